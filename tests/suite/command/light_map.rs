//! `unscatter light-map`: results, settings, threads and resuming.

use serde_json::{Value, json};

use super::pictures::{difference, exr, png_size};
use super::{Desk, scene_with};
use crate::tolerances::SAME_SOLUTION;

const SOLVE: [&str; 4] = ["light-map", "scene.json", "-o", "out"];

fn with<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&SOLVE[..], more].concat()
}

/// The light map of a run that must succeed.
fn solved(desk: &Desk, folder: &str, more: &[&str]) -> Vec<[f32; 3]> {
    desk.done(&[&["light-map", "scene.json", "-o", folder], more].concat());
    exr(&desk.path(&format!("{folder}/light_map.exr"))).1
}

#[test]
fn all_results_are_written_and_read_back() {
    let desk = Desk::new();
    let ran = desk.done(&SOLVE);
    let mut expected: Vec<String> = [
        "light_map.exr",
        "light_map.png",
        "light_map.placement.json",
        "coverage.png",
        "report.json",
        "report.html",
        "scene.resolved.json",
        "checkpoint",
    ]
    .map(String::from)
    .to_vec();
    for view in ["left", "right"] {
        for kind in ["target", "before", "after", "difference"] {
            for ending in ["exr", "png"] {
                expected.push(format!("{view}_{kind}.{ending}"));
            }
        }
    }
    expected.sort();
    assert_eq!(desk.names("out"), expected);
    for name in expected.iter().filter(|name| name.ends_with(".exr")) {
        let (size, pixels) = exr(&desk.path(&format!("out/{name}")));
        assert_eq!(size, if name == "light_map.exr" { [32, 32] } else { [64, 36] }, "{name}");
        assert!(pixels.iter().flatten().all(|value| value.is_finite()), "{name}");
        assert_eq!(png_size(&desk.path(&format!("out/{}", name.replace(".exr", ".png")))), size);
    }
    for words in ["paint met to", "painted pixels in 2 views", "left", "right", "out/report.html"] {
        assert!(ran.out.contains(words), "`{words}` is not in the summary {}", ran.out);
    }
    // Where no terminal is there is nothing else to say than what is to be known.
    assert!(ran.err.lines().all(|line| line.starts_with("warning: ")), "{}", ran.err);
    let numbers = desk.done(&with(&["-v"])).out;
    assert!(numbers.contains("12 iterations") && numbers.contains("(residual "), "{numbers}");
}

#[test]
fn the_light_map_makes_the_views_what_is_painted() {
    let desk = Desk::new();
    solved(&desk, "out", &[]);
    for view in ["left", "right"] {
        let [target, before, difference] = ["target", "before", "difference"]
            .map(|kind| exr(&desk.path(&format!("out/{view}_{kind}.exr"))).1);
        let norm = |values: &mut dyn Iterator<Item = f32>| {
            values.map(|value| f64::from(value).powi(2)).sum::<f64>().sqrt()
        };
        let pairs = target.iter().flatten().zip(before.iter().flatten());
        let asked = norm(&mut pairs.map(|(target, before)| target - before));
        let missed = norm(&mut difference.iter().flatten().copied());
        // The light map also lights the surfaces behind, which no stroke asks for.
        assert!(asked > 0.0 && missed < 0.5 * asked, "{view}: {missed} of {asked}");
        let unpainted = target.iter().zip(&before).zip(&difference).filter(|((t, b), _)| t == b);
        assert!(unpainted.clone().count() > 1000);
        assert!(unpainted.into_iter().all(|(_, difference)| *difference == [0.0; 3]));
    }
}

