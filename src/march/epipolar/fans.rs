//! The fans of all rays: who is in which, and what is summed over all of them.

use rayon::prelude::*;

use super::super::{Real, ViewRay};
use super::edges::Spacing;
use super::fan::{Fan, FanRay, FanRays, Sweep};
use super::sliced_rays::{EpipolarSettings, SlicedRays};
use super::slices::{PolarRay, Slices};

/// Fans from which light is scattered before it is spread over texels: their samples stay in the cache.
const FANS_AT_ONCE: usize = 128;

/// What arrives at the [needed](Fan::needed) samples of a fan.
type Arrived<X> = Vec<[X; 4]>;

/// Takes some fans with what arrives at each.
pub(super) type Visit<'a, X> = &'a mut dyn FnMut(&[Fan], &[Arrived<X>]);

/// Fans of all rays that show anything.
#[derive(Debug, Clone)]
pub struct Fans {
    fans: Vec<Fan>,
    rays: Vec<FanRay>,
    rows: usize,
    sigma_t: [f64; 3],
}

impl Fans {
    /// Puts rays into slices and sorts them there.
    pub fn new(of: &SlicedRays, settings: EpipolarSettings) -> Self {
        let (groups, polar) = polar_rays(of);
        let slices = Slices::new(&polar, groups, of.angle, settings.slices);
        let even = match settings.spacing {
            Spacing::Even => vec![true; groups],
            Spacing::Projective => all_around(&polar, groups),
        };
        let (polar, begins) = in_order(&polar, &slices, settings.between);
        let mut rays = vec![FanRay::default(); polar.len()];
        let parts = parted(&mut rays, &begins).into_par_iter().zip(&begins[..begins.len() - 1]);
        let fan = |(rays, &begin): (&mut [FanRay], &usize)| {
            let polar = &polar[begin..begin + rays.len()];
            let spacing = if even[polar[0].group()] { Spacing::Even } else { settings.spacing };
            Fan::new(of, EpipolarSettings { spacing, ..settings }, polar, (begin, rays))
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

    fn of(&self, fan: &Fan) -> FanRays<'_> {
        FanRays { rays: self.rays_of(fan), sigma_t: self.sigma_t }
    }

    /// Visits the needed samples that a ray weighs, the ray being that with such a place among all.
    pub(super) fn walk(&self, place: usize, mut visit: impl FnMut(&Fan, usize, [f64; 3])) {
        let fan = &self.fans[self.fans.partition_point(|fan| fan.rays.start <= place) - 1];
        fan.walk(self.of(fan), place - fan.rays.start, |needed, weight| visit(fan, needed, weight));
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
        self.fans.iter().map(|fan| fan.needed().len()).sum()
    }

    /// The largest number of terms of any fan.
    pub fn most_terms(&self) -> usize {
        self.fans.iter().map(Fan::terms).max().unwrap_or(0)
    }

    /// Bytes that fans and rays take.
    pub fn bytes(&self) -> u64 {
        (self.fans.iter().map(Fan::bytes).sum::<usize>() + size_of_val(&self.rays[..])) as u64
    }

    /// E x̂: what every ray shows of the light at the [needed](Fan::needed) samples of its fan, which `light` puts there. The rays are those of
    /// [`Self::rays`], in their order.
    ///
    /// Cost    that of `sums.rs` a ray and a sample, times the terms of the expansion
    pub fn gather<X: Real>(&self, light: &(dyn Fn(&Fan, &mut [[X; 4]]) + Sync)) -> Vec<[X; 4]> {
        let mut shown = vec![[X::zero(); 4]; self.rays.len()];
        let parts: Vec<(&Fan, &mut [[X; 4]])> = self.with_parts(&mut shown);
        parts.into_par_iter().for_each_init(Sweep::default, |sweep, (fan, shown)| {
            let samples = sweep.samples(fan.needed().len());
            light(fan, samples);
            fan.gather(self.of(fan), sweep, shown);
        });
        shown
    }

    /// Eᵀ y: visits fans, some at a time and in their order, with what arrives at the samples of each.
    pub(super) fn scatter<X: Real>(&self, y: &(dyn Fn(&FanRay) -> [X; 3] + Sync), visit: Visit<X>) {
        let mut arrived: Vec<Arrived<X>> = vec![Vec::new(); FANS_AT_ONCE.min(self.fans.len())];
        for fans in self.fans.chunks(FANS_AT_ONCE) {
            let scatter = |sweep: &mut Sweep<X>, (fan, arrived): (&Fan, &mut Arrived<X>)| {
                std::mem::swap(&mut sweep.samples, arrived);
                sweep.samples(fan.needed().len());
                fan.scatter(self.of(fan), sweep, y);
                std::mem::swap(&mut sweep.samples, arrived);
            };
            fans.par_iter().zip(&mut arrived).for_each_init(Sweep::default, scatter);
            visit(fans, &arrived[..fans.len()]);
        }
    }

    /// The most samples that [`Self::scatter`] has at a time.
    pub(super) fn samples_at_once(&self) -> usize {
        let samples = |fans: &[Fan]| fans.iter().map(|fan| fan.needed().len()).sum();
        self.fans.chunks(FANS_AT_ONCE).map(samples).max().unwrap_or(0)
    }

    /// Adds what all rays show of light before the first sample of their fan and behind the last one.
    pub fn add_beside(&self, light: [f32; 3], shown: &mut [[f32; 4]]) {
        self.with_parts(shown).into_par_iter().for_each(|(fan, shown)| {
            let [first, last] = [fan.edges.first, fan.last()];
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

/// Which groups have rays in directions about the light that no half-plane beside it holds: then the light's direction or its opposite is among them.
fn all_around(rays: &[PolarRay], groups: usize) -> Vec<bool> {
    const DEGREES: usize = 360;
    let mut met = vec![[false; DEGREES]; groups];
    for ray in rays {
        met[ray.group()][(ray.phi.to_degrees() + 180.0) as usize % DEGREES] = true;
    }
    let is_around = |met: &[bool; DEGREES]| {
        let mut gap = 0;
        // Twice, because a gap may lie across the end.
        let longest = (0..2 * DEGREES).map(|degree| {
            gap = if met[degree % DEGREES] { 0 } else { gap + 1 };
            gap
        });
        longest.max().unwrap_or(0) <= DEGREES / 2
    };
    met.iter().map(is_around).collect()
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
