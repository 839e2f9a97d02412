//! Occlusion as far as a picture shows it.

use glam::DVec3;
use rayon::prelude::*;

use super::buffer::GeometryBuffer;
use super::openness::{Openness, Way};
use super::pattern::Pattern;
use crate::scene::SurfaceLight;

/// What is seen must be nearer than a place by this share of its distance to hide it.
const BIAS: f64 = 1e-3;

/// How open each pixel's surface is, each from its own set of directions; whole where there is none.
///
/// Source  Klehm 2015, listing 3.1
/// Cost    `samples` × `steps` projections a pixel
pub(super) fn openness(buffer: &GeometryBuffer, light: &SurfaceLight, radius: f64) -> Vec<Openness> {
    let pattern = Pattern::new(light.pattern, light.samples, light.weighting);
    let width = buffer.width();
    let of_pixel = |index: usize| {
        let Some(surface) = buffer.at(index) else { return Openness::WHOLE };
        let set = pattern.of_pixel(index % width, index / width);
        let march = March { buffer, radius, steps: light.steps, offset: set.offset };
        let point = buffer.point(surface);
        Openness::of(&set.directions, surface.normal.as_dvec3(), |direction| march.along(point, direction))
    };
    (0..buffer.len()).into_par_iter().map(of_pixel).collect()
}

/// Places along a direction that are compared with what the picture shows.
struct March<'b> {
    buffer: &'b GeometryBuffer<'b>,
    radius: f64,
    steps: usize,
    offset: f64,
}

impl March<'_> {
    /// Places lie denser near the surface, where what is small hides much.
    ///
    /// A surface that is nearer to the eye than the place by more than the radius is an outlier: what is behind it is not known.
    fn along(&self, point: DVec3, direction: DVec3) -> Way {
        let eye = self.buffer.camera.position();
        let mut way = Way::Open;
        for step in 0..self.steps {
            let share = (step as f64 + self.offset) / self.steps as f64;
            let place = point + direction * (self.radius * share * share);
            let Some(seen) = self.buffer.seen_towards(place) else { continue };
            let distance = place.distance(eye);
            if seen >= distance * (1.0 - BIAS) {
                continue;
            }
            if distance - seen <= self.radius {
                return Way::Hidden;
            }
            way = Way::Unknown;
        }
        way
    }
}
