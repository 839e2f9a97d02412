//! Sums that do not depend on the order of their terms: integers of 64 bits in two words.
//!
//! Claim  No sum leaves 63 bits and a sign, in whatever order it is made.
//! Proof  Let R = Σ_k Σ_i w_ki over all rows (weights are not negative) and Y = max|y|. Any partial sum of any element i is
//!        at most Σ_k w_ki |y_k| ≤ R Y. `fixed_scale` takes the e with 2^e < 2^60 / (2^p 2^q), where 2^p ≤ R < 2^(p+1) and
//!        2^q ≤ Y < 2^(q+1), so 2^e R Y < 2^61. Rounding each term to an integer moves a sum by at most half the number
//!        of its terms, less than 2^60 of them, so every sum stays below 2^62. For squares w_ki² ≤ (Σ_i w_ki)², and R is
//!        the sum of those.
//! Error  Half of 2^−e a term: 2^−62 R Y, where f32 itself resolves 2^−24 of each product.
//!        Where R Y is below 2^−67 e is held at 126, and a term is off by 2^−127 at most.

use super::vector::GpuVector;
use crate::Result;
use crate::gpu::device::{Allocation, Gpu};
use crate::gpu::kernels::Kernel;
use crate::gpu::kernels::layout::FixedScaleParams;
use crate::operator::Vector;

/// Memory for sums in fixed point.
#[derive(Debug)]
pub(in crate::gpu) struct FixedSums {
    /// Low and high words.
    pub(in crate::gpu) words: [GpuVector; 2],
    /// 2^e and 2^−e a channel.
    pub(in crate::gpu) scales: Allocation,
    largest: Allocation,
}

impl FixedSums {
    /// For sums over the elements of `domain`, of terms from `range`.
    pub(in crate::gpu) fn new(gpu: &Gpu, domain: usize, range: &GpuVector) -> Result<Self> {
        Ok(Self {
            words: [GpuVector::zeros(gpu, domain), GpuVector::zeros(gpu, domain)],
            scales: gpu.try_allocate("scales", 8 * size_of::<f32>() as u64)?,
            largest: gpu.try_allocate("scales", (range.pieces() * size_of::<f32>()) as u64)?,
        })
    }

    /// Zero sums, at the scale for terms of `y` with rows that sum up to `row_sums`.
    pub(in crate::gpu) fn begin(&mut self, gpu: &Gpu, y: &GpuVector, row_sums: f64) {
        self.words.iter_mut().for_each(|words| words.fill([0.0; 3]));
        let (begin, pieces) = y.record_largest(&self.largest);
        // Rounded up.
        let scale = FixedScaleParams { begin, pieces, row_sums: [(row_sums * (1.0 + 1e-6)) as f32; 4] };
        let bindings = [self.scales.whole(), self.largest.whole()];
        gpu.dispatch(Kernel::FixedScale, &scale, &[&bindings], [1; 3]);
    }
}
