use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::wrap::{Wrap, neighbours};
use super::{Glass, Rgb};
use crate::{Error, Result};

/// Which parts of a surface are there at all: its alpha texture and the cut-off of glTF's `MASK` mode.
#[derive(Debug, Clone, PartialEq)]
pub struct AlphaMask {
    /// Width and height.
    pub size: [usize; 2],
    /// Alpha from 0 to 255, row by row from the top left.
    pub alpha: Vec<u8>,
    /// Where alpha is less than this, from 0 to 1, there is no surface.
    pub cutoff: f32,
    /// How coordinates wrap along u and v.
    pub wrap: [Wrap; 2],
}

impl AlphaMask {
    /// Whether there is a surface at the texture coordinates (u, v): bilinear alpha against the cut-off.
    ///
    /// Pixel centres lie at half-integer multiples of 1/size. Coordinates that are not finite read an edge pixel.
    pub fn is_there(&self, [u, v]: [f64; 2]) -> bool {
        let ([x0, x1], fx) = neighbours(u, self.size[0], self.wrap[0]);
        let ([y0, y1], fy) = neighbours(v, self.size[1], self.wrap[1]);
        let alpha = |x, y| f64::from(self.alpha.get(y * self.size[0] + x).copied().unwrap_or(0));
        let upper = alpha(x0, y0) * (1.0 - fx) + alpha(x1, y0) * fx;
        let lower = alpha(x0, y1) * (1.0 - fx) + alpha(x1, y1) * fx;
        upper * (1.0 - fy) + lower * fy >= f64::from(self.cutoff) * 255.0
    }

    fn validate(&self) -> Result<()> {
        let pixels =
            self.size[0].checked_mul(self.size[1]).filter(|&pixels| pixels > 0).ok_or_else(|| {
                Error::value(
                    "mask.size",
                    format!("{:?}", self.size),
                    "two positive numbers whose product fits",
                )
            })?;
        if self.alpha.len() != pixels {
            return Err(Error::Shape { what: "an alpha mask", expected: pixels, got: self.alpha.len() });
        }
        if !self.cutoff.is_finite() {
            return Err(Error::value("mask.cutoff", self.cutoff, "finite"));
        }
        Ok(())
    }
}

/// What a triangle is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Its name in its file; none for built-in shapes, and where the file does not name it.
    pub name: Option<String>,
    /// Diffuse reflectance, linear, in [0, 1].
    pub albedo: Rgb,
    /// Holes in it.
    pub mask: Option<Arc<AlphaMask>>,
    /// What of it lets light through; none where it is solid all over.
    pub glass: Option<Glass>,
}

impl Material {
    /// Whether what is there depends on texture coordinates.
    pub fn has_pictures(&self) -> bool {
        self.mask.is_some() || self.glass.as_ref().is_some_and(|glass| glass.picture.is_some())
    }

    /// What of light passes at the texture coordinates (u, v) of a surface: zeros where it is solid, ones where it has a hole.
    pub fn passes(&self, coordinates: [f64; 2]) -> Rgb {
        if self.mask.as_ref().is_some_and(|mask| !mask.is_there(coordinates)) {
            return [1.0; 3];
        }
        self.glass.as_ref().map_or([0.0; 3], |glass| glass.at(coordinates))
    }
}

/// What a triangle is part of: a built-in shape, a node of a glTF file, an object or a group of an OBJ file.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Object {
    /// Its name in its file; none for built-in shapes, and where the file does not name it.
    pub name: Option<String>,
    /// Which of the scene's occluders it came with, counted from 0.
    pub occluder: usize,
}

/// Triangles in world space, each of one object and of one material.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Vertices in metres.
    pub positions: Vec<DVec3>,
    /// Texture coordinates of the vertices, (0, 0) at the top left of the texture (glTF).
    pub coordinates: Vec<[f32; 2]>,
    /// Three vertices each; counter-clockwise from outside, though both sides cast shadows.
    pub triangles: Vec<[u32; 3]>,
    /// Material of each triangle, an index into `materials`.
    pub material_of: Vec<u32>,
    /// The materials; two may have the same name.
    pub materials: Vec<Material>,
    /// Object of each triangle, an index into `objects`.
    pub object_of: Vec<u32>,
    /// The objects; two may have the same name.
    pub objects: Vec<Object>,
}

impl Mesh {
    /// What a triangle is made of; panics for a triangle that is not there, like a slice.
    #[inline]
    pub fn material(&self, triangle: usize) -> &Material {
        &self.materials[self.material_of[triangle] as usize]
    }

    /// What a triangle is part of; panics for a triangle that is not there, like a slice.
    #[inline]
    pub fn object(&self, triangle: usize) -> &Object {
        &self.objects[self.object_of[triangle] as usize]
    }

