//! LSQR: least squares by Golub–Kahan bidiagonalization.
//!
//! Problem       min ½‖A x − b‖².
//! Equivalences  In exact arithmetic the iterates are those of CGLS without a scaling.
//! Caveats       More reliable than CGLS where A is ill-conditioned, for one more vector. It knows ‖b − A x‖ and
//!               ‖Aᵀ (b − A x)‖ by recurrences, not b − A x itself. Elements outside the row space keep their start.
//! Source        Paige and Saunders 1982, sec. 4 and 5.1.

use super::bidiagonal::Bidiagonal;
use super::{LeastSquares, Live, Measure, Method, MethodMemory, Vectors, each, ratio};
use crate::Result;
use crate::operator::{LinearOperator, Scalars, Vector};

/// Least squares by bidiagonalization, with the residual falling monotonically.
#[derive(Debug)]
pub struct Lsqr<O: LinearOperator> {
    bidiagonal: Bidiagonal<O>,
    x: O::Domain,
    /// The search direction.
    w: O::Domain,
    phi_bar: Scalars,
    rho_bar: Scalars,
    residual: Scalars,
    normal_residual: Scalars,
}

impl<O: LinearOperator> Lsqr<O> {
    /// The vectors that it keeps.
    pub const VECTORS: Vectors = Vectors { domain: 4, range: 2 };

    /// The method for problems of this operator's shape.
    pub fn new(operator: &O) -> Self {
        Self {
            bidiagonal: Bidiagonal::new(operator),
            x: operator.domain(),
            w: operator.domain(),
            phi_bar: [0.0; 3],
            rho_bar: [0.0; 3],
            residual: [0.0; 3],
            normal_residual: [0.0; 3],
        }
    }
}

impl<O: LinearOperator> Method<O> for Lsqr<O> {
    fn name(&self) -> &'static str {
        "lsqr"
    }

    fn keeps_bounds(&self) -> bool {
        false
    }

    fn vectors(&self) -> Vectors {
        Self::VECTORS
    }

    fn begin(&mut self, problem: &LeastSquares<O>, x: &O::Domain) -> Result<()> {
        self.x.copy_from(x);
        self.bidiagonal.begin(problem, &self.x)?;
        self.w.copy_from(&self.bidiagonal.v);
        (self.phi_bar, self.rho_bar) = (self.bidiagonal.beta, self.bidiagonal.alpha);
        self.residual = self.phi_bar.map(|phi| phi * phi);
        self.normal_residual = each(|c| (self.phi_bar[c] * self.rho_bar[c]).powi(2));
        Ok(())
    }

    fn step(&mut self, problem: &LeastSquares<O>, live: Live) -> Result<()> {
        self.bidiagonal.step(problem)?;
        let Bidiagonal { alpha, beta, v, .. } = &self.bidiagonal;
        let rho = each(|c| self.rho_bar[c].hypot(beta[c]));
        let (cos, sin) = (ratio(self.rho_bar, rho), ratio(*beta, rho));
        let theta = each(|c| sin[c] * alpha[c]);
        let phi = each(|c| cos[c] * self.phi_bar[c]);
        let step = ratio(phi, rho);
        self.x.axpby(each(|c| if live[c] { step[c] } else { 0.0 }), &self.w, [1.0; 3]);
        self.w.axpby([1.0; 3], v, ratio(theta, rho).map(|ratio| -ratio));
        for c in (0..3).filter(|&c| live[c]) {
            self.rho_bar[c] = -cos[c] * alpha[c];
            self.phi_bar[c] *= sin[c];
            self.residual[c] = self.phi_bar[c].powi(2);
            self.normal_residual[c] = (self.phi_bar[c] * alpha[c] * cos[c]).powi(2);
        }
        Ok(())
    }

    fn solution(&self) -> &O::Domain {
        &self.x
    }

    fn measure(&self) -> Measure {
        Measure { residual: self.residual, normal_residual: self.normal_residual }
    }

    fn residual(&self) -> Option<&O::Range> {
        None
    }

    fn memory(&mut self) -> MethodMemory<'_, O> {
        MethodMemory {
            domain: vec![&mut self.x, &mut self.w, &mut self.bidiagonal.v],
            range: vec![&mut self.bidiagonal.u],
            scalars: vec![
                &mut self.bidiagonal.alpha,
                &mut self.bidiagonal.beta,
                &mut self.phi_bar,
                &mut self.rho_bar,
                &mut self.residual,
                &mut self.normal_residual,
            ],
        }
    }
}
