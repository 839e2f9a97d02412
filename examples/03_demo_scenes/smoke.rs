//! Smoke that rises and turns, painted at three of its frames, as the dragon of Klehm 2015, fig. 7.12.

use glam::DVec3;
use unscatter::io::scene_file::{
    Animation, Between, Capsule, Channels, Environment, Field, Find, FovAxis, GridSize, Key, KeyView, Noise,
    Paint, Shape, Shapes, Sphere, Stroke, VolumeDocument, VolumeView,
};
use unscatter::scene::{Camera, VolumeScene};

use crate::cloud::tenths;
use crate::stage::{camera, millimetres, sun, volume, weight};

/// Frames, and which of them are painted.
const FRAMES: usize = 24;
const KEYS: [usize; 3] = [0, 12, 23];

/// Puffs around the stem: direction, how far out, how high between foot (0) and top (1), radius.
const PUFFS: [([f64; 2], f64, f64, f64); 9] = [
    ([1.0, 0.0], 0.1, 0.3, 0.19),
    ([-0.6, 0.8], 0.16, 0.44, 0.2),
    ([-0.28, -0.96], 0.2, 0.56, 0.21),
    ([0.8, 0.6], 0.24, 0.66, 0.22),
    ([-0.96, 0.28], 0.26, 0.76, 0.22),
    ([0.6, -0.8], 0.25, 0.84, 0.21),
    ([0.0, 1.0], 0.22, 0.9, 0.2),
    ([-0.6, -0.8], 0.12, 0.97, 0.2),
    ([0.28, 0.96], 0.04, 1.0, 0.22),
];

/// A key: foot and top of the smoke, how it is turned, how wide and how thick it is, and its colours from the foot to the top.
struct Pose {
    y: [f64; 2],
    turn: [f64; 2],
    spread: f64,
    inside: f64,
    palette: [[f64; 3]; 3],
}

/// Turned by 74° from one to the next; exact, so that files do not depend on a machine's sine.
const POSES: [Pose; 3] = [
    Pose {
        y: [-0.95, -0.2],
        turn: [1.0, 0.0],
        spread: 0.7,
        inside: 22.0,
        palette: [[2.6, 1.5, 0.3], [2.2, 0.55, 0.12], [1.1, 0.14, 0.1]],
    },
    Pose {
        y: [-0.85, 0.35],
        turn: [0.28, 0.96],
        spread: 1.0,
        inside: 16.0,
        palette: [[1.6, 0.3, 0.5], [0.9, 0.25, 1.3], [0.25, 0.5, 1.8]],
    },
    Pose {
        y: [-0.55, 0.78],
        turn: [-0.8432, 0.5376],
        spread: 1.35,
        inside: 11.0,
        palette: [[0.15, 0.5, 1.2], [0.15, 1.2, 1.2], [0.6, 1.9, 0.9]],
    },
];

/// The scene, unpainted and at rest.
pub(crate) fn document() -> VolumeDocument {
    let view = |name: &str, origin: [f64; 3]| {
        let camera = camera(origin, [0.0, 0.0, 0.0], (36.0, FovAxis::Y), [192, 256]);
        VolumeView::new(name, camera)
    };
    let views = vec![view("front", [0.0, 0.1, 3.6]), view("side", [3.4, 0.4, 1.2])];
    let corners = [[-0.75, -1.2, -0.75], [0.75, 1.2, 0.75]];
    let mut volume = volume(GridSize::Sides([52, 84, 52]), Field::made(smoke(&POSES[0])), corners);
    volume.albedo = Field::Constant(Channels::Grey(0.8));
    let mut document = VolumeDocument::new(volume, Find::Joint, views);
    document.name = Some("Smoke".to_owned());
    document.lights.push(sun([-0.6, -0.7, -0.5], [5.0, 4.8, 4.5]));
    document.environment = Some(Environment {
        radiance: Some(Channels::Rgb([0.4, 0.5, 0.7])),
        directions: Some(32),
        ..Environment::default()
    });
    document.light_size = Some(GridSize::Sides([26, 42, 26]));
    document.background = Some(Channels::Rgb([0.01, 0.012, 0.018]));
    document.exposure = 0.5;
    document.solve.tikhonov = Some(weight(0.02));
    document.solve.gradient = Some(weight(0.02));
    document.solve.iterations = 30;
    document.solve.transmittance_bound = 1e-3;
    document
}

