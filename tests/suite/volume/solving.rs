//! Media that are found again in pictures of themselves.

use nalgebra::{DMatrix, DVector};
use unscatter::march::Traversal;
use unscatter::problem::{Problem, VolumeProblem, VolumeState};
use unscatter::scene::{
    DirectionalLight, Environment, Find, Lens, SolverName, VolumeMedium, VolumeScene, look_at,
};
use unscatter::sparse::ExplicitMatrix;

use super::scene::{colors, picture_error, pictures, problem, relative, solved, wanted};
use super::*;
use crate::tolerances::{VOLUME_FOUND, VOLUME_PICTURES};

fn lattice() -> VoxelGrid {
    let cube = DAffine3::from_translation(DVec3::splat(-0.5));
    VoxelGrid::over_cube([6; 3], cube).unwrap()
}

fn between(n: &mut Numbers, low: f64, high: f64, channels: usize) -> Arc<Volume> {
    let samples = (0..lattice().len() * channels).map(|_| n.uniform(low, high) as f32).collect();
    Arc::new(Volume::new(lattice(), channels, Samples::F32(samples)).unwrap())
}

fn flat(value: f32) -> Arc<Volume> {
    Arc::new(Volume::constant(lattice(), [value; 3]).unwrap())
}

/// Six eyes around a cube of a metre; in the sun before black, or in the dark.
fn start(interpolation: Interpolation, is_lit: bool) -> VolumeScene {
    let medium = VolumeMedium {
        extinction: between(&mut numbers(1), 0.5, 1.5, 1),
        albedo: flat(0.5),
        emission: flat(0.0),
        g: 0.0,
        interpolation,
        refraction: None,
    };
    let eyes = [
        [3.0, 0.4, 0.2],
        [-0.3, 3.0, 0.5],
        [0.2, -0.5, 3.0],
        [2.0, 2.0, 1.5],
        [-2.0, 1.2, 2.1],
        [1.7, -2.0, -1.6],
    ];
    let camera = |eye: [f64; 3]| {
        let eye = look_at(DVec3::from_array(eye), DVec3::ZERO, DVec3::new(0.1, 0.9, 0.3)).unwrap();
        Camera::new(eye, 30.0, FovAxis::X, [16; 2]).unwrap()
    };
    let sky = Environment::constant([if is_lit { 0.3 } else { 0.0 }; 3], 24).unwrap();
    let mut scene = scene::scene(medium, sky, eyes.map(camera).to_vec());
    scene.background = Some([0.0; 3]);
    if is_lit {
        scene.lights.push(DirectionalLight::new(DVec3::new(0.3, -1.0, -0.4), [3.0, 2.0, 2.5]).unwrap());
    }
    scene
}

/// x₀ + A⁺ (b − A x₀) of each channel.
fn pseudo_inverse(problem: &VolumeProblem) -> Vec<[f32; 3]> {
    let explicit = match problem.is_grey() {
        true => ExplicitMatrix::new::<1>(&problem.traversal, u64::MAX).unwrap(),
        false => ExplicitMatrix::new::<3>(&problem.traversal, u64::MAX).unwrap(),
    };
    let (rows, columns) = (problem.targets.len(), Traversal::<f64, 1>::elements(&problem.traversal));
    let mut x = problem.start.clone();
    for c in 0..3 {
        let mut matrix = DMatrix::zeros(rows, columns);
        for (&weight, (row, element)) in explicit.channel(c) {
            matrix[(row, element)] = weight * f64::from(problem.weights[row][c]).sqrt();
        }
        let root = |row: usize| f64::from(problem.weights[row][c]).sqrt();
        let b = DVector::from_fn(rows, |row, _| f64::from(problem.targets[row][c]) * root(row));
        let start = DVector::from_fn(columns, |element, _| f64::from(problem.start[element][c]));
        // The normal matrix is small, and its own rounding is far below that of the pictures in f32.
        let normal = (matrix.transpose() * &matrix).symmetric_eigen();
        let pulled = normal.eigenvectors.transpose() * (matrix.transpose() * (b - &matrix * &start));
        let largest = normal.eigenvalues.max();
        let scaled =
            pulled.zip_map(&normal.eigenvalues, |p, e| if e > 1e-10 * largest { p / e } else { 0.0 });
        let found = start + normal.eigenvectors * scaled;
        (0..columns).for_each(|element| x[element][c] = found[element] as f32);
    }
    x
}

