use super::{LightMapProblem, TransferProblem};
use crate::Result;
use crate::operator::FromHost;
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
    /// √(Σ w ‖L − L_target‖² / Σ w ‖L_target‖²), L the radiance that the paint is about and w its weight. Where the paint asks for darkness
    /// it is relative to the plain light.
    pub residual: f64,
    /// Mean angle between the hue shown and the hue wanted, in degrees, over lit pixels of which a hue is wanted.
    /// Grey counts as 90°, the mean over all hues that might have been meant.
    pub hue_error: f64,
    /// The angle that half of those pixels exceed, by weight, and the one that a tenth of them exceeds.
    pub hue_quantiles: [f64; 2],
    /// The same over the pixels that are not contested: no stroke of another hue pulls at the same texels.
    pub uncontested_hue_error: f64,
    /// Painted pixels that are contested.
    pub contested: usize,
}

/// How well what is looked for behind painted pixels meets the targets.
pub struct Assessor<'a> {
    pixels: &'a LightMapProblem,
    operator: &'a dyn FromHost,
    contested: Vec<bool>,
}

/// What a light map shows of the targets.
#[derive(Debug, Clone, PartialEq)]
pub struct Assessment {
    /// Over all rows.
    pub all: Match,
    /// Of each view.
    pub views: Vec<Match>,
    /// Radiance of each row with weight, its known radiance included.
    pub shown: Vec<Rgb>,
}

impl<'a> Assessor<'a> {
    /// Finds out which rows of a light map are contested.
    ///
    /// Cost: 3 applications of the adjoint, 1 of T.
    /// Errors: those of the operator.
    pub fn new(problem: &'a LightMapProblem, operator: &'a dyn FromHost) -> Result<Self> {
        Self::of(problem, operator, problem.maps.light_map.len(), |row| problem.weight_of_texels(row))
    }

    /// The same for a transfer function.
    ///
    /// Errors: those of the operator.
    pub fn of_transfer(problem: &'a TransferProblem, operator: &'a dyn FromHost) -> Result<Self> {
        let lookups = problem.traversal.lookups();
        Self::of(&problem.pixels, operator, problem.table.texels.len(), |row| lookups[row].white)
    }

    /// Of pixels whose rows are those of `operator`, with `whole` the weight of all texels on a row; texels are its first elements.
    fn of(
        pixels: &'a LightMapProblem,
        operator: &'a dyn FromHost,
        texels: usize,
        whole: impl Fn(usize) -> [f64; 3],
    ) -> Result<Self> {
        Ok(Self { pixels, operator, contested: contested(pixels, operator, texels, whole)? })
    }

    /// Compares what `x` (all elements) shows with the targets, over all rows and in each of `views` views.
    ///
    /// Cost: 1 application of T.
    /// Errors: [`crate::Error::Shape`] for another number of elements; those of the operator.
    pub fn assess(&self, x: &[Rgb], views: usize) -> Result<Assessment> {
        let mut shown = self.operator.shown(x)?;
        let mut all = Sums::default();
        let mut by_view = vec![Sums::default(); views];
        for (row, pixel) in self.pixels.constraints.iter().enumerate() {
            if !pixel.is_painted() {
                continue;
            }
            let known = self.pixels.known_radiance[row];
            shown[row] = std::array::from_fn(|c| shown[row][c] + known[c]);
            let target = self.pixels.wanted(row);
            for sums in [&mut all, &mut by_view[pixel.view]] {
                let plain = self.pixels.plain[row];
                sums.add([shown[row], target, plain], f64::from(pixel.weight), self.contested[row]);
            }
        }
        let views = by_view.into_iter().map(Sums::finish).collect();
        Ok(Assessment { all: all.finish(), views, shown })
    }
}

#[derive(Debug, Clone, Default)]
struct Sums {
    pixels: usize,
    contested: usize,
    squares: f64,
    targets: f64,
    plain: f64,
    /// Weight and weighted hue error, over all pixels and over those that are not contested.
    hue: [[f64; 2]; 2],
    /// Hue errors of single pixels and their weights.
    angles: Vec<[f64; 2]>,
}

