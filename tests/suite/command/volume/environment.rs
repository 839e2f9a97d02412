use serde_json::{Value, json};

use unscatter::scene::Image;

use super::{desk_with_targets, scene_with};
use crate::command::{Desk, with as replaced};

fn lights(desk: &Desk, file: &str) -> Vec<[f64; 3]> {
    let list = desk.json(file);
    let lights = list["lights"].as_array().unwrap();
    lights.iter().map(|light| serde_json::from_value(light["radiance"].clone()).unwrap()).collect()
}

fn of_environment() -> Value {
    let mut truth = scene_with("/find", json!("environment"));
    truth["environment"] = json!({ "radiance": [0.9, 0.6, 0.2], "lights": { "count": 12 } });
    truth["solve"] = json!({ "iterations": 200, "tolerance": 1e-6, "tikhonov": 0 });
    truth
}

#[test]
fn the_light_is_found_and_can_be_the_start_of_another_solve() {
    let desk = desk_with_targets(&of_environment(), |scene| {
        scene["environment"] = json!({ "radiance": 0.1, "lights": { "map": [6, 3] } });
    });
    desk.done(&["volume", "scene.json", "-q", "-o", "out", "--turntable", "0"]);
    let report = desk.json("out/report.json");
    assert_eq!(report["problem"]["unknowns"], 18);
    let after = report["weighted_residual"]["after"].as_f64().unwrap();
    assert!(after < 0.01, "{after}");
    let page = String::from_utf8(desk.read("out/report.html")).unwrap();
    assert!(
        page.contains("The light around it") && page.contains("Lights reached") && !page.contains("oxels")
    );
    assert!(desk.names("out").iter().any(|name| name == "environment.png"));
    for file in ["environment.exr", "environment.hdr"] {
        // A map is written as it is, so that it starts where it ended; a radiance beside a file is a factor.
        let start = format!("environment.file=out/{file}");
        let whole = "environment.radiance=1";
        let turntable = ["--turntable", "0"];
        let set = ["--set", &start, "--set", whole];
        desk.done(&[&["volume", "scene.json", "-q", "-o", "again"][..], &turntable, &set].concat());
        let again = desk.json("again/report.json");
        let before = again["weighted_residual"]["before"].as_f64().unwrap();
        assert!(before < after + 0.01, "{file}: {before} and {after}");
    }
    let found = lights(&desk, "out/environment.json");
    assert!(found.len() == 18 && found.iter().flatten().all(|&value| value >= 0.0));
}

#[test]
fn rounds_never_come_farther_away_and_beat_either_alone() {
    let with = |find: &str, rounds: usize| {
        let mut scene = scene_with("/find", json!(find));
        scene["environment"]["lights"] = json!({ "count": 20, "over": "upper-hemisphere" });
        scene["rounds"] = json!(rounds);
        let desk = Desk::with(&scene);
        desk.done(&["volume", "scene.json", "-q", "-o", "out", "--turntable", "0"]);
        desk.json("out/report.json")
    };
    let after = |report: &Value| report["weighted_residual"]["after"].as_f64().unwrap();
    let alone = ["environment", "joint"].map(|find| after(&with(find, 1)));
    let staged = after(&with("environment-then-joint", 1));
    assert!(alone.iter().all(|alone| staged < *alone), "{staged} after {alone:?}");
    let rounds = with("environment-then-joint", 4);
    let mut last = f64::INFINITY;
    let stages = rounds["stages"].as_array().unwrap();
    assert!(stages.len() > 2 && stages.len() % 2 == 0);
    for stage in stages {
        let [before, after] =
            ["before", "after"].map(|when| stage["weighted_residual"][when].as_f64().unwrap());
        assert!(before <= last && after <= before, "{stage}");
        last = after;
    }
    assert!(after(&rounds) < staged);
}

#[test]
fn bad_lights_are_named() {
    let lights = |value: Value| {
        let mut scene = scene_with("/find", json!("environment"));
        scene["environment"]["lights"] = value;
        scene
    };
    let with = |pointer: &str, value: Value| replaced(of_environment(), pointer, value);
    // A floor without reflectance, and lights below it.
    let mut below = lights(json!({ "over": "upper-hemisphere", "up": [0, -1, 0] }));
    let sides = [[0, 0, 4000], [4000, 0, 0]];
    below["occluders"] = json!([{ "plane": { "center": [0, -1.1, 0], "sides": sides, "albedo": 0 } }]);
    let table: [(Value, &str); 13] = [
        (below, "none of the 128 lights reaches"),
        (lights(json!({ "count": 0 })), "from 1 to 4096 lights"),
        (lights(json!({ "count": 5000 })), "from 1 to 4096 lights"),
        (lights(json!({ "map": [0, 4] })), "from 1 to 4096 pixels"),
        (lights(json!({ "map": [8, 4], "count": 9 })), "only discs have this"),
        (lights(json!({ "softness": 2 })), "from 0 (hard) to 1"),
        (lights(json!({ "samples": 0 })), "from 1 to 64 directions"),
        (lights(json!({ "up": [0, 1, 0] })), "only a hemisphere has an up"),
        (lights(json!({ "over": "upper-hemisphere", "up": [0, 0, 0] })), "a direction"),
        (with("/rounds", json!(3)), "looked for in turn"),
        (with("/rounds", json!(0)), "from 1 to 100"),
        (with("/volume/g", json!(0.5)), "0 where there is environment light"),
        (with("/bounds", json!({ "environment": { "lower": -1 } })), "not negative"),
    ];
    for (scene, words) in table {
        let desk = Desk::with(&scene);
        let ran = desk.run(&["volume", "scene.json", "-o", "out"]).exits_with(1);
        ran.tells(words);
        assert!(desk.names("out").is_empty());
    }
    let desk = Desk::with(&with("/environment", json!({ "file": "sky.exr" })));
    let mut sky = Image::constant([8, 4], [1.0; 3]);
    sky.pixels[9] = [1.0, -2.0, 1.0];
    unscatter::io::image::write_exr(&desk.path("sky.exr"), &sky).unwrap();
    let ran = desk.run(&["volume", "scene.json", "-o", "out"]).exits_with(1);
    ran.tells("at pixel (1, 1)");
}
