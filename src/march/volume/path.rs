//! The way of a view ray: straight, or bent by a changing index of refraction.

use std::sync::Arc;

use glam::DVec3;

use super::super::row_order::by_nests;
use super::cells::{CellRay, Line};
use crate::scene::{Camera, Ray, Volume};
use crate::{Error, Result};

/// View rays through pixels, one a row, each up to the first surface. They are made anew from their cameras whenever they are
/// walked: rows by the million cost 8 bytes each.
#[derive(Debug, Clone)]
pub struct PixelRays {
    cameras: Arc<[Camera]>,
    /// View and pixel of each row; pixels are counted row by row from the top left.
    pixels: Arc<[[u32; 2]]>,
    /// Distance to the first surface in metres, infinite where there is none; empty where no ray meets any.
    lengths: Arc<[f64]>,
}

impl PixelRays {
    /// Rays of one camera through pixels `[view, pixel]`; the view may be any number.
    pub fn seen_by_one(camera: Camera, pixels: impl Into<Arc<[[u32; 2]]>>) -> Self {
        Self { cameras: Arc::new([camera]), pixels: pixels.into(), lengths: Arc::new([]) }
    }

    /// Rays through pixels `[view, pixel]`. `lengths` are in metres along the rays up to the first surface; none where there
    /// are no surfaces.
    pub fn new(cameras: Arc<[Camera]>, pixels: impl Into<Arc<[[u32; 2]]>>, lengths: Arc<[f64]>) -> Self {
        let pixels = pixels.into();
        debug_assert!(lengths.is_empty() || lengths.len() == pixels.len());
        Self { cameras, pixels, lengths }
    }

    /// The same rays up to surfaces at these distances; none where there are no surfaces.
    pub fn until(self, lengths: Arc<[f64]>) -> Self {
        debug_assert!(lengths.is_empty() || lengths.len() == self.pixels.len());
        Self { lengths, ..self }
    }

    /// Rows in an order in which neighbours are neighbours in their picture.
    pub(super) fn row_order(&self) -> Vec<u32> {
        by_nests(&self.pixels, |view| self.camera(view).size()[0] as u32)
    }

    /// Some of the rays.
    pub fn picked(&self, rows: &[usize]) -> Self {
        let pixels = rows.iter().map(|&row| self.pixels[row]).collect();
        let lengths = match self.lengths.is_empty() {
            true => self.lengths.clone(),
            false => rows.iter().map(|&row| self.lengths[row]).collect(),
        };
        Self { cameras: self.cameras.clone(), pixels, lengths }
    }

    /// The number of rays.
    pub fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.pixels.is_empty()
    }

    /// View and pixel of a row.
    pub fn pixel(&self, row: usize) -> [u32; 2] {
        self.pixels[row]
    }

    /// View and pixel of every row.
    pub fn pixels(&self) -> &[[u32; 2]] {
        &self.pixels
    }

    /// Distance to the first surface.
    #[inline]
    pub fn length(&self, row: usize) -> f64 {
        self.lengths.get(row).copied().unwrap_or(f64::INFINITY)
    }

    /// The ray of a row as it leaves the eye.
    pub fn ray(&self, row: usize) -> Ray {
        let Line { origin, direction } = self.line(row);
        Ray { origin, direction }
    }

    /// Visits the straight pieces of a row, surfaces left aside, while `visit` says to go on: a ray, with the distances from
    /// its origin at which the piece begins and ends.
    pub fn each_straight(
        &self,
        row: usize,
        refraction: Option<&Refraction>,
        mut visit: impl FnMut(&Ray, f64, f64) -> bool,
    ) {
        let mut visit = |line: &Line, a: f64, b: f64| {
            visit(&Ray { origin: line.origin, direction: line.direction }, a, b)
        };
        match refraction {
            None => {
                visit(&self.line(row), 0.0, f64::INFINITY);
            }
            Some(refraction) => refraction.each_line(&self.line(row), f64::INFINITY, &mut visit),
        }
    }

    #[inline]
    fn camera(&self, view: u32) -> &Camera {
        // Of a single camera all rays are seen by it.
        &self.cameras[(view as usize).min(self.cameras.len() - 1)]
    }

    #[inline]
    pub(super) fn line(&self, row: usize) -> Line {
        let [view, pixel] = self.pixels[row];
        let camera = self.camera(view);
        let width = camera.size()[0];
        let ray = camera.pixel_ray(pixel as usize % width, pixel as usize / width);
        Line { origin: ray.origin, direction: ray.direction }
    }
}

/// A changing index of refraction n, which bends rays: d/ds (n dx/ds) = ∇n.
///
/// Outside its grid rays are straight. Source: Ihrke et al. 2007, *Eikonal rendering*, forward Euler steps along the ray
/// equation, as Klehm 2015, sec. 7.4.2 takes them.
#[derive(Debug, Clone)]
pub struct Refraction {
    /// n at the centres of voxels, above 0; trilinear between them.
    index: Arc<Volume>,
    /// ∇n at the centres of voxels, in 1/metre, by central differences.
    gradient: Arc<Volume>,
    /// Length of a step in metres.
    step: f64,
}

