//! A hand of smoke with an eye on its palm and a star on its side, as the logos of Klehm 2015, fig. 7.5.

use std::error::Error;
use std::path::Path;

use glam::DVec2;
use unscatter::io::scene_file::{
    Capsule, Channels, Environment, Field, Find, FovAxis, GridSize, Noise, Paint, Shape, Shapes, Stroke,
    VolumeDocument, VolumeView,
};

use crate::canvas::{self, Ink};
use crate::stage::{camera, sun, volume};

/// Pixels along each side of the pictures.
const SIDE: u32 = 480;

/// Bones with flesh: from, to, and the radii there.
const BONES: [([f64; 3], [f64; 3], [f64; 2]); 16] = [
    // Wrist.
    ([0.02, -1.05, -0.02], [0.0, -0.45, 0.0], [0.17, 0.2]),
    // Palm.
    ([-0.1, -0.42, 0.0], [-0.27, 0.0, 0.0], [0.2, 0.17]),
    ([-0.04, -0.42, 0.0], [-0.09, 0.06, 0.02], [0.21, 0.185]),
    ([0.04, -0.42, 0.0], [0.1, 0.06, 0.02], [0.21, 0.18]),
    ([0.1, -0.42, 0.0], [0.27, 0.01, 0.0], [0.2, 0.16]),
    // Thumb.
    ([0.14, -0.42, 0.08], [0.36, -0.14, 0.16], [0.19, 0.155]),
    ([0.36, -0.14, 0.16], [0.55, 0.1, 0.22], [0.125, 0.105]),
    ([0.55, 0.1, 0.22], [0.62, 0.32, 0.2], [0.1, 0.08]),
    // Fingers, from the little one on.
    ([-0.27, 0.03, 0.0], [-0.41, 0.31, 0.04], [0.115, 0.1]),
    ([-0.41, 0.31, 0.04], [-0.48, 0.53, 0.12], [0.095, 0.075]),
    ([-0.1, 0.09, 0.02], [-0.16, 0.45, 0.05], [0.125, 0.105]),
    ([-0.16, 0.45, 0.05], [-0.18, 0.74, 0.15], [0.1, 0.08]),
    ([0.1, 0.09, 0.02], [0.1, 0.48, 0.05], [0.125, 0.105]),
    ([0.1, 0.48, 0.05], [0.1, 0.8, 0.14], [0.1, 0.08]),
    ([0.28, 0.04, 0.0], [0.34, 0.41, 0.03], [0.12, 0.1]),
    ([0.34, 0.41, 0.03], [0.37, 0.68, 0.11], [0.098, 0.078]),
];

/// Writes the pictures that are painted on the views; gives back the scene.
pub(crate) fn write(folder: &Path) -> Result<VolumeDocument, Box<dyn Error>> {
    canvas::write(&folder.join("hand_front.png"), [SIDE; 2], lids)?;
    canvas::write(&folder.join("hand_side.png"), [SIDE; 2], star)?;
    let view = |name: &str, origin: [f64; 3]| {
        let camera = camera(origin, [0.0, -0.05, 0.0], (33.0, FovAxis::Y), [SIDE; 2]);
        VolumeView { layers: vec![format!("hand_{name}.png").into()], ..VolumeView::new(name, camera) }
    };
    let front = VolumeView { strokes: iris(), ..view("front", [0.0, -0.05, 3.6]) };
    let views = vec![front, view("side", [3.6, -0.05, 0.0])];
    let mut volume = volume(GridSize::Cube(128), Field::made(smoke()), [[-1.0; 3], [1.0; 3]]);
    volume.albedo = Field::Constant(Channels::Grey(0.85));
    volume.interpolation = None;
    let mut document = VolumeDocument::new(volume, Find::Joint, views);
    document.name = Some("Hand".to_owned());
    document.lights.push(sun([0.6, -0.7, -0.6], [9.0, 8.0, 6.6]));
    document.environment = Some(Environment {
        radiance: Some(Channels::Rgb([0.55, 0.7, 1.0])),
        directions: Some(32),
        ..Environment::default()
    });
    document.background = Some(Channels::Rgb([0.012, 0.014, 0.02]));
    Ok(document)
}

fn smoke() -> Shapes {
    let bone = |(from, to, radii)| Shape::Capsule(Capsule { from, to, radii });
    Shapes {
        shapes: BONES.into_iter().map(bone).collect(),
        inside: 20.0,
        outside: 0.0,
        edge: 0.15,
        noise: Some(Noise { scale: 0.4, octaves: 5, gain: 0.55, depth: 0.15, mottle: 0.75, seed: 3 }),
    }
}

/// The outline of an almond eye on the palm, between two arcs.
fn lids(p: DVec2) -> Option<Ink> {
    let p = p - DVec2::new(0.0, -0.13);
    // The arcs meet in the corners of the eye.
    let (half, sag) = (0.27, 0.105);
    let radius = (half * half + sag * sag) / (2.0 * sag);
    let [above, below] = [sag - radius, radius - sag].map(|y| canvas::disc(p, [0.0, y], radius));
    (0.0..0.042).contains(&above.max(below)).then_some(([0x18, 0x2c, 0x70], 1.0))
}

/// Its iris, which is to be brighter than the smoke: it has to glow.
fn iris() -> Vec<Stroke> {
    let dab = |point: [f64; 2], radius: f64, color: [f64; 3]| Stroke {
        hardness: 0.85,
        ..Stroke::new(vec![point], radius, Paint::Linear(color))
    };
    vec![
        dab([240.0, 271.0], 25.0, [0.05, 0.9, 1.35]),
        dab([240.0, 271.0], 12.5, [0.005, 0.007, 0.03]),
        dab([247.0, 264.0], 5.0, [1.3, 1.3, 1.3]),
    ]
}

/// A star with five points on the side of the hand.
fn star(p: DVec2) -> Option<Ink> {
    // Exact, so that files do not depend on a machine's sine: cos and sin of multiples of 72°.
    const POINTS: [[f64; 2]; 5] =
        [[0.0, 1.0], [0.951, 0.309], [0.588, -0.809], [-0.588, -0.809], [-0.951, 0.309]];
    let corner = |index: usize| -> [f64; 2] {
        // Between two points of the star lies the one of the smaller pentagon that is opposite to a third.
        let scale = if index.is_multiple_of(2) { 0.165 } else { -0.066 };
        let [x, y] = POINTS[if index.is_multiple_of(2) { index / 2 } else { (index / 2 + 3) % 5 }];
        [scale * x, scale * y]
    };
    let corners: [[f64; 2]; 10] = std::array::from_fn(corner);
    canvas::is_in_polygon(p - DVec2::new(-0.02, -0.17), &corners).then_some(([0xf0, 0x38, 0x20], 1.0))
}
