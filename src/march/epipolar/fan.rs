//! A fan: the rays of a slice over its samples of shadow and light, and the sweep that adds up what they show.

use std::ops::Range;

use glam::DVec2;

use super::super::Real;
use super::super::visibility::clip;
use super::edges::Edges;
use super::expansion::Expansion;
use super::sliced_rays::{EpipolarSettings, SlicedRays};
use super::slices::PolarRay;
use super::sums::{BLOCK, Room, Sums, per_terms};
use crate::scene::Extent;
use crate::visibility::ShadowMap;

/// Samples that a fan has at least: rays near the light pass few texels.
const LEAST_SAMPLES: f64 = 8.0;
/// The most samples: they are numbered in 16 bits.
pub const MOST_SAMPLES: usize = 1 << 15;

/// The rays of one slice, sorted, over its samples.
///
/// Samples lie side by side in the distance ξ from the line of the light through the eye. One is lit for the
/// rays with κ ≤ c_j, as its centre is. Rays are sorted by falling κ and samples by falling c, so the samples that light a ray are a prefix
/// of the one list, and those before its end a prefix in ξ.
#[derive(Debug, Clone)]
pub struct Fan {
    /// The line of the light through the eye, in the plane of the light, in metres.
    pub eye: DVec2,
    /// The direction of growing ξ there.
    pub direction: DVec2,
    /// Where its samples lie.
    pub edges: Edges,
    /// c of each sample.
    pub slopes: Vec<f32>,
    /// The samples that light any ray, or in which one ends, in order; what follows counts these alone.
    needed: Vec<u16>,
    /// Those that light any ray, by falling c.
    order: Vec<u16>,
    /// Its rays among all.
    pub(super) rays: Range<usize>,
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
    pub(super) scattering: [f32; 3],
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

    /// The number of needed samples that it passes as a whole.
    pub fn whole(&self) -> u32 {
        self.whole
    }

    /// The needed sample in which it ends, and what it weighs there, a channel.
    pub fn tail(&self) -> Option<(usize, [f32; 3])> {
        (self.last != NONE).then_some((self.last as usize, self.tail))
    }
}

/// The rays of a fan, by falling κ, and the extinction that all share.
#[derive(Clone, Copy)]
pub(super) struct FanRays<'a> {
    pub(super) rays: &'a [FanRay],
    pub(super) sigma_t: [f64; 3],
}

/// What sweeps need room for.
#[derive(Default)]
pub(super) struct Sweep<X> {
    /// Light at the samples.
    pub(super) samples: Vec<[X; 4]>,
    /// The same times what the terms of the expansion are there.
    terms: Vec<[X; 4]>,
    sums: Room<X>,
}

impl<X: Real> Sweep<X> {
    pub(super) fn samples(&mut self, count: usize) -> &mut [[X; 4]] {
        self.samples.clear();
        self.samples.resize(count, [X::zero(); 4]);
        &mut self.samples
    }
}

