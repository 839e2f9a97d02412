//! How radiance changes with extinction, and the problem of a step of Gauss–Newton.

use unscatter::march::{LinearizedTraversal, SourceFunction, channel};
use unscatter::problem::{Problem, VolumeProblem};
use unscatter::scene::{DirectionalLight, Environment, Find, Rgb, Strategy, VolumeMedium, look_at};
use unscatter::sparse::ExplicitMatrix;

use super::scene::{colors, picture_error, pictures, problem, solved, wanted};
use super::*;
use crate::tolerances::{AGAINST_EXPLICIT, REFINEMENT_SLOPE, VOLUME_CONSTANT};
use unscatter::operator::{CpuVector, FromHost, LinearOperator, adjoint_test};

/// Extinction without holes: its differences are taken to both sides.
fn dense_values(n: &mut Numbers, grid: VoxelGrid, channels: usize) -> Volume {
    let samples = (0..grid.len() * channels).map(|_| n.uniform(0.2, 2.0) as f32).collect();
    Volume::new(grid, channels, Samples::F32(samples)).unwrap()
}

struct Case {
    extinction: Volume,
    basis: Interpolation,
    source: SourceFunction,
    rays: Vec<(Ray, f64)>,
    behind: Vec<Rgb>,
}

impl Case {
    /// Emission on a grid of its own, and light from two sides, in a medium with holes or without.
    fn new(seed: u64, channels: usize, basis: Interpolation) -> Self {
        let mut n = numbers(seed);
        let lattice = VoxelGrid::over_cube([7, 6, 9], placement(&mut n)).unwrap();
        let finer = VoxelGrid::over_cube([10, 4, 6], lattice.world_from_cube()).unwrap();
        let extinction = match seed % 2 {
            0 => dense_values(&mut n, lattice, channels),
            _ => values(&mut n, lattice, channels, 2.0),
        };
        let source = match seed % 3 {
            0 => SourceFunction::Constant([0.7, 0.2, 0.4]),
            _ => SourceFunction::Medium {
                emission: Arc::new(values(&mut n, finer, 3, 1.5)),
                albedo: Arc::new(values(&mut n, lattice, 3, 1.0)),
                light: Some(random_light(&mut n, [lattice, finer], 3)),
            },
        };
        let rays = random_rays(&mut n, 18);
        let behind = rays.iter().map(|_| std::array::from_fn(|_| n.uniform(0.0, 1.5) as f32)).collect();
        Self { extinction, basis, source, rays, behind }
    }

    fn traversal(&self, extinction: Volume) -> LinearizedTraversal {
        let grid = *extinction.grid();
        let parts = vec![part(Quantity::Extinction, grid, self.basis)];
        let medium = VolumeTraversal::new(transport(extinction, self.basis), rows_along(&self.rays), parts);
        LinearizedTraversal::new(medium, self.source.clone(), self.behind.clone(), Vec::new())
    }

    /// The same medium with one voxel changed by so much.
    fn changed(&self, index: usize, by: f32) -> LinearizedTraversal {
        let (grid, channels) = (*self.extinction.grid(), self.extinction.channels());
        let mut samples: Vec<f32> = self.extinction.samples().iter().collect();
        (0..channels).for_each(|c| samples[index * channels + c] += by);
        self.traversal(Volume::new(grid, channels, Samples::F32(samples)).unwrap())
    }
}

/// The largest difference between weights and forward differences of third order, as a part of the row's largest weight.
fn slope_error(case: &Case, rows: &LinearizedTraversal) -> f64 {
    const STEP: f32 = 1.0 / 64.0;
    let voxels = rows.medium().parts()[0].voxels().indices();
    let mut dense = vec![vec![[0.0; 3]; voxels.len()]; case.rays.len()];
    for (row, dense) in dense.iter_mut().enumerate() {
        Traversal::<f64, 3>::walk(rows, row, &mut |element, weight| {
            assert_eq!(dense[element], [0.0; 3], "element {element} is visited twice");
            dense[element] = weight;
        });
    }
    let mut worst: f64 = 0.0;
    for element in (0..voxels.len()).step_by(29) {
        let index = voxels[element] as usize;
        let at = [0.0, 1.0, 2.0, 3.0].map(|steps| case.changed(index, steps * STEP));
        // What is rounded to f32 is the step that was taken.
        let base = case.extinction.color(index)[0];
        let step = (f64::from(base + 3.0 * STEP) - f64::from(base)) / 3.0;
        for (row, dense) in dense.iter().enumerate() {
            let of = |k: usize| at[k].radiance::<3>(row);
            let [f0, f1, f2, f3] = [0, 1, 2, 3].map(of);
            let most = dense.iter().flatten().fold(0.0, |most: f64, w| most.max(w.abs()));
            for c in 0..3 {
                let slope = (-11.0 * f0[c] + 18.0 * f1[c] - 9.0 * f2[c] + 2.0 * f3[c]) / (6.0 * step);
                worst = worst.max((dense[element][c] - slope).abs() / most.max(1e-3));
            }
        }
    }
    worst
}

