use std::sync::Arc;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::surfaces::lengths;
use super::surroundings::sky_beams;
use super::{Constraint, SkyBeam, Surfaces, Traced};
use crate::scene::{Extent, Grid, LightFrame, MapSettings, Mesh, Ray, Scene};
use crate::visibility::{Geometry, ShadowMap};
use crate::{Error, Result};

/// Transmittance at which a ray that hits nothing no longer counts for the extent of the maps.
const FADED: f64 = 0.02;
/// Every so many pixels of a view are looked along for what the view sees.
const PIXEL_STRIDE: usize = 8;
/// Room around what was seen, as a share of it.
const MARGIN: f64 = 0.01;
/// Room for rounding, as a share of the distance from the origin: some thousand times that of f64.
const ROUNDING: f64 = 1e-12;

/// Where light map and shadow map lie, the shadow map itself, and what it is a map of.
#[derive(Debug, Clone)]
pub struct Maps {
    /// The hierarchy over the scene's triangles.
    pub geometry: Arc<Geometry>,
    /// The frame of the light.
    pub frame: LightFrame,
    /// The texels of the light map.
    pub light_map: Grid,
    /// The shadow map.
    pub shadow_map: Arc<ShadowMap>,
    /// Where the lights of the sky come from; none where they are not looked for.
    pub sky: Arc<[SkyBeam]>,
}

/// What view rays pass through: of each where it begins and where it no longer counts.
#[derive(Debug, Default)]
pub(super) struct Sight(Vec<[DVec3; 2]>);

impl Sight {
    /// Its shadow on the plane of a light.
    pub(super) fn over(&self, frame: &LightFrame) -> Extent {
        self.0.iter().flatten().fold(Extent::NOTHING, |extent, &point| {
            let p = frame.light_from_world(point);
            extent.include(DVec2::new(p.x, p.y))
        })
    }
}

/// Fits the maps to what is seen where `light_map` and the scene do not set them, and renders the shadow maps. `geometry` is the hierarchy
/// over the scene's triangles.
///
/// The light map covers the rays through painted pixels (of a scene without any, what all views see), the shadow
/// maps what all views see; all only as far as there is geometry to cast a shadow.
///
/// Errors: [`Error::Value`] for an extent without area.
pub fn fit(scene: &Scene, light_map: &MapSettings, geometry: &Arc<Geometry>) -> Result<Maps> {
    let constraints = match super::constraints(scene) {
        Err(Error::Empty { .. }) => Vec::new(),
        painted => painted?,
    };
    let lengths = lengths(&Traced.hits(scene, geometry, &constraints)?);
    fit_to(scene, light_map, geometry, &constraints, &lengths, &Traced)
}

/// The same for constraints whose rays have these lengths.
pub(super) fn fit_to(
    scene: &Scene,
    light_map: &MapSettings,
    geometry: &Arc<Geometry>,
    constraints: &[Constraint],
    lengths: &[f64],
    surfaces: &dyn Surfaces,
) -> Result<Maps> {
    let frame = scene.light.frame();
    let occluded = occluded(&scene.mesh, &frame);
    let painted = Sight(
        constraints
            .par_iter()
            .zip(lengths)
            .filter(|(pixel, _)| pixel.weight > 0.0)
            .map(|(pixel, &length)| {
                let camera = &scene.views[pixel.view].camera;
                seen_along(scene, &camera.pixel_ray(pixel.x, pixel.y), length)
            })
            .collect(),
    );
    let mut sight = seen_by_views(scene, geometry);
    sight.0.extend_from_slice(&painted.0);
    let seen = sight.over(&frame);
    let over_light = if constraints.is_empty() { seen } else { painted.over(&frame) };
    let light_map = grid(light_map, over_light, occluded)?;
    let shadow_grid = grid(&scene.shadow_map, seen, occluded)?;
    let shadow_map = if occluded.has_area() {
        surfaces.shadow_map(geometry, &frame, shadow_grid)?
    } else {
        ShadowMap::open(shadow_grid)
    };
    let sky = sky_beams(scene, geometry, &sight)?;
    let shadow_map = if scene.solve.skip.shadows { shadow_map } else { shadow_map.without_pyramid() };
    let geometry = geometry.clone();
    Ok(Maps { geometry, frame, light_map, shadow_map: Arc::new(shadow_map), sky })
}

/// Where a shadow map along some frame lies; none where nothing casts a shadow.
pub(super) fn shadow_grid(
    scene: &Scene,
    sight: &Sight,
    frame: &LightFrame,
    size: [usize; 2],
) -> Result<Option<Grid>> {
    let occluded = occluded(&scene.mesh, frame);
    let settings = MapSettings { size, extent: None };
    occluded.has_area().then(|| grid(&settings, sight.over(frame), occluded)).transpose()
}

/// The box around all vertices, along a light.
fn occluded(mesh: &Mesh, frame: &LightFrame) -> Extent {
    mesh.positions.iter().fold(Extent::NOTHING, |extent, &point| {
        let p = frame.light_from_world(point);
        extent.include(DVec2::new(p.x, p.y))
    })
}

fn grid(settings: &MapSettings, seen: Extent, occluded: Extent) -> Result<Grid> {
    let fitted = || {
        let extent = seen.intersection(occluded).unwrap_or(seen);
        let sides = extent.max - extent.min;
        // What rounding leaves of a place so far from the origin.
        let rounding = ROUNDING * extent.min.abs().max(extent.max.abs()).max_element();
        let margin = (MARGIN * sides.max_element()).max(rounding);
        // A single ray along the light sees no area at all; give it a texel's worth.
        extent.grown(if margin > 0.0 { margin } else { 1e-6 })
    };
    Grid::new(settings.extent.unwrap_or_else(fitted), settings.size)
}

fn seen_by_views(scene: &Scene, geometry: &Geometry) -> Sight {
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
    Sight(pixels.into_par_iter().map(seen).collect())
}

/// Where a view ray begins and where it no longer counts.
fn seen_along(scene: &Scene, ray: &Ray, length: f64) -> [DVec3; 2] {
    let bound = if length.is_finite() { scene.solve.transmittance_bound } else { FADED };
    let end = length.min(scene.medium.reach(bound));
    [ray.at(0.0), ray.at(end)]
}
