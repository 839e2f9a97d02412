//! Edits of shadow maps: how long they take with kernels of different widths.
//!
//!     cargo bench --bench looks
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench that cannot go on should stop")]
#![allow(clippy::print_stdout, reason = "figures are what it is for")]

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use unscatter::io::scene_file::load;
use unscatter::problem::fit;
use unscatter::scene::{
    Extent, Grid, HoleNoise, Holes, Kernel, LightFrame, Mesh, OccluderEdit, OccluderEditKind, Radius,
};
use unscatter::visibility::{Geometry, ShadowMap, edited};

/// Texels a side.
const SIDE: usize = 2048;
/// Each edit is timed so often.
const ROUNDS: usize = 5;

fn main() {
    let grid = Grid::new(Extent { min: DVec2::ZERO, max: DVec2::splat(20.0) }, [SIDE; 2]).unwrap();
    let geometry = Geometry::new(Mesh::default()).unwrap();
    let frame = LightFrame::along(-DVec3::Y);
    // Leaves with gaps.
    let noise = HoleNoise { size: 0.4, octaves: 5, persistence: 0.5, seed: 1 };
    let threshold = noise.threshold(0.4);
    let depth = |texel: usize| {
        let value = noise.at(grid.centre(texel % SIDE, texel / SIDE));
        if value < threshold { f32::INFINITY } else { 5.0 + value as f32 }
    };
    let map = ShadowMap::new(grid, 0.0, &(0..grid.len()).map(depth).collect::<Vec<_>>()).unwrap();
    let eye = frame.world_from_light(DVec3::new(14.0, 3.0, 9.0));
    println!("{:24} {:>8} {:>8} {:>8} {:>8}", "milliseconds, 2048²", 11, 21, 41, 101);
    let time = |kind: &OccluderEditKind| {
        let edits = [OccluderEdit { kind: kind.clone(), strength: 1.0 }];
        let once = || {
            let (map, clock) = (map.clone(), Instant::now());
            let found = edited(map, &geometry, &frame, &edits).unwrap();
            assert!(found.grid() == &grid);
            1e3 * clock.elapsed().as_secs_f64()
        };
        let mut times: Vec<f64> = (0..ROUNDS).map(|_| once()).collect();
        times.sort_by(f64::total_cmp);
        times[ROUNDS / 2]
    };
    type Kind<'k> = &'k dyn Fn(Radius) -> OccluderEditKind;
    let kinds: [(&str, Kind); 4] = [
        ("fill, square", &|radius| OccluderEditKind::Fill(Kernel::Square, radius)),
        ("fill, disc", &|radius| OccluderEditKind::Fill(Kernel::Disc, radius)),
        ("fill, lines", &|radius| OccluderEditKind::Fill(Kernel::Lines(eye), radius)),
        ("extrude", &|radius| OccluderEditKind::Extrude { eye, radius }),
    ];
    for (name, kind) in kinds {
        let times = [5.0, 10.0, 20.0, 50.0].map(|radius| time(&kind(Radius::Texels(radius))));
        println!("{name:24} {:8.0} {:8.0} {:8.0} {:8.0}", times[0], times[1], times[2], times[3]);
    }
    let nothing = time(&OccluderEditKind::Fill(Kernel::Square, Radius::Texels(0.0)));
    println!("{:24} {nothing:8.0}", "the map and its pyramid");
    let pierce = time(&OccluderEditKind::Pierce(Holes::new(Vec::new(), noise, 0.4, None)));
    println!("{:24} {pierce:8.0}", "hole map, 5 octaves");
    for (name, looks) in [
        ("without a function", "{}"),
        ("visibility and depth", r#"{"transfer": {"layers": [{"solid": {"color": [1, 1, 1]}}]}}"#),
        (
            "angle and depth",
            r#"{"transfer": {"axes": ["angle", "depth"], "layers": [{"solid": {"color": [1, 1, 1]}}]}}"#,
        ),
    ] {
        println!("{name:24} {:8.0}", full_hd(looks));
    }
}

/// Milliseconds in which all rays of the citadel's court get their light's colour, 1920 × 1080.
fn full_hd(looks: &str) -> f64 {
    let sets = ["views[0].camera.size=[1920,1080]".to_owned(), format!("looks={looks}")];
    let scene = load(Path::new("strokes/citadel.json"), &sets).unwrap();
    let geometry = Arc::new(Geometry::new(scene.mesh.clone()).unwrap());
    let maps = fit(&scene, &scene.light_map, &geometry).unwrap();
    let camera = &scene.views[0].camera;
    let [width, height] = camera.size();
    let rays = (0..width * height).into_par_iter().map(|pixel| {
        let ray = camera.pixel_ray(pixel % width, pixel / width);
        (ray, geometry.first_hit(&ray, f64::INFINITY).map_or(f64::INFINITY, |hit| hit.distance))
    });
    let rays: Vec<_> = rays.collect();
    let once = || {
        let clock = Instant::now();
        let scattering: f64 = rays
            .par_iter()
            .map(|(ray, length)| maps.view_ray(ray, *length, &scene.medium).0.scattering[0])
            .sum();
        assert!(scattering > 0.0);
        1e3 * clock.elapsed().as_secs_f64()
    };
    let mut times: Vec<f64> = (0..ROUNDS).map(|_| once()).collect();
    times.sort_by(f64::total_cmp);
    times[ROUNDS / 2]
}
