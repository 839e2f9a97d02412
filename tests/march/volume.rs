//! Rows of volumes against their definitions.

use std::sync::Arc;

use glam::{DAffine3, DVec3};
use unscatter::march::{InScattering, LitVolume, Quantity, VolumeTransport, VolumeTraversal};
use unscatter::scene::{Interpolation, Quadrature, Ray, Samples, Volume, VoxelGrid};

use crate::tolerances::{VOLUME_CONSTANT, VOLUME_CUBIC, VOLUME_LIGHT};
use crate::volumes::*;

/// What a row may differ by, as a part of its sum.
fn tolerance(basis: Interpolation) -> f64 {
    match basis {
        Interpolation::Nearest => VOLUME_CONSTANT,
        Interpolation::Trilinear => VOLUME_CUBIC,
    }
}

/// The largest Σ |w − truth| of the rows, as a part of their sums.
fn worst<const C: usize>(traversal: &VolumeTraversal, truth: &VolumeTransport) -> f64 {
    let part = &traversal.parts()[0];
    let error = |row: usize| {
        let (ray, length) = (traversal.rays().ray(row), traversal.rays().length(row));
        let (exact, truth) =
            (dense::<C>(traversal, row), brute::row(truth, &ray, length, &part.quantity, &part.grid));
        let relative = |c: usize| {
            let sum: f64 = truth.iter().map(|weight| weight[c]).sum();
            difference(&exact, &truth, c) / sum.max(1e-12)
        };
        (0..3).map(relative).fold(0.0, f64::max)
    };
    (0..traversal.rays().len()).map(error).fold(0.0, f64::max)
}

fn against_definitions<const C: usize>(basis: Interpolation, seed: u64, most: f64) {
    let mut n = numbers(seed);
    let medium = grid(&mut n, 12);
    let density = values(&mut n, medium, C, most);
    // One is cached where the medium is, as a job does it; the other lies elsewhere.
    let mut lit =
        |grid: VoxelGrid, along| LitVolume { along, radiance: Arc::new(values(&mut n, grid, C, 2.0)) };
    let here = lit(medium, None);
    let elsewhere = grid(&mut numbers(seed + 70), 7);
    let light = Arc::new(InScattering::new(vec![here, lit(elsewhere, Some((DVec3::X, -0.3)))]));
    let transport = transport(density, basis);
    let rays = random_rays(&mut n, 9);
    for grid in [medium, grid(&mut n, 9)] {
        for (quantity, tolerance) in [
            (Quantity::Emission, tolerance(basis)),
            (Quantity::Albedo(light.clone()), tolerance(basis) + VOLUME_LIGHT),
            (Quantity::Extinction, VOLUME_CONSTANT),
        ] {
            let parts = vec![part(quantity, grid, basis)];
            let traversal = VolumeTraversal::new(transport.clone(), rows_along(&rays), parts);
            let error = worst::<C>(&traversal, &transport);
            let quantity = &traversal.parts()[0].quantity;
            assert!(error <= tolerance, "{basis:?} {seed} {most:e}: {error:e} of {quantity:?}");
        }
    }
}

#[test]
fn rows_are_the_integrals_of_their_definitions() {
    for basis in BOTH {
        for (seed, most) in [(1, 1e-8), (2, 1.0), (3, 1.0), (4, 30.0), (5, 1e3)] {
            against_definitions::<1>(basis, seed, most);
            against_definitions::<3>(basis, seed + 10, most);
        }
    }
}

#[test]
fn unknowns_may_have_another_basis_than_the_medium() {
    for (seed, [between, basis]) in [(1, BOTH), (2, [BOTH[1], BOTH[0]]), (3, BOTH), (4, [BOTH[1], BOTH[0]])] {
        let mut n = numbers(seed);
        let medium = grid(&mut n, 9);
        let density = values(&mut n, medium, 1, 3.0);
        let transport = VolumeTransport { basis, ..transport(density, between) };
        let rays = rows_along(&random_rays(&mut n, 9));
        let parts = vec![part(Quantity::Emission, medium, basis)];
        let error = worst::<1>(&VolumeTraversal::new(transport.clone(), rays, parts), &transport);
        assert!(error <= VOLUME_CUBIC, "{between:?}, {basis:?}: {error:e}");
    }
}

