use glam::DVec3;

use super::{Mesh, Rgb};
use crate::Result;

/// A built-in shape.
#[derive(Debug, Clone, PartialEq)]
pub enum Primitive {
    /// A box with its centre and full side lengths.
    Box { centre: DVec3, size: DVec3 },
    /// A rectangle around `centre` in the plane of two sides (full lengths).
    Plane { centre: DVec3, sides: [DVec3; 2] },
    /// A sphere.
    Sphere { centre: DVec3, radius: f64 },
    /// A cylinder with closed ends from `from` to `to`.
    Cylinder { from: DVec3, to: DVec3, radius: f64 },
}

impl Primitive {
    /// Its triangles, all of one diffuse reflectance.
    pub fn mesh(&self, _albedo: Rgb) -> Result<Mesh> {
        Ok(Mesh::default())
    }
}
