//! A cloud that is painted from ten sides, as if the sun set on one of them while a storm came up on the other: the
//! pictures contradict each other, as those of Klehm 2015, fig. 7.8.

use std::error::Error;
use std::path::Path;

use glam::DVec3;
use unscatter::io::scene_file::{
    Channels, Environment, Field, Find, FovAxis, GridSize, Noise, Paint, Shape, Shapes, Sphere, Stroke,
    VolumeDocument, VolumeView,
};
use unscatter::scene::{Camera, VolumeScene};

use crate::canvas;
use crate::stage::{camera, millimetres, sun, volume, weight};

/// Puffs: middle and radius.
const PUFFS: [([f64; 3], f64); 19] = [
    ([0.0, -0.1, 0.0], 0.5),
    ([-0.62, -0.16, 0.08], 0.42),
    ([0.6, -0.14, -0.1], 0.44),
    ([-1.1, -0.28, -0.05], 0.3),
    ([1.12, -0.28, 0.08], 0.3),
    ([0.1, 0.22, 0.05], 0.42),
    ([-0.32, 0.16, -0.12], 0.36),
    ([0.42, 0.14, 0.18], 0.33),
    ([0.0, -0.2, 0.45], 0.36),
    ([0.1, -0.22, -0.48], 0.36),
    ([-0.55, -0.26, 0.42], 0.28),
    ([0.6, -0.26, 0.4], 0.28),
    ([-0.5, -0.26, -0.42], 0.28),
    ([0.62, -0.26, -0.42], 0.27),
    ([0.08, 0.48, 0.0], 0.26),
    ([-0.18, 0.36, 0.14], 0.2),
    ([0.86, 0.06, 0.02], 0.2),
    ([-0.84, 0.08, -0.04], 0.22),
    ([0.3, 0.4, -0.16], 0.2),
];

/// A light inside of the cloud, and its radius.
const FLASH: (DVec3, f64) = (DVec3::new(-0.15, 0.0, -0.62), 0.22);

/// What is painted on a puff: its lower side, its middle and its upper side, as tints of the light that is seen there.
type Mood = [[f64; 3]; 3];

const SUNSET: Mood = [[1.5, 0.3, 0.12], [1.6, 0.66, 0.24], [1.5, 1.02, 0.68]];
const DUSK: Mood = [[0.62, 0.2, 0.5], [0.95, 0.42, 0.72], [1.1, 0.72, 0.98]];
const STORM: Mood = [[0.16, 0.26, 0.5], [0.38, 0.54, 0.9], [0.8, 1.02, 1.5]];

/// Where the views are around the cloud, 36° from one to the next, and what is painted there. Exact, so that files do
/// not depend on a machine's sine.
const VIEWS: [([f64; 2], Mood); 10] = [
    ([0.0, 1.0], SUNSET),
    ([0.588, 0.809], SUNSET),
    ([0.951, 0.309], SUNSET),
    ([0.951, -0.309], DUSK),
    ([0.588, -0.809], STORM),
    ([0.0, -1.0], STORM),
    ([-0.588, -0.809], STORM),
    ([-0.951, -0.309], STORM),
    ([-0.951, 0.309], DUSK),
    ([-0.588, 0.809], SUNSET),
];

/// How far the views are away, in metres.
const DISTANCE: f64 = 4.0;

/// Writes the sky; gives back the scene, unpainted.
pub(crate) fn write(folder: &Path) -> Result<VolumeDocument, Box<dyn Error>> {
    canvas::write(&folder.join("cloud_sky.png"), [2, 1024], |p| Some((sky(p.y / 512.0), 1.0)))?;
    let view = |(index, ([x, z], _)): (usize, ([f64; 2], Mood))| {
        let origin = [DISTANCE * x, if index % 2 == 0 { -0.25 } else { 0.0 }, DISTANCE * z];
        let camera = camera(origin.map(millimetres), [0.0, 0.02, 0.0], (60.0, FovAxis::X), [640, 360]);
        VolumeView { keep: Some(0.0), ..VolumeView::new(format!("from_{:03}", 36 * index), camera) }
    };
    let views = VIEWS.into_iter().enumerate().map(view).collect();
    let corners = [[-1.6, -0.75, -1.1], [1.6, 0.9, 1.1]];
    let mut volume = volume(GridSize::Sides([88, 48, 64]), Field::made(vapour()), corners);
    volume.albedo = Field::Constant(Channels::Grey(0.95));
    let mut document = VolumeDocument::new(volume, Find::Joint, views);
    document.name = Some("Cloud".to_owned());
    document.lights.push(sun([-0.5, -0.6, -0.8], [5.0, 4.6, 4.1]));
    document.environment = Some(Environment {
        file: Some("cloud_sky.png".into()),
        directions: Some(32),
        ..Environment::default()
    });
    document.light_size = Some(GridSize::Sides([44, 24, 32]));
    document.exposure = 0.3;
    document.solve.tikhonov = Some(weight(0.02));
    document.solve.gradient = Some(weight(0.02));
    document.solve.iterations = 15;
    // Half of the cloud lies behind what can be seen of it.
    document.solve.transmittance_bound = 1e-3;
    Ok(document)
}

