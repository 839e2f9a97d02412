//! Pictures over slices: what all their rays show of a light map and of the light beside it.

use super::prefiltered::PrefilteredSums;
use super::sweeps::Sweeps;
use super::tables;
use crate::Result;
use crate::gpu::device::Gpu;
use crate::gpu::operators::kept::KeptRows;
use crate::gpu::operators::picture::LightPicture;
use crate::gpu::vectors::GpuVector;
use crate::march::{EpipolarTraversal, Fan, FanRay, Traversal};
use crate::operator::Vector;

/// A picture by sweeps.
#[derive(Debug)]
pub struct SweptPicture {
    samples: KeptRows,
    sweeps: Sweeps,
    ends: KeptRows,
}

/// A picture by visibility that is prefiltered.
#[derive(Debug)]
pub struct PrefilteredPicture {
    samples: KeptRows,
    sums: PrefilteredSums,
    beside: KeptRows,
}

/// What a ray loses before the first sample of its fan and behind the last.
fn beside(rows: &EpipolarTraversal, fan: &Fan, ray: &FanRay) -> [f32; 3] {
    let (sigma_t, end) = (rows.fans().sigma_t(), f64::from(ray.end));
    let before = ray.extinguished(sigma_t, 0.0, fan.edges.first.min(end));
    let last = fan.last();
    let behind = if end > last { ray.extinguished(sigma_t, last, end) } else { [0.0; 3] };
    [0, 1, 2].map(|c| (before[c] + behind[c]) as f32)
}

impl SweptPicture {
    /// Hands slices over; one ray is one pixel.
    ///
    /// Errors: as [`swept`](super::swept).
    pub fn new(gpu: &Gpu, rows: &EpipolarTraversal) -> Result<Self> {
        let elements = Traversal::<f64, 1>::elements(rows) + 1;
        let outside = elements as u32 - 1;
        let beside = |fan: &Fan, ray: &FanRay| tables::End {
            beside: beside(rows, fan, ray),
            ..tables::tail(fan, ray)
        };
        Ok(Self {
            samples: KeptRows::new(gpu, &tables::of_samples(rows, outside, tables::needed), elements)?,
            ends: KeptRows::new(gpu, &tables::of_ends(rows, false, outside, &beside), elements)?,
            sweeps: Sweeps::new(gpu, rows.fans())?,
        })
    }
}

impl LightPicture for SweptPicture {
    fn shown(&self, x: &GpuVector) -> Result<GpuVector> {
        let (mut samples, mut y, mut ends) = (self.samples.range(), self.ends.range(), self.ends.range());
        self.samples.gather(x, &mut samples, false)?;
        self.sweeps.gather(&samples, &mut y)?;
        self.ends.gather(x, &mut ends, false)?;
        y.axpby([1.0; 3], &ends, [1.0; 3]);
        Ok(y)
    }
}

impl PrefilteredPicture {
    /// Hands slices over, to be filtered with so many coefficients; one ray is one pixel.
    ///
    /// Errors: as [`SweptPicture::new`].
    pub fn new(gpu: &Gpu, rows: &EpipolarTraversal, coefficients: usize) -> Result<Self> {
        let elements = Traversal::<f64, 1>::elements(rows) + 1;
        let outside = elements as u32 - 1;
        let beside = |fan: &Fan, ray: &FanRay| tables::End { tail: None, beside: beside(rows, fan, ray) };
        Ok(Self {
            samples: KeptRows::new(gpu, &tables::of_samples(rows, outside, tables::all), elements)?,
            beside: KeptRows::new(gpu, &tables::of_ends(rows, false, outside, &beside), elements)?,
            sums: PrefilteredSums::new(gpu, rows.fans(), coefficients)?,
        })
    }
}

impl LightPicture for PrefilteredPicture {
    fn shown(&self, x: &GpuVector) -> Result<GpuVector> {
        let (mut samples, mut y, mut beside) =
            (self.samples.range(), self.beside.range(), self.beside.range());
        self.samples.gather(x, &mut samples, false)?;
        self.sums.gather(&samples, &mut y)?;
        self.beside.gather(x, &mut beside, false)?;
        y.axpby([1.0; 3], &beside, [1.0; 3]);
        Ok(y)
    }
}