#[test]
fn weights_are_how_radiance_changes() {
    for basis in BOTH {
        for seed in 0..6 {
            for channels in [1, 3] {
                let case = Case::new(seed, channels, basis);
                let error = slope_error(&case, &case.traversal(case.extinction.clone()));
                assert!(error <= REFINEMENT_SLOPE, "{basis:?}, seed {seed}, {channels}: {error:e}");
            }
        }
    }
}

#[test]
fn weights_of_another_medium_are_not() {
    for basis in BOTH {
        let case = Case::new(2, 1, basis);
        let middle = case.extinction.grid().index([3, 3, 4]);
        assert!(slope_error(&case, &case.changed(middle, 0.25)) > 10.0 * REFINEMENT_SLOPE);
    }
}

#[test]
fn a_slab_has_the_slope_of_its_closed_form() {
    for (sigma_t, source, behind) in
        [(0.4f32, 0.9f32, 0.2f32), (3.0, 0.1, 1.5), (40.0, 0.5, 0.5), (1e-4, 0.3, 2.0)]
    {
        for basis in BOTH {
            let cube =
                DAffine3::from_scale(DVec3::splat(2.0)) * DAffine3::from_translation(DVec3::splat(-0.5));
            let grid = VoxelGrid::over_cube([5, 6, 7], cube).unwrap();
            let rays = [(Ray { origin: DVec3::new(0.1, 0.2, 5.0), direction: DVec3::NEG_Z }, f64::INFINITY)];
            let parts = vec![part(Quantity::Extinction, grid, basis)];
            let medium = Volume::constant(grid, [sigma_t; 3]).unwrap();
            let medium = VolumeTraversal::new(transport(medium, basis), rows_along(&rays), parts);
            let rows = LinearizedTraversal::new(
                medium,
                SourceFunction::Constant([source; 3]),
                vec![[behind; 3]],
                vec![],
            );
            let mut sum = 0.0;
            Traversal::<f64, 1>::walk(&rows, 0, &mut |_, [weight]| sum += weight);
            let [sigma_t, source, behind] = [sigma_t, source, behind].map(f64::from);
            let slope = 2.0 * (-2.0 * sigma_t).exp() * (source - behind);
            assert!((sum - slope).abs() <= 1e-8 * (source + behind), "{basis:?}: {sum} and {slope}");
            let radiance = source + (-2.0 * sigma_t).exp() * (behind - source);
            assert!((rows.radiance::<1>(0)[0] - radiance).abs() <= 1e-8 * (source + behind));
        }
    }
}

fn scattering_scene(basis: Interpolation, depth: f32) -> unscatter::scene::VolumeScene {
    let mut n = numbers(3);
    let lattice = VoxelGrid::over_cube([8, 8, 8], placement(&mut n)).unwrap();
    let dense = dense_values(&mut n, lattice, 1).map(|value| value * depth).unwrap();
    let medium = VolumeMedium {
        extinction: Arc::new(dense),
        albedo: Arc::new(values(&mut n, lattice, 3, 0.9)),
        emission: Arc::new(values(&mut n, lattice, 3, 0.5)),
        g: 0.0,
        interpolation: basis,
        refraction: None,
    };
    let eye = |k: usize| {
        let eye = [[3.0, 2.0, 0.4], [-2.0, 1.0, 3.0], [0.3, 3.0, -2.0], [-1.0, 0.2, -3.0]][k];
        let eye = look_at(DVec3::from_array(eye), DVec3::ZERO, DVec3::new(0.1, 0.9, 0.3)).unwrap();
        Camera::new(eye, 50.0, FovAxis::X, [16, 14]).unwrap()
    };
    let sky = Environment::constant([0.1, 0.2, 0.4], 16).unwrap();
    let mut scene = scene::scene(medium, sky, (0..4).map(eye).collect());
    scene.lights.push(DirectionalLight::new(DVec3::new(0.3, -1.0, -0.4), [1.0, 0.8, 0.5]).unwrap());
    scene.background = Some([1.0, 0.9, 0.8]);
    scene.extinction.is_scattering = true;
    scene.stages = vec![Find::Refinement];
    scene
}

