use serde_json::{Value, json};

use unscatter::scene::Image;

use super::{Desk, scene, scene_with};

/// The scene with a small light map, and what is looked for around it.
fn around(surroundings: Value) -> Value {
    let mut scene = scene_with("/light_map/extent", json!({ "min": [-1.5, -1.5], "max": [1.5, 1.5] }));
    scene["surroundings"] = surroundings;
    scene
}

fn both() -> Value {
    let lights = json!({ "count": 6, "over": "upper-hemisphere" });
    around(json!({ "sun": true, "environment": { "radiance": 0.2, "lights": lights, "shadow_map": 32 } }))
}

#[test]
fn sun_and_environment_are_found_with_the_light_map() {
    let desk = Desk::with(&both());
    let ran = desk.done(&["light-map", "scene.json", "-o", "out"]);
    assert!(ran.out.contains("around the light map: the sun's radiance"), "{}", ran.out);
    let report = desk.json("out/report.json");
    assert_eq!(report["problem"]["unknowns"], 32 * 32 + 7);
    assert_eq!(report["coverage"]["total"], 32 * 32);
    assert_eq!(report["surroundings"]["lights"], json!({ "count": 6, "of": 6 }));
    assert_eq!(report["surroundings"]["sun"]["before"], json!([4.0, 4.0, 4.0]));
    assert_ne!(report["surroundings"]["sun"]["after"], json!([4.0, 4.0, 4.0]));
    let residual = |report: &Value, when: &str| report["weighted_residual"][when].as_f64().unwrap();
    assert!(residual(&report, "after") < residual(&report, "before"));
    let page = String::from_utf8(desk.read("out/report.html")).unwrap();
    assert!(page.contains("The light around it") && page.contains("Around the light map"));
    let list = desk.json("out/environment.json");
    assert_eq!(list["lights"].as_array().unwrap().len(), 6);
    assert_eq!(list["sun"], report["surroundings"]["sun"]["after"]);
    for name in ["environment.exr", "environment.hdr", "environment.png", "light_map.exr"] {
        assert!(desk.names("out").iter().any(|other| other == name), "{name}");
    }
    // What was found is what another run starts from, and what is drawn.
    let set = ["--set", "surroundings.environment.file=out/environment.exr"];
    let set = [&set[..], &["--set", "surroundings.environment.radiance=1"]].concat();
    let map = ["render", "scene.json", "-q", "-o", "drawn", "--light-map", "out/light_map.exr"];
    desk.done(&[&map[..], &set].concat());
    desk.done(&["render", "scene.json", "-q", "-o", "plain", "--light-map", "out/light_map.exr"]);
    assert_ne!(desk.read("drawn/left.exr"), desk.read("plain/left.exr"));
}

#[test]
fn every_command_knows_the_surroundings() {
    let desk = Desk::with(&both());
    let verdicts = desk.done(&["check", "scene.json", "--json", "-q"]).json();
    assert!(verdicts.as_array().unwrap().iter().all(|verdict| verdict["holds"] == true));
    let plan = desk.done(&["plan", "scene.json", "--json", "-q"]).json();
    assert_eq!(plan["surrounding_unknowns"], 7);
    assert!(plan["prepared_bytes"].as_u64().unwrap() > 0);
    desk.done(&["matrix", "scene.json", "-q", "-o", "matrix"]).exits_with(0);
    desk.done(&["light-map", "scene.json", "-q", "-o", "out", "--iterations", "4"]);
    let go_on = ["light-map", "scene.json", "-q", "-o", "out", "--resume"];
    desk.done(&go_on);
    desk.done(&["light-map", "scene.json", "-q", "-o", "once"]);
    for name in ["light_map.exr", "environment.exr"] {
        assert_eq!(desk.read(&format!("out/{name}")), desk.read(&format!("once/{name}")), "{name}");
    }
    let brighter = ["--set", "surroundings.environment.radiance=0.3"];
    desk.run(&[&go_on[..], &brighter].concat()).exits_with(1).tells("does not continue this solve");
}

#[test]
fn bad_surroundings_are_named() {
    let lights = |value: Value| around(json!({ "environment": { "lights": value } }));
    // Smoke that only absorbs over a floor, and lights below it.
    let mut below = lights(json!({ "count": 4, "over": "upper-hemisphere", "up": [0, -1, 0] }));
    below["medium"]["albedo"] = json!(0);
    let sides = json!([[4000, 0, 0], [0, 0, 4000]]);
    below["occluders"] = json!([{ "plane": { "center": [0, -1, 0], "sides": sides } }]);
    let mut everywhere = scene();
    everywhere["light_map"]["extent"] = json!({ "min": [-1e6, -1e6], "max": [1e6, 1e6] });
    everywhere["surroundings"] = json!({ "sun": true });
    let table: [(Value, &str); 11] = [
        (around(json!({})), "nothing is looked for"),
        (around(json!({ "son": true })), "sun"),
        (lights(json!({ "count": 0 })), "from 1 to 4096 lights"),
        (lights(json!({ "count": 1_000_000_000 })), "from 1 to 4096 lights"),
        (lights(json!({ "map": [8, 4], "count": 9 })), "only discs have this"),
        (lights(json!({ "up": [0, 1, 0] })), "only a hemisphere has an up"),
        (lights(json!({ "gradient": 0.1 })), "only lights around a volume pull"),
        (around(json!({ "environment": { "shadow_map": 4 } })), "from 16 to 2048"),
        (around(json!({ "environment": { "radiance": -1 } })), "radiance"),
        (below, "none of the 4 lights of surroundings.environment reaches"),
        (everywhere, "any of the sun from outside the light map"),
    ];
    for (scene, words) in table {
        let desk = Desk::with(&scene);
        desk.run(&["light-map", "scene.json", "-o", "out"]).exits_with(1).tells(words);
        assert!(desk.names("out").is_empty());
    }
    let many = json!({ "environment": { "lights": { "count": 4096, "samples": 64 }, "shadow_map": 2048 } });
    let desk = Desk::with(&around(many));
    desk.run(&["plan", "scene.json"]).exits_with(1).tells("raise --memory");
    // Negative, and infinite by the factor.
    for (value, factor) in [(-2.0, 1.0), (1e38, 1e10)] {
        let desk = Desk::with(&around(json!({ "environment": { "file": "sky.exr", "radiance": factor } })));
        let mut sky = Image::constant([8, 4], [1.0; 3]);
        sky.pixels[9] = [1.0, value, 1.0];
        unscatter::io::image::write_exr(&desk.path("sky.exr"), &sky).unwrap();
        desk.run(&["light-map", "scene.json", "-o", "out"]).exits_with(1).tells("at pixel (1, 1)");
    }
}
