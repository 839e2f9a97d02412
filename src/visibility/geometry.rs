use std::sync::Arc;

use glam::DVec3;

use super::hierarchy::Hierarchy;
use super::triangle::Probe;
use crate::scene::{LightFrame, Mesh, Ray, Rgb};
use crate::{Error, Result};

/// Triangles with a bounding volume hierarchy over them.
///
/// The mesh stays as it is, so that indices of triangles are the same here and in the scene. Triangles without area are in
/// it, but nothing ever hits them.
///
/// Intersections are computed in f64 and are watertight: a ray does not pass between two triangles that share
/// an edge or a vertex. Both sides of a triangle are hit.
#[derive(Debug)]
pub struct Geometry {
    mesh: Arc<Mesh>,
    hierarchy: Option<Hierarchy>,
    masked: bool,
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
    /// Which triangle it is, an index into [`Mesh::triangles`]: [`Mesh::object`] and [`Mesh::material`] say of what.
    pub triangle: usize,
}

impl Hit {
    /// The point that was hit, lifted off the surface by a ten-thousandth of how far it is from the eye: a tenth of a pixel as a rule,
    /// whatever the unit of the scene is. Rays towards lights begin there.
    pub(crate) fn lifted(&self, point: DVec3, distance: f64) -> DVec3 {
        point + self.normal * (1e-4 * distance)
    }
}

impl Geometry {
    /// The most triangles that one geometry holds.
    pub const MAX_TRIANGLES: usize = 1 << 28;
    /// Largest coordinate of a vertex, in metres.
    pub const MAX_COORDINATE: f64 = 1e12;

    /// Builds the hierarchy. An empty mesh is fine: open air.
    ///
    /// Errors: those of [`Self::check`].
    pub fn new(mesh: impl Into<Arc<Mesh>>) -> Result<Self> {
        let mesh = mesh.into();
        Self::check(&mesh)?;
        let all = mesh.triangles.iter().enumerate();
        let all = all.map(|(index, &triangle)| (index as u32, corners(&mesh, triangle)));
        let solid: Vec<_> = all.filter(|(_, corners)| has_area(corners)).collect();
        let hierarchy = Hierarchy::new(&solid);
        let masked = mesh.materials.iter().any(|material| material.mask.is_some());
        Ok(Self { mesh, hierarchy, masked })
    }

    /// Whether a hierarchy can be built over a mesh; nothing is built for it.
    ///
    /// Errors: [`Error::Shape`] for arrays whose lengths do not agree; [`Error::Value`] for vertices that are
    /// not finite or beyond 10¹² m, indices out of range and impossible materials; [`Error::NonFinite`] for
    /// texture coordinates where there are alpha masks; [`Error::TooLarge`] beyond 2²⁸ triangles.
    pub fn check(mesh: &Mesh) -> Result<()> {
        mesh.validate()?;
        check_size(mesh)
    }

    /// The triangles.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Whether there is no surface at all.
    #[inline]
    pub fn is_open(&self) -> bool {
        self.hierarchy.is_none()
    }

    /// The corners of the smallest box around everything; none for open air.
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        self.hierarchy.as_ref().map(Hierarchy::bounds)
    }

    /// Least and largest depth of everything along a light, in metres; none for open air.
    pub fn depths(&self, frame: &LightFrame) -> Option<[f64; 2]> {
        let depths = self.mesh.positions.iter().map(|&p| frame.light_from_world(p).z);
        depths.fold(None, |range: Option<[f64; 2]>, z| {
            Some(range.map_or([z, z], |[least, largest]| [least.min(z), largest.max(z)]))
        })
    }

    /// The first surface after the origin and before `limit` metres, holes of alpha masks passed through.
    ///
    /// Where several triangles lie at the same distance it is the one that comes first in the mesh. A ray that
    /// is not finite hits nothing.
    pub fn first_hit(&self, ray: &Ray, limit: f64) -> Option<Hit> {
        let hierarchy = self.hierarchy.as_ref()?;
        let (distance, triangle) =
            hierarchy.first(ray, limit, |index, weights| self.is_there(index, weights))?;
        Some(self.hit_at(ray, distance, triangle))
    }

    fn hit_at(&self, ray: &Ray, distance: f64, triangle: usize) -> Hit {
        let normal = normal(&corners(&self.mesh, self.mesh.triangles[triangle]));
        let normal = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
        let albedo = self.mesh.material(triangle).albedo;
        Hit { distance, normal, albedo, triangle }
    }

    /// Where a ray meets one triangle, by its index in the mesh; none where it misses it or passes a hole, and for a
    /// triangle without area.
    pub fn hit_on(&self, ray: &Ray, triangle: usize) -> Option<Hit> {
        let corners = corners(&self.mesh, *self.mesh.triangles.get(triangle)?);
        let meeting = Probe::new(ray).meet(&corners)?;
        let there = meeting.distance > 0.0 && has_area(&corners) && self.is_there(triangle, &meeting.weights);
        there.then(|| self.hit_at(ray, meeting.distance, triangle))
    }

    /// Whether anything lies on the ray after its origin and before `limit` metres.
    pub fn blocks(&self, ray: &Ray, limit: f64) -> bool {
        self.hierarchy.as_ref().is_some_and(|hierarchy| {
            hierarchy.any(ray, limit, |index, weights| self.is_there(index, weights))
        })
    }

    /// Whether a triangle has no hole at the point with these weights of its corners.
    #[inline]
    fn is_there(&self, index: usize, weights: &[f64; 3]) -> bool {
        if !self.masked {
            return true;
        }
        let Some(mask) = &self.mesh.material(index).mask else {
            return true;
        };
        let mut at = [0.0; 2];
        for (vertex, weight) in self.mesh.triangles[index].iter().zip(weights) {
            let [u, v] = self.mesh.coordinates[*vertex as usize].map(f64::from);
            at = [at[0] + weight * u, at[1] + weight * v];
        }
        mask.is_there(at)
    }
}

fn corners(mesh: &Mesh, triangle: [u32; 3]) -> [DVec3; 3] {
    triangle.map(|vertex| mesh.positions[vertex as usize])
}

/// Not finite for a triangle without area.
fn normal([a, b, c]: &[DVec3; 3]) -> DVec3 {
    (*b - *a).cross(*c - *a).normalize()
}

fn has_area(corners: &[DVec3; 3]) -> bool {
    normal(corners).is_finite()
}

fn check_size(mesh: &Mesh) -> Result<()> {
    if mesh.triangles.len() > Geometry::MAX_TRIANGLES {
        return Err(Error::TooLarge {
            what: "the geometry".into(),
            needed: format!("{} triangles", mesh.triangles.len()),
            limit: format!("{}", Geometry::MAX_TRIANGLES),
            remedy: "simplify it in the modelling program",
        });
    }
    let far = |p: &DVec3| p.abs().max_element() > Geometry::MAX_COORDINATE;
    match mesh.positions.iter().position(far) {
        Some(vertex) => {
            let path = format!("positions[{vertex}]");
            Err(Error::value(path, mesh.positions[vertex], "within 1e12 metres of the origin"))
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
