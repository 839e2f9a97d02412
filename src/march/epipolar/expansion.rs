//! Transmittance along the rays of a fan as a sum of few products.

use std::f64::consts::PI;

/// The most terms of an expansion.
const MOST_TERMS: usize = 12;

/// `e^{−σ q ξ}` for q of a range as `Σ_m a_m(q) e^{−σ q_m ξ}`: the polynomial in q through the values at Chebyshev's nodes q_m.
///
/// The a_m are the same for all σ, so one expansion serves all channels.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Expansion {
    nodes: Vec<f64>,
    /// Of the barycentric formula.
    weights: Vec<f64>,
}

impl Expansion {
    /// With as few terms as keep the error below `tolerance`, for q in [least, most] and optical depths σ ξ up to `depth`; with
    /// [`MOST_TERMS`] where these are not enough.
    pub(super) fn new([least, most]: [f64; 2], depth: f64, tolerance: f64) -> Self {
        let enough = |terms: &usize| error_bound([least, most], depth, *terms) <= tolerance;
        let terms = (1..MOST_TERMS).find(enough).unwrap_or(MOST_TERMS);
        let angle = |m: usize| PI * (2 * m + 1) as f64 / (2 * terms) as f64;
        let node = |m: usize| 0.5 * (least + most) + 0.5 * (most - least) * angle(m).cos();
        let weight = |m: usize| if m.is_multiple_of(2) { angle(m).sin() } else { -angle(m).sin() };
        Self { nodes: (0..terms).map(node).collect(), weights: (0..terms).map(weight).collect() }
    }

    /// The q_m.
    pub(super) fn nodes(&self) -> &[f64] {
        &self.nodes
    }

    /// The number of terms.
    pub(super) fn terms(&self) -> usize {
        self.nodes.len()
    }

    /// Gives `take` the a_m(q) in their order.
    pub(super) fn coefficients(&self, q: f64, mut take: impl FnMut(f64)) {
        if let Some(exact) = self.nodes.iter().position(|node| *node == q) {
            return (0..self.terms()).for_each(|m| take(if m == exact { 1.0 } else { 0.0 }));
        }
        let term = |m: usize| self.weights[m] / (q - self.nodes[m]);
        let sum: f64 = (0..self.terms()).map(term).sum();
        (0..self.terms()).for_each(|m| take(term(m) / sum));
    }
}

/// A bound on the error of such an expansion.
///
/// With h half the length of the interval, m its middle and s = σ ξ, `e^{−s q}` has the Chebyshev coefficients `2 I_k(s h) e^{−s m}`, and a
/// polynomial through M nodes is off by at most twice the sum of those from the M-th on; `I_M(z) ≤ (z/2)^M / M! e^{z²/4(M+1)}`. That is
/// largest where its logarithm is level in s.
fn error_bound([least, most]: [f64; 2], depth: f64, terms: usize) -> f64 {
    let (h, middle, count) = (0.5 * (most - least), 0.5 * (most + least), terms as f64);
    let curve = h * h / (2.0 * (count + 1.0));
    let root = (middle * middle - 4.0 * curve * count).max(0.0).sqrt();
    let s = depth.min(2.0 * count / (middle + root));
    let powers: f64 = (1..=terms).map(|m| 0.5 * s * h / m as f64).product();
    4.0 * powers * (0.5 * curve * s * s - s * middle).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn largest_error(range: [f64; 2], depth: f64, tolerance: f64) -> (f64, usize) {
        let expansion = Expansion::new(range, depth, tolerance);
        let mut largest = 0.0_f64;
        for (i, j) in (0..=200).flat_map(|i| (0..=200).map(move |j| (i, j))) {
            let q = range[0] + (range[1] - range[0]) * f64::from(i) / 200.0;
            let s = depth * f64::from(j) / 200.0;
            let (mut sum, mut m) = (0.0, 0);
            expansion.coefficients(q, |a| {
                sum += a * (-s * expansion.nodes()[m]).exp();
                m += 1;
            });
            largest = largest.max((sum - (-s * q).exp()).abs());
        }
        (largest, expansion.terms())
    }

    /// Near the light and far from it, in thin and thick media; a term less would not do.
    #[test]
    fn transmittance_is_expanded_to_the_tolerance() {
        for range in [[1.0, 1.0], [1.0, 1.02], [1.0, 1.42], [1.0, 2.0], [4.0, 8.0], [3000.0, 4100.0]] {
            for depth in [1e-3, 0.5, 8.0, 17.0] {
                for tolerance in [1e-4, 1e-6] {
                    let (error, terms) = largest_error(range, depth / range[0], tolerance);
                    assert!(error <= tolerance, "{range:?}, depth {depth}: {error:.1e} of {terms}");
                    assert!(terms <= 10, "{range:?}, depth {depth}: {terms} terms");
                }
            }
        }
        let (error, terms) = largest_error([1.0, 2.0], 8.0, 1e-4);
        assert!((4..=6).contains(&terms) && error > 1e-6, "{terms} terms, {error:.1e}");
    }
}
