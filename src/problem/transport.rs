use crate::Result;
use crate::cpu::{Storage, TileMetric, Tiling, Transport, WalkPlan};
use crate::march::{LightMapTraversal, Real, Traversal};
use crate::operator::{CpuVector, Indexed, LinearOperator, Metric, Vector};
use crate::scene::{Rgb, Strategy};

/// `T` of a problem, wherever it is computed.
pub trait TransportOperator: LinearOperator<Domain = Self::Vector, Range = Self::Vector> {
    /// Vectors that live where it computes.
    type Vector: Indexed + 'static;

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
    ) -> Result<Box<dyn Metric<Self::Vector>>>;

    /// How much of it is kept.
    fn storage(&self) -> Storage;

    /// T x of texels on the host.
    fn shown(&self, x: &[Rgb]) -> Result<Vec<Rgb>> {
        let (x, mut y) = (brought(self.domain(), x)?, self.range());
        self.apply(&x, &mut y)?;
        fetched(&y)
    }

    /// Tᵀ y of rows on the host.
    fn arriving(&self, y: &[Rgb]) -> Result<Vec<Rgb>> {
        let (y, mut x) = (brought(self.range(), y)?, self.domain());
        self.apply_adjoint(&y, &mut x)?;
        fetched(&x)
    }
}

/// Colours of the host in a vector that lives elsewhere.
pub(super) fn brought<V: Vector>(mut vector: V, colors: &[Rgb]) -> Result<V> {
    let wide: Vec<[f64; 3]> = colors.iter().map(|color| color.map(f64::from)).collect();
    vector.set_from_host(&wide)?;
    Ok(vector)
}

/// The colours of a vector, on the host.
pub(super) fn fetched(vector: &impl Vector) -> Result<Vec<Rgb>> {
    Ok(vector.to_host()?.into_iter().map(|color| color.map(|value| value as f32)).collect())
}

/// `T` of a light-map problem on the CPU in f32.
pub type LightMapOperator = HostOperator<LightMapTraversal>;

/// `T` of a traversal on the CPU; in f64 it is what solutions in f32 are measured against.
#[derive(Debug)]
pub enum HostOperator<T, F = f32> {
    /// One weight for all three channels.
    Grey(Transport<T, F, 1>),
    /// One weight a channel.
    Colored(Transport<T, F, 3>),
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
    type Vector = CpuVector<F>;

    fn squares(&self, weights: &CpuVector) -> Result<CpuVector> {
        let weights = brought(CpuVector::zeros(weights.len()), &weights.0)?;
        let squares = match self {
            Self::Grey(transport) => transport.squares(&weights),
            Self::Colored(transport) => transport.squares(&weights),
        };
        Ok(CpuVector(fetched(&squares?)?))
    }

    fn tile_metric(
        &self,
        tiling: &Tiling,
        weights: &[f64],
        added: &[f64],
    ) -> Result<Box<dyn Metric<CpuVector<F>>>> {
        Ok(match self {
            Self::Grey(transport) => Box::new(TileMetric::new(transport, tiling, weights, added)?),
            Self::Colored(transport) => Box::new(TileMetric::new(transport, tiling, weights, added)?),
        })
    }

    fn storage(&self) -> Storage {
        match self {
            Self::Grey(transport) => transport.storage(),
            Self::Colored(transport) => transport.storage(),
        }
    }
}

impl<T: Traversal<f64, 1> + Traversal<f64, 3>, F: Real> LinearOperator for HostOperator<T, F> {
    type Domain = CpuVector<F>;
    type Range = CpuVector<F>;

    fn domain(&self) -> CpuVector<F> {
        match self {
            Self::Grey(transport) => transport.domain(),
            Self::Colored(transport) => transport.domain(),
        }
    }

    fn range(&self) -> CpuVector<F> {
        match self {
            Self::Grey(transport) => transport.range(),
            Self::Colored(transport) => transport.range(),
        }
    }

    fn apply(&self, x: &CpuVector<F>, y: &mut CpuVector<F>) -> Result<()> {
        match self {
            Self::Grey(transport) => transport.apply(x, y),
            Self::Colored(transport) => transport.apply(x, y),
        }
    }

    fn apply_adjoint(&self, y: &CpuVector<F>, x: &mut CpuVector<F>) -> Result<()> {
        match self {
            Self::Grey(transport) => transport.apply_adjoint(y, x),
            Self::Colored(transport) => transport.apply_adjoint(y, x),
        }
    }
}
