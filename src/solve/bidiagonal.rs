//! Golub–Kahan bidiagonalization: A V = U B, the common part of LSQR, LSMR and the choice of λ.
//!
//! Source  Golub and Kahan 1965; Paige and Saunders 1982, "Bidiag 1".

use super::{LeastSquares, each};
use crate::Result;
use crate::operator::{LinearOperator, Scalars, Vector};

/// The two vectors from which the next are made, and the two numbers of the present column of B.
pub(super) struct Bidiagonal<O: LinearOperator> {
    /// β u = A v − α u: of length 1.
    pub(super) u: O::Range,
    /// α v = Aᵀ u − β v: of length 1.
    pub(super) v: O::Domain,
    image: O::Range,
    back: O::Domain,
    pub(super) alpha: Scalars,
    pub(super) beta: Scalars,
}

impl<O: LinearOperator> std::fmt::Debug for Bidiagonal<O> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bidiagonal")
            .field("alpha", &self.alpha)
            .field("beta", &self.beta)
            .finish_non_exhaustive()
    }
}

impl<O: LinearOperator> Bidiagonal<O> {
    pub(super) fn new(operator: &O) -> Self {
        Self {
            u: operator.range(),
            v: operator.domain(),
            image: operator.range(),
            back: operator.domain(),
            alpha: [0.0; 3],
            beta: [0.0; 3],
        }
    }

    /// β u = b − A x, α v = Aᵀ u.
    pub(super) fn begin(&mut self, problem: &LeastSquares<O>, x: &O::Domain) -> Result<()> {
        problem.residual(x, &mut self.u)?;
        self.beta = normalized(&mut self.u)?;
        problem.apply_adjoint(&self.u, &mut self.v)?;
        self.alpha = normalized(&mut self.v)?;
        Ok(())
    }

    /// The next u, β, v and α.
    pub(super) fn step(&mut self, problem: &LeastSquares<O>) -> Result<()> {
        problem.apply(&self.v, &mut self.image)?;
        self.u.axpby([1.0; 3], &self.image, self.alpha.map(|alpha| -alpha));
        self.beta = normalized(&mut self.u)?;
        problem.apply_adjoint(&self.u, &mut self.back)?;
        self.v.axpby([1.0; 3], &self.back, self.beta.map(|beta| -beta));
        self.alpha = normalized(&mut self.v)?;
        Ok(())
    }
}

/// Divides a vector by its norm, which is returned; zero stays zero.
pub(super) fn normalized<V: Vector>(vector: &mut V) -> Result<Scalars> {
    let norm = vector.norm_squared()?.map(f64::sqrt);
    vector.scale(each(|c| if norm[c] > 0.0 { 1.0 / norm[c] } else { 0.0 }));
    Ok(norm)
}