#[test]
fn the_report_has_the_fields_of_the_contract() {
    let desk = Desk::new();
    desk.done(&SOLVE);
    let report = desk.json("out/report.json");
    let at = |pointer: &str| report.pointer(pointer).unwrap_or_else(|| panic!("{pointer} is missing"));
    let number = |pointer: &str| at(pointer).as_f64().unwrap_or_else(|| panic!("{pointer} is no number"));
    assert_eq!(at("/version"), env!("CARGO_PKG_VERSION"));
    assert_eq!((at("/command"), at("/backend")), (&json!("light-map"), &json!("cpu")));
    assert!(at("/device").is_string());
    assert_eq!(at("/problem/unknowns"), 1024);
    for pointer in
        ["/problem/rows", "/problem/active_unknowns", "/problem/nonzeros", "/regularization/tikhonov"]
    {
        assert!(number(pointer) > 0.0, "{pointer}");
    }
    for pointer in ["/regularization/laplacian", "/regularization/gradient"] {
        assert_eq!(number(pointer), 0.0, "{pointer}");
    }
    let history = at("/history").as_array().unwrap();
    assert_eq!(history.len(), 13, "the start and twelve iterations");
    for (iteration, entry) in history.iter().enumerate() {
        assert_eq!(entry["iteration"], iteration);
        assert!(entry["seconds"].is_number() && entry["operator_applications"].is_u64());
        for field in ["residual", "normal_residual"] {
            assert_eq!(entry[field].as_array().unwrap().len(), 3, "one number a channel");
        }
    }
    assert_eq!(history[0]["residual"], json!([1.0, 1.0, 1.0]));
    assert_eq!(at("/stop"), &json!({ "reason": "iterations", "iteration": 12 }));
    assert!(number("/adjoint_error") < 1e-6);
    assert!(number("/weighted_residual/after") < 0.4 * number("/weighted_residual/before"));
    assert_eq!(at("/certificate/kind"), "projected-gradient");
    for c in 0..3 {
        let certificate = number(&format!("/certificate/value/{c}"));
        let believed = number(&format!("/history/12/normal_residual/{c}"));
        assert!(
            (certificate / believed - 1.0).abs() < 0.05,
            "{certificate} is the truth, {believed} was believed"
        );
    }
    assert!(number("/certificate/at_bounds") > 0.0 && number("/certificate/at_bounds") < 1024.0);
    assert_eq!(number("/coverage/reached") + number("/coverage/unreached"), 1024.0);
    for pointer in ["/timings", "/memory", "/skipped"] {
        assert!(!at(pointer).as_object().unwrap().is_empty(), "{pointer} is empty");
    }
    assert!(report.pointer("/no_such_field").is_none());
}

#[test]
fn the_page_is_one_file_that_needs_no_other() {
    let desk = Desk::new();
    desk.done(&SOLVE);
    let page = String::from_utf8(desk.read("out/report.html")).unwrap();
    assert!(page.starts_with("<!DOCTYPE html>") || page.starts_with("<!doctype html>"));
    assert!(page.contains("data:image/png;base64,") && page.contains("<svg"));
    for elsewhere in ["src=\"http", "href=\"http", "@import", "src=\"left", "url(http"] {
        assert!(!page.contains(elsewhere), "{elsewhere}");
    }
}

#[test]
fn with_json_standard_output_is_the_report_and_nothing_else() {
    let desk = Desk::new();
    let ran = desk.done(&with(&["--json"]));
    assert_eq!(ran.json(), desk.json("out/report.json"));
    let quiet = desk.done(&with(&["--quiet", "--json"]));
    assert!(quiet.err.is_empty());
    assert_eq!(quiet.json()["command"], "light-map");
}

#[test]
fn verbose_speaks_on_standard_error_alone() {
    let desk = Desk::new();
    let ran = desk.done(&with(&["--json", "-v"]));
    assert!(ran.err.contains("INFO"), "{}", ran.err);
    ran.json();
}

#[test]
fn results_go_to_a_folder_named_after_the_scene() {
    let desk = Desk::new();
    desk.done(&["light-map", "scene.json"]);
    assert!(desk.path("out/scene/light_map.exr").is_file());
}

