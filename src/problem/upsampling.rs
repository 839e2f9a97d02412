//! Values of few pixels, for all pixels that are as deep.

/// Rays of about the same depth differ by this share of it at most.
const ALIKE: f64 = 0.1;
/// The part of its neighbours' weights that a pixel must keep, or its own ray is asked.
const KNOWN: f64 = 0.05;

/// Depths and values of the rays through the corners of squares of pixels.
pub(super) struct Coarse<const N: usize> {
    width: usize,
    samples: Vec<(f64, [f64; N])>,
}

impl<const N: usize> Coarse<N> {
    /// Row by row, of so many columns.
    pub(super) fn new(width: usize, samples: Vec<(f64, [f64; N])>) -> Self {
        Self { width, samples }
    }

    /// Bilinear between the four samples around a place, of those that are about as deep (Kopf et al. 2007); none where no such sample is near.
    pub(super) fn between(&self, at: [f64; 2], depth: f64) -> Option<[f64; N]> {
        let [x, y] = at.map(|at| at as usize);
        let [u, v] = at.map(f64::fract);
        let (mut sum, mut weights) = ([0.0; N], 0.0);
        for (i, j, weight) in
            [(0, 0, (1.0 - u) * (1.0 - v)), (1, 0, u * (1.0 - v)), (0, 1, (1.0 - u) * v), (1, 1, u * v)]
        {
            let (deep, value) = &self.samples[(y + j) * self.width + x + i];
            let apart = (deep - depth) / (ALIKE * depth.max(f64::MIN_POSITIVE));
            let weight = weight * (1.0 - apart * apart).max(0.0);
            sum.iter_mut().zip(value).for_each(|(sum, value)| *sum += weight * value);
            weights += weight;
        }
        (weights > KNOWN).then(|| sum.map(|sum| sum / weights))
    }
}
