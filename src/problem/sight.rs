//! What view rays pass through, and the maps that cover it.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::Constraint;
use crate::Result;
use crate::scene::{Extent, Grid, LightFrame, MapSettings, Mesh, Ray, Scene, View};
use crate::visibility::Geometry;

/// Transmittance at which a ray that hits nothing no longer counts for the extent of the maps.
const FADED: f64 = 0.02;
/// Pixels from one sampled ray of a view to the next, along both axes.
const PIXEL_STRIDE: usize = 8;
/// Texels at least along each side of a map whose texels are square.
const LEAST_SIDE: f64 = 16.0;
/// Room around what was seen, as a share of its larger side.
const MARGIN: f64 = 0.01;
/// Room for rounding, as a share of the distance from the origin: some thousand times that of f64.
const ROUNDING: f64 = 1e-12;

/// The stretches of space that view rays pass through: where each begins, and where it no longer counts; in world space, metres.
#[derive(Debug, Default)]
pub(super) struct Sight(Vec<[DVec3; 2]>);

impl Sight {
    /// Along the rays through every eighth pixel of every view.
    pub(super) fn of_views(scene: &Scene, geometry: &Geometry) -> Self {
        let pixels: Vec<(usize, usize, usize)> = scene
            .views
            .iter()
            .enumerate()
            .flat_map(|(view, seen)| {
                let [width, height] = seen.camera.size();
                let along = |side: usize| (0..side).step_by(PIXEL_STRIDE).chain([side - 1]);
                along(height).flat_map(move |y| along(width).map(move |x| (view, x, y)))
            })
            .collect();
        let seen = |(view, x, y): (usize, usize, usize)| {
            let ray = scene.views[view].camera.pixel_ray(x, y);
            let length = geometry.first_hit(&ray, f64::INFINITY).map_or(f64::INFINITY, |hit| hit.distance);
            seen_along(scene, &ray, length)
        };
        Self(pixels.into_par_iter().map(seen).collect())
    }

    /// Along the rays through painted pixels, whose lengths are in metres up to the first surface.
    pub(super) fn of_painted(scene: &Scene, constraints: &[Constraint], lengths: &[f64]) -> Self {
        let painted = constraints.par_iter().zip(lengths).filter(|(pixel, _)| pixel.weight > 0.0);
        let seen = painted.map(|(pixel, &length)| {
            let camera = &scene.views[pixel.view].camera;
            seen_along(scene, &camera.pixel_ray(pixel.x, pixel.y), length)
        });
        Self(seen.collect())
    }

    /// Where each begins and ends.
    pub(super) fn stretches(&self) -> &[[DVec3; 2]] {
        &self.0
    }

    /// Along the rays of both.
    pub(super) fn and(mut self, other: &Self) -> Self {
        self.0.extend_from_slice(&other.0);
        self
    }

    /// Its shadow on the plane of a light.
    pub(super) fn over(&self, frame: &LightFrame) -> Extent {
        self.0.iter().flatten().fold(Extent::NOTHING, |extent, &point| {
            let p = frame.light_from_world(point);
            extent.include(DVec2::new(p.x, p.y))
        })
    }
}

/// Distances to the surfaces that a view sees, from the nearest on, and how many rays were asked: one in so many pixels along both axes.
pub(crate) fn seen_distances(view: &View, geometry: &Geometry, stride: usize) -> (Vec<f64>, usize) {
    let [width, height] = view.camera.size();
    let along = |side: usize| (side.min(stride) / 2..side).step_by(stride);
    let pixels: Vec<[usize; 2]> = along(height).flat_map(|y| along(width).map(move |x| [x, y])).collect();
    let hit = |&[x, y]: &[usize; 2]| geometry.first_hit(&view.camera.pixel_ray(x, y), f64::INFINITY);
    let mut distances: Vec<f64> = pixels.par_iter().filter_map(hit).map(|hit| hit.distance).collect();
    distances.sort_by(f64::total_cmp);
    (distances, pixels.len())
}

/// The grid of a shadow map along a frame, over what is both seen and occluded; none where nothing casts a shadow.
pub(super) fn shadow_grid(
    scene: &Scene,
    sight: &Sight,
    frame: &LightFrame,
    size: [usize; 2],
) -> Result<Option<Grid>> {
    let occluded = occluded(&scene.mesh, frame);
    let settings = MapSettings::new(size);
    occluded
        .has_area()
        .then(|| grid(&settings, || seen_and_occluded(sight.over(frame), occluded)))
        .transpose()
}

/// The box around all vertices, along a light.
pub(super) fn occluded(mesh: &Mesh, frame: &LightFrame) -> Extent {
    mesh.positions.iter().fold(Extent::NOTHING, |extent, &point| {
        let p = frame.light_from_world(point);
        extent.include(DVec2::new(p.x, p.y))
    })
}

/// What is both seen and occluded, with a margin; what is seen where that is nothing.
pub(super) fn seen_and_occluded(seen: Extent, occluded: Extent) -> Extent {
    let extent = seen.intersection(occluded).unwrap_or(seen);
    let sides = extent.max - extent.min;
    // What rounding leaves of a place so far from the origin.
    let rounding = ROUNDING * extent.min.abs().max(extent.max.abs()).max_element();
    let margin = (MARGIN * sides.max_element()).max(rounding);
    // A single ray along the light sees no area at all; give it a texel's worth.
    extent.grown(if margin > 0.0 { margin } else { 1e-6 })
}

/// The grid of a map: where the settings say, else where it is `fitted`.
pub(super) fn grid(settings: &MapSettings, fitted: impl FnOnce() -> Extent) -> Result<Grid> {
    let extent = settings.extent.unwrap_or_else(fitted);
    let size = if settings.square_texels { square(settings.size, extent) } else { settings.size };
    Grid::new(extent, size)
}

/// As many square texels at most, where sides may be so different.
fn square(size: [usize; 2], extent: Extent) -> [usize; 2] {
    let sides = extent.max - extent.min;
    let count = (size[0] * size[1]) as f64;
    let along = |axis: usize| ((count * sides[axis] / sides[1 - axis]).sqrt().floor()).max(LEAST_SIDE);
    let width = along(0).min((count / LEAST_SIDE).floor());
    let height = along(1).min((count / width).floor()).max(1.0);
    if width.is_finite() && height.is_finite() { [width as usize, height as usize] } else { size }
}

/// Where a view ray begins and where it no longer counts.
fn seen_along(scene: &Scene, ray: &Ray, length: f64) -> [DVec3; 2] {
    let bound = if length.is_finite() { scene.solve.transmittance_bound } else { FADED };
    let end = length.min(scene.medium.reach(bound));
    [ray.at(0.0), ray.at(end)]
}
