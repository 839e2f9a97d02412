//! Every command but `light-map` and `matrix`, and the wrong use of all of them.

use std::fs;

use serde_json::{Value, json};
use unscatter::io::scene_file::{SceneFile, Subject};

use super::pictures::{difference, exr, png_size};
use super::{Desk, scene_with};
use crate::tolerances::SAME_SOLUTION;

#[test]
fn render_draws_the_views_and_names_what_it_wrote() {
    let desk = Desk::new();
    let ran = desk.done(&["render", "scene.json", "-o", "views"]);
    assert_eq!(desk.names("views"), ["left.exr", "left.png", "right.exr", "right.png"]);
    assert_eq!(ran.out.lines().collect::<Vec<_>>(), ["views/left.png", "views/right.png"]);
    let written = desk.done(&["render", "scene.json", "-o", "views", "--json"]).json();
    assert_eq!(written, json!(["views/left.png", "views/right.png"]));
    let (size, pixels) = exr(&desk.path("views/left.exr"));
    assert_eq!((size, png_size(&desk.path("views/left.png"))), ([64, 36], [64, 36]));
    assert!(pixels.iter().flatten().all(|&value| value.is_finite() && value >= 0.0));
}

#[test]
fn render_with_the_solved_light_map_is_the_picture_after() {
    let desk = Desk::new();
    desk.done(&["light-map", "scene.json", "-o", "out"]);
    desk.done(&["render", "scene.json", "-o", "views", "--light-map", "out/light_map.exr"]);
    desk.done(&["render", "scene.json", "-o", "plain"]);
    for view in ["left", "right"] {
        let picture = |name: String| exr(&desk.path(&name)).1;
        let after = picture(format!("out/{view}_after.exr"));
        assert!(difference(&picture(format!("views/{view}.exr")), &after) < SAME_SOLUTION);
        assert!(difference(&picture(format!("plain/{view}.exr")), &after) > 0.01);
        assert_eq!(picture(format!("plain/{view}.exr")), picture(format!("out/{view}_before.exr")));
    }
}

/// A light map lies where its solve has put it, whatever the scene says now.
#[test]
fn render_puts_a_light_map_where_its_solve_had_it() {
    let desk = Desk::new();
    desk.done(&["light-map", "scene.json", "-o", "out"]);
    let render = |folder: &str| {
        let moved = r#"light_map.extent={"min": [-3, -3], "max": [3, 3]}"#;
        let light_map = ["--light-map", "out/light_map.exr", "--set", moved];
        desk.run(&[&["render", "scene.json", "-o", folder], &light_map[..]].concat())
    };
    let png = ["render", "scene.json", "-o", "png", "--light-map", "out/light_map.png"];
    desk.run(&png).exits_with(1).tells("is no radiance");
    render("views").exits_with(0);
    let picture = |name: &str| exr(&desk.path(name)).1;
    assert!(difference(&picture("views/left.exr"), &picture("out/left_after.exr")) < SAME_SOLUTION);
    let written = fs::read(desk.path("out/light_map.placement.json")).unwrap();
    for damage in [
        &b""[..],
        b"{}",
        b"\xff",
        br#"{"size": [32, 32], "min": [0, 0], "max": [0, 1], "u": [1,0,0], "v": [0,1,0], "w": [0,0,1]}"#,
    ] {
        desk.put("out/light_map.placement.json", damage);
        render("damaged").exits_with(1).tells("light_map.placement.json");
    }
    assert!(desk.names("damaged").is_empty());
    desk.put("out/light_map.placement.json", &written);
    let turned = ["--set", "light.direction=[-0.3,-1,0.2]"];
    let turned = [&["render", "scene.json", "-o", "turned", "--light-map", "out/light_map.exr"], &turned[..]];
    desk.run(&turned.concat()).exits_with(1).tells("another direction");
    let of_another_size = String::from_utf8(written).unwrap().replacen("32", "16", 1);
    desk.put("out/light_map.placement.json", of_another_size.as_bytes());
    render("damaged").exits_with(1).tells("the light map has 32 × 32");
    fs::remove_file(desk.path("out/light_map.placement.json")).unwrap();
    render("elsewhere").exits_with(0);
    assert!(
        difference(&picture("elsewhere/left.exr"), &picture("out/left_after.exr")) > 10.0 * SAME_SOLUTION
    );
}

