//! The methods against dense factorizations and against SciPy, and the promises of their loop.

mod choice;
mod fixtures;
mod gauss_newton;
mod laws;
mod limits;
mod memory;
mod tiles;

use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::DMatrix;
use unscatter::Result;
use unscatter::operator::{CpuVector, LinearOperator, Scaling, Vector};
use unscatter::solve::{
    Beginning, Cgls, Control, Fista, FlexibleCgls, Lbfgs, LeastSquares, Limits, Lsmr, Lsqr, Method, Mprgp,
    Outcome, Spectral, drive,
};

use crate::scenes::Numbers;

/// A dense matrix as an operator that takes no memory when applied, and counts the vectors that are asked of it.
pub struct Dense {
    pub matrix: DMatrix<f64>,
    domains: AtomicUsize,
    ranges: AtomicUsize,
}

impl Dense {
    pub fn new(matrix: DMatrix<f64>) -> Self {
        Self { matrix, domains: AtomicUsize::new(0), ranges: AtomicUsize::new(0) }
    }

    /// Forgets the vectors that were asked for.
    pub fn count_anew(&self) {
        self.domains.store(0, Ordering::Relaxed);
        self.ranges.store(0, Ordering::Relaxed);
    }

    /// How many vectors of the domain and of the range were asked for.
    pub fn asked_for(&self) -> [usize; 2] {
        [&self.domains, &self.ranges].map(|count| count.load(Ordering::Relaxed))
    }

    /// |A|ᵀ |A| 1, which majorizes Aᵀ A.
    pub fn scaling(&self) -> Scaling<CpuVector<f64>> {
        let absolute = self.matrix.abs();
        let sums = absolute.transpose() * absolute.column_sum();
        Scaling::new(CpuVector(sums.iter().map(|&sum| [sum; 3]).collect()), true)
    }
}

impl LinearOperator for Dense {
    type Domain = CpuVector<f64>;
    type Range = CpuVector<f64>;

    fn domain(&self) -> CpuVector<f64> {
        self.domains.fetch_add(1, Ordering::Relaxed);
        CpuVector::zeros(self.matrix.ncols())
    }

    fn range(&self) -> CpuVector<f64> {
        self.ranges.fetch_add(1, Ordering::Relaxed);
        CpuVector::zeros(self.matrix.nrows())
    }

    fn apply(&self, x: &CpuVector<f64>, y: &mut CpuVector<f64>) -> Result<()> {
        for (row, y) in y.0.iter_mut().enumerate() {
            *y = [0.0; 3];
            for (column, x) in x.0.iter().enumerate() {
                (0..3).for_each(|c| y[c] += self.matrix[(row, column)] * x[c]);
            }
        }
        Ok(())
    }

    fn apply_adjoint(&self, y: &CpuVector<f64>, x: &mut CpuVector<f64>) -> Result<()> {
        for (column, x) in x.0.iter_mut().enumerate() {
            *x = [0.0; 3];
            for (row, y) in y.0.iter().enumerate() {
                (0..3).for_each(|c| x[c] += self.matrix[(row, column)] * y[c]);
            }
        }
        Ok(())
    }
}

pub type Made<O> = Box<dyn Method<O>>;

/// Methods that solve without bounds what they are given.
pub fn unbounded<O: LinearOperator + 'static>(operator: &O) -> Vec<Made<O>> {
    vec![Box::new(Cgls::new(operator)), Box::new(Lsqr::new(operator)), Box::new(Lsmr::new(operator))]
}

/// Methods that end at the solution within bounds.
pub fn bounded<O: LinearOperator + 'static>(operator: &O) -> Vec<Made<O>> {
    vec![
        Box::new(Fista::new(operator)),
        Box::new(Spectral::new(operator)),
        Box::new(Lbfgs::new(operator)),
        Box::new(Mprgp::new(operator)),
    ]
}

/// All of them, the two that need not end at the solution last.
pub fn all<O: LinearOperator + 'static>(operator: &O) -> Vec<Made<O>> {
    let mut methods = unbounded(operator);
    methods.extend(bounded(operator));
    methods.push(Box::new(FlexibleCgls::new(operator)));
    methods.push(Box::new(Cgls::clamped(operator)));
    methods
}

pub fn run<O: LinearOperator>(
    method: &mut dyn Method<O>,
    problem: &LeastSquares<O>,
    start: &O::Domain,
    limits: &Limits,
) -> Outcome {
    drive(method, problem, Beginning::At(start), limits, |_, _| Ok(Control::Continue)).unwrap()
}

pub fn random_matrix(rows: usize, columns: usize, seed: u64) -> DMatrix<f64> {
    let mut n = Numbers(seed | 1);
    DMatrix::from_fn(rows, columns, |_, _| n.uniform(-1.0, 1.0))
}

/// Right-hand sides that differ by channel.
pub fn rhs(rows: usize, seed: u64) -> CpuVector<f64> {
    let mut n = Numbers(seed.wrapping_add(99) | 1);
    CpuVector((0..rows).map(|_| std::array::from_fn(|_| n.uniform(-1.0, 1.0))).collect())
}

/// ½‖b − A x‖², a channel.
pub fn objective<O: LinearOperator>(problem: &LeastSquares<O>, x: &O::Domain) -> [f64; 3] {
    let mut r = problem.operator().range();
    problem.operator().apply(x, &mut r).unwrap();
    r.axpby([-1.0; 3], problem.rhs(), [1.0; 3]);
    r.norm_squared().unwrap().map(|square| 0.5 * square)
}
