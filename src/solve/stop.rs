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
