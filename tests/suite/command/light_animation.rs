//! `animate` of light-map scenes: the sun, the cameras and the looks move.

use serde_json::{Value, json};

use super::pictures::exr;
use super::{Desk, camera, scene, with};

/// A transfer function of one colour.
fn color(color: &str) -> Value {
    json!({ "transfer": { "far": 30, "layers": [{ "gradient": { "along": "depth", "from": color, "to": "#ffffff" } }] } })
}

/// The scene with three keys in seven frames: colours of light, then the sun and a camera on their way.
fn moving(light_map: &str) -> Value {
    let mut scene = scene();
    scene["exposure"] = json!(0.5);
    if light_map == "none" {
        scene["views"].as_array_mut().unwrap().iter_mut().for_each(|view| {
            view.as_object_mut().unwrap().remove("strokes");
        });
    }
    scene["animation"] = json!({ "frames": 7, "light_map": light_map, "keys": [
        { "frame": 0, "looks": color("#4060ff") },
        { "frame": 2, "looks": color("#ff6020") },
        {
            "frame": 6,
            "light": { "direction": [-0.4, -1.0, -0.3], "radiance": [6.0, 4.0, 2.0] },
            "views": [{ "name": "left", "camera": camera([-3.0, 2.5, 7.5]) }]
        }
    ] });
    scene
}

fn animated(scene: &Value, more: &[&str]) -> Desk {
    let desk = Desk::with(scene);
    desk.done(&[&["animate", "scene.json", "-q", "-o", "out"], more].concat());
    desk
}

/// The scene of one key of an animation, without it.
fn at_key(scene: &Value, index: usize) -> Value {
    let mut own = scene.clone();
    let key = own.as_object_mut().unwrap().remove("animation").unwrap()["keys"][index].clone();
    for field in ["light", "looks"] {
        if !key[field].is_null() {
            own[field] = key[field].clone();
        }
    }
    for view in key["views"].as_array().into_iter().flatten() {
        let views = own["views"].as_array_mut().unwrap();
        let place = views.iter_mut().find(|other| other["name"] == view["name"]).unwrap();
        for (field, value) in view.as_object().unwrap() {
            place[field] = value.clone();
        }
    }
    own
}

/// Pixels of a frame of a view.
fn frame(desk: &Desk, number: usize, view: &str) -> Vec<[f32; 3]> {
    exr(&desk.path(&format!("out/frame_{number:04}_{view}.exr"))).1
}

/// How far a picture is from the mean of two others, relative to what is brightest in them.
fn from_mean(middle: &[[f32; 3]], from: &[[f32; 3]], to: &[[f32; 3]]) -> f64 {
    let channels = |picture: &[[f32; 3]]| picture.concat().into_iter().map(f64::from).collect::<Vec<_>>();
    let [middle, from, to] = [middle, from, to].map(channels);
    let most = from.iter().chain(&to).copied().fold(0.0, f64::max);
    let apart = |index: usize| (middle[index] - 0.5 * (from[index] + to[index])).abs();
    (0..middle.len()).map(apart).fold(0.0, f64::max) / most
}

#[test]
fn a_key_is_the_picture_of_its_scene_and_a_frame_between_colours_the_mean() {
    let scene = moving("none");
    let desk = animated(&scene, &[]);
    for (index, number) in [(0, 0), (1, 2), (2, 6)] {
        desk.put("key.json", at_key(&scene, index).to_string());
        desk.done(&["render", "key.json", "-q", "-o", "key"]);
        for view in ["left", "right"] {
            for ending in ["exr", "png"] {
                let [own, key] =
                    [format!("out/frame_{number:04}_{view}.{ending}"), format!("key/{view}.{ending}")];
                assert!(desk.read(&own) == desk.read(&key), "{own}");
            }
        }
    }
    for view in ["left", "right"] {
        let [from, middle, to, next] = [0, 1, 2, 3].map(|number| frame(&desk, number, view));
        let apart = from_mean(&middle, &from, &to);
        assert!(apart < 1e-6, "{view}: {apart}");
        assert!(from_mean(&next, &from, &to) > 1e-3, "another frame is noticed");
        assert!(from_mean(&from, &middle, &middle) > 1e-2, "the keys differ");
    }
    let report = desk.json("out/report.json");
    assert_eq!((&report["command"], &report["animation"]["drawn"]), (&json!("animate"), &json!(7)));
    assert_eq!(report["animation"]["light_map"], "none");
    assert_eq!(report["animation"]["keys"].as_array().unwrap().len(), 3);
    let page = String::from_utf8(desk.read("out/report.html")).unwrap();
    assert!(page.contains("(light as it is). Nothing was looked for, in "));
    assert!(page.contains("Frame 4"));
}

