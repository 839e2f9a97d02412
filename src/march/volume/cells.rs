//! A ray through the cells of a voxel grid, brick by brick.

use std::ops::ControlFlow;

use glam::DVec3;

use crate::scene::{BRICK, VoxelGrid, VoxelSet};

/// A straight piece of a view ray in world space: t runs in metres from the origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Line {
    pub(crate) origin: DVec3,
    /// Unit direction.
    pub(crate) direction: DVec3,
}

/// Takes the pieces of a ray slab by slab.
pub(super) trait Slabs {
    /// A piece [a, b] in a cell; a may be b.
    fn piece(&mut self, cell: [usize; 3], a: f64, b: f64);

    /// Is asked after each slab, of three pieces, whether to go on.
    #[inline(always)]
    fn settle(&mut self) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

impl<V: FnMut([usize; 3], f64, f64)> Slabs for V {
    #[inline(always)]
    fn piece(&mut self, cell: [usize; 3], a: f64, b: f64) {
        self(cell, a, b);
    }
}

/// A line in cells: each coordinate is affine in t.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CellRay {
    pub(super) origin: [f64; 3],
    /// Cells a metre.
    pub(crate) slope: [f64; 3],
    /// 1 / slope, infinite where the slope is zero.
    inverse: [f64; 3],
}

impl CellRay {
    /// The line in cells that are shifted by `shift` against the voxels of a grid.
    pub(crate) fn new(line: &Line, grid: &VoxelGrid, shift: f64) -> Self {
        let origin = grid.grid_from_world().transform_point3(line.origin) + shift;
        let slope = grid.grid_from_world().transform_vector3(line.direction);
        Self::of(origin.to_array(), slope.to_array())
    }

    fn of(origin: [f64; 3], slope: [f64; 3]) -> Self {
        // A coordinate that does not change never crosses: infinite for zero of either sign.
        let inverse = slope.map(|slope| if slope == 0.0 { f64::INFINITY } else { slope.recip() });
        Self { origin, slope, inverse }
    }

    /// The same in bricks.
    fn coarse(&self) -> Self {
        let part = (BRICK as f64).recip();
        Self::of(self.origin.map(|x| x * part), self.slope.map(|x| x * part))
    }

    /// Position in cells.
    #[inline(always)]
    pub(crate) fn at(&self, t: f64) -> [f64; 3] {
        std::array::from_fn(|axis| self.origin[axis] + self.slope[axis] * t)
    }

    /// Where it meets the planes `first`, `first + 1`, … of an axis, in order; nowhere where it runs along them.
    pub(super) fn planes(&self, axis: usize, first: f64, count: usize) -> impl Iterator<Item = f64> {
        let (origin, inverse) = (self.origin[axis], self.inverse[axis]);
        let count = if self.slope[axis] == 0.0 { 0 } else { count };
        (0..count).map(move |index| {
            let index = if inverse > 0.0 { index } else { count - 1 - index };
            (first + index as f64 - origin) * inverse
        })
    }

    /// The part of [a, b] between `low` and `high` on every axis.
    pub(crate) fn clip(&self, low: f64, high: [f64; 3], a: f64, b: f64) -> Option<[f64; 2]> {
        self.clip_to([low; 3], high, a, b)
    }

    /// The same for a box that begins elsewhere on every axis.
    pub(super) fn clip_to(&self, low: [f64; 3], high: [f64; 3], a: f64, b: f64) -> Option<[f64; 2]> {
        let (mut a, mut b) = (a, b);
        for axis in 0..3 {
            if self.slope[axis] == 0.0 {
                if self.origin[axis] < low[axis] || self.origin[axis] >= high[axis] {
                    return None;
                }
            } else {
                let to = |edge: f64| (edge - self.origin[axis]) * self.inverse[axis];
                let (near, far) = (to(low[axis]), to(high[axis]));
                a = a.max(near.min(far));
                b = b.min(near.max(far));
            }
        }
        (a < b).then_some([a, b])
    }