/// Solves for a property of a scene's medium from pictures of `truth`, and compares pictures and volume.
fn is_found(scene: &VolumeScene, truth: &VolumeMedium, find: Find, of: fn(&VolumeMedium) -> &Volume) {
    let pictures_of_truth = pictures(scene, truth, find);
    let problem = problem(scene, &wanted(&pictures_of_truth), find);
    assert!(problem.left_out.without_logarithm == 0 && problem.targets.len() > 500);
    let (_, found) = solved(scene, &problem);
    let error = picture_error(&pictures(scene, &found, find), &pictures_of_truth);
    let before = picture_error(&pictures(scene, &scene.medium, find), &pictures_of_truth);
    assert!(before > 0.05, "{find:?}: the start shows {before:e} already");
    assert!(error <= VOLUME_PICTURES, "{find:?}: pictures differ by {error:e}");
    let best = problem.apply(&VolumeState::of(scene).unwrap(), &pseudo_inverse(&problem)).unwrap().medium;
    let best = relative(&colors(of(&best)), &colors(of(truth)));
    let volume = relative(&colors(of(&found)), &colors(of(truth)));
    assert!(
        best < 1e-3 && volume <= best + VOLUME_FOUND,
        "{find:?}: {volume:e}, the pseudo-inverse {best:e}"
    );
}

#[test]
fn emission_and_albedo_are_found_again() {
    for interpolation in BOTH {
        let mut dark = start(interpolation, false);
        dark.medium.albedo = flat(0.0);
        let truth = VolumeMedium { emission: between(&mut numbers(2), 0.2, 1.0, 3), ..dark.medium.clone() };
        is_found(&dark, &truth, Find::Emission, |medium| &medium.emission);
        // What glows already is subtracted.
        let mut lit = start(interpolation, true);
        lit.medium.emission = between(&mut numbers(3), 0.0, 0.1, 1);
        let truth = VolumeMedium { albedo: between(&mut numbers(4), 0.1, 0.9, 3), ..lit.medium.clone() };
        is_found(&lit, &truth, Find::Albedo, |medium| &medium.albedo);
    }
}

#[test]
fn both_together_show_the_pictures() {
    let mut scene = start(Interpolation::Nearest, true);
    // Emission and albedo of a voxel look nearly alike, so that this takes longer.
    scene.solve.iterations = 1000;
    let truth = VolumeMedium {
        emission: between(&mut numbers(5), 0.0, 0.3, 3),
        albedo: between(&mut numbers(6), 0.1, 0.9, 3),
        ..scene.medium.clone()
    };
    let target = pictures(&scene, &truth, Find::Joint);
    let problem = problem(&scene, &wanted(&target), Find::Joint);
    assert_eq!(problem.start.len(), 2 * lattice().len());
    let (_, found) = solved(&scene, &problem);
    let error = picture_error(&pictures(&scene, &found, Find::Joint), &target);
    assert!(error <= VOLUME_PICTURES, "{error:e}");
}

fn for_extinction(is_grey: bool, interpolation: Interpolation) -> VolumeScene {
    let mut scene = start(interpolation, false);
    scene.medium.extinction = flat(0.8);
    scene.background = Some([1.0, 0.8, 0.6]);
    scene.extinction.medium_radiance = [0.1, 0.05, 0.0];
    scene.extinction.is_grey = is_grey;
    scene
}

#[test]
fn extinction_is_found_again_in_log_space() {
    for interpolation in BOTH {
        for channels in [1, 3] {
            let scene = for_extinction(channels == 1, interpolation);
            let extinction = between(&mut numbers(7), 0.2, 2.0, channels);
            let truth = VolumeMedium { extinction, ..scene.medium.clone() };
            is_found(&scene, &truth, Find::Extinction, |medium| &medium.extinction);
        }
    }
}

