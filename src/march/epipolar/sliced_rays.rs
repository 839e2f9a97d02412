//! What is put into slices, and how finely.

use super::super::ViewRay;
use super::edges::Spacing;
use crate::scene::Extent;
use crate::visibility::ShadowMap;

/// How finely rays are put into slices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EpipolarSettings {
    /// Slices a pixel of the picture's border; one is at most half a pixel away from any pixel.
    pub slices: f64,
    /// Samples a texel of the finer map, along a slice.
    pub density: f64,
    /// The most samples of a slice.
    pub samples: usize,
    /// Largest error of the expansion of transmittance.
    pub tolerance: f64,
    /// How samples are spread over a slice.
    pub spacing: Spacing,
    /// Whether a ray is between the two slices beside it, and not in the nearest one alone.
    pub between: bool,
}

impl EpipolarSettings {
    /// For rows that exact ones correct. Two slices a pixel, because texels that slices miss and exact rays meet are what corrections
    /// converge slowly in.
    pub const CORRECTED: Self = Self {
        slices: 2.0,
        density: 1.0,
        samples: 8192,
        tolerance: 1e-4,
        between: false,
        spacing: Spacing::Even,
    };
}

impl Default for EpipolarSettings {
    fn default() -> Self {
        Self {
            slices: 1.0,
            density: 1.0,
            samples: 1024,
            tolerance: 2e-7,
            between: false,
            spacing: Spacing::Even,
        }
    }
}

/// What is put into slices.
pub struct SlicedRays<'a> {
    /// Rays in the frame of the light, one a row.
    pub rays: &'a [ViewRay],
    /// Where nothing more is seen along a ray, in metres from the eye.
    pub reach: f64,
    /// The angle between the ray of a row and those of neighbouring pixels, in radians.
    pub angle: &'a (dyn Fn(usize) -> f64 + Sync),
    /// What is lit, along each ray.
    pub shadow_maps: Vec<&'a ShadowMap>,
    /// Which of them is that of a row.
    pub of_row: &'a (dyn Fn(usize) -> usize + Sync),
    /// Extinction a channel, in 1/metre.
    pub sigma_t: [f64; 3],
    /// The part of the light's plane over which light is sampled.
    pub region: Extent,
    /// The distance between texels of the finer map, in metres.
    pub pitch: f64,
}
