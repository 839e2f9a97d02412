//! A way between columns, at whose end the sun rises behind a gate: five transfer functions by key frames, as Kol 2017, fig. 11.

use unscatter::io::scene_file::{
    Blend, Channels, Diffusion, Document, Exposure, LightAnimation, LightKey, Looks, Medium, Occluder, Paint,
    SphereShape, Transfer, TransferAxis, TransferLayer, TransferPoint,
};

use crate::stage::{Stage, sun, view};

const GROUND: [f64; 3] = [0.09, 0.08, 0.07];
const STONE: [f64; 3] = [0.16, 0.145, 0.13];
const STEPS: [f64; 3] = [0.1, 0.09, 0.085];
const HILLS: [f64; 3] = [0.05, 0.05, 0.06];

/// Frames from the night to the day.
const FRAMES: usize = 48;

/// Columns on either side of the way: their distance from its middle, and where they stand along it.
const BESIDE: f64 = 6.6;
const ALONG: [f64; 7] = [-9.0, -17.0, -25.0, -33.0, -41.0, -49.0, -57.0];
const HIGH: f64 = 9.2;
/// Those that are broken: side, place and height.
const BROKEN: [(f64, f64, f64); 3] = [(-1.0, -25.0, 4.6), (1.0, -41.0, 6.1), (1.0, -9.0, 3.2)];
/// Where the gate stands.
const GATE: f64 = -68.0;

/// Places of the table, by visibility and by the angle to the sun as a share of 180 degrees.
const PLACES: [[f64; 2]; 6] = [[1.0, 0.0], [1.0, 0.07], [1.0, 0.2], [0.2, 0.0], [0.2, 0.06], [0.1, 0.2]];

/// A moment: its frame, where the light goes, its radiance, and the colours of light: lit at the sun, beside it and away from it; in shadow
/// about the sun and away from it.
struct Moment {
    frame: usize,
    direction: [f64; 3],
    radiance: [f64; 3],
    lit: [[u8; 3]; 3],
    dim: [[u8; 3]; 2],
}

/// The sun rises by 17° and moves by as much to the right; its directions are exact, so that files do not depend on a machine's sine.
const MOMENTS: [Moment; 5] = [
    Moment {
        frame: 0,
        direction: [0.2079, -0.0175, 0.978],
        radiance: [3.0, 4.4, 9.5],
        lit: [[0xa4, 0xae, 0xf4], [0x4a, 0x5c, 0xbc], [0x14, 0x1f, 0x5c]],
        dim: [[0x26, 0x36, 0x8c], [0x0e, 0x1a, 0x4c]],
    },
    Moment {
        frame: 12,
        direction: [0.1388, -0.0732, 0.9876],
        radiance: [15.0, 9.0, 7.0],
        lit: [[0xff, 0x84, 0x44], [0xe4, 0x44, 0x38], [0x50, 0x2a, 0x74]],
        dim: [[0x8c, 0x2c, 0x48], [0x28, 0x24, 0x58]],
    },
    Moment {
        frame: 24,
        direction: [0.0604, -0.1478, 0.9872],
        radiance: [12.0, 10.0, 7.8],
        lit: [[0xff, 0xb0, 0x4c], [0xf8, 0x74, 0x34], [0x8c, 0x44, 0x68]],
        dim: [[0xb8, 0x4c, 0x3c], [0x3c, 0x34, 0x60]],
    },
    Moment {
        frame: 36,
        direction: [-0.017, -0.225, 0.9742],
        radiance: [7.6, 7.1, 6.1],
        lit: [[0xff, 0xe4, 0x9c], [0xff, 0xbc, 0x64], [0xb8, 0x90, 0x90]],
        dim: [[0xcc, 0x7c, 0x48], [0x5c, 0x58, 0x78]],
    },
    Moment {
        frame: 47,
        direction: [-0.0829, -0.309, 0.9474],
        radiance: [5.2, 5.1, 4.6],
        lit: [[0xff, 0xf4, 0xcc], [0xff, 0xe8, 0xa4], [0xec, 0xd8, 0xac]],
        dim: [[0xd0, 0xb0, 0x80], [0x88, 0x84, 0x8c]],
    },
];