    /// Visits the pieces of [a, b] in cells of the bricks of a set that hold something, in order: the cell, and where the piece
    /// begins and ends. Every cell comes at most once.
    #[inline(always)]
    pub(super) fn pieces(
        &self,
        set: &VoxelSet,
        a: f64,
        b: f64,
        mut visit: impl FnMut([usize; 3], f64, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        self.bricks(set, a, b, |low, high, a, b| self.walk(low, high, a, b, &mut visit))
    }

    /// Visits the parts of [a, b] in bricks of a set that hold something, in order: the first and the last cell of the brick, and where
    /// the part begins and ends.
    #[inline(always)]
    pub(super) fn bricks(
        &self,
        set: &VoxelSet,
        a: f64,
        b: f64,
        mut visit: impl FnMut([usize; 3], [usize; 3], f64, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let last = set.size().map(|side| side - 1);
        let last_brick = set.bricks().map(|side| side - 1);
        self.coarse().walk([0; 3], last_brick, a, b, |brick, a, b| {
            if set.is_passed_over(brick) {
                return ControlFlow::Continue(());
            }
            let low = brick.map(|i| i * BRICK);
            let high = std::array::from_fn(|axis| (low[axis] + BRICK - 1).min(last[axis]));
            visit(low, high, a, b)
        })
    }

    /// Visits the pieces of [a, b] in the cells from `low` to `high`, in order (Amanatides and Woo 1987).
    ///
    /// Every crossing is computed from its own grid plane, so rounding does not add up along the ray; and none leads out of
    /// the box, so that a cell belongs to one brick whatever the rounding.
    #[inline(always)]
    pub(super) fn walk(
        &self,
        low: [usize; 3],
        high: [usize; 3],
        a: f64,
        b: f64,
        mut visit: impl FnMut([usize; 3], f64, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        // The cast rounds towards zero, and takes what rounding has put before the first cell to it.
        let mut cell: [usize; 3] =
            std::array::from_fn(|axis| (self.at_axis(axis, a) as usize).clamp(low[axis], high[axis]));
        let ahead = self.slope.map(|slope| slope > 0.0);
        let onwards = ahead.map(|ahead| if ahead { 1 } else { usize::MAX });
        let crossing = |cell: usize, axis: usize| {
            if self.slope[axis] == 0.0 {
                return f64::INFINITY;
            }
            ((cell + usize::from(ahead[axis])) as f64 - self.origin[axis]) * self.inverse[axis]
        };
        let mut next: [f64; 3] = std::array::from_fn(|axis| crossing(cell[axis], axis));
        let mut t = a;
        loop {
            let axis = if next[0] <= next[1] {
                if next[0] <= next[2] { 0 } else { 2 }
            } else if next[1] <= next[2] {
                1
            } else {
                2
            };
            let end = if next[axis] < b { next[axis] } else { b };
            if end > t {
                visit(cell, t, end)?;
                t = end;
            }
            if end >= b {
                return ControlFlow::Continue(());
            }
            cell[axis] = cell[axis].wrapping_add(onwards[axis]);
            // Only rounding leads out of the box before b, by less than it can resolve.
            if cell[axis] < low[axis] || cell[axis] > high[axis] {
                return ControlFlow::Continue(());
            }
            next[axis] = crossing(cell[axis], axis);
        }
    }

    /// As [`Self::pieces`] with pieces without length between them, which `visit` passes over; `settle` says after a few whether to go on.
    #[inline(always)]
    pub(super) fn slab_pieces(
        &self,
        set: &VoxelSet,
        a: f64,
        b: f64,
        sink: &mut impl Slabs,
    ) -> ControlFlow<()> {
        self.bricks(set, a, b, |low, high, a, b| self.slabs(low, high, [a, b], sink))
    }

    /// Visits the parts of [a, b] in slabs of cells along the axis on which the ray is fastest, in order.
    #[inline(always)]
    pub(super) fn each_slab(
        &self,
        low: [usize; 3],
        high: [usize; 3],
        [a, b]: [f64; 2],
        mut visit: impl FnMut(f64, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let [x, y, z] = self.slope.map(f64::abs);
        let axis = if x >= y && x >= z { 0 } else { 1 + usize::from(z > y) };
        let (origin, inverse) = (self.origin[axis], self.inverse[axis]);
        let cell = (self.at_axis(axis, a) as usize).clamp(low[axis], high[axis]);
        let (mut plane, step) = if inverse > 0.0 { (cell as f64 + 1.0, 1.0) } else { (cell as f64, -1.0) };
        let mut t = a;
        loop {
            let end = (plane - origin) * inverse;
            let end = if end < b { end } else { b };
            visit(t, end)?;
            if end >= b {
                return ControlFlow::Continue(());
            }
            plane += step;
            t = end;
        }
    }

    /// Visits the pieces of [a, b] in the cells from `low` to `high`, in order, some of them without length.
    ///
    /// Goes slab by slab along the axis on which the ray is fastest: no other axis is crossed more than once in one, and
    /// which one first is nothing that a processor has to guess.
    #[inline(always)]
    pub(super) fn slabs(
        &self,
        low: [usize; 3],
        high: [usize; 3],
        [a, b]: [f64; 2],
        sink: &mut impl Slabs,
    ) -> ControlFlow<()> {
        let [x, y, z] = self.slope.map(f64::abs);
        if x >= y && x >= z {
            self.slabs_along::<0>(low, high, [a, b], sink)
        } else if y >= z {
            self.slabs_along::<1>(low, high, [a, b], sink)
        } else {
            self.slabs_along::<2>(low, high, [a, b], sink)
        }
    }

    #[inline(always)]
    fn slabs_along<const M: usize>(
        &self,
        low: [usize; 3],
        high: [usize; 3],
        [a, b]: [f64; 2],
        sink: &mut impl Slabs,
    ) -> ControlFlow<()> {
        let (p, q) = ((M + 1) % 3, (M + 2) % 3);
        let mut cell: [usize; 3] =
            std::array::from_fn(|axis| (self.at_axis(axis, a) as usize).clamp(low[axis], high[axis]));
        let ahead = self.slope.map(|slope| slope > 0.0);
        let onwards = ahead.map(|ahead| if ahead { 1 } else { usize::MAX });
        let step = ahead.map(|ahead| if ahead { 1.0 } else { -1.0 });
        let mut plane: [f64; 3] = std::array::from_fn(|axis| (cell[axis] + usize::from(ahead[axis])) as f64);
        // A coordinate that does not change never crosses.
        let inverse: [f64; 3] =
            std::array::from_fn(|axis| if self.slope[axis] == 0.0 { 0.0 } else { self.inverse[axis] });
        let never = self.slope.map(|slope| if slope == 0.0 { f64::INFINITY } else { 0.0 });
        let crossing = |plane: f64, axis: usize| (plane - self.origin[axis]) * inverse[axis] + never[axis];
        let moved = |cell: usize, axis: usize, crosses: bool| {
            let next = if crosses { cell.wrapping_add(onwards[axis]) } else { cell };
            // Only rounding leads out of the box before b, by less than it can resolve.
            next.clamp(low[axis], high[axis])
        };
        let mut t = a;
        loop {
            let end = crossing(plane[M], M);
            let end = if end < b { end } else { b };
            let within = |t_cross: f64| if t_cross < t { t } else { t_cross };
            let (at_p, at_q) = (within(crossing(plane[p], p)), within(crossing(plane[q], q)));
            let (crosses_p, crosses_q) = (at_p < end, at_q < end);
            let (at_p, at_q) = (if crosses_p { at_p } else { end }, if crosses_q { at_q } else { end });
            let p_first = at_p <= at_q;
            let (first, second) = if p_first { (at_p, at_q) } else { (at_q, at_p) };
            sink.piece(cell, t, first);
            let mut between = cell;
            between[p] = moved(cell[p], p, crosses_p && p_first);
            between[q] = moved(cell[q], q, crosses_q && !p_first);
            sink.piece(between, first, second);
            cell[p] = moved(cell[p], p, crosses_p);
            cell[q] = moved(cell[q], q, crosses_q);
            plane[p] += if crosses_p { step[p] } else { 0.0 };
            plane[q] += if crosses_q { step[q] } else { 0.0 };
            sink.piece(cell, second, end);
            sink.settle()?;
            if end >= b {
                return ControlFlow::Continue(());
            }
            cell[M] = cell[M].wrapping_add(onwards[M]);
            if cell[M] < low[M] || cell[M] > high[M] {
                return ControlFlow::Continue(());
            }
            plane[M] += step[M];
            t = end;
        }
    }

    #[inline(always)]
    fn at_axis(&self, axis: usize, t: f64) -> f64 {
        self.origin[axis] + self.slope[axis] * t
    }
}
