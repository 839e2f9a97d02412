//! Pictures of scattered light over slices: time and error beside the exact rows.
//!
//!     cargo bench --bench epipolar
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench that cannot go on should stop")]
#![allow(clippy::print_stdout, reason = "figures are what it is for")]

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;
use unscatter::io::scene_file::load;
use unscatter::march::{
    EpipolarSettings, EpipolarTraversal, LightMapTransport, LightMapTraversal, Traversal, ViewRay,
};
use unscatter::problem::fit;
use unscatter::visibility::Geometry;

fn main() {
    let args: Vec<String> = std::env::args().filter(|it| it != "--bench").skip(1).collect();
    let number = |at: usize, or: f64| args.get(at).and_then(|it| it.parse().ok()).unwrap_or(or);
    let map = number(0, 1024.0) as usize;
    let settings = EpipolarSettings {
        slices: number(1, 1.0),
        samples: number(2, 1024.0) as usize,
        tolerance: number(3, 1e-4),
        density: number(4, 1.0),
        between: number(5, 0.0) > 0.5,
    };
    for name in ["citadel", "nave", "forest"] {
        let sets = [
            "views[0].camera.size=[1920,1080]".to_owned(),
            format!("shadow_map.size={map}"),
            format!("light_map.size={map}"),
        ];
        let scene = load(Path::new(&format!("strokes/{name}.json")), &sets).unwrap();
        let geometry = Arc::new(Geometry::new(scene.mesh.clone()).unwrap());
        let maps = fit(&scene, &scene.light_map, &geometry).unwrap();
        let camera = &scene.views[0].camera;
        let [width, height] = camera.size();
        let rays: Vec<ViewRay> = (0..width * height)
            .into_par_iter()
            .map(|pixel| {
                let ray = camera.pixel_ray(pixel % width, pixel / width);
                let length =
                    geometry.first_hit(&ray, f64::INFINITY).map_or(f64::INFINITY, |hit| hit.distance);
                maps.view_ray(&ray, length, &scene.medium).0
            })
            .collect();
        let transport = LightMapTransport {
            sigma_t: scene.medium.sigma_t,
            shadow_map: maps.shadow_map.clone(),
            light_map: maps.light_map,
            basis: scene.solve.basis,
            quadrature: scene.solve.quadrature,
            transmittance_bound: scene.solve.transmittance_bound,
            mask: None,
        };
        let exact = LightMapTraversal::new(transport, rays.into());
        let clock = Instant::now();
        let angle = |row: usize| camera.pixel_angle(row % width, row / width);
        let epipolar = EpipolarTraversal::new(&exact, &angle, settings).unwrap();
        let setup = clock.elapsed().as_secs_f64();
        let grid = maps.light_map;
        let texels: Vec<[f32; 3]> = (0..grid.len())
            .map(|i| {
                let (x, y) = (
                    (i % grid.size[0]) as f64 / grid.size[0] as f64,
                    (i / grid.size[0]) as f64 / grid.size[1] as f64,
                );
                [
                    (0.5 + 0.5 * (12.0 * x).sin()) as f32,
                    (0.5 + 0.5 * (9.0 * y).cos()) as f32,
                    (0.5 + 0.5 * (20.0 * (x + y)).sin()) as f32,
                ]
            })
            .collect();
        let mut times = Vec::new();
        let mut shown = Vec::new();
        for _ in 0..5 {
            let clock = Instant::now();
            shown = epipolar.shown(&texels);
            times.push(clock.elapsed().as_secs_f64());
        }
        let clock = Instant::now();
        let truth: Vec<[f64; 3]> = (0..width * height)
            .into_par_iter()
            .map(|row| Traversal::<f64, 1>::gather(&exact, row, &texels))
            .collect();
        let walked = clock.elapsed().as_secs_f64();
        let y: Vec<[f32; 3]> = (0..width * height).map(|i| [(i % 7) as f32; 3]).collect();
        let clock = Instant::now();
        let _ = Traversal::<f64, 1>::scatter_rows::<f32>(&epipolar, y.len(), &|row| (row, y[row]), 0);
        let back = clock.elapsed().as_secs_f64();
        let top = truth.iter().flatten().copied().fold(0.0, f64::max);
        let srgb = |x: f64| if x <= 0.0031308 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
        let mut linear: Vec<f64> = truth
            .iter()
            .zip(&shown)
            .map(|(a, b)| (0..3).map(|c| (a[c] - f64::from(b[c])).abs()).fold(0.0, f64::max) / top)
            .collect();
        let coded = truth
            .iter()
            .zip(&shown)
            .filter(|(a, b)| {
                (0..3).all(|c| (255.0 * (srgb(a[c] / top) - srgb(f64::from(b[c]) / top))).abs() < 1.0)
            })
            .count();
        linear.sort_by(f64::total_cmp);
        let within = linear.partition_point(|e| *e < 1.0 / 255.0) as f64 / linear.len() as f64;
        times.sort_by(f64::total_cmp);
        println!(
            "{name}: {} fans, {} samples, {} terms, {} MiB; set-up {setup:.3} s, T x {:.3} s, T' y {back:.3} s, exact {walked:.2} s; median {:.1e}, 99 % {:.1e}, most {:.1e}; within 1/255 {:.3} %, coded {:.3} %",
            epipolar.fans().fans().len(),
            epipolar.fans().samples(),
            epipolar.fans().most_terms(),
            epipolar.bytes() >> 20,
            times[2],
            linear[linear.len() / 2],
            linear[linear.len() * 99 / 100],
            linear[linear.len() - 1],
            100.0 * within,
            100.0 * coded as f64 / linear.len() as f64
        );
    }
}
