//! Heterogeneous air: rows and pictures are multiplied by the mean of noise and blend volumes along each ray.

use std::sync::Arc;

use unscatter::operator::{CpuVector, FromHost, LinearOperator, adjoint_test};
use unscatter::problem::{
    Canvas, DrawnLight, LightMapProblem, Problem, Renderer, Traced, TransferProblem, UnseenAir, constraints,
    fit, unseen_air,
};
use unscatter::scene::{Image, Rgb, Scene, Strategy};
use unscatter::visibility::Geometry;

use crate::looks::{loaded_with, scene};

/// Noise with all three volumes painted, from a view and in the world.
const AIR: &str = r#""heterogeneity": {
    "noise": {"size": 3, "voxels": 32, "octaves": 3, "cells": 3}, "voxels": 24, "quadrature": "exact",
    "amount": {"strokes": [{"value": 0.3, "view": "front", "distance": 6, "pixels": [[10, 10], [30, 30]], "radius": 1}]},
    "frequency": {"strokes": [{"value": 2.5, "points": [[0, 1, 1]], "normal": [0, 0, 1], "radius": 2, "depth": 3}]},
    "intensity": {"base": 1.5, "strokes": [
        {"value": 4, "points": [[0, 2, -1], [1, 2, -1]], "normal": [0, 1, 0], "radius": 1},
        {"erase": true, "points": [[1, 2, -1]], "normal": [0, 1, 0], "radius": 0.8, "hardness": 0}
    ]}
}"#;

fn looks(more: &str) -> String {
    format!("{{{AIR}{more}}}")
}

fn geometry(scene: &Scene) -> Arc<Geometry> {
    Arc::new(Geometry::new(scene.mesh.clone()).unwrap())
}

fn scattered(scene: &Scene) -> Image {
    let maps = fit(scene, &scene.light_map, &geometry(scene)).unwrap();
    let renderer = Renderer::new(scene, &maps, None).unwrap().showing(DrawnLight::Scattered);
    renderer.picture(0, &Canvas::Processor).unwrap().before
}

#[test]
fn rows_and_pictures_are_multiplied_by_the_mean_along_their_rays() {
    let of = |looks: &str| LightMapProblem::new(&scene(looks)).unwrap();
    let (uneven, even) = (of(&looks("")), of("{}"));
    let (with, without) = (scattered(&scene(&looks(""))), scattered(&scene("{}")));
    let camera = scene("{}").views[0].camera.clone();
    let mut factors = Vec::new();
    for (row, pixel) in even.constraints.iter().enumerate() {
        let length = even.traversal.rays()[row].length;
        let factor = uneven.maps.air_factor(&camera.pixel_ray(pixel.x, pixel.y), length);
        factors.push(factor);
        let [mut found, mut expected] = [Vec::new(), Vec::new()];
        uneven.row(row, &mut |texel, weight| found.push((texel, weight)));
        even.row(row, &mut |texel, weight| expected.push((texel, weight)));
        assert_eq!(found.len(), expected.len());
        for ((texel, weight), (expected_texel, expected)) in found.into_iter().zip(expected) {
            assert_eq!(texel, expected_texel);
            assert!((0..3).all(|c| (weight[c] - factor * expected[c]).abs() <= 1e-12 * weight[c]));
        }
        let [with, without] = [&with, &without].map(|picture| picture.at(pixel.x, pixel.y));
        assert!((0..3).all(|c| (f64::from(with[c]) - factor * f64::from(without[c])).abs() <= 2e-6 * (1.0 + factor)));
    }
    factors.sort_by(f64::total_cmp);
    let [least, most] = [factors[0], factors[factors.len() - 1]];
    assert!(least < 1.4 && most > 1.7, "rays differ: {least} to {most}");
    for strategy in [Strategy::Assembled, Strategy::MatrixFree] {
        assert!(adjoint_test(&uneven.on_cpu(strategy, u64::MAX).unwrap(), 3, 5).unwrap().error < 1e-6);
    }
    let operator = uneven.on_cpu(Strategy::Assembled, u64::MAX).unwrap();
    let explicit = uneven.explicit(u64::MAX).unwrap();
    let x: Vec<Rgb> = (0..uneven.elements()).map(|i| [i as f32 % 7.0, 1.0, 0.5]).collect();
    let (shown, mut expected) = (operator.shown(&x).unwrap(), explicit.range());
    explicit.apply(&CpuVector(x.iter().map(|value| value.map(f64::from)).collect()), &mut expected).unwrap();
    let largest = expected.0.iter().flatten().copied().fold(0.0, f64::max);
    for (shown, expected) in shown.iter().flatten().zip(expected.0.iter().flatten()) {
        assert!((f64::from(*shown) - expected).abs() < 1e-5 * largest);
    }
}

