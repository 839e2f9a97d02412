//! Fans: the rays of a slice over its samples of shadow and light, and the sweep that adds up what they show.

use std::ops::Range;

use glam::DVec2;
use rayon::prelude::*;

use super::super::Real;
use super::super::ViewRay;
use super::super::visibility::clip;
use super::expansion::Expansion;
use super::slices::{PolarRay, Slices};
use super::tree::{Sums, per_terms};
use crate::scene::Extent;
use crate::visibility::ShadowMap;

/// How finely rays are put into slices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EpipolarSettings {
    /// Slices a pixel of the picture's border; one is at most half a pixel away from any pixel.
    pub slices: f64,
    /// Samples a texel of the finer map, along a slice.
    pub density: f64,
    /// The most samples of a slice.
    pub samples: usize,
    /// Largest error of the expansion of transmittance.
    pub tolerance: f64,
    /// Whether a ray is between the two slices beside it, and not in the nearest one alone.
    pub between: bool,
}

impl EpipolarSettings {
    /// For rows that exact ones correct. Two slices a pixel, because texels that slices miss and exact rays meet are what corrections
    /// converge slowly in.
    pub const CORRECTED: Self =
        Self { slices: 2.0, density: 1.0, samples: 8192, tolerance: 1e-4, between: false };
}

impl Default for EpipolarSettings {
    fn default() -> Self {
        Self { slices: 1.0, density: 1.0, samples: 1024, tolerance: 2e-7, between: false }
    }
}

/// What is put into slices.
pub struct SlicedRays<'a> {
    /// Rays in the frame of the light, one a row.
    pub rays: &'a [ViewRay],
    /// Where nothing more is seen along a ray, in metres from the eye.
    pub reach: f64,
    /// The angle between the ray of a row and those of neighbouring pixels, in radians.
    pub angle: &'a (dyn Fn(usize) -> f64 + Sync),
    /// What is lit, along each ray.
    pub shadow_maps: Vec<&'a ShadowMap>,
    /// Which of them is that of a row.
    pub of_row: &'a (dyn Fn(usize) -> usize + Sync),
    /// Extinction a channel, in 1/metre.
    pub sigma_t: [f64; 3],
    /// The part of the light's plane over which light is sampled.
    pub region: Extent,
    /// The distance between texels of the finer map, in metres.
    pub pitch: f64,
}

/// The rays of one slice, sorted, over its samples.
///
/// Sample j is [first + j·step, first + (j + 1)·step] in the distance ξ from the line of the light through the eye. It is lit for the
/// rays with κ ≤ c_j, as its centre is. Rays are sorted by falling κ and samples by falling c, so the samples that light a ray are a prefix
/// of the one list, and those before its end a prefix in ξ.
#[derive(Debug, Clone)]
pub struct Fan {
    /// The line of the light through the eye, in the plane of the light, in metres.
    pub eye: DVec2,
    /// The direction of growing ξ there.
    pub direction: DVec2,
    /// ξ at which samples begin, in metres.
    pub first: f64,
    /// Width of a sample in metres.
    pub step: f64,
    /// c of each sample.
    pub slopes: Vec<f32>,
    /// The samples that light any ray, or in which one ends, in order; what follows counts these alone.
    needed: Vec<u16>,
    /// Those that light any ray, by falling c.
    order: Vec<u16>,
    /// Its rays among all.
    rays: Range<usize>,
    expansion: Expansion,
    /// The a_m of ray after ray.
    coefficients: Vec<f32>,
}

/// A ray of a fan.
#[derive(Debug, Clone, Copy, Default)]
pub struct FanRay {
    /// The number of its row.
    pub row: u32,
    /// κ = cot θ.
    pub kappa: f32,
    /// q = 1 / sin θ.
    pub q: f32,
    /// ξ where it ends, in metres.
    pub end: f32,
    /// The number of needed samples that it passes as a whole.
    whole: u32,
    /// The needed sample in which it ends; none where that is dark.
    last: u32,
    /// The weight of what it has of the next sample, cut where the ray leaves light or shadow.
    tail: [f32; 3],
    /// Scattering factor a channel, times the weight of the slice.
    scattering: [f32; 3],
}

