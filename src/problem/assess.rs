use super::{LightMapOperator, LightMapProblem};
use crate::Result;
use crate::operator::{CpuVector, LinearOperator};
use crate::scene::Rgb;

/// Less saturation than this, from 0 to 1, has no hue to speak of.
const SATURATED: f32 = 0.1;
/// A texel is contested when the hues that pull at it agree less than this (0: not at all, 1: fully).
const AGREED: f32 = 0.9;
/// A pixel is contested when more than this share of its light comes through contested texels.
const CONTESTED: f32 = 0.25;

/// How well some painted pixels show what was painted.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Match {
    /// Painted pixels.
    pub pixels: usize,
    /// √(Σ w ‖L − L_target‖² / Σ w ‖L_target‖²), L the scattered radiance and w the painted alpha.
    pub residual: f64,
    /// Mean angle between the hue shown and the hue painted, in degrees, over lit pixels whose paint has a hue.
    /// Grey counts as 90°, the mean over all hues that might have been meant.
    pub hue_error: f64,
    /// The same over the pixels that are not contested: no stroke of another hue pulls at the same texels.
    pub uncontested_hue_error: f64,
    /// Painted pixels that are contested.
    pub contested: usize,
}

/// How well the light map `x` (all texels) meets the targets: over all rows, and view by view.
///
/// Cost: 2 applications of T, 1 of its adjoint.
pub fn assess(
    problem: &LightMapProblem,
    operator: &LightMapOperator,
    x: &CpuVector,
    views: usize,
) -> Result<(Match, Vec<Match>)> {
    let mut shown = operator.range();
    operator.apply(x, &mut shown)?;
    let contested = contested(problem, operator)?;
    let mut all = Sums::default();
    let mut by_view = vec![Sums::default(); views];
    for (row, pixel) in problem.constraints.iter().enumerate() {
        let around = problem.surroundings[row];
        let total = |part: Rgb| std::array::from_fn(|c| part[c] + around[c]);
        let (shown, target) = (total(shown.0[row]), total(problem.targets[row]));
        for sums in [&mut all, &mut by_view[pixel.view]] {
            sums.add(shown, target, pixel.color, f64::from(pixel.weight), contested[row]);
        }
    }
    Ok((all.finish(), by_view.into_iter().map(Sums::finish).collect()))
}

#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    pixels: usize,
    contested: usize,
    squares: f64,
    targets: f64,
    /// Weight and weighted hue error, over all pixels and over those that are not contested.
    hue: [[f64; 2]; 2],
}

impl Sums {
    fn add(&mut self, shown: Rgb, target: Rgb, painted: Rgb, weight: f64, contested: bool) {
        self.pixels += 1;
        self.contested += usize::from(contested);
        for c in 0..3 {
            self.squares += weight * f64::from(shown[c] - target[c]).powi(2);
            self.targets += weight * f64::from(target[c]).powi(2);
        }
        let lit = target.iter().any(|&value| value > 1e-6);
        if let (true, Some(want)) = (lit, hue(painted, SATURATED)) {
            let error = hue(shown, 0.0).map_or(90.0, |have| {
                let turn = (have - want).to_degrees().rem_euclid(360.0);
                f64::from(turn.min(360.0 - turn))
            });
            for sums in &mut self.hue[..if contested { 1 } else { 2 }] {
                sums[0] += weight;
                sums[1] += weight * error;
            }
        }
    }

    fn finish(self) -> Match {
        let mean = |[weight, sum]: [f64; 2]| if weight > 0.0 { sum / weight } else { 0.0 };
        let residual = if self.targets > 0.0 { (self.squares / self.targets).sqrt() } else { 0.0 };
        Match {
            pixels: self.pixels,
            residual,
            hue_error: mean(self.hue[0]),
            uncontested_hue_error: mean(self.hue[1]),
            contested: self.contested,
        }
    }
}

/// Which rows share their texels with strokes of another hue.
///
/// Every row sends its hue, as a point on the colour circle, to its texels; where the mean of what arrives is short,
/// the strokes contradict each other.
fn contested(problem: &LightMapProblem, operator: &LightMapOperator) -> Result<Vec<bool>> {
    let sent = problem.constraints.iter().map(|pixel| match hue(pixel.color, SATURATED) {
        Some(angle) => [angle.cos() * pixel.weight, angle.sin() * pixel.weight, pixel.weight],
        None => [0.0; 3],
    });
    let mut texels = operator.domain();
    operator.apply_adjoint(&CpuVector(sent.collect()), &mut texels)?;
    for texel in &mut texels.0 {
        let agreement = texel[0].hypot(texel[1]) / texel[2];
        *texel = [if agreement < AGREED { 1.0 } else { 0.0 }, 1.0, 0.0];
    }
    let mut shares = operator.range();
    operator.apply(&texels, &mut shares)?;
    Ok(shares.0.iter().map(|share| share[0] > CONTESTED * share[1]).collect())
}

/// Angle on the colour circle in radians; none for a colour of at most `least` saturation.
fn hue([r, g, b]: Rgb, least: f32) -> Option<f32> {
    let (high, low) = (r.max(g).max(b), r.min(g).min(b));
    let saturated = high > 0.0 && high - low > least * high;
    saturated.then(|| (3f32.sqrt() * (g - b)).atan2(2.0 * r - g - b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hues_of_the_primaries_are_a_third_of_a_turn_apart() {
        let degrees = |color| hue(color, 0.1).map(|angle| angle.to_degrees().rem_euclid(360.0).round());
        assert_eq!(degrees([1.0, 0.0, 0.0]), Some(0.0));
        assert_eq!(degrees([0.0, 0.5, 0.0]), Some(120.0));
        assert_eq!(degrees([0.0, 0.0, 2.0]), Some(240.0));
        assert_eq!(degrees([1.0, 0.95, 0.97]), None);
        assert_eq!(degrees([0.0; 3]), None);
    }
}
