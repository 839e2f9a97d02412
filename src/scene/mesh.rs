use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::Rgb;

/// How texture coordinates beyond [0, 1] are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrap {
    /// Repeat the texture.
    #[default]
    Repeat,
    /// Repeat it, mirrored every other time.
    Mirror,
    /// Use its edge.
    Clamp,
}

/// Which parts of a surface are there at all: its alpha texture and the cut-off of glTF's `MASK` mode.
#[derive(Debug, Clone, PartialEq)]
pub struct AlphaMask {
    /// Width and height.
    pub size: [usize; 2],
    /// Alpha from 0 to 255, row by row from the top left.
    pub alpha: Vec<u8>,
    /// Less than this, in [0, 1], is not there.
    pub cutoff: f32,
    /// How coordinates wrap along u and v.
    pub wrap: [Wrap; 2],
}

/// What a triangle is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Diffuse reflectance, linear, in [0, 1].
    pub albedo: Rgb,
    /// Holes in it.
    pub mask: Option<Arc<AlphaMask>>,
}

/// Triangles in world space.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Vertices in metres.
    pub positions: Vec<DVec3>,
    /// Texture coordinates of the vertices, (0, 0) at the top left of the texture (glTF).
    pub coordinates: Vec<[f32; 2]>,
    /// Three vertices each; counter-clockwise from outside, though both sides cast shadows.
    pub triangles: Vec<[u32; 3]>,
    /// Material of each triangle.
    pub material_of: Vec<u32>,
    /// The materials.
    pub materials: Vec<Material>,
}

impl Mesh {
    /// Adds another mesh, moved by `world_from_mesh`.
    pub fn append(&mut self, other: Mesh, world_from_mesh: DAffine3) {
        let vertex = self.positions.len() as u32;
        let material = self.materials.len() as u32;
        self.positions.extend(other.positions.iter().map(|&p| world_from_mesh.transform_point3(p)));
        self.coordinates.extend(other.coordinates);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|index| index + vertex)));
        self.material_of.extend(other.material_of.iter().map(|index| index + material));
        self.materials.extend(other.materials);
    }
}
