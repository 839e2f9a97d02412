//! Stained glass in pictures: against brute force, and against Mitsuba, whose pictures tests/fixtures/mitsuba/glass.py made.

use std::sync::Arc;

use glam::DVec3;
use serde_json::{Value, json};
use unscatter::io::image::read_image;
use unscatter::io::scene_file;
use unscatter::problem::{Canvas, DrawnLight, Renderer, fit};
use unscatter::scene::{Image, Rgb, Scene};
use unscatter::visibility::Geometry;

use crate::tolerances::{GLASS_BRUTE_FORCE, GLASS_MITSUBA_BIAS, GLASS_MITSUBA_LARGEST, GLASS_MITSUBA_RMS};

/// Lower corners of the four panes in the roof, and what they let through: as in glass.py.
const PANES: [([f64; 2], [f64; 3]); 4] = [
    ([-1.0, -1.0], [0.9, 0.2, 0.1]),
    ([0.0, -1.0], [0.1, 0.7, 0.3]),
    ([-1.0, 0.0], [0.2, 0.3, 0.8]),
    ([0.0, 0.0], [0.9, 0.8, 0.2]),
];

/// A black room below a roof at y = 3 with a window of four panes, under a sun that shines straight down.
fn room(sigma_t: f64, size: [usize; 2]) -> Scene {
    let plane = |x: [f64; 2], z: [f64; 2], y: f64, passes: [f64; 3]| {
        json!({"plane": {
            "center": [0.5 * (x[0] + x[1]), y, 0.5 * (z[0] + z[1])],
            "sides": [[0, 0, z[1] - z[0]], [x[1] - x[0], 0, 0]],
            "albedo": 0, "transmittance": passes
        }})
    };
    let roof = |x, z| plane(x, z, 3.0, [0.0; 3]);
    let mut occluders = vec![
        roof([-20.0, -1.0], [-20.0, 20.0]),
        roof([1.0, 20.0], [-20.0, 20.0]),
        roof([-1.0, 1.0], [-20.0, -1.0]),
        roof([-1.0, 1.0], [1.0, 20.0]),
        plane([-20.0, 20.0], [-20.0, 20.0], -0.01, [0.0; 3]),
        json!({"plane": {"center": [0, 5, -5.05], "sides": [[40, 0, 0], [0, 40, 0]], "albedo": 0}}),
    ];
    occluders.extend(PANES.map(|([x, z], passes)| plane([x, x + 1.0], [z, z + 1.0], 3.0, passes)));
    let document: Value = json!({
        "version": 1,
        // Its radiance over one steradian is Mitsuba's irradiance.
        "light": {"direction": [0, -1, 0], "radiance": [4, 3.5, 3]},
        "medium": {"sigma_t": sigma_t, "albedo": 0.9, "g": 0},
        "occluders": occluders,
        "views": [{"name": "room", "camera": {
            "to_world": {"look_at": {"origin": [1.5, 1.2, 5.05], "target": [0, 1.5, 0]}}, "fov": 44, "fov_axis": "x", "size": size
        }}],
        // The edges of panes lie between texels.
        "shadow_map": {"size": 512, "extent": {"min": [-16, -16], "max": [16, 16]}},
        "light_map": {"size": 8, "extent": {"min": [-2, -2], "max": [2, 2]}}
    });
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.json");
    std::fs::write(&path, document.to_string()).unwrap();
    scene_file::load(&path, &[]).unwrap()
}

/// What the medium scatters of the sun.
fn scattered(scene: &Scene) -> Image {
    let geometry = Arc::new(Geometry::new(scene.mesh.clone()).unwrap());
    let maps = fit(scene, &scene.light_map, &geometry).unwrap();
    let renderer = Renderer::new(scene, &maps, None).unwrap().showing(DrawnLight::Scattered);
    renderer.picture(0, &Canvas::Processor).unwrap().before
}