#[test]
fn the_far_end_of_depth_is_the_same_at_all_frames() {
    let mut scene = moving("none");
    scene["animation"]["keys"][2]["looks"] = color("#ff6020");
    let given = animated(&scene, &[]);
    let mut fitted = scene.clone();
    for key in fitted["animation"]["keys"].as_array_mut().unwrap() {
        key["looks"]["transfer"].as_object_mut().unwrap().remove("far");
    }
    let fitted = animated(&fitted, &[]);
    for (index, number) in [(0, 0), (1, 2), (2, 6)] {
        given.put("key.json", at_key(&scene, index).to_string());
        given.done(&["render", "key.json", "-q", "-o", "key"]);
        for view in ["left", "right"] {
            let name = format!("out/frame_{number:04}_{view}.exr");
            assert!(given.read(&name) == given.read(&format!("key/{view}.exr")), "{name}");
            assert!(given.read(&name) != fitted.read(&name), "another end is noticed: {name}");
        }
    }
    // One camera moves alone. What the other sees between two keys of one colour, one sun, is always the same.
    for key in scene["animation"]["keys"].as_array_mut().unwrap() {
        key.as_object_mut().unwrap().remove("light");
        key["looks"] = color("#ff6020");
    }
    let still = animated(&scene, &[]);
    let [first, between, last] = [0, 5, 6].map(|number| frame(&still, number, "right"));
    assert!(first == between && between == last);
    let [before, after] = [5, 6].map(|number| frame(&still, number, "left"));
    assert!(before != after);
}

#[test]
fn points_that_a_view_sees_follow_its_camera() {
    let points = |at: Value| {
        let points = json!([at, { "color": "#2040ff", "at": [0.0, 0.0] }]);
        json!({ "transfer": { "far": 30, "size": [32, 32], "layers": [{ "diffusion": { "points": points } }] } })
    };
    let mut scene = moving("none");
    for key in scene["animation"]["keys"].as_array_mut().unwrap() {
        let seen = json!({ "color": "#ffc040", "view": "left", "triangle": 0, "corners": [0.2, 0.3, 0.5] });
        key["looks"] = points(seen);
    }
    let desk = animated(&scene, &[]);
    // The frame in the middle, as a scene of its own: its camera stands half-way, and its sun as well.
    let mut middle = at_key(&scene, 2);
    let (a, b) =
        (glam::DVec3::new(0.3, -1.0, 0.2).normalize(), glam::DVec3::new(-0.4, -1.0, -0.3).normalize());
    middle["light"] = json!({ "direction": (a + b).to_array(), "radiance": [5.0, 4.0, 3.0] });
    middle["animation"] = json!({ "frames": 5, "light_map": "none", "keys": [
        { "frame": 0, "views": [{ "name": "left", "camera": camera([-5.0, 1.5, 7.0]) }] },
        { "frame": 4 },
    ] });
    desk.put("middle.json", middle.to_string());
    desk.done(&["animate", "middle.json", "-q", "-o", "middle", "--frames", "2"]);
    let expected = exr(&desk.path("middle/frame_0002_left.exr")).1;
    let apart = super::pictures::difference(&frame(&desk, 4, "left"), &expected);
    // Directions differ in their last digits, and a ray may pass a texel's edge on the other side.
    assert!(apart < 1e-3, "{apart}");
    let elsewhere = super::pictures::difference(&frame(&desk, 3, "left"), &expected);
    assert!(elsewhere > 1e-2, "another frame is noticed: {elsewhere}");
}

