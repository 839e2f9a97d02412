//! Where a ray is cut into pieces along which what it meets is a polynomial.

use super::cells::{CellRay, Line};
use crate::scene::{Interpolation, VoxelGrid};

/// Where a line goes from one cell to the next in grids that are not those that it is walked through, in order.
#[derive(Debug, Default)]
pub(super) struct Cuts(Vec<f64>);

impl Cuts {
    /// The cuts inside `ends`. Grids that are the same cut once.
    pub(super) fn of<'a>(
        line: &Line,
        ends: [f64; 2],
        grids: impl Iterator<Item = (&'a VoxelGrid, Interpolation)>,
    ) -> Self {
        let (mut cuts, mut known) = (Vec::new(), Vec::new());
        for (grid, interpolation) in grids {
            if !known.contains(&(grid, interpolation)) {
                known.push((grid, interpolation));
                crossings(line, ends, grid, interpolation, &mut cuts);
            }
        }
        cuts.sort_by(f64::total_cmp);
        Self(cuts)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Visits the pieces of [a, b] between cuts, in order.
    #[inline(always)]
    pub(super) fn parts(&self, a: f64, b: f64, mut visit: impl FnMut(f64, f64)) {
        let first = if self.0.is_empty() { 0 } else { self.0.partition_point(|&cut| cut <= a) };
        let mut start = a;
        for &cut in self.0[first..].iter().take_while(|&&cut| cut < b) {
            if cut > start {
                visit(start, cut);
                start = cut;
            }
        }
        visit(start, b);
    }
}

/// Between cells lie the faces of voxels or their centres; those at the rim count for lines outside, too.
fn crossings(line: &Line, [a, b]: [f64; 2], grid: &VoxelGrid, between: Interpolation, cuts: &mut Vec<f64>) {
    let ray = CellRay::new(line, grid, 0.0);
    let (first, extra) = match between {
        Interpolation::Nearest => (0.0, 1),
        Interpolation::Trilinear => (0.5, 0),
    };
    for axis in 0..3 {
        let planes = ray.planes(axis, first, grid.size()[axis] + extra);
        cuts.extend(planes.filter(|&t| a < t && t < b));
    }
}
