//! The blur that unites what neighbouring pixels found.

use rayon::prelude::*;

use super::buffer::GeometryBuffer;
use super::openness::Openness;

/// Neighbours count that lie nearer to the tangent plane than this share of the radius.
const BESIDE: f64 = 0.1;

/// The mean over the m × m pixels around each, of those that lie on about the same plane and look the same way.
///
/// How directions are bent is blurred, not the normals: what is seen of these stays sharp (fig. 3.6).
///
/// Source  Laine et al. 2007, by Klehm 2015, sec. 3.4
pub(super) fn blurred(
    buffer: &GeometryBuffer,
    found: &[Openness],
    side: usize,
    radius: f64,
) -> Vec<Openness> {
    if side == 1 {
        return found.to_vec();
    }
    let [width, height] = buffer.camera.size();
    let around = |at: usize, size: usize| at.saturating_sub((side - 1) / 2)..(at + side / 2 + 1).min(size);
    let of_pixel = |index: usize| {
        let Some(surface) = buffer.at(index) else { return found[index] };
        let (mut sum, mut weights) = (Openness { share: 0.0, bend: glam::Vec3::ZERO }, 0.0);
        for y in around(index / width, height) {
            for x in around(index % width, width) {
                let other = y * width + x;
                let Some(near) = buffer.at(other) else { continue };
                let apart = f64::from((near.from_eye - surface.from_eye).dot(surface.normal).abs());
                let alike = surface.normal.dot(near.normal).max(0.0).powi(8);
                let weight = alike * (1.0 - apart / (BESIDE * radius)).max(0.0) as f32;
                sum.share += weight * found[other].share;
                sum.bend += weight * found[other].bend;
                weights += weight;
            }
        }
        Openness { share: sum.share / weights, bend: sum.bend / weights }
    };
    (0..buffer.len()).into_par_iter().map(of_pixel).collect()
}
