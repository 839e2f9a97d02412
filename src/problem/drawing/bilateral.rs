//! Few steps a ray, smoothed where pixels are as deep (Ali et al. 2017).
//!
//! The paper gives the form of its kernels, `e^{−h p²}` (eq. 7), one pass along rows and one along columns, and no numbers; nor does it shift
//! samples from pixel to pixel. Shifts in a pattern of 4 × 4, the radius and both h are ours.

use rayon::prelude::*;

use super::marched::marched;
use super::rays::{MARCHED_TO, PictureRays, SunLight};
use crate::march::ViewRay;
use crate::scene::Rgb;

/// Pixels to either side that are averaged: as many as the pattern of shifts has.
const RADIUS: usize = 4;
/// h of the distance in pixels (eq. 7).
const OF_PLACE: f32 = 0.125;
/// h of the logarithm of the ratio of depths: a tenth more is another surface.
const OF_DEPTH: f32 = 200.0;

/// What both lights of a picture show, in so many steps a ray.
pub(super) fn smoothed(light: SunLight, of: &PictureRays, steps: usize) -> Vec<[Rgb; 2]> {
    let noisy = marched(light, of.rays, steps, &|row| offset([row % of.width, row / of.width]));
    let reach = light.scene.medium.reach(MARCHED_TO);
    let depth = |ray: &ViewRay| ray.length.min(reach) as f32;
    let depths: Vec<f32> = of.rays.par_iter().map(depth).collect();
    let width = of.width;
    let along_rows = smoothed_along(&noisy, &depths, width, &|at| (at % width, width, 1));
    smoothed_along(&along_rows, &depths, width, &|at| (at / width, depths.len() / width, width))
}

/// One pass: `line` says which place of how many of its line a pixel is, and how far the next one of them is.
fn smoothed_along(
    picture: &[[Rgb; 2]],
    depths: &[f32],
    width: usize,
    line: &(dyn Fn(usize) -> (usize, usize, usize) + Sync),
) -> Vec<[Rgb; 2]> {
    let pixel = |at: usize| {
        let (place, count, stride) = line(at);
        let (mut sum, mut weights) = (picture[at], 1.0);
        let mut add = |tap: usize, away: usize| {
            let apart = if depths[tap] == depths[at] { 0.0 } else { (depths[tap] / depths[at]).ln() };
            let weight = (-OF_PLACE * (away * away) as f32 - OF_DEPTH * apart * apart).exp();
            // Of depths without a ratio, such as 0, there is none.
            if weight > 0.0 {
                weights += weight;
                for (sum, shown) in sum.as_flattened_mut().iter_mut().zip(picture[tap].as_flattened()) {
                    *sum += weight * shown;
                }
            }
        };
        (1..=RADIUS.min(place)).for_each(|away| add(at - away * stride, away));
        (1..=RADIUS.min(count - 1 - place)).for_each(|away| add(at + away * stride, away));
        sum.map(|color| color.map(|value| value / weights))
    };
    let mut smooth = vec![[[0.0; 3]; 2]; picture.len()];
    smooth.par_chunks_mut(width.max(1)).enumerate().for_each(|(row, pixels)| {
        for (x, value) in pixels.iter_mut().enumerate() {
            *value = pixel(row * width + x);
        }
    });
    smooth
}

/// By which part of a step the samples of a pixel are shifted: the middles of 16 strata in the order of Bayer's matrix, so that the 16 pixels of a
/// square have 16 times the samples of one, evenly spread.
fn offset(pixel: [usize; 2]) -> f64 {
    let pair = |bit: usize| {
        let [x, y] = pixel.map(|at| at >> bit & 1);
        (x ^ y) << 1 | y
    };
    ((pair(0) << 2 | pair(1)) as f64 + 0.5) / 16.0
}