/// No sample.
const NONE: u32 = u32::MAX;

impl FanRay {
    /// What the ray loses of light between two ξ, of 1 at the eye.
    #[inline]
    pub fn extinguished(&self, sigma_t: [f64; 3], from: f64, to: f64) -> [f64; 3] {
        let q = f64::from(self.q);
        let of = |sigma: f64| (-sigma * q * from).exp() * -(-sigma * q * (to - from)).exp_m1();
        match sigma_t == [sigma_t[0]; 3] {
            true => [of(sigma_t[0]); 3],
            false => sigma_t.map(of),
        }
    }

    /// Scattering factor a channel.
    pub fn scattering(&self) -> [f32; 3] {
        self.scattering
    }
}

/// Fans of all rays that show anything.
#[derive(Debug, Clone)]
pub struct Fans {
    fans: Vec<Fan>,
    rays: Vec<FanRay>,
    rows: usize,
    sigma_t: [f64; 3],
}

/// Samples that a fan has at least: rays near the light pass few texels.
const LEAST_SAMPLES: f64 = 8.0;
/// The most samples: they are numbered in 16 bits.
pub const MOST_SAMPLES: usize = 1 << 15;

impl Fans {
    /// Puts rays into slices and sorts them there.
    pub fn new(of: &SlicedRays, settings: EpipolarSettings) -> Self {
        let (groups, polar) = polar_rays(of);
        let slices = Slices::new(&polar, groups, of.angle, settings.slices);
        let (polar, begins) = in_order(&polar, &slices, settings.between);
        let mut rays = vec![FanRay::default(); polar.len()];
        let parts = parted(&mut rays, &begins).into_par_iter().zip(&begins[..begins.len() - 1]);
        let fan = |(rays, &begin): (&mut [FanRay], &usize)| {
            Fan::new(of, settings, &polar[begin..begin + rays.len()], (begin, rays))
        };
        let fans = parts.filter(|(rays, _)| !rays.is_empty()).map(fan).collect();
        Self { fans, rays, rows: of.rays.len(), sigma_t: of.sigma_t }
    }

    /// One a slice that has rays.
    pub fn fans(&self) -> &[Fan] {
        &self.fans
    }

    /// The rays of a fan, by falling κ.
    pub fn rays_of(&self, fan: &Fan) -> &[FanRay] {
        &self.rays[fan.rays.clone()]
    }

    /// All rays, fan by fan.
    pub fn rays(&self) -> &[FanRay] {
        &self.rays
    }

    /// The number of rows, those that show nothing among them.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Extinction a channel, in 1/metre.
    pub fn sigma_t(&self) -> [f64; 3] {
        self.sigma_t
    }

    /// All samples that are needed.
    pub fn samples(&self) -> usize {
        self.fans.iter().map(|fan| fan.needed.len()).sum()
    }

    /// The largest number of terms of any fan.
    pub fn most_terms(&self) -> usize {
        self.fans.iter().map(|fan| fan.expansion.terms()).max().unwrap_or(0)
    }

    /// Bytes that fans and rays take.
    pub fn bytes(&self) -> u64 {
        let fan = |fan: &Fan| {
            size_of::<Fan>()
                + 4 * (fan.slopes.len() + fan.coefficients.len())
                + 2 * (fan.order.len() + fan.needed.len())
        };
        (self.fans.iter().map(fan).sum::<usize>() + size_of_val(&self.rays[..])) as u64
    }

    /// E x̂: what every ray shows of the light at the [needed](Fan::needed) samples of its fan, which `light` puts there. The rays are those of
    /// [`Self::rays`], in their order.
    ///
    /// Cost    O(log n) a ray and a sample, times the terms of the expansion
    pub fn gather<X: Real>(&self, light: &(dyn Fn(&Fan, &mut [[X; 4]]) + Sync)) -> Vec<[X; 4]> {
        let mut shown = vec![[X::zero(); 4]; self.rays.len()];
        let parts: Vec<(&Fan, &mut [[X; 4]])> = self.with_parts(&mut shown);
        parts.into_par_iter().for_each_init(Sweep::default, |sweep, (fan, shown)| {
            let samples = sweep.samples(fan.needed.len());
            light(fan, samples);
            per_terms!(fan.expansion.terms(), M => fan.gather::<X, M>(self, sweep, shown));
        });
        shown
    }