#[test]
fn flags_and_set_replace_values_of_the_scene() {
    let desk = Desk::new();
    let run = |more: &[&str]| desk.done(&with(&[&["--json"], more].concat())).json();
    assert_eq!(run(&["--set", "light_map.size=[16, 8]"])["problem"]["unknowns"], 128);
    assert_eq!(run(&["--set", "solve.iterations=3"])["stop"]["iteration"], 3);
    assert_eq!(run(&["--iterations", "4"])["stop"]["iteration"], 4);
    assert_eq!(run(&["--set", "solve.iterations=3", "--iterations", "4"])["stop"]["iteration"], 4);
    let loose = run(&["--tolerance", "0.5"]);
    assert_eq!(loose["stop"]["reason"], "tolerance");
    assert!(loose["stop"]["iteration"].as_u64().unwrap() < 12);
    assert_eq!(run(&["--solver", "clamped-cgls"])["solver"], "clamped-cgls");
    let clamped = exr(&desk.path("out/light_map.exr")).1;
    assert!(clamped.iter().flatten().all(|&value| value >= 0.0));
    assert_eq!(run(&["--memory", "1GiB"])["memory"]["budget"], 1u64 << 30);
    assert_eq!(run(&["--backend", "cpu", "--deterministic"])["backend"], "cpu");
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let desk = Desk::new();
    for (folder, threads) in [("one", "1"), ("two", "2"), ("five", "5")] {
        solved(&desk, folder, &["--threads", threads]);
    }
    for name in desk.names("one").iter().filter(|name| name.ends_with(".exr") || name.ends_with(".png")) {
        let one = desk.read(&format!("one/{name}"));
        assert_eq!(one, desk.read(&format!("two/{name}")), "{name}");
        assert_eq!(one, desk.read(&format!("five/{name}")), "{name}");
    }
    solved(&desk, "other", &["--set", "light.radiance=4.0001"]);
    assert_ne!(desk.read("one/light_map.exr"), desk.read("other/light_map.exr"));
}

#[test]
fn resuming_ends_where_a_solve_in_one_go_ends() {
    for strategy in ["assembled", "matrix-free"] {
        let desk = Desk::with(&scene_with("/solve/strategy", json!(strategy)));
        let straight = solved(&desk, "straight", &["--iterations", "12"]);
        let half = solved(&desk, "resumed", &["--iterations", "5"]);
        assert_ne!(half, straight);
        solved(&desk, "resumed", &["--iterations", "12", "--resume", "--threads", "1"]);
        assert_eq!(desk.read("resumed/light_map.exr"), desk.read("straight/light_map.exr"), "{strategy}");
        let histories = ["straight", "resumed"].map(|folder| {
            let report = desk.json(&format!("{folder}/report.json"));
            let residuals = |entry: &Value| [entry["residual"].clone(), entry["normal_residual"].clone()];
            report["history"].as_array().unwrap().iter().map(residuals).collect::<Vec<_>>()
        });
        assert_eq!(histories[0], histories[1]);
    }
}

#[test]
fn only_the_checkpoint_of_the_same_problem_is_resumed() {
    let desk = Desk::new();
    let refused = |more: &[&str], words: &str| {
        let before = desk.files("out");
        desk.run(&with(&[&["--resume"], more].concat())).exits_with(1).tells(words);
        assert_eq!(desk.files("out"), before);
    };
    refused(&[], "checkpoint");
    desk.done(&with(&["--iterations", "2"]));
    for change in [
        "views[0].strokes[0].color=[1, 1, 1]",
        "views[0].strokes[0].opacity=0.5",
        "medium.g=0.1",
        "light.direction=[0, -1, 0]",
        "light_map.size=16",
        "shadow_map.size=65",
        "light_map.basis=nearest",
        "solve.tikhonov=0.5",
        "solve.quadrature={\"march\": {\"steps\": 9}}",
        "solve.solver=clamped-cgls",
    ] {
        refused(&["--set", change], "solve again without --resume");
    }
    let whole = desk.read("out/checkpoint");
    for (damage, words) in [
        (whole[..whole.len() - 1].to_vec(), "not as long as it says, and damaged"),
        (whole[..40].to_vec(), "damaged"),
        (Vec::new(), "not a checkpoint"),
        (b"\xff\xff".to_vec(), "checkpoint"),
        ([&whole[..whole.len() - 8], &f64::NAN.to_le_bytes()].concat(), ""),
    ] {
        desk.put("out/checkpoint", damage);
        refused(&[], words);
    }
    desk.put("out/checkpoint", whole);
    desk.done(&with(&["--resume", "--threads", "2", "--memory", "1GiB"]));
}

