use serde_json::{Value, json};

use super::{camera, desk, desk_with_targets, scene, scene_with};
use crate::command::Desk;

#[test]
fn a_joint_solve_leaves_volumes_pictures_and_a_report() {
    let desk = desk();
    let ran = desk.done(&["volume", "scene.json", "-o", "out", "--turntable", "3"]);
    assert!(ran.out.contains("target met to") && ran.out.contains("report.html"), "{}", ran.out);
    let names = desk.names("out");
    for name in [
        "albedo.npy",
        "albedo.vdb",
        "checkpoint",
        "emission.npy",
        "emission.vdb",
        "front_after.exr",
        "front_before.png",
        "front_difference.png",
        "front_target.png",
        "report.html",
        "report.json",
        "scene.resolved.json",
        "side_after.png",
        "turntable_002.png",
    ] {
        assert!(names.iter().any(|other| other == name), "{name} is not in {names:?}");
    }
    let report = desk.json("out/report.json");
    assert_eq!(report["command"], "volume");
    assert_eq!(report["stages"][0]["find"], "joint");
    let residual = &report["weighted_residual"];
    assert!(residual["after"].as_f64() < residual["before"].as_f64(), "{residual}");
    assert!(report["adjoint_error"].as_f64().unwrap() < 1e-6);
    let page = String::from_utf8(desk.read("out/report.html")).unwrap();
    assert!(page.contains("wanted pixels") && !page.contains("light map"), "the page is about a volume");
    // Albedo keeps its bounds, emission its own.
    let (_, albedo) = unscatter::io::npy::read_f32(&desk.path("out/albedo.npy")).unwrap();
    let (shape, emission) = unscatter::io::npy::read_f32(&desk.path("out/emission.npy")).unwrap();
    assert_eq!(shape, [13, 12, 14, 3], "(z, y, x, channel)");
    assert!(albedo.iter().all(|value| (0.0..=1.0).contains(value)));
    assert!(emission.iter().all(|&value| value >= 0.0) && emission.iter().any(|&value| value > 0.0));
}

#[test]
fn pictures_of_a_known_volume_lead_back_to_pictures_that_match() {
    for (find, start) in [("emission", "emission"), ("albedo", "albedo")] {
        let mut truth = scene_with("/find", json!(find));
        truth["volume"][find] = json!({ "made": {
            "shapes": [{ "sphere": { "center": [0.2, 0.2, 0.2], "radius": 0.4 } }], "inside": 0.9, "outside": 0.2, "edge": 0.5
        } });
        let desk = desk_with_targets(&truth, |scene| {
            scene["volume"][start] = json!(if find == "albedo" { 0.5 } else { 0.0 });
            scene["solve"] = json!({ "iterations": 400, "tolerance": 1e-6, "tikhonov": 1e-9 });
        });
        desk.done(&["volume", "scene.json", "-q", "-o", "out", "--turntable", "0"]);
        let residual = desk.json("out/report.json")["weighted_residual"].clone();
        assert!(residual["before"].as_f64().unwrap() > 0.02, "{find} starts elsewhere: {residual}");
        assert!(residual["after"].as_f64().unwrap() < 1e-3, "{find}: {residual}");
    }
}

/// The pictures of the blob before a bright wall, as it takes light away.
fn shadowgraph() -> Value {
    let mut truth = scene_with("/find", json!("extinction"));
    truth["background"] = json!(1.0);
    truth["extinction"] = json!({ "medium_radiance": 0.1 });
    truth["views"] = (0..8)
        .map(|k| {
            let angle = f64::from(k) * std::f64::consts::TAU / 8.0;
            let eye = [4.0 * angle.sin(), 1.5 * (2.0 * angle).sin(), 4.0 * angle.cos()];
            json!({ "name": format!("v{k}"), "camera": camera(eye) })
        })
        .collect();
    truth
}

