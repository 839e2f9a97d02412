//! Which looks, lenses, glass, adapters and ways to compute go together: the table of docs/looks.md, cell by cell.

use std::sync::Arc;

use serde_json::{Value, json};
use unscatter::io::scene_file;
use unscatter::operator::{FromHost, adjoint_test};
use unscatter::problem::{Canvas, DrawnLight, LightMapProblem, Problem, Renderer, fit};
use unscatter::scene::{Rgb, Scene, Strategy};
use unscatter::visibility::Geometry;

/// Every look by its name in the table.
const LOOKS: [(&str, &str); 8] = [
    ("fill", r#"{"occluders": [{"fill": {"texels": 3}}]}"#),
    ("extrude", r#"{"occluders": [{"extrude": {"view": "room", "texels": 6}}]}"#),
    ("pierce", r#"{"occluders": [{"pierce": {"size": 0.5, "share": 0.3}}]}"#),
    (
        "factor",
        r##"{"transfer": {"layers": [{"gradient": {"along": "depth", "from": "#ff8040", "to": "#4080ff"}}]}}"##,
    ),
    (
        "color",
        r##"{"transfer": {"as": "color", "strength": 0.5, "layers": [{"solid": {"color": [0.1, 0.4, 0.2]}}]}}"##,
    ),
    (
        "heterogeneity",
        r#"{"heterogeneity": {"noise": {"size": 3, "voxels": 32, "cells": 3, "octaves": 3},
            "intensity": {"strokes": [{"value": 3, "view": "room", "distance": 4, "pixels": [[12, 12]], "radius": 1}]}}}"#,
    ),
    ("surfaces", r#"{"surfaces": {"environment": {"radiance": [0.4, 0.6, 1]}}}"#),
    ("all of them", ""),
];

/// All methods.
const METHODS: [&str; 9] =
    ["fista", "spectral", "lbfgs", "mprgp", "flexible-cgls", "clamped-cgls", "cgls", "lsqr", "lsmr"];

const PINHOLE: &str = r#"{"fov": 60}"#;
const FISHEYE: &str =
    r#"{"lens": {"fisheye": true, "focal_length": [18, 18], "principal_point": [12, 12], "k1": 0.02}}"#;

/// A room below a roof with a window, which may be of glass; the light that comes through is painted.
fn room(looks: &str, lens: &str, has_glass: bool, sets: &[String]) -> Scene {
    let mut camera: Value = serde_json::from_str(lens).unwrap();
    camera["to_world"] = json!({"look_at": {"origin": [1.5, 1.2, 5], "target": [0, 1.5, 0]}});
    camera["size"] = json!([24, 24]);
    let plane = |center: [f64; 3], width: f64, depth: f64, passes: [f64; 3]| json!({"plane": {"center": center, "sides": [[0, 0, depth], [width, 0, 0]], "albedo": 0.4, "transmittance": passes}});
    let mut occluders = vec![
        plane([-3.0, 3.0, 0.0], 4.0, 10.0, [0.0; 3]),
        plane([3.0, 3.0, 0.0], 4.0, 10.0, [0.0; 3]),
        plane([0.0, 0.0, 0.0], 20.0, 20.0, [0.0; 3]),
    ];
    if has_glass {
        occluders.push(plane([0.0, 3.0, 0.0], 2.0, 10.0, [0.9, 0.5, 0.2]));
    }
    let looks: Value = match looks {
        "" => LOOKS.iter().filter(|(name, _)| !["color", "all of them"].contains(name)).fold(
            json!({"occluders": []}),
            |mut all, (_, look)| {
                let look: Value = serde_json::from_str(look).unwrap();
                for (key, value) in look.as_object().unwrap() {
                    match value.as_array() {
                        Some(edits) => all["occluders"].as_array_mut().unwrap().extend(edits.clone()),
                        None => all[key] = value.clone(),
                    }
                }
                all
            },
        ),
        one => serde_json::from_str(one).unwrap(),
    };
    let document = json!({
        "version": 1,
        "light": {"direction": [0.1, -1, 0], "radiance": [4, 3.5, 3]},
        "medium": {"sigma_t": 0.05},
        "occluders": occluders,
        "views": [{"name": "room", "camera": camera, "strokes": [{"points": [[8, 10], [16, 14]], "radius": 4, "color": "#ff8020"}]}],
        "looks": looks,
        "shadow_map": {"size": 128, "extent": {"min": [-8, -8], "max": [8, 8]}},
        "light_map": {"size": 16, "extent": {"min": [-3, -3], "max": [3, 3]}}
    });
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.json");
    std::fs::write(&path, document.to_string()).unwrap();
    scene_file::load(&path, sets).unwrap()
}

/// Every look under both lenses, with and without glass.
fn each(mut run: impl FnMut(&str, &Scene)) {
    for (name, looks) in LOOKS {
        for (lens_name, lens) in [("pinhole", PINHOLE), ("fisheye", FISHEYE)] {
            for has_glass in [false, true] {
                let scene = room(looks, lens, has_glass, &[]);
                run(&format!("{name}, {lens_name}, glass: {has_glass}"), &scene);
            }
        }
    }
}

/// What the rows show of a light map is what its picture shows.
#[test]
fn rows_of_every_look_are_its_pictures() {
    each(|name, scene| {
        let problem = LightMapProblem::new(scene).unwrap();
        let operator = problem.on_cpu(Strategy::Assembled, u64::MAX).unwrap();
        assert!(adjoint_test(&operator, 3, 5).unwrap().error < 1e-6, "{name}");
        let x: Vec<Rgb> =
            (0..problem.elements()).map(|i| [1.0 + (i % 5) as f32, 1.0, 0.25 * (i % 3) as f32]).collect();
        let shown = operator.shown(&x).unwrap();
        let maps =
            fit(scene, &scene.light_map, &Arc::new(Geometry::new(scene.mesh.clone()).unwrap())).unwrap();
        let renderer = Renderer::new(scene, &maps, Some(&x)).unwrap().showing(DrawnLight::Scattered);
        let picture = renderer.picture(0, &Canvas::Processor).unwrap().after;
        let most = picture.pixels.iter().flatten().copied().fold(0.0, f32::max);
        assert!(most > 0.1, "{name}: nothing is seen");
        for (row, pixel) in problem.constraints.iter().enumerate() {
            let drawn = picture.at(pixel.x, pixel.y);
            for c in 0..3 {
                let found = shown[row][c] + problem.known_radiance[row][c];
                assert!((found - drawn[c]).abs() <= 2e-5 * most, "{name}: {found} and {}", drawn[c]);
            }
        }
    });
}

/// Methods, ways to keep rows and what is looked for.
#[test]
fn every_look_is_solved_with_every_method() {
    for (name, looks) in LOOKS {
        for method in METHODS {
            let sets = [format!("solve.solver={method}"), "solve.iterations=40".to_owned()];
            let found =
                unscatter::job::Job::new(room(looks, PINHOLE, true, &sets)).solve(&mut unscatter::job::Quiet);
            let residual =
                found.unwrap_or_else(|error| panic!("{name}, {method}: {error}")).report().weighted_residual;
            // A method that stays inside the bounds may stay where it begins, at the upper ones.
            assert!(residual.after <= residual.before, "{name}, {method}: {residual:?}");
        }
        let free = room(looks, PINHOLE, true, &["solve.strategy=matrix-free".to_owned()]);
        unscatter::job::Job::new(free)
            .solve(&mut unscatter::job::Quiet)
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        let found = room(looks, PINHOLE, false, &["find=transfer".to_owned()]);
        unscatter::job::Job::new(found)
            .solve(&mut unscatter::job::Quiet)
            .unwrap_or_else(|error| panic!("{name}: {error}"));
    }
}

/// The same pictures and rows as the processor's.
#[cfg(feature = "gpu")]
#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn every_look_is_on_an_adapter_what_it_is_on_the_processor() {
    let gpu = crate::gpu::gpu();
    each(|name, scene| {
        let problem = LightMapProblem::new(scene).unwrap();
        let x: Vec<Rgb> = (0..problem.elements()).map(|i| [1.0 + (i % 5) as f32, 1.0, 0.25]).collect();
        let host = problem.on_cpu(Strategy::Assembled, u64::MAX).unwrap().shown(&x).unwrap();
        let most = host.iter().flatten().copied().fold(0.0, f32::max);
        for strategy in [Strategy::Assembled, Strategy::MatrixFree] {
            let device = problem.on_gpu(&gpu, strategy, u64::MAX, false).unwrap().shown(&x).unwrap();
            for (a, b) in host.iter().flatten().zip(device.iter().flatten()) {
                assert!((a - b).abs() <= 2e-5 * most, "{name}, {strategy:?}: {a} and {b}");
            }
        }
        let maps =
            fit(scene, &scene.light_map, &Arc::new(Geometry::new(scene.mesh.clone()).unwrap())).unwrap();
        let renderer = Renderer::new(scene, &maps, Some(&x)).unwrap();
        let [host, device] = [Canvas::Processor, Canvas::Adapter(gpu.clone())]
            .map(|canvas| renderer.picture(0, &canvas).unwrap().after);
        let most = host.pixels.iter().flatten().copied().fold(0.0, f32::max);
        for (a, b) in host.pixels.iter().flatten().zip(device.pixels.iter().flatten()) {
            assert!((a - b).abs() <= 3e-5 * most, "{name}: {a} and {b}");
        }
        // First hits and shadow maps by a depth pass: all but silhouettes are the same.
        let surfaces = unscatter::problem::Rasterized(gpu.clone());
        let geometry = Arc::new(Geometry::new(scene.mesh.clone()).unwrap());
        let painted = unscatter::problem::constraints(scene).unwrap();
        let rasterized = LightMapProblem::of(scene, &geometry, painted, &surfaces).unwrap();
        let plain: f64 = problem.plain.iter().map(|plain| f64::from(plain[1])).sum();
        let drawn: f64 = rasterized.plain.iter().map(|plain| f64::from(plain[1])).sum();
        assert!((drawn - plain).abs() <= 0.05 * plain, "{name}: {drawn} and {plain}");
    });
}