/// With the maps set and radiance for a target, nothing of the geometry shows in the targets.
#[test]
fn a_checkpoint_of_other_geometry_is_refused() {
    let mut scene = scene_with("/target", json!("radiance"));
    for map in ["light_map", "shadow_map"] {
        scene[map]["extent"] = json!({ "min": [-9, -9], "max": [9, 9] });
    }
    let desk = Desk::with(&scene);
    desk.done(&with(&["--iterations", "2"]));
    for change in ["occluders[0].plane.center[0]=0.5", "views[0].camera.fov=46"] {
        desk.run(&with(&["--resume", "--set", change])).exits_with(1).tells("solve again without --resume");
    }
    desk.done(&with(&["--resume"]));
}

/// Its rays differ in nothing but the sign of one number each, and there is an even number of them.
#[test]
fn a_checkpoint_of_a_camera_on_the_other_side_is_refused() {
    let mut scene = scene_with("/target", json!("radiance"));
    scene["occluders"] = json!([]);
    scene["light"]["direction"] = json!([0, -1, 0.2]);
    scene["views"].as_array_mut().unwrap().truncate(1);
    scene["views"][0]["camera"]["to_world"] = json!({ "translate": [2, 1, 5] });
    for map in ["light_map", "shadow_map"] {
        scene[map]["extent"] = json!({ "min": [-400, -400], "max": [400, 400] });
    }
    let desk = Desk::with(&scene);
    let report = desk.done(&with(&["--iterations", "2", "--json"])).json();
    assert_eq!(report["problem"]["rows"].as_u64().unwrap() % 2, 0);
    let other = "views[0].camera.to_world.translate[0]=-2";
    desk.run(&with(&["--resume", "--set", other])).exits_with(1).tells("solve again without --resume");
}

/// After few iterations: with many, conjugate gradients make more of every rounding where rays hardly reach.
#[test]
fn both_strategies_give_the_same_light_map() {
    let desk = Desk::new();
    let few = ["--iterations", "4", "--set"];
    let assembled = solved(&desk, "assembled", &[&few[..], &["solve.strategy=assembled"]].concat());
    let walked = solved(&desk, "walked", &[&few[..], &["solve.strategy=matrix-free"]].concat());
    let report = |folder: &str| desk.json(&format!("{folder}/report.json"));
    assert_eq!(report("assembled")["strategy"]["walked_rows"], 0);
    assert_eq!(report("walked")["strategy"]["kept_rows"], 0);
    let got = difference(&walked, &assembled);
    assert!(got < SAME_SOLUTION, "{got}");
    let other = solved(&desk, "other", &[&few[..], &["views[0].strokes[0].opacity=0.99"]].concat());
    assert!(difference(&other, &assembled) > SAME_SOLUTION);
}

#[test]
fn a_medium_with_equal_channels_is_the_grey_medium() {
    let desk = Desk::new();
    solved(&desk, "grey", &[]);
    solved(&desk, "equal", &["--set", "medium.sigma_t=[0.08, 0.08, 0.08]"]);
    assert_eq!(desk.read("grey/light_map.exr"), desk.read("equal/light_map.exr"));
    // As good as equal, and yet walked with three weights.
    let grey = exr(&desk.path("grey/light_map.exr")).1;
    let got = difference(
        &solved(&desk, "nearly", &["--set", "medium.sigma_t=[0.08, 0.08, 0.08000000000001]"]),
        &grey,
    );
    assert!(got < SAME_SOLUTION, "{got}");
}

