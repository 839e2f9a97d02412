//! Pieces of a ray in trilinear cells, worked on together in the lanes of wide registers.

use std::ops::ControlFlow;

use super::super::basis::times;
use super::super::{Weight, exponential};
use super::cells::{CellRay, Slabs};
use super::density::{Density, along};
use super::quadrature::{GAUSS_4, PANEL, nodes};
use super::sink::Sink;
use crate::simd::{Kernel, Number, Simd, Wide, dispatch};

/// Pieces that are worked on together.
const LANES: usize = 8;

type Lanes = [f64; LANES];

/// Pieces of a ray in cells of the medium, and what they weigh.
struct Batch<'a, const C: usize> {
    density: &'a Density,
    ray: CellRay,
    /// Those that are waiting; a slab has three.
    cells: [[usize; 3]; LANES + 3],
    ends: [[f64; 2]; LANES + 3],
    len: usize,
    light: [[Lanes; 4]; C],
    weights: Weights<C>,
}

/// What the pieces weigh where light of strength 1 enters each.
struct Weights<const C: usize> {
    /// Of the eight voxels around each cell; x in the lowest bit of the place, then y, then z.
    of: [[Lanes; 8]; C],
    /// What is left of light behind each.
    left: [Lanes; C],
    /// The largest slope of the optical depth along each, or its depth.
    deepest: Lanes,
}

impl<'a, const C: usize> Batch<'a, C> {
    fn new(density: &'a Density, ray: CellRay) -> Self {
        let weights = Weights { of: [[[0.0; LANES]; 8]; C], left: [[0.0; LANES]; C], deepest: [0.0; LANES] };
        let light = [[[1.0; LANES]; 4]; C];
        Self { density, ray, cells: [[0; 3]; LANES + 3], ends: [[0.0; 2]; LANES + 3], len: 0, light, weights }
    }

    /// Adds a piece, if it has a length.
    #[inline(always)]
    fn push(&mut self, cell: [usize; 3], a: f64, b: f64) {
        (self.cells[self.len], self.ends[self.len]) = (cell, [a, b]);
        self.len += usize::from(b > a);
    }

    /// Whether there are enough to work on.
    #[inline(always)]
    fn is_full(&self) -> bool {
        self.len >= LANES
    }

    /// How many can be worked on.
    fn ready(&self) -> usize {
        self.len.min(LANES)
    }

    /// Forgets those.
    fn settle(&mut self) {
        self.cells.copy_within(LANES.., 0);
        self.ends.copy_within(LANES.., 0);
        self.len -= self.ready();
    }

    /// Weighs those that are ready under light that is `light` at t, if there is any; else under 1.
    fn weigh(&mut self, light: Option<impl Fn(f64) -> [f64; C]>) {
        if let Some(light) = light {
            for (lane, &[a, b]) in self.ends[..self.ready()].iter().enumerate() {
                for (node, [u, _]) in GAUSS_4.into_iter().enumerate() {
                    let light = light(a + u * (b - a));
                    (0..C).for_each(|c| self.light[c][node][lane] = light[c]);
                }
            }
        }
        let mut pieces = Pieces {
            corners: [[[0.0; LANES]; 8]; C],
            start: [[0.0; LANES]; 3],
            change: [[0.0; LANES]; 3],
            length: [0.0; LANES],
        };
        for (lane, (&cell, &[a, b])) in self.cells.iter().zip(&self.ends).enumerate().take(self.ready()) {
            let corners = self.density.corners::<C>(cell);
            for c in 0..C {
                (0..8).for_each(|tap| pieces.corners[c][tap][lane] = corners[tap][c]);
            }
            for (axis, [start, change]) in
                self.density.within(cell, &self.ray, [a, b]).into_iter().enumerate()
            {
                (pieces.start[axis][lane], pieces.change[axis][lane]) = (start, change);
            }
            pieces.length[lane] = b - a;
        }
        dispatch(Weigh { pieces: &pieces, light: &self.light, weights: &mut self.weights });
    }

    /// What a piece weighs; none where its medium is too thick for that.
    #[inline(always)]
    fn weights(&self, lane: usize) -> Option<[[f64; C]; 8]> {
        let is_thin = self.weights.deepest[lane] <= PANEL;
        let of = |tap: usize| std::array::from_fn(|c| self.weights.of[c][tap][lane]);
        is_thin.then(|| std::array::from_fn(of))
    }

    /// Whether a piece has no medium.
    #[inline(always)]
    fn is_empty(&self, lane: usize) -> bool {
        self.weights.deepest[lane] == 0.0
    }

    /// What is left of light behind a piece that is thin.
    #[inline(always)]
    fn left(&self, lane: usize) -> [f64; C] {
        std::array::from_fn(|c| self.weights.left[c][lane])
    }
}

/// Takes the pieces of a ray in cells of the medium, and works on eight at once.
pub(super) struct InCells<'a, S, const C: usize> {
    ray: CellRay,
    batch: Batch<'a, C>,
    density: &'a Density,
    /// Transmittance at which the rest of the ray is skipped.
    bound: f64,
    strength: &'a mut Weight<f64, C>,
    sink: S,
}

