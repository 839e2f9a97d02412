//! CGLS: conjugate gradients on the normal equations, without forming them.
//!
//! Problem       min ½‖A x − b‖², each channel with step lengths of its own.
//! Equivalences  In exact arithmetic the iterates are those of LSQR, and of CG on Aᵀ A x = Aᵀ b.
//! Caveats       ‖A x − b‖ falls monotonically, ‖Aᵀ (b − A x)‖ does not. Elements outside the row space of A keep
//!               their start. With `clamped` the iterates are set to non-negative values after each step,
//!               as the papers do; the recursion then no longer describes the iterate, and it need not converge.
//! Source        Hestenes and Stiefel 1952; Björck 1996, algorithm 7.4.1; clamp: Klehm 2015, sec. 7.4.2.

use super::{LeastSquares, Measure, Method, State};
use crate::operator::{LinearOperator, Scalars, Vector};
use crate::{Error, Result};

/// Part of its start below which ‖s‖² is rounding at any precision, and further steps would only underflow.
const NOTHING_LEFT: f64 = 1e-30;

/// Conjugate gradients on the normal equations. Vectors: 3 of the domain (x, s, p), 2 of the range (r, q).
#[derive(Debug)]
pub struct Cgls<O: LinearOperator> {
    clamped: bool,
    x: O::Domain,
    /// The residual b − A x.
    r: O::Range,
    /// The normal residual Aᵀ r.
    s: O::Domain,
    /// The search direction.
    p: O::Domain,
    /// A p.
    q: O::Range,
    /// ‖s‖².
    gamma: Scalars,
    /// ‖s‖² where it began.
    start: Scalars,
    residual: Scalars,
    iteration: usize,
    applications: usize,
}

impl<O: LinearOperator> Cgls<O> {
    /// The method for problems of this operator's shape.
    pub fn new(operator: &O) -> Self {
        Self {
            clamped: false,
            x: operator.domain(),
            r: operator.range(),
            s: operator.domain(),
            p: operator.domain(),
            q: operator.range(),
            gamma: [0.0; 3],
            start: [0.0; 3],
            residual: [0.0; 3],
            iteration: 0,
            applications: 0,
        }
    }

    /// The papers' variant: negative values are set to zero after each step.
    pub fn clamped(operator: &O) -> Self {
        Self { clamped: true, ..Self::new(operator) }
    }

    /// alpha = ‖s‖² / ‖A p‖²; zero for a channel whose normal residual is gone but for rounding.
    fn step_length(&self, curvature: Scalars) -> Result<Scalars> {
        let mut alpha = [0.0; 3];
        for c in 0..3 {
            if self.gamma[c] <= NOTHING_LEFT * self.start[c] {
                continue;
            }
            // Not `<= 0`: a NaN must not pass.
            if !(curvature[c] > 0.0 && curvature[c].is_finite()) {
                return Err(Error::Curvature { value: curvature[c], iteration: self.iteration });
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

    fn begin(&mut self, problem: &LeastSquares<O>, x: &O::Domain) -> Result<()> {
        self.x.copy_from(x);
        problem.residual(&self.x, &mut self.r)?;
        problem.operator.apply_adjoint(&self.r, &mut self.s)?;
        self.p.copy_from(&self.s);
        self.gamma = self.s.norm_squared()?;
        self.start = self.gamma;
        self.residual = self.r.norm_squared()?;
        self.applications += 2;
        Ok(())
    }

    fn step(&mut self, problem: &LeastSquares<O>) -> Result<()> {
        self.iteration += 1;
        problem.operator.apply(&self.p, &mut self.q)?;
        let alpha = self.step_length(self.q.norm_squared()?)?;
        self.x.axpby(alpha, &self.p, [1.0; 3]);
        if self.clamped {
            self.x.clamp_below([0.0; 3]);
        }
        self.r.axpby(alpha.map(|a| -a), &self.q, [1.0; 3]);
        problem.operator.apply_adjoint(&self.r, &mut self.s)?;
        let gamma = self.s.norm_squared()?;
        let beta = std::array::from_fn(|c| if self.gamma[c] > 0.0 { gamma[c] / self.gamma[c] } else { 0.0 });
        self.p.axpby([1.0; 3], &self.s, beta);
        self.gamma = gamma;
        self.residual = self.r.norm_squared()?;
        self.applications += 2;
        Ok(())
    }

    fn solution(&self) -> &O::Domain {
        &self.x
    }

    fn measure(&self) -> Measure {
        Measure { residual: self.residual, normal_residual: self.gamma }
    }

    fn applications(&self) -> usize {
        self.applications
    }

    fn save(&self) -> Result<State> {
        let scalars =
            [self.gamma, self.start, self.residual, [self.iteration as f64, self.applications as f64, 0.0]];
        Ok(State {
            vectors: vec![self.x.to_host()?, self.p.to_host()?, self.r.to_host()?],
            scalars: scalars.concat(),
        })
    }

    fn restore(&mut self, state: &State) -> Result<()> {
        let ([x, p, r], [g0, g1, g2, s0, s1, s2, r0, r1, r2, iteration, applications, _]) =
            (&state.vectors[..], &state.scalars[..])
        else {
            return Err(Error::Shape { what: "a saved CGLS state", expected: 3, got: state.vectors.len() });
        };
        self.x.set_from_host(x)?;
        self.p.set_from_host(p)?;
        self.r.set_from_host(r)?;
        self.gamma = [*g0, *g1, *g2];
        self.start = [*s0, *s1, *s2];
        self.residual = [*r0, *r1, *r2];
        self.iteration = *iteration as usize;
        self.applications = *applications as usize;
        Ok(())
    }
}
