use rayon::prelude::*;

use super::Constraint;
use crate::Result;
use crate::scene::{Grid, LightFrame, Scene};
use crate::visibility::{Geometry, Hit, ShadowMap};

/// What finds the first surfaces behind the texels of a shadow map and behind painted pixels.
pub trait Surfaces {
    /// The shadow map of a scene's geometry.
    ///
    /// Errors: those of [`ShadowMap::render`], and of an adapter where one finds the surfaces.
    fn shadow_map(&self, geometry: &Geometry, frame: &LightFrame, grid: Grid) -> Result<ShadowMap>;

    /// The first surface behind each painted pixel.
    ///
    /// Errors: those of an adapter where one finds the surfaces.
    fn hits(
        &self,
        scene: &Scene,
        geometry: &Geometry,
        constraints: &[Constraint],
    ) -> Result<Vec<Option<Hit>>>;
}

/// Rays through the hierarchy of the geometry: exact, one a texel and pixel.
#[derive(Debug, Clone, Copy, Default)]
pub struct Traced;

impl Surfaces for Traced {
    fn shadow_map(&self, geometry: &Geometry, frame: &LightFrame, grid: Grid) -> Result<ShadowMap> {
        ShadowMap::render(geometry, frame, grid)
    }

    fn hits(
        &self,
        scene: &Scene,
        geometry: &Geometry,
        constraints: &[Constraint],
    ) -> Result<Vec<Option<Hit>>> {
        let hit = |pixel: &Constraint| {
            let ray = scene.views[pixel.view].camera.pixel_ray(pixel.x, pixel.y);
            geometry.first_hit(&ray, f64::INFINITY)
        };
        Ok(constraints.par_iter().map(hit).collect())
    }
}

/// Distances to surfaces in metres; infinite where there is none.
pub(super) fn lengths(hits: &[Option<Hit>]) -> Vec<f64> {
    hits.iter().map(|hit| hit.map_or(f64::INFINITY, |hit| hit.distance)).collect()
}
