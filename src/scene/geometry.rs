use glam::DVec3;

use super::{Mesh, Ray, Rgb};
use crate::Result;

/// Triangles with a bounding volume hierarchy over them.
#[derive(Debug)]
pub struct Geometry {
    mesh: Mesh,
}

/// The first surface on a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance along the ray in metres.
    pub distance: f64,
    /// Unit normal on the side from which the ray came.
    pub normal: DVec3,
    /// Diffuse reflectance.
    pub albedo: Rgb,
}

impl Geometry {
    /// Builds the hierarchy. An empty mesh is fine: open air.
    pub fn new(mesh: Mesh) -> Result<Self> {
        Ok(Self { mesh })
    }

    /// The triangles.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The corners of the smallest box around everything; none for open air.
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        None
    }

    /// The first surface before `limit` metres, holes of alpha masks passed through.
    pub fn first_hit(&self, _ray: &Ray, _limit: f64) -> Option<Hit> {
        None
    }

    /// Whether anything lies on the ray before `limit` metres.
    pub fn blocks(&self, ray: &Ray, limit: f64) -> bool {
        self.first_hit(ray, limit).is_some()
    }
}

impl Geometry {
    /// Least and largest depth of everything along a light, in metres; none for open air.
    pub fn depths(&self, frame: &super::LightFrame) -> Option<[f64; 2]> {
        let depths = self.mesh.positions.iter().map(|&p| frame.light_from_world(p).z);
        depths.fold(None, |range: Option<[f64; 2]>, z| {
            Some(range.map_or([z, z], |[least, largest]| [least.min(z), largest.max(z)]))
        })
    }
}
