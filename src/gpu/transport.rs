use super::rows::Kept;
use super::vector::GpuVector;
use super::walked::Walked;
use crate::Result;
use crate::operator::{Added, LinearOperator, Product};

/// `T` on a device: kept, a product or a sum with what is kept, or walked again in every application.
#[derive(Debug)]
pub enum Transport {
    /// Rows and columns of non-zeros.
    Kept(Kept),
    /// Rays.
    Walked(Walked),
    /// Rays over a light map, and what their rows show beside it.
    Added(Box<Added<Walked, Kept>>),
    /// Light volumes, of what is kept.
    Product(Box<Product<Kept, Kept, Kept>>),
}

impl Transport {
    fn operator(&self) -> &dyn LinearOperator<Domain = GpuVector, Range = GpuVector> {
        match self {
            Self::Kept(kept) => kept,
            Self::Walked(walked) => walked,
            Self::Added(added) => &**added,
            Self::Product(product) => &**product,
        }
    }
}

impl LinearOperator for Transport {
    type Domain = GpuVector;
    type Range = GpuVector;

    fn domain(&self) -> GpuVector {
        self.operator().domain()
    }

    fn range(&self) -> GpuVector {
        self.operator().range()
    }

    fn apply(&self, x: &GpuVector, y: &mut GpuVector) -> Result<()> {
        self.operator().apply(x, y)
    }

    fn apply_adjoint(&self, y: &GpuVector, x: &mut GpuVector) -> Result<()> {
        self.operator().apply_adjoint(y, x)
    }
}
