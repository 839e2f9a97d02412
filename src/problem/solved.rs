use super::system::RegularizationWeights;
use crate::scene::Rgb;
use crate::solve::Outcome;

/// A solved problem.
#[derive(Debug)]
pub struct Solved {
    /// All elements; those that no row reaches keep the start (texels of a light map may be filled instead).
    pub x: Vec<Rgb>,
    /// The elements that some row reaches, in increasing order.
    pub columns: Vec<u32>,
    /// How the solve went.
    pub outcome: Outcome,
    /// λ of the regularizers.
    pub weights: RegularizationWeights,
    /// The same relative to the mean squared column norm, as settings give them.
    pub relative_weights: RegularizationWeights,
    /// Applications of the transport before the first iteration: the metric, the choice of λ.
    pub set_up_applications: usize,
}

/// The first element that is not a number.
pub(super) fn not_finite(elements: &[Rgb]) -> Option<usize> {
    elements.iter().position(|element| !element.iter().all(|value| value.is_finite()))
}
