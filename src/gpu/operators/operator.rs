//! `T` of a problem on the device: kept there, or composed there by whoever knows the scene.

use super::device_operator::DeviceOperator;
use super::kept::Kept;
use super::tiles::TileMetric;
use super::walked::Walked;
use crate::gpu::device::Gpu;
use crate::gpu::kernels::Program;
use crate::gpu::vectors::GpuVector;
use crate::operator::{
    Composed, CpuVector, HostRows, LinearOperator, Metric, Storage, Sum, Tiling, TransportOperator, WalkPlan,
    brought, fetched,
};
use crate::scene::Strategy;
use crate::{Error, Result};

/// Vectors over rows or elements that a solve has on an adapter at most, with those of its system.
const VECTORS: u64 = 16;

/// Rows over a light map, and what their rows show beside it.
impl DeviceOperator for Sum<Walked, Kept> {
    fn squares(&self, _: &GpuVector, _: &mut GpuVector) -> Result<bool> {
        // The squares of a sum are not those of its terms.
        Ok(false)
    }

    fn is_deterministic(&self) -> bool {
        self.terms().0.is_deterministic()
    }

    fn storage(&self) -> Storage {
        self.terms().0.storage()
    }
}

/// Light volumes, of what is kept: G V + D.
impl DeviceOperator for Sum<Composed<Kept, Kept>, Kept> {
    fn squares(&self, _: &GpuVector, _: &mut GpuVector) -> Result<bool> {
        // Nor are those of a product those of its factors.
        Ok(false)
    }

    fn is_deterministic(&self) -> bool {
        true
    }

    fn storage(&self) -> Storage {
        let (product, seen) = self.terms();
        let (scattered, columns) = product.factors();
        Storage {
            kept_nonzeros: [scattered, columns, seen].iter().map(|kept| kept.nonzeros() as u64).sum(),
            of_light_volumes: true,
            ..scattered.storage()
        }
    }
}

/// `T` of a problem on a graphics adapter.
///
/// Rows that are kept are walked once by the processor, in f64; rows that are not are walked by the adapter.
#[derive(Debug)]
pub struct GpuOperator {
    gpu: Gpu,
    products: Box<dyn DeviceOperator>,
    /// The same rows on the processor: what the kept ones and the tiles are made from.
    rows: Box<dyn HostRows>,
    storage: Storage,
}

impl GpuOperator {
    /// Keeps all rows on the adapter where `strategy` and the `budget` in bytes allow; else T is what `otherwise` gives.
    ///
    /// The plan is of the same rows, which have so many `channels`. `on_host` gives them on the processor, all kept there or none.
    ///
    /// Errors: [`Error::TooLarge`] when all rows must be kept and exceed the budget, [`Error::AdapterMemory`]; those of `on_host` and
    /// `otherwise`.
    pub fn new(
        gpu: &Gpu,
        (plan, channels): (&WalkPlan, usize),
        (strategy, budget): (Strategy, u64),
        on_host: &dyn Fn(Strategy) -> Result<Box<dyn HostRows>>,
        otherwise: &dyn Fn() -> Result<Box<dyn DeviceOperator>>,
    ) -> Result<Self> {
        let bytes = Kept::bytes(plan.nonzeros, plan.rows, plan.elements, channels);
        let keep = || -> Result<_> {
            // What is kept may not take the room that a solve needs.
            let _free = gpu.reserve(VECTORS * 12 * (plan.rows + plan.elements) as u64)?;
            let rows = on_host(Strategy::Assembled)?;
            Ok((Kept::new(gpu, rows.table(), plan.elements)?, rows))
        };
        let keep = || {
            let programs = Program::of_kept_rows(channels == 3, gpu.tactics().interleaved);
            std::thread::scope(|scope| {
                scope.spawn(|| gpu.prepare(&programs));
                keep()
            })
        };
        let kept = match strategy {
            Strategy::MatrixFree => None,
            // Once on the adapter, once on the processor while it is made.
            _ if 2 * bytes <= budget => match keep() {
                Err(error) if strategy != Strategy::Assembled && is_of_size(&error) => None,
                kept => Some(kept?),
            },
            Strategy::Assembled => {
                return Err(Error::TooLarge {
                    what: "the assembled transport on an adapter".to_owned(),
                    needed: format!("{} bytes", 2 * bytes),
                    limit: format!("{budget} bytes"),
                    remedy: "raise solve.memory, lower the sizes, or choose the strategy `auto` or `matrix-free`",
                });
            }
            Strategy::Auto | Strategy::Epipolar => None,
        };
        let gpu = gpu.clone();
        Ok(match kept {
            Some((kept, rows)) => {
                let storage = Storage { bytes, ..kept.storage() };
                Self { gpu, products: Box::new(kept), rows, storage }
            }
            None => {
                let products = otherwise()?;
                let storage = products.storage();
                Self { gpu, products, rows: on_host(Strategy::MatrixFree)?, storage }
            }
        })
    }

    /// Whether its products are the same bits in every run.
    pub fn is_deterministic(&self) -> bool {
        self.products.is_deterministic()
    }
}

/// Whether an error says that something is too large, so that something smaller may do.
fn is_of_size(error: &Error) -> bool {
    matches!(error, Error::TooLarge { .. } | Error::AdapterMemory { .. })
}

impl LinearOperator for GpuOperator {
    type Domain = GpuVector;
    type Range = GpuVector;

    fn domain(&self) -> GpuVector {
        self.products.domain()
    }

    fn range(&self) -> GpuVector {
        self.products.range()
    }

    fn apply(&self, x: &GpuVector, y: &mut GpuVector) -> Result<()> {
        self.products.apply(x, y)
    }

    fn apply_adjoint(&self, y: &GpuVector, x: &mut GpuVector) -> Result<()> {
        self.products.apply_adjoint(y, x)
    }
}

impl TransportOperator for GpuOperator {
    fn squares(&self, weights: &CpuVector) -> Result<CpuVector> {
        let (y, mut x) = (brought(self.range(), &weights.0)?, self.domain());
        match self.products.squares(&y, &mut x)? {
            true => Ok(CpuVector(fetched(&x)?)),
            // The processor walks its rows once.
            false => self.rows.squares(weights),
        }
    }

    fn tile_metric(
        &self,
        tiling: &Tiling,
        weights: &[f64],
        added: &[f64],
    ) -> Result<Box<dyn Metric<GpuVector>>> {
        let tiles = self.rows.tiles(tiling, weights, added)?;
        Ok(Box::new(TileMetric::new(&self.gpu, added.len(), tiles.channels(), tiles.blocks())?))
    }

    fn storage(&self) -> Storage {
        self.storage
    }
}