/// Pictures of a lens with its axis beside the middle, pixels that are not square, and distortion.
#[test]
fn extinction_comes_back_through_a_lens_as_without_it() {
    let pinhole = for_extinction(true, Interpolation::Nearest);
    let truth = VolumeMedium { extinction: between(&mut numbers(7), 0.2, 2.0, 1), ..pinhole.medium.clone() };
    let mut lens = pinhole.clone();
    for view in &mut lens.views {
        let eye = view.view.camera.position();
        let bent = Lens {
            radial: [-0.15, 0.04, 0.0, 0.0],
            tangential: [0.004, -0.003],
            ..Lens::new([28.0, 32.0], [8.7, 7.1])
        };
        let world = look_at(eye, DVec3::ZERO, DVec3::new(0.1, 0.9, 0.3)).unwrap();
        view.view.camera = Camera::with_lens(world, bent, [16; 2]).unwrap();
    }
    let [without, with] = [&pinhole, &lens].map(|scene| {
        let desired = wanted(&pictures(scene, &truth, Find::Extinction));
        let (_, found) = solved(scene, &problem(scene, &desired, Find::Extinction));
        colors(&found.extinction)
    });
    let truth = colors(&truth.extinction);
    let [apart, off] = [relative(&with, &without), relative(&with, &truth)];
    assert!(apart < 0.05 && off < 0.05, "{apart:e} from that of the pinhole, {off:e} from the truth");
    // Taken for a pinhole's, the same pictures give something else.
    let desired = wanted(&pictures(&lens, &VolumeMedium { ..pinhole.medium.clone() }, Find::Extinction));
    let (_, found) = solved(&pinhole, &problem(&pinhole, &desired, Find::Extinction));
    let off = relative(&colors(&found.extinction), &colors(&pinhole.medium.extinction));
    assert!(off > 0.05, "{off:e}");
}

#[test]
fn pixels_without_a_logarithm_are_left_out_and_counted() {
    let scene = for_extinction(false, Interpolation::Nearest);
    let extinction = between(&mut numbers(8), 0.2, 2.0, 3);
    let truth = VolumeMedium { extinction, ..scene.medium.clone() };
    let mut desired = wanted(&pictures(&scene, &truth, Find::Extinction));
    let all = problem(&scene, &desired, Find::Extinction);
    let middle = |k: usize| (6 + k) * 16 + 8;
    // Beyond the background in no channel, but darker than the medium itself in all of them: none; not above 0 in blue alone: two.
    for k in 0..3 {
        desired[0].pixels[middle(k)] = [0.05, 0.0, 0.0, 1.0];
        desired[1].pixels[middle(k)][2] = 0.0;
        desired[2].pixels[middle(k)][3] = 0.0;
    }
    let fewer = problem(&scene, &desired, Find::Extinction);
    assert_eq!((fewer.left_out.without_logarithm, fewer.left_out.unwanted), (3, 3));
    assert_eq!(fewer.targets.len() + 6, all.targets.len());
    assert_eq!(fewer.left_out.beside, all.left_out.beside);
    let dead = fewer.weights.iter().filter(|weight| weight[2] == 0.0 && weight[0] > 0.0).count();
    assert_eq!(dead, 3);
    let (_, found) = solved(&scene, &fewer);
    let error = relative(&colors(&found.extinction), &colors(&truth.extinction));
    assert!(error <= 2.0 * VOLUME_FOUND, "{error:e}");
}

#[test]
fn albedo_stays_between_nothing_and_all() {
    let mut scene = start(Interpolation::Trilinear, true);
    let bright = VolumeMedium { albedo: between(&mut numbers(9), 0.0, 2.0, 3), ..scene.medium.clone() };
    let desired = wanted(&pictures(&scene, &bright, Find::Albedo));
    scene.solve.iterations = 60;
    let (solved, _) = solved(&scene, &problem(&scene, &desired, Find::Albedo));
    let values = || solved.x.iter().flatten();
    assert!(values().all(|value| (0.0..=1.0).contains(value)));
    assert!(values().filter(|&&value| value == 1.0).count() > 50 && values().any(|&value| value < 0.2));
}