    /// Eᵀ y: what arrives at the [needed](Fan::needed) samples of every fan from such numbers of its rays, in their order.
    pub fn scatter<X: Real>(&self, y: &(dyn Fn(&FanRay) -> [X; 3] + Sync)) -> Vec<Vec<[X; 4]>> {
        let scatter = |sweep: &mut Sweep<X>, fan: &Fan| {
            sweep.samples(fan.needed.len());
            per_terms!(fan.expansion.terms(), M => fan.scatter::<X, M>(self, sweep, y));
            sweep.samples.clone()
        };
        self.fans.par_iter().map_init(Sweep::default, scatter).collect()
    }

    /// Adds what all rays show of light before the first sample of their fan and behind the last one.
    pub fn add_beside(&self, light: [f32; 3], shown: &mut [[f32; 4]]) {
        self.with_parts(shown).into_par_iter().for_each(|(fan, shown)| {
            let [first, last] = [fan.first, fan.last()];
            for (ray, shown) in self.rays_of(fan).iter().zip(shown) {
                let end = f64::from(ray.end);
                let before = ray.extinguished(self.sigma_t, 0.0, first.min(end));
                let behind = if end > last { ray.extinguished(self.sigma_t, last, end) } else { [0.0; 3] };
                let weight = |c: usize| ray.scattering[c] * (before[c] + behind[c]) as f32;
                (0..3).for_each(|c| shown[c] += weight(c) * light[c]);
            }
        });
    }

    /// Pieces of what there is one of a ray, fan by fan.
    fn with_parts<'a, T>(&'a self, values: &'a mut [T]) -> Vec<(&'a Fan, &'a mut [T])> {
        let mut rest = values;
        let part = |fan: &'a Fan| {
            let (part, behind) = std::mem::take(&mut rest).split_at_mut(fan.rays.len());
            rest = behind;
            (fan, part)
        };
        self.fans.iter().map(part).collect()
    }
}

/// What sweeps need room for.
#[derive(Default)]
struct Sweep<X> {
    /// Light at the samples.
    samples: Vec<[X; 4]>,
    /// The same times what the terms of the expansion are there.
    terms: Vec<[X; 4]>,
    sums: Vec<[X; 4]>,
}

impl<X: Real> Sweep<X> {
    fn samples(&mut self, count: usize) -> &mut [[X; 4]] {
        self.samples.clear();
        self.samples.resize(count, [X::zero(); 4]);
        &mut self.samples
    }
}

impl Fan {
    fn new(
        of: &SlicedRays,
        settings: EpipolarSettings,
        polar: &[PolarRay],
        (begin, rays): (usize, &mut [FanRay]),
    ) -> Self {
        let range = |value: fn(&PolarRay) -> f32| {
            let values = polar.iter().map(value);
            values
                .fold([f32::INFINITY, f32::NEG_INFINITY], |[a, b], it| [a.min(it), b.max(it)])
                .map(f64::from)
        };
        let ([low, high], q, [_, end]) = (range(|ray| ray.phi), range(|ray| ray.q), range(|ray| ray.end));
        let direction = DVec2::from_angle(0.5 * (low + high));
        let first_ray = &of.rays[polar[0].row as usize];
        let eye = DVec2::new(first_ray.origin.x, first_ray.origin.y);
        let [first, last] = clipped(eye, direction, of.region, end).unwrap_or([0.0; 2]);
        let most = settings.samples.min(MOST_SAMPLES);
        let samples =
            ((settings.density * (last - first) / of.pitch).ceil().max(LEAST_SAMPLES) as usize).min(most);
        let step = (last - first) / samples as f64;
        let samples = if step > 0.0 { samples } else { 0 };
        let map = of.shadow_maps[(of.of_row)(polar[0].row as usize)];
        let height = first_ray.origin.z;
        let slope = |j: usize| {
            let xi = first + (j as f64 + 0.5) * step;
            ((depth_at(map, eye + xi * direction) - height) / xi) as f32
        };
        let slopes: Vec<f32> = (0..samples).map(slope).collect();
        let sigma = of.sigma_t.iter().copied().fold(0.0, f64::max);
        let expansion = Expansion::new(q, sigma * last, settings.tolerance);
        let mut fan = Self {
            eye,
            direction,
            first,
            step,
            slopes,
            needed: Vec::new(),
            order: Vec::new(),
            rays: begin..begin + rays.len(),
            coefficients: Vec::with_capacity(rays.len() * expansion.terms()),
            expansion,
        };
        let mut polar = polar.to_vec();
        polar.sort_unstable_by(|a, b| b.kappa.total_cmp(&a.kappa).then(a.row.cmp(&b.row)));
        for (polar, ray) in polar.iter().zip(&mut *rays) {
            *ray = fan.ray(of, polar);
            fan.expansion.coefficients(f64::from(polar.q), |a| fan.coefficients.push(a as f32));
        }
        fan.keep_what_is_needed(rays);
        fan
    }