impl Fan {
    /// Of the rays of one slice, of which there are some; `rays` are their places among all, from the first on.
    pub(super) fn new(
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
        let range = clipped(eye, direction, of.region, end).unwrap_or([0.0; 2]);
        let length = range[1] - range[0];
        let most = settings.samples.min(MOST_SAMPLES);
        let samples = ((settings.density * length / of.pitch).ceil().max(LEAST_SAMPLES) as usize).min(most);
        let samples = if length > 0.0 { samples } else { 0 };
        let edges = Edges::new(range, samples, settings.spacing);
        let map = of.shadow_maps[(of.of_row)(polar[0].row as usize)];
        let height = first_ray.origin.z;
        let slope = |j: usize| {
            let xi = edges.middle(j);
            ((depth_at(map, eye + xi * direction) - height) / xi) as f32
        };
        let slopes: Vec<f32> = (0..samples).map(slope).collect();
        let sigma = of.sigma_t.iter().copied().fold(0.0, f64::max);
        let expansion = Expansion::new(q, sigma * range[1], settings.tolerance);
        let mut fan = Self {
            eye,
            direction,
            edges,
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
        let passed = self.edges.place(f64::from(end)).max(0.0);
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
        let begin = self.edges.edge(whole);
        let (q, kappa, end) = (f64::from(polar.q), f64::from(polar.kappa), f64::from(polar.end));
        let depth = f64::from(slope) * self.edges.middle(whole);
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
    fn weights<X: Real, const M: usize>(
        &self,
        sigma_t: [f64; 3],
        mut visit: impl FnMut(usize, &[[X; 4]; M]),
    ) {
        let nodes = self.expansion.nodes();
        let of = |value: &dyn Fn(f64, f64) -> f64| -> [[f64; 4]; M] {
            std::array::from_fn(|m| {
                let [r, g, b] = sigma_t.map(|sigma| value(sigma, nodes[m]));
                [r, g, b, 0.0]
            })
        };
        let between =
            |a: f64, b: f64| of(&|sigma, q| (-sigma * q * a).exp() * -(-sigma * q * (b - a)).exp_m1());
        let single = |values: &[[f64; 4]; M]| values.map(|value| value.map(X::of));
        let Some(step) = self.edges.step() else {
            for (number, &sample) in self.needed.iter().enumerate() {
                let [a, b] = [0, 1].map(|next| self.edges.edge(usize::from(sample) + next));
                visit(number, &single(&between(a, b)));
            }
            return;
        };
        // From one even sample to the next all weights fall by the same part: what those of a block are of its first.
        let ratio = of(&|sigma, q| (-sigma * q * step).exp());
        let mut part = [[1.0; 4]; M];
        let parts: [_; BLOCK] = std::array::from_fn(|_| {
            let of_sample = single(&part);
            part = times(&part, &ratio);
            of_sample
        });
        let (mut block, mut weights) = (0, between(self.edges.first, self.edges.first + step));
        let mut first = single(&weights);
        for (number, &sample) in self.needed.iter().enumerate() {
            let sample = usize::from(sample);
            if block < sample / BLOCK {
                for _ in block..sample / BLOCK {
                    weights = times(&weights, &part);
                }
                (block, first) = (sample / BLOCK, single(&weights));
            }
            visit(number, &times(&first, &parts[sample % BLOCK]));
        }
    }

    /// Sweeps κ downwards: samples switch on, rays ask for the sum of those before their end.
    pub(super) fn gather<X: Real>(&self, of: FanRays, sweep: &mut Sweep<X>, shown: &mut [[X; 4]]) {
        per_terms!(self.expansion.terms(), M => self.gather_terms::<X, M>(of, sweep, shown));
    }

    fn gather_terms<X: Real, const M: usize>(&self, of: FanRays, sweep: &mut Sweep<X>, shown: &mut [[X; 4]]) {
        let Sweep { samples, terms, sums } = sweep;
        terms.clear();
        self.weights::<X, M>(of.sigma_t, |j, weights| terms.extend(times(weights, &[samples[j]; M])));
        let (mut next, mut sums) = (0, Sums::<X, M>::new(terms, sums));
        for ((ray, shown), a) in of.rays.iter().zip(shown).zip(self.coefficients.as_chunks::<M>().0) {
            while let Some(&j) = self.order.get(next).filter(|&&j| self.slope(j) >= ray.kappa) {
                sums.switch_on(usize::from(j));
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
    pub(super) fn scatter<X: Real>(
        &self,
        of: FanRays,
        sweep: &mut Sweep<X>,
        y: &(dyn Fn(&FanRay) -> [X; 3] + Sync),
    ) {
        per_terms!(self.expansion.terms(), M => self.scatter_terms::<X, M>(of, sweep, y));
    }

    fn scatter_terms<X: Real, const M: usize>(
        &self,
        of: FanRays,
        sweep: &mut Sweep<X>,
        y: &(dyn Fn(&FanRay) -> [X; 3] + Sync),
    ) {
        let Sweep { samples, terms, sums } = sweep;
        terms.clear();
        terms.resize(samples.len() * M, [X::zero(); 4]);
        let (mut lit, mut sums) = (self.order.len(), Sums::<X, M>::new(terms, sums));
        sums.begin(&self.order);
        let rays = of.rays.iter().zip(self.coefficients.as_chunks::<M>().0);
        for (ray, a) in rays.rev() {
            while let Some(&j) = self.order[..lit].last().filter(|&&j| self.slope(j) < ray.kappa) {
                sums.switch_off(usize::from(j));
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
        self.order[..lit].iter().for_each(|&j| sums.switch_off(usize::from(j)));
        let terms = terms.as_chunks::<M>().0;
        self.weights::<X, M>(of.sigma_t, |j, weights| {
            for arrived in times(weights, &terms[j]) {
                (0..4).for_each(|c| samples[j][c] += arrived[c]);
            }
        });
    }

    /// The weights of the samples that light its ray number `ray`, in their order, and of the sample in which it ends.
    pub(super) fn walk(&self, of: FanRays, ray: usize, mut visit: impl FnMut(usize, [f64; 3])) {
        let (terms, a) = (self.expansion.terms(), self.coefficients(ray));
        let ray = &of.rays[ray];
        let (whole, last) = (ray.whole as usize, ray.last as usize);
        let scattering = ray.scattering.map(f64::from);
        per_terms!(terms, M => self.weights::<f64, M>(of.sigma_t, |j, weights| {
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

    /// The needed samples that light any ray, by falling c.
    pub fn order(&self) -> &[u16] {
        &self.order
    }

    /// How many of [`Self::order`] light a ray.
    pub fn lit(&self, ray: &FanRay) -> usize {
        self.order.partition_point(|&needed| self.slope(needed) >= ray.kappa)
    }

    /// Of a ray, the number of which counts those of the fan, the factor of each term of the expansion.
    pub fn coefficients(&self, ray: usize) -> &[f32] {
        &self.coefficients[ray * self.terms()..][..self.terms()]
    }

    /// The number of its rays.
    pub fn ray_count(&self) -> usize {
        self.rays.len()
    }

    /// q of each term of the expansion.
    pub fn nodes(&self) -> &[f64] {
        self.expansion.nodes()
    }

    /// c of a needed sample.
    #[inline(always)]
    fn slope(&self, needed: u16) -> f32 {
        self.slopes[usize::from(self.needed[usize::from(needed)])]
    }

    /// ξ in the middle of a sample, in metres.
    #[inline(always)]
    pub fn middle(&self, sample: usize) -> f64 {
        self.edges.middle(sample)
    }

    /// From which ξ to which its samples are in a part of the light's plane.
    pub(super) fn across(&self, region: Extent) -> Option<[f64; 2]> {
        clipped(self.eye, self.direction, region, self.last())
    }

    /// The number of terms of its expansion.
    pub(super) fn terms(&self) -> usize {
        self.expansion.terms()
    }

    /// Bytes that it takes, its rays apart.
    pub(super) fn bytes(&self) -> usize {
        size_of::<Self>()
            + 4 * (self.slopes.len() + self.coefficients.len())
            + 2 * (self.order.len() + self.needed.len())
    }

    /// ξ where a sample begins, in metres.
    #[inline(always)]
    pub fn edge(&self, sample: usize) -> f64 {
        self.edges.edge(sample)
    }

    /// The number of samples that begin before a ξ.
    pub(super) fn samples_before(&self, xi: f64) -> usize {
        let passed = self.edges.place(xi).ceil() as usize;
        if xi > self.edges.first {
            passed.clamp(1, self.slopes.len().max(1)).min(self.slopes.len())
        } else {
            0
        }
    }

    /// ξ behind its last sample, in metres.
    pub fn last(&self) -> f64 {
        self.edges.last
    }
}

#[inline(always)]
fn times<X: Real, const M: usize>(a: &[[X; 4]; M], b: &[[X; 4]; M]) -> [[X; 4]; M] {
    std::array::from_fn(|m| std::array::from_fn(|c| a[m][c] * b[m][c]))
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
