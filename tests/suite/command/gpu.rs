//! The command on a graphics adapter, and what it does when that is not there or fails.

use serde_json::json;
use unscatter::gpu::{AdapterRecord, adapters};

use super::{Desk, Ran, scene_with};

/// The adapter of this machine that serves, hardware before software; of those that UNSCATTER_ADAPTER names a part of, where it is set.
pub fn adapter() -> AdapterRecord {
    let name = std::env::var("UNSCATTER_ADAPTER").unwrap_or_default().to_lowercase();
    let mut found = adapters();
    found.retain(|adapter| adapter.missing.is_empty() && adapter.name.to_lowercase().contains(&name));
    found.sort_by_key(|adapter| !adapter.is_hardware());
    found.into_iter().next().expect("no adapter; ./test.sh brings one")
}

/// Solves on that adapter.
fn solved(desk: &Desk, out: &str, backend: &str, more: &[&str], fault: &str) -> Ran {
    let name = adapter().name;
    let mut arguments = vec!["light-map", "scene.json", "-o", out, "--backend", backend, "--adapter", &name];
    arguments.extend(more);
    desk.run_in(&arguments, &[("UNSCATTER_FAULT", fault)])
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn a_solve_on_the_adapter_says_so_and_gives_what_the_processor_gives() {
    let desk = Desk::new();
    solved(&desk, "gpu", "gpu", &[], "").exits_with(0);
    desk.done(&["light-map", "scene.json", "-o", "cpu", "--backend", "cpu"]);
    let (there, here) = (desk.json("gpu/report.json"), desk.json("cpu/report.json"));
    assert_eq!((&there["backend"], &here["backend"]), (&json!("gpu"), &json!("cpu")));
    assert!(there["device"].as_str().unwrap().contains(&adapter().name));
    assert_eq!(there["gpu"]["round_trips_an_iteration"], json!(1.0));
    assert!(there["gpu"]["dispatches"].as_u64().unwrap() > 100);
    assert!(here.get("gpu").is_none());
    let after = |report: &serde_json::Value| report["weighted_residual"]["after"].as_f64().unwrap();
    assert!((after(&there) / after(&here) - 1.0).abs() < 1e-5);
    let page = String::from_utf8(desk.read("gpu/report.html")).unwrap();
    assert!(page.contains("round trips (1.0 an iteration)"));
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn a_benchmark_leaves_out_what_an_adapter_cannot_do() {
    let desk = Desk::with(&super::volume::scene());
    let name = adapter().name;
    let bench = ["bench", "scene.json", "--quick", "--only-cases", "--rows", "40", "--backend", "gpu"];
    desk.run_in(&[&bench[..], &["--adapter", &name, "-q"]].concat(), &[]).exits_with(0);
    let bench = desk.json("out/bench/bench.json");
    let cases: Vec<&str> =
        bench["records"].as_array().unwrap().iter().map(|record| record["case"].as_str().unwrap()).collect();
    let has = |case: &str| cases.contains(&case);
    assert!(has("scene/product/gpu/exact/linear/f32/matrix-free"), "{cases:?}");
    // There is no kernel for marches through volumes; their rows can be kept.
    assert!(has("scene/product/gpu/march 128/linear/f32/assembled"));
    assert!(!has("scene/product/gpu/march 128/linear/f32/matrix-free"));
    assert_eq!(bench["held"]["hold"], bench["held"]["of"]);
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn deterministic_runs_leave_the_same_bytes() {
    let desk = Desk::with(&scene_with("/solve/strategy", json!("matrix-free")));
    let bytes = |out: &str| {
        solved(&desk, out, "gpu", &["--deterministic"], "").exits_with(0);
        assert_eq!(desk.json(&format!("{out}/report.json"))["gpu"]["deterministic"], json!(true));
        desk.read(&format!("{out}/light_map.exr"))
    };
    let first = bytes("0");
    for run in 1..10 {
        assert_eq!(bytes(&run.to_string()), first);
    }
    solved(&desk, "fast", "gpu", &[], "").exits_with(0);
    assert_eq!(desk.json("fast/report.json")["gpu"]["deterministic"], json!(false));
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn faults_of_the_adapter_exit_with_3_and_one_sentence() {
    let desk = Desk::new();
    for (fault, words) in [
        ("compilation", "cannot compile the kernel"),
        ("arithmetic", "computes a matrix and a transpose that do not match"),
        ("memory", "has no room for"),
        ("loss:3", "was lost in the middle of the work"),
        ("loss:9", "was lost in the middle of the work"),
        ("crash:9", "was lost in the middle of the work"),
        ("hang:9", "has not answered for"),
    ] {
        let ran = solved(&desk, "out", "gpu", &[], fault).exits_with(3).tells(words).tells("--backend cpu");
        assert!(ran.out.is_empty());
        assert!(desk.names("out").is_empty(), "{fault} has left {:?}", desk.names("out"));
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn the_processor_takes_over_where_that_is_allowed() {
    let desk = Desk::new();
    for fault in ["compilation", "arithmetic", "memory", "loss:3", "loss:9", "crash:9", "hang:9"] {
        let ran = solved(&desk, fault, "auto", &[], fault).exits_with(0);
        ran.tells("computing on the processor, from the start");
        assert_eq!(desk.json(&format!("{fault}/report.json"))["backend"], "cpu");
    }
    desk.done(&["light-map", "scene.json", "-o", "cpu"]);
    assert_eq!(desk.read("loss:9/light_map.exr"), desk.read("cpu/light_map.exr"));
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn the_checkpoint_survives_a_lost_device() {
    let desk = Desk::new();
    solved(&desk, "out", "gpu", &["--iterations", "4"], "").exits_with(0);
    let checkpoint = desk.read("out/checkpoint");
    solved(&desk, "out", "gpu", &["--resume"], "loss:9").exits_with(3).tells("--resume continues");
    assert_eq!(desk.read("out/checkpoint"), checkpoint);
    // The processor goes on from where the adapter was.
    desk.done(&["light-map", "scene.json", "-o", "out", "--resume", "--backend", "cpu"]);
    desk.done(&["light-map", "scene.json", "-o", "whole"]);
    let stop = |out: &str| desk.json(&format!("{out}/report.json"))["stop"].clone();
    assert_eq!(stop("out"), stop("whole"));
    let after = |out: &str| desk.json(&format!("{out}/report.json"))["weighted_residual"]["after"].as_f64();
    assert!((after("out").unwrap() / after("whole").unwrap() - 1.0).abs() < 1e-5);
}

#[test]
fn without_an_adapter_gpu_exits_with_3_and_auto_uses_the_processor() {
    let desk = Desk::new();
    let ask = |backend: &'static str| ["light-map", "scene.json", "-o", "out", "--backend", backend];
    desk.run(&ask("gpu")).exits_with(3).tells("no adapter at all").tells("use --backend cpu");
    assert!(!desk.path("out").exists());
    desk.run(&[&ask("gpu")[..], &["--adapter", "RTX"]].concat()).exits_with(3).tells("`RTX` is not there");
    desk.run(&[&ask("auto")[..], &["--adapter", "RTX"]].concat()).exits_with(0).tells("`RTX` is not there");
    desk.run(&[&ask("cpu")[..], &["--adapter", "RTX"]].concat()).exits_with(1).tells("--adapter");
    // To have no adapter is usual, and nothing to be told of.
    assert!(!desk.done(&ask("auto")).err.contains("adapter"));
    assert_eq!(desk.json("out/report.json")["backend"], "cpu");
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn doctor_and_check_know_the_adapter() {
    let desk = Desk::new();
    let doctor = desk.run_in(&["doctor", "--json"], &[]).exits_with(0).json();
    let listed = doctor["adapters"].as_array().unwrap();
    let mine = listed.iter().find(|listed| listed["name"] == json!(adapter().name)).unwrap();
    assert_eq!(mine["verdict"], json!({ "Ok": null }));
    assert!(mine["binding_limit"].as_u64().unwrap() >= 128 << 20);
    let words = desk.run_in(&["doctor"], &[]).exits_with(0).out;
    assert!(words.contains(&adapter().name) && words.contains("right"), "{words}");

    let check = ["check", "scene.json", "--backend", "gpu", "--adapter", &adapter().name];
    let checked = desk.run_in(&check, &[]).exits_with(0).out;
    for way in ["gpu, assembled", "gpu, matrix-free", "gpu, fixed point", "gpu, epipolar"] {
        assert_eq!(checked.matches(way).count(), 3, "{checked}");
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn surfaces_can_be_rasterized_where_there_is_an_adapter() {
    let desk = Desk::new();
    solved(&desk, "drawn", "gpu", &["--rasterize"], "").exits_with(0);
    solved(&desk, "traced", "gpu", &[], "").exits_with(0);
    let after = |out: &str| desk.json(&format!("{out}/report.json"))["weighted_residual"]["after"].as_f64();
    assert!((after("drawn").unwrap() / after("traced").unwrap() - 1.0).abs() < 0.02);
    desk.run(&["light-map", "scene.json", "-o", "out", "--backend", "cpu", "--rasterize"])
        .exits_with(3)
        .tells("cannot rasterize");
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn light_beyond_what_the_sums_hold_is_refused_and_within_it_makes_no_difference() {
    for radiance in [1e-22, 1e22] {
        let desk = Desk::with(&scene_with("/light/radiance", json!(radiance)));
        solved(&desk, "out", "gpu", &[], "").exits_with(3).tells("is beyond what they hold");
        solved(&desk, "out", "auto", &[], "").exits_with(0).tells("computing on the processor");
    }
    let after = |radiance: f64| {
        let desk = Desk::with(&scene_with("/light/radiance", json!(radiance)));
        solved(&desk, "out", "gpu", &[], "").exits_with(0);
        desk.json("out/report.json")["weighted_residual"]["after"].as_f64().unwrap()
    };
    let usual = after(4.0);
    for radiance in [4e-15, 4e14] {
        assert!((after(radiance) / usual - 1.0).abs() < 1e-3, "{radiance}");
    }
}
