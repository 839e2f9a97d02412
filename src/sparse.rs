//! The explicit matrix in f64: what every backend is checked against.

use sprs::{CsMat, TriMat};

use crate::march::{Traversal, channel};
use crate::operator::{CpuVector, LinearOperator};
use crate::{Error, Result};

/// The matrix of a traversal, one channel after the other, in compressed rows of f64.
#[derive(Debug, Clone)]
pub struct ExplicitMatrix {
    /// One matrix for grey media, else one a channel.
    channels: Vec<CsMat<f64>>,
}

impl ExplicitMatrix {
    /// Walks every row once.
    ///
    /// Errors: [`Error::TooLarge`] for more non-zeros than `limit`.
    pub fn new<const C: usize>(traversal: &impl Traversal<f64, C>, limit: u64) -> Result<Self> {
        let shape = (traversal.rows(), traversal.elements());
        let mut triplets: Vec<TriMat<f64>> = (0..C).map(|_| TriMat::new(shape)).collect();
        for row in 0..shape.0 {
            traversal.walk_shared(row, &mut |element, weight| {
                for (c, triplets) in triplets.iter_mut().enumerate() {
                    triplets.add_triplet(row, element, channel(&weight, c));
                }
            });
            if triplets[0].nnz() as u64 > limit {
                return Err(Error::TooLarge {
                    what: "the explicit matrix".to_owned(),
                    needed: format!("more than {limit} non-zeros"),
                    limit: format!("{limit}"),
                    remedy: "lower the light map's size or paint fewer pixels",
                });
            }
        }
        Ok(Self { channels: triplets.iter().map(TriMat::to_csr).collect() })
    }

    /// The matrix of one channel.
    pub fn channel(&self, channel: usize) -> &CsMat<f64> {
        &self.channels[channel.min(self.channels.len() - 1)]
    }

    /// Whether all channels share one matrix.
    pub fn is_grey(&self) -> bool {
        self.channels.len() == 1
    }
}

impl LinearOperator for ExplicitMatrix {
    type Domain = CpuVector<f64>;
    type Range = CpuVector<f64>;

    fn domain(&self) -> CpuVector<f64> {
        CpuVector::zeros(self.channel(0).cols())
    }

    fn range(&self) -> CpuVector<f64> {
        CpuVector::zeros(self.channel(0).rows())
    }

    fn apply(&self, x: &CpuVector<f64>, y: &mut CpuVector<f64>) -> Result<()> {
        crate::operator::expect_len("x", x, self.channel(0).cols())?;
        crate::operator::expect_len("y", y, self.channel(0).rows())?;
        y.0.fill([0.0; 3]);
        for c in 0..3 {
            for (&weight, (row, element)) in self.channel(c) {
                y.0[row][c] += weight * x.0[element][c];
            }
        }
        Ok(())
    }

    fn apply_adjoint(&self, y: &CpuVector<f64>, x: &mut CpuVector<f64>) -> Result<()> {
        crate::operator::expect_len("x", x, self.channel(0).cols())?;
        crate::operator::expect_len("y", y, self.channel(0).rows())?;
        x.0.fill([0.0; 3]);
        for c in 0..3 {
            for (&weight, (row, element)) in self.channel(c) {
                x.0[element][c] += weight * y.0[row][c];
            }
        }
        Ok(())
    }
}
