//! The properties of view rays that transfer functions are over.

use std::f64::consts::PI;

use crate::march::{ViewRay, lit_stretches};
use crate::problem::sight::seen_distances;
use crate::scene::{LightFrame, Ray, Scene, TransferAxis, TransferPlace};
use crate::visibility::{Geometry, ShadowMap};

/// The share of the surfaces that views see that are nearer than the far end.
const NEARER: f64 = 0.95;
/// Pixels from one sampled ray of a view to the next, along both axes.
const PIXEL_STRIDE: usize = 8;
/// Transmittance at which a medium without surfaces ends.
const FADED: f64 = 0.05;

/// Properties of a ray in the frame of the light, each from 0 to 1, exact: up to the first surface, or to `far` metres where there is none.
pub(super) fn properties(
    ray: &ViewRay,
    shadow_map: &ShadowMap,
    axes: [TransferAxis; 2],
    far: f64,
) -> [f64; 2] {
    let end = if ray.length.is_finite() { ray.length } else { far };
    let needs_light =
        axes.iter().any(|axis| matches!(axis, TransferAxis::Visibility | TransferAxis::Position));
    let (mut lit, mut moment) = (0.0, 0.0);
    if needs_light {
        for [from, to] in lit_stretches(ray, shadow_map, end) {
            lit += to - from;
            moment += 0.5 * (to - from) * (to + from);
        }
    }
    axes.map(|axis| match axis {
        TransferAxis::Visibility if end > 0.0 => (lit / end).clamp(0.0, 1.0),
        TransferAxis::Visibility => 1.0,
        TransferAxis::Depth => (end / far).min(1.0),
        TransferAxis::Position if lit > 0.0 => (moment / (lit * end)).clamp(0.0, 1.0),
        TransferAxis::Position => 0.0,
        // The light travels along the third axis, and comes from the other side.
        TransferAxis::Angle => (-ray.direction.z).clamp(-1.0, 1.0).acos() / PI,
    })
}

/// What places are for a function: the properties of the rays that views see there.
pub(super) struct SeenAxes<'a> {
    pub(super) scene: &'a Scene,
    pub(super) geometry: &'a Geometry,
    pub(super) frame: &'a LightFrame,
    pub(super) shadow_map: &'a ShadowMap,
    pub(super) axes: [TransferAxis; 2],
    pub(super) far: f64,
}

impl SeenAxes<'_> {
    pub(super) fn of(&self, place: TransferPlace) -> [f64; 2] {
        match place {
            TransferPlace::Axes(axes) => axes,
            TransferPlace::Pixel { view, at: [x, y] } => {
                let camera = &self.scene.views[view].camera;
                let [width, height] = camera.size().map(|side| side as f64);
                let ray = camera.ray(x * width, y * height);
                let hit = self.geometry.first_hit(&ray, f64::INFINITY);
                self.along(&ray, hit.map_or(f64::INFINITY, |hit| hit.distance))
            }
            TransferPlace::Point { view, point } => {
                let origin = self.scene.views[view].camera.position();
                let ray = Ray { origin, direction: (point - origin).normalize_or(glam::DVec3::Z) };
                self.along(&ray, origin.distance(point))
            }
        }
    }

    fn along(&self, ray: &Ray, length: f64) -> [f64; 2] {
        let ray = ViewRay::new(ray, length, self.frame, &self.scene.medium);
        properties(&ray, self.shadow_map, self.axes, self.far)
    }
}

/// How far the views of scenes see, in metres: most of the surfaces that they see are nearer. Where they see none it is how far light comes
/// through the medium.
pub(in crate::problem) fn seen_far<'s>(
    scenes: impl IntoIterator<Item = &'s Scene> + Clone,
    geometry: &Geometry,
) -> f64 {
    let views = scenes.clone().into_iter().flat_map(|scene| &scene.views);
    let mut distances: Vec<f64> =
        views.flat_map(|view| seen_distances(view, geometry, PIXEL_STRIDE).0).collect();
    distances.sort_by(f64::total_cmp);
    let most = distances.get((NEARER * distances.len() as f64) as usize).copied();
    let through = |scene: &Scene| scene.medium.reach(FADED);
    most.filter(|&far| far > 0.0)
        .unwrap_or_else(|| scenes.into_iter().map(through).fold(f64::MIN_POSITIVE, f64::max))
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use super::*;
    use crate::scene::{Extent, Grid};

    #[test]
    fn properties_are_those_of_a_million_midpoints() {
        let extent = Extent { min: DVec2::splat(-5.0), max: DVec2::splat(5.0) };
        let grid = Grid::new(extent, [64, 64]).unwrap();
        let depth = |k: usize| if k * 7919 % 5 < 2 { f32::INFINITY } else { (k * 31 % 17) as f32 * 0.4 };
        let map = ShadowMap::new(grid, 0.0, &(0..64 * 64).map(depth).collect::<Vec<_>>()).unwrap();
        let rays = [
            (DVec3::new(-6.0, -3.1, 1.0), DVec3::new(1.0, 0.47, 0.3), 14.0),
            (DVec3::new(0.3, 0.2, 5.0), DVec3::new(0.2, -0.5, -0.4), f64::INFINITY),
            (DVec3::new(1.0, 1.0, -2.0), DVec3::Z, 9.0),
        ];
        let far = 12.0;
        for (origin, direction, length) in rays {
            let direction = direction.normalize();
            let ray = ViewRay { origin, direction, length, scattering: [1.0; 3] };
            let [visibility, depth] =
                properties(&ray, &map, [TransferAxis::Visibility, TransferAxis::Depth], far);
            let [position, angle] =
                properties(&ray, &map, [TransferAxis::Position, TransferAxis::Angle], far);
            let end = f64::min(length, if length.is_finite() { length } else { far });
            let count = 1_000_000;
            let middle = |k: i32| origin + direction * (end * (f64::from(k) + 0.5) / f64::from(count));
            let lit: Vec<i32> = (0..count).filter(|&k| map.is_lit(middle(k))).collect();
            let places = lit.iter().map(|&k| (f64::from(k) + 0.5) / f64::from(count));
            let mean = places.sum::<f64>() / lit.len() as f64;
            let lit = lit.len() as f64 / f64::from(count);
            assert!(lit > 0.05, "{lit}");
            // A midpoint is wrong next to each of a hundred edges at most.
            assert!((visibility - lit).abs() < 1e-4, "{visibility}, not {lit}");
            assert!((position - mean).abs() < 1e-4, "{position}, not {mean}");
            assert_eq!(depth, (end / far).min(1.0));
            let towards_light = direction.dot(-DVec3::Z);
            assert!((angle * PI - towards_light.acos()).abs() < 1e-12);
        }
    }
}
