//! Pixels that are kept out of a fit, so that what is left of them tells what of the others is noise.

use std::sync::Arc;

use super::{Desired, VolumeProblem};
use crate::Result;
use crate::problem::{HeldOut, Problem};
use crate::scene::{Find, Image, Strategy, VolumeScene};
use crate::solve::is_mostly_noise;

/// Noise of the pictures, as a part of their root mean square, below which they are followed as closely as the tolerance asks.
const NOISELESS: f64 = 5e-4;
/// A 32nd of the pixels is kept out, and of few pixels more: up to an eighth.
const SHARE: usize = 32;
const SHARE_OF_FEW: usize = 8;
/// So many pixels tell noise from what is shown.
const ENOUGH: usize = 2048;
/// Of fewer pixels none is spared.
const FEWEST: usize = 1024;

/// Which pixels of measured pictures are kept out of a fit: the same ones in every stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoldOut {
    /// A pixel is kept out where its hash is less.
    below: u32,
    /// The noise of the pictures as a part of their root mean square.
    noise: f64,
}

impl HoldOut {
    /// The pixels that are kept out of the fits of a scene. None where no extinction is looked for, where something is painted, since paint is no
    /// measurement, where the scene says itself how noisy its pictures are, and where there are few pixels.
    pub fn of(scene: &VolumeScene, desired: &[Desired]) -> Option<Self> {
        let is_asked = scene.stages.iter().any(|find| matches!(find, Find::Extinction | Find::Refinement));
        if !is_asked || scene.is_painted || scene.solve.noise.is_some() {
            return None;
        }
        let wanted = desired.iter().flat_map(|view| &view.pixels).filter(|pixel| pixel[3] > 0.0).count();
        if wanted < FEWEST {
            return None;
        }
        let kept_out = (wanted / SHARE).max(ENOUGH.min(wanted / SHARE_OF_FEW));
        let sizes = scene.views.iter().map(|view| view.view.camera.size());
        let mut noises: Vec<f64> =
            desired.iter().zip(sizes).filter_map(|(view, size)| noise(&view.pixels, size)).collect();
        noises.sort_by(f64::total_cmp);
        Some(Self {
            below: (kept_out as f64 / wanted as f64 * f64::from(u32::MAX)) as u32,
            noise: noises.get(noises.len() / 2).copied().unwrap_or_default(),
        })
    }

    /// Whether a property is looked for without them. Steps of a refinement must always help what they have not seen; extinction is looked for
    /// without them where the pictures are noisy. Emission and albedo are not: what they are for is the pictures, which still come nearer to the
    /// truth when the volume does no more (docs/volumes.md).
    pub fn applies_to(&self, find: Find) -> bool {
        match find {
            Find::Refinement => true,
            Find::Extinction => self.noise > NOISELESS,
            Find::Emission | Find::Albedo | Find::Joint | Find::Environment => false,
        }
    }

    /// Whether pictures are nearer to what is wanted than others by more than noise, as far as the pixels that are kept out can tell: by more than
    /// twice the standard error of what they gain, and by enough of what the others gain ([`is_mostly_noise`]).
    pub fn come_nearer(&self, desired: &[Desired], pictures: [&[Image]; 2]) -> bool {
        let (mut fit, mut held_out, mut count, mut squares) = ([0.0; 2], [0.0; 2], 0.0, 0.0);
        for (view, desired) in desired.iter().enumerate() {
            for (pixel, &[r, g, b, weight]) in desired.pixels.iter().enumerate() {
                let miss = pictures.map(|pictures| {
                    let of = |(wanted, shown): (f32, &f32)| f64::from(shown - wanted).powi(2);
                    let colors = [r, g, b].into_iter().zip(&pictures[view].pixels[pixel]);
                    f64::from(weight) * colors.map(of).sum::<f64>()
                });
                let is_out = self.contains(view, pixel);
                let sums = if is_out { &mut held_out } else { &mut fit };
                (0..2).for_each(|when| sums[when] += miss[when]);
                if is_out && weight > 0.0 {
                    (count, squares) = (count + 1.0, squares + (miss[0] - miss[1]).powi(2));
                }
            }
        }
        let gain = held_out[0] - held_out[1];
        let standard_error = (squares - gain * gain / f64::max(count, 1.0)).max(0.0).sqrt();
        gain > 2.0 * standard_error && !is_mostly_noise(fit, held_out)
    }

