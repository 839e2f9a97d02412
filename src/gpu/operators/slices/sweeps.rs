//! E on the device: from samples of slices to rays, and back.

use std::sync::Mutex;

use super::batch::{Batch, ROOM, batches};
use crate::Result;
use crate::gpu::device::{Allocation, Binding, Gpu};
use crate::gpu::kernels::layout::SweepParams;
use crate::gpu::kernels::{Kernel, Program, RAYS, Variant};
use crate::gpu::operators::rounds;
use crate::gpu::vectors::{GpuVector, Slab};
use crate::march::{Fan, Fans};
use crate::operator::{LinearOperator, Vector, expect_len, lock};

/// What rays show of the samples that they pass as a whole: E, but for the samples in which they end.
///
/// Shapes  x: needed samples of all fans, y: rows
/// Error   1e-6 of the largest number: sums are those of trees, and rays and samples are sorted by the processor
/// Cost    O(log n) a ray and a sample, times the terms of the expansion; the same bits in every run
#[derive(Debug)]
pub(super) struct Sweeps {
    gpu: Gpu,
    samples: usize,
    rows: usize,
    batches: Vec<Batch>,
    /// What the terms of rays or samples give, and the trees.
    room: Mutex<[Allocation; 2]>,
}

impl Sweeps {
    /// Hands the fans over.
    ///
    /// Errors: [`Error::AdapterMemory`](crate::Error::AdapterMemory); [`Error::TooLarge`](crate::Error::TooLarge) for samples that a kernel cannot see
    /// as a whole, and for fans whose loops would not end by themselves.
    pub(super) fn new(gpu: &Gpu, fans: &Fans) -> Result<Self> {
        let (samples, rows) = (fans.samples(), fans.rows());
        gpu.expect_visible("a channel of the samples of all slices", 4 * samples.max(rows) as u64, SMALLER)?;
        let rounds_of = || fans.fans().iter().map(|fan| rounds_of(fans, fan)).max().unwrap_or(0);
        rounds::check(gpu, rounds_of, SMALLER)?;
        let most = gpu.binding_limit().min(ROOM) as usize / size_of::<[f32; 3]>();
        let numbers = |fan: &Fan| fan.nodes().len() * (fan.needed().len() + 1).max(fan.ray_count());
        let (ranges, largest) = batches(fans.fans(), most, numbers);
        let bytes = (largest * size_of::<[f32; 3]>()) as u64;
        gpu.expect_visible("the tree of a slice", bytes, SMALLER)?;
        let (mut handed, mut first_sample) = (Vec::new(), 0);
        for range in ranges {
            let of_batch = &fans.fans()[range];
            handed.push(Batch::new(gpu, fans, of_batch, first_sample)?);
            first_sample += of_batch.iter().map(|fan| fan.needed().len()).sum::<usize>();
        }
        let room = || gpu.try_allocate("the trees of slices", bytes);
        let room = Mutex::new([room()?, room()?]);
        Ok(Self { gpu: gpu.clone(), samples, rows, batches: handed, room })
    }

    /// Records two kernels for each batch and the channels that are bound together.
    fn record(
        &self,
        [x, y]: [&GpuVector; 2],
        kernels: [Kernel; 2],
        bindings: impl Fn(&Batch, [Binding; 2], [&Allocation; 2]) -> [Vec<Binding>; 2],
    ) {
        let [partials, tree] = &*lock(&self.room);
        for [channel, channels] in GpuVector::channels(&[x, y]) {
            let bound =
                |vector: &GpuVector, len: usize| vector.binding(Slab { channel, channels, first: 0, len });
            for (number, batch) in self.batches.iter().enumerate() {
                // A batch takes long enough for a submission of its own.
                if number > 0 {
                    self.gpu.hand_over();
                }
                let [items, rays, samples] = batch.counts;
                let params = SweepParams {
                    items,
                    rays,
                    samples,
                    first_sample: batch.first_sample,
                    channel,
                    channels,
                    x_stride: x.stride as u32,
                    y_stride: y.stride as u32,
                };
                let vectors = [bound(x, self.samples), bound(y, self.rows)];
                for (kernel, bindings) in kernels.into_iter().zip(bindings(batch, vectors, [partials, tree]))
                {
                    let lanes = channels
                        * match kernel {
                            Kernel::SweepShown => rays,
                            Kernel::SweepSpread => samples,
                            _ => items,
                        };
                    let program = Program::new(kernel, Variant::Lanes);
                    self.gpu.dispatch(program, &params, &[&bindings], self.gpu.grid(lanes as usize, RAYS));
                }
            }
        }
    }

    /// y ← E x.
    ///
    /// Errors: [`Error::Shape`](crate::Error::Shape) when a vector does not fit, and what has gone wrong on the device.
    pub(super) fn gather(&self, x: &GpuVector, y: &mut GpuVector) -> Result<()> {
        expect_len("the samples", x, self.samples)?;
        expect_len("the rows", y, self.rows)?;
        // Rows that show nothing are in no fan.
        y.fill([0.0; 3]);
        self.record([x, y], [Kernel::SweepGather, Kernel::SweepShown], |batch, [x, y], [partials, tree]| {
            let Batch { items, samples, order, rays, coefficients, .. } = batch;
            let [items, samples, order, rays, coefficients, partials, tree] =
                [items, samples, order, rays, coefficients, partials, tree].map(Allocation::whole);
            let sweep = vec![partials.clone(), tree, items, samples, order, rays.clone(), x];
            [sweep, vec![y, rays, coefficients, partials]]
        });
        self.gpu.check()
    }
}

pub(super) const SMALLER: &str = "lower the maps' or the views' sizes, or compute on the processor";

/// Rounds of the loops of one lane over a fan: as many nodes of the tree are looked at in either direction.
fn rounds_of(fans: &Fans, fan: &Fan) -> usize {
    let samples = fan.needed().len();
    let added = |place: usize| {
        let behind = |node: &usize| Some(node + (node & node.wrapping_neg()));
        std::iter::successors(Some(place + 1), behind).take_while(|&node| node <= samples).count()
    };
    let rays = fans.rays_of(fan).iter().map(|ray| 1 + ray.whole().count_ones() as usize);
    let switched = fan.order().iter().map(|&sample| 1 + added(usize::from(sample)));
    samples + 1 + rays.sum::<usize>() + switched.sum::<usize>()
}

impl LinearOperator for Sweeps {
    type Domain = GpuVector;
    type Range = GpuVector;

    fn domain(&self) -> GpuVector {
        GpuVector::zeros(&self.gpu, self.samples)
    }

    fn range(&self) -> GpuVector {
        GpuVector::zeros(&self.gpu, self.rows)
    }

    fn apply(&self, x: &GpuVector, y: &mut GpuVector) -> Result<()> {
        self.gather(x, y)
    }

    fn apply_adjoint(&self, y: &GpuVector, x: &mut GpuVector) -> Result<()> {
        expect_len("the samples", x, self.samples)?;
        expect_len("the rows", y, self.rows)?;
        let x = &*x;
        self.record(
            [x, y],
            [Kernel::SweepScatter, Kernel::SweepSpread],
            |batch, [x, y], [partials, tree]| {
                let Batch { items, samples, order, rays, coefficients, .. } = batch;
                let [items, samples, order, rays, coefficients, partials, tree] =
                    [items, samples, order, rays, coefficients, partials, tree].map(Allocation::whole);
                let sweep = vec![partials.clone(), tree, items.clone(), order, rays, coefficients, y];
                [sweep, vec![x, items, samples, partials]]
            },
        );
        self.gpu.check()
    }
}
