//! The tolerances of the tests, each with its reason.

/// `T x` in f32 against the explicit matrix in f64: weights and results are rounded to 24 bits, and a texel's
/// sum of a few hundred terms loses up to a few more.
pub const AGAINST_EXPLICIT: f64 = 1e-5;

/// |⟨T x, y⟩ − ⟨x, Tᵀ y⟩| / ‖T x‖ ‖y‖ where sums are f32: the rounding of each side, averaged over the rows.
pub const ADJOINT_F32: f64 = 1e-6;

/// The same where everything is f64.
pub const ADJOINT_F64: f64 = 1e-13;

/// Two ways to the same light map, relative to its brightest texel: products in f32 that round differently,
/// over a few iterations.
pub const SAME_SOLUTION: f64 = 1e-5;

/// The objective against SciPy's, both solved as far as f64 goes.
pub const SCIPY_OBJECTIVE: f64 = 1e-5;

/// x against SciPy's where the data determine it, relative to its largest element.
pub const SCIPY_X: f64 = 1e-4;

#[cfg(feature = "gpu")]
pub use device::*;

/// What devices may differ by.
#[cfg(feature = "gpu")]
mod device {
    /// One operation on elements in f32 on a device: it may round, contract and divide (2.5 units) otherwise than the host.
    pub const DEVICE_ELEMENT: f64 = 4e-7;

    /// A sum on a device, relative to the sum of its terms' magnitudes: some of its thirteen roundings in f32 a piece.
    pub const DEVICE_SUM: f64 = 2e-7;

    /// The share of pixels that a depth pass may see otherwise than rays do: those along silhouettes, where a rasterizer has
    /// moved a corner to its grid of 1/256 pixel.
    pub const SILHOUETTES: f64 = 2e-3;

    /// One symmetric sweep over tiles of 64: each of its 128 steps rounds a few times, in another order than the host.
    pub const DEVICE_TILES: f64 = 1e-5;

    /// A light map that a device has solved for against the processor's, in the 2-norm: a few dozen iterations on
    /// products that differ by roundings.
    pub const DEVICE_LIGHT_MAP: f64 = 1e-3;

    /// The objective of the same; near its least value it is second order in the light map.
    pub const DEVICE_OBJECTIVE: f64 = 1e-5;
}
