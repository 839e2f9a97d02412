use super::TileMetric;
use super::rows::Chunk;
use super::transport::KeptRows;
use crate::Result;
use crate::march::{Real, Weight};
use crate::operator::{
    CpuVector, LinearOperator, MatrixRows, Metric, Picked, Storage, Tiling, TransportOperator, Vector,
    brought, expect_len, fetched,
};

/// `T` of some of the rows that another operator keeps.
///
/// Law     the rows are those of the other, to the bit
#[derive(Debug)]
struct PickedRows<F, const C: usize>(KeptRows<F, C>);

/// T of some rows; none where not all are kept.
pub(super) fn picked<F: Real, const C: usize>(
    kept: &KeptRows<F, C>,
    rows: &[usize],
) -> Option<Picked<CpuVector<F>, CpuVector<F>>> {
    let (rows, kept) = kept.picked(rows)?;
    Some(Picked { rows, operator: Box::new(PickedRows(kept)) })
}

impl<F: Real, const C: usize> TransportOperator for PickedRows<F, C> {
    fn squares(&self, weights: &CpuVector) -> Result<CpuVector> {
        expect_len("the weights", weights, self.0.rows())?;
        let weights = brought(CpuVector::zeros(weights.len()), &weights.0)?;
        let mut squares = self.domain();
        self.0.send(&weights, &mut squares, &|_| Vec::new(), Chunk::squares);
        Ok(CpuVector(fetched(&squares)?))
    }

    fn tile_metric(
        &self,
        tiling: &Tiling,
        weights: &[f64],
        added: &[f64],
    ) -> Result<Box<dyn Metric<CpuVector<F>>>> {
        Ok(Box::new(TileMetric::new(self, tiling, weights, added)?))
    }

    fn storage(&self) -> Storage {
        self.0.storage()
    }

    fn picked(&self, rows: &[usize]) -> Option<Picked<CpuVector<F>, CpuVector<F>>> {
        picked(&self.0, rows)
    }
}

impl<F: Real, const C: usize> MatrixRows<F, C> for PickedRows<F, C> {
    fn rows(&self) -> usize {
        self.0.rows()
    }

    fn visit(&self, row: usize, visit: &mut impl FnMut(usize, Weight<F, C>)) {
        self.0.visit(row, visit);
    }
}

impl<F: Real, const C: usize> LinearOperator for PickedRows<F, C> {
    type Domain = CpuVector<F>;
    type Range = CpuVector<F>;

    fn domain(&self) -> CpuVector<F> {
        CpuVector::zeros(self.0.elements())
    }

    fn range(&self) -> CpuVector<F> {
        CpuVector::zeros(self.0.rows())
    }

    fn apply(&self, x: &CpuVector<F>, y: &mut CpuVector<F>) -> Result<()> {
        expect_len("x", x, self.0.elements())?;
        expect_len("y", y, self.0.rows())?;
        self.0.gather(x, y, |_| ());
        Ok(())
    }

    fn apply_adjoint(&self, y: &CpuVector<F>, x: &mut CpuVector<F>) -> Result<()> {
        expect_len("x", x, self.0.elements())?;
        expect_len("y", y, self.0.rows())?;
        self.0.send(y, x, &|_| Vec::new(), Chunk::scatter);
        Ok(())
    }
}
