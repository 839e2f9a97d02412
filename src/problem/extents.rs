use std::sync::Arc;

use super::heterogeneity::HeterogeneousAir;
use super::scattered::Scattered;
use super::sight::{Sight, grid, occluded, seen_and_occluded};
use super::sky::sky_beams;
use super::surface_light::LitSurfaces;
use super::surfaces::lengths;
use super::transfer::{Tinted, TransferFunction};
use super::{Constraint, SkyBeam, Surfaces, Traced};
use crate::march::ViewRay;
use crate::scene::{Grid, LightFrame, Looks, MapFit, MapSettings, Medium, OccluderEditKind, Ray, Rgb, Scene};
use crate::visibility::{Geometry, ShadowMap, edited};
use crate::{Error, Result};

/// Where light map and shadow map lie, the shadow map itself, and the geometry that it is a map of.
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
    /// The colours of scattered light; none where it is as it is.
    pub transfer: Option<Arc<TransferFunction>>,
    /// What makes the air scatter more or less light along a ray; none where it is even.
    pub heterogeneity: Option<Arc<HeterogeneousAir>>,
    /// Light from everywhere on surfaces; none where it is the ambient light alone.
    pub surface_light: Option<Arc<LitSurfaces>>,
}

impl Maps {
    /// A view ray in the frame of the light, its scattered light as looks have it, and the radiance that they add to that. `length` is in
    /// metres up to the first surface, infinite where there is none.
    pub fn view_ray(&self, ray: &Ray, length: f64, medium: &Medium) -> (ViewRay, Rgb) {
        self.view_ray_in(ray, length, medium, self.air_factor(ray, length))
    }

    /// The same through air that scatters so many times as much light.
    pub(super) fn view_ray_in(&self, ray: &Ray, length: f64, medium: &Medium, air: f64) -> (ViewRay, Rgb) {
        let ray = ViewRay::new(ray, length, &self.frame, medium);
        let tinted = self.transfer.as_ref().map_or(Tinted::NOT, |it| it.of_ray(&ray, &self.shadow_map));
        let scattering = [0, 1, 2].map(|c| ray.scattering[c] * tinted.factor[c] * air);
        (ViewRay { scattering, ..ray }, tinted.added.map(|added| added * air as f32))
    }

    /// How many times as much light the air scatters along a ray as even air.
    pub fn air_factor(&self, ray: &Ray, length: f64) -> f64 {
        self.heterogeneity.as_ref().map_or(1.0, |air| air.factor(ray, length))
    }

    /// The same maps under another transfer function.
    pub fn tinted(&self, transfer: TransferFunction) -> Self {
        Self { transfer: Some(Arc::new(transfer)), ..self.clone() }
    }

    /// Whether scattered light has one weight for all channels, panes aside.
    pub fn is_grey(&self, medium: &Medium) -> bool {
        medium.is_grey() && self.transfer.as_ref().is_none_or(|it| it.is_grey())
    }
}

/// Fits the maps to what is painted and seen where `light_map` and the scene do not set them, and renders the shadow maps. `geometry` is the
/// hierarchy over the scene's triangles.
///
/// The light map covers the light that painted pixels scatter, or all that views see where nothing is painted ([`MapFit`] has another way).
/// The shadow maps cover all that views see, but not beyond the geometry, which alone casts shadows.
///
/// Errors: [`Error::Value`] for an extent without area.
pub fn fit(scene: &Scene, light_map: &MapSettings, geometry: &Arc<Geometry>) -> Result<Maps> {
    let (constraints, lengths) = painted(scene, geometry)?;
    fit_to(scene, light_map, geometry, &constraints, &lengths, &Traced)
}

/// The painted pixels of a scene, which may be none, and the lengths of their rays in metres.
fn painted(scene: &Scene, geometry: &Geometry) -> Result<(Vec<Constraint>, Vec<f64>)> {
    let constraints = match super::constraints(scene) {
        Err(Error::Empty { .. }) => Vec::new(),
        painted => painted?,
    };
    let lengths = lengths(&Traced.hits(scene, geometry, &constraints)?);
    Ok((constraints, lengths))
}

/// Whether something casts shadows where there is no geometry.
fn extrudes(looks: &Looks) -> bool {
    looks.occluders.iter().any(|edit| matches!(edit.kind, OccluderEditKind::Extrude { .. }))
}

/// The maps of constraints whose rays have these lengths, in metres.
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
    let painted = Sight::of_painted(scene, constraints, lengths);
    let views = Sight::of_views(scene, geometry);
    // What is painted moves nothing of the air.
    let heterogeneity = HeterogeneousAir::of(scene, geometry, &views)?.map(Arc::new);
    let sight = views.and(&painted);
    let seen = sight.over(&frame);
    let grid = grid(&scene.shadow_map, || match extrudes(&scene.looks) {
        false => seen_and_occluded(seen, occluded),
        true => seen,
    })?;
    let shadow_map = match occluded.has_area() {
        true => {
            edited(surfaces.shadow_map(geometry, &frame, grid)?, geometry, &frame, &scene.looks.occluders)?
        }
        false => ShadowMap::open(grid),
    };
    let light_map = super::sight::grid(light_map, || {
        let over_paint = if constraints.is_empty() { seen } else { painted.over(&frame) };
        let scattered = || Scattered::new(scene, (&frame, &shadow_map), constraints, lengths).extent();
        match light_map.fit {
            MapFit::Seen => seen_and_occluded(over_paint, occluded),
            MapFit::Scattered => scattered().unwrap_or_else(|| seen_and_occluded(over_paint, occluded)),
        }
    })?;
    let sky = sky_beams(scene, geometry, &sight)?;
    let shadow_map = if scene.solve.skip.shadows { shadow_map } else { shadow_map.without_pyramid() };
    let transfer = TransferFunction::of(scene, geometry, (&frame, &shadow_map))?.map(Arc::new);
    let surface_light = LitSurfaces::of(scene, geometry)?.map(Arc::new);
    let geometry = geometry.clone();
    let shadow_map = Arc::new(shadow_map);
    Ok(Maps { geometry, frame, light_map, shadow_map, sky, transfer, heterogeneity, surface_light })
}
