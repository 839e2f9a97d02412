//! Which half-planes through the light and the eye are sampled for which rays.

use std::f64::consts::PI;

use rayon::prelude::*;

use super::super::ViewRay;

/// Ranges of the angle about the light in each of which slices are equally dense.
const BINS: usize = 2048;
/// Bands of sin θ, each from half of the one before.
const BANDS: u32 = 24;
/// The least angle between neighbouring pixels, in radians.
const LEAST_ANGLE: f64 = 1e-6;
/// Rays that one task looks at.
const AT_ONCE: usize = 1 << 14;

/// A view ray as it lies in the half-plane through it and the light.
///
/// With ξ the distance from the line of the light through the eye, and depth ζ along the light from the eye on, the ray is ζ = κ ξ, and
/// t = q ξ is the distance from the eye.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PolarRay {
    pub(super) row: u32,
    /// Angle about the light, in radians.
    pub(super) phi: f32,
    /// κ = cot θ.
    pub(super) kappa: f32,
    /// q = 1 / sin θ.
    pub(super) q: f32,
    /// ξ where the ray ends, in metres.
    pub(super) end: f32,
    /// Eye, shadow map and band of sin θ, as one number.
    pub(super) bundle: u32,
    /// How much of it a slice shows: less than 1 where it is between two.
    pub(super) share: f32,
}

impl PolarRay {
    /// `group` is the number of its eye and shadow map. None where nothing is seen along it.
    pub(super) fn new(row: usize, ray: &ViewRay, end: f64, group: u32) -> Option<Self> {
        if end <= 0.0 || ray.scattering == [0.0; 3] {
            return None;
        }
        let d = ray.direction;
        let sine = d.x.hypot(d.y).max(f64::exp2(-f64::from(BANDS)));
        // Both poles have bands of their own: there κ is large, of either sign.
        let band = (-sine.log2()) as u32 % BANDS;
        let pole = if d.z < 0.0 { 0 } else { BANDS };
        Some(Self {
            row: row as u32,
            phi: d.y.atan2(d.x) as f32,
            kappa: (d.z / sine) as f32,
            q: (1.0 / sine) as f32,
            end: (sine * end) as f32,
            bundle: group * 2 * BANDS + if band == 0 { 0 } else { band + pole },
            share: 1.0,
        })
    }

    /// The number of its eye and shadow map.
    pub(super) fn group(&self) -> usize {
        (self.bundle / (2 * BANDS)) as usize
    }

    fn bin(&self) -> (usize, f32) {
        let at = (0.5 + 0.5 * self.phi / PI as f32).clamp(0.0, 1.0) * BINS as f32;
        let bin = (at as usize).min(BINS - 1);
        (bin, at - bin as f32)
    }
}

/// Slices of all bundles: rays of one eye, under one shadow map, with sin θ in one octave.
///
/// A pixel is at most half a pixel away from its slice where there is one slice a pixel: neighbours across a slice are δ / sin θ apart in the
/// angle about the light, with δ the angle between their rays. Pinholes get slices through the border of the picture that way, and
/// so does any other lens. Rays near the light need fewer, and have bands of their own.
#[derive(Debug)]
pub(super) struct Slices {
    /// For each bundle and bin, the number of the slice with which it begins, and one more at the end.
    cumulated: Vec<f32>,
    /// Of each bundle the number of its first slice, and one more at the end.
    first: Vec<u32>,
}

impl Slices {
    /// `angle` is that between the ray of a row and its neighbours', in radians; there are `a_pixel` slices a pixel.
    pub(super) fn new(
        rays: &[PolarRay],
        groups: usize,
        angle: &(dyn Fn(usize) -> f64 + Sync),
        a_pixel: f64,
    ) -> Self {
        let bundles = groups * 2 * BANDS as usize;
        let pieces = rays.len().div_ceil(rayon::current_num_threads()).max(AT_ONCE);
        let dense = |rays: &[PolarRay]| {
            let mut density = vec![0.0_f32; bundles * BINS];
            for ray in rays {
                let place = &mut density[ray.bundle as usize * BINS + ray.bin().0];
                *place = place.max(1.0 / (ray.q * angle(ray.row as usize).max(LEAST_ANGLE) as f32));
            }
            density
        };
        let denser = |a: Vec<f32>, b: Vec<f32>| a.iter().zip(&b).map(|(a, b)| a.max(*b)).collect();
        let densities = rays.par_chunks(pieces).map(dense).reduce_with(denser).unwrap_or_default();
        let (mut cumulated, mut first) = (Vec::with_capacity(bundles * (BINS + 1)), vec![0]);
        let width = 2.0 * PI / BINS as f64 * a_pixel;
        for density in densities.chunks_exact(BINS) {
            let mut sum = 0.0_f64;
            cumulated.push(0.0);
            for density in spread(density, width) {
                // A slice ends where there are no rays, so that none has rays of two places.
                sum = if density > 0.0 { sum + f64::from(density) * width } else { sum.ceil() };
                cumulated.push(sum as f32);
            }
            first.push(first[first.len() - 1] + sum.ceil() as u32);
        }
        Self { cumulated, first }
    }

    /// The number of slices.
    pub(super) fn count(&self) -> usize {
        self.first[self.first.len() - 1] as usize
    }

    /// The slice of a ray.
    pub(super) fn of(&self, ray: &PolarRay) -> usize {
        let (bin, within) = ray.bin();
        let bundle = ray.bundle as usize;
        let ends = &self.cumulated[bundle * (BINS + 1) + bin..][..2];
        let slice = (ends[0] + within * (ends[1] - ends[0])) as u32;
        let [first, next] = [self.first[bundle], self.first[bundle + 1]];
        (first + slice).min(next - 1) as usize
    }

    /// The slice on the other side of a ray, and how near the ray is to that one, from 0 to a half or so. None where no slice follows, or its
    /// rays are not next to those of the first. `middles` are the angles of all slices, NaN where one has no rays.
    pub(super) fn beside(&self, ray: &PolarRay, slice: u32, middles: &[f32]) -> Option<(u32, f32)> {
        let (bundle, middle) = (ray.bundle as usize, middles[slice as usize]);
        let [first, next] = [self.first[bundle], self.first[bundle + 1]];
        let other = if ray.phi > middle { slice + 1 } else { slice.checked_sub(1)? };
        let apart = middles.get(other as usize)? - middle;
        let (bin, _) = ray.bin();
        let ends = &self.cumulated[bundle * (BINS + 1) + bin..][..2];
        let width = 2.0 * PI as f32 / BINS as f32 / (ends[1] - ends[0]);
        let is_next = (first..next).contains(&other) && apart.abs() < 2.0 * width;
        // Not `<= 0`: a slice without rays is nowhere.
        let share = (ray.phi - middle) / apart;
        (is_next && share > 0.0).then_some((other, share.min(1.0)))
    }
}

/// The density of each bin, as far as a slice of it reaches: so a slice that begins in another bin is no wider there.
fn spread(density: &[f32], width: f64) -> Vec<f32> {
    let mut spread = vec![0.0_f32; BINS];
    for (bin, &density) in density.iter().enumerate().filter(|(_, density)| **density > 0.0) {
        let reach = ((f64::from(density) * width).recip().ceil() as usize).min(BINS);
        let near = bin.saturating_sub(reach)..(bin + reach + 1).min(BINS);
        spread[near].iter_mut().for_each(|near| *near = near.max(density));
    }
    spread
}
