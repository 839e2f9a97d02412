//! The metric of dense tiles on the device; its blocks are those of the CPU's.

use super::Gpu;
use super::kernel::{Kernel, TileOperation};
use super::layout::Tiles;
use super::memory::Allocation;
use super::vector::{GpuVector, bound, numbers};
use crate::operator::{Bounds, Metric, Scalars, Vector};
use crate::{Error, Result};

/// A metric of dense blocks that majorizes Aᵀ A.
///
/// One workgroup takes one tile; see [`crate::operator::Metric`] for what the operations promise.
#[derive(Debug)]
pub struct TileMetric {
    gpu: Gpu,
    colored: bool,
    slabs: Vec<TileSlab>,
    /// Bound where an operation has no second vector.
    unused: Allocation,
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
    /// Errors: [`Error::AdapterMemory`]; [`Error::TooLarge`] for vectors that a kernel cannot see channel by channel.
    pub fn new<'a>(
        gpu: &Gpu,
        unknowns: usize,
        channels: usize,
        blocks: impl Iterator<Item = (&'a [u32], &'a [f32])>,
    ) -> Result<Self> {
        let longest = (unknowns * size_of::<f32>()) as u64;
        if longest > gpu.binding_limit() {
            return Err(Error::TooLarge {
                what: "a channel of the unknowns".to_owned(),
                needed: format!("{longest} bytes"),
                limit: format!("{} bytes", gpu.binding_limit()),
                remedy: "choose the metric `sqs`",
            });
        }
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
        Ok(Self { gpu: gpu.clone(), colored: channels == 3, slabs, unused: gpu.try_allocate("nothing", 4)? })
    }

    fn each(&self, operation: TileOperation, v: &GpuVector, y: Option<&GpuVector>, params: Tiles) {
        for [channel, channels] in GpuVector::channels(&[v]) {
            let kernel = Kernel::Tiles { colored: self.colored, channels, operation };
            let Some(part) = v.slabs([channel, channels]).next() else { continue };
            for slab in &self.slabs {
                let bindings = [
                    v.binding(part),
                    y.map_or_else(|| self.unused.whole(), |y| y.binding(part)),
                    slab.tiles.whole(),
                    slab.members.whole(),
                    slab.matrices.whole(),
                ];
                let params = Tiles { tiles: slab.count as u32, stride: v.stride as u32, channel, ..params };
                self.gpu.dispatch(kernel, &params, &[&bindings], self.gpu.grid(slab.count, 1));
            }
        }
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
        self.each(TileOperation::Stretch, v, None, Tiles::default());
    }

    fn shrink(&self, v: &mut GpuVector) {
        self.each(TileOperation::Shrink, v, None, Tiles::default());
    }

    fn descend(&self, x: &mut GpuVector, y: &GpuVector, norm: Scalars, bounds: &Bounds) {
        let [(_, [lower, upper]), (others, [then_lower, then_upper])] = bounds.parts(x.len());
        let params = Tiles {
            then: others.start as u32,
            lower: bound(lower),
            upper: bound(upper),
            then_lower: bound(then_lower),
            then_upper: bound(then_upper),
            shorter: numbers(norm.map(|norm| 1.0 / norm)),
            ..Tiles::default()
        };
        debug_assert_eq!(x.len(), y.len());
        self.each(TileOperation::Descend, x, Some(y), params);
    }

    fn majorizes(&self) -> bool {
        true
    }
}
