//! Methods for `min ½‖A x − b‖², l ≤ x ≤ u`, one file each, and the loop that drives them.
//!
//! A method knows operators and vectors and nothing else. The loop owns what all methods share: when to
//! stop, the history, and the check of what the method believes against the truth.
//!
//! | method | bounds | metric | idea |
//! |---|---|---|---|
//! | [`Fista`] | yes | any | projected gradient with momentum and restart |
//! | [`Spectral`] | yes | diagonal | projected gradient with Barzilai–Borwein steps |
//! | [`Lbfgs`] | yes | diagonal | quasi-Newton on the free elements |
//! | [`Mprgp`] | yes | diagonal | conjugate gradients on a face, projected steps between faces |
//! | [`FlexibleCgls`] | yes | none | conjugate gradients scaled by the distance to the bounds |
//! | [`Cgls::clamped`] | yes | any | the papers' variant, for comparison; need not converge |
//! | [`Cgls`] | no | any | conjugate gradients on the normal equations |
//! | [`Lsqr`] | no | none | Golub–Kahan bidiagonalization, least ‖b − A x‖ |
//! | [`Lsmr`] | no | none | the same, least ‖Aᵀ(b − A x)‖ |
//!
//! [`gauss_newton`] solves what is not linear by problems that are.

mod bidiagonal;
mod cgls;
mod choose;
mod correction;
mod drive;
mod fista;
mod flexible;
mod gauss_newton;
mod iterate;
mod lbfgs;
mod least_squares;
mod lsmr;
mod lsqr;
mod mprgp;
mod spectral;
mod stop;

pub use cgls::Cgls;
pub use choose::{Rule, Term, choose_weight};
pub use correction::Correction;
pub use drive::{Beginning, History, Outcome, Progress, drive};
pub use fista::Fista;
pub use flexible::FlexibleCgls;
pub use gauss_newton::{GaussNewton, Looked, NonLinear, Taken, gauss_newton};
pub use lbfgs::Lbfgs;
pub use least_squares::{LeastSquares, Misfit};
pub use lsmr::Lsmr;
pub use lsqr::Lsqr;
pub use mprgp::Mprgp;
pub use spectral::Spectral;
pub use stop::{Control, Ending, Limits, Progressing, StopReason, is_mostly_noise};

use crate::operator::{LinearOperator, Scalars, Vector};
use crate::{Error, Result};

/// How far a method is: squared norms, channel by channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measure {
    /// ‖b − A x‖².
    pub residual: Scalars,
    /// ‖Aᵀ (b − A x)‖², without the parts that only the bounds hold back: the KKT residual, zero at a solution.
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

/// How many vectors a method keeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Vectors {
    /// Like x.
    pub domain: usize,
    /// Like b.
    pub range: usize,
}

impl Vectors {
    /// Both together.
    pub fn and(self, other: Self) -> Self {
        Self { domain: self.domain + other.domain, range: self.range + other.range }
    }
}

/// What of a method lives from one iteration to the next.
#[derive(Debug)]
pub struct MethodMemory<'a, O: LinearOperator> {
    /// Vectors of the shape of x.
    pub domain: Vec<&'a mut O::Domain>,
    /// Vectors of the shape of b.
    pub range: Vec<&'a mut O::Range>,
    /// Scalars, a number a channel each.
    pub scalars: Vec<&'a mut Scalars>,
}

/// An iterative method. It is made by the caller, once for any number of problems of one shape, and owns its vectors;
/// neither `begin` nor `step` takes memory.
pub trait Method<O: LinearOperator> {
    /// What it is called in commands and reports.
    fn name(&self) -> &'static str;

    /// Whether it keeps the bounds of the problem; if not it solves the problem without them.
    fn keeps_bounds(&self) -> bool;

    /// The vectors that it keeps.
    fn vectors(&self) -> Vectors;