#[test]
fn render_takes_a_scene_without_paint() {
    let mut scene = scene_with("/views/0/strokes", json!([]));
    scene["views"][1]["strokes"] = json!([]);
    Desk::with(&scene).done(&["render", "scene.json", "-o", "views"]);
}

#[test]
fn exposure_brightens_png_and_not_exr() {
    let desk = Desk::new();
    desk.done(&["render", "scene.json", "-o", "plain"]);
    desk.done(&["render", "scene.json", "-o", "bright", "--set", "exposure=1"]);
    assert_eq!(desk.read("plain/left.exr"), desk.read("bright/left.exr"));
    assert_ne!(desk.read("plain/left.png"), desk.read("bright/left.png"));
}

#[test]
fn plan_foresees_what_the_solve_finds() {
    let desk = Desk::new();
    let plan = desk.done(&["plan", "scene.json", "--json"]).json();
    let report = desk.done(&["light-map", "scene.json", "-o", "out", "--json"]).json();
    assert_eq!(plan["rows"], report["problem"]["rows"]);
    assert_eq!(plan["unknowns"], report["problem"]["unknowns"]);
    let nonzeros = [&plan["nonzeros"], &report["problem"]["nonzeros"]].map(|n| n.as_f64().unwrap());
    assert!((nonzeros[0] / nonzeros[1] - 1.0).abs() < 0.1, "{nonzeros:?}");
    assert_eq!((&plan["strategy"], &plan["iterations"]), (&json!("assembled"), &json!(12)));
    let free = desk.done(&["plan", "scene.json", "--json", "--set", "solve.strategy=matrix-free"]).json();
    assert_eq!(free["strategy"], "matrix-free");
    let words = desk.done(&["plan", "scene.json"]);
    for word in ["rows", "unknowns", "non-zeros", "matrix", "strategy", "time"] {
        assert!(words.out.contains(word), "{word}");
    }
    assert!(!desk.path("out/scene").exists() && desk.names(".") == ["scene.json"], "plan writes nothing");
}

#[test]
fn check_holds_every_law_for_every_kind_of_scene() {
    let desk = Desk::new();
    for set in [
        "version=1",
        "light_map.basis=nearest",
        "medium.sigma_t=[0.08, 0.3, 0.0001]",
        r#"solve.quadrature={"march": {"steps": 33}}"#,
        "target=radiance",
        "occluders=[]",
        "light.direction=[0, -1, 0]",
        "medium.g=-0.9",
        "medium.sigma_t=30",
    ] {
        let verdicts = desk.done(&["check", "scene.json", "--json", "--set", set]).json();
        let verdicts = verdicts.as_array().unwrap();
        assert!(verdicts.len() >= 8);
        for verdict in verdicts {
            assert_eq!(verdict["holds"], true, "{set}: {verdict}");
            assert!(verdict["error"].as_f64().unwrap() <= verdict["bound"].as_f64().unwrap());
        }
        let laws: Vec<&str> = verdicts.iter().map(|verdict| verdict["law"].as_str().unwrap()).collect();
        for law in ["adjoint", "T x against the explicit matrix", "gradient by finite differences"] {
            assert!(laws.contains(&law), "{law}");
        }
    }
    let words = desk.done(&["check", "scene.json"]).out;
    assert!(words.contains("holds") && !words.contains("BROKEN"), "{words}");
}

