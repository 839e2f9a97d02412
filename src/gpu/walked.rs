//! Operators whose rays are walked anew in every application.

use std::sync::Mutex;

use super::device::lock;
use super::fixed_point::{Accumulation, FixedSums};
use super::recorder::Binding;
use super::vector::{GpuVector, Slab};
use super::walk::Consumer;
use super::{DeviceOperator, Gpu};
use crate::Result;
use crate::operator::{LinearOperator, Storage, Vector, expect_len};

/// Rays on the device, and what they are walked through.
pub(super) trait Rays: std::fmt::Debug + Send + Sync {
    /// How many rows and elements there are.
    fn shape(&self) -> [usize; 2];

    /// Σ_k Σ_i w_ki at most, and with the power of 2 the same of squared row sums.
    fn row_sums(&self, power: usize) -> f64;

    /// Records a consumer for every slab of rays, of y and of x. `bindings` are those of the vectors.
    fn record(
        &self,
        gpu: &Gpu,
        consumer: Consumer,
        vectors: [&GpuVector; 2],
        bindings: &dyn Fn(Slab, Slab) -> Vec<Binding>,
    );
}

/// T, walked on the device; made by [`Walked::light_map`] or [`Walked::volume`].
///
/// Shapes  x: elements, y: rays, three channels each
/// Error   1e-5 relative to the explicit matrix in f64: rays are cut to the grid in f64, and walked in integers from there
/// Cost    one walk a row; scatters in f32 depend on the order in which rays arrive, those in fixed point do not
#[derive(Debug)]
pub struct Walked {
    gpu: Gpu,
    rays: Box<dyn Rays>,
    accumulation: Accumulation,
    fixed: Option<Mutex<FixedSums>>,
}

impl Walked {
    /// Errors: [`crate::Error::AdapterMemory`].
    pub(super) fn new(gpu: &Gpu, rays: impl Rays + 'static, accumulation: Accumulation) -> Result<Self> {
        let [rows, elements] = rays.shape();
        let fixed = match accumulation {
            Accumulation::Fixed => {
                Some(Mutex::new(FixedSums::new(gpu, elements, &GpuVector::zeros(gpu, rows))?))
            }
            Accumulation::Float | Accumulation::Swap => None,
        };
        Ok(Self { gpu: gpu.clone(), rays: Box::new(rays), accumulation, fixed })
    }

    /// How sums are made where rays meet.
    pub fn accumulation(&self) -> Accumulation {
        self.accumulation
    }

    fn deposit(&self, consumer: Consumer, y: &GpuVector, x: &mut GpuVector, row_sums: f64) -> Result<()> {
        let [rows, elements] = self.rays.shape();
        expect_len("x", x, elements)?;
        expect_len("y", y, rows)?;
        match &self.fixed {
            None => {
                x.fill([0.0; 3]);
                let x = &*x;
                let bindings = |of_y, of_x| vec![y.binding(of_y), x.binding(of_x)];
                self.rays.record(&self.gpu, consumer, [y, x], &bindings);
            }
            Some(fixed) => {
                let mut fixed = lock(fixed);
                fixed.begin(&self.gpu, y, row_sums);
                let [low, high] = &fixed.words;
                self.rays.record(&self.gpu, consumer, [y, x], &|of_y, of_x| {
                    vec![y.binding(of_y), low.binding(of_x), high.binding(of_x), fixed.scales.whole()]
                });
                x.finish_fixed(&fixed.words, &fixed.scales);
            }
        }
        self.gpu.check()
    }
}

impl LinearOperator for Walked {
    type Domain = GpuVector;
    type Range = GpuVector;

    fn domain(&self) -> GpuVector {
        GpuVector::zeros(&self.gpu, self.rays.shape()[1])
    }

    fn range(&self) -> GpuVector {
        GpuVector::zeros(&self.gpu, self.rays.shape()[0])
    }

    fn apply(&self, x: &GpuVector, y: &mut GpuVector) -> Result<()> {
        let [rows, elements] = self.rays.shape();
        expect_len("x", x, elements)?;
        expect_len("y", y, rows)?;
        // Every slab of x, and every quantity, adds its share.
        y.fill([0.0; 3]);
        let y = &*y;
        let bindings = |of_y, of_x| vec![y.binding(of_y), x.binding(of_x)];
        self.rays.record(&self.gpu, Consumer::Gather, [y, x], &bindings);
        self.gpu.check()
    }

    fn apply_adjoint(&self, y: &GpuVector, x: &mut GpuVector) -> Result<()> {
        self.deposit(Consumer::Scatter(self.accumulation), y, x, self.rays.row_sums(1))
    }
}

impl DeviceOperator for Walked {
    fn squares(&self, y: &GpuVector, x: &mut GpuVector) -> Result<bool> {
        self.deposit(Consumer::Squares(self.accumulation), y, x, self.rays.row_sums(2))?;
        Ok(true)
    }

    fn is_deterministic(&self) -> bool {
        self.accumulation == Accumulation::Fixed
    }

    fn storage(&self) -> Storage {
        Storage { walked_rows: self.rays.shape()[0], ..Storage::default() }
    }
}