impl<S: Sink<C>, const C: usize> Slabs for InCells<'_, S, C> {
    #[inline(always)]
    fn piece(&mut self, cell: [usize; 3], a: f64, b: f64) {
        self.batch.push(cell, a, b);
    }

    #[inline(always)]
    fn settle(&mut self) -> ControlFlow<()> {
        if self.batch.is_full() { self.take() } else { ControlFlow::Continue(()) }
    }
}

impl<'a, S: Sink<C>, const C: usize> InCells<'a, S, C> {
    /// Of a ray that light of some strength enters, down to a bound of it.
    pub(super) fn new(
        density: &'a Density,
        ray: CellRay,
        bound: f64,
        strength: &'a mut Weight<f64, C>,
        sink: S,
    ) -> Self {
        Self { ray, batch: Batch::new(density, ray), density, bound, strength, sink }
    }

    /// Works on what is ready; says whether the ray goes on.
    pub(super) fn take(&mut self) -> ControlFlow<()> {
        let Self { ray, batch, density, bound, strength, sink } = self;
        batch.weigh(sink.light());
        for lane in 0..batch.ready() {
            if batch.is_empty(lane) {
                continue;
            }
            let (cell, [a, b]) = (batch.cells[lane], batch.ends[lane]);
            match batch.weights(lane) {
                Some(weights) => {
                    sink.cell(cell, weights.map(|weight| times(**strength, weight)));
                    **strength = times(**strength, batch.left(lane));
                }
                None => {
                    let depth = density.depth::<C>(cell, ray, a, b);
                    nodes(&depth, 0.0, 1.0, |u, weight| {
                        let t = a + u * (b - a);
                        sink.node(cell, ray.at(t), t, times(**strength, weight));
                    });
                    let gone = depth.at(1.0).map(exponential::extinguished);
                    (0..C).for_each(|c| strength[c] -= strength[c] * gone[c]);
                }
            }
            if strength.iter().all(|left| left <= bound) {
                return ControlFlow::Break(());
            }
        }
        batch.settle();
        ControlFlow::Continue(())
    }
}

/// Where pieces lie in their cells, and the extinction around them.
struct Pieces<const C: usize> {
    /// At the eight voxels around, in 1/metre.
    corners: [[Lanes; 8]; C],
    /// How far the piece is towards the voxels behind, at its start, and how that changes along it.
    start: [Lanes; 3],
    change: [Lanes; 3],
    /// In metres.
    length: Lanes,
}

struct Weigh<'a, const C: usize> {
    pieces: &'a Pieces<C>,
    /// At the nodes.
    light: &'a [[Lanes; 4]; C],
    weights: &'a mut Weights<C>,
}

impl<const C: usize> Kernel for Weigh<'_, C> {
    type Output = ();

    /// Optical depth is a polynomial along a piece, τ(u) = Σ aₙ uⁿ⁺¹, and so is each basis function. So the moments of what is extinguished,
    /// Mⱼ = ∫ τ'(u) e^{−τ(u)} L(u) uʲ du, are all that the eight weights need; they are taken by Gauss' rule of four nodes.
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { pieces, light, weights } = self;
        weights.deepest = [0.0; LANES];
        for c in 0..C {
            for part in 0..LANES / Wide::<S>::LANES {
                let lanes = |numbers: &Lanes| Wide::of(simd, numbers, part);
                let mut within = [[Wide::splat(simd, 0.0); 2]; 3];
                for axis in 0..3 {
                    within[axis] = [lanes(&pieces.start[axis]), lanes(&pieces.change[axis])];
                }
                let mut corners = [Wide::splat(simd, 0.0); 8];
                for tap in 0..8 {
                    corners[tap] = lanes(&pieces.corners[c][tap]);
                }
                let depth = along(corners, within, lanes(&pieces.length));
                let all = depth_at(depth, 1.0);
                let steepest = slope_at(depth, 0.0).larger(slope_at(depth, 0.5)).larger(slope_at(depth, 1.0));
                let deepest = lanes(&weights.deepest).larger(steepest.larger(all));
                deepest.store(&mut weights.deepest, part);
                decayed(all).store(&mut weights.left[c], part);
                let mut moments = [Wide::splat(simd, 0.0); 4];
                for (node, [u, share]) in GAUSS_4.into_iter().enumerate() {
                    // Rounding can make the slope of a vanishing density negative.
                    let slope = slope_at(depth, u).larger(Wide::splat(simd, 0.0));
                    let gone = slope * decayed(depth_at(depth, u)) * share * lanes(&light[c][node]);
                    moments[0] = moments[0] + gone;
                    moments[1] = moments[1] + gone * u;
                    moments[2] = moments[2] + gone * (u * u);
                    moments[3] = moments[3] + gone * (u * u * u);
                }
                let of = corner_weights(moments, within);
                for tap in 0..8 {
                    of[tap].store(&mut weights.of[c][tap], part);
                }
            }
        }
    }
}