#[test]
fn extinction_comes_back_from_eight_views() {
    let desk = desk_with_targets(&shadowgraph(), |scene| {
        scene["volume"]["extinction"] = json!(0);
        scene["solve"] = json!({ "iterations": 300, "tolerance": 1e-5, "tikhonov": 1e-7 });
    });
    desk.done(&["volume", "scene.json", "-q", "-o", "out", "--turntable", "0"]);
    let residual = desk.json("out/report.json")["weighted_residual"].clone();
    assert!(residual["after"].as_f64().unwrap() < 1e-3, "{residual}");
    let (_, found) = unscatter::io::npy::read_f32(&desk.path("out/extinction.npy")).unwrap();
    let truth = unscatter::io::scene_file::load_volume(&desk.path("truth.json"), &[]);
    assert!(truth.is_err(), "the truth was only rendered");
    desk.put("truth.json", shadowgraph().to_string());
    let truth = unscatter::io::scene_file::load_volume(&desk.path("truth.json"), &[]).unwrap();
    let truth: Vec<f32> = truth.medium.extinction.samples().iter().collect();
    let mean =
        |values: &mut dyn Iterator<Item = f32>| values.map(f64::from).sum::<f64>() / truth.len() as f64;
    let error = mean(&mut truth.iter().zip(&found).map(|(a, b)| (a - b).abs()));
    let size = mean(&mut truth.iter().copied());
    assert!(error < 0.05 * size, "mean error {error} of a mean of {size}");
}

#[test]
fn extinction_and_then_albedo_are_found_in_one_run() {
    let desk = desk_with_targets(&shadowgraph(), |scene| {
        scene["volume"]["extinction"] = json!(0);
        scene["find"] = json!("extinction-then-albedo");
        scene["solve"] = json!({ "iterations": 40 });
    });
    desk.done(&["volume", "scene.json", "-q", "-o", "out", "--turntable", "0"]);
    let report = desk.json("out/report.json");
    let finds: Vec<_> = report["stages"].as_array().unwrap().iter().map(|stage| &stage["find"]).collect();
    assert_eq!(finds, ["extinction", "albedo"]);
    for name in ["extinction.npy", "albedo.npy"] {
        assert!(desk.names("out").iter().any(|other| other == name));
    }
}

#[test]
fn masks_shrink_the_problem() {
    let mut truth = shadowgraph();
    let desk = Desk::with(&truth);
    desk.done(&["render", "scene.json", "-q", "-o", "truth"]);
    let whole =
        desk.done(&["plan", "scene.json", "--json", "-q", "--set", "views[0].picture=truth/v0.exr"]).json();
    // Everything that is darker than the wall is inside.
    for view in truth["views"].as_array_mut().unwrap() {
        let name = view["name"].as_str().unwrap().to_owned();
        let path = desk.path(&format!("truth/{name}.exr"));
        let mut picture = unscatter::io::image::read_image(&path).unwrap();
        picture.pixels.iter_mut().for_each(|pixel| *pixel = [if pixel[0] < 0.999 { 1.0 } else { 0.0 }; 3]);
        unscatter::io::image::write_png(&desk.path(&format!("{name}_mask.png")), &picture, 0.0).unwrap();
        view["mask"] = json!(format!("{name}_mask.png"));
        view["picture"] = json!(format!("truth/{name}.exr"));
    }
    desk.put("scene.json", truth.to_string());
    let carved = desk.done(&["plan", "scene.json", "--json", "-q"]).json();
    let unknowns = |plan: &Value| plan[0]["unknowns"].as_u64().unwrap();
    assert_eq!(unknowns(&whole), 14 * 12 * 13);
    assert!(unknowns(&carved) < unknowns(&whole) * 3 / 4, "{} of {}", unknowns(&carved), unknowns(&whole));
    assert_eq!(
        carved[0]["skipped"]["outside_hull"]["count"].as_u64().unwrap(),
        unknowns(&whole) - unknowns(&carved)
    );
    let uncarved = desk.done(&["plan", "scene.json", "--json", "-q", "--set", "hull=false"]).json();
    assert_eq!(unknowns(&uncarved), unknowns(&whole));
}

