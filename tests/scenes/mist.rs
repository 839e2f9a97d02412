//! A room in mist, with the light around it as unknowns behind the texels.

use serde_json::Value;
use unscatter::scene::Scene;

/// A roof and a coloured block in mist over a floor, with open air beside them, painted nearly everywhere.
const SCENE: &str = r##"{
    "version": 1, "defaults": "paper",
    "light": {"direction": [0.4, -1, 0.25], "radiance": [3, 2.5, 2]},
    "medium": {"sigma_t": 0.06, "albedo": 0.9, "g": 0.25},
    "ambient": [0.02, 0.03, 0.04],
    "surroundings": SURROUNDINGS,
    "occluders": [
        {"box": {"center": [-0.5, 3.5, 0], "size": [4, 0.3, 3], "albedo": 0.6}},
        {"box": {"center": [1.5, 0.5, 1], "size": [1, 1, 1], "albedo": BLOCK}},
        PANES
        {"plane": {"center": [0, 0, 0], "sides": [[0, 0, 14], [14, 0, 0]], "albedo": 0.5}}
    ],
    "views": [
        {"name": "front", "camera": {"to_world": {"look_at": {"origin": [1, 2.5, 11], "target": [0, 1.8, 0]}}, "fov": 50, "size": [40, 28]},
         "strokes": [{"points": [[4, 4], [36, 6]], "radius": 9, "color": [0.7, 0.5, 0.4]},
                     {"points": [[6, 22], [34, 20]], "radius": 7, "color": [0.4, 0.5, 0.8]}]},
        {"name": "side", "camera": {"to_world": {"look_at": {"origin": [-10, 4, 3], "target": [0, 1.5, 0]}}, "fov": 45, "size": [36, 28]},
         "strokes": [{"points": [[3, 14], [33, 14]], "radius": 12, "color": [0.5, 0.6, 0.5]}]}
    ],
    "light_map": {"size": [23, 19], "basis": "BASIS", "extent": {"min": [-1.7, -1.4], "max": [1.5, 1.6]}},
    "shadow_map": {"size": 512},
    "target": "TARGET",
    "solve": {"iterations": 400, "tolerance": 1e-6, "tikhonov": 1e-6}
}"##;

/// What differs from case to case.
#[derive(Debug, Clone, Copy)]
pub struct Case {
    pub surroundings: &'static str,
    pub basis: &'static str,
    pub target: &'static str,
    pub block: &'static str,
    pub panes: &'static str,
}

/// One on the way of the light, and one before the eye of a view and on the way of the light.
const PANES: &str = r#"
    {"plane": {"center": [2.2, 3.4, 0], "sides": [[0, 0, 3], [1.6, 0, 0]], "transmittance": [0.9, 0.3, 0.1]}},
    {"box": {"center": [-3, 2, 1], "size": [0.1, 2.5, 3], "transmittance": [0.2, 0.5, 0.8]}},"#;
const DISCS: &str = r#"{"sun": true, "environment": {"radiance": [0.1, 0.12, 0.2], "shadow_map": 512,
    "lights": {"count": 9, "over": "upper-hemisphere", "samples": 2}}}"#;
pub const CASES: [Case; 5] = [
    Case { surroundings: DISCS, basis: "bilinear", target: "radiance", block: "[0.8, 0.3, 0.2]", panes: "" },
    Case { surroundings: DISCS, basis: "nearest", target: "tint", block: "0.3", panes: "" },
    Case { surroundings: r#"{"sun": true}"#, basis: "bilinear", target: "tint", block: "0.3", panes: "" },
    Case {
        surroundings: r#"{"environment": {"lights": {"map": [5, 4]}, "shadow_map": 64}}"#,
        basis: "bilinear",
        target: "radiance",
        block: "[0.1, 0.9, 0.2]",
        panes: "",
    },
    Case { surroundings: DISCS, basis: "bilinear", target: "radiance", block: "0.3", panes: PANES },
];

/// The same without anything around it, so that rows are those of light shafts alone.
pub const SHAFTS: Case =
    Case { surroundings: "null", basis: "nearest", target: "tint", block: "0.3", panes: PANES };

pub fn scene_of(case: &Case) -> Scene {
    scaled(case, 1)
}

/// The same with pictures and strokes so many times as wide and high.
pub fn scaled(case: &Case, by: usize) -> Scene {
    let text = SCENE
        .replace("SURROUNDINGS", case.surroundings)
        .replace("BASIS", case.basis)
        .replace("TARGET", case.target)
        .replace("BLOCK", case.block)
        .replace("PANES", case.panes);
    let mut document: Value = serde_json::from_str(&text).unwrap();
    for view in document["views"].as_array_mut().unwrap() {
        multiply(&mut view["camera"]["size"], by);
        for stroke in view["strokes"].as_array_mut().unwrap() {
            multiply(&mut stroke["points"], by);
            multiply(&mut stroke["radius"], by);
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    std::fs::write(&path, document.to_string()).unwrap();
    unscatter::io::scene_file::load(&path, &[]).unwrap()
}

fn multiply(value: &mut Value, by: usize) {
    match value {
        Value::Array(values) => values.iter_mut().for_each(|value| multiply(value, by)),
        number => *number = (number.as_u64().unwrap() * by as u64).into(),
    }
}