/// What is painted, at which frames.
pub(crate) fn animation(scene: &VolumeScene) -> Animation {
    let key = |(index, frame): (usize, usize)| {
        let pose = &POSES[index];
        let painted = |view: &unscatter::scene::VolumeView| KeyView {
            name: view.view.name.clone(),
            strokes: strokes(pose, &view.view.camera),
            keep: Some(0.0),
            ..KeyView::default()
        };
        Key {
            frame,
            // The first is the scene's own.
            extinction: (index > 0).then(|| Field::made(smoke(pose))),
            albedo: None,
            emission: None,
            views: scene.views.iter().map(painted).collect(),
        }
    };
    let keys = KEYS.into_iter().enumerate().map(key).collect();
    Animation { frames: FRAMES, keys, between: Between::Shapes, first_file: None }
}

impl Pose {
    fn at(&self, out: [f64; 2], height: f64) -> DVec3 {
        let [cos, sin] = self.turn;
        let [x, z] = [out[0] * cos - out[1] * sin, out[0] * sin + out[1] * cos];
        DVec3::new(x, self.y[0] + height * (self.y[1] - self.y[0]), z)
    }

    /// Middle and radius of each puff.
    fn puffs(&self) -> impl Iterator<Item = (DVec3, f64, f64)> {
        PUFFS.into_iter().map(|([x, z], out, height, radius)| {
            let out = out * self.spread;
            (self.at([x * out, z * out], height), radius * (0.6 + 0.4 * self.spread), height)
        })
    }
}

fn smoke(pose: &Pose) -> Shapes {
    let rounded = |point: DVec3| point.to_array().map(millimetres);
    let stem = Capsule {
        from: rounded(pose.at([0.0, 0.0], 0.0)),
        to: rounded(pose.at([0.03, 0.02], 0.8)),
        radii: [0.07, 0.16],
    };
    let puff = |(middle, radius, _): (DVec3, f64, f64)| {
        Shape::Sphere(Sphere { center: rounded(middle), radius: millimetres(radius) })
    };
    Shapes {
        shapes: [Shape::Capsule(stem)].into_iter().chain(pose.puffs().map(puff)).collect(),
        inside: pose.inside,
        outside: 0.0,
        edge: 0.15,
        noise: Some(Noise { scale: 0.34, octaves: 5, gain: 0.6, depth: 0.22, mottle: 0.75, seed: 7 }),
    }
}

/// Strokes across the puffs, from those far away to the near ones.
fn strokes(pose: &Pose, camera: &Camera) -> Vec<Stroke> {
    let eye = camera.position();
    let mut puffs: Vec<_> = pose.puffs().collect();
    puffs.push((pose.at([0.0, 0.0], 0.12), 0.12, 0.0));
    puffs.sort_by(|a, b| b.0.distance(eye).total_cmp(&a.0.distance(eye)));
    puffs.into_iter().flat_map(|puff| bands(pose, camera, puff)).collect()
}

/// Two bands on a puff, the upper one of the next colour of the palette.
fn bands(pose: &Pose, camera: &Camera, (middle, radius, height): (DVec3, f64, f64)) -> Vec<Stroke> {
    let lower = if height < 0.5 { 0 } else { 1 };
    let band = |up: f64, color: [f64; 3]| {
        let point = camera.project(middle + DVec3::Y * up * radius)?;
        let pixels = camera.project(middle + DVec3::Y)?.distance(camera.project(middle)?);
        let half = 0.6 * radius * pixels;
        let points =
            [-1.0, 1.0].map(|side| [tenths(point.x + side * half), tenths(point.y - 0.3 * side * half)]);
        let brush = Stroke::new(points.to_vec(), tenths(0.55 * radius * pixels), Paint::Linear(color));
        Some(Stroke { hardness: 0.3, opacity: 0.9, ..brush })
    };
    let palette = &pose.palette;
    [band(-0.4, palette[lower]), band(0.45, palette[lower + 1])].into_iter().flatten().collect()
}
