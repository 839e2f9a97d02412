//! Scenes of one volume, built in code.

use std::sync::Arc;
use unscatter::problem::TransportOperator;

use unscatter::problem::{
    Desired, Model, Optics, Solved, VolumeProblem, VolumeRenderer, VolumeState, minimize,
};
use unscatter::scene::{
    Environment, ExtinctionSettings, Find, Geometry, Image, LightBasis, Mesh, Over, PropertyBounds,
    Regularization, SolveSettings, Strategy, Target, View, VolumeMedium, VolumeScene, VolumeView, Weight,
};
use unscatter::solve::Control;

use super::*;

/// A medium under a sky, without surfaces, seen by some cameras; nothing pulls at what is looked for.
pub fn scene(medium: VolumeMedium, environment: Environment, cameras: Vec<Camera>) -> VolumeScene {
    let view = |(index, camera): (usize, Camera)| VolumeView {
        view: View { name: format!("view {index}"), camera, strokes: Vec::new(), layers: Vec::new() },
        picture: None,
        keep: 1.0,
        mask: None,
        background: None,
    };
    let regularization = Regularization { tikhonov: Weight::Relative(0.0), ..Regularization::default() };
    VolumeScene {
        name: String::new(),
        medium,
        lights: Vec::new(),
        environment,
        light_basis: Arc::new(LightBasis::discs(1, Over::Sphere, 0.5, 1).unwrap()),
        light_size: None,
        background: None,
        geometry: Arc::new(Geometry::new(Mesh::default()).unwrap()),
        views: cameras.into_iter().enumerate().map(view).collect(),
        target: Target::Radiance,
        stages: Vec::new(),
        rounds: 1,
        extinction: ExtinctionSettings {
            medium_radiance: [0.0; 3],
            is_grey: true,
            steps: 10,
            is_scattering: false,
        },
        bounds: PropertyBounds::default(),
        pull: [1.0; 2],
        hull: true,
        solve: SolveSettings { regularization, iterations: 400, tolerance: 1e-6, ..SolveSettings::default() },
        exposure: 0.0,
    }
}

/// What every view sees of a medium.
pub fn pictures(scene: &VolumeScene, medium: &VolumeMedium, find: Find) -> Vec<Image> {
    let state = VolumeState { medium: medium.clone(), ..VolumeState::of(scene).unwrap() };
    pictures_in(scene, &state, find)
}

/// The same of a medium and the light around it.
pub fn pictures_in(scene: &VolumeScene, state: &VolumeState, find: Find) -> Vec<Image> {
    let medium = &state.medium;
    let optics = Optics::new(scene, state).unwrap();
    let model: Model = VolumeProblem::model(scene, find);
    let renderer = VolumeRenderer::new(scene, medium, &optics, model);
    (0..scene.views.len()).map(|view| renderer.picture(view).unwrap()).collect()
}

/// Every pixel is wanted to be as in a picture.
pub fn wanted(pictures: &[Image]) -> Vec<Desired> {
    let pixels = |picture: &Image| picture.pixels.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect();
    pictures.iter().map(|picture| Desired { pixels: pixels(picture) }).collect()
}

/// The problem of finding something of a scene's medium.
pub fn problem(scene: &VolumeScene, desired: &[Desired], find: Find) -> VolumeProblem {
    let optics = Optics::new(scene, &VolumeState::of(scene).unwrap()).unwrap();
    VolumeProblem::new(scene, &scene.medium, &optics, desired, find).unwrap()
}

/// A problem solved, and the medium with its solution.
pub fn solved(scene: &VolumeScene, problem: &VolumeProblem) -> (Solved, VolumeMedium) {
    let (solved, state) = solved_state(scene, problem);
    (solved, state.medium)
}

/// A problem solved, and the medium and the light around it with its solution.
pub fn solved_state(scene: &VolumeScene, problem: &VolumeProblem) -> (Solved, VolumeState) {
    let operator = problem.operator(Strategy::Auto, 1 << 30).unwrap();
    let coverage = operator.squares(&problem.row_weights()).unwrap();
    let settings = VolumeProblem::settings(scene, problem.find);
    let each = |_: &_, _: &mut dyn unscatter::problem::Snapshot| Ok(Control::Continue);
    let solved = minimize(&problem.formulation(), &operator, &coverage, &settings, None, each).unwrap();
    let state = problem.apply(&VolumeState::of(scene).unwrap(), &solved.x).unwrap();
    (solved, state)
}

/// ‖a − b‖ / ‖b‖ of pictures.
pub fn picture_error(a: &[Image], b: &[Image]) -> f64 {
    let colors = |pictures: &[Image]| -> Vec<[f32; 3]> {
        pictures.iter().flat_map(|picture| picture.pixels.clone()).collect()
    };
    relative(&colors(a), &colors(b))
}

/// ‖a − b‖ / ‖b‖.
pub fn relative(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let square = |value: f32| f64::from(value) * f64::from(value);
    let differences: f64 = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| square(a - b)).sum();
    (differences / b.iter().flatten().map(|&b| square(b)).sum::<f64>()).sqrt()
}

/// The colours of a volume.
pub fn colors(volume: &Volume) -> Vec<[f32; 3]> {
    (0..volume.grid().len()).map(|index| volume.color(index)).collect()
}
