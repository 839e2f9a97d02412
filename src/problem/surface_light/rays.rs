//! The reference: rays through the hierarchy of triangles.

use glam::DVec3;
use rayon::prelude::*;

use super::buffer::{GeometryBuffer, Surface};
use super::openness::{Openness, Way, frame};
use super::pattern::hemisphere;
use crate::scene::{Environment, Ray, Rgb, SurfaceLight, Weighting};
use crate::visibility::Geometry;

/// Steps of the lattice of points of which each pixel has its own: the generalized golden ratio's (Roberts 2018).
const LATTICE: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];

/// Rays from surfaces.
pub(super) struct Rays<'r> {
    pub(super) buffer: &'r GeometryBuffer<'r>,
    pub(super) geometry: &'r Geometry,
    /// How far they go, in metres.
    pub(super) limit: f64,
}

impl Rays<'_> {
    /// What arrives at each pixel's surface: the mean over directions that are as dense as their cosines, of the light that panes let through. Each pixel has its own
    /// directions.
    ///
    /// Cost    `samples` rays a pixel
    pub(super) fn arriving(&self, environment: &Environment, samples: usize) -> Vec<Rgb> {
        let of_pixel = |index: usize| {
            let Some(surface) = self.buffer.at(index) else { return [0.0; 3] };
            let (frame, origin) = (frame(surface.normal.as_dvec3()), self.origin(surface));
            let mut sum = [0.0; 3];
            for local in self.directions(index, samples, Weighting::Cosine) {
                let direction = frame * local;
                let passes = self.geometry.transmittance(&Ray { origin, direction }, self.limit);
                if passes != [0.0; 3] {
                    let radiance = environment.radiance(direction);
                    (0..3).for_each(|c| sum[c] += f64::from(passes[c] * radiance[c]));
                }
            }
            sum.map(|sum| (sum / samples as f64) as f32)
        };
        (0..self.buffer.len()).into_par_iter().map(of_pixel).collect()
    }

    /// How open each pixel's surface is to solid surfaces; whole where there is none.
    pub(super) fn openness(&self, light: &SurfaceLight) -> Vec<Openness> {
        let of_pixel = |index: usize| {
            let Some(surface) = self.buffer.at(index) else { return Openness::WHOLE };
            let origin = self.origin(surface);
            let directions = self.directions(index, light.samples, light.weighting);
            Openness::of(&directions, surface.normal.as_dvec3(), |direction| {
                match self.geometry.blocks(&Ray { origin, direction }, self.limit) {
                    true => Way::Hidden,
                    false => Way::Open,
                }
            })
        };
        (0..self.buffer.len()).into_par_iter().map(of_pixel).collect()
    }

    /// Off the surface as far as rays towards other lights are.
    fn origin(&self, surface: &Surface) -> DVec3 {
        self.buffer.point(surface) + surface.normal.as_dvec3() * (1e-4 * f64::from(surface.distance))
    }

    fn directions(&self, index: usize, samples: usize, weighting: Weighting) -> Vec<DVec3> {
        let width = self.buffer.width();
        let [x, y] = [index % width, index / width].map(|at| at as f64);
        let [a, b] = LATTICE;
        hemisphere(samples, weighting, [(a * x + b * y).fract(), (b * x + a * a * b * y + 0.5).fract()])
    }
}