#[test]
fn the_comparison_notices_one_voxel_another_basis_and_a_shift() {
    for basis in BOTH {
        let mut n = numbers(7);
        let medium = VoxelGrid::over_cube([6, 5, 4], placement(&mut n)).unwrap();
        let density = Volume::constant(medium, [1.5; 3]).unwrap();
        let mut rays = random_rays(&mut n, 9);
        let origin = DVec3::new(3.0, -2.0, 2.5);
        let direction = (medium.centre([3, 2, 2]) - origin).normalize();
        rays.push((Ray { origin, direction }, f64::INFINITY));
        let rays = rows_along(&rays);
        let parts = vec![part(Quantity::Emission, medium, basis)];
        let right = transport(density.clone(), basis);
        let traversal = VolumeTraversal::new(right.clone(), rays, parts);
        assert!(worst::<1>(&traversal, &right) <= tolerance(basis));
        let mut samples = vec![1.5; medium.len()];
        samples[medium.index([3, 2, 2])] *= 1.001;
        let voxel = transport(Volume::new(medium, 1, Samples::F32(samples)).unwrap(), basis);
        assert!(worst::<1>(&traversal, &voxel) > 2.0 * tolerance(basis));
        let other = if basis == Interpolation::Nearest { BOTH[1] } else { BOTH[0] };
        let other = VolumeTransport { basis: other, ..right };
        assert!(worst::<1>(&traversal, &other) > 1e-2);
        let moved = DAffine3::from_translation(DVec3::splat(1e-3)) * *medium.world_from_grid();
        let shifted = density.placed(VoxelGrid::new(medium.size(), moved).unwrap()).unwrap();
        assert!(worst::<1>(&traversal, &transport(shifted, basis)) > 2.0 * tolerance(basis));
    }
}

#[test]
fn rows_have_weights_where_a_weight_is_not_zero() {
    let mut counts = [0; 2];
    for (seed, basis) in (1..20).flat_map(|seed| BOTH.map(|basis| (seed, basis))) {
        let mut n = numbers(seed + 200);
        let medium = grid(&mut n, 5);
        let density = values(&mut n, medium, 1, 2.0);
        let lit = values(&mut n, medium, 3, 1.0);
        let light = InScattering::new(vec![LitVolume { along: None, radiance: Arc::new(lit) }]);
        let rays = rows_along(&random_rays(&mut n, 40));
        for quantity in [Quantity::Emission, Quantity::Albedo(light.into()), Quantity::Extinction] {
            let parts = vec![part(quantity, medium, basis)];
            let traversal = VolumeTraversal::new(transport(density.clone(), basis), rays.clone(), parts);
            for row in 0..40 {
                let has = dense::<3>(&traversal, row).iter().any(|weight| *weight != [0.0; 3]);
                assert_eq!(traversal.has_weights(row), has, "{basis:?} {seed} {row}");
                counts[usize::from(has)] += 1;
            }
        }
    }
    assert!(counts.iter().all(|&count| count > 300), "{counts:?}");
}

#[test]
fn row_sums_are_what_is_extinguished_and_the_length_inside() {
    for (seed, basis) in (1..9).flat_map(|seed| BOTH.map(|basis| (seed, basis))) {
        let mut n = numbers(seed + 100);
        let medium = grid(&mut n, 20);
        let density = values(&mut n, medium, 3, 2.0);
        let parts = [Quantity::Emission, Quantity::Extinction].map(|q| part(q, medium, basis));
        let rays = rows_along(&random_rays(&mut n, 40));
        let traversal = VolumeTraversal::new(transport(density.clone(), basis), rays, parts.into());
        for row in 0..40 {
            let weights = dense::<3>(&traversal, row);
            let (emission, extinction) = weights.split_at(medium.len());
            let sum = |weights: &[[f64; 3]], c: usize| weights.iter().map(|w| w[c]).sum::<f64>();
            let (ray, length) = (traversal.rays().ray(row), traversal.rays().length(row));
            let tau = brute::optical_depth(&density, basis, &ray, length);
            let depth = traversal.transport().density.optical_depth(ray.origin, ray.direction, length);
            let transmittance = traversal.transmittance(row);
            for c in 0..3 {
                assert!((depth[c] - tau[c]).abs() <= VOLUME_CONSTANT * tau[c], "{row}: {depth:?}, {tau:?}");
                assert!((transmittance[c] - (-tau[c]).exp()).abs() <= VOLUME_CONSTANT);
                let gone = -(-tau[c]).exp_m1();
                assert!((sum(emission, c) - gone).abs() <= tolerance(basis) * gone, "{basis:?} {row}");
                let inside = brute::length_inside(&medium, &ray, length);
                assert!((sum(extinction, c) - inside).abs() <= VOLUME_CONSTANT, "{basis:?} {row}");
            }
        }
    }
}

