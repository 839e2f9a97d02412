//! The traversal of volumes on the device: rays are walked anew in every application.

mod bricks;
mod light;
mod limits;
mod part;
mod track;

use super::Gpu;
use super::kernel::{Kernel, RAYS};
use super::layout::Pass;
use super::pass::walkings;
use super::recorder::Binding;
use super::vector::{GpuVector, Slab};
use super::walk::{Consumer, VolumeWalk};
use super::walked::{Rays, Walked};
use crate::Result;
use crate::march::VolumeTraversal;
use part::{Medium, WalkedPart};

/// Rays through a volume, quantity after quantity.
///
/// Memory  64 bytes a row and quantity, 128 where a quantity has another grid than the medium; of volumes the bricks that are not empty
/// Error   5e-7 measured (trilinear 3e-6); tests/suite/gpu/volume.rs
#[derive(Debug)]
struct VolumeRays {
    rows: usize,
    elements: usize,
    parts: Vec<WalkedPart>,
}

impl Walked {
    /// Hands rays, medium and lights of a volume over. `colored` ones have one weight a channel; `deterministic` scatters give the same
    /// bits every time.
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
        let accumulation = gpu.accumulation(deterministic);
        limits::check(gpu, traversal, accumulation)?;
        let medium = Medium::new(gpu, traversal)?;
        let (mut parts, mut elements) = (Vec::new(), 0);
        for part in traversal.parts() {
            parts.push(WalkedPart::new(gpu, traversal, &medium, part, elements, colored)?);
            elements += part.voxels().len();
        }
        Self::new(gpu, VolumeRays { rows: traversal.rays().len(), elements, parts }, accumulation)
    }
}

impl Rays for VolumeRays {
    fn shape(&self) -> [usize; 2] {
        [self.rows, self.elements]
    }

    fn row_sums(&self, power: usize) -> f64 {
        self.parts.iter().map(|part| part.row_sums[power - 1]).sum()
    }

    fn record(
        &self,
        gpu: &Gpu,
        consumer: Consumer,
        vectors: [&GpuVector; 2],
        bindings: &dyn Fn(Slab, Slab) -> Vec<Binding>,
    ) {
        for channels in GpuVector::channels(&vectors) {
            for part in &self.parts {
                let kernel = Kernel::Volume(consumer, VolumeWalk { channels: channels[1], ..part.walk });
                let shared =
                    [part.bricks.whole(), part.sigma.whole(), part.lights.whole(), part.volume.whole()];
                for walking in walkings(&part.slabs, vectors, channels) {
                    let of_x = walking.of_x;
                    if of_x.first >= part.first + part.len || of_x.first + of_x.len <= part.first {
                        continue;
                    }
                    // Counted from the first element of the quantity, and wrapped where the slab begins before.
                    let x_first = (of_x.first as u32).wrapping_sub(part.first as u32);
                    let first_group = bindings(walking.of_y, of_x);
                    part.paces.of(consumer)(gpu, walking.rows.len(), &mut |rows| {
                        let (rows, pass) = walking.narrowed(&rows);
                        let pass = Pass { x_first, ..pass };
                        let [offset, size] =
                            [rows.start, rows.len()].map(|rows| (rows * part.row_bytes()) as u64);
                        let tracks = part.tracks[walking.slab].part(offset, size);
                        let groups: [&[Binding]; 3] = [&first_group, &shared, std::slice::from_ref(&tracks)];
                        gpu.dispatch(kernel, &pass, &groups, [pass.rows.div_ceil(RAYS), 1, 1]);
                    });
                }
            }
        }
    }
}
