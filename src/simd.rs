//! Loops over lanes, compiled twice: for what every processor of a kind has, and for AVX2. Which one runs is seen at run time.
//!
//! Nothing is fused to one rounding, so both give the same bits.

use std::ops::{Add, Div, Mul, Sub};

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

/// What the widest registers of this processor are called, of those that loops over lanes use.
pub(crate) fn instructions() -> &'static str {
    struct Lanes;
    impl Kernel for Lanes {
        type Output = usize;

        fn run<S: Simd>(self, _simd: S) -> usize {
            S::F64_LANES
        }
    }
    match (std::env::consts::ARCH, dispatch(Lanes)) {
        ("x86_64", 1) => "SSE2",
        ("x86_64", 4) => "AVX2",
        ("x86_64", _) => "AVX-512",
        ("aarch64", 2) => "NEON",
        (arch, _) => arch,
    }
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

/// A register of numbers: its type, and the operations of `Simd` that it is made of.
macro_rules! register {
    ($(#[$words:meta])* $name:ident, $number:ty, $lanes:ident, $register:ident, $splat:ident, $of:ident, $of_mut:ident, $add:ident, $sub:ident, $mul:ident, $max:ident) => {
        $(#[$words])*
        #[derive(Clone, Copy)]
        pub(crate) struct $name<S: Simd>(S, S::$register);

        impl<S: Simd> $name<S> {
            /// Lanes of a register.
            pub(crate) const LANES: usize = S::$lanes;

            #[inline(always)]
            pub(crate) fn splat(simd: S, value: $number) -> Self {
                Self(simd, simd.$splat(value))
            }

            /// The register number `number` of some numbers.
            #[inline(always)]
            pub(crate) fn of(simd: S, numbers: &[$number], number: usize) -> Self {
                Self(simd, S::$of(numbers).0[number])
            }

            #[inline(always)]
            pub(crate) fn store(self, numbers: &mut [$number], number: usize) {
                S::$of_mut(numbers).0[number] = self.1;
            }
        }

        impl<S: Simd> Number for $name<S> {
            #[inline(always)]
            fn constant(self, value: f64) -> Self {
                Self::splat(self.0, value as $number)
            }

            #[inline(always)]
            fn larger(self, other: Self) -> Self {
                Self(self.0, self.0.$max(self.1, other.1))
            }
        }

        impl<S: Simd> Add for $name<S> {
            type Output = Self;

            #[inline(always)]
            fn add(self, other: Self) -> Self {
                Self(self.0, self.0.$add(self.1, other.1))
            }
        }

        impl<S: Simd> Sub for $name<S> {
            type Output = Self;

            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                Self(self.0, self.0.$sub(self.1, other.1))
            }
        }

        impl<S: Simd> Mul for $name<S> {
            type Output = Self;

            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                Self(self.0, self.0.$mul(self.1, other.1))
            }
        }

        impl<S: Simd> Mul<f64> for $name<S> {
            type Output = Self;

            #[inline(always)]
            fn mul(self, other: f64) -> Self {
                self * self.constant(other)
            }
        }
    };
}

register!(
    /// A register of numbers of double precision.
    Wide, f64, F64_LANES, f64s, splat_f64s, as_simd_f64s, as_mut_simd_f64s, add_f64s, sub_f64s, mul_f64s, max_f64s
);
register!(
    /// A register of numbers of single precision.
    Single, f32, F32_LANES, f32s, splat_f32s, as_simd_f32s, as_mut_simd_f32s, add_f32s, sub_f32s, mul_f32s, max_f32s
);

impl<S: Simd> Wide<S> {
    /// The smaller one in each lane.
    #[inline(always)]
    pub(crate) fn smaller(self, other: Self) -> Self {
        Self(self.0, self.0.min_f64s(self.1, other.1))
    }
}

impl<S: Simd> Div for Single<S> {
    type Output = Self;

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(self.0, self.0.div_f32s(self.1, other.1))
    }
}
