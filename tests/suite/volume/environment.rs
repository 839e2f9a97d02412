//! Light from everywhere as what is looked for.

use unscatter::Error;
use unscatter::operator::{CpuVector, FromHost, LinearOperator, TransportOperator, adjoint_test};
use unscatter::problem::{Problem, VolumeProblem, VolumeState};
use unscatter::scene::{
    DirectionalLight, Environment, Find, LightBasis, Mesh, Over, Primitive, RegularizationWeight, Rgb,
    Strategy, VolumeMedium, VolumeScene, look_at,
};
use unscatter::sparse::ExplicitMatrix;

use super::scene::scene as made;
use super::scene::{picture_error, pictures_in, problem, relative, solved_state, wanted};
use super::*;
use crate::scenes::volume::optics;
use crate::tolerances::{ADJOINT_F32, AGAINST_EXPLICIT, VOLUME_PICTURES};

/// What differs from case to case.
#[derive(Debug, Clone, Copy)]
struct Case {
    basis: Interpolation,
    is_map: bool,
    /// Of extinction and of albedo.
    channels: [usize; 2],
    has_floor: bool,
    sees_sky: bool,
}

const CASES: [Case; 5] = [
    Case { basis: BOTH[0], is_map: false, channels: [1, 1], has_floor: false, sees_sky: true },
    Case { basis: BOTH[1], is_map: true, channels: [1, 1], has_floor: false, sees_sky: false },
    Case { basis: BOTH[0], is_map: true, channels: [1, 3], has_floor: false, sees_sky: true },
    Case { basis: BOTH[1], is_map: false, channels: [3, 3], has_floor: false, sees_sky: true },
    Case { basis: BOTH[0], is_map: false, channels: [1, 1], has_floor: true, sees_sky: true },
];

/// A square below the cloud.
fn floor(side: f64, albedo: Rgb) -> Arc<Mesh> {
    let sides = [DVec3::Z * side, DVec3::X * side];
    let floor = Primitive::Plane { centre: DVec3::new(0.0, -2.6, 0.0), sides };
    floor.mesh(albedo).unwrap().into()
}

/// A cloud in some sun that glows a little, seen from all around.
fn scene(case: &Case) -> VolumeScene {
    let mut n = numbers(11);
    let lattice = VoxelGrid::over_cube([9, 8, 7], placement(&mut n)).unwrap();
    let [extinction, albedo] = case.channels;
    let albedo = values(&mut n, lattice, albedo, 0.9);
    let medium = VolumeMedium {
        extinction: Arc::new(values(&mut n, lattice, extinction, 2.0)),
        albedo: Arc::new(albedo),
        emission: Arc::new(values(&mut n, lattice, 1, 0.05)),
        g: 0.0,
        interpolation: case.basis,
        refraction: None,
    };
    let eye = |k: usize| {
        let eye = [[3.0, 2.0, 0.4], [-2.0, 1.0, 3.0], [0.3, 3.0, -2.0], [-1.0, 0.2, -3.0]][k];
        let eye = look_at(DVec3::from_array(eye), DVec3::ZERO, DVec3::new(0.1, 0.9, 0.3));
        Camera::new(eye.unwrap(), 50.0, FovAxis::X, [14, 10]).unwrap()
    };
    let mut scene = made(medium, Environment::constant([0.0; 3], 1).unwrap(), (0..4).map(eye).collect());
    scene.lights.push(DirectionalLight::new(DVec3::new(0.3, -1.0, -0.4), [1.0, 0.8, 0.5]).unwrap());
    scene.background = if case.sees_sky { None } else { Some([0.1, 0.2, 0.3]) };
    scene.light_size = Some([6, 7, 5]);
    scene.stages = vec![Find::Environment];
    scene.light_basis = Arc::new(match case.is_map {
        true => LightBasis::map([6, 4], Over::Sphere).unwrap(),
        false => LightBasis::discs(21, Over::Sphere, 0.6, 2).unwrap(),
    });
    if case.has_floor {
        scene.mesh = floor(8.0, [0.5, 0.4, 0.3]);
    }
    scene
}

fn colours(basis: &LightBasis) -> Vec<Rgb> {
    let mut n = numbers(5);
    (0..basis.len()).map(|_| std::array::from_fn(|_| n.uniform(0.1, 1.0) as f32)).collect()
}

fn lit(scene: &VolumeScene, colours: Vec<Rgb>) -> VolumeState {
    let environment = Environment::lights(scene.light_basis.clone(), colours).unwrap();
    VolumeState { environment, ..VolumeState::of(scene).unwrap() }
}

/// The problem whose targets are the pictures of a light.
fn of_truth(scene: &VolumeScene) -> (VolumeProblem, VolumeState) {
    let truth = lit(scene, colours(&scene.light_basis));
    (problem(scene, &wanted(&pictures_in(scene, &truth, Find::Environment)), Find::Environment), truth)
}

