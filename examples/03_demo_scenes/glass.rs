//! A ball of glass that bends the light and shows another suit of cards from each of four sides, as the pictures that
//! are hidden in Klehm 2015, fig. 7.7.

use std::error::Error;
use std::path::Path;

use glam::DVec2;
use unscatter::io::scene_file::{
    Channels, Extinction, Field, FieldSource, Find, FovAxis, GridSize, Noise, Refraction, Shape, Shapes,
    Sphere, Target, VolumeDocument, VolumeView,
};

use crate::canvas::{self, Ink};
use crate::stage::{camera, volume};

/// Pixels along each side of the pictures.
const SIDE: u32 = 256;
/// Radii in the pictures: of what is hidden, of where it may be hidden, and beyond which there is nothing but the
/// background. Between the first and the last nothing is wanted: there rays are bent most.
const PICTURE: f64 = 0.76;
const HULL: f64 = 0.77;
const OUTSIDE: f64 = 0.88;
/// What the picture around a suit weighs.
const PAPER_WEIGHT: f64 = 1.0 / 3.0;

const PAPER: [u8; 3] = [0x9d, 0xaa, 0xac];
const WHITE: [u8; 3] = [0xff; 3];
const BLACK: [u8; 3] = [0; 3];

/// A suit, from where it is seen, and its colour.
struct Card {
    name: &'static str,
    origin: [f64; 3],
    color: [u8; 3],
    suit: fn(DVec2) -> bool,
}

const CARDS: [Card; 4] = [
    Card { name: "spade", origin: [0.0, 2.756, 9.612], color: [0x45, 0x45, 0x7c], suit: spade },
    Card { name: "heart", origin: [6.76, -3.42, 6.528], color: [0xae, 0x30, 0x38], suit: heart },
    Card { name: "club", origin: [9.606, 2.756, -0.336], color: [0x38, 0x73, 0x50], suit: club },
    Card { name: "diamond", origin: [6.408, -3.42, -6.872], color: [0xb8, 0x7c, 0x27], suit: diamond },
];

/// Writes the pictures that are wanted of the views; gives back the scene.
pub(crate) fn write(folder: &Path) -> Result<VolumeDocument, Box<dyn Error>> {
    let mask = |p: DVec2| Some((if p.length() < HULL { WHITE } else { BLACK }, 1.0));
    canvas::write(&folder.join("glass_mask.png"), [SIDE; 2], mask)?;
    let mut views = Vec::new();
    for card in &CARDS {
        let file = format!("glass_{}.png", card.name);
        canvas::write(&folder.join(&file), [SIDE; 2], |p| card.ink(p))?;
        let camera = camera(card.origin, [0.0; 3], (12.0, FovAxis::Y), [SIDE; 2]);
        views.push(VolumeView {
            picture: Some(file.into()),
            mask: Some("glass_mask.png".into()),
            ..VolumeView::new(card.name, camera)
        });
    }
    let smoky = ball(0.3, 0.0, 0.1);
    let mut volume = volume(GridSize::Cube(76), Field::made(smoky), [[-0.93; 3], [0.93; 3]]);
    let index = Shapes {
        noise: Some(Noise { scale: 0.6, octaves: 2, gain: 0.5, depth: 0.03, mottle: 0.35, seed: 5 }),
        ..ball(1.35, 1.0, 0.25)
    };
    volume.refraction = Some(Refraction {
        index: Field::From(FieldSource {
            made: Some(index),
            size: Some(GridSize::Cube(48)),
            ..FieldSource::default()
        }),
        step: Some(0.05),
    });
    let mut document = VolumeDocument::new(volume, Find::Extinction, views);
    document.name = Some("Glass".to_owned());
    document.background = Some(Channels::Grey(1.0));
    document.target = Target::Radiance;
    document.extinction = Extinction { colored: true, ..Extinction::default() };
    document.solve.iterations = 60;
    Ok(document)
}

fn ball(inside: f64, outside: f64, edge: f64) -> Shapes {
    let shapes = vec![Shape::Sphere(Sphere { center: [0.0; 3], radius: 0.76 })];
    Shapes { shapes, inside, outside, edge, noise: None }
}

impl Card {
    fn ink(&self, p: DVec2) -> Option<Ink> {
        if p.length() > OUTSIDE {
            Some((WHITE, PAPER_WEIGHT))
        } else if p.length() > PICTURE {
            None
        } else if (self.suit)(p / 1.1) {
            Some((self.color, 1.0))
        } else {
            Some((PAPER, PAPER_WEIGHT))
        }
    }
}

fn heart(p: DVec2) -> bool {
    // The straight sides touch the discs.
    let sides = [[0.0, -0.46], [0.38, -0.012], [0.0, 0.2], [-0.38, -0.012]];
    let is_in_disc = |x: f64| canvas::disc(p, [x, 0.14], 0.235) < 0.0;
    is_in_disc(0.2) || is_in_disc(-0.2) || canvas::is_in_polygon(p, &sides)
}

fn spade(p: DVec2) -> bool {
    heart(DVec2::new(p.x, -p.y)) || stem(p)
}

fn club(p: DVec2) -> bool {
    let discs = [([0.0, 0.22], 0.2), ([-0.23, -0.1], 0.2), ([0.23, -0.1], 0.2), ([0.0, -0.02], 0.1)];
    discs.into_iter().any(|(middle, radius)| canvas::disc(p, middle, radius) < 0.0) || stem(p)
}

fn diamond(p: DVec2) -> bool {
    p.x.abs() / 0.34 + p.y.abs() / 0.48 < 1.0
}

fn stem(p: DVec2) -> bool {
    let below = f64::max(-0.22 - p.y, 0.0);
    (-0.46..-0.05).contains(&p.y) && p.x.abs() < 0.03 + 2.2 * below * below
}
