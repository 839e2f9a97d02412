//! The blend volumes as grids over one box.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::cells::Planes;
use crate::scene::{AirStroke, BlendVolume, Ray, Samples, Volume, VoxelGrid};
use crate::{Error, Result};

/// A box of cubes along the axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AirGrid {
    low: DVec3,
    /// The side of a cube, in metres.
    voxel: f64,
    size: [usize; 3],
}

impl AirGrid {
    /// Over a box, with so many cubes along its longest side; it grows to whole cubes.
    ///
    /// Errors: [`Error::Value`] for a box without volume.
    pub fn over([low, high]: [DVec3; 2], voxels: usize) -> Result<Self> {
        let sides = high - low;
        if !(sides.is_finite() && sides.min_element() > 0.0) {
            let expected = "a box whose `max` is above its `min` on every axis";
            return Err(Error::value("bounds", format!("{low} to {high}"), expected));
        }
        let voxel = sides.max_element() / voxels as f64;
        let size = sides.to_array().map(|side| ((side / voxel - 1e-9).ceil() as usize).max(1));
        let grown = DVec3::from_array(size.map(|side| side as f64 * voxel)) - sides;
        Ok(Self { low: low - 0.5 * grown, voxel, size })
    }

    /// The side of a cube, in metres.
    pub fn voxel(&self) -> f64 {
        self.voxel
    }

    /// Cubes along x, y and z.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Its least and its largest corner, in metres.
    pub fn bounds(&self) -> [DVec3; 2] {
        [self.low, self.low + self.voxel * DVec3::from_array(self.size.map(|side| side as f64))]
    }

    /// The same as voxels of volumes.
    ///
    /// Errors: those of [`VoxelGrid::new`].
    pub(super) fn voxels(&self) -> Result<VoxelGrid> {
        let scale = DAffine3::from_scale(DVec3::splat(self.voxel));
        VoxelGrid::new(self.size, DAffine3::from_translation(self.low) * scale)
    }

    pub(super) fn len(&self) -> usize {
        self.size.iter().product()
    }

    pub(super) fn contains(&self, point: DVec3) -> bool {
        let [low, high] = self.bounds();
        point.cmpge(low).all() && point.cmple(high).all()
    }

    /// The middle of a cube.
    pub(super) fn middle(&self, index: usize) -> DVec3 {
        let [width, height, _] = self.size;
        let voxel = [index % width, index / width % height, index / width / height];
        self.low + self.voxel * (DVec3::from_array(voxel.map(|i| i as f64)) + 0.5)
    }

    /// Cubes that a stroke may reach: the first and the one behind the last on each axis.
    fn reached(&self, stroke: &AirStroke) -> [[usize; 3]; 2] {
        let [low, high] = stroke.bounds().map(|corner| (corner - self.low) / self.voxel);
        let first = [0, 1, 2].map(|axis| low[axis].clamp(0.0, self.size[axis] as f64) as usize);
        let end = [0, 1, 2].map(|axis| high[axis].ceil().clamp(0.0, self.size[axis] as f64) as usize);
        [first, end]
    }
}

/// Corners of a cell between middles, and where a point is in it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    first: usize,
    step: [usize; 3],
    between: [f32; 3],
}

/// A grid with a ring around it, so that what is inside becomes what is outside over one cube.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ringed {
    grid: AirGrid,
    size: [usize; 3],
}

impl Ringed {
    pub(super) fn new(grid: AirGrid) -> Self {
        Self { grid, size: grid.size.map(|side| side + 2) }
    }

    /// Position of a point in cells, whose corners are the middles of cubes.
    fn cells(&self, point: DVec3) -> DVec3 {
        (point - self.grid.low) / self.grid.voxel + 0.5
    }

    /// Where a point is; beyond the ring it is on it.
    pub(super) fn place(&self, point: DVec3) -> Place {
        let cells = self.cells(point);
        let mut place =
            Place { first: 0, step: [1, self.size[0], self.size[0] * self.size[1]], between: [0.0; 3] };
        for axis in 0..3 {
            let at = cells[axis].clamp(0.0, (self.size[axis] - 1) as f64);
            let corner = (at as usize).min(self.size[axis] - 2);
            place.first += corner * place.step[axis];
            place.between[axis] = (at - corner as f64) as f32;
        }
        place
    }

    /// The planes between which values are smooth, along a ray.
    pub(super) fn planes(&self, ray: &Ray) -> Planes {
        let last = DVec3::from_array(self.size.map(|side| (side - 1) as f64));
        Planes::new(self.cells(ray.origin), ray.direction / self.grid.voxel, Some(last))
    }
}