#[test]
fn results_do_not_depend_on_the_number_of_threads_and_a_solve_can_be_resumed() {
    let desk = desk();
    for threads in ["1", "2", "5"] {
        desk.done(&["volume", "scene.json", "-q", "--turntable", "0", "--threads", threads, "-o", threads]);
    }
    assert_eq!(desk.read("1/albedo.npy"), desk.read("2/albedo.npy"));
    assert_eq!(desk.read("1/emission.npy"), desk.read("5/emission.npy"));
    desk.done(&["volume", "scene.json", "-q", "--turntable", "0", "--iterations", "5", "-o", "part"]);
    assert_ne!(desk.read("1/albedo.npy"), desk.read("part/albedo.npy"));
    desk.done(&["volume", "scene.json", "-q", "--turntable", "0", "--resume", "-o", "part"]);
    assert_eq!(desk.read("1/albedo.npy"), desk.read("part/albedo.npy"));
}

#[test]
fn nobody_goes_on_from_a_checkpoint_of_another_light() {
    // What is painted is a radiance, and nothing else is wanted: the light is in T alone.
    let mut scene = scene_with("/find", json!("albedo"));
    scene["target"] = json!("radiance");
    scene["views"].as_array_mut().unwrap().iter_mut().for_each(|view| view["keep"] = json!(0));
    let desk = Desk::with(&scene);
    let solve = ["volume", "scene.json", "-q", "--turntable", "0", "-o", "out"];
    desk.done(&[&solve[..], &["--iterations", "2"]].concat());
    for set in ["lights[0].radiance=3", "lights[0].direction=[-1,-1,0]", "environment.radiance=[0.5,0.6,0.9]"]
    {
        let resumed = desk.run(&[&solve[..], &["--resume", "--set", set]].concat());
        resumed.exits_with(1).tells("does not continue this solve").tells("without --resume");
    }
    desk.done(&[&solve[..], &["--resume"]].concat());
}

#[test]
fn every_solver_and_both_interpolations_serve() {
    let desk = desk();
    for solver in
        ["fista", "spectral", "lbfgs", "mprgp", "flexible-cgls", "clamped-cgls", "cgls", "lsqr", "lsmr"]
    {
        let set = "volume.interpolation=trilinear";
        let arguments = [
            "volume",
            "scene.json",
            "-q",
            "--turntable",
            "0",
            "--solver",
            solver,
            "--set",
            set,
            "-o",
            solver,
        ];
        desk.done(&arguments);
        let residual = desk.json(&format!("{solver}/report.json"))["weighted_residual"].clone();
        // Clamping breaks conjugate gradients: that it converges is not promised.
        let converges = solver != "clamped-cgls";
        assert!(
            !converges || residual["after"].as_f64() < residual["before"].as_f64(),
            "{solver}: {residual}"
        );
    }
}

#[test]
fn plan_check_render_and_matrix_know_volumes() {
    let desk = desk();
    let plan = desk.done(&["plan", "scene.json", "-q"]).out;
    assert!(plan.contains("voxels") && plan.contains("bricks are empty"), "{plan}");
    let checked = desk.done(&["check", "scene.json", "-q"]).out;
    assert!(checked.contains("holds") && !checked.contains("BROKEN"), "{checked}");
    desk.done(&["render", "scene.json", "-q", "-o", "seen", "--turntable", "2"]);
    assert_eq!(
        desk.names("seen"),
        ["front.exr", "front.png", "side.exr", "side.png", "turntable_000.png", "turntable_001.png"]
    );
    let grey = "environment.radiance=0.5";
    let written = desk.done(&["matrix", "scene.json", "-q", "--json", "--set", grey, "-o", "m"]).json();
    assert_eq!(written["columns"], 2 * 14 * 12 * 13);
    let (shape, _) = unscatter::io::npy::read_f32(&desk.path("m/x0.npy")).unwrap();
    assert_eq!(shape, [2 * 14 * 12 * 13, 3]);
    let (_, rows) = unscatter::io::npy::read_f32(&desk.path("m/rows.npy")).unwrap();
    let places: Vec<[u32; 3]> =
        rows.chunks(4).map(|row| [row[0] as u32, row[2] as u32, row[1] as u32]).collect();
    assert!(places.windows(2).all(|pair| pair[0] < pair[1]), "view by view, row by row");
    desk.run(&["matrix", "scene.json", "-q", "-o", "m"]).exits_with(1).tells("one matrix cannot hold three");
}

