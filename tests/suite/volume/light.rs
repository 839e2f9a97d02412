//! Light that is cached at voxels against its definition.

use unscatter::cpu::{Beam, light_volume, near_medium};
use unscatter::scene::{Environment, Mesh, Primitive};
use unscatter::visibility::Geometry;

use super::*;
use crate::tolerances::VOLUME_LIGHT;

fn open() -> Geometry {
    Geometry::new(Mesh::default()).unwrap()
}

/// Σ L e^{−τ} at a centre, the optical depths by brute force.
fn truth(density: &Volume, between: Interpolation, centre: DVec3, beams: &[Beam]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for beam in beams {
        let ray = Ray { origin: centre, direction: beam.towards };
        let tau = brute::optical_depth(density, between, &ray, f64::INFINITY);
        (0..3).for_each(|c| sum[c] += f64::from(beam.radiance[c]) * (-tau[c]).exp());
    }
    sum
}

#[test]
fn it_is_attenuated_on_its_way_and_asked_for_only_near_the_medium() {
    for (seed, (between, channels)) in
        [(BOTH[0], 1), (BOTH[1], 1), (BOTH[0], 3), (BOTH[1], 3)].into_iter().enumerate()
    {
        let mut n = numbers(seed as u64 + 31);
        let (medium, lattice) = (grid(&mut n, 12), grid(&mut n, 7));
        let volume = values(&mut n, medium, channels, 2.0);
        let density = Density::new(Arc::new(volume.clone()), between);
        let beams: Vec<Beam> = (1..6)
            .map(|k| Beam {
                towards: n.direction(),
                radiance: [k as f32, if channels == 1 { k as f32 } else { 1.0 }, k as f32],
            })
            .collect();
        let lit = light_volume(&density, &open(), lattice, &beams).unwrap();
        assert_eq!(lit.channels(), channels);
        let near = near_medium(&density, &lattice);
        for index in 0..lattice.len() {
            let voxel = lattice.voxel(index);
            let (got, truth) = (lit.color(index), truth(&volume, between, lattice.centre(voxel), &beams));
            for c in 0..3 {
                let truth = if near.contains(voxel) { truth[c] } else { 0.0 };
                assert!((f64::from(got[c]) - truth).abs() <= VOLUME_LIGHT * truth, "{between:?} {voxel:?}");
            }
        }
        // One beam from elsewhere would be noticed.
        let turned: Vec<Beam> = beams
            .iter()
            .map(|beam| Beam { towards: DVec3::new(beam.towards.z, beam.towards.x, beam.towards.y), ..*beam })
            .collect();
        let elsewhere =
            light_volume(&density, &open(), lattice, &[&beams[1..], &turned[..1]].concat()).unwrap();
        let off = |index| {
            let (elsewhere, lit) = (elsewhere.color(index)[0], lit.color(index)[0]);
            f64::from((elsewhere - lit).abs()) > 100.0 * VOLUME_LIGHT * f64::from(lit)
        };
        assert!((0..lattice.len()).any(off));
        // Whatever scatters asks for values that are there.
        for _ in 0..3000 {
            let p = point(&mut n, 1.5);
            if brute::sigma_t(&volume, between, p) == [0.0; 3] {
                continue;
            }
            let q = lattice.grid_from_world().transform_point3(p) - 0.5;
            for corner in 0..8 {
                let taken: [usize; 3] = std::array::from_fn(|axis| {
                    let last = lattice.size()[axis] as f64 - 1.0;
                    let low = q[axis].clamp(0.0, last).floor();
                    if corner >> axis & 1 == 1 && q[axis] > low {
                        (low + 1.0).min(last) as usize
                    } else {
                        low as usize
                    }
                });
                assert!(near.contains(taken), "{taken:?} is read at {p}");
            }
        }
    }
}

#[test]
fn a_surface_shadows_what_is_behind_it_and_nothing_else() {
    let cube = DAffine3::from_scale(DVec3::splat(2.0)) * DAffine3::from_translation(DVec3::splat(-0.5));
    let grid = VoxelGrid::over_cube([8; 3], cube).unwrap();
    let volume = Volume::constant(grid, [0.4; 3]).unwrap();
    let density = Density::new(Arc::new(volume.clone()), Interpolation::Nearest);
    let roof =
        Primitive::Plane { centre: DVec3::new(-1.0, 0.3, 0.0), sides: [DVec3::X * 2.0, DVec3::Z * 4.0] };
    let geometry = Geometry::new(roof.mesh([0.5; 3]).unwrap()).unwrap();
    let beams = [Beam { towards: DVec3::Y, radiance: [2.0; 3] }];
    let lit = light_volume(&density, &geometry, grid, &beams).unwrap();
    for index in 0..grid.len() {
        let centre = grid.centre(grid.voxel(index));
        let truth = truth(&volume, Interpolation::Nearest, centre, &beams)[0];
        let expected = if centre.x < 0.0 && centre.y < 0.3 { 0.0 } else { truth };
        assert!((f64::from(lit.color(index)[0]) - expected).abs() <= VOLUME_LIGHT * truth);
    }
}

#[test]
fn an_even_sky_gives_a_clear_medium_its_own_radiance_and_a_ball_the_mean_of_its_shadows() {
    let sky = Environment::constant([1.0, 2.0, 0.5], 200).unwrap();
    let beams: Vec<Beam> =
        sky.beams().into_iter().map(|(towards, radiance)| Beam { towards, radiance }).collect();
    let cube = DAffine3::from_scale(DVec3::splat(2.0)) * DAffine3::from_translation(DVec3::splat(-0.5));
    let grid = VoxelGrid::over_cube([41; 3], cube).unwrap();
    let ball = |sigma: f64| {
        let inside = |index| grid.centre(grid.voxel(index)).length() < 0.8;
        let samples = (0..grid.len()).map(|index| if inside(index) { sigma as f32 } else { 0.0 }).collect();
        Density::new(Arc::new(Volume::new(grid, 1, Samples::F32(samples)).unwrap()), Interpolation::Nearest)
    };
    let middle = VoxelGrid::over_cube([1; 3], cube).unwrap();
    for sigma in [1e-6, 1.5] {
        let lit = light_volume(&ball(sigma), &open(), middle, &beams).unwrap().color(0);
        for (lit, radiance) in lit.into_iter().zip([1.0, 2.0, 0.5]) {
            let truth = 4.0 * std::f64::consts::PI * radiance * (-0.8 * sigma).exp();
            // The ball is one of voxels: its radius is off by a part of one of 5 cm, and less on average.
            assert!((f64::from(lit) / truth - 1.0).abs() <= 1e-5 + 0.01 * sigma, "{lit} is not {truth}");
        }
    }
}
