use std::fmt;

use crate::Result;
use crate::operator::{FromHost, OnHost};
use crate::scene::Rgb;

/// Rows that are kept out of a fit. What is found shows them as well as the others as long as it is more than their noise.
pub struct HeldOut {
    operator: OnHost,
    targets: Vec<Rgb>,
    weights: Vec<Rgb>,
}

impl fmt::Debug for HeldOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("HeldOut").field("rows", &self.targets.len()).finish_non_exhaustive()
    }
}

impl HeldOut {
    /// Rows of T with their targets and weights.
    pub fn new(operator: OnHost, targets: Vec<Rgb>, weights: Vec<Rgb>) -> Self {
        Self { operator, targets, weights }
    }

    /// How many rows they are.
    pub fn rows(&self) -> usize {
        self.targets.len()
    }

    /// √(Σ w (T x − b)²) over the rows, of all elements x.
    ///
    /// Errors: those of the operator.
    pub fn misfit(&self, x: &[Rgb]) -> Result<f64> {
        let shown = self.operator.shown(x)?;
        let mut sum = 0.0;
        for ((shown, target), weight) in shown.iter().zip(&self.targets).zip(&self.weights) {
            for c in 0..3 {
                sum += f64::from(weight[c]) * (f64::from(shown[c]) - f64::from(target[c])).powi(2);
            }
        }
        Ok(sum.sqrt())
    }
}