#[test]
fn doctor_describes_the_machine() {
    let desk = Desk::new();
    let doctor = desk.done(&["doctor", "--json", "--threads", "2"]).json();
    assert_eq!((&doctor["backend"], &doctor["threads"]), (&json!("cpu"), &json!(2)));
    assert_eq!(doctor["adapters"], json!([]));
    assert!(doctor["memory_budget"].as_u64().unwrap() > 0);
    assert!(desk.done(&["doctor"]).out.contains(env!("CARGO_PKG_VERSION")));
}

#[test]
fn schema_is_json_that_knows_every_field() {
    let schema = Desk::new().done(&["schema"]).json();
    assert_eq!(schema["type"], "object");
    assert_eq!(schema["additionalProperties"], false);
    let properties = schema["properties"].as_object().unwrap();
    for field in super::scene().as_object().unwrap().keys() {
        assert!(properties.contains_key(field), "{field}");
    }
    let text = schema.to_string();
    for name in ["sigma_t", "albedo", "to_world", "fov_axis", "look_at", "hardness", "matrix-free"] {
        assert!(text.contains(&format!("\"{name}\"")), "{name}");
    }
    assert_no_dangling_reference(&schema, &schema);
}

fn assert_no_dangling_reference(schema: &Value, part: &Value) {
    match part {
        Value::Object(object) => {
            if let Some(Value::String(reference)) = object.get("$ref") {
                let pointer = reference.strip_prefix('#').unwrap();
                assert!(schema.pointer(pointer).is_some(), "{reference} leads nowhere");
            }
            object.values().for_each(|part| assert_no_dangling_reference(schema, part));
        }
        Value::Array(parts) => parts.iter().for_each(|part| assert_no_dangling_reference(schema, part)),
        _ => {}
    }
}

#[test]
fn the_scenes_in_strokes_can_be_planned() {
    let folder = crate::root().join("strokes");
    let desk = Desk::new();
    for entry in fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|ending| ending == "json") {
            // Small grids: this is about whether the files are understood, not about their size.
            let small = match SceneFile::read(&path).unwrap().subject() {
                Subject::LightMap | Subject::LightAnimation => {
                    ["--set", "shadow_map.size=64", "--set", "light_map.size=32"]
                }
                Subject::Volume | Subject::Animation => ["--set", "volume.size=16", "--set", "light_size=8"],
            };
            desk.done(&[&["plan", path.to_str().unwrap(), "--json"], &small[..]].concat()).json();
        }
    }
}

#[test]
fn completions_are_made_for_every_shell() {
    let desk = Desk::new();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        assert!(desk.done(&["completions", shell]).out.contains("light-map"), "{shell}");
    }
}

#[test]
fn help_and_version_are_given() {
    let desk = Desk::new();
    let help = desk.done(&["--help"]).out;
    for command in
        ["light-map", "animate", "render", "plan", "check", "matrix", "doctor", "schema", "completions"]
    {
        assert!(help.contains(command), "{command}");
        desk.done(&[command, "--help"]);
    }
    assert!(desk.done(&["--version"]).out.contains(env!("CARGO_PKG_VERSION")));
}

#[test]
fn wrong_usage_exits_with_2_and_writes_nothing() {
    let desk = Desk::new();
    for arguments in [
        &[][..],
        &["frobnicate"],
        &["light-map"],
        &["light-map", "scene.json", "extra"],
        &["light-map", "scene.json", "--no-such-flag"],
        &["light-map", "scene.json", "--iterations", "many"],
        &["light-map", "scene.json", "--iterations", "-1"],
        &["light-map", "scene.json", "--tolerance", "small"],
        &["light-map", "scene.json", "--preview-every", "0"],
        &["light-map", "scene.json", "--threads", "0"],
        &["light-map", "scene.json", "--backend", "abacus"],
        &["light-map", "scene.json", "-o"],
        &["completions", "tcsh"],
        &["render"],
    ] {
        let ran = desk.run(arguments).exits_with(2);
        assert!(ran.out.is_empty() && !ran.err.is_empty(), "{arguments:?}");
    }
    assert_eq!(desk.names("."), ["scene.json"]);
    assert!(!desk.path("out").exists());
}