fn vapour() -> Shapes {
    let puff = |(center, radius)| Shape::Sphere(Sphere { center, radius });
    Shapes {
        shapes: PUFFS.into_iter().map(puff).collect(),
        inside: 18.0,
        outside: 0.0,
        edge: 0.2,
        noise: Some(Noise { scale: 0.45, octaves: 5, gain: 0.6, depth: 0.22, mottle: 0.7, seed: 11 }),
    }
}

/// Colour of the sky at a height from −1 (nadir) to 1 (zenith), in sRGB.
fn sky(height: f64) -> [u8; 3] {
    // From the horizon on, a hyperbola: it needs no exponential.
    let (far, share) = if height > 0.0 {
        ([0x45, 0x65, 0xa2], 1.0 / (1.0 + 18.0 * height * height + 2.0 * height))
    } else {
        ([0x40, 0x46, 0x55], 1.0 / (1.0 + 300.0 * height * height - 8.0 * height))
    };
    let horizon = [0xe7, 0xcf, 0xbc];
    std::array::from_fn(|c| (share * f64::from(horizon[c]) + (1.0 - share) * f64::from(far[c])).round() as u8)
}

/// Strokes of a view, from the puffs far away to the near ones. The rims of the cloud stay unpainted.
pub(crate) fn strokes(scene: &VolumeScene, view: usize) -> Vec<Stroke> {
    let camera = &scene.views[view].view.camera;
    let eye = camera.position();
    let mut puffs = PUFFS.map(|(middle, radius)| (DVec3::from_array(middle), radius));
    puffs.sort_by(|a, b| b.0.distance(eye).total_cmp(&a.0.distance(eye)));
    let mood = VIEWS[view].1;
    // Those far behind would be painted over.
    let seen = puffs.into_iter().filter(|puff| puff.0.distance(eye) < DISTANCE + 0.1);
    let mut strokes: Vec<Stroke> = seen.flat_map(|puff| puff_strokes(camera, puff, mood)).collect();
    let (flash, radius) = FLASH;
    if flash.distance(eye) < DISTANCE - 0.4 {
        let dab = |grow: f64, color: [f64; 3]| brush(camera, flash, 0.0, (grow * radius, 0.0), color);
        strokes.extend(dab(1.0, [2.4, 2.4, 4.0]));
        strokes.extend(dab(0.55, [9.0, 9.0, 11.0]));
    }
    strokes
}

fn puff_strokes(camera: &Camera, (middle, radius): (DVec3, f64), mood: Mood) -> Vec<Stroke> {
    let at = |part: usize, height: f64, width: f64| {
        let point = middle + DVec3::Y * height * radius;
        brush(camera, point, 0.45 * radius, (width * radius, 0.1), mood[part])
    };
    let parts = [at(1, 0.0, 0.75), at(0, -0.45, 0.45), at(2, 0.45, 0.42)];
    // Small puffs are one dab.
    let count = if radius < 0.25 { 1 } else { 3 };
    parts.into_iter().take(count).flatten().collect()
}

/// A level stroke across a point, `half` as long as it reaches to each side and `radius` wide, in metres.
fn brush(
    camera: &Camera,
    point: DVec3,
    half: f64,
    (radius, hardness): (f64, f64),
    color: [f64; 3],
) -> Option<Stroke> {
    let middle = camera.project(point)?;
    let pixels = camera.project(point + DVec3::Y)?.distance(middle);
    let end =
        |side: f64| [tenths(middle.x + side * half * pixels), tenths(middle.y - 0.06 * side * half * pixels)];
    let points = if half > 0.0 { vec![end(-1.0), end(1.0)] } else { vec![end(0.0)] };
    let opacity = 0.75;
    Some(Stroke { hardness, opacity, ..Stroke::new(points, tenths(radius * pixels), Paint::Linear(color)) })
}

/// Pixels to a tenth; finer than anyone paints.
pub(crate) fn tenths(value: f64) -> f64 {
    millimetres((value * 10.0).round() / 10.0)
}
