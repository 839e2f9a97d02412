//! Media, rays and rows by lot, and their definitions written out again: what the tests of the traversals share with those of all
//! that is built on them.
#![allow(dead_code, reason = "each binary of tests takes what it needs")]

pub mod brute;

use std::sync::Arc;

use glam::{DAffine3, DMat3, DQuat, DVec3};
use unscatter::march::{
    Density, InScattering, LitVolume, PixelRays, Quantity, Traversal, VolumeTransport, VolumeTraversal,
    VoxelElements,
};
use unscatter::scene::{
    Camera, FovAxis, Interpolation, Quadrature, Ray, Samples, Volume, VoxelGrid, VoxelSet,
};

use crate::scenes::Numbers;

pub const BOTH: [Interpolation; 2] = [Interpolation::Nearest, Interpolation::Trilinear];

/// Numbers that differ from seed to seed from the first one on.
pub fn numbers(seed: u64) -> Numbers {
    let mut n = Numbers(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    (0..8).for_each(|_| _ = n.next());
    n
}

pub fn point(n: &mut Numbers, reach: f64) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| n.uniform(-reach, reach)))
}

/// A cube of about 2 metres around the origin: turned, of different lengths, every other one mirrored, a few sheared.
pub fn placement(n: &mut Numbers) -> DAffine3 {
    let turned = DMat3::from_quat(DQuat::from_axis_angle(n.direction(), n.uniform(0.0, 3.0)));
    let mut scale: [f64; 3] = std::array::from_fn(|_| n.uniform(1.0, 2.5));
    if n.next().is_multiple_of(2) {
        scale[0] = -scale[0];
    }
    let shear = if n.next().is_multiple_of(3) { n.uniform(-0.5, 0.5) } else { 0.0 };
    let sheared = DMat3::from_cols(DVec3::X, DVec3::new(shear, 1.0, 0.0), DVec3::Z);
    let matrix3 = turned * DMat3::from_diagonal(DVec3::from_array(scale)) * sheared;
    let cube = DAffine3 { matrix3, translation: point(n, 0.3) };
    cube * DAffine3::from_translation(DVec3::splat(-0.5))
}

pub fn grid(n: &mut Numbers, most: usize) -> VoxelGrid {
    let size = std::array::from_fn(|_| 1 + n.next() as usize % most);
    VoxelGrid::over_cube(size, placement(n)).unwrap()
}

/// Values up to `most`, of which about every third is zero, and whole stretches are: bricks without anything.
pub fn values(n: &mut Numbers, grid: VoxelGrid, channels: usize, most: f64) -> Volume {
    let mut is_empty = false;
    let samples = (0..grid.len())
        .flat_map(|index| {
            if index % 97 == 0 {
                is_empty = n.next().is_multiple_of(2);
            }
            let is_zero = is_empty || n.next().is_multiple_of(3);
            let value = |n: &mut Numbers| if is_zero { 0.0 } else { n.uniform(0.1, 1.0) * most };
            (0..channels).map(|_| value(n) as f32).collect::<Vec<f32>>()
        })
        .collect();
    Volume::new(grid, channels, Samples::F32(samples)).unwrap()
}

/// A camera of one pixel that looks along a direction; exactly, where that is along an axis.
pub fn camera(ray: &Ray) -> Camera {
    let forward = ray.direction.normalize();
    let up = if forward.y.abs() > 0.9 { DVec3::Z } else { DVec3::Y };
    let right = forward.cross(up).normalize();
    let matrix3 = DMat3::from_cols(right, right.cross(forward), -forward);
    Camera::new(DAffine3 { matrix3, translation: ray.origin }, 40.0, FovAxis::Y, [1, 1]).unwrap()
}