#[test]
fn some_frames_are_those_of_all() {
    let all = animated(&moving("each"), &[]);
    let some = animated(&moving("each"), &["--frames", "3..4"]);
    for number in 0..7 {
        let name = format!("out/frame_{number:04}_left.exr");
        let is_asked = (3..=4).contains(&number);
        assert_eq!(some.path(&name).is_file(), is_asked, "{name}");
        assert!(!is_asked || all.read(&name) == some.read(&name), "{name}");
    }
    assert_eq!(some.json("out/report.json")["animation"]["drawn"], 2);
}

#[test]
#[cfg(unix)]
fn ctrl_c_writes_the_keys_that_there_are_and_resume_goes_on() {
    let desk = Desk::with(&moving("each"));
    let long = ["animate", "scene.json", "-o", "out", "--iterations", "1000000", "--tolerance", "0"];
    super::interrupt::interrupted(&desk, &long, "key_0000_left_after.png");
    let report = desk.json("out/report.json");
    assert_eq!(report["stop"]["reason"], "interrupted");
    let keys = report["animation"]["keys"].as_array().unwrap().len();
    assert!(keys < 3 && desk.path("out/key_0000_checkpoint").is_file(), "{keys} keys");
    let goal = (report["stop"]["iteration"].as_u64().unwrap() + 5).to_string();
    let until = ["--iterations", &goal, "--tolerance", "0"];
    desk.done(&[&["animate", "scene.json", "-q", "-o", "out", "--resume"], &until[..]].concat());
    desk.done(&[&["animate", "scene.json", "-q", "-o", "straight"], &until[..]].concat());
    for number in 0..7 {
        let name = format!("frame_{number:04}_left.exr");
        assert!(desk.read(&format!("out/{name}")) == desk.read(&format!("straight/{name}")), "{name}");
    }
}

#[test]
fn light_maps_of_keys_are_found_and_blended() {
    let scene = moving("each");
    let desk = animated(&scene, &[]);
    let names = desk.names("out");
    for key in ["0000", "0002", "0006"] {
        for name in ["light_map.exr", "light_map.placement.json", "checkpoint", "left_target.png"] {
            assert!(names.contains(&format!("key_{key}_{name}")), "{key}, {name}: {names:?}");
        }
        let [frame, after] = ["frame", "key"].map(|kind| format!("out/{kind}_{key}_left"));
        assert!(desk.read(&format!("{frame}.exr")) == desk.read(&format!("{after}_after.exr")));
        assert!(desk.read(&format!("{frame}.exr")) != desk.read(&format!("{after}_before.exr")));
    }
    let placements =
        ["0000", "0002", "0006"].map(|key| desk.json(&format!("out/key_{key}_light_map.placement.json")));
    for placement in &placements {
        assert_eq!((&placement["min"], &placement["max"]), (&placements[0]["min"], &placements[0]["max"]));
    }
    let report = desk.json("out/report.json");
    assert_eq!(
        (&report["animation"]["light_map"], &report["animation"]["drawn"]),
        (&json!("each"), &json!(7))
    );
    assert_eq!(report["stages"].as_array().unwrap().len(), 3);
    for key in report["animation"]["keys"].as_array().unwrap() {
        let [before, after] =
            ["before", "after"].map(|when| key["weighted_residual"][when].as_f64().unwrap());
        assert!(after < before, "{key}");
    }
    assert!(report["match"].as_array().unwrap().iter().any(|view| view["view"] == "right, frame 6"));

    // Each key is what `light-map` finds at its extent.
    let mut own = at_key(&scene, 1);
    let corner = |of: &str| placements[1][of].clone();
    own["light_map"]["extent"] = json!({ "min": corner("min"), "max": corner("max") });
    let mut given = scene.clone();
    given["light_map"]["extent"] = own["light_map"]["extent"].clone();
    desk.put("own.json", own.to_string());
    desk.put("given.json", given.to_string());
    desk.done(&["light-map", "own.json", "-q", "-o", "own"]);
    desk.done(&["animate", "given.json", "-q", "-o", "given", "--frames", "2"]);
    assert!(desk.read("own/light_map.exr") == desk.read("given/key_0002_light_map.exr"));
    assert!(desk.read("own/left_after.exr") == desk.read("given/frame_0002_left.exr"));
}