#[test]
fn rays_in_faces_along_edges_and_through_corners_lose_nothing() {
    let grid = VoxelGrid::new([4; 3], DAffine3::IDENTITY).unwrap();
    let ray = |origin: [f64; 3], direction: [f64; 3]| {
        let direction = DVec3::from_array(direction).normalize();
        (Ray { origin: DVec3::from_array(origin), direction }, f64::INFINITY)
    };
    let rays = [
        ray([-1.0, 2.0, 1.5], [1.0, 0.0, 0.0]),
        ray([5.0, 2.0, 3.0], [-1.0, 0.0, 0.0]),
        ray([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
        ray([2.0, 2.0, 2.0], [0.0, -1.0, 0.0]),
        ray([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]),
        ray([5.0, 5.0, 5.0], [-1.0, -1.0, -1.0]),
        ray([0.5, 0.5, 1.5], [1.0, 1.0, 0.0]),
        ray([4.0, 0.0, 2.0], [-1.0, 1.0, 0.0]),
        // In the far face: outside.
        ray([-1.0, 4.0, 2.0], [1.0, 0.0, 0.0]),
    ];
    for basis in BOTH {
        let density = values(&mut numbers(3), grid, 1, 2.0);
        for quantity in [Quantity::Emission, Quantity::Extinction] {
            let transport = transport(density.clone(), basis);
            let traversal =
                VolumeTraversal::new(transport.clone(), rows_along(&rays), vec![part(quantity, grid, basis)]);
            assert!(dense::<1>(&traversal, 8).iter().all(|weight| weight[0] == 0.0));
            for row in 0..8 {
                let length: f64 = brute::length_inside(&grid, &traversal.rays().ray(row), f64::INFINITY);
                assert!(length > 1.9);
                let sum: f64 = dense::<1>(&traversal, row).iter().map(|weight| weight[0]).sum();
                let truth = match traversal.parts()[0].quantity {
                    Quantity::Extinction => length,
                    _ => 1.0 - traversal.transmittance(row)[0],
                };
                assert!((sum - truth).abs() <= tolerance(basis), "{basis:?} {row}: {sum} is not {truth}");
                if row < 4 || basis == Interpolation::Trilinear {
                    assert!(
                        worst::<1>(&traversal.along(rows_along(&rays[row..=row])), &transport)
                            <= VOLUME_CUBIC
                    );
                }
            }
        }
    }
}

#[test]
fn no_medium_a_black_one_and_a_long_one_are_integrated() {
    for basis in BOTH {
        for (size, sigma) in
            [([3, 2, 1], 0.0), ([3, 2, 1], 1e-30), ([3, 2, 1], 1e5), ([4096, 1, 1], 2.0), ([1, 1, 4096], 1e3)]
        {
            let grid = VoxelGrid::over_cube(size, DAffine3::from_scale(DVec3::splat(2.0))).unwrap();
            let density = Volume::constant(grid, [sigma; 3]).unwrap();
            let parts = [Quantity::Emission, Quantity::Extinction].map(|q| part(q, grid, basis));
            let rays = [DVec3::ONE, DVec3::X, DVec3::new(1.0, 1e-17, -1e-300), DVec3::Z].map(|direction| {
                (Ray { origin: DVec3::splat(0.1), direction: direction.normalize() }, f64::INFINITY)
            });
            let traversal = VolumeTraversal::new(transport(density, basis), rows_along(&rays), parts.into());
            for row in 0..rays.len() {
                let length = brute::length_inside(&grid, &traversal.rays().ray(row), f64::INFINITY);
                let weights = dense::<1>(&traversal, row);
                let (emission, extinction) = weights.split_at(grid.len());
                let sum = |weights: &[[f64; 1]]| weights.iter().map(|w| w[0]).sum::<f64>();
                let truth = -(-f64::from(sigma) * length).exp_m1();
                let emission = sum(emission);
                assert!((emission - truth).abs() <= 1e-8 * truth, "{basis:?} {size:?} {sigma}: {emission}");
                assert!((sum(extinction) - length).abs() <= VOLUME_CONSTANT, "{basis:?} {size:?}");
            }
        }
    }
}

#[test]
fn the_march_converges_to_the_exact_weights() {
    // Where v is smooth enough for its midpoints to be good to second order; jumps of nearest make it first order.
    for (basis, least) in [(Interpolation::Nearest, 5.0), (Interpolation::Trilinear, 40.0)] {
        let error = |steps: u32| -> f64 {
            let mut n = numbers(5);
            let medium = VoxelGrid::over_cube([6, 7, 5], placement(&mut n)).unwrap();
            let mut transport = transport(values(&mut n, medium, 1, 2.0), basis);
            let rays = rows_along(&random_rays(&mut n, 60));
            let parts = [Quantity::Emission, Quantity::Extinction].map(|q| part(q, medium, basis)).to_vec();
            let exact = VolumeTraversal::new(transport.clone(), rays.clone(), parts.clone());
            transport.quadrature = Quadrature::March { steps };
            let marched = VolumeTraversal::new(transport, rays, parts);
            let of_row = |row: usize| {
                let exact: Vec<[f64; 3]> = dense::<1>(&exact, row).into_iter().map(|[w]| [w; 3]).collect();
                difference(&dense::<1>(&marched, row), &exact, 0)
            };
            (0..60).map(of_row).sum()
        };
        let gain = error(250) / error(2000);
        assert!(
            gain > least && gain < 3.0 * least,
            "{basis:?}: eight times the steps, {gain} times the accuracy"
        );
    }
}

#[test]
fn light_that_is_looked_for_counts_as_light_that_is_known() {
    for basis in BOTH {
        for (seed, channels) in [(1, 1), (2, 3), (3, 1), (4, 3)] {
            let mut n = numbers(40 + seed);
            let (medium, albedos, lit) = (grid(&mut n, 12), grid(&mut n, 7), grid(&mut n, 6));
            let transport = transport(values(&mut n, medium, channels, 4.0), basis);
            let rays = rows_along(&random_rays(&mut n, 40));
            // Albedo and light have three channels of their own.
            let albedo = values(&mut n, albedos, 3, 1.0);
            let light = values(&mut n, lit, 3, 5.0);
            let known = Quantity::Albedo(Arc::new(InScattering::new(vec![LitVolume {
                along: None,
                radiance: Arc::new(light.clone()),
            }])));
            let known =
                VolumeTraversal::new(transport.clone(), rays.clone(), vec![part(known, albedos, basis)]);
            let sought = part(Quantity::InScattered(Arc::new(albedo.clone())), lit, basis);
            let sought = VolumeTraversal::new(transport, rays.clone(), vec![sought]);
            let shown = |traversal: &VolumeTraversal, values: &Volume, row: usize| {
                let weights = dense::<3>(traversal, row);
                weights.iter().enumerate().fold([0.0; 3], |sum: [f64; 3], (index, weight)| {
                    std::array::from_fn(|c| sum[c] + weight[c] * f64::from(values.color(index)[c]))
                })
            };
            for row in 0..rays.len() {
                let (a, b) = (shown(&known, &albedo, row), shown(&sought, &light, row));
                let scale = a.iter().copied().fold(1e-30, f64::max);
                let error = (0..3).map(|c| (a[c] - b[c]).abs() / scale).fold(0.0, f64::max);
                assert!(
                    error <= VOLUME_LIGHT,
                    "{basis:?} {seed}: row {row} differs by {error:e}: {a:?} {b:?}"
                );
            }
        }
    }
}
