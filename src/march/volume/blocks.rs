//! The elements of a grid, copied so that those that a ray meets one after the other lie near each other.

use rayon::prelude::*;

use super::super::Real;
use super::elements::VoxelElements;
use crate::scene::BRICK;

/// Voxels along an axis of a block: one more than the cells of a brick have, between voxel centres.
pub(super) const AROUND: usize = BRICK + 1;
/// The same where cells are voxels.
pub(super) const WITHIN: usize = BRICK;
/// How far behind the first the voxels around a cell stand in a block; x in the lowest bit of the place, then y, then z.
pub(super) const STEPS: [usize; 8] = {
    let mut steps = [0; 8];
    let mut tap = 0;
    while tap < 8 {
        steps[tap] = (tap >> 2) * AROUND * AROUND + (tap >> 1 & 1) * AROUND + (tap & 1);
        tap += 1;
    }
    steps
};
/// What is no block.
const NOWHERE: u32 = u32::MAX;

/// Three channels of elements and a fourth number that nobody reads: a block of `SIDE`³ for every brick of cells that an element reaches into.
///
/// The voxels around a cell are in up to eight bricks of a vector, but in one block.
pub(super) struct Blocks<X, const SIDE: usize> {
    /// The block of each brick of cells.
    of_brick: Vec<u32>,
    bricks: [usize; 3],
    values: Vec<[X; 4]>,
}

impl<X: Real, const SIDE: usize> Blocks<X, SIDE> {
    const LEN: usize = SIDE * SIDE * SIDE;

    /// Copies the elements of a part.
    pub(super) fn of(part: &VoxelElements, x: &[[X; 3]]) -> Self {
        let (cells, voxels) = (part.cells(), part.voxels());
        let bricks = cells.bricks();
        let place = |n: usize| [n % bricks[0], n / bricks[0] % bricks[1], n / bricks[0] / bricks[1]];
        let mut of_brick = vec![NOWHERE; bricks.iter().product()];
        let mut full = Vec::new();
        for (n, block) in of_brick.iter_mut().enumerate().filter(|(n, _)| !cells.is_brick_empty(place(*n))) {
            *block = full.len() as u32;
            full.push(place(n));
        }
        let size = voxels.size();
        // Cells between centres begin half a voxel before the first.
        let before = SIDE - BRICK;
        let mut values = vec![[X::zero(); 4]; full.len() * Self::LEN];
        values.par_chunks_mut(Self::LEN).zip(&full).for_each(|(block, brick)| {
            for (n, value) in block.iter_mut().enumerate() {
                let local = [n % SIDE, n / SIDE % SIDE, n / SIDE / SIDE];
                let voxel: [usize; 3] =
                    std::array::from_fn(|axis| (brick[axis] * BRICK + local[axis]).wrapping_sub(before));
                let is_inside = (0..3).all(|axis| voxel[axis] < size[axis]);
                if let Some(number) = if is_inside { voxels.number(voxel) } else { None } {
                    let [r, g, b] = x[number as usize];
                    *value = [r, g, b, X::zero()];
                }
            }
        });
        Self { of_brick, bricks, values }
    }

    /// Where a cell's first voxel is; none where no element is near.
    #[inline(always)]
    fn place(&self, [i, j, k]: [usize; 3]) -> Option<usize> {
        let brick = (k / BRICK * self.bricks[1] + j / BRICK) * self.bricks[0] + i / BRICK;
        let block = self.of_brick[brick];
        let local = (k % BRICK * SIDE + j % BRICK) * SIDE + i % BRICK;
        (block != NOWHERE).then(|| block as usize * Self::LEN + local)
    }
}

impl<X: Real> Blocks<X, AROUND> {
    /// The elements around a cell between voxel centres, those [`STEPS`] behind the first; none where no element is near.
    #[inline(always)]
    pub(super) fn around(&self, cell: [usize; 3]) -> Option<&[[X; 4]; STEPS[7] + 1]> {
        self.values[self.place(cell)?..].first_chunk()
    }
}

impl<X: Real> Blocks<X, WITHIN> {
    /// The element of a voxel; zero where it is none.
    #[inline(always)]
    pub(super) fn at(&self, voxel: [usize; 3]) -> [X; 4] {
        self.place(voxel).map_or([X::zero(); 4], |place| self.values[place])
    }
}
