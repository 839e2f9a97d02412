//! A walled citadel at dawn: the sun behind it shines through its gates and between its towers into the court.

use glam::DVec3;
use unscatter::io::scene_file::{Channels, Document, Light, Medium};

use crate::painter::Shaft;
use crate::stage::{Arch, Opening, Stage, Wall, shadow_map, view};

/// Where the light goes; the sun is 23° high.
const SUN: [f64; 3] = [0.26, -0.4, 0.87];

const GROUND: [f64; 3] = [0.09, 0.085, 0.075];
const STONE: [f64; 3] = [0.14, 0.13, 0.12];
const TOWER: [f64; 3] = [0.46, 0.42, 0.37];

/// The court side of the wall towards the sun.
const GATE_WALL: [f64; 2] = [-26.0, -23.5];

/// The scene, unpainted.
pub(crate) fn document() -> Document {
    let light = Light { direction: Some(SUN), gltf: None, radiance: Some(Channels::Rgb([30.0, 26.5, 22.0])) };
    let medium = Medium { sigma_t: Channels::Grey(0.018), albedo: Channels::Grey(0.95), g: 0.2 };
    let views = vec![
        view("court", [3.5, 2.2, 12.0], [0.5, 10.4, -24.0], 76.0),
        view("wall-walk", [25.5, 13.5, -7.0], [-8.0, 3.0, -15.0], 66.0),
        view("balcony", [11.0, 8.2, 3.0], [-5.5, 6.0, -22.0], 66.0),
    ];
    let mut document = Document::new(light, medium, views);
    document.name = Some("Citadel".to_owned());
    document.ambient = Channels::Rgb([0.030, 0.040, 0.062]);
    let corners = [DVec3::new(-32.0, 0.0, -46.0), DVec3::new(32.0, 27.0, 18.0)];
    document.shadow_map = shadow_map(512, DVec3::from_array(SUN), corners);
    document.occluders = citadel().occluders;
    document
}

fn citadel() -> Stage {
    let mut stage = Stage::new(STONE);
    stage.of(GROUND).ground([[-120.0, 120.0], [-140.0, 60.0]], 0.0);
    stage.of(STONE);
    outer_wall(&mut stage);
    gate_wall(&mut stage);
    // The other three sides of the court.
    for x in [[-31.0, -28.0], [28.0, 31.0]] {
        stage.block([x, [0.0, 14.0], [-26.0, 18.0]]);
    }
    stage.block([[-28.0, 28.0], [0.0, 12.0], [18.0, 20.0]]);
    keep(&mut stage);
    stage
}

fn outer_wall(stage: &mut Stage) {
    let wall = Wall { x: [-44.0, 44.0], y: [0.0, 6.0], z: [-42.0, -40.5] };
    let gate = Opening { middle: -5.0, width: 5.0, sill: 0.0, spring: 2.4, arch: Arch::Round };
    stage.wall(wall, &[gate]);
    stage.merlons(wall, 1.2, 22);
    for x in [-30.0, -9.5, -0.5, 22.0] {
        stage.tower([x, -41.5], 2.0, 9.0);
    }
}

/// Towers with a gate, a crenellated wall and a postern between them.
fn gate_wall(stage: &mut Stage) {
    for (x, radius, height) in [
        (-27.5, 5.0, 26.0),
        (-16.0, 3.4, 24.0),
        (-5.6, 3.2, 25.0),
        (5.6, 3.2, 25.0),
        (16.0, 3.4, 24.0),
        (27.5, 5.0, 26.0),
    ] {
        stage.of(TOWER).tower([x, -24.8], radius, height);
    }
    stage.of(STONE);
    let z = GATE_WALL;
    let gate = Opening { middle: 0.0, width: 5.0, sill: 0.0, spring: 6.0, arch: Arch::Round };
    let window = Opening { middle: 0.0, width: 1.8, sill: 13.0, spring: 15.5, arch: Arch::Pointed };
    stage.wall(Wall { x: [-5.0, 5.0], y: [0.0, 11.0], z }, &[gate]);
    stage.wall(Wall { x: [-5.0, 5.0], y: [11.0, 22.0], z }, &[window]);
    stage.merlons(Wall { x: [-5.0, 5.0], y: [11.0, 22.0], z }, 1.3, 3);
    let low = Wall { x: [-16.0, -5.6], y: [0.0, 11.0], z };
    stage.wall(low, &[]);
    stage.merlons(low, 1.6, 6);
    stage.block([low.x, [17.5, 23.0], z]);
    let postern = Opening { middle: 10.8, width: 3.2, sill: 0.0, spring: 5.0, arch: Arch::Pointed };
    let high = Wall { x: [5.6, 16.0], y: [0.0, 17.0], z };
    stage.wall(high, &[postern]);
    stage.merlons(high, 1.6, 6);
    stage.block([high.x, [18.6, 23.0], z]);
    let sally_port = Opening { middle: -20.5, width: 2.6, sill: 0.0, spring: 4.0, arch: Arch::Round };
    stage.wall(Wall { x: [-27.5, -16.0], y: [0.0, 21.0], z }, &[sally_port]);
    stage.block([[16.0, 27.5], [0.0, 21.0], z]);
}

fn keep(stage: &mut Stage) {
    stage.block([[14.0, 23.0], [0.0, 14.0], [2.0, 10.0]]);
    for x in [14.0, 23.0] {
        for z in [2.0, 10.0] {
            stage.of(TOWER).tower([x, z], 1.6, 19.0);
        }
    }
}

/// The shafts, and what is painted on them.
pub(crate) fn shafts() -> Vec<Shaft> {
    let z = GATE_WALL[1];
    let shaft = |x: f64, y: f64, half: [f64; 2], along: [f64; 2], color: [u8; 3]| Shaft {
        from: DVec3::new(x, y, z),
        half,
        along,
        color,
        otherwise: None,
    };
    let mut shafts = vec![
        // Through the gate, from the ground up.
        shaft(-0.9, 2.6, [1.1, 1.2], [0.5, 5.0], [0xf0, 0x28, 0x18]),
        shaft(0.6, 5.0, [1.4, 1.4], [0.5, 9.0], [0xff, 0x5a, 0x14]),
        shaft(0.2, 7.2, [1.4, 1.2], [1.0, 12.0], [0xff, 0x96, 0x20]),
        // The window above it.
        shaft(0.0, 14.6, [0.8, 1.6], [2.0, 16.0], [0xff, 0xd0, 0x38]),
        // Between the towers, over the low wall.
        shaft(-10.8, 13.0, [1.5, 1.2], [1.0, 16.0], [0x18, 0x90, 0xd8]),
        shaft(-10.8, 16.0, [1.5, 1.2], [1.0, 16.0], [0x20, 0xc8, 0xb0]),
        // The postern and the sally port.
        shaft(10.8, 4.4, [1.1, 2.2], [1.0, 9.0], [0xc0, 0x30, 0xf0]),
        shaft(-20.5, 3.0, [1.0, 1.8], [0.5, 6.0], [0xf0, 0x30, 0xa0]),
        // Over the high wall, between its merlons.
        shaft(9.2, 17.8, [2.0, 0.6], [1.0, 16.0], [0xff, 0xc0, 0x60]),
    ];
    // The views disagree about the window: on the balcony it is seen as rose.
    shafts[3].otherwise = Some((2, [0xff, 0x50, 0x80]));
    shafts
}