    /// Begins, or begins again, at `x`; a method that keeps bounds moves it into them first.
    ///
    /// Errors: those of the operator and its vectors.
    fn begin(&mut self, problem: &LeastSquares<O>, x: &O::Domain) -> Result<()>;

    /// One iteration; channels that are not live keep their x.
    ///
    /// Errors: [`Error::Curvature`] when the operator and its adjoint do not match.
    fn step(&mut self, problem: &LeastSquares<O>, live: Live) -> Result<()>;

    /// Where it is.
    fn solution(&self) -> &O::Domain;

    /// What it believes its residuals to be.
    fn measure(&self) -> Measure;

    /// b − A x, where it keeps that.
    fn residual(&self) -> Option<&O::Range>;

    /// What [`save`] writes and [`restore`] reads.
    fn memory(&mut self) -> MethodMemory<'_, O>;
}

/// Which channels are still worked on.
pub type Live = [bool; 3];

/// 1 where `yes`, else 0: factors that choose channels.
fn chosen(yes: Live) -> Scalars {
    yes.map(|yes| if yes { 1.0 } else { 0.0 })
}

/// A number a channel.
fn each(number: impl FnMut(usize) -> f64) -> Scalars {
    std::array::from_fn(number)
}

/// a / b, and 0 where b is 0.
fn ratio(a: Scalars, b: Scalars) -> Scalars {
    each(|c| if b[c] == 0.0 { 0.0 } else { a[c] / b[c] })
}

/// The state of a method.
///
/// Errors: those of fetching its vectors from where they are.
pub fn save<O: LinearOperator>(method: &mut (impl Method<O> + ?Sized)) -> Result<State> {
    let mut vectors = Vec::new();
    hand_out(method, &mut |vector| {
        vectors.push(vector);
        Ok(())
    })?;
    Ok(State { vectors, scalars: outline(method).1 })
}

/// The lengths of the vectors of a method's state, and its scalars.
pub fn outline<O: LinearOperator>(method: &mut (impl Method<O> + ?Sized)) -> (Vec<usize>, Vec<f64>) {
    let MethodMemory { domain, range, scalars } = method.memory();
    let lengths = domain.iter().map(|vector| vector.len()).chain(range.iter().map(|vector| vector.len()));
    (lengths.collect(), scalars.iter().flat_map(|scalars| **scalars).collect())
}

/// Gives the vectors of a method's state away, one after the other, so that no more than one need be on the host.
///
/// Errors: those of fetching them from where they are, and of `put`.
pub fn hand_out<O: LinearOperator>(
    method: &mut (impl Method<O> + ?Sized),
    put: &mut dyn FnMut(Vec<[f64; 3]>) -> Result<()>,
) -> Result<()> {
    let MethodMemory { domain, range, .. } = method.memory();
    domain.iter().try_for_each(|vector| put(vector.to_host()?))?;
    range.iter().try_for_each(|vector| put(vector.to_host()?))
}

/// Puts a method where [`save`] found it; it then continues bit by bit.
///
/// Errors: [`Error::Shape`] when it is the state of another method or problem.
pub fn restore<O: LinearOperator>(method: &mut (impl Method<O> + ?Sized), state: &State) -> Result<()> {
    let MethodMemory { domain, range, scalars } = method.memory();
    let expect = |what, expected, got| {
        if expected == got { Ok(()) } else { Err(Error::Shape { what, expected, got }) }
    };
    expect("a saved state (vectors)", domain.len() + range.len(), state.vectors.len())?;
    expect("a saved state (scalars)", 3 * scalars.len(), state.scalars.len())?;
    let (for_domain, for_range) = state.vectors.split_at(domain.len());
    for (vector, saved) in domain.into_iter().zip(for_domain) {
        vector.set_from_host(saved)?;
    }
    for (vector, saved) in range.into_iter().zip(for_range) {
        vector.set_from_host(saved)?;
    }
    for (scalars, saved) in scalars.into_iter().zip(state.scalars.as_chunks::<3>().0) {
        *scalars = *saved;
    }
    Ok(())
}