fn explicit(problem: &VolumeProblem) -> ExplicitMatrix {
    match problem.is_grey() {
        true => ExplicitMatrix::new::<1>(&problem.traversal, u64::MAX).unwrap(),
        false => ExplicitMatrix::new::<3>(&problem.traversal, u64::MAX).unwrap(),
    }
}

#[test]
fn rows_are_what_pictures_of_a_light_show() {
    for case in &CASES {
        let scene = scene(case);
        let (problem, truth) = of_truth(&scene);
        assert_eq!(problem.is_grey(), case.channels == [1, 1] && !case.has_floor, "{case:?}");
        let explicit = explicit(&problem);
        let mut shown = explicit.range();
        let x = truth.environment.coefficients(&scene.light_basis);
        explicit.apply(&CpuVector(x.iter().map(|x| x.map(f64::from)).collect()), &mut shown).unwrap();
        let shown: Vec<Rgb> = shown.0.iter().map(|color| color.map(|value| value as f32)).collect();
        let error = relative(&shown, &problem.targets);
        assert!(error <= 1e-4, "{case:?}: {error:e}");
    }
}

#[test]
fn both_strategies_are_the_explicit_matrix_and_have_its_adjoint() {
    for case in &CASES {
        let scene = scene(case);
        let (problem, _) = of_truth(&scene);
        let explicit = explicit(&problem);
        let x = CpuVector(colours(&scene.light_basis));
        let y = CpuVector(problem.targets.clone());
        let wide = |colors: &CpuVector| CpuVector(colors.0.iter().map(|c| c.map(f64::from)).collect());
        let (mut true_y, mut true_x) = (explicit.range(), explicit.domain());
        explicit.apply(&wide(&x), &mut true_y).unwrap();
        explicit.apply_adjoint(&wide(&y), &mut true_x).unwrap();
        let narrow =
            |v: &CpuVector<f64>| v.0.iter().map(|c| c.map(|value| value as f32)).collect::<Vec<Rgb>>();
        for strategy in [Strategy::Assembled, Strategy::MatrixFree] {
            let operator = problem.on_cpu(strategy, u64::MAX).unwrap();
            let errors = [
                relative(&operator.shown(&x.0).unwrap(), &narrow(&true_y)),
                relative(&operator.arriving(&y.0).unwrap(), &narrow(&true_x)),
            ];
            assert!(
                errors.iter().all(|error| *error <= AGAINST_EXPLICIT),
                "{case:?} {strategy:?}: {errors:?}"
            );
            let adjoint = adjoint_test(&operator, 2, 3).unwrap().error;
            assert!(adjoint <= ADJOINT_F32, "{case:?} {strategy:?}: {adjoint:e}");
        }
    }
}

#[test]
fn too_many_lights_for_the_memory_become_light_volumes() {
    let scene = scene(&CASES[0]);
    let (problem, _) = of_truth(&scene);
    let all = problem.on_cpu(Strategy::Auto, problem.kept_bytes()).unwrap().storage();
    assert_eq!((all.kept_rows, all.walked_rows), (problem.targets.len(), 0));
    assert_eq!(all.kept_nonzeros, problem.plan().nonzeros);
    let none = problem.on_cpu(Strategy::Auto, 0).unwrap().storage();
    assert_eq!((none.kept_rows, none.walked_rows), (0, problem.targets.len()));
    assert!(matches!(problem.on_cpu(Strategy::Assembled, 0), Err(Error::TooLarge { .. })));
}

#[test]
fn the_light_of_pictures_is_found_again() {
    for case in &CASES {
        let scene = scene(case);
        let (problem, truth) = of_truth(&scene);
        let target = pictures_in(&scene, &truth, Find::Environment);
        let dark = VolumeState::of(&scene).unwrap();
        assert!(picture_error(&pictures_in(&scene, &dark, Find::Environment), &target) > 0.05, "{case:?}");
        let (_, found) = solved_state(&scene, &problem);
        let error = picture_error(&pictures_in(&scene, &found, Find::Environment), &target);
        assert!(error <= VOLUME_PICTURES, "{case:?}: {error:e}");
    }
}

/// Radiance that rises from the nadir to the zenith, as the scene's lights would give it.
fn smooth_sky(basis: &LightBasis) -> Vec<Rgb> {
    basis.lights().iter().map(|light| [0.5, 0.6, 0.8].map(|c| c * (1.2 + light.towards.y as f32))).collect()
}

