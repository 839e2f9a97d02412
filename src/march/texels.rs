//! A ray in cells of a grid on the plane of a light.

use glam::DVec2;

use super::basis::Piece;
use super::view_ray::ViewRay;
use super::{Real, least};
use crate::scene::Grid;

/// One over a slope, and infinite for zero of either sign: such a line is never crossed.
pub(super) fn inverse<F: Real>(slope: F) -> F {
    if slope == F::zero() { F::infinity() } else { F::one() / slope }
}

/// Position in a grid at t = 0 and its change a metre.
pub(super) fn grid_ray(ray: &ViewRay, grid: &Grid) -> [DVec2; 2] {
    let slope = DVec2::new(ray.direction.x, ray.direction.y) * grid.density();
    [grid.grid_from_light(DVec2::new(ray.origin.x, ray.origin.y)), slope]
}

/// A ray in cells of the basis.
pub(super) struct TexelRay<F> {
    pub(super) origin: [F; 2],
    pub(super) slope: [F; 2],
    /// 1 / slope, infinite where the slope is zero.
    inverse: [F; 2],
    last: [usize; 2],
}

impl<F: Real> TexelRay<F> {
    pub(super) fn new(ray: &ViewRay, grid: &Grid, shift: f64, extra: usize) -> Self {
        let [origin, slope] = grid_ray(ray, grid);
        Self {
            origin: [F::of(origin.x + shift), F::of(origin.y + shift)],
            slope: [F::of(slope.x), F::of(slope.y)],
            inverse: [inverse(F::of(slope.x)), inverse(F::of(slope.y))],
            last: grid.size.map(|side| side + extra - 1),
        }
    }

    #[inline(always)]
    pub(super) fn cell(&self, t: F) -> [usize; 2] {
        std::array::from_fn(|axis| {
            // The cast rounds towards zero, and takes what rounding has put before the first cell to it.
            let index = (self.origin[axis] + self.slope[axis] * t).wide() as usize;
            index.min(self.last[axis])
        })
    }

    #[inline(always)]
    pub(super) fn at(&self, t: F) -> Piece<F> {
        self.piece(self.cell(t), t, F::zero())
    }

    #[inline(always)]
    fn piece(&self, cell: [usize; 2], t: F, length: F) -> Piece<F> {
        let start = |axis: usize| self.origin[axis] + self.slope[axis] * t - F::of(cell[axis] as f64);
        Piece { cell, start: [start(0), start(1)], change: [self.slope[0] * length, self.slope[1] * length] }
    }

    /// Visits the pieces of [a, b] cell by cell, in order (Amanatides and Woo 1987).
    ///
    /// Every crossing is computed from its own grid line, so rounding does not add up along the ray. Which axis comes
    /// next is hard to predict, so both are advanced without a branch, one of them by nothing.
    ///
    /// `reached` is the cell in which the stretch before has ended; whatever the rounding, none begins behind it.
    #[inline(always)]
    pub(super) fn pieces(&self, reached: &mut [usize; 2], a: F, b: F, mut visit: impl FnMut(&Piece<F>, F)) {
        let (ahead, step) = (self.slope.map(|slope| slope > F::zero()), self.slope.map(F::signum));
        let begin = self.cell(a);
        let mut cell = std::array::from_fn(|axis| match ahead[axis] {
            true => begin[axis].max(reached[axis]),
            false => begin[axis].min(reached[axis]),
        });
        let mut line: [F; 2] = std::array::from_fn(|axis| match self.slope[axis] == F::zero() {
            true => F::infinity(),
            false => F::of((cell[axis] + usize::from(ahead[axis])) as f64),
        });
        let crossing = |line: [F; 2], axis: usize| (line[axis] - self.origin[axis]) * self.inverse[axis];
        let mut next = [crossing(line, 0), crossing(line, 1)];
        let mut t = a;
        loop {
            let x_first = next[0] <= next[1];
            let end = least(least(next[0], next[1]), b);
            if end > t {
                visit(&self.piece(cell, t, end - t), end - t);
                t = end;
                *reached = cell;
            }
            if end >= b {
                break;
            }
            for (axis, comes) in [(0, x_first), (1, !x_first)] {
                line[axis] += if comes { step[axis] } else { F::zero() };
                let onwards = if ahead[axis] { 1 } else { usize::MAX };
                cell[axis] = cell[axis].wrapping_add(if comes { onwards } else { 0 });
            }
            // Only rounding at the rim of the map can lead outside, by less than what it can resolve.
            if cell[0] > self.last[0] || cell[1] > self.last[1] {
                break;
            }
            next = [crossing(line, 0), crossing(line, 1)];
        }
    }
}
