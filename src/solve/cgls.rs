//! CGLS: conjugate gradients on the normal equations, without forming them.
//!
//! Problem       min ½‖A x − b‖², each channel with step lengths of its own.
//! Equivalences  In exact arithmetic and without a scaling the iterates are those of LSQR, and of CG on Aᵀ A x = Aᵀ b;
//!               with one, those of CG preconditioned by D.
//! Caveats       ‖A x − b‖ falls monotonically, ‖Aᵀ (b − A x)‖ does not. Elements outside the row space of A keep
//!               their start. With `clamped` the iterates are moved into the bounds after each step,
//!               as the papers do; the recursion then no longer describes the iterate, and it need not converge.
//! Source        Hestenes and Stiefel 1952; Björck 1996, algorithm 7.4.1; clamp: Klehm 2015, sec. 7.4.2.

use super::{LeastSquares, Live, Measure, Method, MethodMemory, Vectors, each, ratio};
use crate::operator::{LinearOperator, PendingSum, Scalars, Vector};
use crate::{Error, Result};

/// Part of its start below which ‖s‖² is rounding at any precision, and further steps would only underflow.
const NOTHING_LEFT: f64 = 1e-30;

/// Conjugate gradients on the normal equations.
#[derive(Debug)]
pub struct Cgls<O: LinearOperator> {
    clamped: bool,
    x: O::Domain,
    /// The residual b − A x.
    r: O::Range,
    /// The normal residual Aᵀ r.
    s: O::Domain,
    /// D⁻¹ s.
    z: O::Domain,
    /// The search direction.
    p: O::Domain,
    /// A p.
    q: O::Range,
    /// ⟨s, z⟩.
    gamma: Scalars,
    /// ⟨s, z⟩ where it began.
    start: Scalars,
    residual: Scalars,
    normal_residual: Scalars,
}

impl<O: LinearOperator> Cgls<O> {
    /// The vectors that it keeps.
    pub const VECTORS: Vectors = Vectors { domain: 4, range: 2 };

    /// The method for problems of this operator's shape.
    pub fn new(operator: &O) -> Self {
        Self {
            clamped: false,
            x: operator.domain(),
            r: operator.range(),
            s: operator.domain(),
            z: operator.domain(),
            p: operator.domain(),
            q: operator.range(),
            gamma: [0.0; 3],
            start: [0.0; 3],
            residual: [0.0; 3],
            normal_residual: [0.0; 3],
        }
    }

    /// The papers' variant: x is moved into the bounds after each step.
    pub fn clamped(operator: &O) -> Self {
        Self { clamped: true, ..Self::new(operator) }
    }

    /// s, z and what follows from them, of the present r; gives ⟨s, z⟩.
    fn look(&mut self, problem: &LeastSquares<O>) -> Result<Scalars> {
        problem.descent(&self.r, &mut self.s)?;
        let residual = self.r.dot_later(&self.r)?;
        let normal_residual = if self.clamped {
            self.z.axpby([-1.0; 3], &self.s, [0.0; 3]);
            self.z.projected_norm_squared_later(&self.x, problem.bounds())?
        } else {
            self.s.dot_later(&self.s)?
        };
        self.z.copy_from(&self.s);
        problem.shrink(&mut self.z);
        let gamma = self.s.dot_later(&self.z)?;
        (self.residual, self.normal_residual) = (residual.value()?, normal_residual.value()?);
        gamma.value()
    }

    /// alpha = ⟨s, z⟩ / ‖A p‖²; zero for a channel whose normal residual is gone but for rounding.
    fn step_length(&self, curvature: Scalars, live: Live) -> Result<Scalars> {
        let mut alpha = [0.0; 3];
        for c in 0..3 {
            if !live[c] || self.gamma[c] <= NOTHING_LEFT * self.start[c] {
                continue;
            }
            // Not `<= 0`: a NaN must not pass.
            if !(curvature[c] > 0.0 && curvature[c].is_finite()) {
                return Err(Error::Curvature { value: curvature[c], iteration: 0 });
            }
            alpha[c] = self.gamma[c] / curvature[c];
        }
        Ok(alpha)
    }
}

impl<O: LinearOperator> Method<O> for Cgls<O> {
    fn name(&self) -> &'static str {
        if self.clamped { "clamped-cgls" } else { "cgls" }
    }

    fn keeps_bounds(&self) -> bool {
        self.clamped
    }

    fn vectors(&self) -> Vectors {
        Self::VECTORS
    }

    fn begin(&mut self, problem: &LeastSquares<O>, x: &O::Domain) -> Result<()> {
        self.x.copy_from(x);
        if self.clamped {
            self.x.clamp(problem.bounds());
        }
        problem.residual(&self.x, &mut self.r)?;
        self.gamma = self.look(problem)?;
        self.start = self.gamma;
        self.p.copy_from(&self.z);
        Ok(())
    }

    fn step(&mut self, problem: &LeastSquares<O>, live: Live) -> Result<()> {
        problem.apply(&self.p, &mut self.q)?;
        let alpha = self.step_length(self.q.norm_squared()?, live)?;
        self.x.axpby(alpha, &self.p, [1.0; 3]);
        if self.clamped {
            self.x.clamp(problem.bounds());
        }
        self.r.axpby(alpha.map(|a| -a), &self.q, [1.0; 3]);
        let gamma = self.look(problem)?;
        let beta = ratio(gamma, self.gamma);
        self.p.axpby([1.0; 3], &self.z, each(|c| if live[c] { beta[c] } else { 0.0 }));
        self.gamma = gamma;
        Ok(())
    }

    fn solution(&self) -> &O::Domain {
        &self.x
    }

    fn measure(&self) -> Measure {
        Measure { residual: self.residual, normal_residual: self.normal_residual }
    }

    fn residual(&self) -> Option<&O::Range> {
        Some(&self.r)
    }

    fn memory(&mut self) -> MethodMemory<'_, O> {
        MethodMemory {
            domain: vec![&mut self.x, &mut self.p],
            range: vec![&mut self.r],
            scalars: vec![&mut self.gamma, &mut self.start, &mut self.residual, &mut self.normal_residual],
        }
    }
}