#[test]
fn commands_for_the_other_kind_of_scene_say_so() {
    let desk = desk();
    desk.run(&["light-map", "scene.json"]).exits_with(1).tells("unscatter volume");
    let other = Desk::new();
    other.run(&["volume", "scene.json"]).exits_with(1).tells("unscatter light-map");
    other.run(&["volume", "scene.json", "--find", "emission"]).exits_with(1).tells("unscatter light-map");
    other.run(&["animate", "scene.json"]).exits_with(1).tells("unscatter light-map");
    desk.run(&["animate", "scene.json"]).exits_with(1).tells("unscatter volume");
    other.put("scene.json", "{ \"volume\": ");
    other.run(&["volume", "scene.json"]).exits_with(1).tells("scene.json:1:12");
    assert!(scene()["volume"].is_object());
}

#[test]
fn views_can_come_from_a_transforms_file() {
    let desk = desk_with_targets(&shadowgraph(), |_| {});
    let mut scene: Value = serde_json::from_slice(&desk.read("scene.json")).unwrap();
    let frames: Vec<Value> = (0..8)
        .map(|k| {
            let angle = f64::from(k) * std::f64::consts::TAU / 8.0;
            let eye = glam::DVec3::new(4.0 * angle.sin(), 1.5 * (2.0 * angle).sin(), 4.0 * angle.cos());
            let world = unscatter::scene::look_at(eye, glam::DVec3::ZERO, glam::DVec3::Y).unwrap();
            let m = glam::DMat4::from(world).transpose().to_cols_array_2d();
            json!({ "file_path": format!("truth/v{k}.exr"), "transform_matrix": m })
        })
        .collect();
    let half = (35f64 / 2.0).to_radians().tan() * 32.0 / 30.0;
    desk.put("transforms.json", json!({ "camera_angle_x": 2.0 * half.atan(), "frames": frames }).to_string());
    desk.done(&["volume", "scene.json", "-q", "--turntable", "0", "--iterations", "5", "-o", "by_scene"]);
    scene["views"] = json!([]);
    scene["transforms"] = json!({ "file": "transforms.json" });
    desk.put("scene.json", scene.to_string());
    desk.done(&["volume", "scene.json", "-q", "--turntable", "0", "--iterations", "5", "-o", "by_file"]);
    let read = |name: &str| unscatter::io::npy::read_f32(&desk.path(name)).unwrap().1;
    let (a, b) = (read("by_scene/extinction.npy"), read("by_file/extinction.npy"));
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-4), "the same cameras, the same volume");
}