/// The scene and its animation; nothing is painted on it.
pub(crate) fn document() -> Document {
    let [first, ..] = &MOMENTS;
    let medium = Medium { sigma_t: Channels::Grey(0.012), albedo: Channels::Grey(0.95), g: 0.55 };
    let views = vec![view("way", [1.6, 1.9, 3.5], [0.2, 7.0, -40.0], 68.0)];
    let mut document = Document::new(sun(first.direction, first.radiance), medium, views);
    document.name = Some("Sunrise".to_owned());
    document.ambient = Channels::Rgb([0.018, 0.024, 0.042]);
    document.occluders = columns_and_gate();
    document.exposure = Exposure(Some(0.0));
    let keys = MOMENTS.iter().map(Moment::key).collect();
    document.animation = Some(LightAnimation { frames: FRAMES, light_map: None, keys });
    document
}

impl Moment {
    fn key(&self) -> LightKey {
        let colors = self.lit.iter().chain([&self.dim[0]]).chain(&self.dim);
        let points = colors.zip(PLACES).map(|(color, at)| TransferPoint {
            color: Paint::Hex(*color),
            alpha: 1.0,
            at: Some(at),
            view: None,
            pixel: None,
            triangle: None,
            corners: None,
        });
        let diffusion = Diffusion { points: points.collect(), blend: Blend::Alpha, opacity: 1.0 };
        let transfer = Transfer {
            axes: [TransferAxis::Visibility, TransferAxis::Angle],
            size: [32, 64],
            ..Transfer::new(vec![TransferLayer::Diffusion(diffusion)])
        };
        LightKey {
            frame: self.frame,
            light: Some(sun(self.direction, self.radiance)),
            views: Vec::new(),
            looks: Some(Looks { transfer: Some(transfer), ..Looks::default() }),
        }
    }
}

fn columns_and_gate() -> Vec<Occluder> {
    let mut stage = Stage::new(GROUND);
    stage.ground([[-230.0, 230.0], [-400.0, 20.0]], 0.0);
    hills(&mut stage);
    for side in [-1.0, 1.0] {
        let x = side * BESIDE;
        let height =
            |z: f64| BROKEN.iter().find(|broken| (broken.0, broken.1) == (side, z)).map_or(HIGH, |it| it.2);
        stage.of(STEPS).block([[x - 1.6, x + 1.6], [0.0, 0.2], [-61.0, -5.0]]);
        stage.of(STONE);
        for z in ALONG {
            stage.block([[x - 1.15, x + 1.15], [0.0, 0.6], [z - 1.15, z + 1.15]]);
            stage.pillar([x, z], 0.78, [0.6, height(z)]);
            if height(z) == HIGH {
                stage.block([[x - 1.1, x + 1.1], [HIGH, HIGH + 0.6], [z - 1.1, z + 1.1]]);
            }
        }
        for pair in ALONG.windows(2).filter(|pair| pair.iter().all(|&z| height(z) == HIGH)) {
            stage.block([[x - 0.85, x + 0.85], [HIGH + 0.6, HIGH + 1.5], [pair[1], pair[0]]]);
        }
    }
    // What has fallen.
    stage.block([[-4.85, -3.35], [0.0, 1.2], [-24.1, -20.7]]);
    stage.bar([3.7, 0.75, -38.6], [1.5, 0.0, -1.6], 0.75);
    gate(&mut stage);
    stage.occluders
}

fn gate(stage: &mut Stage) {
    let about = |half: f64| [GATE - half, GATE + half];
    for side in [-1.0, 1.0] {
        let beside = |middle: f64, half: f64| [side * middle - half, side * middle + half];
        stage.block([beside(8.2, 2.2), [0.0, 12.4], about(2.0)]);
        stage.block([beside(8.2, 2.5), [12.4, 13.2], about(2.3)]);
        stage.block([beside(15.8, 5.4), [0.0, 6.4], about(1.2)]);
    }
    stage.block([[-11.2, 11.2], [13.2, 14.6], about(2.0)]);
    stage.block([[-9.2, 9.2], [14.6, 15.4], about(1.7)]);
    stage.of(STEPS);
    for step in 0..4 {
        let (middle, half) = (GATE - 3.0 - 1.2 * f64::from(step), 4.0 - 1.2 * f64::from(step));
        stage.block([[-6.0, 6.0], [0.0, 0.28 * f64::from(2 * step + 1)], [middle - half, middle + half]]);
    }
}

fn hills(stage: &mut Stage) {
    for (x, radius, top, z) in
        [(-120.0, 150.0, 20.0, -300.0), (-20.0, 190.0, 11.0, -340.0), (110.0, 140.0, 26.0, -310.0)]
    {
        stage.occluders.push(Occluder::Sphere(SphereShape {
            center: [x, top - radius, z],
            radius,
            albedo: Channels::Rgb(HILLS),
            transmittance: Channels::Grey(0.0),
            to_world: None,
        }));
    }
}