impl Place {
    /// The value between those of a grid with its ring.
    pub(super) fn value(&self, values: &[f32]) -> f32 {
        let mix = |a: f32, b: f32, share: f32| a + share * (b - a);
        let line = |first: usize| mix(values[first], values[first + 1], self.between[0]);
        let plane = |first: usize| mix(line(first), line(first + self.step[1]), self.between[1]);
        mix(plane(self.first), plane(self.first + self.step[2]), self.between[2])
    }
}

/// A blend volume: one value everywhere, or those of a grid with its ring.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Values {
    Same(f64),
    Painted { base: f64, values: Vec<f32> },
}

impl Values {
    /// Lays the strokes over what is stored, between the least and the largest value.
    ///
    /// Errors: [`Error::Value`] naming a stroke that reaches no middle of a cube.
    pub(super) fn new(blend: &BlendVolume, grid: &AirGrid, range: [f64; 2]) -> Result<Self> {
        if blend.stored.is_none() && blend.strokes.is_empty() {
            return Ok(Self::Same(blend.base));
        }
        let mut inner = vec![blend.base as f32; grid.len()];
        if let Some(stored) = &blend.stored {
            let size = DVec3::from_array(stored.grid().size().map(|side| side as f64));
            inner.par_iter_mut().enumerate().for_each(|(index, value)| {
                let place = stored.grid().grid_from_world().transform_point3(grid.middle(index));
                if place.cmpge(DVec3::ZERO).all() && place.cmple(size).all() {
                    let color = stored.interpolated(place.to_array());
                    *value = f64::from(color[0]).clamp(range[0], range[1]) as f32;
                }
            });
        }
        for (number, stroke) in blend.strokes.iter().enumerate() {
            if !paint(&mut inner, grid, stroke, blend.base) {
                let what = format!(
                    "a stroke beside the box of the blend volumes, or thinner than a voxel ({:.3})",
                    grid.voxel
                );
                return Err(Error::value(
                    format!("strokes[{number}]"),
                    what,
                    "one that reaches the middle of a voxel: move or widen it, raise `voxels`, or give smaller `bounds`",
                ));
            }
        }
        let [width, height, depth] = grid.size;
        let mut values = vec![blend.base as f32; (width + 2) * (height + 2) * (depth + 2)];
        for (row, inner) in inner.chunks(width).enumerate() {
            let (j, k) = (row % height, row / height);
            let first = ((k + 1) * (height + 2) + j + 1) * (width + 2) + 1;
            values[first..first + width].copy_from_slice(inner);
        }
        Ok(Self::Painted { base: blend.base, values })
    }

    pub(super) fn is_painted(&self) -> bool {
        matches!(self, Self::Painted { .. })
    }

    /// The value at a place; the place is asked only where something is painted.
    pub(super) fn at(&self, place: Option<&Place>) -> f64 {
        match (self, place) {
            (Self::Same(value), _) => *value,
            (Self::Painted { values, .. }, Some(place)) => f64::from(place.value(values)),
            (Self::Painted { base, .. }, None) => *base,
        }
    }

    /// The least and the largest value.
    pub(super) fn range(&self) -> [f64; 2] {
        match self {
            Self::Same(value) => [*value; 2],
            Self::Painted { values, .. } => {
                values.iter().fold([f64::INFINITY, 0.0], |[low, high], &value| {
                    [low.min(f64::from(value)), high.max(f64::from(value))]
                })
            }
        }
    }

    /// As a volume over the box.
    ///
    /// Errors: those of [`Volume::new`].
    pub(super) fn volume(&self, grid: &AirGrid) -> Result<Volume> {
        let [width, height, depth] = grid.size;
        let samples = match self {
            Self::Same(value) => vec![*value as f32; grid.len()],
            Self::Painted { values, .. } => (0..height * depth)
                .flat_map(|row| {
                    let (j, k) = (row % height, row / height);
                    let first = ((k + 1) * (height + 2) + j + 1) * (width + 2) + 1;
                    values[first..first + width].iter().copied()
                })
                .collect(),
        };
        Volume::new(grid.voxels()?, 1, Samples::F32(samples))
    }

    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Same(_) => 0,
            Self::Painted { values, .. } => size_of_val(&values[..]),
        }
    }
}

/// Paints a stroke; whether it has reached any cube.
fn paint(values: &mut [f32], grid: &AirGrid, stroke: &AirStroke, base: f64) -> bool {
    let target = stroke.value.unwrap_or(base) as f32;
    let [first, end] = grid.reached(stroke);
    let [width, height, _] = grid.size;
    let rows = (first[2]..end[2]).flat_map(|k| (first[1]..end[1]).map(move |j| [j, k]));
    let mut is_reached = false;
    for [j, k] in rows {
        let row = (k * height + j) * width;
        for i in first[0]..end[0] {
            let opacity = stroke.opacity_at(grid.middle(row + i)) as f32;
            if opacity > 0.0 {
                is_reached = true;
                values[row + i] += opacity * (target - values[row + i]);
            }
        }
    }
    is_reached
}