#[test]
fn surfaces_stand_before_and_behind_the_volume() {
    let mut scene = scene();
    scene["occluders"] = json!([
        { "plane": { "center": [0.0, 0.0, -1.2], "sides": [[6, 0, 0], [0, 6, 0]], "albedo": [0.2, 0.6, 0.2] } },
        { "box": { "center": [-0.6, 0.0, 1.5], "size": [0.8, 3.0, 0.1], "albedo": 0.7 } }
    ]);
    let desk = Desk::with(&scene);
    desk.done(&["render", "scene.json", "-q", "-o", "seen"]);
    let picture = unscatter::io::image::read_image(&desk.path("seen/front.exr")).unwrap();
    let [r, g, b] = picture.at(29, 3);
    assert!(g > 1.5 * r && g > 1.5 * b, "the wall is green where nothing is before it: {r} {g} {b}");
    let [r, g, b] = picture.at(6, 15);
    assert!(r > 0.01 && g < 1.5 * r && b > 0.5 * r, "the box before everything is not: {r} {g} {b}");
    // What is behind the box is no row.
    let plan =
        |desk: &Desk| desk.done(&["plan", "scene.json", "--json", "-q"]).json()[0]["rows"].as_u64().unwrap();
    assert!(plan(&desk) < plan(&super::desk()), "the box hides voxels");
    desk.done(&["volume", "scene.json", "-q", "-o", "out", "--turntable", "0"]);
    let residual = desk.json("out/report.json")["weighted_residual"].clone();
    assert!(residual["after"].as_f64() < residual["before"].as_f64(), "{residual}");
}

#[test]
fn bent_rays_serve_every_property_and_the_report_says_what_a_step_costs() {
    for find in ["joint", "extinction"] {
        let mut scene = scene_with("/find", json!(find));
        scene["background"] = json!(1.0);
        scene["volume"]["refraction"] = json!({ "index": { "made": {
            "shapes": [{ "sphere": { "center": [0, 0, 0], "radius": 0.6 } }],
            "inside": 1.3, "outside": 1.0, "edge": 0.5
        } } });
        let desk = Desk::with(&scene);
        desk.done(&["volume", "scene.json", "-q", "-o", "out", "--turntable", "0"]);
        let report = desk.json("out/report.json");
        let residual = &report["weighted_residual"];
        assert!(residual["after"].as_f64() < residual["before"].as_f64(), "{find}: {residual}");
        let words = report["settings"]["refraction"].as_str().unwrap();
        assert!(words.contains("Euler steps") && words.contains("on average"), "{words}");
        let checked = desk.done(&["check", "scene.json", "-q"]).out;
        assert!(!checked.contains("BROKEN"), "{checked}");
    }
}

#[test]
fn sixteen_bits_change_a_solve_by_their_rounding_alone() {
    let desk = desk();
    desk.done(&["volume", "scene.json", "-q", "--find", "emission", "--turntable", "0", "-o", "wide"]);
    let half = "volume.extinction.half=true";
    desk.done(&[
        "volume",
        "scene.json",
        "-q",
        "--find",
        "emission",
        "--turntable",
        "0",
        "--set",
        half,
        "-o",
        "half",
    ]);
    let read = |name: &str| unscatter::io::npy::read_f32(&desk.path(name)).unwrap().1;
    let (wide, half) = (read("wide/emission.npy"), read("half/emission.npy"));
    let norm =
        |values: &mut dyn Iterator<Item = f32>| values.map(|v| f64::from(v).powi(2)).sum::<f64>().sqrt();
    let apart = norm(&mut wide.iter().zip(&half).map(|(a, b)| a - b)) / norm(&mut wide.iter().copied());
    assert!(apart > 0.0 && apart < 5e-3, "{apart}");
}

#[test]
fn a_stronger_pull_keeps_emission_and_albedo_nearer_to_their_start() {
    let desk = desk();
    let emitted = |pull: &str, name: &str| {
        let set = format!("pull={pull}");
        desk.done(&["volume", "scene.json", "-q", "--turntable", "0", "--set", &set, "-o", name]);
        let (_, emission) =
            unscatter::io::npy::read_f32(&desk.path(&format!("{name}/emission.npy"))).unwrap();
        emission.iter().map(|&value| f64::from(value)).sum::<f64>()
    };
    let one = emitted(r#"{"emission": 1, "albedo": 1}"#, "one");
    let both = emitted(r#"{"emission": 100, "albedo": 100}"#, "both");
    let emission_alone = emitted(r#"{"emission": 100, "albedo": 1}"#, "emission");
    assert!(both < 0.9 * one && emission_alone < 0.9 * one, "{one} {both} {emission_alone}");
}
