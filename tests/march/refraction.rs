//! Bent rays against the closed form of a linear index of refraction.
//!
//! Where n = n₀ + a y and a ray starts along x at y = 0, n cos θ is kept (Snell), so that dy/dx = √(n²/n₀² − 1) and
//! n = n₀ cosh(a x / n₀): a catenary, of length s = n₀/a sinh(a x / n₀).

use std::sync::Arc;

use glam::{DAffine3, DMat3, DQuat, DVec3};
use unscatter::march::{Quantity, Refraction, VolumeTraversal};
use unscatter::scene::{Interpolation, Ray, Samples, Volume, VoxelGrid};

use crate::volumes::*;

const INDEX: f64 = 1.2;
const SLOPE: f64 = 0.4;

/// The point of the catenary at a length.
fn catenary(s: f64) -> DVec3 {
    let x = INDEX / SLOPE * (SLOPE * s / INDEX).asinh();
    DVec3::new(x, INDEX / SLOPE * ((SLOPE * x / INDEX).cosh() - 1.0), 0.0)
}

/// Everything is turned and moved by this, so that no axis is special.
fn world() -> DAffine3 {
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.8);
    DAffine3::from_rotation_translation(turn, DVec3::new(0.3, -0.2, 0.5))
}

/// n over a box around the path, which starts well inside it.
fn index() -> Arc<Volume> {
    let cube = DAffine3 {
        matrix3: DMat3::from_diagonal(DVec3::new(6.0, 5.0, 4.0)),
        translation: DVec3::new(-1.0, -1.5, -2.0),
    };
    let grid = VoxelGrid::over_cube([12, 20, 8], world() * cube).unwrap();
    let height = |index| world().inverse().transform_point3(grid.centre(grid.voxel(index))).y;
    let samples = (0..grid.len()).map(|index| (INDEX + SLOPE * height(index)) as f32).collect();
    Arc::new(Volume::new(grid, 1, Samples::F32(samples)).unwrap())
}

fn start() -> Ray {
    Ray { origin: world().translation, direction: world().transform_vector3(DVec3::X) }
}

/// The point of a bent ray at a length.
fn reached(refraction: &Refraction, length: f64) -> DVec3 {
    let mut end = DVec3::NAN;
    rows_along(&[(start(), f64::INFINITY)]).each_straight(0, Some(refraction), |ray, a, b| {
        if (a..=b).contains(&length) {
            end = ray.at(length);
        }
        b < length
    });
    world().inverse().transform_point3(end)
}

#[test]
fn a_constant_index_bends_nothing() {
    let mut n = numbers(4);
    let grid = grid(&mut n, 9);
    let index = Arc::new(Volume::constant(grid, [1.4; 3]).unwrap());
    let refraction = Refraction::new(index, 0.07).unwrap();
    let rays = random_rays(&mut n, 30);
    let rows = rows_along(&rays);
    for row in 0..30 {
        let (straight, mut last) = (rows.ray(row), 0.0);
        rows.each_straight(row, Some(&refraction), |ray, a, b| {
            assert!(a == last && b > a, "pieces follow each other");
            last = b;
            let t = if b.is_finite() { b } else { a + 1.0 };
            assert!((ray.at(t) - straight.at(t)).length() <= 1e-12);
            true
        });
        assert_eq!(last, f64::INFINITY);
    }
}

#[test]
fn the_path_in_a_linear_index_is_a_catenary_to_first_order_in_the_step() {
    let refraction = Refraction::new(index(), 1.0).unwrap();
    let errors: Vec<f64> = [0.04, 0.02, 0.01, 0.005]
        .map(|step| (reached(&refraction.with_step(step), 3.5) - catenary(3.5)).length())
        .to_vec();
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 1.0).abs() < 0.02, "order {order} of {errors:?}");
    }
    assert!(errors[3] < 3e-3, "{errors:?}");
    // A straight ray would be far away, and so would one that is bent the other way.
    assert!((catenary(3.5) - DVec3::X * 3.5).length() > 1.0);
}

#[test]
fn weights_along_bent_rays_are_those_of_the_path_to_first_order_in_the_step() {
    let mut n = numbers(12);
    let lattice = VoxelGrid::new([7, 8, 5], *index().grid().world_from_grid()).unwrap();
    let cube = index().grid().world_from_cube();
    let lattice = VoxelGrid::over_cube(lattice.size(), cube).unwrap();
    let density = values(&mut n, lattice, 1, 0.8);
    let basis = Interpolation::Trilinear;
    for quantity in [Quantity::Emission, Quantity::Extinction] {
        let parts = vec![part(quantity.clone(), lattice, basis)];
        let truth = along_catenary(&density, &quantity, 3.0);
        let error = |step: f64| {
            let mut transport = transport(density.clone(), basis);
            transport.refraction = Some(Arc::new(Refraction::new(index(), step).unwrap()));
            let rays = rows_along(&[(start(), 3.0)]);
            difference(&dense::<1>(&VolumeTraversal::new(transport, rays, parts.clone()), 0), &truth, 0)
        };
        let errors = [0.02, 0.01, 0.005].map(error);
        let sum: f64 = truth.iter().map(|w| w[0]).sum();
        for pair in errors.windows(2) {
            let order = (pair[0] / pair[1]).log2();
            assert!((order - 1.0).abs() < 0.1, "order {order} of {errors:?}");
        }
        assert!(errors[2] < 5e-3 * sum, "{errors:?} of {sum}");
    }
}

/// ∫ T σ v ds or ∫ v ds along the closed form, by many midpoints.
fn along_catenary(density: &Volume, quantity: &Quantity, length: f64) -> Vec<[f64; 3]> {
    let (grid, steps) = (density.grid(), 100_000);
    let step = length / f64::from(steps);
    let (mut sums, mut tau) = (vec![[0.0; 3]; grid.len()], 0.0);
    for j in 0..steps {
        let p = world().transform_point3(catenary((f64::from(j) + 0.5) * step));
        let sigma = brute::sigma_t(density, Interpolation::Trilinear, p)[0];
        let weight = match quantity {
            Quantity::Extinction => step,
            _ => (-tau - 0.5 * sigma * step).exp() * sigma * step,
        };
        tau += sigma * step;
        for (index, part) in brute::basis(grid, Interpolation::Trilinear, p) {
            (0..3).for_each(|c| sums[index][c] += weight * part);
        }
    }
    sums
}

#[test]
fn steps_and_indices_that_lead_nowhere_are_refused() {
    let grid = VoxelGrid::new([2; 3], DAffine3::IDENTITY).unwrap();
    let index = |n: f32| Arc::new(Volume::constant(grid, [n; 3]).unwrap());
    for step in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(Refraction::new(index(1.3), step).is_err());
    }
    assert!(Refraction::new(index(0.0), 0.1).is_err());
    assert!(Refraction::new(index(1.3), 0.1).is_ok());
}
