//! What a camera sees, pixel by pixel.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::scene::Camera;
use crate::visibility::Geometry;

/// The first surface on the ray through each pixel: a picture of distances and normals.
#[derive(Debug)]
pub(super) struct GeometryBuffer<'c> {
    pub(super) camera: &'c Camera,
    pixels: Vec<Option<Surface>>,
}

/// A surface that a pixel shows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surface {
    /// Along the pixel's ray, in metres.
    pub(super) distance: f32,
    /// Where it is, from the eye, in metres.
    pub(super) from_eye: Vec3,
    /// Of unit length, on the side that is seen.
    pub(super) normal: Vec3,
}

impl<'c> GeometryBuffer<'c> {
    /// Cost    one ray a pixel
    pub(super) fn new(camera: &'c Camera, geometry: &Geometry) -> Self {
        let [width, height] = camera.size();
        let surface = |index: usize| {
            let ray = camera.pixel_ray(index % width, index / width);
            let hit = geometry.first_hit(&ray, f64::INFINITY)?;
            Some(Surface {
                distance: hit.distance as f32,
                from_eye: (ray.direction * hit.distance).as_vec3(),
                normal: hit.normal.as_vec3(),
            })
        };
        Self { camera, pixels: (0..width * height).into_par_iter().map(surface).collect() }
    }

    pub(super) fn len(&self) -> usize {
        self.pixels.len()
    }

    pub(super) fn width(&self) -> usize {
        self.camera.size()[0]
    }

    pub(super) fn at(&self, index: usize) -> Option<&Surface> {
        self.pixels[index].as_ref()
    }

    /// Where a surface is, in world space.
    pub(super) fn point(&self, surface: &Surface) -> DVec3 {
        self.camera.position() + surface.from_eye.as_dvec3()
    }

    /// How far the eye sees towards a point, in metres: up to the plane of the surface that its pixel shows, so that a plane hides nothing of itself however
    /// slanted it is. None where nothing is known: outside of the picture, behind the eye, or without a surface.
    pub(super) fn seen_towards(&self, point: DVec3) -> Option<f64> {
        let at = self.camera.project(point)?;
        let [width, height] = self.camera.size();
        if at.x < 0.0 || at.y < 0.0 || at.x >= width as f64 || at.y >= height as f64 {
            return None;
        }
        let (x, y) = (at.x as usize, at.y as usize);
        let surface = self.at(y * width + x)?;
        let distance = f64::from(surface.distance);
        let normal = surface.normal.as_dvec3();
        let towards = (point - self.camera.position()).normalize_or_zero();
        let across = normal.dot(towards);
        let plane = normal.dot(surface.from_eye.as_dvec3()) / across;
        // Beside a rim that is seen from the side its plane is anywhere.
        let is_near = across < 0.0 && plane > 0.5 * distance && plane < 2.0 * distance;
        Some(if is_near { plane } else { distance })
    }
}