    /// Adds another mesh, moved by `world_from_mesh`. Its materials and objects stay its own, whatever their names.
    pub fn append(&mut self, other: Mesh, world_from_mesh: DAffine3) {
        let vertex = self.positions.len() as u32;
        let material = self.materials.len() as u32;
        let object = self.objects.len() as u32;
        self.positions.extend(other.positions.iter().map(|&p| world_from_mesh.transform_point3(p)));
        self.coordinates.extend(other.coordinates);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|index| index + vertex)));
        self.material_of.extend(other.material_of.iter().map(|index| index + material));
        self.materials.extend(other.materials);
        self.object_of.extend(other.object_of.iter().map(|index| index + object));
        self.objects.extend(other.objects);
    }

    /// Whether the arrays belong together: lengths, indices and numbers.
    ///
    /// Errors: [`Error::Shape`], [`Error::Value`] or [`Error::NonFinite`], with the vertex or triangle at fault.
    pub fn validate(&self) -> Result<()> {
        self.validate_vertices()?;
        self.validate_triangles()?;
        for (index, material) in self.materials.iter().enumerate() {
            if !material.albedo.iter().all(|&c| c.is_finite() && c >= 0.0) {
                let albedo = format!("{:?}", material.albedo);
                return Err(Error::value(format!("materials[{index}].albedo"), albedo, "between 0 and 1"));
            }
            if let Some(mask) = &material.mask {
                mask.validate().map_err(|error| error.inside(&format!("materials[{index}]")))?;
            }
            if let Some(glass) = &material.glass {
                glass.validate().map_err(|error| error.inside(&format!("materials[{index}]")))?;
            }
        }
        Ok(())
    }

    fn validate_vertices(&self) -> Result<()> {
        let (expected, got) = (self.positions.len(), self.coordinates.len());
        if expected != got {
            return Err(Error::Shape { what: "the list of texture coordinates", expected, got });
        }
        if let Some(vertex) = self.positions.iter().position(|p| !p.is_finite()) {
            return Err(Error::value(format!("positions[{vertex}]"), self.positions[vertex], "finite"));
        }
        // Coordinates are only read where there are pictures, and files of opaque things carry broken ones.
        let masked = self.materials.iter().any(Material::has_pictures);
        let broken = self.coordinates.iter().position(|c| !c.iter().all(|c| c.is_finite()));
        match broken.filter(|_| masked) {
            Some(vertex) => Err(Error::NonFinite {
                what: "a texture coordinate".into(),
                place: format!("vertex {vertex}"),
            }),
            None => Ok(()),
        }
    }

    fn validate_triangles(&self) -> Result<()> {
        let expected = self.triangles.len();
        for (what, got) in [
            ("the list of materials of triangles", self.material_of.len()),
            ("the list of objects of triangles", self.object_of.len()),
        ] {
            if expected != got {
                return Err(Error::Shape { what, expected, got });
            }
        }
        let outside = |t: &[u32; 3]| t.iter().any(|&vertex| vertex as usize >= self.positions.len());
        if let Some(index) = self.triangles.iter().position(outside) {
            let vertices = format!("{:?}", self.triangles[index]);
            return Err(Error::value(
                format!("triangles[{index}]"),
                vertices,
                "below the number of vertices",
            ));
        }
        below("material_of", &self.material_of, self.materials.len(), "below the number of materials")?;
        below("object_of", &self.object_of, self.objects.len(), "below the number of objects")
    }
}

/// Errors: [`Error::Value`] naming the first index that is not below `count`.
fn below(name: &str, indices: &[u32], count: usize, expected: &'static str) -> Result<()> {
    match indices.iter().position(|&index| index as usize >= count) {
        Some(at) => Err(Error::value(format!("{name}[{at}]"), indices[at], expected)),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(wrap: Wrap) -> AlphaMask {
        AlphaMask { size: [4, 2], alpha: vec![255, 0, 0, 0, 255, 0, 0, 0], cutoff: 0.5, wrap: [wrap; 2] }
    }

    #[test]
    fn coordinates_wrap_as_they_are_told() {
        let column = |wrap, u| mask(wrap).is_there([u, 0.4]);
        for (wrap, there, not_there) in [
            (Wrap::Repeat, [0.1, 1.1, -0.9, 1e6 + 0.125], [0.9, -0.125, 1.9, -0.4]),
            (Wrap::Mirror, [0.1, -0.1, 1.9, 2.1], [0.9, 1.1, 3.0, -1.0]),
            (Wrap::Clamp, [0.1, -0.1, -5.0, f64::NEG_INFINITY], [0.9, 1.1, 5.0, 1e300]),
        ] {
            assert!(there.iter().all(|&u| column(wrap, u)), "{wrap:?}");
            assert!(not_there.iter().all(|&u| !column(wrap, u)), "{wrap:?}");
        }
    }

    #[test]
    fn the_border_lies_where_interpolated_alpha_crosses_the_cutoff() {
        let mask = mask(Wrap::Clamp);
        // Centres of the first two pixels are at 1/8 and 3/8.
        assert!(mask.is_there([0.249, 0.5]) && !mask.is_there([0.251, 0.5]));
    }

    #[test]
    fn appended_meshes_keep_their_own_vertices_materials_and_objects() {
        let one = Mesh {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            coordinates: vec![[0.0; 2]; 3],
            triangles: vec![[0, 1, 2]],
            material_of: vec![0],
            materials: vec![Material { name: None, albedo: [0.25; 3], mask: None, glass: None }],
            object_of: vec![0],
            objects: vec![Object { name: Some("one".to_owned()), occluder: 0 }],
        };
        let mut other = one.clone();
        other.objects[0].name = Some("other".to_owned());
        other.materials[0].albedo = [0.75; 3];
        let mut both = one;
        both.append(other, DAffine3::from_translation(DVec3::Z));
        assert!(both.validate().is_ok());
        let name = |triangle: usize| both.object(triangle).name.as_deref();
        assert_eq!([name(0), name(1)], [Some("one"), Some("other")]);
        assert_eq!([0, 1].map(|triangle| both.material(triangle).albedo[0]), [0.25, 0.75]);
        assert_eq!((both.triangles[1], both.material_of[1]), ([3, 4, 5], 1));
        assert_eq!(both.positions[4], DVec3::new(1.0, 0.0, 1.0));
        let broken: [fn(&mut Mesh); 4] = [
            |mesh| mesh.triangles[1][0] = 6,
            |mesh| mesh.material_of[0] = 2,
            |mesh| mesh.object_of[1] = 2,
            |mesh| mesh.object_of.truncate(1),
        ];
        for breaks in broken {
            let mut mesh = both.clone();
            breaks(&mut mesh);
            assert!(mesh.validate().is_err());
        }
    }
}
