use std::fmt::Debug;

use super::picked::picked;
use super::{Mixed, TileMetric, Transport};
use crate::Result;
use crate::march::{Real, Traversal};
use crate::operator::{
    CpuVector, HostRows, LinearOperator, Metric, Picked, RowTable, Storage, TileBlocks, Tiling,
    TransportOperator, Vector, WalkPlan, brought, fetched,
};
use crate::scene::Strategy;

/// Does the same with any kind.
macro_rules! of_any {
    ($operator:expr, $transport:ident => $done:expr) => {
        match $operator {
            HostOperator::Grey($transport) => $done,
            HostOperator::Colored($transport) => $done,
            HostOperator::Mixed($transport) => $done,
        }
    };
}

/// `T` of a traversal on the processor. Solutions in f32 are measured against the same in f64.
#[derive(Debug)]
pub enum HostOperator<T, F = f32> {
    /// One weight for all three channels.
    Grey(Transport<T, F, 1>),
    /// One weight a channel.
    Colored(Transport<T, F, 3>),
    /// One weight a channel in some rows.
    Mixed(Mixed<T, F>),
}

impl<T: Traversal<f64, 1> + Traversal<f64, 3>, F: Real> HostOperator<T, F> {
    /// Keeps as many rows as `strategy` and the `budget` in bytes ask for; one weight serves all channels of grey rows. The plan
    /// must be of the same traversal.
    ///
    /// Errors: [`crate::Error::TooLarge`] when all rows must be kept and do not fit.
    pub fn new(
        traversal: T,
        is_grey: bool,
        plan: &WalkPlan,
        strategy: Strategy,
        budget: u64,
    ) -> Result<Self> {
        Ok(if is_grey {
            Self::Grey(Transport::new(traversal, plan, strategy, budget)?)
        } else {
            Self::Colored(Transport::new(traversal, plan, strategy, budget)?)
        })
    }
}

impl<T: Traversal<f64, 1> + Traversal<f64, 3>, F: Real> TransportOperator for HostOperator<T, F> {
    fn squares(&self, weights: &CpuVector) -> Result<CpuVector> {
        let weights = brought(CpuVector::zeros(weights.len()), &weights.0)?;
        let squares = of_any!(self, transport => transport.squares(&weights));
        Ok(CpuVector(fetched(&squares?)?))
    }

    fn tile_metric(
        &self,
        tiling: &Tiling,
        weights: &[f64],
        added: &[f64],
    ) -> Result<Box<dyn Metric<CpuVector<F>>>> {
        Ok(of_any!(self, transport => Box::new(TileMetric::new(transport, tiling, weights, added)?)))
    }

    fn storage(&self) -> Storage {
        of_any!(self, transport => transport.storage())
    }

    fn picked(&self, rows: &[usize]) -> Option<Picked<CpuVector<F>, CpuVector<F>>> {
        match self {
            Self::Grey(transport) => picked(transport.kept(), rows),
            Self::Colored(transport) => picked(transport.kept(), rows),
            // The rows of two kinds would have to be put in one order.
            Self::Mixed(_) => None,
        }
    }
}

impl<T> HostRows for HostOperator<T>
where
    T: Traversal<f64, 1> + Traversal<f64, 3> + Debug + Send,
{
    fn table(&self) -> RowTable {
        of_any!(self, transport => RowTable::of(transport))
    }

    fn squares(&self, weights: &CpuVector) -> Result<CpuVector> {
        TransportOperator::squares(self, weights)
    }

    fn tiles(&self, tiling: &Tiling, weights: &[f64], added: &[f64]) -> Result<Box<dyn TileBlocks>> {
        Ok(of_any!(self, transport => Box::new(TileMetric::new(transport, tiling, weights, added)?)))
    }
}

impl<T: Traversal<f64, 1> + Traversal<f64, 3>, F: Real> LinearOperator for HostOperator<T, F> {
    type Domain = CpuVector<F>;
    type Range = CpuVector<F>;

    fn domain(&self) -> CpuVector<F> {
        of_any!(self, transport => transport.domain())
    }

    fn range(&self) -> CpuVector<F> {
        of_any!(self, transport => transport.range())
    }

    fn apply(&self, x: &CpuVector<F>, y: &mut CpuVector<F>) -> Result<()> {
        of_any!(self, transport => transport.apply(x, y))
    }

    fn apply_adjoint(&self, y: &CpuVector<F>, x: &mut CpuVector<F>) -> Result<()> {
        of_any!(self, transport => transport.apply_adjoint(y, x))
    }
}
