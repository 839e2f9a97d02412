use std::sync::Arc;

#[cfg(feature = "gpu")]
use super::VolumeProblem;
use super::VolumeRows;
use super::environment::{LightColumns, LitRows, SeenLights};
#[cfg(feature = "gpu")]
use crate::Error;
use crate::Result;
use crate::cpu::{HostOperator, kept_bytes};
#[cfg(feature = "gpu")]
use crate::gpu::{DeviceOperator, Gpu, GpuOperator, Kept, Walked};
use crate::march::VolumeTraversal;
use crate::operator::{
    Composed, CpuVector, LinearOperator, Metric, Storage, Sum, Tiling, TransportOperator, WalkPlan,
};
#[cfg(feature = "gpu")]
use crate::operator::{HostRows, RowTable};
use crate::scene::Strategy;

/// `T` of a volume problem on the CPU in f32: its rows, kept or walked; or, of lights, light volumes that are walked.
#[derive(Debug)]
pub struct VolumeOperator {
    rows: HostOperator<VolumeRows>,
    light_volumes: Option<LightVolumes>,
}

/// G V + D: what an application takes hardly depends on the number of lights.
type LightVolumes = Sum<Composed<HostOperator<VolumeTraversal>, Arc<LightColumns>>, HostOperator<SeenLights>>;

impl VolumeOperator {
    /// All rows are kept where that is asked for, or fits; of lights, those that do not fit are not walked but given up for light
    /// volumes.
    ///
    /// Errors: [`crate::Error::TooLarge`] when all rows must be kept and do not fit.
    pub(super) fn new(
        rows: &VolumeRows,
        is_grey: bool,
        plan: &WalkPlan,
        strategy: Strategy,
        budget: u64,
    ) -> Result<Self> {
        let bytes = kept_bytes::<f32>(plan, if is_grey { 1 } else { 3 });
        let keep = |strategy| HostOperator::new(rows.clone(), is_grey, plan, strategy, budget);
        let walked = match (rows, strategy) {
            (VolumeRows::Lights(rows), Strategy::MatrixFree) => Some(rows),
            (VolumeRows::Lights(rows), Strategy::Auto) if bytes > budget => Some(rows),
            _ => None,
        };
        Ok(match walked {
            None => Self { rows: keep(strategy)?, light_volumes: None },
            Some(lit) => {
                let light_volumes = light_volumes(lit, is_grey, strategy, budget)?;
                Self { rows: keep(Strategy::MatrixFree)?, light_volumes: Some(light_volumes) }
            }
        })
    }
}

fn light_volumes(rows: &LitRows, is_grey: bool, strategy: Strategy, budget: u64) -> Result<LightVolumes> {
    let (scattered, seen) = (rows.scattered.clone(), rows.seen.clone());
    let plans = [WalkPlan::of(&scattered, is_grey), WalkPlan::of(&seen, is_grey)];
    let scattered = HostOperator::new(scattered, is_grey, &plans[0], strategy, budget)?;
    let seen = HostOperator::new(seen, is_grey, &plans[1], Strategy::MatrixFree, 0)?;
    Sum::new(Composed::new(scattered, rows.columns.clone())?, seen)
}

#[cfg(feature = "gpu")]
impl VolumeProblem {
    /// T on a graphics adapter: all rows kept there where `strategy` and the `budget` in bytes allow. Else voxels are walked there,
    /// and of lights the factors of light volumes are kept. `deterministic` sums are the same in every run.
    ///
    /// Errors: [`Error::TooLarge`] when rows must be kept and exceed the budget, [`Error::AdapterMemory`]; [`Error::Unsupported`] for
    /// rays that no kernel walks.
    pub fn on_gpu(
        &self,
        gpu: &Gpu,
        strategy: Strategy,
        budget: u64,
        deterministic: bool,
    ) -> Result<GpuOperator> {
        let grey = self.is_grey();
        let on_host = |strategy| -> Result<Box<dyn HostRows>> {
            let rows = self.traversal.clone();
            Ok(Box::new(HostOperator::<_, f32>::new(rows, grey, &self.plan, strategy, u64::MAX)?))
        };
        let otherwise = || -> Result<Box<dyn DeviceOperator>> {
            match &self.traversal {
                VolumeRows::Voxels(rows) => Ok(Box::new(Walked::volume(gpu, rows, !grey, deterministic)?)),
                VolumeRows::Linearized(_) => Err(Error::TooLarge {
                    what: "the rows of a refinement, which an adapter only keeps".to_owned(),
                    needed: format!("{} bytes", self.kept_bytes()),
                    limit: format!("{budget} bytes"),
                    remedy: "raise --memory, lower the views' sizes or volume.size, or use --backend cpu",
                }),
                VolumeRows::Lights(rows) => Ok(Box::new(light_volumes_on(gpu, rows, grey, budget)?)),
            }
        };
        let channels = if grey { 1 } else { 3 };
        GpuOperator::new(gpu, (&self.plan, channels), (strategy, budget), &on_host, &otherwise)
    }
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
            remedy: "raise --memory, lower the views' sizes or light_size, or use --backend cpu",
        });
    }
    let scattered = Kept::new(gpu, RowTable::walked(&rows.scattered, is_grey), voxels)?;
    let seen = RowTable::walked(&rows.seen, is_grey);
    let [columns, seen] = [Kept::new(gpu, columns, lights)?, Kept::new(gpu, seen, lights)?];
    Sum::new(Composed::new(scattered, columns)?, seen)
}

impl TransportOperator for VolumeOperator {
    type Vector = CpuVector;

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
        match &self.light_volumes {
            Some(light_volumes) => {
                let (scattered, _) = light_volumes.terms().0.factors();
                Storage { of_light_volumes: true, ..scattered.storage() }
            }
            None => self.rows.storage(),
        }
    }
}

impl LinearOperator for VolumeOperator {
    type Domain = CpuVector;
    type Range = CpuVector;

    fn domain(&self) -> CpuVector {
        self.rows.domain()
    }

    fn range(&self) -> CpuVector {
        self.rows.range()
    }

    fn apply(&self, x: &CpuVector, y: &mut CpuVector) -> Result<()> {
        match &self.light_volumes {
            Some(light_volumes) => light_volumes.apply(x, y),
            None => self.rows.apply(x, y),
        }
    }

    fn apply_adjoint(&self, y: &CpuVector, x: &mut CpuVector) -> Result<()> {
        match &self.light_volumes {
            Some(light_volumes) => light_volumes.apply_adjoint(y, x),
            None => self.rows.apply_adjoint(y, x),
        }
    }
}
