//! Equal steps along a line, as the papers march.

use super::cells::{CellRay, Line};
use crate::scene::VoxelGrid;

/// Visits the middles of equal steps of a line through a grid, and their lengths, while `visit` says to go on.
pub(super) fn each_step(
    line: &Line,
    [a, b]: [f64; 2],
    steps: u32,
    grid: &VoxelGrid,
    mut visit: impl FnMut(f64, f64) -> bool,
) {
    let corners = grid.corners();
    let step = (corners[7] - corners[0]).length() / f64::from(steps);
    let through = CellRay::new(line, grid, 0.0);
    let Some([enter, leave]) = through.clip(0.0, grid.size().map(|side| side as f64), a, b) else { return };
    for j in 0..((leave - enter) / step).ceil() as u32 {
        let start = enter + f64::from(j) * step;
        let length = step.min(leave - start);
        if !visit(start + 0.5 * length, length) {
            return;
        }
    }
}
