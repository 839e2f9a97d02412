//! How the document wants to be solved.

use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::scene::{self, Regularization, SolveSettings};

use super::flaw::{Built, Flaw, checked, within};
use super::size::MemorySize;

/// How the problem is discretized and solved. What is not given has the default of the library.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Solve {
    /// The method.
    pub solver: Solver,
    /// Iterations at most, from 1 to 1000000.
    pub iterations: usize,
    /// Stop when the normal residual has fallen to this part of its start; from 0 (never) to below 1.
    pub tolerance: f64,
    /// Stop after this many seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    /// Pull towards the start, relative to the mean squared column norm of the transport; 0 for none.
    pub tikhonov: f64,
    /// How the integral along a view ray is taken.
    pub quadrature: Quadrature,
    /// Whether the non-zeros of the transport are kept or walked again in each application.
    pub strategy: Strategy,
    /// Memory that a solve may take, such as "4GiB"; three quarters of what is free when not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory: Option<MemorySize>,
    /// The rest of a ray is skipped once its transmittance is below this; inside (0, 1).
    pub transmittance_bound: f64,
}

/// The methods that can solve the problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Conjugate gradients on the normal equations.
    Cgls,
    /// CGLS with negative values set to zero after every step, as in the papers; it need not converge.
    ClampedCgls,
}

/// How the integral along a view ray is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Quadrature {
    /// Cell by cell, in closed form.
    Exact,
    /// The papers' march in steps of equal length.
    March {
        /// Steps a ray, from 1 to 100000.
        steps: u32,
    },
}

/// Whether the non-zeros of the transport are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Strategy {
    /// As many rows are kept as the memory budget allows.
    Auto,
    /// All rows are kept; an error when they exceed the budget.
    Assembled,
    /// No row is kept.
    MatrixFree,
}

impl Default for Solve {
    fn default() -> Self {
        let settings = SolveSettings::default();
        Self {
            solver: settings.solver.into(),
            iterations: settings.iterations,
            tolerance: settings.tolerance,
            seconds: settings.time_limit.map(|limit| limit.as_secs_f64()),
            tikhonov: settings.regularization.tikhonov,
            quadrature: settings.quadrature.into(),
            strategy: settings.strategy.into(),
            memory: settings.memory.map(MemorySize),
            transmittance_bound: settings.transmittance_bound,
        }
    }
}

const ITERATIONS: [usize; 2] = [1, 1_000_000];
const STEPS: [u32; 2] = [1, 100_000];

impl Solve {
    /// The settings of a solve with the `basis` that the light map asks for.
    pub(super) fn build(&self, basis: scene::Basis) -> Built<SolveSettings> {
        let tikhonov = checked("tikhonov", self.tikhonov, "finite and not negative", |t| t >= 0.0)?;
        Ok(SolveSettings {
            solver: self.solver.into(),
            iterations: within("iterations", self.iterations, ITERATIONS)?,
            tolerance: checked("tolerance", self.tolerance, "from 0 to below 1", |t| {
                (0.0..1.0).contains(&t)
            })?,
            time_limit: self.seconds.map(time_limit).transpose()?,
            regularization: Regularization { tikhonov },
            basis,
            quadrature: self.quadrature.build()?,
            strategy: self.strategy.into(),
            memory: self.memory.map(|size| size.0),
            transmittance_bound: checked(
                "transmittance_bound",
                self.transmittance_bound,
                "above 0 and below 1",
                |bound| bound > 0.0 && bound < 1.0,
            )?,
        })
    }
}

fn time_limit(seconds: f64) -> Built<Duration> {
    let limit = Duration::try_from_secs_f64(seconds).ok().filter(|limit| !limit.is_zero());
    limit.ok_or_else(|| Flaw::value("seconds", seconds, "a number of seconds above 0"))
}

impl Quadrature {
    fn build(self) -> Built<scene::Quadrature> {
        Ok(match self {
            Self::Exact => scene::Quadrature::Exact,
            Self::March { steps } => {
                scene::Quadrature::March { steps: within("quadrature.march.steps", steps, STEPS)? }
            }
        })
    }
}

impl From<scene::Quadrature> for Quadrature {
    fn from(quadrature: scene::Quadrature) -> Self {
        match quadrature {
            scene::Quadrature::Exact => Self::Exact,
            scene::Quadrature::March { steps } => Self::March { steps },
        }
    }
}

/// The same names here and in the scene, so that neither can gain one without the other.
macro_rules! same_names {
    ($document:ident, $scene:ident: $($name:ident),+) => {
        impl From<$document> for scene::$scene {
            fn from(name: $document) -> Self {
                match name { $($document::$name => Self::$name),+ }
            }
        }

        impl From<scene::$scene> for $document {
            fn from(name: scene::$scene) -> Self {
                match name { $(scene::$scene::$name => Self::$name),+ }
            }
        }
    };
}

same_names!(Solver, SolverName: Cgls, ClampedCgls);
same_names!(Strategy, Strategy: Auto, Assembled, MatrixFree);

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_object_is_the_default_of_the_library() {
        let solve: Solve = serde_json::from_str("{}").unwrap();
        assert_eq!(solve.build(scene::Basis::default()).unwrap(), SolveSettings::default());
    }

    #[test]
    fn every_field_reaches_the_settings() {
        let text = r#"{"solver": "clamped-cgls", "iterations": 7, "tolerance": 0.5, "seconds": 1.5, "tikhonov": 2,
            "quadrature": {"march": {"steps": 9}}, "strategy": "matrix-free", "memory": "3KiB",
            "transmittance_bound": 0.25}"#;
        let solve: Solve = serde_json::from_str(text).unwrap();
        let expected = SolveSettings {
            solver: scene::SolverName::ClampedCgls,
            iterations: 7,
            tolerance: 0.5,
            time_limit: Some(Duration::from_millis(1500)),
            regularization: Regularization { tikhonov: 2.0 },
            basis: scene::Basis::Nearest,
            quadrature: scene::Quadrature::March { steps: 9 },
            strategy: scene::Strategy::MatrixFree,
            memory: Some(3072),
            transmittance_bound: 0.25,
        };
        assert_eq!(solve.build(scene::Basis::Nearest).unwrap(), expected);
    }

    #[test]
    fn settings_out_of_range_are_refused_at_their_fault() {
        let table = [
            (r#"{"iterations": 0}"#, "iterations"),
            (r#"{"tolerance": 1}"#, "tolerance"),
            (r#"{"tolerance": -1e-9}"#, "tolerance"),
            (r#"{"seconds": 0}"#, "seconds"),
            (r#"{"seconds": 1e300}"#, "seconds"),
            (r#"{"tikhonov": -1}"#, "tikhonov"),
            (r#"{"quadrature": {"march": {"steps": 0}}}"#, "quadrature.march.steps"),
            (r#"{"transmittance_bound": 0}"#, "transmittance_bound"),
        ];
        for (text, expected) in table {
            let solve: Solve = serde_json::from_str(text).unwrap();
            let Err(Flaw::Document { path, .. }) = solve.build(scene::Basis::Nearest) else {
                unreachable!("{text} was accepted")
            };
            assert_eq!(path, expected);
        }
    }
}
