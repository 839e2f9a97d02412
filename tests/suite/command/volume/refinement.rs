use std::path::Path;

use serde_json::{Value, json};
use unscatter::io::image;
use unscatter::scene::Image;

use super::{desk_with_targets, scene_with};
use crate::command::{Desk, with as replaced};
use crate::scenes::Numbers;

/// Mist of some optical depth across before a bright background; it glows and scatters, or has one radiance everywhere.
fn mist(depth: f64, is_scattering: bool) -> Value {
    let mut scene = scene_with("/background", json!([1.0, 0.9, 0.8]));
    // About 1.2 metres across.
    scene["volume"]["extinction"]["made"]["inside"] = json!(depth / 1.2);
    scene["solve"] = json!({ "iterations": 40, "tolerance": 1e-4 });
    if is_scattering {
        scene["volume"]["emission"] = json!([0.3, 0.1, 0.02]);
        scene["extinction"] = json!({ "gives": "single-scattering", "medium_radiance": [0.3, 0.25, 0.2] });
    } else {
        scene["extinction"] = json!({ "medium_radiance": 0.1 });
        scene["find"] = json!("extinction");
    }
    scene
}

/// Adds noise of a standard deviation to a picture.
fn add_noise(file: &Path, deviation: f64, n: &mut Numbers) {
    let picture = image::read_image(file).unwrap();
    let mut noise = || deviation * ((0..12).map(|_| n.uniform(0.0, 1.0)).sum::<f64>() - 6.0);
    let pixels = picture.pixels.iter().map(|color| color.map(|value| (f64::from(value) + noise()) as f32));
    image::write_exr(file, &Image::new(picture.size(), pixels.collect()).unwrap()).unwrap();
}

/// The pictures of a mist with noise, and the same scene from a mist of another shape on.
fn desk(depth: f64, is_scattering: bool) -> Desk {
    let desk = desk_with_targets(&mist(depth, is_scattering), |scene| {
        scene["find"] = json!("extinction-then-refinement");
        let sphere = json!({ "center": [0.0, 0.0, 0.0], "radius": 0.9 });
        let made = json!({ "shapes": [{ "sphere": sphere }], "inside": depth / 2.4, "edge": 0.3 });
        scene["volume"]["extinction"] = json!({ "made": made });
    });
    let mut n = Numbers(7);
    for view in ["front", "side"] {
        add_noise(&desk.path(&format!("truth/{view}.exr")), 0.01, &mut n);
    }
    desk
}

#[test]
fn every_step_comes_nearer_and_all_end_below_the_logarithm() {
    let depths = [0.1, 0.5, 2.0, 8.0];
    for (depth, is_scattering) in depths.into_iter().flat_map(|depth| [(depth, true), (depth, false)]) {
        let desk = desk(depth, is_scattering);
        desk.done(&["volume", "scene.json", "-q", "-o", "out", "--turntable", "0"]);
        let report = desk.json("out/report.json");
        let stages = report["stages"].as_array().unwrap();
        assert_eq!(stages[0]["find"], "extinction");
        let [before, after] = ["before", "after"]
            .map(|when| move |stage: &Value| stage["weighted_residual"][when].as_f64().unwrap());
        let steps = &stages[1..];
        let in_log_space = before(&steps[0]);
        let mut last = in_log_space;
        for step in steps {
            assert_eq!(step["find"], "refinement");
            assert!(before(step) == last && after(step) <= last, "{depth}: {step}");
            assert_eq!(step["is_taken"], after(step) < last);
            last = after(step);
        }
        eprintln!("{depth} {is_scattering} {in_log_space:.5} -> {last:.5}, {} steps", steps.len());
        // Where the medium has one radiance everywhere, what the logarithm leaves is noise, and pixels that are kept out of the fit say so.
        let gains = is_scattering && depth >= 0.5;
        assert!(if gains { last < 0.7 * in_log_space } else { last <= in_log_space }, "depth {depth}");
        assert_eq!(steps.last().unwrap()["is_taken"], false);
    }
}

#[test]
fn without_noise_to_stop_at_every_medium_is_refined_below_the_logarithm() {
    for is_scattering in [true, false] {
        let desk = desk(8.0, is_scattering);
        let close = ["volume", "scene.json", "-q", "-o", "out", "--turntable", "0", "--set", "solve.noise=0"];
        desk.done(&close);
        let stages = desk.json("out/report.json")["stages"].as_array().unwrap().clone();
        let of = |stage: &Value| stage["weighted_residual"]["after"].as_f64().unwrap();
        assert!(of(stages.last().unwrap()) < 0.95 * of(&stages[0]), "{stages:?}");
    }
}

#[test]
fn a_solve_that_stops_at_the_noise_can_be_resumed() {
    let desk = desk(2.0, false);
    let solve = [
        "volume",
        "scene.json",
        "-q",
        "--turntable",
        "0",
        "--set",
        "find=extinction",
        "--set",
        "solve.iterations=400",
    ];
    desk.done(&[&solve[..], &["-o", "whole"]].concat());
    let report = desk.json("whole/report.json");
    assert_eq!(report["stop"]["reason"], "held-out");
    assert!(report["stop"]["iteration"].as_u64().unwrap() > 5);
    desk.done(&[&solve[..], &["-o", "part", "--iterations", "5"]].concat());
    assert_ne!(desk.read("whole/extinction.npy"), desk.read("part/extinction.npy"));
    desk.done(&[&solve[..], &["-o", "part", "--resume"]].concat());
    assert_eq!(desk.read("whole/extinction.npy"), desk.read("part/extinction.npy"));
}

#[test]
fn extinction_alone_can_be_refined_from_the_scene_s_own() {
    let desk = desk(1.0, true);
    desk.done(&["volume", "scene.json", "-q", "-o", "both", "--turntable", "0"]);
    let set = ["--set", "find=refinement", "--set", "extinction.steps=3"];
    desk.done(&[&["volume", "scene.json", "-q", "-o", "out", "--turntable", "0"][..], &set].concat());
    let report = desk.json("out/report.json");
    assert_eq!(report["stages"].as_array().unwrap().len(), 3);
    let [before, after] = ["before", "after"].map(|when| report["weighted_residual"][when].as_f64().unwrap());
    assert!(after < 0.5 * before, "{before} and {after}");
    assert!(desk.names("out").iter().any(|name| name == "extinction.npy"));
    desk.done(&["check", "scene.json", "-q", "--set", "find=refinement"]);
    let plans = desk.done(&["plan", "scene.json", "-q", "--json", "--set", "extinction.steps=3"]).json();
    let solves: Vec<u64> =
        plans.as_array().unwrap().iter().map(|plan| plan["solves"].as_u64().unwrap()).collect();
    assert_eq!(solves, [1, 3], "extinction, and each step of its refinement");
    assert!(desk.done(&["plan", "scene.json", "-q"]).out.contains("solves of 40 iterations"));
}

#[test]
fn what_makes_no_sense_is_named() {
    for (pointer, value, words) in [
        ("/extinction/steps", json!(0), "from 1 to 1000"),
        ("/extinction/gives", json!("light"), "single-scattering"),
        ("/rounds", json!(2), "where the environment is looked for"),
    ] {
        let scene = replaced(mist(1.0, true), "/find", json!("extinction-then-refinement"));
        let desk = Desk::with(&replaced(scene, pointer, value));
        desk.run(&["volume", "scene.json", "-o", "out"]).exits_with(1).tells(words);
    }
}
