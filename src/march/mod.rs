//! The traversals: one view ray becomes pairs (element, weight), the non-zeros of its row of `T`.
//!
//! Forward rendering, back-projection, the explicit matrix and the preconditioner are consumers of the
//! same walk, so they agree by construction.

mod basis;
mod epipolar;
mod exponential;
mod further_weights;
mod heterogeneity;
mod light_map;
mod lit;
mod row_order;
mod table;
mod texels;
mod view_ray;
mod visibility;
mod volume;

use rayon::prelude::*;

pub use epipolar::{
    Edges, EpipolarSettings, EpipolarTraversal, Fan, FanRay, Fans, MOST_COEFFICIENTS, MOST_SAMPLES,
    MinMaxTree, Prefilter, PrefilterLookup, PrefilterWeighting, Prefiltered, SlicedRays, Spacing, harmonics,
};
pub use exponential::{SERIES_0, SERIES_2};
pub use further_weights::{FurtherWeights, Reflected};
pub use heterogeneity::{AirGrid, HeterogeneityField, MOST_INTENSITY, NoiseVolume};
pub use light_map::{LightMapTransport, LightMapTraversal, LitRay, RowExtent, RowSuns};
pub use lit::{LitStretch, SeenPane, SeenPanes, lit_stretches, weight_between};
pub use table::{Lookup, TableTraversal};
pub use view_ray::ViewRay;
#[cfg(feature = "gpu")]
pub(crate) use volume::{CellRay, Line};
pub use volume::{
    Density, InScattering, LinearizedTraversal, LitVolume, PixelRays, Quantity, Refraction, SourceFunction,
    VolumeTransport, VolumeTraversal, VoxelElements,
};
pub use volume::{GAUSS_2, GAUSS_4, MOST_PANELS, PANEL};

/// The floating-point types that traversals and operators compute in.
pub trait Real:
    num_traits::Float + Default + Send + Sync + std::fmt::Debug + std::ops::AddAssign + 'static
{
    /// Whether it is f32.
    const IS_SINGLE: bool;
    /// The nearest value.
    fn of(value: f64) -> Self;
    /// The same value, or the nearest one in f64.
    fn wide(self) -> f64;
}

impl Real for f32 {
    const IS_SINGLE: bool = true;
    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }
    #[inline(always)]
    fn wide(self) -> f64 {
        f64::from(self)
    }
}

impl Real for f64 {
    const IS_SINGLE: bool = false;
    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn wide(self) -> f64 {
        self
    }
}

/// The smaller number; one instruction, where `Float::min` also asks for NaN.
#[inline(always)]
fn least<F: Real>(a: F, b: F) -> F {
    if a < b { a } else { b }
}

/// The larger number; one instruction, where `Float::max` also asks for NaN.
#[inline(always)]
fn most<F: Real>(a: F, b: F) -> F {
    if a > b { a } else { b }
}

/// A weight of `C` channels: one for all three colours (grey media), or one a colour.
pub type Weight<F, const C: usize> = [F; C];

/// The weight of colour channel `channel`.
#[inline(always)]
pub fn channel<F: Copy, const C: usize>(weight: &Weight<F, C>, channel: usize) -> F {
    weight[if C == 1 { 0 } else { channel }]
}

/// Rows of a matrix that are walked rather than stored.
///
/// Law: a walk visits every element of its row at most once, in the order in which the ray meets them, and
/// the same walk gives the same numbers every time.
pub trait Traversal<F: Real, const C: usize>: Sync {
    /// The number of rows.
    fn rows(&self) -> usize;

    /// The number of elements, reached or not.
    fn elements(&self) -> usize;

    /// The first of the elements that nearly every row visits: sums over their columns are too long for f32. Most have none.
    fn long_from(&self) -> usize {
        usize::MAX
    }

    /// All rows in an order in which neighbours meet the same elements. None where nothing is known of one, or it is that of their
    /// numbers.
    fn row_order(&self) -> Option<Vec<u32>> {
        None
    }

    /// Visits the non-zeros of a row; weights of elements that are not visited are zero.
    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<F, C>));

    /// A row of T x: the sum of its weights times their elements.
    fn gather<X: Real>(&self, row: usize, x: &[[X; 3]]) -> [F; 3] {
        gathered(self, row, x)
    }

    /// Bytes that copies of elements may take while [`Self::gather_rows`] and [`Self::scatter_rows`] work, for these to be fast.
    fn room(&self) -> u64 {
        0
    }

    /// Some rows of T x, in so many bytes beside it: `y[k]` is that of row `row(k)`, and a fourth number that nobody reads.
    fn gather_rows<X: Real>(
        &self,
        x: &[[X; 3]],
        row: &(dyn Fn(usize) -> usize + Sync),
        y: &mut [[X; 4]],
        _room: u64,
    ) {
        gathered_rows(y, &|k| self.gather(row(k), x).map(Real::wide));
    }

    /// Tᵀ y of so many rows, in so many bytes beside it: `y(k)` is the number of one and what it has. None where they have to be walked one
    /// by one.
    fn scatter_rows<X: Real>(
        &self,
        _rows: usize,
        _y: &(dyn Fn(usize) -> (usize, [X; 3]) + Sync),
        _room: u64,
    ) -> Option<Vec<[X; 3]>> {
        None
    }

    /// The same for visitors that are in no hurry: they share one copy of the walk, and are called through a pointer.
    fn walk_shared(&self, row: usize, mut visit: &mut dyn FnMut(usize, Weight<F, C>)) {
        self.walk(row, &mut visit);
    }
}

/// Rows that one task gathers.
const ROWS_AT_ONCE: usize = 64;

/// Rows of T x, each of which is `gathered`.
fn gathered_rows<X: Real>(y: &mut [[X; 4]], gathered: &(dyn Fn(usize) -> [f64; 3] + Sync)) {
    y.par_chunks_mut(ROWS_AT_ONCE).enumerate().for_each(|(piece, y)| {
        for (k, y) in (piece * ROWS_AT_ONCE..).zip(y) {
            let [r, g, b] = gathered(k).map(X::of);
            *y = [r, g, b, X::zero()];
        }
    });
}

/// A row of T x, walked.
fn gathered<F: Real, const C: usize, X: Real>(
    traversal: &(impl Traversal<F, C> + ?Sized),
    row: usize,
    x: &[[X; 3]],
) -> [F; 3] {
    let mut sum = [F::zero(); 3];
    traversal.walk(row, &mut |element, weight| {
        let x = x[element];
        for c in 0..3 {
            sum[c] += channel(&weight, c) * F::of(x[c].wide());
        }
    });
    sum
}
