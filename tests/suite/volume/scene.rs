//! Problems of one volume, solved and compared.

use unscatter::operator::TransportOperator;
use unscatter::problem::{Problem, Solved, VolumeProblem, VolumeState, solve};
use unscatter::scene::{Image, Strategy, VolumeMedium, VolumeScene};
use unscatter::solve::Control;

use super::*;
pub use crate::scenes::volume::{pictures, pictures_in, problem, scene, wanted};

/// A problem solved, and the medium with its solution.
pub fn solved(scene: &VolumeScene, problem: &VolumeProblem) -> (Solved, VolumeMedium) {
    let (solved, state) = solved_state(scene, problem);
    (solved, state.medium)
}

/// A problem solved, and the medium and the light around it with its solution.
pub fn solved_state(scene: &VolumeScene, problem: &VolumeProblem) -> (Solved, VolumeState) {
    let operator = problem.on_cpu(Strategy::Auto, 1 << 30).unwrap();
    let coverage = operator.squares(&problem.weights()).unwrap();
    let settings = VolumeProblem::settings(scene, problem.find);
    let each = |_: &_, _: &mut dyn unscatter::problem::Snapshot| Ok(Control::Continue);
    let solved = solve(problem, &operator, &coverage, &settings, None, each).unwrap();
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