/// τ(u).
#[inline(always)]
fn depth_at<T: Number>([a, b, c, d]: [T; 4], u: f64) -> T {
    (((d * u + c) * u + b) * u + a) * u
}

/// τ'(u).
#[inline(always)]
fn slope_at<T: Number>([a, b, c, d]: [T; 4], u: f64) -> T {
    ((d * (4.0 * u) + c * 3.0) * u + b * 2.0) * u + a
}

/// e^{−τ} for τ up to [`PANEL`], to 2e-15: a quarter of it by its series, squared twice.
#[inline(always)]
fn decayed<T: Number>(tau: T) -> T {
    const FACTORIALS: [f64; 9] = [40_320.0, 5040.0, 720.0, 120.0, 24.0, 6.0, 2.0, 1.0, 1.0];
    let q = tau * 0.25;
    let mut sum = tau.constant(1.0 / 362_880.0);
    for factorial in FACTORIALS {
        sum = tau.constant(1.0 / factorial) - q * sum;
    }
    let square = sum * sum;
    square * square
}

/// ∫ g v du for the eight trilinear functions v, each a product of f or 1 − f along the axes, f = f₀ + f₁ u: from the moments of g.
#[inline(always)]
fn corner_weights<T: Number>(m: [T; 4], [x, y, z]: [[T; 2]; 3]) -> [T; 8] {
    let by_x = [x[0] * m[0] + x[1] * m[1], x[0] * m[1] + x[1] * m[2], x[0] * m[2] + x[1] * m[3]];
    let by_y = [y[0] * m[0] + y[1] * m[1], y[0] * m[1] + y[1] * m[2]];
    let by_z = z[0] * m[0] + z[1] * m[1];
    let by_xy = [y[0] * by_x[0] + y[1] * by_x[1], y[0] * by_x[1] + y[1] * by_x[2]];
    let by_xz = z[0] * by_x[0] + z[1] * by_x[1];
    let by_yz = z[0] * by_y[0] + z[1] * by_y[1];
    let by_xyz = z[0] * by_xy[0] + z[1] * by_xy[1];
    let none = m[0].constant(0.0);
    // Grouped so that they are exactly zero for voxels outside the grid.
    let high_yz = by_yz - by_xyz;
    let high_z = (by_z - by_xz) - high_yz;
    [
        (((m[0] - by_x[0]) - (by_y[0] - by_xy[0])) - high_z).larger(none),
        ((by_x[0] - by_xy[0]) - (by_xz - by_xyz)).larger(none),
        ((by_y[0] - by_xy[0]) - high_yz).larger(none),
        (by_xy[0] - by_xyz).larger(none),
        high_z.larger(none),
        (by_xz - by_xyz).larger(none),
        high_yz.larger(none),
        by_xyz.larger(none),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_is_the_exponential() {
        let worst = |off: f64| {
            let errors = (0..=1000).map(|k| PANEL * f64::from(k) / 1000.0);
            errors.map(|tau| (decayed(tau + off) / (-tau).exp() - 1.0).abs()).fold(0.0, f64::max)
        };
        assert!(worst(0.0) <= 2e-15, "{:e}", worst(0.0));
        assert!(worst(1e-14) > 2e-15);
    }

    /// The weights of a piece with g = 1 + 3 u², by midpoints.
    fn by_midpoints(within: [[f64; 2]; 3]) -> [f64; 8] {
        const STEPS: usize = 20_000;
        let mut weights = [0.0; 8];
        for step in 0..STEPS {
            let u = (step as f64 + 0.5) / STEPS as f64;
            for (tap, weight) in weights.iter_mut().enumerate() {
                let f = |axis: usize| {
                    let high = within[axis][0] + within[axis][1] * u;
                    if tap >> axis & 1 == 1 { high } else { 1.0 - high }
                };
                *weight += (1.0 + 3.0 * u * u) * f(0) * f(1) * f(2) / STEPS as f64;
            }
        }
        weights
    }

    #[test]
    fn corners_weigh_what_their_functions_do() {
        // ∫ (1 + 3 u²) uʲ du.
        let moments = [2.0, 1.25, 1.0 / 3.0 + 0.6, 0.75];
        for within in [
            [[0.2, 0.7], [0.9, -0.3], [0.4, 0.1]],
            [[1.0, 0.0], [0.5, 0.5], [0.0, 0.0]],
            [[0.0, 1.0], [1.0, -1.0], [1.0, 0.0]],
        ] {
            let truth = by_midpoints(within);
            let worst = |weights: [f64; 8]| {
                weights.iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
            };
            let weights = corner_weights(moments, within);
            assert!(worst(weights) < 1e-8, "{weights:?}, not {truth:?}");
            assert!((weights.iter().sum::<f64>() - moments[0]).abs() < 1e-15);
            let outside = truth.iter().zip(&weights).filter(|(truth, _)| **truth == 0.0);
            assert!(outside.map(|(_, weight)| *weight).all(|weight| weight == 0.0));
            assert!(worst(corner_weights([2.0, 1.2501, moments[2], 0.75], within)) > 1e-8);
        }
    }
}
