use rayon::prelude::*;

use super::products::{Padded, padded};
use crate::march::Weight;
use crate::operator::{CpuVector, LinearOperator, MatrixRows, expect_len};
use crate::{Error, Result};

/// Rows that one task adds up: their number depends on the problem alone, so the sums do too.
const PIECE: usize = 2048;
/// Products that are added up in f32 before their sum is added in f64.
const RUN: usize = 32;

/// A matrix with few columns whose entries are all kept: rows are rays or voxels, columns are lights.
///
/// Shapes  x: columns, y: rows, three channels each; an entry has one weight for all channels, or one a channel
/// Memory  4 C bytes an entry
/// Error   f32 products, summed in f64 every 32 terms: 1e-6 of Σ|terms|
/// Cost    one multiplication an entry and channel; bit-identical for any number of threads
#[derive(Debug, Clone)]
pub struct Dense<const C: usize> {
    rows: usize,
    columns: usize,
    /// Row by row.
    weights: Vec<Weight<f32, C>>,
}

impl<const C: usize> Dense<C> {
    /// Errors: [`Error::Shape`] when there are not so many entries.
    pub fn new(rows: usize, columns: usize, weights: Vec<Weight<f32, C>>) -> Result<Self> {
        if weights.len() != rows * columns {
            return Err(Error::Shape { what: "a matrix", expected: rows * columns, got: weights.len() });
        }
        Ok(Self { rows, columns, weights })
    }

    /// Bytes of so many rows and columns.
    pub fn bytes(rows: usize, columns: usize) -> u64 {
        rows as u64 * columns as u64 * size_of::<Weight<f32, C>>() as u64
    }

    /// Whether every entry is zero.
    pub fn is_zero(&self) -> bool {
        self.weights.par_iter().all(|weight| *weight == [0.0; C])
    }

    /// The entries of a row.
    #[inline(always)]
    pub fn row(&self, row: usize) -> &[Weight<f32, C>] {
        &self.weights[row * self.columns..(row + 1) * self.columns]
    }

    /// x ← Σ of entries times y over the rows, in pieces that are added up in their order.
    fn sum_rows(&self, y: &CpuVector, x: &mut CpuVector) {
        let starts: Vec<usize> = (0..self.rows).step_by(PIECE).collect();
        let pieces: Vec<Vec<[f64; 3]>> = starts.par_iter().map(|&start| self.sum_piece(start, y)).collect();
        x.0.par_iter_mut().enumerate().for_each(|(column, x)| {
            let mut sum = [0.0; 3];
            for piece in &pieces {
                (0..3).for_each(|c| sum[c] += piece[column][c]);
            }
            *x = sum.map(|value| value as f32);
        });
    }

    fn sum_piece(&self, start: usize, y: &CpuVector) -> Vec<[f64; 3]> {
        let mut sums = vec![[0.0f64; 3]; self.columns];
        let mut run: Vec<Padded<f32>> = vec![[0.0; 4]; self.columns];
        let end = (start + PIECE).min(self.rows);
        for first in (start..end).step_by(RUN) {
            run.fill([0.0; 4]);
            for row in first..(first + RUN).min(end) {
                let y = padded(y.0[row]);
                for (sum, weight) in run.iter_mut().zip(self.row(row)) {
                    let weight = four(weight);
                    (0..4).for_each(|c| sum[c] += weight[c] * y[c]);
                }
            }
            for (sum, run) in sums.iter_mut().zip(&run) {
                (0..3).for_each(|c| sum[c] += f64::from(run[c]));
            }
        }
        sums
    }
}

/// A weight for each channel and the padding.
#[inline(always)]
fn four<const C: usize>(weight: &Weight<f32, C>) -> Padded<f32> {
    if C == 1 { [weight[0]; 4] } else { [weight[0], weight[1], weight[2], 0.0] }
}

impl<const C: usize> MatrixRows<f32, C> for Dense<C> {
    fn rows(&self) -> usize {
        self.rows
    }

    fn visit(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f32, C>)) {
        for (column, weight) in self.row(row).iter().enumerate() {
            if weight.iter().any(|&weight| weight != 0.0) {
                visit(column, *weight);
            }
        }
    }
}

impl<const C: usize> LinearOperator for Dense<C> {
    type Domain = CpuVector;
    type Range = CpuVector;

    fn domain(&self) -> CpuVector {
        CpuVector::zeros(self.columns)
    }

    fn range(&self) -> CpuVector {
        CpuVector::zeros(self.rows)
    }

    fn apply(&self, x: &CpuVector, y: &mut CpuVector) -> Result<()> {
        expect_len("x", x, self.columns)?;
        expect_len("y", y, self.rows)?;
        let x: Vec<Padded<f32>> = x.0.iter().map(|&x| padded(x)).collect();
        y.0.par_iter_mut().enumerate().with_min_len(64).for_each(|(row, y)| {
            let mut sum = [0.0f64; 3];
            for (weights, x) in self.row(row).chunks(RUN).zip(x.chunks(RUN)) {
                let mut run = [0.0f32; 4];
                for (weight, x) in weights.iter().zip(x) {
                    let weight = four(weight);
                    (0..4).for_each(|c| run[c] += weight[c] * x[c]);
                }
                (0..3).for_each(|c| sum[c] += f64::from(run[c]));
            }
            *y = sum.map(|value| value as f32);
        });
        Ok(())
    }

    fn apply_adjoint(&self, y: &CpuVector, x: &mut CpuVector) -> Result<()> {
        expect_len("x", x, self.columns)?;
        expect_len("y", y, self.rows)?;
        self.sum_rows(y, x);
        Ok(())
    }
}
