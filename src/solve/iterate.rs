use super::{LeastSquares, Measure};
use crate::Result;
use crate::operator::{LinearOperator, PendingSum, Vector};

/// The iterate of a method within bounds: x, and what is known there.
pub(super) struct Iterate<O: LinearOperator> {
    pub(super) x: O::Domain,
    /// b − A x.
    pub(super) r: O::Range,
    /// Aᵀ (A x − b).
    pub(super) g: O::Domain,
    pub(super) measure: Measure,
}

impl<O: LinearOperator> std::fmt::Debug for Iterate<O> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Iterate").field("measure", &self.measure).finish_non_exhaustive()
    }
}

impl<O: LinearOperator> Iterate<O> {
    pub(super) fn new(operator: &O) -> Self {
        Self {
            x: operator.domain(),
            r: operator.range(),
            g: operator.domain(),
            measure: Measure { residual: [0.0; 3], normal_residual: [0.0; 3] },
        }
    }

    /// Stands at `x`, moved into the bounds.
    pub(super) fn begin(&mut self, problem: &LeastSquares<O>, x: &O::Domain) -> Result<()> {
        self.x.copy_from(x);
        self.x.clamp(problem.bounds());
        problem.residual(&self.x, &mut self.r)?;
        self.look(problem)
    }

    /// g and the measure, given x and r.
    pub(super) fn look(&mut self, problem: &LeastSquares<O>) -> Result<()> {
        problem.gradient(&self.r, &mut self.g)?;
        self.take_measure(problem)
    }

    /// The measure, given x, r and g.
    pub(super) fn take_measure(&mut self, problem: &LeastSquares<O>) -> Result<()> {
        let residual = self.r.dot_later(&self.r)?;
        let normal_residual = self.g.projected_norm_squared_later(&self.x, problem.bounds())?;
        self.measure = Measure { residual: residual.value()?, normal_residual: normal_residual.value()? };
        Ok(())
    }
}