#[test]
fn channels_of_a_medium_are_channels_of_the_light() {
    let desk = Desk::new();
    let with_sigma = |sigma: &str| {
        let sigma = format!("medium.sigma_t={sigma}");
        let plain = ["--solver", "cgls", "--iterations", "12", "--set", "solve.metric=none"];
        solved(&desk, "out", &[&plain[..], &["--set", &sigma, "--set", EXTENT, "--set", SHADOW]].concat())
    };
    let [thin, thick, both] = ["0.08", "0.2", "[0.08, 0.2, 0.08]"].map(with_sigma);
    // The pull to the start is a share of the mean of all channels, so that is not the same to the last digit.
    let channel =
        |pixels: &[[f32; 3]], c: usize| pixels.iter().map(|pixel| [pixel[c]; 3]).collect::<Vec<_>>();
    assert!(difference(&channel(&both, 0), &channel(&thin, 0)) < 0.01);
    assert!(difference(&channel(&both, 1), &channel(&thick, 1)) < 0.01);
    assert!(difference(&channel(&both, 1), &channel(&thin, 1)) > 0.01);
}

const EXTENT: &str = r#"light_map.extent={"min": [-6, -6], "max": [6, 6]}"#;
const SHADOW: &str = r#"shadow_map.extent={"min": [-9, -9], "max": [9, 9]}"#;

#[test]
fn every_basis_and_quadrature_solves() {
    let desk = Desk::new();
    let settings = |set: &str| {
        let report = desk.done(&with(&["--json", "--set", set])).json();
        let change = &report["weighted_residual"];
        assert!(change["after"].as_f64().unwrap() < 0.4 * change["before"].as_f64().unwrap(), "{set}");
        report["settings"].clone()
    };
    assert_eq!(settings("light_map.basis=nearest")["basis"], "nearest");
    let quadrature = settings(r#"solve.quadrature={"march": {"steps": 64}}"#)["quadrature"].clone();
    assert!(quadrature.as_str().unwrap().contains("64"), "{quadrature}");
    let fine = solved(&desk, "fine", &["--set", r#"solve.quadrature={"march": {"steps": 20000}}"#]);
    let coarse = solved(&desk, "coarse", &["--set", r#"solve.quadrature={"march": {"steps": 50}}"#]);
    let exact = solved(&desk, "exact", &[]);
    assert!(difference(&fine, &exact) < difference(&coarse, &exact), "more steps come nearer");
    assert!(difference(&fine, &exact) < 0.02, "{}", difference(&fine, &exact));
}

#[test]
fn painted_layers_are_constraints_like_strokes() {
    let mut scene = scene_with("/views/1/strokes", json!([]));
    scene["views"][1]["layers"] = json!(["paint.exr"]);
    let desk = Desk::with(&scene);
    super::pictures::write_rgba_exr(&desk.path("paint.exr"), [64, 36], |x, y| {
        if (20..40).contains(&x) && (10..20).contains(&y) { [0.1, 0.5, 0.1, 0.5] } else { [0.0; 4] }
    });
    let report = desk.done(&with(&["--json"])).json();
    assert_eq!(report["match"][1]["painted_pixels"], 200);
    // A little less than what the other view's strokes leave of it.
    let residual = &report["match"][1]["weighted_residual"];
    assert!(residual["after"].as_f64().unwrap() < 0.5 * residual["before"].as_f64().unwrap());
}

#[test]
fn previews_are_the_pictures_of_a_solve_under_way() {
    let desk = Desk::new();
    let straight = solved(&desk, "out", &["--preview-every", "5"]);
    assert_eq!(solved(&desk, "plain", &[]), straight);
    assert_eq!(desk.names("out"), desk.names("plain"));
}
