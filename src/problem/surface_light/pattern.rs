//! Directions of a hemisphere, others for each pixel of a small square.

use std::f64::consts::TAU;

use glam::DVec3;

use crate::scene::Weighting;

/// The golden ratio less one: the turn from one direction to the next.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Directions of a hemisphere around +Z, and where along them places are looked up.
#[derive(Debug, Clone)]
pub(super) struct DirectionSet {
    pub(super) directions: Vec<DVec3>,
    /// Where the places along them lie between those before and behind, from 0 to 1.
    pub(super) offset: f64,
}

/// The sets of the m × m pixels of a square.
#[derive(Debug)]
pub(super) struct Pattern {
    side: usize,
    sets: Vec<DirectionSet>,
}

impl Pattern {
    /// Sets of so many directions, which together are spread as evenly as each.
    pub(super) fn new(side: usize, samples: usize, weighting: Weighting) -> Self {
        let count = side * side;
        let set = |index: usize| {
            let turn = (index as f64 + 0.5) / count as f64;
            let shift = radical_inverse(index, 2) + 0.5 / count as f64;
            let offset = radical_inverse(index, 3) + 0.5 / count as f64;
            DirectionSet {
                directions: hemisphere(samples, weighting, [turn, shift.fract()]),
                offset: offset.fract(),
            }
        };
        Self { side, sets: (0..count).map(set).collect() }
    }

    pub(super) fn of_pixel(&self, x: usize, y: usize) -> &DirectionSet {
        &self.sets[y % self.side * self.side + x % self.side]
    }
}

/// So many directions around +Z, as dense as their weights: a spiral that begins turned by a part of a whole turn, and moved by a part of a step.
pub(super) fn hemisphere(samples: usize, weighting: Weighting, [turn, shift]: [f64; 2]) -> Vec<DVec3> {
    let direction = |k: usize| {
        let u = (k as f64 + shift) / samples as f64;
        let z = match weighting {
            Weighting::Cosine => (1.0 - u).sqrt(),
            Weighting::Uniform => 1.0 - u,
        };
        let (sin, cos) = (TAU * (k as f64 * GOLDEN + turn)).sin_cos();
        let radius = (1.0 - z * z).sqrt();
        DVec3::new(radius * cos, radius * sin, z)
    };
    (0..samples).map(direction).collect()
}

/// The digits of a number mirrored at the point (van der Corput).
fn radical_inverse(mut index: usize, base: usize) -> f64 {
    let (mut value, mut place) = (0.0, 1.0);
    while index > 0 {
        place /= base as f64;
        value += (index % base) as f64 * place;
        index /= base;
    }
    value
}
