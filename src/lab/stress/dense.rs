//! Small dense problems in f64, for every method, and their solutions by factorization.

use nalgebra::{DMatrix, DVector};

use super::case::Setting;
use super::rows::{FAULT, RandomNumbers, worse};
use crate::Result;
use crate::march::{Traversal, Weight};
use crate::operator::{Bounds, CpuVector, LinearOperator};
use crate::problem::method;
use crate::scene::SolverName;
use crate::solve::{Beginning, Control, LeastSquares, Limits, Outcome, drive};

/// A dense matrix as an operator; a wrong one forgets something on the way to its range.
pub(super) struct DenseOperator {
    matrix: DMatrix<f64>,
    faulty: bool,
}

impl DenseOperator {
    /// The operator of a problem.
    pub(super) fn of(problem: &DenseProblem, setting: &Setting) -> Self {
        Self { matrix: problem.matrix.clone(), faulty: setting.faulty }
    }
}

impl LinearOperator for DenseOperator {
    type Domain = CpuVector<f64>;
    type Range = CpuVector<f64>;

    fn domain(&self) -> CpuVector<f64> {
        CpuVector::zeros(self.matrix.ncols())
    }

    fn range(&self) -> CpuVector<f64> {
        CpuVector::zeros(self.matrix.nrows())
    }

    fn apply(&self, x: &CpuVector<f64>, y: &mut CpuVector<f64>) -> Result<()> {
        y.0.fill([0.0; 3]);
        for (column, x) in self.matrix.column_iter().zip(&x.0) {
            for (weight, y) in column.iter().zip(&mut y.0) {
                (0..3).for_each(|c| y[c] += weight * x[c]);
            }
        }
        if self.faulty {
            y.0[0] = y.0[0].map(|value| FAULT * value + FAULT - 1.0);
        }
        Ok(())
    }

    fn apply_adjoint(&self, y: &CpuVector<f64>, x: &mut CpuVector<f64>) -> Result<()> {
        for (column, x) in self.matrix.column_iter().zip(&mut x.0) {
            *x = [0.0; 3];
            for (weight, y) in column.iter().zip(&y.0) {
                (0..3).for_each(|c| x[c] += weight * y[c]);
            }
        }
        Ok(())
    }
}

/// The rows of a dense matrix, to be walked.
#[derive(Debug)]
pub(super) struct Listed(pub(super) DMatrix<f64>);

impl<const C: usize> Traversal<f64, C> for Listed {
    fn rows(&self) -> usize {
        self.0.nrows()
    }

    fn elements(&self) -> usize {
        self.0.ncols()
    }

    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f64, C>)) {
        for (column, &weight) in self.0.row(row).iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
            visit(column, [weight; C]);
        }
    }
}

/// min ½‖A x − b‖², and where it starts.
pub(super) struct DenseProblem {
    pub(super) matrix: DMatrix<f64>,
    pub(super) b: Vec<[f64; 3]>,
    pub(super) x0: Vec<[f64; 3]>,
    pub(super) bounds: Bounds,
}

/// How a method ended there.
pub(super) struct Ended {
    pub(super) x: Vec<[f64; 3]>,
    pub(super) outcome: Outcome,
    /// The certificate as the method states it and as it is, the worst channel's, and what rounding makes of either.
    pub(super) claimed: f64,
    pub(super) truth: f64,
    pub(super) rounding: f64,
    /// ‖projected gradient‖ at the start, a channel.
    pub(super) at_start: [f64; 3],
}

impl DenseProblem {
    /// Runs a method on it, with the bounds where it keeps any.
    pub(super) fn run(&self, setting: &Setting, name: SolverName, limits: &Limits) -> Result<Ended> {
        let operator = DenseOperator::of(self, setting);
        let (b, x0) = (CpuVector(self.b.clone()), CpuVector(self.x0.clone()));
        let least_squares = LeastSquares::new(&operator, &b).bounded(self.bounds.clone());
        let mut method = method(name, &operator);
        let outcome =
            drive(&mut *method, &least_squares, Beginning::At(&x0), limits, |_, _| Ok(Control::Continue))?;
        Ok(self.judged(name, method.solution().0.clone(), outcome))
    }