    /// Leaves out the samples that light no ray; `rays` are by falling κ, and count all samples so far.
    fn keep_what_is_needed(&mut self, rays: &mut [FanRay]) {
        let least = rays.last().map_or(f32::INFINITY, |ray| ray.kappa);
        let farthest = rays.iter().map(|ray| ray.whole as usize).max().unwrap_or(0);
        let mut is_needed: Vec<bool> = self.slopes.iter().map(|&slope| slope >= least).collect();
        is_needed[farthest.min(self.slopes.len())..].fill(false);
        rays.iter().filter(|ray| ray.last != NONE).for_each(|ray| is_needed[ray.last as usize] = true);
        let mut numbers = Vec::with_capacity(is_needed.len() + 1);
        for (sample, &is_needed) in is_needed.iter().enumerate() {
            numbers.push(self.needed.len() as u32);
            if is_needed {
                self.needed.push(sample as u16);
            }
        }
        numbers.push(self.needed.len() as u32);
        for ray in rays {
            ray.whole = numbers[ray.whole as usize];
            ray.last = if ray.last == NONE { NONE } else { numbers[ray.last as usize] };
        }
        self.order = (0..self.needed.len() as u16).filter(|&needed| self.slope(needed) >= least).collect();
        let mut order = std::mem::take(&mut self.order);
        order.sort_unstable_by(|&a, &b| self.slope(b).total_cmp(&self.slope(a)));
        self.order = order;
    }

    fn ray(&self, of: &SlicedRays, polar: &PolarRay) -> FanRay {
        let &PolarRay { row, kappa, q, end, .. } = polar;
        let passed = ((f64::from(end) - self.first) / self.step).max(0.0);
        let whole = if self.slopes.is_empty() { 0 } else { (passed as usize).min(self.slopes.len()) };
        let tail = match self.slopes.get(whole) {
            Some(&slope) => self.tail(of.sigma_t, polar, whole, slope),
            None => [0.0; 3],
        };
        let last = if tail == [0.0; 3] { NONE } else { whole as u32 };
        let scattering = of.rays[row as usize].scattering.map(|it| (it * f64::from(polar.share)) as f32);
        FanRay { row, kappa, q, end, whole: whole as u32, last, tail, scattering }
    }

    /// The weight of the part of a sample up to the end of a ray, cut where it crosses the depth of the sample.
    fn tail(&self, sigma_t: [f64; 3], polar: &PolarRay, whole: usize, slope: f32) -> [f32; 3] {
        let begin = self.first + whole as f64 * self.step;
        let (q, kappa, end) = (f64::from(polar.q), f64::from(polar.kappa), f64::from(polar.end));
        let depth = f64::from(slope) * (begin + 0.5 * self.step);
        let crossing = if kappa == 0.0 { f64::INFINITY } else { depth / kappa };
        // Lit where κ ξ ≤ depth.
        let [from, to] = match kappa > 0.0 {
            _ if depth == f64::INFINITY => [begin, end],
            true => [begin, end.min(crossing)],
            false if kappa < 0.0 => [begin.max(crossing), end],
            false => [begin, if depth >= 0.0 { end } else { begin }],
        };
        if to <= from {
            return [0.0; 3];
        }
        let of = |sigma: f64| ((-sigma * q * from).exp() * -(-sigma * q * (to - from)).exp_m1()) as f32;
        match sigma_t == [sigma_t[0]; 3] {
            true => [of(sigma_t[0]); 3],
            false => sigma_t.map(of),
        }
    }

