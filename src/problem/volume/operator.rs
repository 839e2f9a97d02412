use std::sync::{Arc, Mutex, PoisonError};

use super::VolumeRows;
use super::environment::{LightColumns, LitRows, SeenLights};
use crate::Result;
use crate::cpu::{Storage, Tiling, WalkPlan};
use crate::march::VolumeTraversal;
use crate::operator::{CpuVector, LinearOperator, Metric, Vector};
use crate::problem::TransportOperator;
use crate::problem::transport::HostOperator;
use crate::scene::Strategy;

/// `T` of a volume problem on the CPU in f32: its rows, kept or walked; or, of lights, light volumes that are walked.
#[derive(Debug)]
pub struct VolumeOperator {
    rows: HostOperator<VolumeRows>,
    light_volumes: Option<LightVolumes>,
}

/// G V + D, one factor after the other: what an application takes does not depend on the number of lights.
///
/// Error   f32 values between the factors
/// Cost    one walk of G, kept or not, and a multiplication for every voxel and light
#[derive(Debug)]
struct LightVolumes {
    columns: Arc<LightColumns>,
    scattered: HostOperator<VolumeTraversal>,
    seen: HostOperator<SeenLights>,
    /// Light at the voxels, and what the other term gives.
    room: Mutex<Room>,
}

#[derive(Debug)]
struct Room {
    light: CpuVector,
    rows: CpuVector,
    lights: CpuVector,
}

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
        let keep = |strategy| HostOperator::new(rows.clone(), is_grey, plan, strategy, budget);
        let light_volumes = match (rows, strategy) {
            (VolumeRows::Lights(rows), Strategy::MatrixFree) => Some(rows),
            (VolumeRows::Lights(rows), Strategy::Auto) if plan.bytes > budget => Some(rows),
            _ => None,
        };
        Ok(match light_volumes {
            None => Self { rows: keep(strategy)?, light_volumes: None },
            Some(lit) => {
                let light_volumes = LightVolumes::new(lit, is_grey, strategy, budget)?;
                Self { rows: keep(Strategy::MatrixFree)?, light_volumes: Some(light_volumes) }
            }
        })
    }
}

impl LightVolumes {
    fn new(rows: &LitRows, is_grey: bool, strategy: Strategy, budget: u64) -> Result<Self> {
        let walked = rows.scattered.clone();
        let plan = if is_grey { WalkPlan::new::<f32, 1>(&walked) } else { WalkPlan::new::<f32, 3>(&walked) };
        let scattered = HostOperator::new(walked, is_grey, &plan, strategy, budget)?;
        let seen = rows.seen.clone();
        let plan = if is_grey { WalkPlan::new::<f32, 1>(&seen) } else { WalkPlan::new::<f32, 3>(&seen) };
        let seen = HostOperator::new(seen, is_grey, &plan, Strategy::MatrixFree, 0)?;
        let room = Room { light: scattered.domain(), rows: scattered.range(), lights: seen.domain() };
        Ok(Self { columns: rows.columns.clone(), scattered, seen, room: Mutex::new(room) })
    }

    fn apply(&self, x: &CpuVector, y: &mut CpuVector) -> Result<()> {
        let mut room = self.room.lock().unwrap_or_else(PoisonError::into_inner);
        let Room { light, rows, .. } = &mut *room;
        self.columns.apply(x, light)?;
        self.scattered.apply(light, y)?;
        self.seen.apply(x, rows)?;
        y.axpby([1.0; 3], rows, [1.0; 3]);
        Ok(())
    }

    fn apply_adjoint(&self, y: &CpuVector, x: &mut CpuVector) -> Result<()> {
        let mut room = self.room.lock().unwrap_or_else(PoisonError::into_inner);
        let Room { light, lights, .. } = &mut *room;
        self.scattered.apply_adjoint(y, light)?;
        self.columns.apply_adjoint(light, x)?;
        self.seen.apply_adjoint(y, lights)?;
        x.axpby([1.0; 3], lights, [1.0; 3]);
        Ok(())
    }
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
            Some(light_volumes) => Storage { of_light_volumes: true, ..light_volumes.scattered.storage() },
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