    /// What is true of an x that a method has ended at.
    pub(super) fn judged(&self, name: SolverName, x: Vec<[f64; 3]>, outcome: Outcome) -> Ended {
        let bounds = if name.keeps_bounds() { self.bounds.clone() } else { Bounds::NONE };
        let at_start = self.gradient(&self.x0, &bounds);
        let at_end = self.gradient(&x, &bounds);
        let largest = at_start.iter().copied().fold(0.0, f64::max);
        let scale = at_start.map(|norm| norm.max(1e-6 * largest));
        let truth = (0..3).map(|c| at_end[c] / scale[c]).fold(0.0, worse);
        let norm = self.matrix.norm();
        let rounding = |c: usize| {
            let (x, b) = (channel(&x, c).norm(), channel(&self.b, c).norm());
            self.matrix.len() as f64 * f64::EPSILON * norm * (norm * x + b) / scale[c]
        };
        let rounding = (0..3).map(rounding).fold(0.0, worse);
        let claimed = outcome.true_normal_residual.into_iter().fold(0.0, worse);
        Ended { x, outcome, claimed, truth, rounding, at_start }
    }

    /// ‖b − A x‖ of a channel.
    pub(super) fn residual(&self, x: &[[f64; 3]], c: usize) -> f64 {
        (&self.matrix * channel(x, c) - channel(&self.b, c)).norm()
    }

    /// ‖Aᵀ (A x − b)‖ without what only the bounds hold back.
    fn gradient(&self, x: &[[f64; 3]], bounds: &Bounds) -> [f64; 3] {
        std::array::from_fn(|c| {
            let r = &self.matrix * channel(x, c) - channel(&self.b, c);
            let mut g = self.matrix.tr_mul(&r);
            for (index, slope) in g.iter_mut().enumerate() {
                let ([lower, upper], x) = (bounds.of(index), x[index][c]);
                if (x <= lower[c] && *slope > 0.0) || (x >= upper[c] && *slope < 0.0) {
                    *slope = 0.0;
                }
            }
            g.norm()
        })
    }
}

/// One channel of a vector.
pub(super) fn channel(x: &[[f64; 3]], c: usize) -> DVector<f64> {
    DVector::from_iterator(x.len(), x.iter().map(|x| x[c]))
}

/// Numbers from −1 to 1.
pub(super) fn random(rows: usize, columns: usize, seed: u64) -> DMatrix<f64> {
    let mut n = RandomNumbers(seed);
    DMatrix::from_fn(rows, columns, |_, _| n.uniform(-1.0, 1.0))
}

/// Colours from 0.5 to 2.
pub(super) fn colors(len: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut n = RandomNumbers(seed);
    (0..len).map(|_| std::array::from_fn(|_| n.uniform(0.5, 2.0))).collect()
}

/// A matrix whose singular values fall evenly, in the logarithm, from 1 to 1 / `condition`.
pub(super) fn conditioned(rows: usize, columns: usize, condition: f64, seed: u64) -> DMatrix<f64> {
    let last = (columns - 1).max(1) as f64;
    let value = |index: usize| condition.powf(-(index as f64) / last);
    let diagonal = DMatrix::from_diagonal(&DVector::from_fn(columns, |index, _| value(index)));
    let left = random(rows, columns, seed).qr().q();
    let right = random(columns, columns, seed + 1).qr().q();
    left * diagonal * right.transpose()
}

/// A X for the columns of X.
pub(super) fn image(matrix: &DMatrix<f64>, x: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let shown: [DVector<f64>; 3] = std::array::from_fn(|c| matrix * channel(x, c));
    (0..matrix.nrows()).map(|row| std::array::from_fn(|c| shown[c][row])).collect()
}
