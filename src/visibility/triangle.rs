//! Where a ray meets a triangle, such that no ray slips between two triangles that share an edge.

use glam::DVec3;

use crate::scene::Ray;

/// A ray prepared for many triangles: space is sheared so that the ray runs along one axis.
///
/// Source: Woop, Benthin and Wald 2013, "Watertight ray/triangle intersection". The two products of an edge
/// function are the same numbers in both triangles of the edge, and rounding is monotone, so a sign is
/// right or zero and never wrong; zero counts as inside on both sides.
#[derive(Debug, Clone, Copy)]
pub(super) struct Probe {
    origin: DVec3,
    axes: [usize; 3],
    shear: DVec3,
}

/// Where on a triangle a ray met it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Meeting {
    /// Along the ray, in lengths of its direction; may be negative.
    pub(super) distance: f64,
    /// Weights of the three corners; they sum to one.
    pub(super) weights: [f64; 3],
}

impl Probe {
    /// The direction must not be zero.
    pub(super) fn new(ray: &Ray) -> Self {
        let d = ray.direction;
        let size = d.abs();
        let z = if size.x > size.y && size.x > size.z { 0 } else { 1 + usize::from(size.z >= size.y) };
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        Self {
            origin: ray.origin,
            axes,
            shear: DVec3::new(d[axes[0]] / d[axes[2]], d[axes[1]] / d[axes[2]], 1.0 / d[axes[2]]),
        }
    }

    fn sheared(&self, point: DVec3) -> [f64; 3] {
        let [x, y, z] = self.axes;
        let p = point - self.origin;
        [p[x] - self.shear.x * p[z], p[y] - self.shear.y * p[z], self.shear.z * p[z]]
    }

    /// Where the line of the ray meets the triangle; none where it misses or lies in its plane.
    #[inline]
    pub(super) fn meet(&self, corners: &[DVec3; 3]) -> Option<Meeting> {
        let [a, b, c] = corners.map(|corner| self.sheared(corner));
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let sum = u + v + w;
        if sum == 0.0 {
            return None;
        }
        let weights = [u / sum, v / sum, w / sum];
        let distance = weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2];
        Some(Meeting { distance, weights })
    }
}
