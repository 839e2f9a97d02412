//! The depth pass against rays through the hierarchy.

use unscatter::io::scene_file;
use unscatter::problem::{Constraint, LightMapProblem, Rasterized, Surfaces, Traced};
use unscatter::scene::{Extent, Grid, Scene};
use unscatter::visibility::ShadowMap;

use super::gpu;
use crate::tolerances::SILHOUETTES;

fn demo(name: &str) -> Scene {
    scene_file::load(&crate::root().join(format!("strokes/{name}.json")), &[]).unwrap()
}

/// The share of numbers that are not the same to the last digits of f32.
fn differ(a: &[f64], b: &[f64]) -> f64 {
    let same = |a: f64, b: f64| a == b || (a - b).abs() <= 1e-6 * a.abs().max(b.abs());
    let other = a.iter().zip(b).filter(|&(&a, &b)| !same(a, b)).count();
    other as f64 / a.len() as f64
}

fn depths(map: &ShadowMap) -> Vec<f64> {
    let [width, height] = map.grid().size;
    (0..width * height).map(|k| f64::from(map.depth(k % width, k / width))).collect()
}

/// Every pixel of every view.
fn all_pixels(scene: &Scene) -> Vec<Constraint> {
    let of_view = |view: usize| {
        let [width, height] = scene.views[view].camera.size();
        let pixel = move |k| Constraint {
            view,
            x: k % width,
            y: k / width,
            color: [1.0; 3],
            opacity: 1.0,
            weight: 1.0,
        };
        (0..width * height).map(pixel)
    };
    (0..scene.views.len()).flat_map(of_view).collect()
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn surfaces_are_those_that_rays_meet() {
    let rasterized = Rasterized(gpu());
    for name in ["citadel", "forest", "nave"] {
        let scene = demo(name);
        let problem = LightMapProblem::new(&scene).unwrap();
        let (frame, grid) = (problem.maps.frame, *problem.maps.shadow_map.grid());
        let geometry = &problem.maps.geometry;
        let seen = rasterized.shadow_map(geometry, &frame, grid).unwrap();
        let truth = depths(&problem.maps.shadow_map);
        assert_eq!(seen.depth_origin(), problem.maps.shadow_map.depth_origin());
        let share = differ(&depths(&seen), &truth);
        assert!(share <= SILHOUETTES, "{name}: {share} of the shadow map");

        let pixels = all_pixels(&scene);
        let distances = |surfaces: &dyn Surfaces| -> Vec<f64> {
            let hits = surfaces.hits(&scene, geometry, &pixels).unwrap();
            hits.iter().map(|hit| hit.map_or(f64::INFINITY, |hit| hit.distance)).collect()
        };
        let lengths = distances(&rasterized);
        let true_lengths = distances(&Traced);
        let share = differ(&lengths, &true_lengths);
        assert!(share <= SILHOUETTES, "{name}: {share} of the pixels");

        // Half a texel aside everything is different.
        let aside = 0.5 / grid.density();
        let Extent { min, max } = grid.extent;
        let moved = Grid::new(Extent { min: min + aside, max: max + aside }, grid.size).unwrap();
        assert!(
            differ(&depths(&rasterized.shadow_map(geometry, &frame, moved).unwrap()), &truth) > SILHOUETTES
        );
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn a_map_of_several_tiles_has_no_seams() {
    let mut scene = demo("citadel");
    scene.shadow_map.size = [4100, 30];
    let problem = LightMapProblem::new(&scene).unwrap();
    let grid = *problem.maps.shadow_map.grid();
    let seen = Rasterized(gpu()).shadow_map(&problem.maps.geometry, &problem.maps.frame, grid).unwrap();
    assert!(differ(&depths(&seen), &depths(&problem.maps.shadow_map)) <= SILHOUETTES);
}
