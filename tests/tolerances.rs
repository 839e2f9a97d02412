//! The tolerances of the tests, each with its reason.
#![allow(dead_code, unused_imports, reason = "each binary of tests takes what it needs")]

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

/// How radiance changes with extinction against differences of third order over steps of 1/64 of the radiance itself, both with
/// four nodes for every half of optical depth: what the steps leave is 1e-6, cubic cells in which a property has a kink a few times
/// that.
pub const REFINEMENT_SLOPE: f64 = 5e-5;

/// Weights of volumes where the medium is constant in each cell, and lengths, as a part of a row's sum: some dozens of pieces
/// whose ends are rounded in f64.
pub const VOLUME_CONSTANT: f64 = 1e-11;

/// The same where density and basis are cubic along a ray: four nodes for half an optical depth, whose error is below 5e-6
/// for densities that jump from voxel to voxel.
pub const VOLUME_CUBIC: f64 = 1e-5;

/// What arrives at voxels is kept in f32, and its interpolation is computed in f32.
pub const VOLUME_LIGHT: f64 = 1e-6;

/// Pictures of a medium that was found in pictures of another, which are rounded to f32.
pub const VOLUME_PICTURES: f64 = 1e-3;

/// How much farther a volume may be from the truth than what the pseudo-inverse finds: iterations end at a part of 1e-6 of
/// the normal residual, and the directions that pictures hardly tell come last.
pub const VOLUME_FOUND: f64 = 2e-2;

/// Diffused values of about 1: rounded to f32 after a solve in f64, and a Laplacian adds up seven of them.
pub const DIFFUSED: f64 = 1e-6;

/// Our own error in pictures of single scattering, as a part of each pixel: 64 directions for a sky, light that is trilinear
/// between the centres of 72³ voxels. It is added to the standard error of the reference.
pub const MITSUBA_BIAS: f64 = 1e-3;

/// The same where a voxel is an optical depth of 1.5 thick, in which light is less like a trilinear function.
pub const MITSUBA_BIAS_THICK: f64 = 3e-3;

/// Root mean square deviation of the pixels in those errors: 1 were they independent and of just this size. The sun's is the
/// largest, 1.15, for its shadows have edges inside voxels.
pub const MITSUBA_RMS: f64 = 1.25;

/// The largest deviation of 7000 pixels in those errors: normal deviates pass 4.5 once in 20 pictures.
pub const MITSUBA_LARGEST: f64 = 4.5;

/// Pixels in which every sample of the reference was the same: they see hardly any matter.
pub const MITSUBA_EMPTY: f64 = 2e-5;

/// Rows of a light map and its surroundings against pictures: both are sums of some f32 numbers in another order.
pub const SURROUNDINGS_PICTURE: f64 = 1e-5;

/// Weights of the surroundings against points that look for the light by rays of their own: shadow maps of 512 texels have edges that
/// are off by half a texel of some centimetres, along rays of some metres.
pub const SURROUNDINGS_TRACED: f64 = 1e-2;

/// Pictures of a light map and its surroundings that were found in pictures of others.
pub const SURROUNDINGS_FOUND: f64 = 1e-2;

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

/// Pictures of panes against an integral of 400,000 steps, relative.
pub const GLASS_BRUTE_FORCE: f64 = 1e-5;

/// The sum of a picture of panes against Mitsuba's: light loses 0.15 % on its way through the fog, which we leave out, and theirs has
/// a standard error of 0.1 %.
pub const GLASS_MITSUBA_BIAS: f64 = 5e-3;

/// Root mean square deviation of its pixels in standard errors: 1 were they of just this size, which 16 batches tell to a fifth.
pub const GLASS_MITSUBA_RMS: f64 = 1.25;

/// The largest deviation of 1700 values in standard errors that are known from 16 batches (Student's t of 15 degrees of freedom).
pub const GLASS_MITSUBA_LARGEST: f64 = 7.0;
