//! Values of a grid, copied so that those that a ray meets one after the other lie near each other.

use rayon::prelude::*;

use crate::scene::{BRICK, VoxelSet};

/// Voxels along an axis of a block: one more than the cells of a brick have, between voxel centres.
pub(super) const AROUND: usize = BRICK + 1;
/// The same where cells are voxels.
pub(super) const WITHIN: usize = BRICK;
/// What is no block.
const NOWHERE: u32 = u32::MAX;

/// A block of `SIDE`³ values for every brick of cells that holds something.
///
/// The voxels around a cell are in up to eight bricks of a vector, but in one block. Beyond the grid stand the values of its outermost voxels.
pub(super) struct Blocks<const SIDE: usize> {
    /// The block of each brick of cells.
    of_brick: Vec<u32>,
    bricks: [usize; 3],
    /// The brick of each block.
    places: Vec<[usize; 3]>,
    /// Voxels of the grid.
    size: [usize; 3],
}

impl<const SIDE: usize> Blocks<SIDE> {
    /// Values of a block.
    pub(super) const LEN: usize = SIDE * SIDE * SIDE;
    /// How far apart neighbours along each axis are.
    pub(super) const STRIDES: [usize; 3] = [1, SIDE, SIDE * SIDE];
    /// Cells between centres begin half a voxel before the first.
    const BEFORE: usize = SIDE - BRICK;

    /// The blocks of cells in a grid of so many voxels.
    pub(super) fn of(cells: &VoxelSet, size: [usize; 3]) -> Self {
        let bricks = cells.bricks();
        let mut of_brick = vec![NOWHERE; bricks.iter().product()];
        let mut places = Vec::new();
        for (n, block) in of_brick.iter_mut().enumerate() {
            let place = [n % bricks[0], n / bricks[0] % bricks[1], n / bricks[0] / bricks[1]];
            if !cells.is_brick_empty(place) {
                *block = places.len() as u32;
                places.push(place);
            }
        }
        Self { of_brick, bricks, places, size }
    }

    /// Values of all blocks of cells.
    pub(super) fn values(cells: &VoxelSet) -> usize {
        let [full, all] = cells.empty_bricks();
        (all - full) * Self::LEN
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.places.len()
    }

    /// The block of the brick whose first cell is this.
    #[inline(always)]
    pub(super) fn block(&self, first_cell: [usize; 3]) -> Option<usize> {
        self.number(first_cell.map(|cell| cell / BRICK))
    }

    #[inline(always)]
    fn number(&self, brick: [usize; 3]) -> Option<usize> {
        let block = self.of_brick[(brick[2] * self.bricks[1] + brick[1]) * self.bricks[0] + brick[0]];
        (block != NOWHERE).then_some(block as usize)
    }

    /// The values of all blocks, each that of a voxel.
    pub(super) fn filled<const L: usize>(
        &self,
        value: impl Fn([usize; 3]) -> [f32; L] + Sync,
    ) -> Vec<[f32; L]> {
        let mut values = vec![[0.0; L]; self.len() * Self::LEN];
        values.par_chunks_mut(Self::LEN).zip(&self.places).for_each(|(block, brick)| {
            for (n, filled) in block.iter_mut().enumerate() {
                let local = [n % SIDE, n / SIDE % SIDE, n / SIDE / SIDE];
                *filled = value(std::array::from_fn(|axis| {
                    let place = brick[axis] * BRICK + local[axis];
                    place.saturating_sub(Self::BEFORE).min(self.size[axis] - 1)
                }));
            }
        });
        values
    }

    /// Visits where among the values of all blocks those of a voxel stand.
    pub(super) fn each_copy(&self, voxel: [usize; 3], mut visit: impl FnMut(usize)) {
        let along: [_; 3] = std::array::from_fn(|axis| self.along(axis, voxel[axis]));
        let copies = |axis: usize| along[axis].into_iter().flatten();
        for [k, c] in copies(2) {
            for [j, b] in copies(1) {
                for [i, a] in copies(0) {
                    if let Some(block) = self.number([i, j, k]) {
                        visit(block * Self::LEN + (c * SIDE + b) * SIDE + a);
                    }
                }
            }
        }
    }

    /// The bricks along an axis in whose blocks a voxel stands, each with its place there.
    fn along(&self, axis: usize, voxel: usize) -> [Option<[usize; 2]>; 6] {
        let mut found = [None; 6];
        let (first, last) = (0, self.size[axis] - 1);
        // The places beyond the grid are those of its outermost voxels.
        let places = [
            Some(voxel + Self::BEFORE),
            (Self::BEFORE > 0 && voxel == first).then_some(0),
            (Self::BEFORE > 0 && voxel == last).then_some(voxel + 2 * Self::BEFORE),
        ];
        for (place, found) in places.into_iter().zip(found.chunks_mut(2)) {
            let Some(place) = place else { continue };
            let (brick, local) = (place / BRICK, place % BRICK);
            found[0] = (brick < self.bricks[axis]).then_some([brick, local]);
            found[1] = (local < Self::BEFORE && brick > 0).then(|| [brick - 1, local + BRICK]);
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn copies_are_found<const SIDE: usize>(size: [usize; 3], holds: impl Fn(usize) -> bool) {
        let set = VoxelSet::new(size, holds);
        let cells = if SIDE == AROUND { set.cells_between() } else { set };
        let blocks = Blocks::<SIDE>::of(&cells, size);
        let number = |[i, j, k]: [usize; 3]| (k * size[1] + j) * size[0] + i;
        let values = blocks.filled(|voxel| [number(voxel) as f32]);
        let mut seen = vec![false; values.len()];
        for n in 0..size.iter().product() {
            let voxel = [n % size[0], n / size[0] % size[1], n / size[0] / size[1]];
            blocks.each_copy(voxel, |place| {
                assert_eq!(values[place], [n as f32]);
                assert!(!std::mem::replace(&mut seen[place], true), "{voxel:?} comes twice");
            });
        }
        // All that a cell can ask for is some voxel's.
        for brick in &blocks.places {
            for local in (0..Blocks::<SIDE>::LEN).map(|n| [n % SIDE, n / SIDE % SIDE, n / SIDE / SIDE]) {
                let is_asked_for =
                    (0..3).all(|axis| brick[axis] * BRICK + local[axis] < cells.size()[axis] + SIDE - BRICK);
                let place = blocks.number(*brick).unwrap() * Blocks::<SIDE>::LEN
                    + (local[2] * SIDE + local[1]) * SIDE
                    + local[0];
                assert_eq!(seen[place], is_asked_for, "{brick:?} {local:?}");
            }
        }
    }

    #[test]
    fn copies_of_a_voxel_are_found() {
        for size in [[7, 8, 9], [1, 16, 23], [15, 17, 2]] {
            copies_are_found::<AROUND>(size, |_| true);
            copies_are_found::<WITHIN>(size, |_| true);
            copies_are_found::<AROUND>(size, |n| n % 89 == 3);
            copies_are_found::<WITHIN>(size, |n| n % 89 == 3);
        }
    }
}
