use rayon::prelude::*;

use super::Constraint;
use crate::Result;
use crate::scene::{Grid, LightFrame, Scene};
use crate::visibility::{Geometry, ShadowMap};

/// What finds the first surfaces behind the texels of a shadow map and behind painted pixels.
pub trait Surfaces {
    /// The shadow map of a scene's geometry.
    fn shadow_map(&self, geometry: &Geometry, frame: &LightFrame, grid: Grid) -> Result<ShadowMap>;

    /// Distance to the first surface behind each painted pixel in metres; infinite where there is none.
    fn lengths(&self, scene: &Scene, geometry: &Geometry, constraints: &[Constraint]) -> Result<Vec<f64>>;
}

/// Rays through the hierarchy of the geometry: exact, one a texel and pixel.
#[derive(Debug, Clone, Copy, Default)]
pub struct Traced;

impl Surfaces for Traced {
    fn shadow_map(&self, geometry: &Geometry, frame: &LightFrame, grid: Grid) -> Result<ShadowMap> {
        ShadowMap::render(geometry, frame, grid)
    }

    fn lengths(&self, scene: &Scene, geometry: &Geometry, constraints: &[Constraint]) -> Result<Vec<f64>> {
        let length = |pixel: &Constraint| {
            let ray = scene.views[pixel.view].camera.pixel_ray(pixel.x, pixel.y);
            geometry.first_hit(&ray, f64::INFINITY).map_or(f64::INFINITY, |hit| hit.distance)
        };
        Ok(constraints.par_iter().map(length).collect())
    }
}
