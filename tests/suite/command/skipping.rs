//! What is skipped can be switched off, and no result depends on it.

use serde_json::{Value, json};

use super::pictures::exr;
use super::{Desk, scene, volume};
use crate::tolerances::SAME_SOLUTION;

fn solved(desk: &Desk, more: &[&str]) -> (Value, Vec<[f32; 3]>) {
    let report = desk
        .done(&[&["light-map", "scene.json", "-o", "out", "--json", "--backend", "cpu"], more].concat())
        .json();
    (report, exr(&desk.path("out/light_map.exr")).1)
}

/// The largest difference relative to the brightest texel.
fn apart(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let [a, b] = [a.as_flattened(), b.as_flattened()];
    let brightest = a.iter().fold(0.0f32, |most, value| most.max(value.abs()));
    let most = a.iter().zip(b).fold(0.0f32, |most, (a, b)| most.max((a - b).abs()));
    f64::from(most / brightest)
}

fn count(report: &Value, what: &str) -> u64 {
    report["skipped"][what]["count"].as_u64().unwrap()
}

#[test]
fn a_light_map_is_the_same_whatever_is_skipped() {
    let desk = Desk::new();
    let (usual, found) = solved(&desk, &[]);
    for (switch, counted) in [("pixels", Some("pixels")), ("unknowns", Some("unknowns")), ("shadows", None)] {
        let off = format!("solve.skip.{switch}=false");
        let (report, texels) = solved(&desk, &["--set", &off]);
        let apart = apart(&found, &texels);
        assert!(apart < SAME_SOLUTION, "{switch}: {apart:e}");
        if let Some(counted) = counted {
            assert!(count(&usual, counted) > 0);
            assert_eq!(count(&report, counted), 0);
        }
        // What a person reads of the match is about painted pixels, however many are rows.
        assert_eq!(report["views"][0]["pixels"], usual["views"][0]["pixels"]);
    }
    let (_, brighter) = solved(&desk, &["--set", "light.radiance=4.001"]);
    assert!(apart(&found, &brighter) > SAME_SOLUTION);
}

#[test]
fn channels_that_have_converged_can_go_on() {
    let desk = Desk::new();
    let limits = ["--set", "solve.tolerance=1e-3", "--set", "solve.iterations=500"];
    let (usual, _) = solved(&desk, &limits);
    let (report, _) = solved(&desk, &[&limits[..], &["--set", "solve.skip.channels=false"]].concat());
    assert!(count(&usual, "channel_iterations") > 0);
    assert_eq!(count(&report, "channel_iterations"), 0);
}

#[test]
fn a_volume_is_the_same_to_the_bit_with_empty_bricks_entered() {
    let desk = Desk::with(&volume::scene());
    let mut found = Vec::new();
    for more in [&[][..], &["--set", "solve.skip.bricks=false"]] {
        desk.done(&[&["volume", "scene.json", "-o", "out", "--quiet", "--backend", "cpu"], more].concat());
        found.push(desk.read("out/emission.npy"));
    }
    assert!(found[0] == found[1]);
}

#[test]
fn a_switch_that_would_change_the_problem_is_refused() {
    let mut scene = scene();
    scene["solve"] = json!({ "gradient": 0.01 });
    let desk = Desk::with(&scene);
    let ran = desk.run(&["light-map", "scene.json", "--set", "solve.skip.shadow=false"]).exits_with(1);
    assert!(ran.tells("shadows").told().contains("skip"));
}
