//! A forest in the morning: god rays through gaps of a canopy of leaf cards with an alpha mask.

use std::error::Error;

use glam::DVec3;
use unscatter::io::scene_file::{Channels, Document, GltfMesh, Light, Medium, Occluder};

use crate::glb::{Made, Surface, glb, leaf_picture};
use crate::numbers::Numbers;
use crate::painter::Shaft;
use crate::stage::{Stage, shadow_map, view};

/// Where the light goes.
const SUN: [f64; 3] = [0.3, -0.76, 0.57];

const MOSS: [f64; 3] = [0.05, 0.065, 0.03];
const BARK: [f32; 3] = [0.16, 0.125, 0.095];

const CARDS: usize = 3500;

/// Between these heights there are leaves.
const CANOPY: [f64; 2] = [7.0, 12.5];

/// Where the sun finds a gap: the place on the ground that it reaches, the gap's radius, and its colour.
const GAPS: [([f64; 2], f64, [u8; 3]); 9] = [
    ([-5.2, -4.5], 0.55, [0xf4, 0xc0, 0x38]),
    ([-2.6, -8.0], 0.7, [0xb8, 0xd0, 0x30]),
    ([-0.4, -2.0], 0.42, [0xf0, 0xb0, 0x30]),
    ([1.8, -5.6], 0.65, [0x30, 0x70, 0xf0]),
    ([4.6, -9.5], 0.75, [0xc8, 0xd8, 0x40]),
    ([4.4, -3.4], 0.5, [0xf0, 0x48, 0x90]),
    ([7.4, -6.0], 0.6, [0xf0, 0xc8, 0x48]),
    ([-8.2, -9.0], 0.7, [0x80, 0xc0, 0x38]),
    ([-0.6, -12.5], 0.8, [0xf8, 0xd8, 0x70]),
];

/// The scene, unpainted.
pub(crate) fn document() -> Document {
    let light = Light { direction: Some(SUN), gltf: None, radiance: Some(Channels::Rgb([46.0, 42.0, 33.0])) };
    let medium = Medium { sigma_t: Channels::Grey(0.03), albedo: Channels::Grey(0.95), g: 0.2 };
    let views = vec![
        view("path", [0.8, 1.7, 7.5], [0.2, 4.2, -8.0], 66.0),
        view("glade", [-11.5, 2.2, 1.5], [3.0, 3.6, -7.5], 66.0),
        view("ferns", [11.5, 1.4, 0.5], [-3.0, 4.2, -7.5], 66.0),
    ];
    let mut document = Document::new(light, medium, views);
    document.name = Some("Forest".to_owned());
    document.ambient = Channels::Rgb([0.030, 0.040, 0.034]);
    let sun = DVec3::from_array(SUN);
    let wood = [DVec3::new(-52.0, 0.0, -70.0), DVec3::new(52.0, 13.0, 14.0)];
    document.shadow_map = shadow_map(2048, sun, wood);
    let mut stage = Stage::new(MOSS);
    stage.ground([[-90.0, 90.0], [-90.0, 90.0]], 0.0);
    far_canopy(&mut stage);
    document.occluders = stage.occluders;
    document.occluders.push(Occluder::Gltf(GltfMesh {
        file: "forest.glb".into(),
        node: None,
        to_world: None,
    }));
    document
}

/// The wood goes on all around: roofs of leaves that are too far away to be more than dark, and thickets before
/// which views end inside the shadow map.
fn far_canopy(stage: &mut Stage) {
    stage.of([0.03, 0.04, 0.02]);
    stage.ground([[-90.0, 90.0], [-150.0, -33.5]], 10.0);
    for x in [[-90.0, -24.0], [16.0, 90.0]] {
        stage.ground([x, [-42.0, 40.0]], 11.0);
    }
    for x in [[-49.0, -46.0], [46.0, 49.0]] {
        stage.block([x, [0.0, 9.0], [-65.0, 30.0]]);
    }
    stage.block([[-49.0, 49.0], [0.0, 9.0], [-66.0, -63.0]]);
}