    /// Whether a pixel is kept out.
    pub fn contains(&self, view: usize, pixel: usize) -> bool {
        // The finalizer of SplitMix64 (Steele et al. 2014).
        let mut hash = ((view as u64) << 32 | pixel as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        hash = (hash ^ (hash >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        hash = (hash ^ (hash >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((hash ^ (hash >> 31)) as u32) < self.below
    }
}

impl VolumeProblem {
    /// The same problem without the rows that are kept out of its fit. As it is where that leaves nothing.
    ///
    /// Errors: those of keeping these rows.
    pub fn holding_out(self, pixels: &HoldOut, strategy: Strategy) -> Result<Self> {
        let is_out = |&row: &usize| {
            let [view, pixel] = self.pixel(row);
            pixels.contains(view, pixel)
        };
        let (out, kept): (Vec<usize>, Vec<usize>) = (0..self.rows()).partition(is_out);
        if out.is_empty() || kept.is_empty() {
            return Ok(self);
        }
        let out = self.of_some(&out);
        let operator = out.on_cpu(strategy, u64::MAX)?;
        let held_out = Arc::new(HeldOut::new(operator, out.targets, out.weights));
        let mut kept = self.of_some(&kept);
        kept.held_out = Some(held_out);
        Ok(kept)
    }
}

/// The standard deviation of the noise of a picture, as a part of its root mean square; none where it has no 3 × 3 pixels.
///
/// `[1 −2 1; −2 4 −2; 1 −2 1]` of the grey picture is nothing on planes and edges along the axes, and has six times the standard deviation
/// of independent noise (Immerkær 1996); its median over the picture passes over what is not flat. Pixels at the least or the largest value
/// that many have are cut off there, so that neighbourhoods that touch them tell nothing, unless they are flat altogether.
fn noise(pixels: &[[f32; 4]], [width, height]: [usize; 2]) -> Option<f64> {
    const MASK: [[f64; 3]; 3] = [[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]];
    /// A median of absolute values of normal numbers to their standard deviation.
    const OF_MEDIAN: f64 = 1.482_602;
    /// The share of pixels with the same extreme value from which on it is a limit.
    const CUT_OFF: f64 = 0.01;
    let grey: Vec<Option<f64>> = pixels
        .iter()
        .map(|&[r, g, b, weight]| (weight > 0.0).then(|| (f64::from(r) + f64::from(g) + f64::from(b)) / 3.0))
        .collect();
    let wanted = || grey.iter().flatten().copied();
    let count = wanted().count() as f64;
    let limits = [wanted().fold(f64::INFINITY, f64::min), wanted().fold(f64::NEG_INFINITY, f64::max)];
    let is_cut_off =
        limits.map(|limit| wanted().filter(|&value| value == limit).count() as f64 > CUT_OFF * count);
    let is_at_limit = |value: f64| (0..2).any(|end| is_cut_off[end] && value == limits[end]);
    let mut found = Vec::new();
    for y in 1..height.saturating_sub(1) {
        for x in 1..width.saturating_sub(1) {
            let (mut sum, mut at_limit, mut all) = (0.0, 0, true);
            for (j, weights) in MASK.iter().enumerate() {
                for (i, weight) in weights.iter().enumerate() {
                    match grey[(y + j - 1) * width + x + i - 1] {
                        Some(value) => {
                            sum += weight * value;
                            at_limit += usize::from(is_at_limit(value));
                        }
                        None => all = false,
                    }
                }
            }
            if all && (at_limit == 0 || at_limit == 9) {
                found.push(sum.abs());
            }
        }
    }
    let rms = (wanted().map(|value| value * value).sum::<f64>() / count).sqrt();
    if found.is_empty() || rms <= 0.0 || rms.is_nan() {
        return None;
    }
    let middle = found.len() / 2;
    let (_, median, _) = found.select_nth_unstable_by(middle, f64::total_cmp);
    Some(OF_MEDIAN * *median / 6.0 / rms)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of waves, with normal noise of a standard deviation by the sum of twelve uniform numbers.
    fn picture(deviation: f64, cut_off: bool) -> Vec<[f32; 4]> {
        let mut state = 1u32;
        let mut uniform = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state) / f64::from(u32::MAX)
        };
        let mut pixel = |index: usize| {
            let (x, y) = ((index % 64) as f64, (index / 64) as f64);
            let wave = 0.5 + 0.6 * (0.1 * x).sin() * (0.08 * y).cos();
            let value = wave + deviation * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0);
            let value = if cut_off { value.clamp(0.2, 0.8) } else { value } as f32;
            [value, value, value, 1.0]
        };
        (0..64 * 64).map(&mut pixel).collect()
    }

    fn rms(pixels: &[[f32; 4]]) -> f64 {
        (pixels.iter().map(|pixel| f64::from(pixel[0]).powi(2)).sum::<f64>() / pixels.len() as f64).sqrt()
    }

    #[test]
    fn the_noise_of_a_picture_is_found() {
        for deviation in [0.002, 0.02, 0.1] {
            for cut_off in [false, true] {
                let pixels = picture(deviation, cut_off);
                let found = noise(&pixels, [64, 64]).unwrap() * rms(&pixels);
                // Nearly half of the picture is cut off, and counts as free of noise.
                let least = if cut_off { 0.5 } else { 0.9 };
                let share = found / deviation;
                assert!((least..1.1).contains(&share), "{deviation}, {cut_off}: {share}");
            }
        }
        let clean = picture(0.0, false);
        assert!(noise(&clean, [64, 64]).unwrap() < NOISELESS);
    }

    #[test]
    fn a_picture_of_nothing_has_no_noise() {
        assert_eq!(noise(&[[0.0, 0.0, 0.0, 1.0]; 16], [4, 4]), None);
        assert_eq!(noise(&[[0.5, 0.5, 0.5, 1.0]; 16], [4, 4]), Some(0.0));
        assert_eq!(noise(&[[0.5, 0.5, 0.5, 0.0]; 16], [4, 4]), None, "nothing is wanted");
        assert_eq!(noise(&[[0.5, 0.5, 0.5, 1.0]; 4], [2, 2]), None, "too small");
    }
}