/// A mean of factors is a factor by the mean, whatever else colours light.
#[test]
fn transfer_functions_are_multiplied_with_it() {
    for role in ["factor", "color"] {
        let transfer = format!(
            r##""transfer": {{"as": "{role}", "strength": 0.6, "far": 12, "layers": [
                {{"gradient": {{"along": "depth", "from": "#ffffff", "to": [0.2, 0.5, 1]}}}}]}}"##
        );
        let even = format!("{{{transfer}}}");
        let uneven = looks(&format!(", {transfer}"));
        let [with, without] = [&uneven, &even].map(|looks| LightMapProblem::new(&scene(looks)).unwrap());
        let camera = scene("{}").views[0].camera.clone();
        for (row, pixel) in with.constraints.iter().enumerate() {
            let ray = camera.pixel_ray(pixel.x, pixel.y);
            let factor = with.maps.air_factor(&ray, with.traversal.rays()[row].length);
            for c in 0..3 {
                let expected = factor * f64::from(without.plain[row][c]);
                assert!(
                    (f64::from(with.plain[row][c]) - expected).abs() <= 3e-6 * (1.0 + expected),
                    "{role}"
                );
            }
        }
        // The function is looked for behind the same light.
        let painted = scene(&uneven);
        let problem =
            TransferProblem::of(&painted, &geometry(&painted), constraints(&painted).unwrap(), &Traced)
                .unwrap();
        for row in 0..with.constraints.len() {
            let shown = problem.pixels.plain[row];
            let expected = with.plain[row];
            assert!(
                (0..3).all(|c| (shown[c] - expected[c]).abs() <= 3e-6 * (1.0 + expected[c])),
                "{role}, {row}"
            );
        }
    }
}