#[test]
fn a_window_of_four_panes_colours_the_shafts() {
    const STEPS: usize = 400_000;
    let scene = room(0.2, [32, 24]);
    let picture = scattered(&scene);
    // The whole integral for some pixels, from the definition: no map, no geometry.
    let brute_force = |x: usize, y: usize| -> Option<[f64; 3]> {
        let ray = scene.views[0].camera.pixel_ray(x, y);
        let ends = [(-5.05 - ray.origin.z) / ray.direction.z, (-0.01 - ray.origin.y) / ray.direction.y];
        let roof = (3.0 - ray.origin.y) / ray.direction.y;
        let end = ends.into_iter().filter(|&t| t > 0.0).fold(f64::INFINITY, f64::min);
        if (0.0..end).contains(&roof) {
            let DVec3 { x, z, .. } = ray.at(roof);
            // Through the window one sees the light above it.
            if x.abs() < 1.0 && z.abs() < 1.0 {
                return None;
            }
        }
        let end = if roof > 0.0 { end.min(roof) } else { end };
        let phase = 1.0 / (4.0 * std::f64::consts::PI);
        let step = end / STEPS as f64;
        let mut sum = [0.0; 3];
        for k in 0..STEPS {
            let t = (k as f64 + 0.5) * step;
            let DVec3 { x, z, .. } = ray.at(t);
            let over = |corner: [f64; 2]| {
                (corner[0]..corner[0] + 1.0).contains(&x) && (corner[1]..corner[1] + 1.0).contains(&z)
            };
            if let Some((_, passes)) = PANES.iter().find(|(corner, _)| over(*corner)) {
                let weight = 0.9 * phase * 0.2 * (-0.2 * t).exp() * step;
                (0..3).for_each(|c| sum[c] += weight * passes[c] * f64::from(scene.light.radiance[c]));
            }
        }
        Some(sum)
    };
    let (mut error, mut whole, mut hues) = (0.0, 0.0, std::collections::BTreeSet::new());
    for y in (0..24).step_by(3) {
        for x in 0..32 {
            let (seen, Some(expected)) = (picture.at(x, y), brute_force(x, y)) else { continue };
            for c in 0..3 {
                error += (f64::from(seen[c]) - expected[c]).powi(2);
                whole += expected[c].powi(2);
            }
            if expected != [0.0; 3] {
                hues.insert((0..3).max_by(|&a, &b| expected[a].total_cmp(&expected[b])));
            }
        }
    }
    let error = (error / whole).sqrt();
    assert!(error <= GLASS_BRUTE_FORCE, "{error:e}");
    assert_eq!(hues.len(), 3, "red, green and blue shafts");
}

#[test]
fn thin_fog_behind_panes_is_as_mitsuba_draws_it() {
    const PART: usize = 4;
    let fixture =
        |name: &str| read_image(&crate::root().join(format!("tests/fixtures/mitsuba/{name}.exr"))).unwrap();
    let (mean, deviation) = (fixture("glass"), fixture("glass_se"));
    let fine = scattered(&room(0.001, [32 * PART, 24 * PART]));
    // Theirs is a mean over the area of each pixel.
    let ours = |x: usize, y: usize| -> [f64; 3] {
        let mut sum = [0.0; 3];
        for k in 0..PART * PART {
            let pixel = fine.at(PART * x + k % PART, PART * y + k / PART);
            (0..3).for_each(|c| sum[c] += f64::from(pixel[c]) / (PART * PART) as f64);
        }
        sum
    };
    let (mut sums, mut squares, mut largest, mut count) = ([[0.0; 2]; 3], 0.0, 0.0f64, 0.0);
    // Above, rays pass through the window, and there is no fog of theirs.
    for y in 4..24 {
        for x in 0..32 {
            let (ours, theirs, spread): (_, Rgb, Rgb) = (ours(x, y), mean.at(x, y), deviation.at(x, y));
            for c in 0..3 {
                sums[c][0] += ours[c];
                sums[c][1] += f64::from(theirs[c]);
                if spread[c] > 0.0 && theirs[c] > 1e-5 {
                    let off = (ours[c] - f64::from(theirs[c])) / f64::from(spread[c]);
                    squares += off * off;
                    largest = largest.max(off.abs());
                    count += 1.0;
                }
            }
        }
    }
    for [ours, theirs] in sums {
        let bias = ours / theirs - 1.0;
        assert!(bias.abs() <= GLASS_MITSUBA_BIAS, "{bias:e}");
    }
    let rms = f64::sqrt(squares / count);
    assert!(count > 1000.0 && rms <= GLASS_MITSUBA_RMS, "{rms} standard errors");
    assert!(largest <= GLASS_MITSUBA_LARGEST, "{largest} standard errors");
}
