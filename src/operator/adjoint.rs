use super::{LinearOperator, Vector};
use crate::Result;

/// How well an operator and its adjoint match.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdjointTest {
    /// max over channels of |⟨T x, y⟩ − ⟨x, Tᵀ y⟩| / (‖T x‖ ‖y‖); 0 for an operator that is zero, NaN when a product is.
    pub error: f64,
    /// The factor a with ⟨T x, y⟩ ≈ a ⟨x, Tᵀ y⟩: 1 when they match, another constant when one of them misses
    /// a factor, and nothing near a constant (see `scatter`) when they walk different elements.
    pub factor: f64,
    /// Largest deviation of that factor from its mean over trials and channels, relative to it.
    pub scatter: f64,
}

/// The dot-product test: ⟨T x, y⟩ against ⟨x, Tᵀ y⟩ for `trials` pairs of pseudo-random vectors.
///
/// Entries are uniform in [0, 1), so that the two products do not vanish by chance.
/// Cost: 2 applications a trial.
///
/// Errors: those of the operator and its vectors.
pub fn adjoint_test<T: LinearOperator>(operator: &T, trials: usize, seed: u64) -> Result<AdjointTest> {
    let mut numbers = SplitMix(seed);
    let (mut x, mut y) = (operator.domain(), operator.range());
    let (mut forward, mut backward) = (operator.range(), operator.domain());
    let (mut error, mut factors) = (0.0_f64, Vec::new());
    for _ in 0..trials.max(1) {
        x.set_from_host(&numbers.vector(x.len()))?;
        y.set_from_host(&numbers.vector(y.len()))?;
        operator.apply(&x, &mut forward)?;
        operator.apply_adjoint(&y, &mut backward)?;
        let (left, right) = (forward.dot(&y)?, x.dot(&backward)?);
        let (image, rows) = (forward.norm_squared()?, y.norm_squared()?);
        for c in 0..3 {
            let scale = (image[c] * rows[c]).sqrt();
            let difference = (left[c] - right[c]).abs();
            if difference.is_nan() {
                return Ok(AdjointTest { error: f64::NAN, factor: f64::NAN, scatter: f64::NAN });
            }
            // Zero against zero is a match, whatever the scale.
            if difference > 0.0 {
                error = error.max(difference / scale);
            }
            if right[c] != 0.0 {
                factors.push(left[c] / right[c]);
            }
        }
    }
    let mean = factors.iter().sum::<f64>() / factors.len().max(1) as f64;
    let spread = factors.iter().map(|factor| (factor - mean).abs()).fold(0.0, f64::max);
    let factor = if factors.is_empty() { 1.0 } else { mean };
    Ok(AdjointTest { error, factor, scatter: spread / factor.abs().max(f64::MIN_POSITIVE) })
}

/// SplitMix64 (Steele, Lea and Flood 2014): small, and the same numbers everywhere.
struct SplitMix(u64);

impl SplitMix {
    fn vector(&mut self, len: usize) -> Vec<[f64; 3]> {
        (0..len).map(|_| std::array::from_fn(|_| self.uniform())).collect()
    }

    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * f64::powi(2.0, -53)
    }
}
