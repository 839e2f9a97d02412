use std::fmt::Debug;

use super::{CpuVector, Indexed, LinearOperator, Metric, RowTable, TileBlocks, Tiling, Vector};
use crate::Result;
use crate::scene::Rgb;

/// How much of an operator is kept and how much is walked again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Storage {
    /// Rows whose non-zeros are kept.
    pub kept_rows: usize,
    /// Rows that are walked in every application.
    pub walked_rows: usize,
    /// Non-zeros of the kept rows; not those of rows that are walked.
    pub kept_nonzeros: u64,
    /// Bytes that the kept rows take.
    pub bytes: u64,
    /// Whether the rows are those of one factor of T: what light volumes scatter.
    pub of_light_volumes: bool,
}

/// `T` of a problem, wherever it is computed.
///
/// Elements and rows may be vectors of different types: rows may be distributed where every place has all elements.
pub trait TransportOperator: LinearOperator<Domain: Indexed + 'static, Range: 'static> + Sync {
    /// diag(Tᵀ diag(weights) T).
    ///
    /// Errors: [`crate::Error::Shape`] when there is not one weight a row.
    fn squares(&self, weights: &CpuVector) -> Result<CpuVector>;

    /// The metric of tiles for rows with these weights, and `added` on its diagonal.
    fn tile_metric(
        &self,
        tiling: &Tiling,
        weights: &[f64],
        added: &[f64],
    ) -> Result<Box<dyn Metric<Self::Domain>>>;

    /// How much of it is kept.
    fn storage(&self) -> Storage;

    /// T of some rows, made of what is kept. None where rows would have to be walked for that.
    fn picked(&self, _rows: &[usize]) -> Option<Picked<Self::Domain, Self::Range>> {
        None
    }
}

/// `T` of some rows of another one, and of those that are kept together with them.
pub struct Picked<V, R> {
    /// Which rows of the other it has, in their order.
    pub rows: Vec<usize>,
    /// T of them.
    pub operator: Box<dyn TransportOperator<Domain = V, Range = R> + Send + Sync>,
}

/// `T` on the processor, whatever its rows are.
pub type OnHost<F = f32> =
    Box<dyn TransportOperator<Domain = CpuVector<F>, Range = CpuVector<F>> + Send + Sync>;

impl<O: TransportOperator + ?Sized> TransportOperator for Box<O> {
    fn squares(&self, weights: &CpuVector) -> Result<CpuVector> {
        (**self).squares(weights)
    }

    fn tile_metric(
        &self,
        tiling: &Tiling,
        weights: &[f64],
        added: &[f64],
    ) -> Result<Box<dyn Metric<Self::Domain>>> {
        (**self).tile_metric(tiling, weights, added)
    }

    fn storage(&self) -> Storage {
        (**self).storage()
    }

    fn picked(&self, rows: &[usize]) -> Option<Picked<Self::Domain, Self::Range>> {
        (**self).picked(rows)
    }
}

/// `T` applied to what is on the host, wherever it is computed.
pub trait FromHost {
    /// T x of elements on the host.
    fn shown(&self, x: &[Rgb]) -> Result<Vec<Rgb>>;

    /// Tᵀ y of rows on the host.
    fn arriving(&self, y: &[Rgb]) -> Result<Vec<Rgb>>;
}

impl<O: TransportOperator> FromHost for O {
    fn shown(&self, x: &[Rgb]) -> Result<Vec<Rgb>> {
        let (x, mut y) = (brought(self.domain(), x)?, self.range());
        self.apply(&x, &mut y)?;
        fetched(&y)
    }

    fn arriving(&self, y: &[Rgb]) -> Result<Vec<Rgb>> {
        let (y, mut x) = (brought(self.range(), y)?, self.domain());
        self.apply_adjoint(&y, &mut x)?;
        fetched(&x)
    }
}

/// Rows of `T` on the host, for whoever computes elsewhere.
pub trait HostRows: Debug + Send + Sync {
    /// Their non-zeros, row by row, each row's in the order in which the host has them.
    fn table(&self) -> RowTable;

    /// diag(Tᵀ diag(weights) T).
    ///
    /// Errors: [`crate::Error::Shape`] when there is not one weight a row.
    fn squares(&self, weights: &CpuVector) -> Result<CpuVector>;

    /// The blocks of the metric of tiles for rows with these weights, and `added` on its diagonal.
    ///
    /// Errors: [`crate::Error::Shape`] when there is not one weight a row, or not one addition an unknown.
    fn tiles(&self, tiling: &Tiling, weights: &[f64], added: &[f64]) -> Result<Box<dyn TileBlocks>>;
}

/// Colours of the host in a vector that lives elsewhere.
pub(crate) fn brought<V: Vector>(mut vector: V, colors: &[Rgb]) -> Result<V> {
    let wide: Vec<[f64; 3]> = colors.iter().map(|color| color.map(f64::from)).collect();
    vector.set_from_host(&wide)?;
    Ok(vector)
}

/// The colours of a vector, on the host.
pub(crate) fn fetched(vector: &impl Vector) -> Result<Vec<Rgb>> {
    Ok(vector.to_host()?.into_iter().map(|color| color.map(|value| value as f32)).collect())
}
