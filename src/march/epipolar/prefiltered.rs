//! Light shafts by prefiltered visibility (Klehm et al. 2014; Klehm 2015, chapter 4).
//!
//! Whether a sample is lit is a step in the difference of two angles, that of the ray and that of the surface over the sample. As a Fourier
//! series it is a sum of products of one function of each (eq. 9), and the functions of the surfaces are summed up along the samples
//! beforehand. So a ray of any length takes M products, whatever the scene. The samples are weighted by the transmittance along one
//! reference ray (eq. 11), and the mean is multiplied with the ray's own integral (eqs. 2 and 3, appendix A).
//!
//! Three things depart from the paper. Samples weigh what is between their edges, because the ratio of eq. 12 is constant for no projection. The
//! reference ray is the best one (dissertation, eqs. 4.10 to 4.12), not the bisectrix. And depths beyond those of all rays are clamped a little outside their range
//! ([`GUARD`]): at its very edge the series has its other jump, and open sky would show half of its light.

use std::f64::consts::{PI, TAU};

use super::fan::{Fan, FanRay};

/// The most coefficients.
pub const MOST_COEFFICIENTS: usize = 256;
/// How far outside the rays' range depths are clamped, as a part of it.
const GUARD: f64 = 0.1;

/// How the samples before the end of a ray are weighted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PrefilterWeighting {
    /// All alike: average visibility (eq. 2).
    Average,
    /// By the transmittance along a reference ray (eq. 11).
    Transmittance,
}

/// How the visibility of a fan is filtered, whatever the light.
#[derive(Debug)]
pub struct Prefilter<'a> {
    fan: &'a Fan,
    sigma_t: [f64; 3],
    /// The least angle of a ray, and how far the others reach.
    angles: [f64; 2],
    /// Extinction along the reference ray, a metre of ξ and channel.
    pub rates: [f64; 3],
}

/// What a ray reads of sums along the samples of its fan.
#[derive(Debug, Clone, Copy)]
pub struct PrefilterLookup {
    /// The edge at or behind its end, at least the second one.
    pub edge: usize,
    /// The part of the sums there, a channel; the rest is that of the edge before.
    pub far: [f64; 3],
    /// What the ray loses up to its end, which the filtered visibility is a part of.
    pub whole: [f64; 3],
    /// Where its angle is in the half period of the series.
    pub place: f64,
}

impl<'a> Prefilter<'a> {
    /// Of a fan with such rays.
    pub fn new((fan, rays): (&'a Fan, &[FanRay]), sigma_t: [f64; 3], weighting: PrefilterWeighting) -> Self {
        let reference = match weighting {
            PrefilterWeighting::Average => 0.0,
            PrefilterWeighting::Transmittance => reference_q(rays),
        };
        Self { fan, sigma_t, angles: angles_of(rays), rates: sigma_t.map(|sigma| sigma * reference) }
    }

    /// Where a slope is in the half period of the series, from 0 to 1.
    pub fn place(&self, slope: f32) -> f64 {
        let [least, range] = self.angles;
        let place = ((f64::from(slope).atan() - least) / range).clamp(-GUARD, 1.0 + GUARD);
        (place + GUARD) / (1.0 + 2.0 * GUARD)
    }

    /// Σ w up to a ξ: what the reference ray loses of 1 from the first edge on, over its rate.
    fn total(&self, color: usize, xi: f64) -> f64 {
        let (rate, way) = (self.rates[color], xi - self.fan.edges.first);
        if rate > 0.0 { -(-rate * way).exp_m1() / rate } else { way }
    }

    /// What a ray of the fan reads; none where it passes no sample.
    pub fn lookup(&self, ray: &FanRay) -> Option<PrefilterLookup> {
        let end = f64::from(ray.end).min(self.fan.last());
        let edge = self.fan.samples_before(end);
        if edge == 0 {
            return None;
        }
        let far = |color: usize| {
            let [before, after] = [edge - 1, edge].map(|edge| self.total(color, self.fan.edge(edge)));
            let whole = self.total(color, end);
            let part =
                if after > before { ((whole - before) / (after - before)).clamp(0.0, 1.0) } else { 1.0 };
            if whole > 0.0 { (part * after / whole).min(1.0) } else { 1.0 }
        };
        Some(PrefilterLookup {
            edge,
            far: std::array::from_fn(far),
            whole: ray.extinguished(self.sigma_t, self.fan.edges.first, end),
            place: self.place(ray.kappa),
        })
    }
}

/// The visibility of a fan in a Fourier series, summed up along its samples.
///
/// Shapes  one mean and M sums of each edge, for each colour that differs
#[derive(Debug)]
pub struct Prefiltered<'a> {
    filter: Prefilter<'a>,
    /// 2 / c_k: the size of a_k (eq. 8).
    amplitudes: Vec<f32>,
    /// The colours that differ.
    colors: usize,
    /// Σ w of each edge and colour.
    totals: Vec<f64>,
    /// Σ w x / Σ w of each edge and colour.
    means: Vec<f32>,
    /// Σ w x B_k / Σ w of each edge, colour and k.
    sums: Vec<f32>,
}

