use std::sync::Arc;

#[cfg(feature = "gpu")]
use super::VolumeRows;
use super::environment::{LightColumns, LitRows, SeenLights};
#[cfg(feature = "gpu")]
use crate::Error;
use crate::Result;
use crate::cpu::HostOperator;
#[cfg(feature = "gpu")]
use crate::cpu::kept_bytes;
#[cfg(feature = "gpu")]
use crate::gpu::{DeviceOperator, Gpu, GpuOperator, Kept, Walked};
use crate::march::VolumeTraversal;
#[cfg(feature = "gpu")]
use crate::operator::RowTable;
use crate::operator::{
    Composed, CpuVector, LinearOperator, Metric, Storage, Sum, Tiling, TransportOperator, WalkPlan,
};
#[cfg(feature = "gpu")]
use crate::problem::looked_for;
use crate::scene::Strategy;

/// `T` of lights on the processor, as light volumes: what an application takes hardly depends on the number of lights.
#[derive(Debug)]
pub(super) struct LightVolumes {
    /// The same rows, walked for what only they can say.
    rows: HostOperator<LitRows>,
    product: Product,
}

/// G V + D.
type Product = Sum<Composed<HostOperator<VolumeTraversal>, Arc<LightColumns>>, HostOperator<SeenLights>>;

impl LightVolumes {
    pub(super) fn new(
        rows: &LitRows,
        is_grey: bool,
        plan: &WalkPlan,
        strategy: Strategy,
        budget: u64,
    ) -> Result<Self> {
        let product = product(rows, is_grey, strategy, budget)?;
        let rows = HostOperator::new(rows.clone(), is_grey, plan, Strategy::MatrixFree, budget)?;
        Ok(Self { rows, product })
    }
}

fn product(rows: &LitRows, is_grey: bool, strategy: Strategy, budget: u64) -> Result<Product> {
    let (scattered, seen) = (rows.scattered.clone(), rows.seen.clone());
    let plans = [WalkPlan::of(&scattered, is_grey), WalkPlan::of(&seen, is_grey)];
    let scattered = HostOperator::new(scattered, is_grey, &plans[0], strategy, budget)?;
    let seen = HostOperator::new(seen, is_grey, &plans[1], Strategy::MatrixFree, 0)?;
    Sum::new(Composed::new(scattered, rows.columns.clone())?, seen)
}

/// T on a graphics adapter: all rows kept there where `strategy` and the `budget` in bytes allow. Else voxels are walked there,
/// and of lights the factors of light volumes are kept. `deterministic` sums are the same in every run.
///
/// Errors: [`Error::TooLarge`] when rows must be kept and exceed the budget, [`Error::AdapterMemory`]; [`Error::Unsupported`] for
/// rays that no kernel walks.
#[cfg(feature = "gpu")]
pub(super) fn on_gpu(
    rows: &VolumeRows,
    (grey, plan): (bool, &WalkPlan),
    gpu: &Gpu,
    (strategy, budget): (Strategy, u64),
    deterministic: bool,
) -> Result<GpuOperator> {
    let otherwise = || -> Result<Box<dyn DeviceOperator>> {
        match rows {
            VolumeRows::Voxels(rows) => Ok(Box::new(Walked::volume(gpu, rows, !grey, deterministic)?)),
            VolumeRows::Linearized(_) => Err(Error::TooLarge {
                what: "the rows of a refinement, which an adapter only keeps".to_owned(),
                needed: format!("{} bytes", kept_bytes::<f32>(plan, if grey { 1 } else { 3 })),
                limit: format!("{budget} bytes"),
                remedy: "raise solve.memory, lower the views' sizes or volume.size, or compute on the processor",
            }),
            VolumeRows::Lights(rows) => Ok(Box::new(light_volumes_on(gpu, rows, grey, budget)?)),
        }
    };
    looked_for::on_gpu(rows, (grey, plan), gpu, (strategy, budget), &otherwise)
}

/// G V + D of lights on an adapter, each factor kept there.
///
/// Errors: [`Error::TooLarge`], [`Error::AdapterMemory`].
#[cfg(feature = "gpu")]
fn light_volumes_on(
    gpu: &Gpu,
    rows: &LitRows,
    is_grey: bool,
    budget: u64,
) -> Result<Sum<Composed<Kept, Kept>, Kept>> {
    let (lights, voxels) = (rows.basis().len(), rows.scattered.parts()[0].voxels().len());
    let columns = match &*rows.columns {
        LightColumns::Grey(columns) => RowTable::of(columns),
        LightColumns::Colored(columns) => RowTable::of(columns),
    };
    let plan = WalkPlan::of(&rows.scattered, is_grey);
    let bytes = Kept::bytes(plan.nonzeros, plan.rows, voxels, if is_grey { 1 } else { 3 });
    if 2 * bytes > budget {
        return Err(Error::TooLarge {
            what: "what the voxels scatter, on an adapter".to_owned(),
            needed: format!("{} bytes", 2 * bytes),
            limit: format!("{budget} bytes"),
            remedy: "raise solve.memory, lower the views' sizes or light_size, or compute on the processor",
        });
    }
    let scattered = Kept::new(gpu, RowTable::walked(&rows.scattered, is_grey), voxels)?;
    let seen = RowTable::walked(&rows.seen, is_grey);
    let [columns, seen] = [Kept::new(gpu, columns, lights)?, Kept::new(gpu, seen, lights)?];
    Sum::new(Composed::new(scattered, columns)?, seen)
}

impl TransportOperator for LightVolumes {
    fn squares(&self, weights: &CpuVector) -> Result<CpuVector> {
        TransportOperator::squares(&self.rows, weights)
    }

    fn tile_metric(
        &self,
        tiling: &Tiling,
        weights: &[f64],
        added: &[f64],
    ) -> Result<Box<dyn Metric<CpuVector>>> {
        self.rows.tile_metric(tiling, weights, added)
    }

    fn storage(&self) -> Storage {
        let (scattered, _) = self.product.terms().0.factors();
        Storage { of_light_volumes: true, ..scattered.storage() }
    }
}

impl LinearOperator for LightVolumes {
    type Domain = CpuVector;
    type Range = CpuVector;

    fn domain(&self) -> CpuVector {
        self.product.domain()
    }

    fn range(&self) -> CpuVector {
        self.product.range()
    }

    fn apply(&self, x: &CpuVector, y: &mut CpuVector) -> Result<()> {
        self.product.apply(x, y)
    }

    fn apply_adjoint(&self, y: &CpuVector, x: &mut CpuVector) -> Result<()> {
        self.product.apply_adjoint(y, x)
    }
}
