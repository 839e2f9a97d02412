//! Loops over lanes, compiled twice: for what every processor of a kind has, and for AVX2. Which one runs is seen at run time.
//!
//! Nothing is fused to one rounding, so both give the same bits.

use pulp::{Arch, Simd, WithSimd};

/// Work whose loops gain from wide registers.
pub(crate) trait Kernel {
    type Output;

    /// Does the work. It has to be `#[inline(always)]`, with all that it calls in its loops: what is not inlined is compiled once.
    fn run(self) -> Self::Output;
}

struct Anywhere<K>(K);

impl<K: Kernel> WithSimd for Anywhere<K> {
    type Output = K::Output;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> K::Output {
        self.0.run()
    }
}

/// Runs a kernel in the widest registers that this processor has.
#[inline]
pub(crate) fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    Arch::new().dispatch(Anywhere(kernel))
}
