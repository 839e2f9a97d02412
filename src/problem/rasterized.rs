use super::{Constraint, Surfaces};
use crate::Result;
use crate::gpu::{Gpu, surfaces_seen};
use crate::operator::NOWHERE;
use crate::scene::{Camera, Grid, LightFrame, Mesh, Ray, Scene};
use crate::visibility::{Geometry, Hit, ShadowMap};
use glam::DVec2;

/// A depth pass on a graphics adapter.
///
/// It finds which triangle each pixel sees; where on it is computed in f64, as rays do it. Pixels whose ray misses that triangle or
/// passes a hole of it, along edges and through foliage, are traced, and so are all of a lens that bends straight lines. Against rays only pixels along silhouettes
/// can differ, by what a rasterizer rounds corners to.
#[derive(Debug, Clone)]
pub struct Rasterized(pub Gpu);

/// Nearer than this part of the way to the farthest corner a view sees nothing.
const NEAR: f64 = 1e-6;

impl Rasterized {
    /// The triangle behind every pixel of a camera; none where its lens bends lines that a rasterizer draws straight.
    fn seen_by(&self, camera: &Camera, mesh: &Mesh) -> Result<Option<Vec<u32>>> {
        let far = mesh.positions.iter().map(|p| p.distance(camera.position())).fold(0.0, f64::max);
        let clip = mesh.positions.iter().map(|&p| camera.clip_from_world(p, NEAR * far));
        let Some(clip) = clip.collect::<Option<Vec<_>>>() else { return Ok(None) };
        surfaces_seen(&self.0, &clip, &mesh.triangles, camera.size()).map(Some)
    }
}

impl Surfaces for Rasterized {
    fn shadow_map(&self, geometry: &Geometry, frame: &LightFrame, grid: Grid) -> Result<ShadowMap> {
        let [near, far] = geometry.depths(frame).unwrap_or_default();
        // Room on both sides, so that nothing is cut off.
        let span = 1.002 * (far - near) + 1e-6 * far.abs().max(near.abs()) + f64::MIN_POSITIVE;
        let size = DVec2::new(grid.size[0] as f64, grid.size[1] as f64);
        let clip = geometry.mesh().positions.iter().map(|&position| {
            let p = frame.light_from_world(position);
            let at = 2.0 * grid.grid_from_light(DVec2::new(p.x, p.y)) / size - 1.0;
            [at.x, -at.y, (far + 0.001 * span - p.z) / span, 1.0]
        });
        let seen = surfaces_seen(&self.0, &clip.collect::<Vec<_>>(), &geometry.mesh().triangles, grid.size)?;
        ShadowMap::render_by(geometry, frame, grid, |index, ray| {
            hit(geometry, ray, seen[index]).map(|hit| hit.distance)
        })
    }

    fn hits(
        &self,
        scene: &Scene,
        geometry: &Geometry,
        constraints: &[Constraint],
    ) -> Result<Vec<Option<Hit>>> {
        let mut seen = vec![None; scene.views.len()];
        for (view, seen) in seen.iter_mut().enumerate() {
            if constraints.iter().any(|pixel| pixel.view == view) {
                *seen = self.seen_by(&scene.views[view].camera, geometry.mesh())?;
            }
        }
        let of_pixel = |pixel: &Constraint| {
            let camera = &scene.views[pixel.view].camera;
            let ray = camera.pixel_ray(pixel.x, pixel.y);
            match &seen[pixel.view] {
                Some(seen) => hit(geometry, &ray, seen[pixel.y * camera.size()[0] + pixel.x]),
                None => geometry.first_hit(&ray, f64::INFINITY),
            }
        };
        Ok(constraints.iter().map(of_pixel).collect())
    }
}

/// Where a ray meets the triangle that it was seen to meet, or what it meets instead.
fn hit(geometry: &Geometry, ray: &Ray, triangle: u32) -> Option<Hit> {
    if triangle == NOWHERE {
        return None;
    }
    geometry.hit_on(ray, triangle as usize).or_else(|| geometry.first_hit(ray, f64::INFINITY))
}
