//! Slices on the device. Their samples are kept as rows of texels, S; rays sweep over them, E, or read what is prefiltered along them; and
//! where rays end is kept, too: T = E S + D.

mod batch;
mod pictures;
mod prefiltered;
mod sweeps;
mod tables;

pub use pictures::{PrefilteredPicture, SweptPicture};

use super::device_operator::DeviceOperator;
use super::kept::Kept;
use crate::gpu::device::Gpu;
use crate::gpu::vectors::GpuVector;
use crate::march::{EpipolarTraversal, Traversal};
use crate::operator::{Composed, Storage, Sum};
use crate::{Error, Result};
use sweeps::Sweeps;

/// The rows of a light map over slices.
type Swept = Sum<Composed<Sweeps, Kept>, Kept>;

impl DeviceOperator for Swept {
    fn squares(&self, _: &GpuVector, _: &mut GpuVector) -> Result<bool> {
        // The squares of a product are not the product of squares.
        Ok(false)
    }

    fn is_deterministic(&self) -> bool {
        true
    }

    fn storage(&self) -> Storage {
        Storage { walked_rows: self.terms().1.storage().kept_rows, ..Storage::default() }
    }
}

/// T of a light map over slices: what whole samples show is swept, and that of the samples in which rays end is kept.
///
/// Errors: [`Error::Unsupported`] for rays between two slices; [`Error::AdapterMemory`]; [`Error::TooLarge`] for samples that a kernel cannot see as a
/// whole, and for fans whose loops would not end by themselves.
pub fn swept(gpu: &Gpu, rows: &EpipolarTraversal, is_grey: bool) -> Result<Box<dyn DeviceOperator>> {
    if !rows.has_one_ray_a_row() {
        return Err(Error::Unsupported {
            adapter: gpu.record().name.clone(),
            problem: "has no kernel for rays between two slices".to_owned(),
            remedy: "compute on the processor",
        });
    }
    let texels = Traversal::<f64, 1>::elements(rows);
    // Samples of rows lie in the light map.
    let outside = texels as u32;
    let samples = Kept::new(gpu, tables::of_samples(rows, outside, tables::needed), texels)?;
    let ends = Kept::new(gpu, tables::of_ends(rows, is_grey, outside, &tables::tail), texels)?;
    Ok(Box::new(Sum::new(Composed::new(Sweeps::new(gpu, rows.fans())?, samples)?, ends)?))
}
