//! Heterogeneous air in full HD: time and error of steps and of upsampling, as figures 21 and 22 of Kol et al. 2017 have them.
//!
//!     cargo bench --bench heterogeneity
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench that cannot go on should stop")]
#![allow(clippy::print_stdout, reason = "figures are what it is for")]

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;
use unscatter::io::scene_file::load;
use unscatter::problem::{Canvas, DrawnLight, Renderer, fit};
use unscatter::scene::{Ray, Scene};
use unscatter::visibility::Geometry;

/// Rows and columns from one ray to the next, where all would take too long.
const STRIDE: usize = 32;
const BLENDS: &str = r#""amount": {"strokes": [{"value": 0.2, "view": "court", "distance": 20, "pixels": [[960, 300]], "radius": 8}]},
    "frequency": {"strokes": [{"value": 2, "view": "court", "distance": 12, "pixels": [[400, 800]], "radius": 6}]},
    "intensity": {"strokes": [{"value": 3, "view": "court", "distance": 15, "pixels": [[1400, 700]], "radius": 6}]},"#;

fn main() {
    for (name, blends) in [("noise alone", ""), ("three blend volumes", BLENDS), ("baked, 128", "BAKED")] {
        let blends = if blends == "BAKED" { format!("{BLENDS} \"bake\": 128,") } else { blends.to_owned() };
        println!("{name}");
        let looks =
            |quadrature: &str| format!(r#"{{"heterogeneity": {{{blends} "quadrature": {quadrature}}}}}"#);
        let exact = means(&looks("\"exact\""), STRIDE);
        let all = (STRIDE * STRIDE) as f64 * exact.seconds;
        println!("  {:24} {all:8.2} s (from 1 in 1024 rays)", "cell by cell");
        for steps in [4, 16, 64, 2048] {
            let looks = looks(&format!(r#"{{"march": {{"steps": {steps}}}}}"#));
            let sampled = means(&looks, STRIDE);
            let seconds = if steps <= 64 {
                means(&looks, 1).seconds
            } else {
                (STRIDE * STRIDE) as f64 * sampled.seconds
            };
            let [rms, most] = apart(&sampled.values, &exact.values);
            println!(
                "  {:24} {seconds:8.2} s   rms {:.4} %   most {:.3} %",
                format!("{steps} steps"),
                100.0 * rms,
                100.0 * most
            );
        }
    }
    println!("pictures of the scattered light, 64 steps");
    let picture = |upsample: usize| {
        picture(&format!(
            r#"{{"heterogeneity": {{{BLENDS} "upsample": {upsample}, "quadrature": {{"march": {{"steps": 64}}}}}}}}"#
        ))
    };
    let whole = picture(1);
    println!("  {:24} {:8.2} s", "each pixel", whole.seconds);
    for upsample in [2, 4, 8, 16] {
        let upsampled = picture(upsample);
        let [rms, most] = apart(&upsampled.values, &whole.values);
        let name = format!("{upsample} x upsampling");
        println!(
            "  {name:24} {:8.2} s   rms {:.4} %   most {:.3} %",
            upsampled.seconds,
            100.0 * rms,
            100.0 * most
        );
    }
    let even = self::picture("{}");
    let [rms, most] = apart(&even.values, &whole.values);
    println!(
        "  {:24} {:8.2} s   rms {:.4} %   most {:.3} %",
        "even air",
        even.seconds,
        100.0 * rms,
        100.0 * most
    );
}

/// What was computed, and how long that took.
struct Timed {
    values: Vec<f64>,
    seconds: f64,
}

impl Timed {
    fn of(values: impl Fn() -> Vec<f64>) -> Self {
        let clock = Instant::now();
        Self { values: values(), seconds: clock.elapsed().as_secs_f64() }
    }
}

fn scene(looks: &str) -> (Scene, Arc<Geometry>) {
    let sets = ["views[0].camera.size=[1920,1080]".to_owned(), format!("looks={looks}")];
    let scene = load(Path::new("strokes/citadel.json"), &sets).unwrap();
    let geometry = Arc::new(Geometry::new(scene.mesh.clone()).unwrap());
    (scene, geometry)
}

/// The factors of the rays of the citadel's court, of every so many rows and columns.
fn means(looks: &str, stride: usize) -> Timed {
    let (scene, geometry) = scene(looks);
    let maps = fit(&scene, &scene.light_map, &geometry).unwrap();
    let camera = &scene.views[0].camera;
    let [width, height] = camera.size().map(|side| side / stride);
    let rays: Vec<(Ray, f64)> = (0..width * height)
        .into_par_iter()
        .map(|pixel| {
            let ray = camera.pixel_ray(pixel % width * stride, pixel / width * stride);
            (ray, geometry.first_hit(&ray, f64::INFINITY).map_or(f64::INFINITY, |hit| hit.distance))
        })
        .collect();
    Timed::of(|| rays.par_iter().map(|(ray, length)| maps.air_factor(ray, *length)).collect())
}

/// The whole picture of what the air of the court scatters.
fn picture(looks: &str) -> Timed {
    let (scene, geometry) = scene(looks);
    let maps = fit(&scene, &scene.light_map, &geometry).unwrap();
    let renderer = Renderer::new(&scene, &maps, None).unwrap().showing(DrawnLight::Scattered);
    Timed::of(|| {
        let drawn = renderer.picture(0, &Canvas::Processor).unwrap().before;
        drawn.pixels.iter().map(|pixel| f64::from(pixel[1])).collect()
    })
}

/// Root mean square and largest difference, relative to the root mean square and the largest value.
fn apart(values: &[f64], expected: &[f64]) -> [f64; 2] {
    let rms = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>().sqrt();
    let most = |values: &mut dyn Iterator<Item = f64>| values.map(f64::abs).fold(0.0, f64::max);
    let differences = || values.iter().zip(expected).map(|(a, b)| a - b);
    [
        rms(&mut differences()) / rms(&mut expected.iter().copied()),
        most(&mut differences()) / most(&mut expected.iter().copied()),
    ]
}
