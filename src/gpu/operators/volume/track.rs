//! Rays as the kernels walk them through a grid: in integers, rounded once, in f64.

use glam::DMat3;

use crate::gpu::kernels::layout::{PLACE_BITS, TICKS, Track};
use crate::gpu::operators::entry::CellEntry;
use crate::march::{CellRay, Line};
use crate::scene::{Interpolation, Ray, VoxelGrid};

const END: f64 = TICKS as f64;

/// The cells that a ray is walked through.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cells {
    grid: VoxelGrid,
    shift: f64,
    /// Cells a side.
    pub(super) size: [usize; 3],
}

/// Between which distances a ray is walked, in metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stretch {
    enter: f64,
    leave: f64,
}

impl Stretch {
    pub(super) fn metres(&self) -> f64 {
        self.leave - self.enter
    }
}

impl Cells {
    pub(super) fn new(grid: &VoxelGrid, interpolation: Interpolation) -> Self {
        let (shift, extra) = interpolation.cells();
        Self { grid: *grid, shift, size: grid.size().map(|side| side + extra) }
    }

    /// Metres along the axes of a cell.
    pub(super) fn world_from_cells(&self) -> DMat3 {
        self.grid.world_from_grid().matrix3
    }

    fn cell_ray(&self, ray: &Ray) -> CellRay {
        CellRay::new(&Line { origin: ray.origin, direction: ray.direction }, &self.grid, self.shift)
    }

    fn over(&self, ray: &CellRay, a: f64, b: f64) -> Option<[f64; 2]> {
        ray.clip(self.shift, self.grid.size().map(|side| side as f64 + self.shift), a, b)
    }

    /// The ray over the grid, from its beginning to there; none where it misses.
    pub(super) fn stretch(&self, ray: &Ray, length: f64) -> Option<Stretch> {
        let [enter, leave] = self.over(&self.cell_ray(ray), 0.0, length)?;
        Some(Stretch { enter, leave })
    }

    /// The ray from where it enters a stretch of which it may be over this grid in a part; a track of zeros where it never is.
    /// Behind stand the ticks between which it is.
    pub(super) fn track(&self, ray: &Ray, stretch: Stretch) -> Track {
        let ray = self.cell_ray(ray);
        let Some([a, b]) = self.over(&ray, stretch.enter, stretch.leave) else { return Track::default() };
        let ticks = END / stretch.metres();
        let clip = [a, b].map(|t| ((t - stretch.enter) * ticks).clamp(0.0, END));
        let place = ray.at(a);
        let axes: [AxisPlanes; 3] = [0, 1, 2]
            .map(|axis| AxisPlanes::new(place[axis], ray.slope[axis] / ticks, clip[0], self.size[axis]));
        let words = |of: fn(&AxisPlanes) -> u32, behind: u32| {
            let [x, y, z] = &axes;
            [of(x), of(y), of(z), behind]
        };
        Track {
            first: words(|axis| axis.first, clip[0].round() as u32),
            step_high: words(|axis| axis.step[0], clip[1].round() as u32),
            step_low: words(|axis| axis.step[1], 0),
            entry: words(|axis| axis.entry, 0),
        }
    }
}

/// Where a ray begins along one axis, and when it crosses the planes of that axis.
struct AxisPlanes {
    /// In 2^−PLACE_BITS of a cell.
    entry: u32,
    /// In ticks.
    first: u32,
    /// In ticks and 2⁻³² of a tick, and whether it goes backwards.
    step: [u32; 2],
}

impl AxisPlanes {
    /// At `place` among so many cells at tick `begin`, with `slope` cells a tick.
    fn new(place: f64, slope: f64, begin: f64, cells: usize) -> Self {
        let CellEntry { cell, fraction, first } = CellEntry::new(place, slope, begin, cells);
        let parts = f64::from(1 << PLACE_BITS);
        let inside = (fraction * parts).round().min(parts - 1.0);
        let backwards = u32::from(slope < 0.0) << 31;
        let step = slope.abs().recip();
        // An axis along which the ray crosses one plane at most is described by its speed.
        let step = if step < END {
            [step.floor() as u32, ((step - step.floor()) * f64::powi(2.0, 32)) as u32]
        } else {
            [TICKS, (slope.abs() as f32).to_bits()]
        };
        // Not `min`: an axis along which a ray stands still may have 0 / 0.
        let first = if first < 2.0 * END - 1.0 { first } else { 2.0 * END - 1.0 };
        Self {
            entry: ((cell as u32) << PLACE_BITS) | inside as u32,
            first: first as u32,
            step: [step[0] | backwards, step[1]],
        }
    }
}
