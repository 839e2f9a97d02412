//! What a person should know: every kind of warning has a scene that gives reason for it, and a healthy scene has none.

use serde_json::{Value, json};

use super::Desk;

/// A hall with a slit in its roof, and paint on the shaft under it.
fn hall() -> Value {
    json!({
        "version": 1,
        "light": { "direction": [0.45, -1.0, -0.1], "radiance": 4.0 },
        "medium": { "sigma_t": 0.08, "g": 0.3 },
        "occluders": [
            { "box": { "center": [0, -0.1, 0], "size": [60, 0.2, 60] } },
            { "box": { "center": [0, 3, -10], "size": [60, 6, 0.2] } },
            { "box": { "center": [-31, 6, 0], "size": [60, 0.2, 60] } },
            { "box": { "center": [30, 6, 0], "size": [60, 0.2, 60] } }
        ],
        "views": [{
            "name": "hall",
            "camera": { "fov": 55, "size": [120, 80],
                "to_world": { "look_at": { "origin": [1.5, 1.7, 9.5], "target": [0.5, 2.6, 0] } } },
            "strokes": [{ "points": [[65.5, 41], [71, 51]], "radius": 4, "color": "#ff8020" }]
        }],
        "light_map": { "size": 96 },
        "shadow_map": { "size": 512 }
    })
}

/// A room with a slit in its roof, into which no other light comes, and paint on the shaft under it.
fn room() -> Value {
    let slab = |center: [f64; 3], size: [f64; 3]| json!({ "box": { "center": center, "size": size } });
    json!({
        "version": 1,
        "light": { "direction": [0.1, -1, 0], "radiance": 5.0 },
        "medium": { "sigma_t": 0.1 },
        "occluders": [
            slab([0.0, -0.1, 0.0], [10.0, 0.2, 10.0]),
            slab([0.0, 1.8, -5.0], [10.2, 4.0, 0.2]),
            slab([0.0, 1.8, 5.0], [10.2, 4.0, 0.2]),
            slab([-5.0, 1.8, 0.0], [0.2, 4.0, 10.2]),
            slab([5.0, 1.8, 0.0], [0.2, 4.0, 10.2]),
            slab([-1.5, 3.8, 0.0], [7.2, 0.2, 10.2]),
            slab([3.8, 3.8, 0.0], [2.6, 0.2, 10.2])
        ],
        "views": [{
            "name": "hall",
            "camera": { "fov": 50, "size": [120, 80],
                "to_world": { "look_at": { "origin": [0, 1.7, 4.5], "target": [0, 1.7, 0] } } },
            "strokes": [{ "points": [[86, 34], [88, 50]], "radius": 4, "color": "#ff8020" }]
        }],
        "light_map": { "size": 96 },
        "shadow_map": { "size": 512 }
    })
}

/// The codes of the warnings of a run, in their order; what is told in the terminal and what the page says is the same.
fn warned(desk: &Desk, more: &[&str]) -> Vec<String> {
    let ran = desk.done(&[&["light-map", "hall.json", "-o", "out"], more].concat());
    let report = desk.json("out/report.json");
    let page = String::from_utf8(desk.read("out/report.html")).unwrap();
    let warnings = report["warnings"].as_array().unwrap();
    for warning in warnings {
        let [code, text, remedy] = ["code", "text", "remedy"].map(|field| warning[field].as_str().unwrap());
        let first = text.split_whitespace().take(5).collect::<Vec<_>>().join(" ");
        assert!(ran.told().contains(&first), "`{first}` is not told: {}", ran.err);
        assert!(page.contains(&format!("<li id=\"{code}\">")), "{code} is not on the page");
        assert!(!text.ends_with('.') && !remedy.ends_with('.'), "{text}; {remedy}");
    }
    assert_eq!(ran.err.matches("warning: ").count(), warnings.len(), "{}", ran.err);
    assert_eq!(page.contains("<ul class=\"warnings\">"), !warnings.is_empty());
    warnings.iter().map(|warning| warning["code"].as_str().unwrap().to_owned()).collect()
}

fn desk(scene: &Value) -> Desk {
    let desk = Desk::new();
    desk.put("hall.json", scene.to_string());
    desk
}

#[test]
fn a_healthy_scene_has_none() {
    assert_eq!(warned(&desk(&hall()), &[]), [""; 0]);
}

