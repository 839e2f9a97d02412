//! Light from everywhere on the surfaces of a view (Klehm 2015, ch. 3).

mod blur;
mod buffer;
mod occlusion;
mod openness;
mod pattern;
mod preconvolved;
mod rays;
#[cfg(test)]
mod tests;

use glam::DVec3;
use rayon::prelude::*;

use super::transfer::seen_far;
use crate::Result;
use crate::scene::{Camera, Environment, Rgb, Scene, SurfaceLight, SurfaceMethod, Weighting, rgb};
use crate::visibility::Geometry;
use blur::blurred;
use buffer::GeometryBuffer;
use occlusion::openness;
pub use openness::BentCone;
use openness::Openness;
use preconvolved::PreconvolvedLight;
use rays::Rays;

/// How far occluders count where that is not said, as a share of how far the views see.
const RADIUS: f64 = 0.1;

/// Light from everywhere on the surfaces of a scene.
#[derive(Debug, Clone)]
pub struct LitSurfaces {
    parts: Vec<Part>,
    /// What arrives in the place of shares that are missing.
    rest: Rgb,
}

/// One of several ways in which light arrives, with its share.
#[derive(Debug, Clone)]
struct Part {
    share: f64,
    settings: SurfaceLight,
    environment: Environment,
    convolved: PreconvolvedLight,
    /// How far occluders count in a picture, in metres.
    radius: f64,
}

/// How far occluders count in the pictures of scenes where that is not said, in metres.
pub(super) fn fitted_radius<'s>(
    scenes: impl IntoIterator<Item = &'s Scene> + Clone,
    geometry: &Geometry,
) -> f64 {
    RADIUS * seen_far(scenes, geometry)
}

impl LitSurfaces {
    /// None where surfaces are under the same ambient light everywhere.
    ///
    /// Errors: [`crate::Error::Value`] for ambient light that is no light.
    pub fn of(scene: &Scene, geometry: &Geometry) -> Result<Option<Self>> {
        let lights = &scene.looks.surfaces;
        if lights.is_empty() {
            return Ok(None);
        }
        let is_fitted = lights.iter().any(|(_, light)| light.radius.is_none());
        let fitted = if is_fitted { fitted_radius([scene], geometry) } else { f64::INFINITY };
        let part = |(share, settings): &(f64, SurfaceLight)| {
            let environment = match &settings.environment {
                Some(environment) => environment.clone(),
                None => Environment::constant(scene.ambient, 1)?,
            };
            Ok(Part {
                share: *share,
                convolved: PreconvolvedLight::new(&environment)?,
                radius: settings.radius.unwrap_or(fitted),
                settings: settings.clone(),
                environment,
            })
        };
        let parts = lights.iter().map(part).collect::<Result<Vec<_>>>()?;
        let rest = 1.0 - lights.iter().map(|(share, _)| share).sum::<f64>();
        Ok(Some(Self { parts, rest: scene.ambient.map(|value| value * rest.max(0.0) as f32) }))
    }

    /// What arrives at the surface that each pixel shows, as the radiance of a light that is the same from everywhere and hidden by nothing. It is
    /// the same for any number of threads.
    ///
    /// Shapes  [width × height of the camera], RGB
    pub fn arriving(&self, camera: &Camera, geometry: &Geometry) -> Vec<Rgb> {
        let buffer = GeometryBuffer::new(camera, geometry);
        let mut sum = vec![self.rest; buffer.len()];
        for part in &self.parts {
            let arriving = part.arriving(&buffer, geometry);
            sum.par_iter_mut().zip(arriving).for_each(|(sum, arriving)| {
                (0..3).for_each(|c| sum[c] += part.share as f32 * arriving[c]);
            });
        }
        sum
    }

    /// The cones of directions to which the surfaces of the first part are open, pixel by pixel; none where a pixel shows no surface. They are found by its rays where
    /// it has them, else in the picture.
    pub fn bent_cones(&self, camera: &Camera, geometry: &Geometry) -> Vec<Option<BentCone>> {
        let buffer = GeometryBuffer::new(camera, geometry);
        let Some(part) = self.parts.first() else { return vec![None; buffer.len()] };
        let openness = match part.settings.method {
            SurfaceMethod::Rays => part.rays(&buffer, geometry).openness(&part.settings),
            _ => part.openness(&buffer),
        };
        let cone = |(index, openness): (usize, &Openness)| {
            let normal = buffer.at(index)?.normal.as_dvec3();
            Some(openness.cone(normal, part.settings.weighting))
        };
        openness.par_iter().enumerate().map(cone).collect()
    }
}

impl Part {
    fn arriving(&self, buffer: &GeometryBuffer, geometry: &Geometry) -> Vec<Rgb> {
        let openness = match self.settings.method {
            SurfaceMethod::Rays => {
                return self.rays(buffer, geometry).arriving(&self.environment, self.settings.samples);
            }
            SurfaceMethod::Open => vec![Openness::WHOLE; buffer.len()],
            _ => self.openness(buffer),
        };
        let of_pixel = |(index, openness): (usize, &Openness)| {
            buffer.at(index).map_or([0.0; 3], |surface| self.light(surface.normal.as_dvec3(), openness))
        };
        openness.par_iter().enumerate().map(of_pixel).collect()
    }

    fn rays<'r>(&self, buffer: &'r GeometryBuffer, geometry: &'r Geometry) -> Rays<'r> {
        Rays { buffer, geometry, limit: self.settings.radius.unwrap_or(f64::INFINITY) }
    }

    fn openness(&self, buffer: &GeometryBuffer) -> Vec<Openness> {
        let found = openness(buffer, &self.settings, self.radius);
        blurred(buffer, &found, self.settings.pattern, self.radius)
    }

    /// What arrives at a surface with this normal.
    ///
    /// Law     light that is the same from everywhere is AO times itself, whatever is open, where directions count their cosines; light that is linear in the
    ///         direction is exact from cones
    /// Source  Klehm 2015, eqs. 3.8 and 3.9; where directions count alike, with t = 1 / (1 − cos α) and eq. 3.10
    fn light(&self, normal: DVec3, openness: &Openness) -> Rgb {
        let cone = openness.cone(normal, self.settings.weighting);
        let (radiance, factor) = match self.settings.method {
            SurfaceMethod::BentNormals => (self.convolved.of_hemisphere(cone.direction), 1.0),
            SurfaceMethod::BentCones => {
                let factor = match self.settings.weighting {
                    Weighting::Cosine => 1.0,
                    Weighting::Uniform => (1.0 + cone.angle.cos()) * cone.direction.dot(normal).max(0.0),
                };
                (self.convolved.of_cone(cone.direction, cone.angle), factor)
            }
            _ => (self.convolved.of_hemisphere(normal), 1.0),
        };
        rgb(|c| (cone.visibility * factor) as f32 * radiance[c])
    }
}