    /// Of each needed sample and term in turn the weight `e^{−σ q_m a} − e^{−σ q_m b}` between its edges a and b.
    fn weights<const M: usize>(&self, sigma_t: [f64; 3], mut visit: impl FnMut(usize, &[[f64; 3]; M])) {
        let nodes = self.expansion.nodes();
        let of = |value: &dyn Fn(f64, f64) -> f64| -> [[f64; 3]; M] {
            std::array::from_fn(|m| sigma_t.map(|sigma| value(sigma, nodes[m])))
        };
        let ratios = of(&|sigma, q| (-sigma * q * self.step).exp());
        let mut weights =
            of(&|sigma, q| (-sigma * q * self.first).exp() * -(-sigma * q * self.step).exp_m1());
        let mut at = 0;
        for (number, &sample) in self.needed.iter().enumerate() {
            for _ in at..sample {
                for (weight, ratio) in weights.iter_mut().zip(&ratios) {
                    (0..3).for_each(|c| weight[c] *= ratio[c]);
                }
            }
            at = sample;
            visit(number, &weights);
        }
    }

    /// Sweeps κ downwards: samples switch on, rays ask for the sum of those before their end.
    fn gather<X: Real, const M: usize>(&self, of: &Fans, sweep: &mut Sweep<X>, shown: &mut [[X; 4]]) {
        let Sweep { samples, terms, sums } = sweep;
        terms.clear();
        self.weights::<M>(of.sigma_t, |j, weights| {
            let light = samples[j];
            let times = |weight: &[f64; 3]| {
                [
                    X::of(weight[0]) * light[0],
                    X::of(weight[1]) * light[1],
                    X::of(weight[2]) * light[2],
                    X::zero(),
                ]
            };
            terms.extend(weights.iter().map(times));
        });
        let mut sums = Sums::<X, M>::new(sums, samples.len());
        let (mut next, terms) = (0, terms.as_chunks::<M>().0);
        for ((ray, shown), a) in of.rays_of(self).iter().zip(shown).zip(self.coefficients.as_chunks::<M>().0)
        {
            while let Some(&j) = self.order.get(next).filter(|&&j| self.slope(j) >= ray.kappa) {
                sums.add(usize::from(j), &terms[usize::from(j)]);
                next += 1;
            }
            let mut sum = [X::zero(); 4];
            for (term, a) in sums.before(ray.whole as usize).iter().zip(a) {
                let a = X::of(f64::from(*a));
                (0..4).for_each(|c| sum[c] += a * term[c]);
            }
            let last = samples.get(ray.last as usize).copied().unwrap_or_default();
            for c in 0..3 {
                let tail = X::of(f64::from(ray.tail[c])) * last[c];
                shown[c] = X::of(f64::from(ray.scattering[c])) * (sum[c] + tail);
            }
        }
    }

