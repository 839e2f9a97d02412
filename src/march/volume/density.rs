//! Extinction along a ray: optical depth in closed form.

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::DVec3;

use super::super::Real;
use super::cells::{CellRay, Line};
use crate::scene::{BRICK, Interpolation, Samples, Volume, VoxelGrid, VoxelSet};
use crate::simd::Number;

/// A heterogeneous medium: extinction σ_t at the centres of voxels, in 1/metre, none outside their grid.
///
/// Between centres it is constant in each voxel (`nearest`) or trilinear, constant beyond the outermost centres.
#[derive(Debug, Clone)]
pub struct Density {
    volume: Arc<Volume>,
    interpolation: Interpolation,
    /// The cells of the interpolation in which there is any extinction.
    cells: Arc<VoxelSet>,
    /// The first and the last cell along each axis of a box around them, where it is so full that no brick is worth passing over.
    full: Option<[[usize; 3]; 2]>,
}

/// Share of the bricks of a box that hold something, from which on walking cell by cell is faster than brick by brick.
const FULL: f64 = 0.25;

/// Optical depth over a piece of a ray inside one cell, as a polynomial: τ(u) = Σ aₙ uⁿ⁺¹ for u in [0, 1] along the piece.
///
/// Trilinear extinction is cubic along a line, so the polynomial is exact.
#[derive(Debug, Clone, Copy)]
pub(super) struct Depth<const C: usize> {
    coefficients: [[f64; 4]; C],
}

impl<const C: usize> Depth<C> {
    /// τ(u).
    #[inline(always)]
    pub(super) fn at(&self, u: f64) -> [f64; C] {
        self.coefficients.map(|[a, b, c, d]| u * (a + u * (b + u * (c + u * d))))
    }

    /// dτ/du at u.
    #[inline(always)]
    pub(super) fn slope(&self, u: f64) -> [f64; C] {
        self.coefficients.map(|[a, b, c, d]| a + u * (2.0 * b + u * (3.0 * c + u * 4.0 * d)))
    }
}

impl Density {
    /// The medium of a volume of extinction.
    pub fn new(volume: Arc<Volume>, interpolation: Interpolation) -> Self {
        let some = volume.grid().set(|index| volume.color(index).iter().any(|&sigma_t| sigma_t > 0.0));
        let cells = match interpolation {
            Interpolation::Nearest => some,
            Interpolation::Trilinear => some.cells_between(),
        };
        Self { volume, interpolation, full: full(&cells), cells: Arc::new(cells) }
    }

    /// The same, with walks that enter bricks without extinction, too.
    pub fn entered_everywhere(self) -> Self {
        Self { cells: Arc::new(Arc::unwrap_or_clone(self.cells).entered_everywhere()), ..self }
    }

    /// Extinction at the centres of voxels.
    pub fn volume(&self) -> &Volume {
        &self.volume
    }

    /// What lies between the centres.
    pub fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    /// Where the voxels are.
    pub fn grid(&self) -> &VoxelGrid {
        self.volume.grid()
    }

    /// The cells of the interpolation in which there is any extinction.
    pub fn cells(&self) -> &VoxelSet {
        &self.cells
    }

    /// Whether all channels share one extinction.
    pub fn is_grey(&self) -> bool {
        self.volume.channels() == 1
    }

    /// Optical depth a channel along `direction` (of unit length) from `origin`, over `length` metres; infinite lengths are
    /// allowed. Beyond a depth of 750, where e^−τ is below the least f64, it may be too small.
    pub fn optical_depth(&self, origin: DVec3, direction: DVec3, length: f64) -> [f64; 3] {
        self.depth_between(&Line { origin, direction }, 0.0, length)
    }

    /// Optical depth a channel over [a, b] of a line.
    pub(super) fn depth_between(&self, line: &Line, a: f64, b: f64) -> [f64; 3] {
        if self.is_grey() {
            let [tau] = self.depth_along::<1>(line, a, b);
            return [tau; 3];
        }
        self.depth_along::<3>(line, a, b)
    }

