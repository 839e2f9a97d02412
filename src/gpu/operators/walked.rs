//! Operators whose rays are walked anew in every application.

use std::ops::Range;
use std::slice;
use std::sync::{Arc, Mutex};

use super::device_operator::DeviceOperator;
use super::pace::Paces;
use super::rays::Rays;
use crate::Result;
use crate::gpu::device::{Allocation, Binding, Gpu};
use crate::gpu::kernels::{Accumulation, Kernel, Program, RAYS, Variant, Walk};
use crate::gpu::vectors::{FixedSums, GpuVector, Index, Slab};
use crate::operator::{Indexed, LinearOperator, RowOrder, Storage, Vector, expect_len, lock};

/// Rays that are walked over some of the elements: over all texels of a light map, or over one quantity of a volume.
#[derive(Debug)]
pub(super) struct WalkedPart {
    walk: Walk,
    elements: Range<usize>,
    /// What the rays pass through: the second group of bindings.
    passed: Vec<Arc<Allocation>>,
    rays: Rays,
    paces: Paces,
}

impl WalkedPart {
    pub(super) fn new(walk: Walk, elements: Range<usize>, passed: Vec<Arc<Allocation>>, rays: Rays) -> Self {
        Self { walk, elements, passed, rays, paces: Paces::default() }
    }
}

/// T, walked on the device; made by [`Walked::light_map`] or [`Walked::volume`].
///
/// Shapes  x: elements, y: rays, three channels each
/// Error   1e-5 relative to the explicit matrix in f64: rays are cut to the grid in f64, and walked in integers from there
/// Cost    one walk a row, in an order in which neighbours meet the same elements; scatters in f32 depend on the order in which rays arrive, those in fixed point do not
#[derive(Debug)]
pub struct Walked {
    gpu: Gpu,
    rows: usize,
    parts: Vec<WalkedPart>,
    accumulation: Accumulation,
    fixed: Option<Mutex<FixedSums>>,
    /// None where rows are walked in the order of their numbers.
    order: Option<InOrder>,
}

/// Rows in an order in which neighbours meet the same elements: lanes that walk side by side part less, and read the same.
#[derive(Debug)]
struct InOrder {
    /// The row at each position.
    rows: Index,
    /// What the rows show, or are given, in that order.
    shown: Mutex<GpuVector>,
}

impl Walked {
    /// Of parts that have the same rows, in an `order` of them, and elements one behind the other.
    ///
    /// Errors: [`crate::Error::AdapterMemory`].
    pub(super) fn new(
        gpu: &Gpu,
        (rows, order): (usize, &RowOrder),
        parts: Vec<WalkedPart>,
        accumulation: Accumulation,
    ) -> Result<Self> {
        let order = match order.rows() {
            [] => None,
            rows => {
                let shown = GpuVector::zeros(gpu, rows.len());
                Some(InOrder { rows: shown.index(&rows.into())?, shown: Mutex::new(shown) })
            }
        };
        let mut walked = Self { gpu: gpu.clone(), rows, parts, accumulation, fixed: None, order };
        if accumulation == Accumulation::Fixed {
            let sums = FixedSums::new(gpu, walked.elements(), &GpuVector::zeros(gpu, rows))?;
            walked.fixed = Some(Mutex::new(sums));
        }
        Ok(walked)
    }

    fn elements(&self) -> usize {
        self.parts.last().map_or(0, |part| part.elements.end)
    }

    /// Σ_k Σ_i w_ki at most, and with the power of 2 the same of squared row sums.
    fn row_sums(&self, power: usize) -> f64 {
        self.parts.iter().map(|part| part.rays.row_sums[power - 1]).sum()
    }