    /// The transpose: the same sweep backwards, in which rays add to the samples before their end, and samples ask when they switch off.
    fn scatter<X: Real, const M: usize>(
        &self,
        of: &Fans,
        sweep: &mut Sweep<X>,
        y: &(dyn Fn(&FanRay) -> [X; 3] + Sync),
    ) {
        let Sweep { samples, terms, sums } = sweep;
        terms.clear();
        terms.resize(samples.len() * M, [X::zero(); 4]);
        let mut sums = Sums::<X, M>::new(sums, samples.len());
        let (mut lit, terms) = (self.order.len(), terms.as_chunks_mut::<M>().0);
        let rays = of.rays_of(self).iter().zip(self.coefficients.as_chunks::<M>().0);
        for (ray, a) in rays.rev() {
            while let Some(&j) = self.order[..lit].last().filter(|&&j| self.slope(j) < ray.kappa) {
                terms[usize::from(j)] = sums.behind(usize::from(j));
                lit -= 1;
            }
            let y = y(ray);
            let y: [X; 3] = std::array::from_fn(|c| X::of(f64::from(ray.scattering[c])) * y[c]);
            sums.add_before(
                ray.whole as usize,
                &std::array::from_fn(|m| {
                    let a = X::of(f64::from(a[m]));
                    [a * y[0], a * y[1], a * y[2], X::zero()]
                }),
            );
            if let Some(sample) = samples.get_mut(ray.last as usize) {
                (0..3).for_each(|c| sample[c] += X::of(f64::from(ray.tail[c])) * y[c]);
            }
        }
        for &j in &self.order[..lit] {
            terms[usize::from(j)] = sums.behind(usize::from(j));
        }
        self.weights::<M>(of.sigma_t, |j, weights| {
            for (weight, term) in weights.iter().zip(&terms[j]) {
                (0..3).for_each(|c| samples[j][c] += X::of(weight[c]) * term[c]);
            }
        });
    }

    /// The weights of the samples that light its ray number `ray`, in their order, and of the sample in which it ends.
    pub(super) fn walk(&self, of: &Fans, ray: usize, mut visit: impl FnMut(usize, [f64; 3])) {
        let terms = self.expansion.terms();
        let a = &self.coefficients[ray * terms..][..terms];
        let ray = &of.rays_of(self)[ray];
        let (whole, last) = (ray.whole as usize, ray.last as usize);
        let scattering = ray.scattering.map(f64::from);
        per_terms!(terms, M => self.weights::<M>(of.sigma_t, |j, weights| {
            if j < whole && ray.kappa <= self.slope(j as u16) {
                let sum = |c: usize| weights.iter().zip(a).map(|(weight, a)| f64::from(*a) * weight[c]).sum::<f64>();
                visit(j, std::array::from_fn(|c| scattering[c] * sum(c)));
            } else if j == last {
                visit(j, std::array::from_fn(|c| scattering[c] * f64::from(ray.tail[c])));
            }
        }));
    }

    /// The samples that light any of its rays, or in which one ends, in order.
    pub fn needed(&self) -> &[u16] {
        &self.needed
    }

    /// c of a needed sample.
    #[inline(always)]
    fn slope(&self, needed: u16) -> f32 {
        self.slopes[usize::from(self.needed[usize::from(needed)])]
    }

    /// ξ in the middle of a sample, in metres.
    #[inline(always)]
    pub fn middle(&self, sample: usize) -> f64 {
        self.first + (sample as f64 + 0.5) * self.step
    }

    /// A place of the slice in the plane of the light, in metres.
    #[inline(always)]
    pub fn at(&self, xi: f64) -> DVec2 {
        self.eye + xi * self.direction
    }

    /// From which ξ to which its samples are in a part of the light's plane.
    pub(super) fn across(&self, region: Extent) -> Option<[f64; 2]> {
        clipped(self.eye, self.direction, region, self.last())
    }

    /// Where its rays begin among all.
    pub(super) fn begin(&self) -> usize {
        self.rays.start
    }

    /// ξ where a sample begins, in metres.
    #[inline(always)]
    pub fn edge(&self, sample: usize) -> f64 {
        self.first + sample as f64 * self.step
    }

    /// The number of samples that begin before a ξ.
    pub(super) fn samples_before(&self, xi: f64) -> usize {
        let passed = (xi - self.first) / self.step;
        if passed > 0.0 { (passed.ceil() as usize).min(self.slopes.len()) } else { 0 }
    }

    /// ξ behind its last sample, in metres.
    pub fn last(&self) -> f64 {
        self.first + self.slopes.len() as f64 * self.step
    }
}

/// Depth of the first surface in the frame of the light, in metres; infinite where nothing blocks it.
fn depth_at(map: &ShadowMap, place: DVec2) -> f64 {
    let (texel, size) = (map.grid().grid_from_light(place).floor(), map.grid().size);
    let is_inside = |at: f64, side: usize| at >= 0.0 && at < side as f64;
    match is_inside(texel.x, size[0]) && is_inside(texel.y, size[1]) {
        true => map.depth_origin() + f64::from(map.depth(texel.x as usize, texel.y as usize)),
        false => f64::INFINITY,
    }
}

