//! The nave of a church: the sun shines through the windows of its south side, and paint makes them stained glass.

use glam::DVec3;
use unscatter::io::scene_file::{Channels, Document, Light, Medium};

use crate::painter::Shaft;
use crate::stage::{Arch, Opening, Stage, Wall, shadow_map, view};

/// Where the light goes; from the south, −z.
const SUN: [f64; 3] = [-0.16, -0.72, 0.66];

const FLOOR: [f64; 3] = [0.07, 0.065, 0.06];
const WALL: [f64; 3] = [0.2, 0.19, 0.17];
const PILLAR: [f64; 3] = [0.55, 0.5, 0.43];

/// Middles of the bays with a tall window, along x.
const WINDOWS: [f64; 4] = [-16.5, -10.5, 1.5, 7.5];
/// Middle of the rose window, between them.
const ROSE: f64 = -4.5;
const ROSE_MIDDLE: f64 = 11.6;
const ROSE_RADIUS: f64 = 2.5;

/// The south wall, with the windows.
const SOUTH: Wall = Wall { x: [-21.0, 12.0], y: [0.0, 17.0], z: [-9.6, -9.0] };

/// One hue a window, from the east to the west.
const GLASS: [[u8; 3]; 4] = [[0xc8, 0x30, 0xd8], [0x20, 0x78, 0xf0], [0x28, 0xb8, 0x50], [0xf4, 0x60, 0x20]];

/// The scene, unpainted.
pub(crate) fn document() -> Document {
    let light = Light { direction: Some(SUN), gltf: None, radiance: Some(Channels::Rgb([52.0, 48.0, 42.0])) };
    let medium = Medium { sigma_t: Channels::Grey(0.018), albedo: Channels::Grey(0.95), g: 0.15 };
    let views = vec![
        view("nave", [-4.5, 2.6, 8.4], [-4.5, 7.2, -9.0], 84.0),
        view("west", [8.2, 3.6, 7.4], [-9.0, 7.0, -9.0], 78.0),
        view("gallery", [-16.8, 10.0, 7.6], [-1.0, 5.0, -8.0], 78.0),
    ];
    let mut document = Document::new(light, medium, views);
    document.name = Some("Nave".to_owned());
    document.ambient = Channels::Rgb([0.050, 0.048, 0.058]);
    let sun = DVec3::from_array(SUN);
    let church = [DVec3::new(-22.0, 0.0, -10.5), DVec3::new(13.0, 18.5, 10.0)];
    document.shadow_map = shadow_map(1024, sun, church);
    document.occluders = church_of_stone().occluders;
    document
}

fn church_of_stone() -> Stage {
    let mut stage = Stage::new(FLOOR);
    stage.ground([[-22.0, 13.0], [-9.6, 9.6]], 0.0);
    south_wall(&mut stage);
    // North wall, vault, ends.
    stage.of(WALL).block([SOUTH.x, SOUTH.y, [9.0, 9.6]]);
    stage.block([SOUTH.x, [17.0, 18.0], [-9.6, 9.6]]);
    stage.block([[-22.0, -21.0], [0.0, 18.0], [-9.6, 9.6]]);
    stage.block([[12.0, 13.0], [0.0, 18.0], [-9.6, 9.6]]);
    stage.of(PILLAR);
    for x in [-19.5, -13.5, -7.8, -1.2, 4.5, 10.5] {
        columns(&mut stage, x);
    }
    stage
}

/// A pair of columns, and the ribs that go up from them to the vault.
fn columns(stage: &mut Stage, x: f64) {
    for side in [-1.0, 1.0] {
        let z = side * 7.2;
        stage.pillar([x, z], 0.5, [0.0, 11.0]);
        for (half, y) in [(0.85, [0.0, 0.5]), (0.7, [0.5, 1.0]), (0.75, [10.6, 11.2])] {
            stage.block([[x - half, x + half], y, [z - half, z + half]]);
        }
        let ribs = [[11.0, 7.2], [13.6, 5.9], [15.6, 3.6], [16.8, 0.0]];
        for ends in ribs.windows(2) {
            let [from, to] = [ends[0], ends[1]];
            let middle = [x, 0.5 * (from[0] + to[0]), side * 0.5 * (from[1] + to[1])];
            stage.bar(middle, [0.0, 0.5 * (to[0] - from[0]), side * 0.5 * (to[1] - from[1])], 0.28);
        }
    }
}

