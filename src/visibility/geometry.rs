use std::sync::Arc;

use glam::DVec3;

use super::hierarchy::Hierarchy;
use super::triangle::Probe;
use crate::scene::{Glass, LightFrame, Material, Mesh, Ray, Rgb, rgb};
use crate::{Error, Result};

/// Triangles with a bounding volume hierarchy over them.
///
/// The mesh stays as it is, so that indices of triangles are the same here and in the scene. Triangles without area are in
/// it, but nothing ever hits them.
///
/// Intersections are computed in f64 and are watertight: a ray does not pass between two triangles that share
/// an edge or a vertex. Both sides of a triangle are hit.
///
/// Panes, which let light through ([`crate::scene::Glass`]), have a hierarchy of their own: they cost a scene without them nothing.
#[derive(Debug)]
pub struct Geometry {
    mesh: Arc<Mesh>,
    solid: Option<Hierarchy>,
    panes: Option<Hierarchy>,
    /// Whether a picture says where some surface is.
    has_pictures: bool,
}

/// A surface on a ray that lets light through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pane {
    /// Distance along the ray in metres.
    pub distance: f64,
    /// What passes of light, a share a channel.
    pub transmittance: Rgb,
    /// Which triangle it is, an index into [`Mesh::triangles`].
    pub triangle: usize,
}

impl Pane {
    /// Two triangles of one material are one surface where a ray meets them so close to each other, as a share of the distance: on their
    /// common edge.
    const SAME: f64 = 1e-9;
}