/// Rays of one's own as rows; each ends after its length.
pub fn rows_along(rays: &[(Ray, f64)]) -> PixelRays {
    let cameras: Vec<Camera> = rays.iter().map(|(ray, _)| camera(ray)).collect();
    let pixels: Vec<[u32; 2]> = (0..rays.len() as u32).map(|view| [view, 0]).collect();
    PixelRays::new(cameras.into(), pixels, rays.iter().map(|&(_, length)| length).collect())
}

/// Rays that start inside, outside and beside; some along the axes, some that end on the way.
pub fn random_rays(n: &mut Numbers, count: usize) -> Vec<(Ray, f64)> {
    (0..count)
        .map(|index| {
            let origin = point(n, if index % 3 == 0 { 0.6 } else { 3.0 });
            let direction = match index % 9 {
                0 => DVec3::X,
                1 => DVec3::NEG_Y,
                2 => DVec3::Z,
                3 => n.direction(),
                _ => (point(n, 0.8) - origin).normalize(),
            };
            let length = if index % 4 == 0 { n.uniform(0.0, 4.0) } else { f64::INFINITY };
            (Ray { origin, direction }, length)
        })
        .collect()
}

pub fn transport(density: Volume, interpolation: Interpolation) -> VolumeTransport {
    VolumeTransport {
        density: Arc::new(Density::new(Arc::new(density), interpolation)),
        basis: interpolation,
        quadrature: Quadrature::Exact,
        accuracy: 1e-6,
        transmittance_bound: 1e-300,
        refraction: None,
    }
}

/// All voxels of a grid.
pub fn part(quantity: Quantity, grid: VoxelGrid, basis: Interpolation) -> VoxelElements {
    VoxelElements::new(quantity, grid, Arc::new(VoxelSet::all(grid.size())), basis)
}

/// Light from everywhere on one grid, and from one direction with anisotropic scattering on another.
pub fn random_light(n: &mut Numbers, grids: [VoxelGrid; 2], channels: usize) -> Arc<InScattering> {
    let along = Some((n.direction(), 0.4));
    let lit = |n: &mut Numbers, grid, along| {
        let radiance = Arc::new(values(n, grid, channels, 2.0));
        LitVolume { along, radiance }
    };
    let fields = vec![lit(n, grids[0], None), lit(n, grids[1], along)];
    Arc::new(InScattering::new(fields))
}

/// A scene of a few hundred rays through a volume of some bricks, and emission and albedo on different grids.
pub fn random_traversal(seed: u64, rays: usize, channels: usize, basis: Interpolation) -> VolumeTraversal {
    let mut n = numbers(seed);
    let (medium, other) = (grid(&mut n, 20), grid(&mut n, 11));
    let density = values(&mut n, medium, channels, 2.0);
    let light = random_light(&mut n, [medium, other], channels);
    let parts = vec![part(Quantity::Emission, medium, basis), part(Quantity::Albedo(light), other, basis)];
    let rays = rows_along(&random_rays(&mut n, rays));
    VolumeTraversal::new(transport(density, basis), rays, parts)
}

/// A row as a dense vector, in the order of a grid's indices; a walk that visits an element twice breaks the law.
pub fn dense<const C: usize>(traversal: &VolumeTraversal, row: usize) -> Vec<[f64; C]> {
    let mut dense = vec![[0.0; C]; Traversal::<f64, C>::elements(traversal)];
    let mut places = Vec::new();
    for part in traversal.parts() {
        let first = places.len();
        places.extend(part.voxels().indices().iter().map(|&index| first + index as usize));
    }
    traversal.walk(row, &mut |element, weight: [f64; C]| {
        let place = places[element];
        assert_eq!(dense[place], [0.0; C], "element {element} is visited twice");
        assert!(weight.iter().all(|w| w.is_finite() && *w >= 0.0) && weight != [0.0; C], "{weight:?}");
        dense[place] = weight;
    });
    dense
}

/// Σ |a − b| of one channel.
pub fn difference<const C: usize>(a: &[[f64; C]], b: &[[f64; 3]], c: usize) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a[c.min(C - 1)] - b[c]).abs()).sum()
}
