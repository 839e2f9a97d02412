//! A chapel with windows of stained glass, which colour the light without any paint; one shaft is painted on top.

use std::error::Error;

use glam::DVec3;
use image::{Rgba, RgbaImage};
use unscatter::io::scene_file::{Channels, Document, GltfMesh, Light, Medium, Occluder};

use crate::glb::{Made, Surface, glb};
use crate::painter::Shaft;
use crate::stage::{Arch, Opening, Stage, Wall, shadow_map, view};

/// Where the light goes; from the south, −z.
const SUN: [f64; 3] = [-0.3, -0.62, 0.72];

const FLOOR: [f64; 3] = [0.3, 0.28, 0.25];
const WALL: [f64; 3] = [0.34, 0.32, 0.28];
const PILLAR: [f64; 3] = [0.5, 0.46, 0.4];

/// The south wall, with the windows.
const SOUTH: Wall = Wall { x: [-7.0, 7.0], y: [0.0, 9.0], z: [-4.5, -4.0] };
/// Middles of the windows, along x.
const WINDOWS: [f64; 3] = [-4.0, 0.0, 4.0];
const WIDTH: f64 = 2.0;
const SILL: f64 = 2.0;
const SPRING: f64 = 5.8;
/// Where the glass ends, above the point of the arch.
const TOP: f64 = SPRING + 1.8;

/// The scene, unpainted.
pub(crate) fn document() -> Document {
    let light = Light { direction: Some(SUN), gltf: None, radiance: Some(Channels::Rgb([60.0, 57.0, 52.0])) };
    let medium = Medium { sigma_t: Channels::Grey(0.03), albedo: Channels::Grey(0.95), g: 0.2 };
    let views = vec![
        view("choir", [-2.6, 2.0, 5.7], [-0.7, 3.5, -4.0], 92.0),
        view("door", [-6.6, 2.4, 5.2], [1.6, 2.9, -2.4], 74.0),
    ];
    let mut document = Document::new(light, medium, views);
    document.name = Some("Chapel".to_owned());
    document.ambient = Channels::Rgb([0.1, 0.1, 0.12]);
    let church = [DVec3::new(-7.5, 0.0, -5.0), DVec3::new(7.5, 9.5, 6.5)];
    document.shadow_map = shadow_map(1024, DVec3::from_array(SUN), church);
    let mut stage = Stage::new(FLOOR);
    stage.ground([[-7.0, 7.0], [-4.0, 6.0]], 0.0);
    let openings = WINDOWS.map(|middle| Opening {
        middle,
        width: WIDTH,
        sill: SILL,
        spring: SPRING,
        arch: Arch::Pointed,
    });
    stage.of(WALL).wall(SOUTH, &openings);
    stage.block([SOUTH.x, SOUTH.y, [6.0, 6.5]]);
    stage.block([SOUTH.x, [9.0, 9.5], [-4.5, 6.5]]);
    for x in [[-7.5, -7.0], [7.0, 7.5]] {
        stage.block([x, [0.0, 9.5], [-4.5, 6.5]]);
    }
    stage.of(PILLAR);
    for x in [-6.3, -2.0, 2.0, 6.3] {
        stage.pillar([x, -3.7], 0.22, [0.0, 6.4]);
        for (half, y) in [(0.4, [0.0, 0.35]), (0.34, [6.2, 6.5])] {
            stage.block([[x - half, x + half], y, [-4.0, -3.7 + half]]);
        }
    }
    // Steps, and a table on them.
    stage.block([[4.6, 7.0], [0.0, 0.25], [-1.6, 2.6]]);
    stage.block([[5.4, 6.2], [0.25, 1.2], [-0.4, 1.4]]);
    stage.block([[5.2, 6.4], [1.2, 1.32], [-0.6, 1.6]]);
    document.occluders = stage.occluders;
    document.occluders.push(Occluder::Gltf(GltfMesh {
        file: "chapel.glb".into(),
        node: None,
        to_world: None,
    }));
    document
}

