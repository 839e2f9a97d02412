//! The lights of the sky that are looked for around a light map: their directions, and what stands in their way.

use std::sync::Arc;

use glam::DVec3;

use super::sight::{Sight, shadow_grid};
use crate::Result;
use crate::scene::{Grid, LightFrame, Scene};
use crate::visibility::{Geometry, ShadowMap};

/// One direction that a light of the sky comes from, and what stands in its way.
#[derive(Debug, Clone)]
pub struct SkyBeam {
    /// The number of the light among those of the sky.
    pub light: usize,
    /// Towards the light, in world space; of unit length.
    pub towards: DVec3,
    /// The part of the light's solid angle that it stands for, in steradians.
    pub solid_angle: f64,
    /// The frame of the light that comes from this direction.
    pub frame: LightFrame,
    /// Where the light arrives.
    pub shadow_map: ShadowMap,
}

/// The directions of the lights that are looked for, with a shadow map for each.
///
/// Cost: one ray a texel and direction.
pub(super) fn sky_beams(scene: &Scene, geometry: &Geometry, sight: &Sight) -> Result<Arc<[SkyBeam]>> {
    let Some(sky) = scene.surroundings.as_ref().and_then(|it| it.sky.as_ref()) else {
        return Ok(Arc::new([]));
    };
    let beam = |light: usize, (towards, solid_angle): (DVec3, f64)| -> Result<SkyBeam> {
        let frame = LightFrame::along(-towards);
        let shadow_map = match shadow_grid(scene, sight, &frame, [sky.shadow_map; 2])? {
            Some(grid) => ShadowMap::render(geometry, &frame, grid)?,
            None => ShadowMap::open(Grid::new(sight.over(&frame).grown(1.0), [1, 1])?),
        };
        let shadow_map = if scene.solve.skip.shadows { shadow_map } else { shadow_map.without_pyramid() };
        Ok(SkyBeam { light, towards, solid_angle, frame, shadow_map })
    };
    let directions = |light| sky.basis.directions(light).into_iter().map(move |direction| (light, direction));
    (0..sky.basis.len()).flat_map(directions).map(|(light, direction)| beam(light, direction)).collect()
}
