//! Methods for `min ½‖A x − b‖²`, one file each, and the loop that drives them.
//!
//! A method knows operators and vectors and nothing else. The loop owns what all methods share: when to
//! stop, the history, and the check of the recursive residual against the true one.

mod cgls;
mod drive;

pub use cgls::Cgls;
pub use drive::{Control, History, Limits, Outcome, Progress, Stop, StopReason, drive};

use crate::Result;
use crate::operator::{LinearOperator, Scalars};

/// `min ½‖A x − b‖²`, channel by channel.
#[derive(Debug)]
pub struct LeastSquares<'a, O: LinearOperator> {
    /// A: the weighted transport stacked on its regularizers.
    pub operator: &'a O,
    /// b: the weighted targets stacked on what the regularizers pull to.
    pub rhs: &'a O::Range,
}

impl<O: LinearOperator> LeastSquares<'_, O> {
    /// r ← b − A x.
    pub fn residual(&self, x: &O::Domain, r: &mut O::Range) -> Result<()> {
        use crate::operator::Vector;
        self.operator.apply(x, r)?;
        r.axpby([1.0; 3], self.rhs, [-1.0; 3]);
        Ok(())
    }
}

/// How far a method is: squared norms of its residuals, channel by channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measure {
    /// ‖b − A x‖².
    pub residual: Scalars,
    /// ‖Aᵀ (b − A x)‖².
    pub normal_residual: Scalars,
}

/// Everything that a method needs to go on as if it had never stopped.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct State {
    /// Its vectors, in an order of its own.
    pub vectors: Vec<Vec<[f64; 3]>>,
    /// Its scalars, in an order of its own.
    pub scalars: Vec<f64>,
}

/// An iterative method.
pub trait Method<O: LinearOperator> {
    /// What it is called in commands and reports.
    fn name(&self) -> &'static str;

    /// Begins, or begins again, at `x`.
    fn begin(&mut self, problem: &LeastSquares<O>, x: &O::Domain) -> Result<()>;

    /// One iteration.
    ///
    /// Errors: [`crate::Error::Curvature`] when the operator and its adjoint do not match.
    fn step(&mut self, problem: &LeastSquares<O>) -> Result<()>;

    /// Where it is.
    fn solution(&self) -> &O::Domain;

    /// What it believes its residuals to be.
    fn measure(&self) -> Measure;

    /// Applications of A and of Aᵀ since it was made, each counted as one.
    fn applications(&self) -> usize;

    /// What [`Method::restore`] needs to continue bit by bit.
    fn save(&self) -> Result<State>;

    /// Continues from a saved state.
    ///
    /// Errors: [`crate::Error::Shape`] when it is the state of another method or problem.
    fn restore(&mut self, state: &State) -> Result<()>;
}
