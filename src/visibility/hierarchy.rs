//! A hierarchy of f32 boxes that is conservative for triangles and rays in f64.
//!
//! Boxes live in a space where everything lies in [−1, 1]³, whatever the size and place of the scene. There
//! the traversal's errors (f32 rays, 8-bit boxes, directions below 1e-7 taken as 1e-7) stay below 4e-6, and
//! boxes are larger than their triangles by [`PADDING`]; so no triangle is lost and the answer is that of the f64 test.

use glam::{DVec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::ray::RayHit;

use super::build::build;
use super::triangle::{Meeting, Probe};
use crate::scene::Ray;

const PADDING: f64 = 8e-6;
/// How far before its start a ray enters the boxes: they are only seen from 1e-4 on.
const RUN_UP: f64 = 1e-3;

/// Triangles in the order of the leaves of a hierarchy.
#[derive(Debug)]
pub(super) struct Hierarchy {
    tree: CwBvh,
    /// Of each leaf the index that its triangle was given.
    indices: Vec<u32>,
    corners: Vec<[DVec3; 3]>,
    bounds: [DVec3; 2],
    centre: DVec3,
    /// Boxes' lengths in a metre.
    scale: f64,
}

/// A ray as the hierarchy sees it.
struct Entry {
    /// Where the ray reaches the scene, in metres from its origin.
    start: f64,
    probe: Probe,
    boxes: obvhs::ray::Ray,
}

impl Hierarchy {
    /// Over triangles that are finite and not degenerate, with their indices, which increase; none without triangles.
    pub(super) fn new(triangles: &[(u32, [DVec3; 3])]) -> Option<Self> {
        let bounds = bounds_of(triangles)?;
        let centre = bounds[0].midpoint(bounds[1]);
        let scale = 2.0 / (bounds[1] - bounds[0]).max_element();
        let boxes = triangles.iter().map(|(_, corners)| padded_box(corners, centre, scale));
        let mut tree = bvh2_to_cwbvh(&build(&boxes.collect::<Vec<Aabb>>()), 3, true, false);
        // Walks of the tree do not read it.
        let leaves = std::mem::take(&mut tree.primitive_indices);
        let (indices, corners) = leaves.iter().map(|&leaf| triangles[leaf as usize]).unzip();
        Some(Self { tree, indices, corners, bounds, centre, scale })
    }

    /// The corners of the smallest box around the triangles.
    pub(super) fn bounds(&self) -> [DVec3; 2] {
        self.bounds
    }

    /// The nearest triangle before `limit` for which `is_there` (index, weights of its corners), and its
    /// distance. Of triangles at the same distance, the one of the least index.
    pub(super) fn first(
        &self,
        ray: &Ray,
        limit: f64,
        is_there: impl Fn(usize, &[f64; 3]) -> bool,
    ) -> Option<(f64, usize)> {
        let entry = self.enter(ray, limit)?;
        let mut best: Option<(f64, usize)> = None;
        self.tree.ray_traverse(entry.boxes, &mut RayHit::none(), |_, leaf| {
            let Some((distance, meeting)) = self.meet(&entry, leaf, limit) else { return f32::INFINITY };
            let index = self.indices[leaf] as usize;
            if best.is_some_and(|nearest| nearest <= (distance, index)) || !is_there(index, &meeting.weights)
            {
                return f32::INFINITY;
            }
            best = Some((distance, index));
            self.box_distance(distance - entry.start)
        });
        best
    }

    /// Visits all triangles before `limit` in any order: distance, index, weights of the corners.
    pub(super) fn each(&self, ray: &Ray, limit: f64, mut visit: impl FnMut(f64, usize, &[f64; 3])) {
        let Some(entry) = self.enter(ray, limit) else { return };
        self.tree.ray_traverse(entry.boxes, &mut RayHit::none(), |_, leaf| {
            if let Some((distance, meeting)) = self.meet(&entry, leaf, limit) {
                visit(distance, self.indices[leaf] as usize, &meeting.weights);
            }
            f32::INFINITY
        });
    }

    /// Whether there is any triangle before `limit` for which `is_there`.
    pub(super) fn any(&self, ray: &Ray, limit: f64, is_there: impl Fn(usize, &[f64; 3]) -> bool) -> bool {
        let Some(entry) = self.enter(ray, limit) else { return false };
        !self.tree.ray_traverse_miss(entry.boxes, |_, leaf| match self.meet(&entry, leaf, limit) {
            Some((_, meeting)) if is_there(self.indices[leaf] as usize, &meeting.weights) => 0.0,
            _ => f32::INFINITY,
        })
    }

    #[inline]
    fn meet(&self, entry: &Entry, leaf: usize, limit: f64) -> Option<(f64, Meeting)> {
        let meeting = entry.probe.meet(&self.corners[leaf])?;
        let distance = entry.start + meeting.distance;
        (distance > 0.0 && distance < limit).then_some((distance, meeting))
    }

    /// Moves the start of a ray to the scene's box, where f32 numbers can tell its parts apart.
    fn enter(&self, ray: &Ray, limit: f64) -> Option<Entry> {
        let start = self.reach(ray)?;
        if start >= limit || limit.is_nan() {
            return None;
        }
        let origin = ray.at(start);
        let in_boxes = (origin - self.centre) * self.scale - ray.direction * RUN_UP;
        // Adding zero turns −0 into 0: the traversal takes the sign of one from its bits and of the other by `<`.
        let direction = ray.direction.as_vec3a() + Vec3A::ZERO;
        let far = self.box_distance(limit - start);
        Some(Entry {
            start,
            probe: Probe::new(&Ray { origin, direction: ray.direction }),
            boxes: obvhs::ray::Ray::new(in_boxes.as_vec3a(), direction, 0.0, far),
        })
    }

    /// The distance at which a ray is in the scene's box, a little enlarged; none where it never is.
    fn reach(&self, ray: &Ray) -> Option<f64> {
        if !(ray.origin.is_finite() && ray.direction.is_finite() && ray.direction != DVec3::ZERO) {
            return None;
        }
        let margin = PADDING / self.scale;
        let (mut near, mut far) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let (origin, direction) = (ray.origin[axis], ray.direction[axis]);
            // What the box is enlarged by grows with what the position of a far origin is rounded by.
            let margin = margin + 4.0 * f64::EPSILON * origin.abs();
            let (low, high) = (self.bounds[0][axis] - margin, self.bounds[1][axis] + margin);
            if direction == 0.0 {
                if origin < low || origin > high {
                    return None;
                }
                continue;
            }
            let (a, b) = ((low - origin) / direction, (high - origin) / direction);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near <= far).then_some(near)
    }

    /// A distance from the start of a ray as the boxes see it, rounded up by more than their errors.
    fn box_distance(&self, distance: f64) -> f32 {
        (distance * self.scale + RUN_UP + 2.0 * PADDING) as f32
    }
}

fn bounds_of(triangles: &[(u32, [DVec3; 3])]) -> Option<[DVec3; 2]> {
    let first = triangles.first()?.1[0];
    let around = |[low, high]: [DVec3; 2], p: &DVec3| [low.min(*p), high.max(*p)];
    Some(triangles.iter().flat_map(|(_, corners)| corners).fold([first; 2], around))
}

fn padded_box(corners: &[DVec3; 3], centre: DVec3, scale: f64) -> Aabb {
    let [a, b, c] = corners.map(|corner| (corner - centre) * scale);
    let padding = DVec3::splat(PADDING);
    Aabb::new((a.min(b).min(c) - padding).as_vec3a(), (a.max(b).max(c) + padding).as_vec3a())
}