/// The file `forest.glb`: leaves and trunks.
pub(crate) fn model() -> Result<Vec<u8>, Box<dyn Error>> {
    let mut numbers = Numbers(0x5eed);
    let trees = trees(&mut numbers);
    let leaves = leaves(&mut numbers);
    let mut wood = Surface::default();
    for tree in &trees {
        trunk(&mut wood, &mut numbers, *tree);
    }
    glb(&[
        (["leaves", "leaf"], &leaves, Made::OfLeaves(leaf_picture())),
        (["trunks", "bark"], &wood, Made::Of(BARK)),
    ])
}

fn trees(numbers: &mut Numbers) -> Vec<DVec3> {
    let mut trees: Vec<DVec3> = Vec::new();
    while trees.len() < 42 {
        let tree = DVec3::new(numbers.between(-20.0, 20.0), 0.0, numbers.between(-30.0, 4.0));
        let is_free = trees.iter().all(|other| other.distance(tree) > 2.4);
        // The path and the cameras stay free, and no trunk stands in a shaft.
        let on_path = (tree.x - 0.5).abs() < 2.0 && tree.z > -14.0;
        let at_camera = tree.x.abs() > 8.0 && tree.z > -3.0;
        let in_shaft = (0..8).any(|step| is_in_gap(tree + DVec3::Y * f64::from(step), 0.5));
        if is_free && !on_path && !at_camera && !in_shaft {
            trees.push(tree);
        }
    }
    trees
}

/// Whether a point lies in the light of a gap, or within `margin` metres of it.
fn is_in_gap(point: DVec3, margin: f64) -> bool {
    let sun = DVec3::from_array(SUN).normalize();
    GAPS.iter().any(|&([x, z], radius, _)| {
        (point - DVec3::new(x, 0.0, z)).reject_from_normalized(sun).length() < radius + margin
    })
}

fn leaves(numbers: &mut Numbers) -> Surface {
    let sun = DVec3::from_array(SUN).normalize();
    let mut leaves = Surface::default();
    while leaves.quads() < CARDS {
        let ground = DVec3::new(numbers.between(-21.0, 21.0), 0.0, numbers.between(-27.0, 8.0));
        let height = numbers.between(CANOPY[0], CANOPY[1]);
        // Up towards the sun, so that what is shaded is what is seen.
        let middle = ground - sun * (height / -sun.y);
        let size = numbers.between(0.7, 1.3);
        if is_in_gap(middle, 0.68 * size) {
            continue;
        }
        // Leaves turn towards the sun.
        let face = (0.8 * numbers.direction() - sun).normalize();
        let a = face.cross(numbers.direction()).normalize_or(face.any_orthonormal_vector());
        let b = face.cross(a);
        leaves.card(middle, [size * a, size * b]);
    }
    leaves
}

/// Eight flat sides, thinner upwards, a little off the vertical.
fn trunk(wood: &mut Surface, numbers: &mut Numbers, foot: DVec3) {
    const RING: [[f64; 2]; 8] = [
        [1.0, 0.0],
        [0.7, 0.7],
        [0.0, 1.0],
        [-0.7, 0.7],
        [-1.0, 0.0],
        [-0.7, -0.7],
        [0.0, -1.0],
        [0.7, -0.7],
    ];
    let radius = numbers.between(0.16, 0.34);
    let lean = DVec3::new(numbers.between(-0.6, 0.6), 0.0, numbers.between(-0.6, 0.6));
    let levels = [[0.0, 1.4], [0.8, 1.0], [12.0, 0.4]];
    let ring = |[height, width]: [f64; 2], corner: usize| {
        let [x, z] = RING[corner % RING.len()];
        foot + lean * (height / 12.0) + DVec3::new(x * radius * width, height, z * radius * width)
    };
    for pair in levels.windows(2) {
        for corner in 0..RING.len() {
            let (next, [low, high]) = (corner + 1, [pair[0], pair[1]]);
            wood.quad([ring(low, next), ring(low, corner), ring(high, corner), ring(high, next)]);
        }
    }
}

/// The shafts, and what is painted on them.
pub(crate) fn shafts() -> Vec<Shaft> {
    let sun = DVec3::from_array(SUN).normalize();
    let shaft = |([x, z], radius, color): ([f64; 2], f64, [u8; 3])| {
        let ground = DVec3::new(x, 0.0, z);
        // The lower edge of the canopy.
        let from = ground - sun * (CANOPY[0] / -sun.y);
        Shaft { from, half: [radius; 2], along: [1.0, 7.0], color, otherwise: None }
    };
    GAPS.into_iter().map(shaft).collect()
}
