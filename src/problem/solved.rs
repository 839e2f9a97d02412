use super::system::RegularizationWeights;
use crate::scene::Rgb;
use crate::solve::Outcome;

/// A solved problem.
#[derive(Debug)]
pub struct Solved {
    /// All elements. Those that no row reaches keep their start, or are filled where the problem asks for it.
    pub x: Vec<Rgb>,
    /// Numbers of the elements that were unknown, increasing: those that some row reaches, and those that stand for cells of others.
    pub columns: Vec<u32>,
    /// How the solve went.
    pub outcome: Outcome,
    /// λ of the regularizers; unit of T squared.
    pub weights: RegularizationWeights,
    /// λ relative to the mean squared column norm, as settings give it; dimensionless.
    pub relative_weights: RegularizationWeights,
    /// Applications of the transport before the first iteration: the metric, the choice of λ.
    pub set_up_applications: usize,
    /// Whether an operator stood for T, and was given up because its corrections brought no more.
    pub gave_up_near: bool,
}

/// The first element that is not a number.
pub(super) fn not_finite(elements: &[Rgb]) -> Option<usize> {
    elements.iter().position(|element| !element.iter().all(|value| value.is_finite()))
}
