//! Lengths of lines inside the basis functions of extinction.

use std::ops::ControlFlow;

use super::cells::{CellRay, Line, Slabs};
use super::elements::VoxelElements;
use super::quadrature::GAUSS_2;
use super::steps::each_step;
use super::window::{Visit, VoxelWindow};

/// Pieces that are settled together.
const AT_ONCE: usize = 8;

/// Adds the lengths of a line inside the basis functions of extinction.
#[inline(always)]
pub(super) fn lengths<const C: usize, W: VoxelWindow<C>>(
    (line, [a, b]): (&Line, [f64; 2]),
    part: &VoxelElements,
    window: &mut W,
    visit: &mut Visit<C>,
) {
    let cells = CellRay::new(line, &part.grid, W::SHIFT);
    let high = part.grid.size().map(|side| side as f64 + W::SHIFT);
    let Some([a, b]) = cells.clip(W::SHIFT, high, a, b) else { return };
    if W::CONSTANT {
        let mut waiting = Waiting {
            cells: [[0; 3]; AT_ONCE + 3],
            lengths: [0.0; AT_ONCE + 3],
            len: 0,
            take: |cell, length| window.sample(cell, [0.0; 3], [length; C], visit),
        };
        let _all_visited = cells.slab_pieces(&part.cells, a, b, &mut waiting);
        waiting.take(waiting.len);
        return;
    }
    let _all_visited = cells.pieces(&part.cells, a, b, |cell, a, b| {
        let length = b - a;
        for [u, weight] in GAUSS_2 {
            window.sample(cell, cells.at(a + u * length), [weight * length; C], visit);
        }
        ControlFlow::Continue(())
    });
}

/// Cells and lengths of the pieces of a ray, without those that have none: nothing that a processor has to guess.
struct Waiting<V> {
    cells: [[usize; 3]; AT_ONCE + 3],
    lengths: [f64; AT_ONCE + 3],
    len: usize,
    take: V,
}

impl<V: FnMut([usize; 3], f64)> Waiting<V> {
    fn take(&mut self, count: usize) {
        for (&cell, &length) in self.cells.iter().zip(&self.lengths).take(count) {
            (self.take)(cell, length);
        }
    }
}

impl<V: FnMut([usize; 3], f64)> Slabs for Waiting<V> {
    #[inline(always)]
    fn piece(&mut self, cell: [usize; 3], a: f64, b: f64) {
        (self.cells[self.len], self.lengths[self.len]) = (cell, b - a);
        self.len += usize::from(b > a);
    }

    #[inline(always)]
    fn settle(&mut self) -> ControlFlow<()> {
        if self.len >= AT_ONCE {
            self.take(AT_ONCE);
            self.cells.copy_within(AT_ONCE.., 0);
            self.lengths.copy_within(AT_ONCE.., 0);
            self.len -= AT_ONCE;
        }
        ControlFlow::Continue(())
    }
}

/// The same as [`lengths`] in equal steps.
pub(super) fn march_lengths<const C: usize, W: VoxelWindow<C>>(
    (line, ends): (&Line, [f64; 2]),
    steps: u32,
    part: &VoxelElements,
    window: &mut W,
    visit: &mut Visit<C>,
) {
    let cells = CellRay::new(line, &part.grid, W::SHIFT);
    let high = part.grid.size().map(|side| side as f64 + W::SHIFT);
    each_step(line, ends, steps, &part.grid, |t, length| {
        let at = cells.at(t);
        let cell = at.map(|x| x as usize);
        if (0..3).all(|axis| at[axis] >= W::SHIFT && at[axis] < high[axis]) && part.cells.contains(cell) {
            window.sample(cell, at, [length; C], visit);
        }
        true
    });
}