#[test]
fn every_setting_that_gives_reason_for_one_is_told_of() {
    let desk = desk(&hall());
    let table: &[(&[&str], &str)] = &[
        (&["medium.sigma_t=3"], "fog-out-of-range"),
        (&["medium.sigma_t=1e-4"], "fog-out-of-range"),
        (&[r#"light_map.extent={"min": [-0.3, -4], "max": [0.3, 3]}"#], "light-from-outside"),
        (&["views[0].strokes[0].color=[3, 2, 1]", "light_map.gobo=false"], "brightest-texel"),
        (&["views[0].strokes[0].color=[1.4, 1.2, 0.6]"], "bounds-bind"),
        (&["views[0].strokes[0].color=[3, 2, 1]"], "out-of-reach"),
        (&["solve.tikhonov=50"], "pull-outweighs-data"),
        (&["solve.solver=spectral", "solve.tolerance=1e-12", "solve.iterations=200"], "iteration-limit"),
    ];
    for (set, code) in table {
        let more: Vec<&str> = set.iter().flat_map(|set| ["--set", set]).collect();
        let codes = warned(&desk, &more);
        assert!(codes.iter().any(|told| told == code), "{set:?}: {codes:?}");
    }
}

#[test]
fn strokes_in_shadow_are_named() {
    let mut scene = room();
    let dark = json!({ "points": [[20, 34], [21, 50]], "radius": 4, "color": "#30ff60" });
    scene["views"][0]["strokes"].as_array_mut().unwrap().push(dark.clone());
    let desk = desk(&scene);
    assert_eq!(warned(&desk, &[]), ["stroke-in-shadow"]);
    let text = desk.json("out/report.json")["warnings"][0]["text"].as_str().unwrap().to_owned();
    assert_eq!(text, "strokes[1] of view `hall` lies in shadow: no light reaches it");
    // The one in the light alone has no warning, whatever its number.
    scene["views"][0]["strokes"] = json!([dark, room()["views"][0]["strokes"][0]]);
    desk.put("hall.json", scene.to_string());
    warned(&desk, &[]);
    let warnings = desk.json("out/report.json")["warnings"].clone();
    assert!(warnings[0]["text"].as_str().unwrap().starts_with("strokes[0] of"), "{warnings}");
    assert_eq!(warnings.as_array().unwrap().len(), 1);
}

#[test]
fn paint_that_contradicts_other_paint_says_whose_it_is() {
    let mut scene = hall();
    let blue = json!({ "points": [[71, 51], [76, 61]], "radius": 4, "color": "#3080ff" });
    scene["views"][0]["strokes"].as_array_mut().unwrap().push(blue.clone());
    let desk = desk(&scene);
    let text = |desk: &Desk| {
        let codes = warned(desk, &[]);
        let at =
            codes.iter().position(|code| code == "contradicted-paint").unwrap_or_else(|| panic!("{codes:?}"));
        desk.json("out/report.json")["warnings"][at]["text"].as_str().unwrap().to_owned()
    };
    let told = text(&desk);
    assert!(told.contains("in the same view") && !told.contains("another view"), "{told}");
    // The same from two views.
    let mut other = scene["views"][0].clone();
    (other["name"], other["strokes"]) = (json!("other"), json!([blue]));
    scene["views"][0]["strokes"].as_array_mut().unwrap().pop();
    scene["views"].as_array_mut().unwrap().push(other);
    desk.put("hall.json", scene.to_string());
    assert!(text(&desk).contains("in another view"));
}

#[test]
fn what_is_ignored_of_a_file_is_in_the_report() {
    let mut scene = hall();
    scene["occluders"].as_array_mut().unwrap().push(json!({ "obj": { "file": "box.obj" } }));
    let desk = desk(&scene);
    desk.put("box.obj", "v -9 0 -9\nv -8 0 -9\nv -8 1 -9\nf 1 2 3\ncurv 0 1 1 2\n");
    assert_eq!(warned(&desk, &[]), ["ignored"]);
}

#[test]
fn opacity_is_strength_and_the_papers_is_weight() {
    let mut scene = hall();
    scene["views"][0]["strokes"][0]["opacity"] = json!(0.25);
    let desk = desk(&scene);
    let blue = |more: &[&str]| {
        desk.done(&[&["light-map", "hall.json", "-q", "-o", "out"], more].concat());
        let [before, target, after] = ["before", "target", "after"]
            .map(|kind| super::pictures::exr(&desk.path(&format!("out/hall_{kind}.exr"))).1[46 * 120 + 68]);
        [target, after].map(|color| f64::from(color[2] / before[2]))
    };
    // A quarter of the way to a blue of about 0.014 leaves three quarters of it, and the ambient light.
    let [target, after] = blue(&[]);
    assert!((target - 0.78).abs() < 0.03 && (after - target).abs() < 0.05, "{target} {after}");
    let [_, after] = blue(&["--set", "opacity=weight"]);
    assert!(after < 0.3, "{after}");
}

#[test]
fn pixels_that_are_kept_stay_nearer_to_what_they_were() {
    let desk = desk(&hall());
    let change = |more: &[&str]| {
        desk.done(&[&["light-map", "hall.json", "-q", "-o", "out"], more].concat());
        let [before, target, after] = ["before", "target", "after"]
            .map(|kind| super::pictures::exr(&desk.path(&format!("out/hall_{kind}.exr"))).1);
        let unpainted = (0..before.len()).filter(|&k| before[k] == target[k]);
        unpainted
            .map(|k| (0..3).map(|c| f64::from(after[k][c] - before[k][c]).powi(2)).sum::<f64>())
            .sum::<f64>()
            .sqrt()
    };
    let free = change(&[]);
    let kept = change(&["--set", "views[0].keep=1"]);
    assert!(kept < 0.8 * free, "{kept} of {free}");
    // What is kept is no paint.
    assert_eq!(desk.json("out/report.json")["match"][0]["painted_pixels"], {
        desk.done(&["light-map", "hall.json", "-q", "-o", "plain"]);
        desk.json("plain/report.json")["match"][0]["painted_pixels"].clone()
    });
}

#[test]
fn paint_in_open_air_works_at_first_try() {
    let desk = Desk::new();
    let scene = json!({
        "version": 1,
        "light": { "direction": [-0.3, -1, 0.2], "radiance": 4 },
        "medium": { "sigma_t": 0.1 },
        "occluders": [{ "box": { "center": [0, 1.5, -2], "size": [1, 1, 1] } }],
        "views": [{
            "name": "v",
            "camera": { "to_world": { "look_at": { "origin": [0, 1.7, 6], "target": [0, 1.7, 0] } }, "fov": 50, "size": [120, 80] },
            "strokes": [{ "points": [[60, 40]], "radius": 6, "color": "#30ff60" }]
        }],
        "light_map": { "size": 128 },
        "shadow_map": { "size": 128 }
    });
    desk.put("air.json", scene.to_string());
    let report = desk.done(&["light-map", "air.json", "--json", "-q", "-o", "out"]).json();
    let light = &report["light"];
    assert!(
        light["outside"].as_f64().unwrap() < 0.05 && light["brightest"].as_f64().unwrap() <= 1.0 + 1e-6,
        "{light}"
    );
    let hue = &report["hue"];
    assert!(hue["median"].as_f64().unwrap() < 10.0 && hue["nine_tenths"].as_f64().unwrap() < 20.0, "{hue}");
    assert_eq!(report["warnings"], json!([]));
    // As the paper has it the map ends with the box, and nearly all light comes from beyond it.
    let report =
        desk.done(&["light-map", "air.json", "--json", "-q", "-o", "out", "--set", "defaults=paper"]).json();
    assert!(report["light"]["outside"].as_f64().unwrap() > 0.9);
    assert!(report["warnings"].as_array().unwrap().iter().any(|it| it["code"] == "light-from-outside"));
}

#[test]
fn what_was_chosen_is_said_and_gives_the_same_results() {
    let mut scene = hall();
    scene.as_object_mut().unwrap().remove("light_map");
    scene["light_map"] = json!({ "extent": null });
    let desk = desk(&scene);
    desk.done(&["light-map", "hall.json", "-q", "-o", "first"]);
    let resolved = desk.json("first/scene.resolved.json");
    for path in ["light_map.extent", "light_map.size", "shadow_map.extent", "solve.fade", "exposure"] {
        let value = path.split('.').fold(&resolved, |value, key| &value[key]);
        assert!(!value.is_null(), "{path}");
        assert!(resolved["chosen"][path].is_string(), "{path}: {}", resolved["chosen"]);
    }
    assert_eq!(
        (resolved["light_map"]["gobo"].as_bool(), resolved["solve"]["gradient"].as_f64()),
        (Some(true), Some(1.0))
    );
    desk.done(&["light-map", "first/scene.resolved.json", "-q", "-o", "second"]);
    for name in ["light_map.exr", "hall_after.png", "scene.resolved.json"] {
        assert!(desk.read(&format!("first/{name}")) == desk.read(&format!("second/{name}")), "{name}");
    }
}

#[test]
fn the_scattered_light_alone_can_be_drawn() {
    let desk = desk(&room());
    let drawn = |more: &[&str]| {
        desk.done(&[&["render", "hall.json", "-q", "-o", "out"], more].concat());
        super::pictures::exr(&desk.path("out/hall.exr")).1
    };
    let (all, scattered) = (drawn(&[]), drawn(&["--only", "scattering"]));
    assert!(all.iter().zip(&scattered).all(|(all, part)| (0..3).all(|c| part[c] <= all[c] * 1.0001)));
    assert!(scattered.iter().filter(|color| **color == [0.0; 3]).count() > 1000, "shadow scatters nothing");
    assert!(all.iter().all(|color| color[0] > 0.0), "the ambient light is everywhere");
}