#[test]
fn the_hull_leaves_out_what_no_mask_shows_and_what_is_there_is_known() {
    for find in [Find::Emission, Find::Extinction] {
        let mut scene = for_extinction(true, Interpolation::Nearest);
        scene.medium.emission = flat(0.3);
        scene.medium.albedo = flat(0.0);
        let is_inside = |index: usize| lattice().voxel(index).iter().all(|i| (2..4).contains(i));
        let change = |volume: &Volume, inside: f32| {
            let samples = (0..lattice().len())
                .map(|index| if is_inside(index) { inside } else { volume.color(index)[0] })
                .collect();
            Arc::new(Volume::new(lattice(), 1, Samples::F32(samples)).unwrap())
        };
        // Masks are where the inside alone would be seen.
        let alone = VolumeMedium { extinction: change(&flat(0.0), 5.0), ..scene.medium.clone() };
        let seen = pictures(&scene, &alone, Find::Extinction);
        for (view, picture) in scene.views.iter_mut().zip(&seen) {
            view.mask = Some(picture.pixels.iter().map(|pixel| pixel[0] < 0.999).collect());
        }
        let mut truth = scene.medium.clone();
        match find {
            Find::Emission => truth.emission = change(&truth.emission, 0.9),
            _ => truth.extinction = change(&truth.extinction, 1.7),
        }
        let of = |medium: &VolumeMedium| match find {
            Find::Emission => colors(&medium.emission),
            _ => colors(&medium.extinction),
        };
        let target = pictures(&scene, &truth, find);
        let hull = problem(&scene, &wanted(&target), find);
        assert_eq!(hull.outside_hull + hull.start.len(), lattice().len());
        assert!(hull.start.len() >= 8 && hull.outside_hull > 80, "{} outside", hull.outside_hull);
        let (_, found) = solved(&scene, &hull);
        let outside: Vec<bool> = {
            let inside = hull.traversal.through_medium().parts()[0].voxels();
            (0..lattice().len()).map(|index| !inside.contains(lattice().voxel(index))).collect()
        };
        for (index, (found, start)) in of(&found).into_iter().zip(of(&scene.medium)).enumerate() {
            assert!(if is_inside(index) { !outside[index] } else { !outside[index] || found == start });
        }
        let error = picture_error(&pictures(&scene, &found, find), &target);
        assert!(error <= VOLUME_PICTURES, "{find:?}: {error:e}");
        let error = relative(&of(&found), &of(&truth));
        assert!(error <= VOLUME_FOUND, "{find:?}: {error:e}");
        scene.hull = false;
        assert_eq!(problem(&scene, &wanted(&target), find).start.len(), lattice().len());
    }
}

#[test]
fn each_quantity_of_a_joint_problem_keeps_its_own_bounds() {
    let mut scene = start(Interpolation::Nearest, true);
    let truth = VolumeMedium {
        emission: between(&mut numbers(5), 0.0, 0.6, 3),
        albedo: between(&mut numbers(6), 0.0, 1.0, 3),
        ..scene.medium.clone()
    };
    let desired = wanted(&pictures(&scene, &truth, Find::Joint));
    let (emission, albedo) = ([0.125, 0.25], [0.375, 0.625]);
    scene.bounds.emission = emission.map(|bound| [bound; 3]);
    scene.bounds.albedo = albedo.map(|bound| [bound; 3]);
    for solver in [
        SolverName::Fista,
        SolverName::Spectral,
        SolverName::Lbfgs,
        SolverName::Mprgp,
        SolverName::FlexibleCgls,
    ] {
        scene.solve.solver = solver;
        scene.solve.iterations = 40;
        let problem = problem(&scene, &desired, Find::Joint);
        let (solved, _) = solved(&scene, &problem);
        let (first, second) = solved.x.split_at(lattice().len());
        for (part, [low, high]) in [(first, emission), (second, albedo)] {
            let values = || part.iter().flatten().map(|&value| f64::from(value));
            assert!(values().all(|value| (low..=high).contains(&value)), "{solver:?} leaves {low}..{high}");
            // Flexible CGLS stays inside, and nears its bounds slowly.
            if solver != SolverName::FlexibleCgls {
                assert!(
                    values().any(|value| value == low) && values().any(|value| value == high),
                    "{solver:?}"
                );
            }
        }
    }
}
