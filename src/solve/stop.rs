use std::time::Duration;

use crate::operator::Scalars;
use crate::{Error, Result};

/// When to stop.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits {
    /// Iterations at most.
    pub iterations: usize,
    /// Stop when the normal residual has fallen to this part of its start, in every channel, each relative to its own.
    pub tolerance: f64,
    /// Stop after this long.
    pub time: Option<Duration>,
    /// Morozov's discrepancy principle: stop when ‖b − A x‖² of the data (the uppermost block), over all channels, has fallen to this, the
    /// squared norm of the noise in b; to fit it better would be to fit the noise.
    pub discrepancy: Option<f64>,
    /// Whether channels that are done go on with the others.
    pub carry_on: bool,
}

impl Limits {
    /// So many iterations, or this tolerance.
    pub fn new(iterations: usize, tolerance: f64) -> Self {
        Self { iterations, tolerance, time: None, discrepancy: None, carry_on: false }
    }

    /// Errors: [`Error::Value`] naming a tolerance or discrepancy that is negative or not a number.
    pub(super) fn check(&self) -> Result<()> {
        let not_negative = |name: &'static str, value: f64| {
            // Not `< 0`: a NaN must not pass.
            if value >= 0.0 {
                Ok(())
            } else {
                Err(Error::value(name, value, "a number that is not negative"))
            }
        };
        not_negative("tolerance", self.tolerance)?;
        self.discrepancy.map_or(Ok(()), |noise| not_negative("discrepancy", noise))
    }
}

/// The least share of the fit's gain that rows it knows nothing of must gain.
const SHARED: f64 = 0.5;

/// Whether what a fit gains is mostly noise, given its residual before and after, and that of rows that are kept out of it.
///
/// What is found of what is there brings both nearer alike: ρ = Δ ln h / Δ ln f is near 1, f the residual of the fit and h the other. Their
/// noises have nothing to do with each other, so that ρ falls, and below 0, when noise is followed. From ρ < ½ on it is most of what is gained.
pub fn is_mostly_noise(fit: [f64; 2], held_out: [f64; 2]) -> bool {
    let gain = |[before, after]: [f64; 2]| (before / after).ln();
    gain(fit) > 0.0 && gain(held_out) < SHARED * gain(fit)
}

/// Why a solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum StopReason {
    /// The normal residual reached the tolerance, and the true residual confirmed it.
    Tolerance,
    /// The residual reached the noise of the data.
    Discrepancy,
    /// What still improves is noise: rows that are kept out of the fit come no nearer.
    HeldOut,
    /// The iteration limit.
    Iterations,
    /// The time limit.
    Time,
    /// Rounding: neither the objective nor the normal residual falls any more.
    Stagnation,
    /// The caller asked for it.
    Interrupted,
}

impl StopReason {
    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tolerance => "tolerance",
            Self::Discrepancy => "discrepancy",
            Self::HeldOut => "held-out",
            Self::Iterations => "iterations",
            Self::Time => "time",
            Self::Stagnation => "stagnation",
            Self::Interrupted => "interrupted",
        }
    }
}

/// Why and when a solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ending {
    /// Why.
    pub reason: StopReason,
    /// After how many iterations.
    pub iteration: usize,
}

/// What a callback wants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// Go on.
    Continue,
    /// Stop here.
    Stop,
    /// Stop here at once: the residuals of the outcome are the method's own, and are no certificate.
    Pause,
}

/// Iterations without any progress after which a solve has stagnated.
const PATIENCE: usize = 100;

/// The least normal residual so far, and whether there is progress still.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progressing {
    /// The largest of the channels' normal residuals, where it was least.
    pub least: f64,
    /// ‖b − A x‖ at the last progress.
    pub residual: Scalars,
    /// Iterations since.
    pub without: usize,
}

impl Progressing {
    /// Before the first iteration.
    pub const START: Self = Self { least: f64::INFINITY, residual: [f64::INFINITY; 3], without: 0 };

    /// Takes note of an iteration: it is progress when the largest normal residual falls by a hundredth, or a residual by
    /// more than rounding makes of it.
    pub(super) fn note(&mut self, normal_residual: f64, residual: Scalars, epsilon: f64) {
        let falls = (0..3).any(|c| residual[c] < (1.0 - 4.0 * epsilon) * self.residual[c]);
        if falls || normal_residual < 0.99 * self.least {
            *self = Self {
                least: self.least.min(normal_residual),
                residual: least(residual, self.residual),
                without: 0,
            };
        } else {
            self.without += 1;
        }
    }

    /// Whether there has been none for long.
    pub(super) fn has_stagnated(&self) -> bool {
        self.without >= PATIENCE
    }
}

fn least(a: Scalars, b: Scalars) -> Scalars {
    std::array::from_fn(|c| a[c].min(b[c]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gains_that_others_do_not_share_are_noise() {
        assert!(!is_mostly_noise([1.0, 0.5], [2.0, 1.0]), "both gain alike");
        assert!(!is_mostly_noise([1.0, 0.5], [2.0, 1.4]), "just above the half of it, in the logarithm");
        assert!(is_mostly_noise([1.0, 0.5], [2.0, 1.5]));
        assert!(is_mostly_noise([1.0, 0.5], [2.0, 2.5]));
        assert!(!is_mostly_noise([1.0, 1.0], [2.0, 2.5]), "nothing was gained");
    }
}
