//! Where a ray enters the cells of a grid along one axis: in f64, before it is rounded for a kernel.

/// The first cell of a ray along one axis.
pub(super) struct CellEntry {
    pub(super) cell: usize,
    /// Where it is inside the cell, 0 to 1.
    pub(super) fraction: f64,
    /// When it crosses into the next cell, in ticks; infinite or NaN where it stands still.
    pub(super) first: f64,
}

impl CellEntry {
    /// At `place` among so many cells at tick `begin`, with `slope` cells a tick.
    pub(super) fn new(place: f64, slope: f64, begin: f64, cells: usize) -> Self {
        // Rounding at the rim can put the place outside by less than anything that counts.
        let cell = place.floor().clamp(0.0, cells as f64 - 1.0);
        let fraction = (place - cell).clamp(0.0, 1.0);
        let way = if slope > 0.0 { 1.0 - fraction } else { fraction };
        Self { cell: cell as usize, fraction, first: begin + way / slope.abs() }
    }
}