#[test]
fn the_same_stroke_is_painted_in_a_view_and_in_the_world() {
    let (view, camera) = (scene(&looks("")), scene("{}").views[0].camera.clone());
    let on_plane = |x: f64, y: f64| {
        let ray = camera.ray(x, y);
        ray.at(6.0 / ray.direction.dot(camera.ahead())).to_array()
    };
    let ahead = camera.ahead().to_array();
    let points = [on_plane(10.0, 10.0), on_plane(30.0, 30.0)];
    let world = looks("").replace(
        r#""view": "front", "distance": 6, "pixels": [[10, 10], [30, 30]]"#,
        &format!(r#""points": {points:?}, "normal": {ahead:?}"#),
    );
    let [a, b] =
        [&view, &scene(&world)].map(|scene| scene.looks.heterogeneity[0].1.blends.amount.strokes[0].clone());
    assert!(
        a.path.iter().zip(&b.path).all(|(a, b)| a.distance(*b) < 1e-12)
            && a.normal.distance(b.normal) < 1e-12
    );
}

#[test]
fn fewer_steps_and_rays_come_near_the_exact_picture() {
    let picture = |quadrature: &str, upsample: usize| {
        let looks = looks("").replace(
            r#""quadrature": "exact""#,
            &format!(r#""quadrature": {quadrature}, "upsample": {upsample}"#),
        );
        scattered(&scene(&looks))
    };
    let exact = picture(r#""exact""#, 1);
    let plain = scattered(&scene("{}"));
    let error = |of: &Image, from: &Image| {
        let apart =
            of.pixels.iter().zip(&from.pixels).map(|(a, b)| f64::from(a[0] - b[0]).powi(2)).sum::<f64>();
        (apart / from.pixels.iter().map(|pixel| f64::from(pixel[0]).powi(2)).sum::<f64>()).sqrt()
    };
    let march = |steps: u32| format!(r#"{{"march": {{"steps": {steps}}}}}"#);
    let [few, some, many] = [4, 16, 64].map(|steps| error(&picture(&march(steps), 1), &exact));
    assert!(many < some && some < few && many < 5e-3, "{few}, {some}, {many}");
    let [fine, coarse] = [2, 8].map(|upsample| error(&picture(r#""exact""#, upsample), &exact));
    assert!(3.0 * fine < coarse && coarse < error(&plain, &exact), "{fine}, {coarse}");
}

/// What a job writes as OpenVDB is the same air when a scene names it.
#[test]
fn blend_volumes_come_back_from_their_file() {
    let folder = tempfile::tempdir().unwrap();
    let painted = loaded_with(folder.path(), &looks(""), &[]).unwrap();
    let found = unscatter::job::Job::new(painted.clone()).solve(&mut unscatter::job::Quiet).unwrap();
    found.write(folder.path().join("out")).unwrap();
    let maps = fit(&painted, &painted.light_map, &geometry(&painted)).unwrap();
    let [low, high] =
        maps.heterogeneity.as_ref().unwrap().fields()[0].1.grid().bounds().map(|it| it.to_array());
    let from_file =
        |grid: &str, base: f64| format!(r#"{{"base": {base}, "file": "out/air.vdb", "grid": "{grid}"}}"#);
    let read = format!(
        r#"{{"heterogeneity": {{
            "noise": {{"size": 3, "voxels": 32, "octaves": 3, "cells": 3}}, "voxels": 24, "quadrature": "exact",
            "bounds": {{"min": {low:?}, "max": {high:?}}},
            "amount": {}, "frequency": {}, "intensity": {}}}}}"#,
        from_file("amount", 1.0),
        from_file("frequency", 0.0),
        from_file("intensity", 1.5)
    );
    let read = loaded_with(folder.path(), &read, &[]).unwrap();
    let [painted, read] = [&painted, &read].map(scattered);
    for (a, b) in painted.pixels.iter().zip(&read.pixels) {
        assert!((a[0] - b[0]).abs() <= 1e-5 * (1.0 + a[0]));
    }
}

#[test]
fn baked_air_is_near_what_was_baked() {
    let [apart, baked] = ["", r#""bake": 128,"#].map(|bake| {
        scattered(&scene(&looks("").replace(r#""voxels": 24,"#, &format!(r#""voxels": 24, {bake}"#))))
    });
    assert_ne!(apart, baked);
    for (a, b) in apart.pixels.iter().zip(&baked.pixels) {
        assert!((a[0] - b[0]).abs() <= 0.03 * (0.1 + a[0]), "{a:?} and {b:?}");
    }
}

#[test]
fn air_between_two_keys_is_part_of_each_and_wind_moves_it() {
    let of = |offset: f64| {
        let noise = format!(r#""noise": {{"offset": [{offset}, 0, 0], "#);
        scene(&looks("").replace(r#""noise": {"#, &noise)).looks
    };
    let (here, there) = (of(0.0), of(2.0));
    let between = here.between(&there, 0.25);
    let [(1.0, moved)] = &between.heterogeneity[..] else { panic!("one air that moves") };
    assert_eq!(moved.noise.offset.x, 0.5);
    let even = scene("{}").looks;
    let plain =
        |looks: unscatter::scene::Looks| LightMapProblem::new(&Scene { looks, ..scene("{}") }).unwrap().plain;
    let half = plain(here.between(&even, 0.5));
    let [uneven, even] = [plain(here), plain(even)];
    for row in 0..half.len() {
        let expected = 0.5 * (uneven[row][0] + even[row][0]);
        assert!((half[row][0] - expected).abs() <= 2e-6 * (1.0 + expected));
    }
}

#[test]
fn what_no_view_sees_is_told() {
    let unseen = |looks: &str| {
        let scene = scene(looks);
        unseen_air(&scene, &geometry(&scene))
    };
    assert_eq!(unseen(&looks("")), []);
    let boxed = r#"{"heterogeneity": {"bounds": {"min": [50, 50, 50], "max": [51, 51, 51]}}}"#;
    assert_eq!(unseen(boxed), [UnseenAir::Box]);
    // Behind the camera, but in the box.
    let behind = r#"{"heterogeneity": {"bounds": {"min": [-9, -9, -9], "max": [9, 9, 20]}, "amount": {"strokes": [
        {"value": 0, "points": [[0, 2, 0]], "normal": [0, 0, 1], "radius": 2},
        {"value": 0, "points": [[0, 2, 15]], "normal": [0, 0, 1], "radius": 2}
    ]}}}"#;
    assert_eq!(unseen(behind), [UnseenAir::Stroke("amount", 1)]);
}

#[test]
fn air_that_cannot_be_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let grid = unscatter::scene::VoxelGrid::over_cube([2; 3], glam::DAffine3::IDENTITY).unwrap();
    let volume = unscatter::scene::Volume::constant(grid, [1.0; 3]).unwrap();
    let write = unscatter::io::volume::write;
    write(&folder.path().join("nowhere.npy"), "v", &volume, unscatter::io::volume::Format::Npy).unwrap();
    let told = |air: &str, told: &str| {
        let looks = format!(r#"{{"heterogeneity": {{{air}}}}}"#);
        let loaded = loaded_with(folder.path(), &looks, &[]);
        let error = loaded.and_then(|scene| fit(&scene, &scene.light_map, &geometry(&scene)));
        let error = error.unwrap_err().to_string();
        assert!(error.contains(told), "{air}: {error}");
    };
    let stroke =
        |stroke: &str, words: &str| told(&format!(r#""amount": {{"strokes": [{{{stroke}}}]}}"#), words);
    told(
        r#""noise": {"voxels": 1000}"#,
        "looks.heterogeneity.noise.voxels: 1000 is not allowed; it must be from 8 to 256",
    );
    told(r#""noise": {"voxels": 100}"#, "a power of two");
    told(r#""noise": {"octaves": 9}"#, "noise.octaves: 9 is not allowed; it must be from 1 to 8");
    told(
        r#""noise": {"octaves": 8}"#,
        "the last of 8 octaves has 512 cells a side, for which 128 voxels are too few",
    );
    told(r#""noise": {"cells": 1000}"#, "noise.cells: 1000");
    told(r#""noise": {"size": 0}"#, "noise.size: 0");
    told(r#""noise": {"size": 1e300}"#, "noise.size");
    told(r#""noise": {"offset": [1e300, 0, 0]}"#, "noise.offset");
    told(r#""voxels": 1000"#, "voxels: 1000 is not allowed; it must be from 2 to 256");
    told(r#""bake": 1"#, "bake: 1 is not allowed");
    told(r#""upsample": 0"#, "upsample: 0 is not allowed; it must be from 1 to 64");
    told(r#""quadrature": {"march": {"steps": 0}}"#, "steps: 0");
    told(r#""bounds": {"min": [0, 0, 0], "max": [1, 0, 1]}"#, "bounds.max");
    told(r#""amount": {"base": 2}"#, "amount.base: 2 is not allowed; it must be from 0 to 1");
    told(r#""frequency": {"base": 9}"#, "frequency.base: 9 is not allowed; it must be from 0 to 7");
    told(r#""intensity": {"base": -1}"#, "intensity.base");
    told(r#""amount": {"grid": "density"}"#, "amount.grid: it is one of a file");
    told(r#""amount": {"file": "none.vdb"}"#, "none.vdb");
    told(r#""amount": {"file": "nowhere.npy"}"#, "does not say where its voxels lie");
    stroke(r#""value": 1, "radius": 1"#, "strokes[0]: say where it is");
    stroke(
        r#""radius": 1, "points": [[0, 0, 0]], "normal": [0, 0, 1]"#,
        "either a `value`, or `\"erase\": true`",
    );
    stroke(
        r#""value": 1, "radius": 0, "points": [[0, 0, 0]], "normal": [0, 0, 1]"#,
        "radius: 0 is not allowed",
    );
    stroke(r#""value": 1, "radius": 1, "points": [[0, 0, 0]], "normal": [0, 0, 0]"#, "normal");
    stroke(r#""value": 1, "radius": 1, "points": [], "normal": [0, 0, 1]"#, "points: 0 is not allowed");
    stroke(
        r#""value": 1, "radius": 1, "view": "side", "distance": 1, "pixels": [[1, 1]]"#,
        "no view is called `side`",
    );
    stroke(r#""value": 1, "radius": 1, "view": "front", "distance": -1, "pixels": [[1, 1]]"#, "distance: -1");
    stroke(
        r#""value": 1, "radius": 1, "points": [[500, 0, 0]], "normal": [0, 0, 1]"#,
        "looks.heterogeneity.amount.strokes[0]: a stroke beside the box of the blend volumes",
    );
    stroke(
        r#""value": 1, "radius": 1e-4, "points": [[0, 0, 0]], "normal": [0, 0, 1]"#,
        "thinner than a voxel",
    );
}