impl<'a> Prefiltered<'a> {
    /// Of a fan; light is 1 everywhere where there are no samples of it. M counts sines and cosines.
    pub fn new(filter: Prefilter<'a>, coefficients: usize, light: Option<&[[f32; 4]]>) -> Self {
        let is_grey = light.is_none() && filter.rates == [filter.rates[0]; 3];
        let mut prefiltered = Self {
            filter,
            amplitudes: (0..harmonics(coefficients)).map(|k| amplitude(k) as f32).collect(),
            colors: if is_grey { 1 } else { 3 },
            totals: Vec::new(),
            means: Vec::new(),
            sums: Vec::new(),
        };
        prefiltered.sum(light);
        prefiltered
    }

    /// Sums the weighted basis up along the samples, in f64.
    fn sum(&mut self, light: Option<&[[f32; 4]]>) {
        let (fan, colors, terms) = (self.filter.fan, self.colors, self.terms());
        let edges = fan.slopes.len() + 1;
        self.totals = vec![0.0; edges * colors];
        self.means = vec![0.0; edges * colors];
        self.sums = vec![0.0; edges * colors * terms];
        let (mut values, mut sums, mut shown) =
            ([0.0; MOST_COEFFICIENTS], vec![0.0; colors * terms], [0.0; 3]);
        let values = &mut values[..terms];
        for (sample, &slope) in fan.slopes.iter().enumerate() {
            basis(self.filter.place(slope), values);
            for color in 0..colors {
                let at = (sample + 1) * colors + color;
                let total = self.filter.total(color, fan.edge(sample + 1));
                let light = light.map_or(1.0, |light| f64::from(light[sample][color]));
                let part = (total - self.totals[at - colors]) * light;
                let scale = if total > 0.0 { 1.0 / total } else { 0.0 };
                shown[color] += part;
                self.totals[at] = total;
                self.means[at] = (shown[color] * scale) as f32;
                let sums = &mut sums[color * terms..][..terms];
                for ((mean, sum), value) in
                    self.sums[at * terms..][..terms].iter_mut().zip(sums).zip(&*values)
                {
                    *sum += part * f64::from(*value);
                    *mean = (*sum * scale) as f32;
                }
            }
        }
    }

    fn terms(&self) -> usize {
        2 * self.amplitudes.len()
    }

    /// What a ray of the fan shows of its samples.
    ///
    /// Cost    M products a colour
    pub fn of(&self, ray: &FanRay) -> [f64; 3] {
        let Some(lookup) = self.filter.lookup(ray) else { return [0.0; 3] };
        let mut coefficients = [0.0; MOST_COEFFICIENTS];
        let coefficients = &mut coefficients[..self.terms()];
        basis(lookup.place, coefficients);
        for (pair, amplitude) in coefficients.as_chunks_mut::<2>().0.iter_mut().zip(&self.amplitudes) {
            *pair = [amplitude * pair[1], -amplitude * pair[0]];
        }
        let visible = |color: usize| self.visible(color, &lookup, coefficients);
        match self.colors {
            1 => {
                let visible = visible(0);
                lookup.whole.map(|whole| whole * visible)
            }
            _ => std::array::from_fn(|c| lookup.whole[c] * visible(c)),
        }
    }

    /// Σ w x V / Σ w up to the end of a ray, between that of two edges as the weights are there; it cannot leave 0 to Σ w x / Σ w.
    fn visible(&self, color: usize, lookup: &PrefilterLookup, coefficients: &[f32]) -> f64 {
        let terms = coefficients.len();
        let upper = lookup.edge * self.colors + color;
        let lower = upper - self.colors;
        let far = lookup.far[color] as f32;
        let near = 1.0 - far;
        let sum = |at: usize| -> f32 {
            self.sums[at * terms..][..terms].iter().zip(coefficients).map(|(sum, a)| sum * a).sum()
        };
        let mean = near * self.means[lower] + far * self.means[upper];
        let visible = 0.5 * mean + near * sum(lower) + far * sum(upper);
        f64::from(visible.min(mean.max(0.0)).max(mean.min(0.0)))
    }
}

/// Pairs of a sine and a cosine.
pub fn harmonics(coefficients: usize) -> usize {
    coefficients.clamp(2, MOST_COEFFICIENTS) / 2
}

/// 2 / c_k.
fn amplitude(k: usize) -> f64 {
    2.0 / (PI * (2 * k + 1) as f64)
}

/// sin(c_k z) and cos(c_k z) in turns, c_k = π (2k − 1): B_k of eq. 8.
fn basis(z: f64, values: &mut [f32]) {
    let (mut sin, mut cos) = (PI * z).sin_cos();
    let (turn_sin, turn_cos) = (TAU * z).sin_cos();
    for pair in values.as_chunks_mut::<2>().0 {
        *pair = [sin as f32, cos as f32];
        (sin, cos) = (sin * turn_cos + cos * turn_sin, cos * turn_cos - sin * turn_sin);
    }
}

/// q of the ray whose distances are nearest to those of all others, by their largest ratio.
fn reference_q(rays: &[FanRay]) -> f64 {
    let qs = rays.iter().map(|ray| f64::from(ray.q));
    let [least, most] = qs.fold([f64::INFINITY, 0.0], |[a, b], q| [q.min(a), q.max(b)]);
    (least * most).sqrt()
}

/// The least angle of any ray, and how far the others reach from it.
fn angles_of(rays: &[FanRay]) -> [f64; 2] {
    let kappas = rays.iter().map(|ray| f64::from(ray.kappa).atan());
    let [least, most] = kappas.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], it| [it.min(a), it.max(b)]);
    // Rays that are all alike still need a range about them.
    let slack = (1e-4 - (most - least)).max(0.0);
    [least - 0.5 * slack, most - least + slack]
}