#[test]
fn between_keys_of_one_sun_light_maps_are_blended() {
    let mut scene = moving("each");
    let white = json!([{ "points": [[10, 8], [30, 20]], "radius": 4, "color": "#ffffff" }]);
    scene["animation"] = json!({ "frames": 3, "keys": [
        { "frame": 0 }, { "frame": 2, "views": [{ "name": "left", "strokes": white }] }
    ] });
    let desk = animated(&scene, &[]);
    assert_eq!(desk.json("out/report.json")["animation"]["light_map"], "each");
    for view in ["left", "right"] {
        let [from, middle, to] = [0, 1, 2].map(|number| frame(&desk, number, view));
        let apart = from_mean(&middle, &from, &to);
        assert!(apart < 1e-5, "{view}: {apart}");
        assert!(from_mean(&from, &middle, &middle) > 1e-3, "the keys differ");
    }
}

#[test]
fn one_light_map_passes_the_same_part_of_every_light() {
    let mut scene = moving("one");
    scene["animation"]["keys"] = json!([{ "frame": 0 }, { "frame": 6, "light": {
        "direction": [0.3, -1.0, 0.2], "radiance": [2.0, 8.0, 4.0]
    } }]);
    scene["ambient"] = json!(0);
    let desk = animated(&scene, &[]);
    let names = desk.names("out");
    assert!(names.iter().any(|name| name == "key_0000_light_map.exr"));
    assert!(!names.iter().any(|name| name == "key_0006_light_map.exr"));
    let [first, last] = [0, 6].map(|number| frame(&desk, number, "left"));
    let most = last.iter().flatten().copied().fold(0.0, f32::max);
    for (a, b) in first.iter().zip(&last) {
        for (c, factor) in [0.5, 2.0, 1.0].into_iter().enumerate() {
            assert!((b[c] - factor * a[c]).abs() < 1e-5 * most, "{a:?} and {b:?}");
        }
    }
    let report = desk.json("out/report.json");
    assert_eq!((&report["animation"]["light_map"], &report["stages"][1]), (&json!("one"), &Value::Null));
}

#[test]
fn one_light_map_is_found_behind_the_paint_of_all_keys() {
    let paint =
        |color: &str, x: i32| json!([{ "points": [[x, 8], [x + 4, 30]], "radius": 4, "color": color }]);
    let mut scene = moving("one");
    scene["animation"]["keys"] = json!([
        { "frame": 0, "views": [{ "name": "left", "strokes": paint("#ff8040", 12) }, { "name": "right", "strokes": [] }] },
        {
            "frame": 6,
            "light": { "direction": [-0.1, -1.0, -0.2], "radiance": [4.0, 4.0, 4.0] },
            "views": [{ "name": "left", "strokes": [] }, { "name": "right", "strokes": paint("#40a0ff", 30) }]
        }
    ]);
    let matched = |scene: &Value| {
        let report = animated(scene, &[]).json("out/report.json");
        let views = report["match"].as_array().unwrap().clone();
        let of = |name: &str| {
            let view = views.iter().find(|view| view["view"] == name);
            view.map(|view| view["weighted_residual"]["after"].as_f64().unwrap())
        };
        ["left, frame 0", "right, frame 6"].map(of)
    };
    let both = matched(&scene);
    assert!(both.iter().all(|residual| residual.is_some_and(|residual| residual < 0.5)), "{both:?}");
    // Without the paint of the last key nobody asks for it.
    scene["animation"]["keys"][1]["views"][1]["strokes"] = json!([]);
    let first = matched(&scene);
    assert!(first[1].is_none() && first[0].unwrap() <= both[0].unwrap() + 0.05, "{first:?}, {both:?}");
}

#[test]
fn an_animation_comes_out_again() {
    for light_map in ["none", "each"] {
        let mut scene = moving(light_map);
        scene["exposure"] = json!("auto");
        let desk = animated(&scene, &[]);
        std::fs::rename(desk.path("out"), desk.path("first")).unwrap();
        desk.done(&["animate", "first/scene.resolved.json", "-q", "-o", "out"]);
        for name in desk.names("first").iter().filter(|name| name.starts_with("frame_")) {
            assert!(desk.read(&format!("first/{name}")) == desk.read(&format!("out/{name}")), "{name}");
        }
        assert_eq!(desk.json("first/scene.resolved.json"), desk.json("out/scene.resolved.json"));
    }
}

