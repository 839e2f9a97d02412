use super::rows::Kept;
use super::vector::GpuVector;
use super::walked::Walked;
use crate::Result;
use crate::operator::LinearOperator;

/// `T` on a device: kept, or walked again in every application.
#[derive(Debug)]
pub enum Transport {
    /// Rows and columns of non-zeros.
    Kept(Kept),
    /// Rays.
    Walked(Walked),
}

impl Transport {
    /// x ← diag(Tᵀ diag(y) T): with constraint weights for y the coverage.
    ///
    /// Errors: [`crate::Error::Shape`] when a vector does not fit, and what has gone wrong on the device.
    pub fn squares(&self, y: &GpuVector, x: &mut GpuVector) -> Result<()> {
        match self {
            Self::Kept(kept) => kept.squares(y, x),
            Self::Walked(walked) => walked.squares(y, x),
        }
    }
}

impl LinearOperator for Transport {
    type Domain = GpuVector;
    type Range = GpuVector;

    fn domain(&self) -> GpuVector {
        match self {
            Self::Kept(kept) => kept.domain(),
            Self::Walked(walked) => walked.domain(),
        }
    }

    fn range(&self) -> GpuVector {
        match self {
            Self::Kept(kept) => kept.range(),
            Self::Walked(walked) => walked.range(),
        }
    }

    fn apply(&self, x: &GpuVector, y: &mut GpuVector) -> Result<()> {
        match self {
            Self::Kept(kept) => kept.apply(x, y),
            Self::Walked(walked) => walked.apply(x, y),
        }
    }

    fn apply_adjoint(&self, y: &GpuVector, x: &mut GpuVector) -> Result<()> {
        match self {
            Self::Kept(kept) => kept.apply_adjoint(y, x),
            Self::Walked(walked) => walked.apply_adjoint(y, x),
        }
    }
}
