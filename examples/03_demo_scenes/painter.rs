//! A painter who follows shafts of light: each is marked where it is seen best.

use glam::{DVec2, DVec3};
use unscatter::io::scene_file::{Paint, Stroke};
use unscatter::scene::{Ray, Scene};
use unscatter::visibility::Geometry;

use crate::stage::millimetres;

/// A shaft of light to be painted.
#[derive(Clone, Copy)]
pub(crate) struct Shaft {
    /// A point of the opening that it comes through.
    pub(crate) from: DVec3,
    /// Half its width and half its height in the plane of the light, in metres.
    pub(crate) half: [f64; 2],
    /// How far from the opening it is painted, in metres, and how far at most.
    pub(crate) along: [f64; 2],
    pub(crate) color: [u8; 3],
    /// A view that disagrees, and the colour there.
    pub(crate) otherwise: Option<(usize, [u8; 3])>,
}

/// Points that are looked at along a shaft.
const STEPS: usize = 64;
/// Points that are looked at along a view ray.
const SAMPLES: usize = 96;

/// Strokes of one view along its shafts, in the shafts' order; `share` is how much of the light of a pixel must come
/// from the shaft for it to be painted there.
pub(crate) fn strokes(
    scene: &Scene,
    geometry: &Geometry,
    view: usize,
    shafts: &[Shaft],
    share: f64,
    brush: f64,
) -> Vec<Stroke> {
    shafts.iter().flat_map(|shaft| stroke(scene, geometry, view, shaft, share, brush)).collect()
}

/// The longest clear run of a shaft; none when that is short.
fn stroke(
    scene: &Scene,
    geometry: &Geometry,
    view: usize,
    shaft: &Shaft,
    share: f64,
    brush: f64,
) -> Option<Stroke> {
    let direction = scene.light.direction;
    let down = Ray { origin: shaft.from, direction };
    let length = geometry.first_hit(&down, f64::INFINITY).map_or(shaft.along[1], |hit| hit.distance);
    let end = length.min(shaft.along[1]);
    let mut best: Vec<(DVec2, f64)> = Vec::new();
    let mut run = Vec::new();
    for step in 0..=STEPS {
        let t = shaft.along[0] + (end - shaft.along[0]) * step as f64 / STEPS as f64;
        match clear(scene, geometry, view, shaft, down.at(t), share, brush) {
            Some(seen) => run.push(seen),
            None => run.clear(),
        }
        if run.len() > best.len() {
            best.clone_from(&run);
        }
    }
    let (&(first, _), &(last, _)) = (best.first()?, best.last()?);
    let radius = best.iter().map(|(_, radius)| radius).sum::<f64>() / best.len() as f64;
    // A hand's arc: a little off the straight line in the middle.
    let middle = 0.5 * (first + last) + 0.03 * (last - first).perp();
    let points: Vec<[f64; 2]> = if first.distance(last) < 2.0 {
        return None;
    } else {
        [first, middle, last].iter().map(|p| [tenths(p.x), tenths(p.y)]).collect()
    };
    let color = match shaft.otherwise {
        Some((other, color)) if other == view => color,
        _ => shaft.color,
    };
    let radius = tenths((brush * radius).max(2.0));
    Some(Stroke {
        points,
        radius,
        hardness: 0.8,
        opacity: 1.0,
        weight: 1.0,
        pressure: Vec::new(),
        erase: false,
        group: None,
        color: Paint::Hex(color),
    })
}

/// Where a point of a shaft is in the picture and how wide the shaft is there, in pixels; none when it is hidden or
/// lost among other light.
fn clear(
    scene: &Scene,
    geometry: &Geometry,
    view: usize,
    shaft: &Shaft,
    point: DVec3,
    share: f64,
    brush: f64,
) -> Option<(DVec2, f64)> {
    let camera = &scene.views[view].camera;
    let [width, height] = camera.size().map(|side| side as f64);
    let pixel = camera.project(point)?;
    if pixel.x < 0.0 || pixel.y < 0.0 || pixel.x > width || pixel.y > height {
        return None;
    }
    let ray = camera.ray(pixel.x, pixel.y);
    if geometry.blocks(&ray, point.distance(ray.origin)) {
        return None;
    }
    let beside = camera.project(point + shaft.half[0] * ray.direction.any_orthonormal_vector())?;
    let radius = beside.distance(pixel);
    // Nobody paints the sky: all of the brush is before a surface.
    let is_before_surface = |[x, y]: [f64; 2]| {
        let ray = camera.ray(pixel.x + brush * radius * x, pixel.y + brush * radius * y);
        geometry.first_hit(&ray, f64::INFINITY).is_some()
    };
    let rim = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
    let is_clear = rim.into_iter().all(is_before_surface) && clarity(scene, geometry, shaft, &ray) >= share;
    is_clear.then_some((pixel, radius))
}

/// The share of the light scattered along a view ray that comes from within a shaft.
fn clarity(scene: &Scene, geometry: &Geometry, shaft: &Shaft, ray: &Ray) -> f64 {
    let reach = scene.medium.reach(0.02);
    let end = geometry.first_hit(ray, reach).map_or(reach, |hit| hit.distance);
    let frame = scene.light.frame();
    let (mut inside, mut all) = (0.0, 0.0);
    for sample in 0..SAMPLES {
        let t = end * (sample as f64 + 0.5) / SAMPLES as f64;
        let point = ray.at(t);
        if is_lit(scene, geometry, point) {
            let light = scene.medium.transmittance(t)[1];
            all += light;
            let across = frame.light_from_world(point - shaft.from);
            let is_inside = across.x.abs() < 1.4 * shaft.half[0] && across.y.abs() < 1.4 * shaft.half[1];
            inside += if is_inside { light } else { 0.0 };
        }
    }
    if all > 0.0 { inside / all } else { 0.0 }
}

fn is_lit(scene: &Scene, geometry: &Geometry, point: DVec3) -> bool {
    !geometry.blocks(&Ray { origin: point, direction: -scene.light.direction }, f64::INFINITY)
}

/// Pixels to a tenth; finer than anyone paints.
fn tenths(value: f64) -> f64 {
    millimetres((value * 10.0).round() / 10.0)
}
