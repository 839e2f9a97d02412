//! How much pictures are brightened for a screen.

use crate::scene::{Image, luminance};

/// The part of all pixels that may be brighter than [`BRIGHT`]: windows and skies.
const BRIGHTEST: f64 = 0.1;
/// The luminance that the others have at most on the screen, linear.
const BRIGHT: f64 = 0.7;

/// Stops, in halves, at which pictures can be read: one number for all of them, so that they can be compared.
pub(crate) fn readable<'a>(pictures: impl IntoIterator<Item = &'a Image>) -> f64 {
    let pixels = pictures.into_iter().flat_map(|picture| &picture.pixels);
    let mut luminances: Vec<f32> = pixels.map(|&color| luminance(color)).filter(|&l| l > 0.0).collect();
    let brighter = (BRIGHTEST * luminances.len() as f64) as usize;
    if luminances.is_empty() {
        return 0.0;
    }
    let (_, &mut bright, _) = luminances.select_nth_unstable_by(brighter, |a, b| b.total_cmp(a));
    let stops = (2.0 * (BRIGHT / f64::from(bright)).log2()).floor() / 2.0;
    stops.clamp(-64.0, 64.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_but_the_brightest_pixels_become_bright_and_none_of_them_white() {
        for scale in [1e-6, 0.02, 1.0, 300.0] {
            let mut picture = Image::constant([100, 10], [0.5 * scale; 3]);
            picture.pixels[..99].fill([1e6 * scale; 3]);
            let shown = 0.5 * f64::from(scale) * readable([&picture]).exp2();
            assert!((0.7 / 2f64.sqrt()..=0.7).contains(&shown), "{shown} at {scale}");
        }
        assert_eq!(readable([&Image::constant([2, 2], [0.0; 3])]), 0.0);
    }
}
