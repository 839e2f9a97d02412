//! The traversal of volumes on the device: rays are walked anew in every application.

mod bricks;
mod light;
mod limits;
mod part;
mod track;

use super::walked::Walked;
use crate::Result;
use crate::gpu::device::Gpu;
use crate::march::{Traversal, VolumeTraversal};
use crate::operator::RowOrder;
use part::{MediumBricks, walked_part};

impl Walked {
    /// Hands rays, medium and lights of a volume over. `colored` ones have one weight a channel; `deterministic` scatters give the same
    /// bits every time.
    ///
    /// Memory  64 bytes a row and quantity, 128 where a quantity has another grid than the medium; of volumes the bricks that are
    ///         not empty
    /// Error   5e-7 measured (trilinear 3e-6); tests/suite/gpu/volume.rs
    ///
    /// Errors: [`crate::Error::Unsupported`] for rays that are bent, integrals that are marched, more than four lights, and an unknown that
    /// is interpolated otherwise than the medium; [`crate::Error::TooLarge`] for volumes that a kernel cannot see as a whole;
    /// [`crate::Error::AdapterMemory`].
    pub fn volume(
        gpu: &Gpu,
        traversal: &VolumeTraversal,
        colored: bool,
        deterministic: bool,
    ) -> Result<Self> {
        let order = RowOrder::new(Traversal::<f64, 1>::row_order(traversal));
        Self::through_volume(gpu, (traversal, &order), colored, deterministic)
    }

    /// The same for rows of pixels that are gathered once: they are walked as they come, for to sort them takes longer.
    ///
    /// Errors: as [`Self::volume`].
    pub fn pixels_of_volume(gpu: &Gpu, traversal: &VolumeTraversal, colored: bool) -> Result<Self> {
        Self::through_volume(gpu, (traversal, &RowOrder::default()), colored, false)
    }

    fn through_volume(
        gpu: &Gpu,
        (traversal, order): (&VolumeTraversal, &RowOrder),
        colored: bool,
        deterministic: bool,
    ) -> Result<Self> {
        let accumulation = gpu.accumulation(deterministic);
        limits::check(gpu, traversal, accumulation)?;
        let medium = MediumBricks::new(gpu, traversal)?;
        let (mut parts, mut elements) = (Vec::new(), 0);
        for part in traversal.parts() {
            parts.push(walked_part(gpu, (traversal, order), &medium, part, elements, colored)?);
            elements += part.voxels().len();
        }
        Self::new(gpu, (traversal.rays().len(), order), parts, accumulation)
    }
}
