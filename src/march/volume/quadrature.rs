//! Gauss' rules along pieces of a ray.

use super::super::{Weight, exponential};
use super::density::Depth;

/// Nodes and weights of Gauss and Legendre on [0, 1] with four points: exact for polynomials of degree 7.
pub const GAUSS_4: [[f64; 2]; 4] = [
    [0.069_431_844_202_973_71, 0.173_927_422_568_726_93],
    [0.330_009_478_207_571_87, 0.326_072_577_431_273_07],
    [0.669_990_521_792_428_1, 0.326_072_577_431_273_07],
    [0.930_568_155_797_026_3, 0.173_927_422_568_726_93],
];
/// The same with two points: exact for the cubics that trilinear functions are along a line.
pub const GAUSS_2: [[f64; 2]; 2] = [[0.211_324_865_405_187_13, 0.5], [0.788_675_134_594_812_9, 0.5]];
/// Optical depth over which four nodes are accurate enough.
pub const PANEL: f64 = 0.5;
/// Panels of a cell at most: 5e5 of optical depth are resolved.
pub const MOST_PANELS: f64 = 1_048_576.0;
/// Optical depth behind which nothing adds to what is before it in f64.
const OPAQUE: f64 = 40.0;

/// Visits nodes u of [from, to] with weights w so that Σ w f(u) = ∫ τ'(u) e^{τ(from) − τ(u)} f(u) du for a cubic f: four nodes for
/// every half of optical depth, 1e-8 of the whole where the density is constant, 1e-5 where it is cubic itself.
#[inline(always)]
pub(super) fn nodes<const C: usize>(
    depth: &Depth<C>,
    from: f64,
    to: f64,
    mut visit: impl FnMut(f64, Weight<f64, C>),
) {
    let (start, end) = (depth.at(from), depth.at(to));
    // By the steepest part, for panels are equal in length.
    let slopes = [from, 0.5 * (from + to), to].map(|u| depth.slope(u));
    let steepest = slopes.as_flattened().iter().copied().fold(0.0, f64::max) * (to - from);
    let most = (0..C).fold(steepest, |most: f64, c| most.max(end[c] - start[c]));
    let panels = (most / PANEL).ceil().clamp(1.0, MOST_PANELS);
    let width = (to - from) / panels;
    for panel in 0..panels as u32 {
        let before = depth.at(from + f64::from(panel) * width);
        if (0..C).all(|c| before[c] - start[c] > OPAQUE) {
            return;
        }
        for [node, weight] in GAUSS_4 {
            let u = from + (f64::from(panel) + node) * width;
            let (tau, slope) = (depth.at(u), depth.slope(u));
            // Rounding can make the slope of a vanishing density negative.
            visit(
                u,
                std::array::from_fn(|c| {
                    weight * width * slope[c].max(0.0) * exponential::left(tau[c] - start[c])
                }),
            );
        }
    }
}