/// Targets of another medium, so that something is left to do.
fn off_by_a_tenth(scene: &unscatter::scene::VolumeScene) -> VolumeProblem {
    let mut truth = scene.medium.clone();
    truth.extinction = Arc::new(truth.extinction.map(|value| 1.1 * value).unwrap());
    problem(scene, &wanted(&pictures(scene, &truth, Find::Refinement)), Find::Refinement)
}

#[test]
fn kept_and_walked_rows_are_the_explicit_matrix_and_have_its_adjoint() {
    for basis in BOTH {
        for is_grey in [true, false] {
            let mut scene = scattering_scene(basis, 1.0);
            scene.extinction.is_grey = is_grey;
            let problem = off_by_a_tenth(&scene);
            assert_eq!(problem.is_grey(), is_grey);
            let explicit = match is_grey {
                true => ExplicitMatrix::new::<1>(&problem.traversal, u64::MAX).unwrap(),
                false => ExplicitMatrix::new::<3>(&problem.traversal, u64::MAX).unwrap(),
            };
            let x = CpuVector(problem.start.iter().map(|x| x.map(f64::from)).collect::<Vec<_>>());
            let mut y = explicit.range();
            explicit.apply(&x, &mut y).unwrap();
            let most = y.0.iter().flatten().fold(0.0, |most: f64, y| most.max(y.abs()));
            for strategy in [Strategy::Assembled, Strategy::MatrixFree] {
                let operator = problem.on_cpu(strategy, u64::MAX).unwrap();
                let shown = operator.shown(&problem.start).unwrap();
                for (shown, y) in shown.iter().zip(&y.0) {
                    (0..3).for_each(|c| {
                        assert!((f64::from(shown[c]) - y[c]).abs() <= AGAINST_EXPLICIT * most);
                    });
                }
                assert!(adjoint_test(&operator, 2, 3).unwrap().error <= 1e-6);
            }
        }
    }
}

#[test]
fn one_extinction_for_all_channels_is_three_rows_a_pixel() {
    let scene = scattering_scene(Interpolation::Nearest, 1.0);
    let problem = off_by_a_tenth(&scene);
    let mut colored = scattering_scene(Interpolation::Nearest, 1.0);
    colored.extinction.is_grey = false;
    let colored = off_by_a_tenth(&colored);
    assert_eq!(problem.targets.len(), 3 * colored.targets.len());
    for row in (0..colored.targets.len()).step_by(41) {
        for c in 0..3 {
            let mut mine = vec![0.0; problem.start.len()];
            Traversal::<f64, 1>::walk(&problem.traversal, 3 * row + c, &mut |element, [weight]| {
                mine[element] = weight;
            });
            Traversal::<f64, 3>::walk(&colored.traversal, row, &mut |element, weight| {
                assert!((channel(&weight, c) - mine[element]).abs() <= VOLUME_CONSTANT);
            });
            assert_eq!(problem.targets[3 * row + c][0], colored.targets[row][c]);
        }
    }
    let (solved, medium) = solved(&scene, &problem);
    assert!(solved.x.iter().all(|x| x[0] == x[1] && x[1] == x[2]), "three channels of one number");
    assert_eq!(colors(&medium.extinction).len(), 512);
}

#[test]
fn steps_lead_to_the_medium_behind_the_pictures() {
    for basis in BOTH {
        let mut scene = scattering_scene(basis, 1.0);
        scene.solve.iterations = 150;
        let truth = scene.medium.clone();
        let targets = pictures(&scene, &truth, Find::Refinement);
        let start = truth.extinction.map(|value| 0.7 * value + 0.2).unwrap();
        scene.medium.extinction = Arc::new(start);
        let error = |scene: &unscatter::scene::VolumeScene| {
            picture_error(&pictures(scene, &scene.medium, Find::Refinement), &targets)
        };
        let at_start = error(&scene);
        let mut errors = vec![at_start];
        for _ in 0..6 {
            let step = problem(&scene, &wanted(&targets), Find::Refinement);
            scene.medium = solved(&scene, &step).1;
            errors.push(error(&scene));
        }
        assert!(errors[6] <= 2e-2 * at_start, "{basis:?}: {errors:?}");
    }
}