    /// Records a consumer for every slab of rays, of y and of x. `bindings` are those of the vectors.
    fn record(
        &self,
        consumer: Kernel,
        vectors: [&GpuVector; 2],
        bindings: &dyn Fn(Slab, Slab) -> Vec<Binding>,
    ) {
        let (gpu, deposits) = (&self.gpu, consumer != Kernel::Gather);
        for channels in GpuVector::channels(&vectors) {
            for part in &self.parts {
                let walk = part.walk.over(channels[1], deposits && gpu.tactics().sums_near);
                let program =
                    Program::new(consumer, Variant::Walk(walk, deposits.then_some(self.accumulation)));
                let passed: Vec<_> = part.passed.iter().map(|memory| memory.whole()).collect();
                for walking in part.rays.walkings(vectors, &part.elements, channels) {
                    let of_vectors = bindings(walking.of_y, walking.of_x);
                    part.paces.walk(consumer, gpu, walking.len(), &mut |rows| {
                        let (params, rays) = walking.of_rows(&rows);
                        let groups: [&[Binding]; 3] = [&of_vectors, &passed, slice::from_ref(&rays)];
                        gpu.dispatch(program, &params, &groups, [params.rows.div_ceil(RAYS), 1, 1]);
                    });
                }
            }
        }
    }

    fn gather(&self, x: &GpuVector, y: &mut GpuVector) {
        // Every slab of x, and every quantity, adds its share.
        y.fill([0.0; 3]);
        let y = &*y;
        let bindings = |of_y, of_x| vec![y.binding(of_y), x.binding(of_x)];
        self.record(Kernel::Gather, [y, x], &bindings);
    }

    /// How sums are made where rays meet.
    pub fn accumulation(&self) -> Accumulation {
        self.accumulation
    }

    fn deposit(&self, consumer: Kernel, y: &GpuVector, x: &mut GpuVector, row_sums: f64) -> Result<()> {
        expect_len("x", x, self.elements())?;
        expect_len("y", y, self.rows)?;
        let Some(InOrder { rows, shown }) = &self.order else {
            return self.deposit_shown(consumer, y, x, row_sums);
        };
        let mut shown = lock(shown);
        shown.pick(y, rows);
        self.deposit_shown(consumer, &shown, x, row_sums)
    }

    fn deposit_shown(&self, consumer: Kernel, y: &GpuVector, x: &mut GpuVector, row_sums: f64) -> Result<()> {
        match &self.fixed {
            None => {
                x.fill([0.0; 3]);
                let x = &*x;
                let bindings = |of_y, of_x| vec![y.binding(of_y), x.binding(of_x)];
                self.record(consumer, [y, x], &bindings);
            }
            Some(fixed) => {
                let mut fixed = lock(fixed);
                fixed.begin(&self.gpu, y, row_sums);
                let [low, high] = &fixed.words;
                self.record(consumer, [y, x], &|of_y, of_x| {
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
        GpuVector::zeros(&self.gpu, self.elements())
    }

    fn range(&self) -> GpuVector {
        GpuVector::zeros(&self.gpu, self.rows)
    }

    fn apply(&self, x: &GpuVector, y: &mut GpuVector) -> Result<()> {
        expect_len("x", x, self.elements())?;
        expect_len("y", y, self.rows)?;
        match &self.order {
            None => self.gather(x, y),
            Some(InOrder { rows, shown }) => {
                let mut shown = lock(shown);
                self.gather(x, &mut shown);
                y.overwrite(&shown, rows);
            }
        }
        self.gpu.check()
    }

    fn apply_adjoint(&self, y: &GpuVector, x: &mut GpuVector) -> Result<()> {
        self.deposit(Kernel::Scatter, y, x, self.row_sums(1))
    }
}

impl DeviceOperator for Walked {
    fn squares(&self, y: &GpuVector, x: &mut GpuVector) -> Result<bool> {
        self.deposit(Kernel::Squares, y, x, self.row_sums(2))?;
        Ok(true)
    }

    fn is_deterministic(&self) -> bool {
        self.accumulation == Accumulation::Fixed
    }

    fn storage(&self) -> Storage {
        Storage { walked_rows: self.rows, ..Storage::default() }
    }
}
