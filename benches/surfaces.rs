//! Light on surfaces: how far what pictures know is from rays, and how long it takes.
//!
//!     cargo bench --bench surfaces
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench that cannot go on should stop")]
#![allow(clippy::print_stdout, reason = "figures are what it is for")]

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use glam::DAffine3;
use unscatter::io::scene_file::load;
use unscatter::problem::{BentCone, LitSurfaces};
use unscatter::scene::{Rgb, Scene, SurfaceLight, SurfaceMethod, Weighting};
use unscatter::visibility::Geometry;

/// Errors are those of pictures of this size.
const SIZE: [usize; 2] = [480, 270];
/// Times are those of pictures of this size; that of rays is found from the smaller one.
const FULL: [usize; 2] = [1280, 720];
/// Rays a pixel of the reference.
const RAYS: usize = 256;
/// How far occluders count, in metres, in pictures and by rays alike.
const RADIUS: f64 = 4.0;
/// Each picture is timed so often, and the shortest time counts.
const ROUNDS: usize = 2;

fn main() {
    for name in ["citadel", "nave", "forest"] {
        Case::new(name).print();
    }
}

/// What a method finds.
struct Found {
    light: Vec<Rgb>,
    cones: Vec<Option<BentCone>>,
    seconds: f64,
}

/// A demo scene under the evening's sky.
struct Case {
    small: Scene,
    full: Scene,
    geometry: Arc<Geometry>,
}

impl Case {
    fn new(name: &str) -> Self {
        let looks = r#"looks={"surfaces":{"environment":{"file":"evening.exr"}}}"#.to_owned();
        let scene = load(Path::new(&format!("strokes/{name}.json")), &[looks]).unwrap();
        let sized = |size: [usize; 2]| {
            let mut view = scene.views[0].clone();
            view.camera = view.camera.moved(DAffine3::IDENTITY, size).unwrap();
            view.strokes.clear();
            Scene { views: vec![view], ..scene.clone() }
        };
        let (small, full) = (sized(SIZE), sized(FULL));
        let geometry = Arc::new(Geometry::new(small.mesh.clone()).unwrap());
        println!("\n{name}");
        Self { small, full, geometry }
    }

    fn with(&self, scene: &Scene, change: &dyn Fn(&mut SurfaceLight)) -> LitSurfaces {
        let mut looks = scene.looks.clone();
        looks.surfaces[0].1.radius = Some(RADIUS);
        change(&mut looks.surfaces[0].1);
        LitSurfaces::of(&Scene { looks, ..scene.clone() }, &self.geometry).unwrap().unwrap()
    }

    fn found(&self, change: &dyn Fn(&mut SurfaceLight)) -> Found {
        let surfaces = self.with(&self.small, change);
        let camera = &self.small.views[0].camera;
        let clock = Instant::now();
        let light = surfaces.arriving(camera, &self.geometry);
        let seconds = clock.elapsed().as_secs_f64();
        Found { light, cones: surfaces.bent_cones(camera, &self.geometry), seconds }
    }

    /// Milliseconds of a whole picture.
    fn time(&self, change: &dyn Fn(&mut SurfaceLight)) -> f64 {
        let surfaces = self.with(&self.full, change);
        let once = || {
            let clock = Instant::now();
            assert!(!surfaces.arriving(&self.full.views[0].camera, &self.geometry).is_empty());
            1e3 * clock.elapsed().as_secs_f64()
        };
        (0..ROUNDS).map(|_| once()).fold(f64::INFINITY, f64::min)
    }

    fn print(&self) {
        let rays = |light: &mut SurfaceLight| {
            (light.method, light.samples) = (SurfaceMethod::Rays, RAYS);
        };
        let reference = self.found(&rays);
        let scale = (FULL[0] * FULL[1]) as f64 / (SIZE[0] * SIZE[1]) as f64;
        println!("{:42} {:>8} {:>8} {:>8}", "", "RMSE", "degrees", "ms");
        println!(
            "{:42} {:>8} {:>8} {:8.0}",
            format!("rays, {RAYS}"),
            "",
            "",
            1e3 * scale * reference.seconds
        );
        let row = |name: String, timed: bool, change: &dyn Fn(&mut SurfaceLight)| {
            let found = self.found(change);
            let (error, angle) = (error(&found, &reference), angle(&found.cones, &reference.cones));
            let time = if timed { format!("{:8.0}", self.time(change)) } else { String::new() };
            println!("{name:42} {error:8.3} {angle:8.1} {time}");
        };
        let methods = [
            ("ambient occlusion", SurfaceMethod::AmbientOcclusion),
            ("bent normals", SurfaceMethod::BentNormals),
            ("bent cones", SurfaceMethod::BentCones),
        ];
        row("open".to_owned(), true, &|light| light.method = SurfaceMethod::Open);
        for (name, method) in methods {
            for samples in [4, 8, 16] {
                for pattern in [4, 1] {
                    let blur = if pattern == 1 { ", no blur" } else { "" };
                    row(format!("{name}, {samples}{blur}"), true, &|light| {
                        (light.method, light.samples, light.pattern) = (method, samples, pattern);
                    });
                }
            }
        }
        for (name, method) in methods {
            row(format!("{name}, 8, as in the paper"), false, &|light| {
                (light.method, light.weighting) = (method, Weighting::Uniform);
            });
        }
        row("bent cones, 16, 12 steps".to_owned(), false, &|light| (light.samples, light.steps) = (16, 12));
        row("rays without an end".to_owned(), false, &|light| {
            (light.method, light.samples, light.radius) = (SurfaceMethod::Rays, RAYS, None);
        });
    }
}

/// Root of the mean square of the differences, relative to the mean of the reference, over the pixels that show a surface.
fn error(found: &Found, reference: &Found) -> f64 {
    let pairs = found.light.iter().zip(&reference.light).zip(&reference.cones);
    let (mut square, mut sum, mut count) = (0.0, 0.0, 0.0);
    for ((a, b), _) in pairs.filter(|(_, cone)| cone.is_some()) {
        for c in 0..3 {
            square += (f64::from(a[c]) - f64::from(b[c])).powi(2);
            sum += f64::from(b[c]);
            count += 1.0;
        }
    }
    f64::sqrt(square / count) / (sum / count)
}

/// The mean angle between bent normals in degrees, where the reference is open at all.
fn angle(found: &[Option<BentCone>], reference: &[Option<BentCone>]) -> f64 {
    let pairs = found.iter().flatten().zip(reference.iter().flatten());
    let angles: Vec<f64> = pairs
        .filter(|(_, reference)| reference.visibility > 0.0)
        .map(|(a, b)| a.direction.dot(b.direction).clamp(-1.0, 1.0).acos().to_degrees())
        .collect();
    angles.iter().sum::<f64>() / angles.len() as f64
}