#[test]
fn bad_animations_are_named() {
    let keys = |keys: Value| with(moving("none"), "/animation/keys", keys);
    let key = |frame: usize| json!({ "frame": frame });
    let last = |field: &str, value: Value| with(moving("none"), &format!("/animation/keys/2/{field}"), value);
    let view = |camera: Value| last("views", json!([{ "name": "left", "camera": camera }]));
    let resized = with(camera([0.0, 1.0, 7.0]), "/size", json!([32, 18]));
    let fisheye =
        json!({ "to_world": {}, "size": [64, 36], "lens": { "focal_length": [40, 40], "fisheye": true } });
    let unpainted = with(moving("none"), "/animation/light_map", json!("each"));
    let table: [(Value, [&str; 2]); 14] = [
        (
            keys(json!([key(3), key(1)])),
            ["animation.keys[1].frame", "above 3, the frame of the key before it"],
        ),
        (keys(json!([key(2), key(2)])), ["animation.keys[1].frame", "above 2"]),
        (keys(json!([key(1)])), ["animation.keys", "at least two are needed"]),
        (keys(json!([key(0), key(7)])), ["animation.keys[1].frame", "below 7, the number of frames"]),
        (with(moving("none"), "/animation/frames", json!(1)), ["animation.frames", "from 2 to 10000"]),
        (with(moving("none"), "/animation/light_map", json!("many")), ["animation.light_map", "each"]),
        (last("views", json!([{ "name": "top" }])), ["keys[2].views[0].name", "a view of the scene"]),
        (
            last("views", json!([{ "name": "left" }, { "name": "left" }])),
            ["keys[2].views[1].name", "another view"],
        ),
        (view(resized), ["keys[2].views[0].camera.size", "[64, 36], the size of the view at all frames"]),
        (view(fisheye), ["keys[2].views[0].camera.lens", "same kind as at the key before it"]),
        (
            last("light", json!({ "direction": [-0.3, 1.0, -0.2] })),
            ["keys[2].light.direction", "less than half a turn"],
        ),
        (
            last("looks", json!({ "transfer": { "layers": [] } })),
            ["keys[2].looks.transfer.layers", "no layer"],
        ),
        (unpainted, ["animation.keys[0]", "nothing is painted at this key"]),
        (
            with(moving("each"), "/surroundings", json!({ "sun": true })),
            ["surroundings", "an animation looks for light maps alone"],
        ),
    ];
    for (scene, words) in table {
        let desk = Desk::with(&scene);
        let ran = desk.run(&["animate", "scene.json", "-o", "out"]).exits_with(1);
        words.iter().for_each(|words| assert!(ran.told().contains(words), "{words}: {}", ran.told()));
        assert!(desk.names("out").is_empty());
    }
}

#[test]
fn other_commands_look_at_the_keys() {
    let desk = Desk::with(&moving("each"));
    desk.run(&["light-map", "scene.json", "-o", "out"]).exits_with(1).tells("`unscatter animate`");
    for flag in [&["--find", "joint"][..], &["--volumes"], &["--format", "npy"]] {
        desk.run(&[&["animate", "scene.json", "-o", "out"], flag].concat())
            .exits_with(1)
            .tells("it is about volumes");
    }
    desk.run(&["animate", "scene.json", "-o", "out", "--frames", "3..9"])
        .exits_with(1)
        .tells("within the frames of the animation");
    let scenes = |plans: Value| -> Vec<String> {
        plans.as_array().unwrap().iter().map(|plan| plan["scene"].as_str().unwrap().to_owned()).collect()
    };
    let plans = desk.done(&["plan", "scene.json", "--json"]).json();
    assert_eq!(scenes(plans), ["scene, frame 0", "scene, frame 2", "scene, frame 6"]);
    assert!(desk.done(&["check", "scene.json"]).out.contains("scene, frame 6, light map"));
    desk.done(&["render", "scene.json", "-q", "-o", "out"]);
    let names = desk.names("out");
    assert!(
        ["frame_0000_left.png", "frame_0006_right.exr"].iter().all(|name| names.iter().any(|n| n == name))
    );
    let set = ["--set", "animation.light_map=none"];
    let plans = desk.done(&[&["plan", "scene.json", "--json"], &set[..]].concat()).json();
    assert_eq!(plans, json!([]));
}
