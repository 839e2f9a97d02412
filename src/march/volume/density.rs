//! Extinction along a ray: optical depth in closed form.

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::DVec3;

use super::cells::{CellRay, Line};
use super::window::parts;
use crate::scene::{Interpolation, Volume, VoxelGrid, VoxelSet};

/// A heterogeneous medium: extinction σ_t at the centres of voxels, in 1/metre, none outside their grid.
///
/// Between centres it is constant in each voxel (`nearest`) or trilinear, constant beyond the outermost centres.
#[derive(Debug, Clone)]
pub struct Density {
    volume: Arc<Volume>,
    interpolation: Interpolation,
    /// The cells of the interpolation in which there is any extinction.
    cells: Arc<VoxelSet>,
}

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
        Self { volume, interpolation, cells: Arc::new(cells) }
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
    /// allowed. Past a depth of 750, through which not even the least f64 gets, it may be too small.
    pub fn optical_depth(&self, origin: DVec3, direction: DVec3, length: f64) -> [f64; 3] {
        let line = Line { origin, direction };
        if self.is_grey() {
            let [tau] = self.depth_along::<1>(&line, length);
            return [tau; 3];
        }
        self.depth_along::<3>(&line, length)
    }

    fn depth_along<const C: usize>(&self, line: &Line, length: f64) -> [f64; C] {
        let mut sum = [0.0; C];
        self.each_piece::<C>(line, 0.0, length, |_, _, _, depth| {
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
            Interpolation::Trilinear => self.cubic(cell, &ray, 0.0, 1.0).slope(0.0),
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
        let (shift, extra) = self.interpolation.cells();
        let cells = CellRay::new(line, self.grid(), shift);
        let size = self.grid().size();
        let high = size.map(|side| side as f64 + shift);
        let Some([a, b]) = cells.clip(shift, high, a, b) else { return };
        debug_assert_eq!(self.cells.size(), size.map(|side| side + extra));
        let _all_visited = cells.pieces(&self.cells, a, b, |cell, a, b| {
            let depth = self.depth(cell, &cells, a, b);
            if depth.coefficients.iter().all(|coefficients| *coefficients == [0.0; 4]) {
                return ControlFlow::Continue(());
            }
            visit(cell, a, b, &depth)
        });
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
            Interpolation::Trilinear => self.cubic(cell, cells, a, b),
        }
    }

    #[inline(always)]
    fn sigma_t<const C: usize>(&self, voxel: [usize; 3]) -> [f64; C] {
        let color = self.volume.color(self.grid().index(voxel));
        std::array::from_fn(|c| f64::from(color[c]))
    }

    #[inline(always)]
    fn constant<const C: usize>(&self, voxel: [usize; 3], length: f64) -> Depth<C> {
        Depth { coefficients: self.sigma_t::<C>(voxel).map(|sigma_t| [sigma_t * length, 0.0, 0.0, 0.0]) }
    }

    /// The cubic through σ_t at the ends of the piece and at its thirds, integrated.
    #[inline(always)]
    fn cubic<const C: usize>(&self, cell: [usize; 3], ray: &CellRay, a: f64, b: f64) -> Depth<C> {
        let size = self.grid().size();
        let corners: [[f64; C]; 8] = std::array::from_fn(|tap| {
            self.sigma_t(std::array::from_fn(|axis| {
                // The voxel before the first and the one behind the last stand for their neighbours: they weigh nothing.
                (cell[axis] + (tap >> axis & 1)).saturating_sub(1).min(size[axis] - 1)
            }))
        });
        let length = b - a;
        let at = |u: f64| {
            let parts = parts(cell, ray.at(a + u * length), size);
            let mut sum = [0.0; C];
            for (corner, part) in corners.iter().zip(parts) {
                (0..C).for_each(|c| sum[c] += corner[c] * part);
            }
            sum
        };
        let [p, q, r, s] = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0].map(at);
        let coefficients = std::array::from_fn(|c| {
            let (p, q, r, s) = (p[c], q[c], r[c], s[c]);
            let first = -5.5 * p + 9.0 * q - 4.5 * r + s;
            let second = 9.0 * p - 22.5 * q + 18.0 * r - 4.5 * s;
            let third = -4.5 * p + 13.5 * q - 13.5 * r + 4.5 * s;
            [p * length, first / 2.0 * length, second / 3.0 * length, third / 4.0 * length]
        });
        Depth { coefficients }
    }
}
