//! `unscatter volume` and what the other commands make of a volume.

mod animation;
mod bad_input;
mod environment;
mod formats;
mod paint;
mod refinement;
mod solving;

use serde_json::{Value, json};

use super::Desk;

/// A blob of mist under a sky and a sun, with something painted on two small views.
pub fn scene() -> Value {
    json!({
        "version": 1,
        "volume": {
            "extinction": { "made": {
                "shapes": [
                    { "sphere": { "center": [0.0, 0.1, 0.0], "radius": 0.5 } },
                    { "capsule": { "from": [-0.5, -0.5, 0.1], "to": [0.4, -0.2, 0.0], "radii": [0.25, 0.15] } }
                ],
                "inside": 4.0, "edge": 0.3, "noise": { "scale": 0.5, "octaves": 3 }
            } },
            "albedo": 0.7,
            "size": [14, 12, 13],
            // Of pictures and of paint alike.
            "interpolation": "nearest",
            "to_world": { "translate": [-1, -1, -1], "scale": 2 }
        },
        "find": "joint",
        "environment": { "radiance": [0.5, 0.6, 0.8], "directions": 16 },
        "lights": [{ "direction": [-1, -1, -0.4], "radiance": 2.0 }],
        "background": 0.05,
        "views": [
            {
                "name": "front", "camera": camera([0.0, 0.0, 4.0]),
                "strokes": [{ "points": [[12, 16], [20, 14]], "radius": 4, "color": "#ff4020" }]
            },
            {
                "name": "side", "camera": camera([4.0, 0.5, 0.0]),
                "strokes": [{ "points": [[16, 12]], "radius": 5, "color": [0.1, 0.4, 1.0] }]
            }
        ],
        "solve": { "iterations": 12, "tolerance": 0.0 }
    })
}

pub fn camera(origin: [f64; 3]) -> Value {
    json!({
        "to_world": { "look_at": { "origin": origin, "target": [0.0, 0.0, 0.0] } },
        "fov": 35, "size": [32, 30]
    })
}

/// The scene with the value at a JSON pointer replaced, or made where there is none.
pub fn scene_with(pointer: &str, value: Value) -> Value {
    super::with(scene(), pointer, value)
}

pub fn desk() -> Desk {
    Desk::with(&scene())
}

/// A desk on which `truth/` holds the pictures of a scene, and `scene.json` asks for them with another start.
pub fn desk_with_targets(truth: &Value, start: impl FnOnce(&mut Value)) -> Desk {
    let desk = Desk::with(truth);
    desk.done(&["render", "scene.json", "-q", "-o", "truth"]);
    let mut scene = truth.clone();
    for view in scene["views"].as_array_mut().unwrap() {
        let name = view["name"].as_str().unwrap().to_owned();
        view["picture"] = json!(format!("truth/{name}.exr"));
        view.as_object_mut().unwrap().remove("strokes");
    }
    start(&mut scene);
    desk.put("scene.json", scene.to_string());
    desk
}