/// The first solid surface on a ray.
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
        let all: Vec<_> = all.filter(|(_, corners)| has_area(corners)).collect();
        let of = |is_of: &dyn Fn(Option<&Glass>) -> bool| {
            let is_of: Vec<bool> =
                mesh.materials.iter().map(|material| is_of(material.glass.as_ref())).collect();
            let picked = all.iter().filter(|(index, _)| is_of[mesh.material_of[*index as usize] as usize]);
            Hierarchy::new(&picked.copied().collect::<Vec<_>>())
        };
        let solid = of(&|glass| glass.is_none_or(Glass::has_solid_places));
        let panes = of(&|glass| glass.is_some_and(Glass::colors));
        let has_pictures = mesh.materials.iter().any(Material::has_pictures);
        Ok(Self { mesh, solid, panes, has_pictures })
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
        self.solid.is_none() && self.panes.is_none()
    }

    /// Whether some surface lets light through.
    #[inline]
    pub fn has_panes(&self) -> bool {
        self.panes.is_some()
    }

    /// Whether all panes let all channels through alike; so where there are none.
    pub fn is_grey(&self) -> bool {
        self.mesh.materials.iter().filter_map(|material| material.glass.as_ref()).all(Glass::is_grey)
    }

    /// The corners of the smallest box around everything; none for open air.
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        let each = [&self.solid, &self.panes].into_iter().flatten().map(Hierarchy::bounds);
        each.reduce(|[low, high], [other_low, other_high]| [low.min(other_low), high.max(other_high)])
    }

    /// Least and largest depth of everything along a light, in metres; none for open air.
    pub fn depths(&self, frame: &LightFrame) -> Option<[f64; 2]> {
        let depths = self.mesh.positions.iter().map(|&p| frame.light_from_world(p).z);
        depths.fold(None, |range: Option<[f64; 2]>, z| {
            Some(range.map_or([z, z], |[least, largest]| [least.min(z), largest.max(z)]))
        })
    }

    /// The first solid surface after the origin and before `limit` metres, panes and holes of alpha masks passed through.
    ///
    /// Where several triangles lie at the same distance it is the one that comes first in the mesh. A ray that
    /// is not finite hits nothing.
    pub fn first_hit(&self, ray: &Ray, limit: f64) -> Option<Hit> {
        let hierarchy = self.solid.as_ref()?;
        let (distance, triangle) =
            hierarchy.first(ray, limit, |index, weights| self.is_solid(index, weights))?;
        Some(self.hit_at(ray, distance, triangle))
    }

    /// How far the first solid surface is that is on no triangle of some.
    pub fn first_hit_but(&self, ray: &Ray, limit: f64, is_passed: impl Fn(usize) -> bool) -> Option<f64> {
        let hierarchy = self.solid.as_ref()?;
        let hit =
            hierarchy.first(ray, limit, |index, weights| !is_passed(index) && self.is_solid(index, weights));
        hit.map(|(distance, _)| distance)
    }

    /// The panes after the origin and before `limit` metres, in the order in which the ray meets them. The two sides of a body are one
    /// pane, where the ray meets the first of them: a window that is a flat box colours light as one that is a rectangle.
    pub fn panes(&self, ray: &Ray, limit: f64) -> Vec<Pane> {
        let Some(hierarchy) = &self.panes else { return Vec::new() };
        let mut panes = Vec::new();
        hierarchy.each(ray, limit, |distance, triangle, weights| {
            let transmittance = self.mesh.material(triangle).passes(self.coordinates(triangle, weights));
            if transmittance != [0.0; 3] && transmittance != [1.0; 3] {
                panes.push(Pane { distance, transmittance, triangle });
            }
        });
        panes.sort_by(|a, b| a.distance.total_cmp(&b.distance).then(a.triangle.cmp(&b.triangle)));
        let of = |pane: &Pane| [self.mesh.object_of[pane.triangle], self.mesh.material_of[pane.triangle]];
        panes.dedup_by(|later, earlier| {
            let apart = later.distance - earlier.distance;
            apart <= Pane::SAME * earlier.distance && of(later) == of(earlier)
        });
        // Sides that have been met and not yet their other sides.
        let mut met: Vec<([u32; 2], bool)> = Vec::new();
        panes.retain(|pane| {
            let normal = normal(&corners(&self.mesh, self.mesh.triangles[pane.triangle]));
            let is_front = normal.dot(ray.direction) < 0.0;
            let other = met.iter().position(|&side| side == (of(pane), !is_front));
            match other {
                Some(other) => _ = met.swap_remove(other),
                None => met.push((of(pane), is_front)),
            }
            other.is_none()
        });
        panes
    }

    /// What passes of light on a ray after its origin and before `limit` metres: zeros where a solid surface is in between.
    pub fn transmittance(&self, ray: &Ray, limit: f64) -> Rgb {
        if self.blocks(ray, limit) {
            return [0.0; 3];
        }
        let panes = self.panes(ray, limit);
        panes.iter().fold([1.0; 3], |passed, pane| rgb(|c| passed[c] * pane.transmittance[c]))
    }

    /// The first surface after the origin and before `limit` metres, whether it is solid or a pane.
    pub fn first_surface(&self, ray: &Ray, limit: f64) -> Option<Hit> {
        let hit = self.first_hit(ray, limit);
        let pane = self.panes(ray, hit.map_or(limit, |hit| hit.distance)).into_iter().next();
        pane.map(|pane| self.hit_at(ray, pane.distance, pane.triangle)).or(hit)
    }

    fn hit_at(&self, ray: &Ray, distance: f64, triangle: usize) -> Hit {
        let normal = normal(&corners(&self.mesh, self.mesh.triangles[triangle]));
        let normal = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
        let albedo = self.mesh.material(triangle).albedo;
        Hit { distance, normal, albedo, triangle }
    }

    /// Where a ray meets one triangle, by its index in the mesh; none where it misses it or passes a hole or a pane, and for
    /// a triangle without area.
    pub fn hit_on(&self, ray: &Ray, triangle: usize) -> Option<Hit> {
        let corners = corners(&self.mesh, *self.mesh.triangles.get(triangle)?);
        let meeting = Probe::new(ray).meet(&corners)?;
        let there = meeting.distance > 0.0 && has_area(&corners) && self.is_solid(triangle, &meeting.weights);
        there.then(|| self.hit_at(ray, meeting.distance, triangle))
    }

    /// Whether anything solid lies on the ray after its origin and before `limit` metres.
    pub fn blocks(&self, ray: &Ray, limit: f64) -> bool {
        self.solid.as_ref().is_some_and(|hierarchy| {
            hierarchy.any(ray, limit, |index, weights| self.is_solid(index, weights))
        })
    }

    /// Whether a triangle has no hole and is no pane at the point with these weights of its corners.
    #[inline]
    fn is_solid(&self, index: usize, weights: &[f64; 3]) -> bool {
        if !self.has_panes() && !self.has_pictures {
            return true;
        }
        let material = self.mesh.material(index);
        match (&material.glass, &material.mask) {
            (None, None) => true,
            (None, Some(mask)) => mask.is_there(self.coordinates(index, weights)),
            (Some(_), _) => material.passes(self.coordinates(index, weights)) == [0.0; 3],
        }
    }

    /// The texture coordinates at the point of a triangle with these weights of its corners.
    fn coordinates(&self, triangle: usize, weights: &[f64; 3]) -> [f64; 2] {
        let mut at = [0.0; 2];
        for (vertex, weight) in self.mesh.triangles[triangle].iter().zip(weights) {
            let [u, v] = self.mesh.coordinates[*vertex as usize].map(f64::from);
            at = [at[0] + weight * u, at[1] + weight * v];
        }
        at
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