/// The lights that are found behind noisy pictures of a smooth sky, with some pull of neighbours; and the sky itself.
fn found_behind_noise(scene: &mut VolumeScene, gradient: f64) -> [Vec<Rgb>; 2] {
    scene.regularization_of_sky.gradient = RegularizationWeight::Relative(gradient);
    let sky = smooth_sky(&scene.light_basis);
    let mut pictures = pictures_in(scene, &lit(scene, sky.clone()), Find::Environment);
    let mut n = numbers(3);
    let mut noise = |value: f32| value + n.uniform(-0.05, 0.05) as f32;
    pictures
        .iter_mut()
        .flat_map(|picture| &mut picture.pixels)
        .for_each(|color| *color = color.map(&mut noise));
    let (_, found) = solved_state(scene, &problem(scene, &wanted(&pictures), Find::Environment));
    [found.environment.coefficients(&scene.light_basis), sky]
}

#[test]
fn a_sky_that_is_found_is_smooth() {
    for case in [CASES[1], CASES[4], Case { is_map: true, ..CASES[4] }] {
        let mut scene = scene(&case);
        scene.background = Some([0.1, 0.2, 0.3]);
        let mut error = |gradient| {
            let [found, sky] = found_behind_noise(&mut scene, gradient);
            relative(&found, &sky)
        };
        let (rough, smooth) = (error(0.0), error(0.01));
        assert!(smooth < 0.5 * rough, "{case:?}: {smooth} and {rough}");
    }
}

#[test]
fn lights_that_reach_nothing_are_like_those_beside_them() {
    // A black floor without end hides the lower half of the sky.
    let mut scene = scene(&CASES[4]);
    scene.background = Some([0.1, 0.2, 0.3]);
    scene.mesh = floor(4000.0, [0.0; 3]);
    let below = |scene: &VolumeScene, found: &[Rgb]| -> Vec<f32> {
        let lights = scene.light_basis.lights().iter().zip(found);
        lights.filter(|(light, _)| light.towards.y < -0.3).map(|(_, color)| color[0]).collect()
    };
    let [found, _] = found_behind_noise(&mut scene, 0.0);
    assert!(below(&scene, &found).iter().all(|&value| value == 0.0), "they keep their start");
    let [found, _] = found_behind_noise(&mut scene, 0.01);
    // What only neighbours pull at is between them.
    let above = scene.light_basis.lights().iter().zip(&found).filter(|(light, _)| light.towards.y >= -0.3);
    let [least, most] =
        above.fold([f32::INFINITY, 0.0f32], |[a, b], (_, color)| [a.min(color[0]), b.max(color[0])]);
    let values = below(&scene, &found);
    assert!(values.iter().all(|value| (least..=most).contains(value)), "{least} {most} {values:?}");
    assert!(values.iter().all(|&value| value > 0.1));
}

#[test]
fn lights_that_nothing_shows_are_refused() {
    // A hemisphere that points down at a floor, seen from above it.
    let mut scene = scene(&CASES[4]);
    scene.background = Some([0.1; 3]);
    scene.mesh = floor(4000.0, [0.0; 3]);
    scene.light_basis = Arc::new(LightBasis::discs(9, Over::Hemisphere(DVec3::NEG_Y), 0.2, 1).unwrap());
    let state = VolumeState::of(&scene).unwrap();
    let desired = wanted(&pictures_in(&scene, &state, Find::Environment));
    let optics = optics(&scene, &state);
    let refused = VolumeProblem::new(&scene, &scene.medium, &optics, &desired, Find::Environment);
    let Err(error) = refused else { panic!("nothing can come from below") };
    assert!(error.to_string().contains("none of the 9 lights reaches"), "{error}");
    // Scattering that depends on the view would need a light volume a view.
    scene.medium.g = 0.5;
    let refused = VolumeProblem::new(&scene, &scene.medium, &optics, &desired, Find::Environment);
    assert!(matches!(refused, Err(Error::Value { .. })));
}

#[cfg(feature = "gpu")]
#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn adapters_agree_with_the_explicit_matrix() {
    let gpu = crate::gpu::gpu();
    for case in &CASES {
        let scene = scene(case);
        let (problem, _) = of_truth(&scene);
        let x = colours(&scene.light_basis);
        let here = problem.on_cpu(Strategy::Assembled, u64::MAX).unwrap();
        for strategy in [Strategy::Assembled, Strategy::MatrixFree] {
            let operator = problem.on_gpu(&gpu, strategy, u64::MAX, false).unwrap();
            assert!(operator.is_deterministic());
            let errors = [
                relative(&operator.shown(&x).unwrap(), &here.shown(&x).unwrap()),
                relative(
                    &operator.arriving(&problem.targets).unwrap(),
                    &here.arriving(&problem.targets).unwrap(),
                ),
                relative(
                    &operator.squares(&problem.weights()).unwrap().0,
                    &here.squares(&problem.weights()).unwrap().0,
                ),
            ];
            assert!(
                errors.iter().all(|error| *error <= AGAINST_EXPLICIT),
                "{case:?} {strategy:?}: {errors:?}"
            );
            let adjoint = adjoint_test(&operator, 2, 3).unwrap().error;
            assert!(adjoint <= ADJOINT_F32, "{case:?} {strategy:?}: {adjoint:e}");
        }
    }
}
