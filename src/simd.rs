//! Loops over lanes, compiled twice: for what every processor of a kind has, and for AVX2. Which one runs is seen at run time.
//!
//! Nothing is fused to one rounding, so both give the same bits.

use std::ops::{Add, Mul, Sub};

pub(crate) use pulp::Simd;
use pulp::{Arch, WithSimd};

/// Work whose loops gain from wide registers.
pub(crate) trait Kernel {
    type Output;

    /// Does the work. It has to be `#[inline(always)]`, with all that it calls in its loops: what is not inlined is compiled once.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

struct Anywhere<K>(K);

impl<K: Kernel> WithSimd for Anywhere<K> {
    type Output = K::Output;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> K::Output {
        self.0.run(simd)
    }
}

/// Runs a kernel in the widest registers that this processor has.
#[inline]
pub(crate) fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    Arch::new().dispatch(Anywhere(kernel))
}

/// Numbers that formulas can be written in: one, or one in each lane of a register.
pub(crate) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Mul<f64, Output = Self>
{
    /// A constant, in all lanes of which this has any.
    fn constant(self, value: f64) -> Self;

    /// The larger one in each lane.
    fn larger(self, other: Self) -> Self;
}

impl Number for f64 {
    #[inline(always)]
    fn constant(self, value: f64) -> f64 {
        value
    }

    /// One instruction, where `f64::max` also asks for NaN.
    #[inline(always)]
    fn larger(self, other: f64) -> f64 {
        if self > other { self } else { other }
    }
}

/// A register of numbers.
#[derive(Clone, Copy)]
pub(crate) struct Wide<S: Simd>(S, S::f64s);

impl<S: Simd> Wide<S> {
    /// Lanes of a register.
    pub(crate) const LANES: usize = S::F64_LANES;

    #[inline(always)]
    pub(crate) fn splat(simd: S, value: f64) -> Self {
        Self(simd, simd.splat_f64s(value))
    }

    /// The register number `number` of some numbers.
    #[inline(always)]
    pub(crate) fn of(simd: S, numbers: &[f64], number: usize) -> Self {
        Self(simd, S::as_simd_f64s(numbers).0[number])
    }

    #[inline(always)]
    pub(crate) fn store(self, numbers: &mut [f64], number: usize) {
        S::as_mut_simd_f64s(numbers).0[number] = self.1;
    }
}

impl<S: Simd> Number for Wide<S> {
    #[inline(always)]
    fn constant(self, value: f64) -> Self {
        Self::splat(self.0, value)
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        Self(self.0, self.0.max_f64s(self.1, other.1))
    }
}

impl<S: Simd> Add for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0, self.0.add_f64s(self.1, other.1))
    }
}

impl<S: Simd> Sub for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0, self.0.sub_f64s(self.1, other.1))
    }
}

impl<S: Simd> Mul for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0, self.0.mul_f64s(self.1, other.1))
    }
}

impl<S: Simd> Mul<f64> for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        self * self.constant(other)
    }
}
