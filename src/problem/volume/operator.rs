use std::sync::Arc;

use super::VolumeRows;
use super::environment::{LightColumns, LitRows, SeenLights};
use crate::Result;
use crate::cpu::{HostOperator, kept_bytes};
use crate::march::VolumeTraversal;
use crate::operator::{
    CpuVector, LinearOperator, Metric, Product, Storage, Tiling, TransportOperator, WalkPlan,
};
use crate::scene::Strategy;

/// `T` of a volume problem on the CPU in f32: its rows, kept or walked; or, of lights, light volumes that are walked.
#[derive(Debug)]
pub struct VolumeOperator {
    rows: HostOperator<VolumeRows>,
    light_volumes: Option<LightVolumes>,
}

/// G V + D: what an application takes hardly depends on the number of lights.
type LightVolumes = Product<HostOperator<VolumeTraversal>, Arc<LightColumns>, HostOperator<SeenLights>>;

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
    Product::new(scattered, rows.columns.clone(), seen)
}

impl TransportOperator for VolumeOperator {
    type Vector = CpuVector;

    fn squares(&self, weights: &CpuVector) -> Result<CpuVector> {
        self.rows.squares(weights)
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
            Some(light_volumes) => Storage { of_light_volumes: true, ..light_volumes.factors().0.storage() },
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
