//! The basis functions of a volume, sampled along a ray and gathered into one weight a voxel.

use super::super::Weight;
use super::super::basis::add;

/// Takes the voxels of a row. Not generic: walks are long, and each consumer would have a copy of all of them compiled.
pub(super) type Visit<'a, const C: usize> = dyn FnMut([usize; 3], Weight<f64, C>) + 'a;

/// A basis that takes samples of a ray in order and visits each voxel once, when the ray has left it.
///
/// The support of every basis function is convex, so a straight ray is inside it without interruption.
pub(super) trait VoxelWindow<const C: usize> {
    /// How far cells are shifted against voxels, and how many more there are a side.
    const SHIFT: f64;
    /// Cells beyond the number of voxels.
    const EXTRA: usize;
    /// Whether v is constant inside a cell.
    const CONSTANT: bool;

    fn new(size: [usize; 3]) -> Self;

    /// Adds `weight · v` for every basis function v, at position `at` (in cells) inside `cell`.
    fn sample(&mut self, cell: [usize; 3], at: [f64; 3], weight: Weight<f64, C>, visit: &mut Visit<C>);

    /// Adds weights of the eight voxels around a trilinear cell.
    fn add(&mut self, cell: [usize; 3], weights: [Weight<f64, C>; 8], visit: &mut Visit<C>);

    /// Visits what is left at the end of a ray.
    fn finish(self, visit: &mut Visit<C>);
}

/// Constant in each voxel.
pub(super) struct NearestVoxel<const C: usize> {
    voxel: [usize; 3],
    weight: Weight<f64, C>,
}

impl<const C: usize> VoxelWindow<C> for NearestVoxel<C> {
    const SHIFT: f64 = 0.0;
    const EXTRA: usize = 0;
    const CONSTANT: bool = true;

    fn new(_size: [usize; 3]) -> Self {
        Self { voxel: [usize::MAX; 3], weight: [0.0; C] }
    }

    #[inline(always)]
    fn sample(&mut self, cell: [usize; 3], _at: [f64; 3], weight: Weight<f64, C>, visit: &mut Visit<C>) {
        if cell == self.voxel {
            return add(&mut self.weight, weight);
        }
        if is_something(self.weight) {
            visit(self.voxel, self.weight);
        }
        (self.voxel, self.weight) = (cell, weight);
    }

    fn add(&mut self, _cell: [usize; 3], _weights: [Weight<f64, C>; 8], _visit: &mut Visit<C>) {
        unreachable!("its cells are voxels")
    }

    #[inline(always)]
    fn finish(self, visit: &mut Visit<C>) {
        if is_something(self.weight) {
            visit(self.voxel, self.weight);
        }
    }
}

/// Trilinear between voxel centres, constant beyond the outermost ones.
///
/// Cell (i, j, k) lies between voxels i − 1 and i, and so on; the first and the last along an axis are half outside the
/// grid, where only the inner voxel counts.
pub(super) struct Trilinear<const C: usize> {
    size: [usize; 3],
    cell: [usize; 3],
    /// Weights of the eight voxels around; x in the lowest bit of the place, then y, then z.
    taps: [Weight<f64, C>; 8],
}

impl<const C: usize> Trilinear<C> {
    /// Moves the window over `cell`, visits the voxels that it leaves and keeps the others.
    #[inline(always)]
    fn move_to(&mut self, cell: [usize; 3], visit: &mut Visit<C>) {
        if cell == self.cell {
            return;
        }
        if (0..3).any(|axis| cell[axis].abs_diff(self.cell[axis]) > 1) {
            (0..8).for_each(|tap| self.leave(tap, self.taps[tap], visit));
            (self.cell, self.taps) = (cell, [[0.0; C]; 8]);
            return;
        }
        for axis in 0..3 {
            if cell[axis] == self.cell[axis] {
                continue;
            }
            let is_ahead = cell[axis] > self.cell[axis];
            for low in (0..8).filter(|tap| tap >> axis & 1 == 0) {
                let high = low | 1 << axis;
                let (left, kept) = if is_ahead { (low, high) } else { (high, low) };
                self.leave(left, self.taps[left], visit);
                self.taps[left] = self.taps[kept];
                self.taps[kept] = [0.0; C];
            }
            self.cell[axis] = cell[axis];
        }
    }

    #[inline(always)]
    fn leave(&self, tap: usize, weight: Weight<f64, C>, visit: &mut Visit<C>) {
        // A weight is zero where its voxel would be outside.
        if is_something(weight) {
            visit(std::array::from_fn(|axis| self.cell[axis] + (tap >> axis & 1) - 1), weight);
        }
    }
}

impl<const C: usize> VoxelWindow<C> for Trilinear<C> {
    const SHIFT: f64 = 0.5;
    const EXTRA: usize = 1;
    const CONSTANT: bool = false;

    fn new(size: [usize; 3]) -> Self {
        Self { size, cell: [0; 3], taps: [[0.0; C]; 8] }
    }

    #[inline(always)]
    fn sample(&mut self, cell: [usize; 3], at: [f64; 3], weight: Weight<f64, C>, visit: &mut Visit<C>) {
        self.move_to(cell, visit);
        let parts = parts(cell, at, self.size);
        for (tap, part) in self.taps.iter_mut().zip(parts) {
            add(tap, weight.map(|value| value * part));
        }
    }

    #[inline(always)]
    fn add(&mut self, cell: [usize; 3], weights: [Weight<f64, C>; 8], visit: &mut Visit<C>) {
        self.move_to(cell, visit);
        self.taps.iter_mut().zip(weights).for_each(|(tap, weight)| add(tap, weight));
    }

    #[inline(always)]
    fn finish(self, visit: &mut Visit<C>) {
        for (tap, &weight) in self.taps.iter().enumerate() {
            self.leave(tap, weight, visit);
        }
    }
}

/// The trilinear weights of the eight voxels around a position in a cell. They sum to 1, and are exactly zero for voxels outside the
/// grid.
#[inline(always)]
pub(super) fn parts(cell: [usize; 3], at: [f64; 3], size: [usize; 3]) -> [f64; 8] {
    let fraction: [f64; 3] = std::array::from_fn(|axis| match cell[axis] {
        0 => 1.0,
        last if last == size[axis] => 0.0,
        index => (at[axis] - index as f64).clamp(0.0, 1.0),
    });
    std::array::from_fn(|tap| {
        let side = |axis: usize| if tap >> axis & 1 == 1 { fraction[axis] } else { 1.0 - fraction[axis] };
        side(0) * side(1) * side(2)
    })
}

#[inline(always)]
fn is_something<const C: usize>(weight: Weight<f64, C>) -> bool {
    weight.iter().any(|&value| value != 0.0)
}