/// The glass of the windows, each a picture.
pub(crate) fn windows() -> Result<Vec<u8>, Box<dyn Error>> {
    let names = [["east", "ruby"], ["middle", "gold"], ["west", "cobalt"]];
    let surfaces = WINDOWS.map(|x| {
        let mut surface = Surface::default();
        let middle = DVec3::new(x, 0.5 * (SILL + TOP), -4.25);
        surface.card(middle, [DVec3::X * 0.5 * WIDTH, DVec3::Y * 0.5 * (TOP - SILL)]);
        surface
    });
    let parts: Vec<_> = names
        .into_iter()
        .zip(&surfaces)
        .zip(PALETTES)
        .map(|((names, surface), palette)| (names, surface, Made::OfGlass(window(palette))))
        .collect();
    glb(&parts)
}

/// Colours of the glass as sRGB: field, its other diamonds, border, medallion, its heart.
type Palette = [[u8; 3]; 5];

const PALETTES: [Palette; 3] = [
    [[0xd0, 0x20, 0x28], [0xe0, 0x50, 0x20], [0x30, 0x40, 0xc0], [0xf0, 0xb0, 0x30], [0x30, 0x98, 0x50]],
    [[0xe8, 0xa8, 0x28], [0xf0, 0xc8, 0x70], [0xb8, 0x28, 0x38], [0xe8, 0x70, 0x20], [0x40, 0x60, 0xd8]],
    [[0x20, 0x40, 0xc8], [0x28, 0x88, 0xd0], [0xa0, 0x30, 0xb0], [0x38, 0xb0, 0x68], [0xf0, 0xc8, 0x50]],
];

/// Diamonds of coloured glass between leads, a border around them, and medallions on the middle line.
fn window(palette: Palette) -> RgbaImage {
    const PIXELS: [u32; 2] = [80, 224];
    // Half a lead, in pixels.
    const LEAD: f64 = 1.1;
    let [width, height] = PIXELS.map(f64::from);
    RgbaImage::from_fn(PIXELS[0], PIXELS[1], |i, j| {
        let (x, y) = (f64::from(i) + 0.5, f64::from(j) + 0.5);
        let from_edge = x.min(width - x).min(height - y);
        let from_heart = [36.0, 104.0, 172.0].map(|middle| (x - 0.5 * width).hypot(y - middle));
        let from_heart = from_heart.into_iter().fold(f64::INFINITY, f64::min);
        // The two families of leads of the diamonds.
        let [a, b] = [x / 12.0 + y / 18.0, x / 12.0 - y / 18.0].map(|at| at + 0.33);
        let from_diamond = [a, b].map(|at| 10.0 * (at - at.round()).abs());
        let lies = |distance: f64, at: f64| (distance - at).abs() < LEAD;
        let is_lead = lies(from_edge, 0.0)
            || lies(from_edge, 8.0)
            || lies(from_heart, 9.0)
            || lies(from_heart, 21.0)
            || from_edge <= 8.0 && (y / 22.0).fract() * 22.0 < 2.0 * LEAD
            || from_edge > 8.0 && from_heart > 21.0 && from_diamond.iter().any(|&far| far < LEAD);
        let [r, g, b] = match () {
            () if is_lead => [0; 3],
            () if from_edge < 8.0 => palette[2],
            () if from_heart < 9.0 => palette[4],
            () if from_heart < 21.0 => palette[3],
            () if (a.floor() + b.floor()).rem_euclid(2.0) < 1.0 => palette[0],
            () => palette[1],
        };
        Rgba([r, g, b, 255])
    })
}

/// The shaft of the middle window, painted rose.
pub(crate) fn shafts() -> Vec<Shaft> {
    vec![Shaft {
        from: DVec3::new(WINDOWS[1], 0.5 * (SILL + SPRING), SOUTH.z[1]),
        half: [0.8, 1.8],
        along: [0.8, 6.0],
        color: [0xff, 0x70, 0xb0],
        otherwise: None,
    }]
}