fn south_wall(stage: &mut Stage) {
    let window = |middle| Opening { middle, width: 2.4, sill: 4.0, spring: 12.4, arch: Arch::Pointed };
    let x = |left: f64, right: f64| Wall { x: [left, right], ..SOUTH };
    let [a, b, c, d] = WINDOWS.map(window);
    stage.of(WALL).wall(x(SOUTH.x[0], -7.5), &[a, b]);
    stage.wall(x(-1.5, SOUTH.x[1]), &[c, d]);
    for middle in WINDOWS {
        // A mullion and two crossbars.
        stage.block([[middle - 0.08, middle + 0.08], [4.0, 14.0], [-9.4, -9.2]]);
        for y in [6.8, 9.6, 12.4] {
            stage.block([[middle - 1.2, middle + 1.2], [y - 0.08, y + 0.08], [-9.4, -9.2]]);
        }
    }
    rose(stage);
}

/// A wheel: a round hole with spokes, a hub and a ring of discs.
fn rose(stage: &mut Stage) {
    let [bottom, top] = SOUTH.y;
    let z = SOUTH.z;
    let columns = 24;
    let edge = |column: i32| ROSE_RADIUS * (f64::from(2 * column) / f64::from(columns) - 1.0);
    stage.block([[-7.5, ROSE - ROSE_RADIUS], [bottom, top], z]);
    stage.block([[ROSE + ROSE_RADIUS, -1.5], [bottom, top], z]);
    for column in 0..columns {
        let (left, right) = (edge(column), edge(column + 1));
        let middle = 0.5 * (left + right);
        let half = (ROSE_RADIUS * ROSE_RADIUS - middle * middle).sqrt();
        let x = [ROSE + left, ROSE + right];
        stage.block([x, [bottom, ROSE_MIDDLE - half], z]);
        stage.block([x, [ROSE_MIDDLE + half, top], z]);
    }
    stage.disc([ROSE, ROSE_MIDDLE, -9.3], 0.55, 0.2);
    for [a, b] in [[1.0, 0.0], [0.0, 1.0], [0.707, 0.707], [0.707, -0.707]] {
        stage.bar([ROSE, ROSE_MIDDLE, -9.3], [a * ROSE_RADIUS, b * ROSE_RADIUS, 0.0], 0.07);
        for side in [-1.0, 1.0] {
            let [u, v] =
                [0.924 * a - 0.383 * b, 0.383 * a + 0.924 * b].map(|w| side * 0.86 * ROSE_RADIUS * w);
            stage.disc([ROSE + u, ROSE_MIDDLE + v, -9.3], 0.3, 0.2);
        }
    }
}

/// The shafts, and what is painted on them.
pub(crate) fn shafts() -> Vec<Shaft> {
    let shaft = |x: f64, y: f64, half: [f64; 2], color: [u8; 3]| Shaft {
        from: DVec3::new(x, y, SOUTH.z[1]),
        half,
        along: [1.5, 8.0],
        color,
        otherwise: None,
    };
    let glass = WINDOWS
        .into_iter()
        .zip(GLASS)
        .flat_map(|(x, color)| [5.6, 8.4, 11.2].map(|y| shaft(x, y, [1.1, 5.0], color)));
    let rose = [
        shaft(ROSE, 11.6, [0.9, 1.0], [0xff, 0xd0, 0x40]),
        shaft(ROSE, 13.3, [0.8; 2], [0xe8, 0x30, 0x70]),
        shaft(ROSE, 9.9, [0.8; 2], [0x30, 0x50, 0xf0]),
    ];
    glass.chain(rose).collect()
}
