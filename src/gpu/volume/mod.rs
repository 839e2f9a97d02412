//! The traversal of volumes on the device: rays are walked anew in every application.

mod bricks;
mod light;
mod limits;
mod part;
mod track;

use std::cell::RefCell;

use super::Gpu;
use super::fixed_point::{Accumulation, FixedSums};
use super::kernel::{Kernel, RAYS};
use super::layout::Pass;
use super::pass::walkings;
use super::recorder::Binding;
use super::vector::{GpuVector, Slab};
use super::walk::{Consumer, VolumeWalk};
use crate::Result;
use crate::march::VolumeTraversal;
use crate::operator::{LinearOperator, Vector, expect_len};
use part::{Medium, WalkedPart};

/// T of a volume, walked on the device.
///
/// Shapes  x: the elements of all quantities, y: rays, three channels each
/// Memory  64 bytes a row and quantity, 128 where a quantity has another grid than the medium; of volumes the bricks that are not empty
/// Error   1e-5 relative to the explicit matrix in f64, measured 5e-7 (trilinear 3e-6): rays are cut to the grid in f64, and walked in
///         integers from there; tests/suite/gpu/volume.rs
/// Cost    one walk a row and quantity; scatters in f32 depend on the order in which rays arrive, those in fixed point do not
#[derive(Debug)]
pub struct WalkedVolume {
    gpu: Gpu,
    rows: usize,
    elements: usize,
    accumulation: Accumulation,
    parts: Vec<WalkedPart>,
    fixed: Option<RefCell<FixedSums>>,
}

impl WalkedVolume {
    /// Hands rays, medium and lights over. `colored` ones have one weight a channel; `deterministic` scatters give the same bits
    /// every time.
    ///
    /// Errors: [`crate::Error::Adapter`] for rays that are bent, integrals that are marched, more than four lights, and an unknown that
    /// is interpolated otherwise than the medium; [`crate::Error::TooLarge`] for volumes that a kernel cannot see as a whole;
    /// [`crate::Error::AdapterMemory`].
    pub fn new(gpu: &Gpu, traversal: &VolumeTraversal, colored: bool, deterministic: bool) -> Result<Self> {
        let accumulation = gpu.accumulation(deterministic);
        limits::check(gpu, traversal, accumulation)?;
        let medium = Medium::new(gpu, traversal)?;
        let (mut parts, mut elements) = (Vec::new(), 0);
        for part in traversal.parts() {
            parts.push(WalkedPart::new(gpu, traversal, &medium, part, elements, colored)?);
            elements += part.voxels().len();
        }
        let rows = traversal.rays().len();
        let fixed = match accumulation {
            Accumulation::Fixed => {
                Some(RefCell::new(FixedSums::new(gpu, elements, &GpuVector::zeros(gpu, rows))?))
            }
            Accumulation::Float | Accumulation::Swap => None,
        };
        Ok(Self { gpu: gpu.clone(), rows, elements, accumulation, parts, fixed })
    }

    /// How sums are made where rays meet.
    pub fn accumulation(&self) -> Accumulation {
        self.accumulation
    }

    /// x ← diag(Tᵀ diag(y) T).
    ///
    /// Errors: [`crate::Error::Shape`] when a vector does not fit, and what has gone wrong on the device.
    pub fn squares(&self, y: &GpuVector, x: &mut GpuVector) -> Result<()> {
        self.scatter(Consumer::Squares(self.accumulation), y, x, self.row_sums(1))
    }

    fn row_sums(&self, power: usize) -> f64 {
        self.parts.iter().map(|part| part.row_sums[power]).sum()
    }

    fn scatter(&self, consumer: Consumer, y: &GpuVector, x: &mut GpuVector, row_sums: f64) -> Result<()> {
        expect_len("x", x, self.elements)?;
        expect_len("y", y, self.rows)?;
        match &self.fixed {
            None => {
                x.fill([0.0; 3]);
                let x = &*x;
                self.each_pass(consumer, [y, x], |of_y, of_x| vec![y.binding(of_y), x.binding(of_x)]);
            }
            Some(fixed) => {
                let mut fixed = fixed.borrow_mut();
                fixed.begin(&self.gpu, y, row_sums);
                let [low, high] = &fixed.words;
                self.each_pass(consumer, [y, x], |of_y, of_x| {
                    vec![y.binding(of_y), low.binding(of_x), high.binding(of_x), fixed.scales.whole()]
                });
                x.finish_fixed(&fixed.words, &fixed.scales);
            }
        }
        self.gpu.check()
    }

    /// Records a consumer for every quantity, slab of rays, of y and of x.
    fn each_pass(
        &self,
        consumer: Consumer,
        vectors: [&GpuVector; 2],
        bindings: impl Fn(Slab, Slab) -> Vec<Binding>,
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
                    let pass = Pass { x_first, ..walking.pass };
                    let [offset, size] =
                        [walking.rows.start, walking.rows.len()].map(|rows| (rows * part.row_bytes()) as u64);
                    let tracks = part.tracks[walking.slab].part(offset, size);
                    let first_group = bindings(walking.of_y, of_x);
                    let groups: [&[Binding]; 3] = [&first_group, &shared, std::slice::from_ref(&tracks)];
                    self.gpu.dispatch(kernel, &pass, &groups, [pass.rows.div_ceil(RAYS), 1]);
                }
            }
        }
    }
}

impl LinearOperator for WalkedVolume {
    type Domain = GpuVector;
    type Range = GpuVector;

    fn domain(&self) -> GpuVector {
        GpuVector::zeros(&self.gpu, self.elements)
    }

    fn range(&self) -> GpuVector {
        GpuVector::zeros(&self.gpu, self.rows)
    }

    fn apply(&self, x: &GpuVector, y: &mut GpuVector) -> Result<()> {
        expect_len("x", x, self.elements)?;
        expect_len("y", y, self.rows)?;
        // Every quantity adds its share.
        y.fill([0.0; 3]);
        let y = &*y;
        self.each_pass(Consumer::Gather, [y, x], |of_y, of_x| vec![y.binding(of_y), x.binding(of_x)]);
        self.gpu.check()
    }

    fn apply_adjoint(&self, y: &GpuVector, x: &mut GpuVector) -> Result<()> {
        self.scatter(Consumer::Scatter(self.accumulation), y, x, self.row_sums(0))
    }
}
