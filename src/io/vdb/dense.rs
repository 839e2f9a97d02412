use super::mask::{Mask, place_of, slot_at};
use super::tree::{LEAF_LOG2, Node};
use crate::scene::VoxelGrid;
use crate::{Error, Result};

/// Voxels of a dense box at most: a few bytes of a file can claim any number.
pub(super) const MAX_DENSE: usize = 1 << 29;

/// The least box around voxels; empty at first.
#[derive(Debug, Clone, Copy)]
pub(super) struct IndexBox {
    pub(super) min: [i64; 3],
    /// Belongs to the box.
    pub(super) max: [i64; 3],
}

impl IndexBox {
    pub(super) const EMPTY: Self = Self { min: [i64::MAX; 3], max: [i64::MIN; 3] };

    pub(super) fn include(&mut self, voxel: [i64; 3]) {
        for (axis, side) in voxel.into_iter().enumerate() {
            self.min[axis] = self.min[axis].min(side);
            self.max[axis] = self.max[axis].max(side);
        }
    }

    /// Includes what is active of a part.
    pub(super) fn include_active<const C: usize>(&mut self, part: &Node<C>) {
        match *part {
            Node::Tile { origin, side, active: true, .. } => {
                self.include(origin);
                self.include(origin.map(|first| first + side - 1));
            }
            Node::Tile { .. } => {}
            Node::Leaf { origin, active } => self.include_leaf(origin, active),
        }
    }

    fn include_leaf(&mut self, origin: [i64; 3], active: &Mask) {
        for slot in active.slots() {
            let place = place_of(slot, LEAF_LOG2);
            self.include(std::array::from_fn(|axis| origin[axis] + place[axis] as i64));
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.min[0] > self.max[0]
    }

    /// Voxels a side; `what` is named in errors.
    ///
    /// Errors: [`Error::TooLarge`] for more than `max_voxels` or [`VoxelGrid::MAX_SIDE`] a side.
    pub(super) fn size(&self, what: String, max_voxels: usize) -> Result<[usize; 3]> {
        let size: [i64; 3] = std::array::from_fn(|axis| self.max[axis] - self.min[axis] + 1);
        let side = size.map(|side| usize::try_from(side).unwrap_or(0));
        let voxels = side.iter().try_fold(1, |product: usize, &side| product.checked_mul(side));
        if side.iter().all(|&side| side <= VoxelGrid::MAX_SIDE) && voxels.is_some_and(|all| all <= max_voxels)
        {
            return Ok(side);
        }
        Err(Error::TooLarge {
            what,
            needed: format!("{} × {} × {} voxels", size[0], size[1], size[2]),
            limit: format!("{max_voxels} in all and {} a side", VoxelGrid::MAX_SIDE),
            remedy: "crop or resample the grid",
        })
    }
}

/// The values of all voxels of a box; x runs fastest.
pub(super) struct DenseGrid<const C: usize> {
    min: [i64; 3],
    size: [usize; 3],
    pub(super) values: Vec<[f32; C]>,
}

impl<const C: usize> DenseGrid<C> {
    /// Errors: [`Error::Machine`] without the memory for it.
    pub(super) fn new(min: [i64; 3], size: [usize; 3], background: [f32; C]) -> Result<Self> {
        let mut values = Vec::new();
        let count = size.iter().product();
        if values.try_reserve_exact(count).is_err() {
            return Err(Error::Machine(format!("there is no memory for {count} voxels of a VDB grid")));
        }
        values.resize(count, background);
        Ok(Self { min, size, values })
    }

    /// Fills what lies inside of a cube.
    pub(super) fn fill(&mut self, origin: [i64; 3], side: i64, value: [f32; C]) {
        let [xs, ys, zs] = self.overlap(origin, side);
        if xs.is_empty() {
            return;
        }
        for z in zs {
            for y in ys.clone() {
                let row = self.index([0, y, z]);
                if let Some(row) = self.values.get_mut(row + xs.start..row + xs.end) {
                    row.fill(value);
                }
            }
        }
    }

    /// Places what lies inside of a leaf.
    pub(super) fn place(&mut self, origin: [i64; 3], leaf: &[[f32; C]]) {
        let [xs, ys, zs] = self.overlap(origin, 1 << LEAF_LOG2);
        let first: [i64; 3] = std::array::from_fn(|axis| origin[axis] - self.min[axis]);
        let inside = |axis: usize, at: usize| (at as i64 - first[axis]) as usize;
        for z in zs {
            for y in ys.clone() {
                for x in xs.clone() {
                    let slot = slot_at([inside(0, x), inside(1, y), inside(2, z)], LEAF_LOG2);
                    let index = self.index([x, y, z]);
                    if let (Some(to), Some(from)) = (self.values.get_mut(index), leaf.get(slot)) {
                        *to = *from;
                    }
                }
            }
        }
    }

    /// The voxels of a cube that lie in the box.
    fn overlap(&self, origin: [i64; 3], side: i64) -> [std::ops::Range<usize>; 3] {
        std::array::from_fn(|axis| {
            let first = origin[axis] - self.min[axis];
            let inside = |at: i64| at.clamp(0, self.size[axis] as i64) as usize;
            inside(first)..inside(first + side)
        })
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.size[1] + y) * self.size[0] + x
    }
}
