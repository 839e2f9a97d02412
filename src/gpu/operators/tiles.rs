//! The metric of dense tiles on the device; its blocks are those of the CPU's.

use std::ops::Range;
use std::sync::Mutex;

use crate::Result;
use crate::gpu::device::{Allocation, Binding, Gpu};
use crate::gpu::kernels::layout::{BoundsPart, TilesParams};
use crate::gpu::kernels::{Kernel, Program, TileOperation, Variant};
use crate::gpu::vectors::{GpuVector, bound, numbers};
use crate::operator::{Bounds, Metric, Scalars, Vector, lock};

/// A metric of dense blocks that majorizes Aᵀ A.
///
/// One workgroup takes one tile; see [`Metric`] for what the operations promise.
#[derive(Debug)]
pub struct TileMetric {
    gpu: Gpu,
    colored: bool,
    slabs: Vec<TileSlab>,
    /// Bound where an operation has no second vector and no bounds.
    unused: Allocation,
    /// The bounds of the last step. They seldom change from step to step, and are sent only then.
    last: Mutex<Option<SentBounds>>,
}

/// Bounds, and their parts on the device.
#[derive(Debug)]
struct SentBounds {
    bounds: Bounds,
    /// Elements that the parts cover.
    len: usize,
    count: usize,
    parts: Allocation,
}

/// What a step within bounds needs beside the gradient.
struct BoundedStep<'a> {
    from: &'a GpuVector,
    parts: Binding,
    count: usize,
    /// 1 / norm.
    shorter: [f32; 4],
}

/// So many tiles as can be seen at once.
#[derive(Debug)]
struct TileSlab {
    count: usize,
    tiles: Allocation,
    members: Allocation,
    matrices: Allocation,
}

impl TileMetric {
    /// From the blocks of [`TileBlocks`](crate::operator::TileBlocks), with so many `channels`.
    ///
    /// Errors: [`Error::AdapterMemory`](crate::Error::AdapterMemory); [`Error::TooLarge`](crate::Error::TooLarge) for vectors that a kernel cannot see channel by channel.
    pub fn new<'a>(
        gpu: &Gpu,
        unknowns: usize,
        channels: usize,
        blocks: impl Iterator<Item = (&'a [u32], &'a [f32])>,
    ) -> Result<Self> {
        let longest = (unknowns * size_of::<f32>()) as u64;
        gpu.expect_visible("a channel of the unknowns", longest, "choose the metric `sqs`")?;
        let at_once = gpu.binding_limit() as usize / size_of::<f32>();
        let (mut tiles, mut members, mut matrices) = (Vec::new(), Vec::new(), Vec::new());
        let mut slabs = Vec::new();
        for (block, matrix) in blocks {
            if matrices.len() + matrix.len() > at_once {
                slabs.push(TileSlab::new(gpu, &tiles, &members, &matrices)?);
                (tiles, members, matrices) = (Vec::new(), Vec::new(), Vec::new());
            }
            tiles.push([(matrices.len() / channels) as u32, members.len() as u32, block.len() as u32, 0]);
            members.extend_from_slice(block);
            matrices.extend_from_slice(matrix);
        }
        if !tiles.is_empty() {
            slabs.push(TileSlab::new(gpu, &tiles, &members, &matrices)?);
        }
        let unused = gpu.try_allocate("nothing", size_of::<BoundsPart>() as u64)?;
        Ok(Self { gpu: gpu.clone(), colored: channels == 3, slabs, unused, last: Mutex::default() })
    }

    /// The parts of bounds of so many elements on the device, and how many they are.
    fn parts(&self, bounds: &Bounds, len: usize) -> (Binding, usize) {
        let mut last = lock(&self.last);
        let sent = match last.take() {
            Some(sent) if sent.len == len && sent.bounds == *bounds => sent,
            _ => SentBounds::new(&self.gpu, bounds, len),
        };
        let sent = last.insert(sent);
        (sent.parts.whole(), sent.count)
    }

    fn each(&self, operation: TileOperation, v: &GpuVector, step: Option<&BoundedStep<'_>>) {
        let unused = || self.unused.whole();
        for [channel, channels] in GpuVector::channels(&[v]) {
            let colored = self.colored;
            // To stretch is to read a tile once, and the memory of a workgroup has no room for a coloured one.
            let held = self.gpu.tactics().holds_tiles && !colored && operation != TileOperation::Stretch;
            let variant = Variant::Tiles { colored, channels, operation, held };
            let Some(part) = v.slabs([channel, channels]).next() else { continue };
            for slab in &self.slabs {
                let bindings = [
                    v.binding(part),
                    step.map_or_else(unused, |step| step.from.binding(part)),
                    slab.tiles.whole(),
                    slab.members.whole(),
                    slab.matrices.whole(),
                    step.map_or_else(unused, |step| step.parts.clone()),
                ];
                let params = TilesParams {
                    tiles: slab.count as u32,
                    stride: v.stride as u32,
                    channel,
                    parts: step.map_or(0, |step| step.count as u32),
                    shorter: step.map_or([0.0; 4], |step| step.shorter),
                };
                let workgroups = self.gpu.grid(slab.count, 1);
                self.gpu.dispatch(Program::new(Kernel::Tiles, variant), &params, &[&bindings], workgroups);
            }
        }
    }
}

impl SentBounds {
    fn new(gpu: &Gpu, bounds: &Bounds, len: usize) -> Self {
        let part = |(range, [lower, upper]): (Range<usize>, [Scalars; 2])| BoundsPart {
            lower: bound(lower),
            upper: bound(upper),
            begin: range.start as u32,
            ..BoundsPart::default()
        };
        let sent: Vec<BoundsPart> = bounds.parts(len).map(part).collect();
        // A kernel sees one at least.
        let bytes = size_of_val(&sent[..]).max(size_of::<BoundsPart>()) as u64;
        let parts = gpu.allocate("the bounds", bytes);
        gpu.write(&parts, 0, &sent);
        Self { bounds: bounds.clone(), len, count: sent.len(), parts }
    }
}

impl TileSlab {
    fn new(gpu: &Gpu, tiles: &[[u32; 4]], members: &[u32], matrices: &[f32]) -> Result<Self> {
        Ok(Self {
            count: tiles.len(),
            tiles: gpu.upload("the tiles", tiles)?,
            members: gpu.upload("the tiles", members)?,
            matrices: gpu.upload("the tiles", matrices)?,
        })
    }
}

impl Metric<GpuVector> for TileMetric {
    fn stretch(&self, v: &mut GpuVector) {
        self.each(TileOperation::Stretch, v, None);
    }

    fn shrink(&self, v: &mut GpuVector) {
        self.each(TileOperation::Shrink, v, None);
    }

    fn descend(&self, x: &mut GpuVector, y: &GpuVector, norm: Scalars, bounds: &Bounds) {
        debug_assert_eq!(x.len(), y.len());
        let (parts, count) = self.parts(bounds, x.len());
        let step = BoundedStep { from: y, parts, count, shorter: numbers(norm.map(|norm| 1.0 / norm)) };
        self.each(TileOperation::Descend, x, Some(&step));
    }

    fn majorizes(&self) -> bool {
        true
    }
}