impl Refraction {
    /// Rays bent by an index of refraction, in steps of `step` metres.
    ///
    /// Errors: [`Error::Value`] for a step or an index that is not above 0, [`Error::NonFinite`] for a gradient beyond f32.
    pub fn new(index: Arc<Volume>, step: f64) -> Result<Self> {
        if !(step > 0.0 && step.is_finite()) {
            return Err(Error::value("step", step, "finite and above 0 (metres)"));
        }
        if index.range()[0] <= 0.0 {
            return Err(Error::value(
                "refraction",
                index.range()[0],
                "an index of refraction above 0 everywhere",
            ));
        }
        let gradient = Arc::new(gradient(&index)?);
        Ok(Self { index, gradient, step })
    }

    /// The same with steps of another length.
    pub fn with_step(&self, step: f64) -> Self {
        Self { step, ..self.clone() }
    }

    /// Length of a step in metres.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// How far the line on which a ray leaves the grid moves when steps are half as long, in metres: about half of the error of
    /// the step, which is of first order.
    pub fn step_error(&self, ray: &Ray) -> f64 {
        let [(coarse, direction), (fine, _)] =
            [self, &self.with_step(0.5 * self.step)].map(|path| path.exit(ray));
        // Both leave within a step behind the rim; how far along the line says nothing.
        (fine - coarse).reject_from_normalized(direction).length()
    }

    /// Where a ray begins its last straight piece, and its direction there.
    fn exit(&self, ray: &Ray) -> (DVec3, DVec3) {
        let mut exit = (ray.origin, ray.direction);
        let line = Line { origin: ray.origin, direction: ray.direction };
        self.each_line(&line, f64::INFINITY, &mut |line, a, _| {
            exit = (line.origin + line.direction * a, line.direction);
            true
        });
        exit
    }

    /// Visits the straight pieces of a ray in order, of `length` metres in all: each a line with the t at which it begins
    /// and ends, t running through all of them.
    pub(super) fn each_line(&self, line: &Line, length: f64, visit: &mut dyn FnMut(&Line, f64, f64) -> bool) {
        let grid = self.index.grid();
        let cells = CellRay::new(line, grid, 0.0);
        let size = grid.size().map(|side| side as f64);
        let Some([enter, _]) = cells.clip(0.0, size, 0.0, length) else {
            visit(line, 0.0, length);
            return;
        };
        if enter > 0.0 && !visit(line, 0.0, enter) {
            return;
        }
        let inside = |p: DVec3| {
            let q = grid.grid_from_world().transform_point3(p);
            let inside = q.cmpge(DVec3::ZERO).all() && q.cmple(DVec3::from_array(size)).all();
            (q.to_array(), inside)
        };
        let mut t = enter;
        let mut position = line.origin + line.direction * enter;
        let start = self.index.interpolated(inside(position).0)[0];
        let mut momentum = line.direction * f64::from(start);
        // Light that circles inside would never leave; no ray is longer than this many times through the grid.
        let longest = t + 8.0 * self.diagonal();
        loop {
            let (q, is_inside) = inside(position);
            let direction = momentum.normalize_or(line.direction);
            let left = !is_inside && t > enter + 0.5 * self.step;
            // Lines are given as if they had begun at t = 0, so that t runs on.
            let straight = Line { origin: position - direction * t, direction };
            if left || t >= longest {
                visit(&straight, t, length);
                return;
            }
            let end = (t + self.step).min(length);
            if !visit(&straight, t, end) || end >= length {
                return;
            }
            position += direction * (end - t);
            let slope = self.gradient.interpolated(q).map(f64::from);
            momentum += DVec3::from_array(slope) * (end - t);
            t = end;
        }
    }

    fn diagonal(&self) -> f64 {
        let corners = self.index.grid().corners();
        (corners[7] - corners[0]).length()
    }
}

/// The gradient of a volume in world space by central differences, one-sided at its rim.
fn gradient(volume: &Volume) -> Result<Volume> {
    let grid = *volume.grid();
    let size = grid.size();
    let to_world = grid.grid_from_world().matrix3.transpose();
    let values: Vec<[f32; 3]> = (0..grid.len())
        .map(|index| {
            let voxel = grid.voxel(index);
            let slope: [f64; 3] = std::array::from_fn(|axis| {
                let neighbour = |step: isize| {
                    let mut other = voxel;
                    other[axis] = other[axis].saturating_add_signed(step).min(size[axis] - 1);
                    (other[axis] as f64, f64::from(volume.color(grid.index(other))[0]))
                };
                let ((x0, low), (x1, high)) = (neighbour(-1), neighbour(1));
                if x1 > x0 { (high - low) / (x1 - x0) } else { 0.0 }
            });
            (to_world * DVec3::from_array(slope)).as_vec3().to_array()
        })
        .collect();
    Volume::new(grid, 3, crate::scene::Samples::F32(values.into_flattened()))
}
