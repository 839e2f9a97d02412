use std::sync::Arc;

use super::sight::{Sight, grid, occluded};
use super::sky::sky_beams;
use super::surfaces::lengths;
use super::{Constraint, SkyBeam, Surfaces, Traced};
use crate::scene::{Grid, LightFrame, MapSettings, Scene};
use crate::visibility::{Geometry, ShadowMap};
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
}

/// Fits the maps to what is seen where `light_map` and the scene do not set them, and renders the shadow maps. `geometry` is the hierarchy
/// over the scene's triangles.
///
/// The light map covers the rays through painted pixels, or all that views see where nothing is painted. The shadow maps cover all that
/// views see. Neither goes beyond the geometry, which alone casts shadows.
///
/// Errors: [`Error::Value`] for an extent without area.
pub fn fit(scene: &Scene, light_map: &MapSettings, geometry: &Arc<Geometry>) -> Result<Maps> {
    let (constraints, lengths) = painted(scene, geometry)?;
    fit_to(scene, light_map, geometry, &constraints, &lengths, &Traced)
}

/// Where [`fit`] puts the light map and the shadow map, without rendering anything into them: two grids in metres across the light.
///
/// Errors: as [`fit`].
pub fn fitted_grids(scene: &Scene, geometry: &Geometry) -> Result<[Grid; 2]> {
    let (constraints, lengths) = painted(scene, geometry)?;
    let placed = Placed::new(scene, &scene.light_map, geometry, &constraints, &lengths)?;
    Ok([placed.light_map, placed.shadow_map])
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

/// Where the maps lie, and what they were fitted to.
struct Placed {
    frame: LightFrame,
    sight: Sight,
    /// Whether anything casts a shadow.
    is_occluded: bool,
    light_map: Grid,
    shadow_map: Grid,
}

impl Placed {
    fn new(
        scene: &Scene,
        light_map: &MapSettings,
        geometry: &Geometry,
        constraints: &[Constraint],
        lengths: &[f64],
    ) -> Result<Self> {
        let frame = scene.light.frame();
        let occluded = occluded(&scene.mesh, &frame);
        let painted = Sight::of_painted(scene, constraints, lengths);
        let sight = Sight::of_views(scene, geometry).and(&painted);
        let seen = sight.over(&frame);
        let over_light = if constraints.is_empty() { seen } else { painted.over(&frame) };
        Ok(Self {
            frame,
            sight,
            is_occluded: occluded.has_area(),
            light_map: grid(light_map, over_light, occluded)?,
            shadow_map: grid(&scene.shadow_map, seen, occluded)?,
        })
    }
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
    let Placed { frame, sight, is_occluded, light_map, shadow_map } =
        Placed::new(scene, light_map, geometry, constraints, lengths)?;
    let shadow_map = match is_occluded {
        true => surfaces.shadow_map(geometry, &frame, shadow_map)?,
        false => ShadowMap::open(shadow_map),
    };
    let sky = sky_beams(scene, geometry, &sight)?;
    let shadow_map = if scene.solve.skip.shadows { shadow_map } else { shadow_map.without_pyramid() };
    let geometry = geometry.clone();
    Ok(Maps { geometry, frame, light_map, shadow_map: Arc::new(shadow_map), sky })
}