impl Sums {
    fn add(&mut self, [shown, target, plain]: [Rgb; 3], weight: f64, contested: bool) {
        self.pixels += 1;
        self.contested += usize::from(contested);
        for c in 0..3 {
            self.squares += weight * f64::from(shown[c] - target[c]).powi(2);
            self.targets += weight * f64::from(target[c]).powi(2);
            self.plain += weight * f64::from(plain[c]).powi(2);
        }
        let lit = target.iter().any(|&value| value > 1e-6);
        if let (true, Some(want)) = (lit, hue(target, SATURATED)) {
            let error = hue(shown, 0.0).map_or(90.0, |have| {
                let turn = (have - want).to_degrees().rem_euclid(360.0);
                f64::from(turn.min(360.0 - turn))
            });
            self.angles.push([error, weight]);
            for sums in &mut self.hue[..if contested { 1 } else { 2 }] {
                sums[0] += weight;
                sums[1] += weight * error;
            }
        }
    }

    fn finish(mut self) -> Match {
        let mean = |[weight, sum]: [f64; 2]| if weight > 0.0 { sum / weight } else { 0.0 };
        let whole = if self.targets > 0.0 { self.targets } else { self.plain };
        let residual = if whole > 0.0 { (self.squares / whole).sqrt() } else { 0.0 };
        self.angles.sort_unstable_by(|[a, _], [b, _]| a.total_cmp(b));
        let of_hue = self.hue[0][0];
        let quantile = |part: f64| {
            let mut below = 0.0;
            let angle = self.angles.iter().find(|[_, weight]| {
                below += weight;
                below >= part * of_hue
            });
            angle.or(self.angles.last()).map_or(0.0, |[angle, _]| *angle)
        };
        let hue_quantiles = [quantile(0.5), quantile(0.9)];
        Match {
            pixels: self.pixels,
            residual,
            hue_error: mean(self.hue[0]),
            hue_quantiles,
            uncontested_hue_error: mean(self.hue[1]),
            contested: self.contested,
        }
    }
}

/// Which rows share their texels with strokes of another hue.
///
/// Every row sends its hue, as a point on the colour circle, to its texels; where the mean of what arrives is short,
/// the strokes contradict each other.
fn contested(
    pixels: &LightMapProblem,
    operator: &dyn FromHost,
    count: usize,
    whole: impl Fn(usize) -> [f64; 3],
) -> Result<Vec<bool>> {
    // One transport for all three quantities, for coloured media have three.
    let arriving = |part: fn(f32) -> f32| -> Result<Vec<f32>> {
        let sent = pixels.constraints.iter().map(|pixel| {
            let weight = pixel.weight * pixel.opacity;
            let value = hue(pixel.color, SATURATED).map_or(0.0, |angle| part(angle) * weight);
            [value; 3]
        });
        let texels = operator.arriving(&sent.collect::<Vec<Rgb>>())?;
        Ok(texels.iter().map(|texel| texel[0] + texel[1] + texel[2]).collect())
    };
    let (cos, sin, all) = (arriving(f32::cos)?, arriving(f32::sin)?, arriving(|_| 1.0)?);
    let disputed = (0..all.len()).map(|texel| {
        let agreement = cos[texel].hypot(sin[texel]) / all[texel];
        // What is behind the texels is one for all strokes, and none of them can have it alone.
        let is_disputed = agreement < AGREED && texel < count;
        [if is_disputed { 1.0 } else { 0.0 }; 3]
    });
    let shares = operator.shown(&disputed.collect::<Vec<Rgb>>())?;
    let sum = |row: Rgb| row.iter().map(|&value| f64::from(value)).sum::<f64>();
    let rows = shares.iter().enumerate();
    Ok(rows
        .map(|(row, &share)| {
            let whole: f64 = whole(row).iter().sum();
            sum(share) > f64::from(CONTESTED) * whole
        })
        .collect())
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