    fn depth_along<const C: usize>(&self, line: &Line, a: f64, b: f64) -> [f64; C] {
        let mut sum = [0.0; C];
        if let Some([low, high]) = self.full {
            self.depth_through(line, [a, b], [low, high], &mut sum);
            return sum;
        }
        self.each_piece::<C>(line, a, b, |_, _, _, depth| {
            let tau = depth.at(1.0);
            (0..C).for_each(|c| sum[c] += tau[c]);
            if sum.iter().all(|&tau| tau > 750.0) {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        sum
    }

    /// The same through a box of cells outside of which there is nothing.
    fn depth_through<const C: usize>(
        &self,
        line: &Line,
        [a, b]: [f64; 2],
        [low, high]: [[usize; 3]; 2],
        sum: &mut [f64; C],
    ) {
        let shift = self.interpolation.cells().0;
        let size = self.grid().size();
        let cells = CellRay::new(line, self.grid(), shift);
        // The outermost cells of an interpolation are half outside.
        let begin = low.map(|cell| (cell as f64).max(shift));
        let end = std::array::from_fn(|axis| ((high[axis] + 1) as f64).min(size[axis] as f64 + shift));
        let Some([a, b]) = cells.clip_to(begin, end, a, b) else { return };
        match self.volume.samples() {
            Samples::F32(values) => self.sum_slabs(&cells, [a, b], [low, high], sum, |n| values[n]),
            Samples::F16(values) => self.sum_slabs(&cells, [a, b], [low, high], sum, |n| values[n].to_f32()),
        }
    }

    #[inline(always)]
    fn sum_slabs<const C: usize>(
        &self,
        cells: &CellRay,
        ends: [f64; 2],
        [low, high]: [[usize; 3]; 2],
        sum: &mut [f64; C],
        sample: impl Fn(usize) -> f32,
    ) {
        let sigma_t = |index: usize| std::array::from_fn(|c| f64::from(sample(C * index + c)));
        let _all_visited = match self.interpolation {
            Interpolation::Nearest => cells.slabs(low, high, ends, &mut |cell, a, b| {
                let sigma_t: [f64; C] = sigma_t(self.grid().index(cell));
                (0..C).for_each(|c| sum[c] += sigma_t[c] * (b - a));
            }),
            Interpolation::Trilinear => cells.slabs(low, high, ends, &mut |cell, a, b| {
                if b > a {
                    let tau = self.cubic::<C>(cell, cells, [a, b], sigma_t).at(1.0);
                    (0..C).for_each(|c| sum[c] += tau[c]);
                }
            }),
        };
    }

    /// σ_t at a point in world space.
    pub(super) fn at(&self, point: DVec3) -> [f64; 3] {
        let line = Line { origin: point, direction: DVec3::ZERO };
        let shift = self.interpolation.cells().0;
        let ray = CellRay::new(&line, self.grid(), shift);
        let size = self.grid().size();
        if ray.clip(shift, size.map(|side| side as f64 + shift), 0.0, 1.0).is_none() {
            return [0.0; 3];
        }
        let cell = ray.at(0.0).map(|x| x as usize);
        match self.interpolation {
            Interpolation::Nearest => self.constant(cell, 1.0).slope(0.0),
            Interpolation::Trilinear => {
                self.cubic(cell, &ray, [0.0, 1.0], |index| self.sigma_t(index)).slope(0.0)
            }
        }
    }

    /// Visits the pieces of [a, b] of a line in cells with extinction, in order: the ray in cells, where the piece begins and
    /// ends, and its optical depth.
    #[inline(always)]
    pub(super) fn each_piece<const C: usize>(
        &self,
        line: &Line,
        a: f64,
        b: f64,
        mut visit: impl FnMut([usize; 3], f64, f64, &Depth<C>) -> ControlFlow<()>,
    ) {
        let cells = CellRay::new(line, self.grid(), self.interpolation.cells().0);
        let Some([a, b]) = self.clipped(&cells, a, b) else { return };
        let _all_visited = cells.pieces(&self.cells, a, b, |cell, a, b| {
            let depth = self.depth(cell, &cells, a, b);
            if depth.coefficients.iter().all(|coefficients| *coefficients == [0.0; 4]) {
                return ControlFlow::Continue(());
            }
            visit(cell, a, b, &depth)
        });
    }

    /// σ_t of a voxel.
    pub(super) fn sigma_t_of<T: Real, const C: usize>(&self, voxel: [usize; 3]) -> [T; C] {
        self.sigma_t(self.grid().index(voxel)).map(T::of)
    }

    /// The part of [a, b] of a ray that lies in the grid.
    pub(super) fn clipped(&self, cells: &CellRay, a: f64, b: f64) -> Option<[f64; 2]> {
        let (shift, extra) = self.interpolation.cells();
        let size = self.grid().size();
        debug_assert_eq!(self.cells.size(), size.map(|side| side + extra));
        cells.clip(shift, size.map(|side| side as f64 + shift), a, b)
    }

    /// Optical depth of the piece [a, b] of a ray in one cell.
    #[inline(always)]
    pub(super) fn depth<const C: usize>(
        &self,
        cell: [usize; 3],
        cells: &CellRay,
        a: f64,
        b: f64,
    ) -> Depth<C> {
        match self.interpolation {
            Interpolation::Nearest => self.constant(cell, b - a),
            Interpolation::Trilinear => self.cubic(cell, cells, [a, b], |index| self.sigma_t(index)),
        }
    }

    #[inline(always)]
    fn sigma_t<const C: usize>(&self, index: usize) -> [f64; C] {
        let color = self.volume.color(index);
        std::array::from_fn(|c| f64::from(color[c]))
    }

    #[inline(always)]
    fn constant<const C: usize>(&self, voxel: [usize; 3], length: f64) -> Depth<C> {
        let sigma_t = self.sigma_t::<C>(self.grid().index(voxel));
        Depth { coefficients: sigma_t.map(|sigma_t| [sigma_t * length, 0.0, 0.0, 0.0]) }
    }

    /// Trilinear σ_t along the piece, integrated.
    #[inline(always)]
    fn cubic<const C: usize>(
        &self,
        cell: [usize; 3],
        ray: &CellRay,
        [a, b]: [f64; 2],
        sigma_t: impl Fn(usize) -> [f64; C],
    ) -> Depth<C> {
        let corners = self.corners_by(cell, sigma_t);
        let within = self.within(cell, ray, [a, b]);
        let of = |c: usize| along(corners.map(|corner| corner[c]), within, b - a);
        Depth { coefficients: std::array::from_fn(of) }
    }

    /// σ_t of the eight voxels around a trilinear cell; x in the lowest bit of the place, then y, then z.
    #[inline(always)]
    pub(super) fn corners<const C: usize>(&self, cell: [usize; 3]) -> [[f64; C]; 8] {
        let channels = self.volume.channels();
        let channel = |c: usize| if channels == 1 { 0 } else { c };
        match self.volume.samples() {
            Samples::F32(values) => {
                self.corners_by(cell, |n| std::array::from_fn(|c| values[channels * n + channel(c)].into()))
            }
            Samples::F16(values) => {
                self.corners_by(cell, |n| std::array::from_fn(|c| values[channels * n + channel(c)].into()))
            }
        }
    }

    #[inline(always)]
    fn corners_by<const C: usize>(
        &self,
        cell: [usize; 3],
        sigma_t: impl Fn(usize) -> [f64; C],
    ) -> [[f64; C]; 8] {
        let size = self.grid().size();
        let strides = [1, size[0], size[0] * size[1]];
        // The voxel before the first and the one behind the last stand for their neighbours: they weigh nothing.
        let places: [[usize; 2]; 3] = std::array::from_fn(|axis| {
            [0, 1].map(|side| (cell[axis] + side).saturating_sub(1).min(size[axis] - 1) * strides[axis])
        });
        std::array::from_fn(|tap| sigma_t(places[0][tap & 1] + places[1][tap >> 1 & 1] + places[2][tap >> 2]))
    }

    /// How far the piece [a, b] of a ray is towards the voxels behind, at its start, and how that changes along it.
    #[inline(always)]
    pub(super) fn within(&self, cell: [usize; 3], ray: &CellRay, [a, b]: [f64; 2]) -> [[f64; 2]; 3] {
        let (size, start) = (self.grid().size(), ray.at(a));
        std::array::from_fn(|axis| match cell[axis] {
            0 => [1.0, 0.0],
            last if last == size[axis] => [0.0, 0.0],
            index => [start[axis] - index as f64, ray.slope[axis] * (b - a)],
        })
    }
}

/// The coefficients of τ(u) along a piece of so many metres: trilinear extinction, integrated. `within` is where the piece lies in its cell.
#[inline(always)]
pub(super) fn along<T: Number>(corners: [T; 8], within: [[T; 2]; 3], length: T) -> [T; 4] {
    let [x, y, z] = within;
    let [a, b, c, d] = [
        lerp(corners[0], corners[1], x),
        lerp(corners[2], corners[3], x),
        lerp(corners[4], corners[5], x),
        lerp(corners[6], corners[7], x),
    ];
    let [low, high] = [bilerp(a, b, y), bilerp(c, d, y)];
    let rise = [high[0] - low[0], high[1] - low[1], high[2] - low[2]];
    [
        (low[0] + rise[0] * z[0]) * length,
        (low[1] + rise[0] * z[1] + rise[1] * z[0]) * length * (1.0 / 2.0),
        (low[2] + rise[1] * z[1] + rise[2] * z[0]) * length * (1.0 / 3.0),
        rise[2] * z[1] * length * (1.0 / 4.0),
    ]
}

/// From one number to another, as f₀ + f₁ u goes from 0 to 1: a polynomial in u.
#[inline(always)]
fn lerp<T: Number>(low: T, high: T, f: [T; 2]) -> [T; 2] {
    let rise = high - low;
    [low + rise * f[0], rise * f[1]]
}

/// The same from one line to another.
#[inline(always)]
fn bilerp<T: Number>(low: [T; 2], high: [T; 2], f: [T; 2]) -> [T; 3] {
    let rise = [high[0] - low[0], high[1] - low[1]];
    [low[0] + rise[0] * f[0], low[1] + rise[0] * f[1] + rise[1] * f[0], rise[1] * f[1]]
}

/// A box of whole bricks around the cells of a set, where it is full enough.
fn full(cells: &VoxelSet) -> Option<[[usize; 3]; 2]> {
    let [across, down, deep] = cells.bricks();
    let (mut low, mut high, mut count) = ([usize::MAX; 3], [0; 3], 0);
    for brick in (0..across * down * deep).map(|n| [n % across, n / across % down, n / across / down]) {
        if !cells.is_brick_empty(brick) {
            count += 1;
            (0..3).for_each(|axis| low[axis] = low[axis].min(brick[axis]));
            (0..3).for_each(|axis| high[axis] = high[axis].max(brick[axis]));
        }
    }
    if count == 0 {
        return None;
    }
    let bricks: usize = (0..3).map(|axis| high[axis] - low[axis] + 1).product();
    let last = std::array::from_fn(|axis| (high[axis] * BRICK + BRICK - 1).min(cells.size()[axis] - 1));
    (f64::from(count) >= FULL * bricks as f64).then_some([low.map(|brick| brick * BRICK), last])
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DAffine3;

    /// Depths of lines through a medium that fills its grid, slab by slab and brick by brick.
    fn depths(interpolation: Interpolation, changed: f32) -> crate::Result<Vec<[[f64; 3]; 2]>> {
        let size = [19, 11, 14];
        let grid = VoxelGrid::new(size, DAffine3::from_scale(DVec3::new(0.3, 0.5, 0.4)))?;
        let value = |index: usize| ((index * 7919 % 101) as f32 * 0.02 - 0.2).max(0.0);
        let samples: Vec<f32> = (0..3 * grid.len()).map(value).collect();
        let density = |samples: Vec<f32>| -> crate::Result<Density> {
            Ok(Density::new(Arc::new(Volume::new(grid, 3, Samples::F32(samples))?), interpolation))
        };
        let full = density(samples.clone())?;
        assert!(full.full.is_some());
        let mut bricks = density(samples.into_iter().map(|sigma_t| sigma_t * changed).collect())?;
        bricks.full = None;
        let mut lines = Vec::new();
        for n in 0..400 {
            let part = |k: usize| ((n * k * 131 + 17 * k) % 211) as f64 / 211.0;
            let origin = DVec3::new(8.0 * part(1) - 1.0, 8.0 * part(2) - 1.0, 8.0 * part(3) - 1.0);
            // Some along an axis, some along the planes between voxels and through their edges.
            let (origin, direction) = match n % 5 {
                0 => (origin, [DVec3::X, DVec3::NEG_Y, DVec3::Z][n % 3]),
                1 => (DVec3::new(0.9, 1.5, 1.2), DVec3::new(0.3, 0.5, [0.4, -0.4, 0.0][n % 3])),
                _ => (origin, DVec3::new(part(4) - 0.5, part(5) - 0.5, part(6) - 0.5)),
            };
            let direction = direction.normalize_or(DVec3::X);
            let length = if n % 7 == 0 { 2.0 } else { f64::INFINITY };
            lines.push([
                full.optical_depth(origin, direction, length),
                bricks.optical_depth(origin, direction, length),
            ]);
        }
        Ok(lines)
    }

    #[test]
    fn depth_is_the_same_slab_by_slab_and_brick_by_brick() -> crate::Result<()> {
        for interpolation in [Interpolation::Nearest, Interpolation::Trilinear] {
            let worst = |changed| -> crate::Result<f64> {
                let errors = depths(interpolation, changed)?
                    .into_iter()
                    .flat_map(|[a, b]| (0..3).map(move |c| (a[c] - b[c]).abs() / (1.0 + a[c])));
                Ok(errors.fold(0.0, f64::max))
            };
            assert!(worst(1.0)? < 1e-12, "{interpolation:?}: {:e}", worst(1.0)?);
            assert!(worst(1.0001)? > 1e-12);
        }
        Ok(())
    }
}