/// The part of [0, end] in which a line of the light's plane is inside a region.
fn clipped(eye: DVec2, direction: DVec2, region: Extent, end: f64) -> Option<[f64; 2]> {
    let size = region.max - region.min;
    clip((eye - region.min).to_array(), direction.to_array(), size.to_array(), 0.0, end)
}

/// The number of eyes under a sun each, and the rays that show anything.
fn polar_rays(of: &SlicedRays) -> (usize, Vec<PolarRay>) {
    let key = |row: usize| (of.rays[row].origin.to_array().map(f64::to_bits), (of.of_row)(row));
    let mut groups = std::collections::BTreeMap::new();
    let mut of_rows: Vec<u32> = Vec::with_capacity(of.rays.len());
    let mut before = None;
    for row in 0..of.rays.len() {
        let key = key(row);
        let group = match before {
            Some((same, group)) if same == key => group,
            _ => {
                let count = groups.len() as u32;
                *groups.entry(key).or_insert(count)
            }
        };
        before = Some((key, group));
        of_rows.push(group);
    }
    let ray = |(row, ray): (usize, &ViewRay)| PolarRay::new(row, ray, ray.length.min(of.reach), of_rows[row]);
    (groups.len(), of.rays.par_iter().enumerate().filter_map(ray).collect())
}

/// Rays slice by slice, and where those of each slice begin, with the end of the last.
fn in_order(rays: &[PolarRay], slices: &Slices, between: bool) -> (Vec<PolarRay>, Vec<usize>) {
    let of: Vec<u32> = rays.par_iter().map(|ray| slices.of(ray) as u32).collect();
    let beside: Vec<Option<(u32, f32)>> = match between {
        true => {
            let middles = middles(rays, &of, slices.count());
            let beside = |(ray, &slice): (&PolarRay, &u32)| slices.beside(ray, slice, &middles);
            rays.par_iter().zip(&of).map(beside).collect()
        }
        false => Vec::new(),
    };
    let mut begins = vec![0_usize; slices.count() + 1];
    let slices_of = || of.iter().copied().chain(beside.iter().flatten().map(|(slice, _)| *slice));
    slices_of().for_each(|slice| begins[slice as usize + 1] += 1);
    (1..begins.len()).for_each(|slice| begins[slice] += begins[slice - 1]);
    let (mut next, mut order) = (begins.clone(), vec![(0_u32, 0.0_f32); begins[begins.len() - 1]]);
    let mut put = |slice: u32, index: usize, share: f32| {
        order[next[slice as usize]] = (index as u32, share);
        next[slice as usize] += 1;
    };
    for (index, &slice) in of.iter().enumerate() {
        let other = beside.get(index).copied().flatten();
        put(slice, index, 1.0 - other.map_or(0.0, |(_, share)| share));
        if let Some((other, share)) = other {
            put(other, index, share);
        }
    }
    let ray = |&(index, share): &(u32, f32)| PolarRay { share, ..rays[index as usize] };
    (order.par_iter().map(ray).collect(), begins)
}

/// The angle about the light in the middle of the rays of each slice.
fn middles(rays: &[PolarRay], of: &[u32], slices: usize) -> Vec<f32> {
    let mut ranges = vec![[f32::INFINITY, f32::NEG_INFINITY]; slices];
    for (ray, &slice) in rays.iter().zip(of) {
        let [low, high] = &mut ranges[slice as usize];
        (*low, *high) = (low.min(ray.phi), high.max(ray.phi));
    }
    ranges.into_iter().map(|[low, high]| 0.5 * (low + high)).collect()
}

/// The pieces between such places.
fn parted<'a, T>(values: &'a mut [T], begins: &[usize]) -> Vec<&'a mut [T]> {
    let mut rest = values;
    let part = |ends: &[usize]| {
        let (part, behind) = std::mem::take(&mut rest).split_at_mut(ends[1] - ends[0]);
        rest = behind;
        part
    };
    begins.windows(2).map(part).collect()
}
