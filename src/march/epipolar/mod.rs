//! Rows of a light map whose cost does not grow with the map: the epipolar operator.
//!
//! All rays in a half-plane through the eye and the light's direction pass the same shadow and the same texels. There a point has ξ, its
//! distance from the line of the light through the eye, and a depth ζ along the light from the eye on; a ray is ζ = κ ξ with κ = cot θ, and
//! t = q ξ with q = 1 / sin θ. Sample j of the half-plane is lit for it where κ ≤ c_j = ζ_j / ξ_j, with ζ_j the depth of the first surface
//! there. So a ray shows
//!
//! ```text
//! Σ_j [κ ≤ c_j] [ξ_j < ξ_end] x̂_j (e^{−σ q a_j} − e^{−σ q b_j}) ,    x̂ = S x
//! ```
//!
//! with [a_j, b_j] the edges of the sample and S the texels' basis there. Sorted by κ and c, these are sums over a prefix of a prefix; with
//! the transmittance expanded in few products (`expansion.rs`) a sweep with sums over blocks of samples takes a few steps a ray
//! and a sample (`sums.rs`). Its transpose is the same sweep backwards, so T = E S and Tᵀ = Sᵀ Eᵀ match to rounding.
//!
//! What is approximate: a ray takes the slice that is nearest to it, at most half a pixel away; shadow and light are sampled in the middle
//! of samples; and the expansion is cut at a tolerance. Min-max trees (Chen et al. 2011) and prefilters (Klehm et al. 2014) work on the same slices.

mod edges;
mod expansion;
mod fan;
mod fans;
mod min_max;
mod prefiltered;
mod sliced_rays;
mod slices;
mod sums;
#[cfg(test)]
mod tests;

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

pub use edges::{Edges, Spacing};
pub use fan::{Fan, FanRay, MOST_SAMPLES};
pub use fans::Fans;
pub use min_max::MinMaxTree;
pub use prefiltered::{
    MOST_COEFFICIENTS, Prefilter, PrefilterLookup, PrefilterWeighting, Prefiltered, harmonics,
};
pub use sliced_rays::{EpipolarSettings, SlicedRays};

use super::basis::{Bilinear, NearestTexel, TexelBasis, add};
use super::texels::TexelRay;
use super::view_ray::ViewRay;
use super::{LightMapTraversal, Real, Traversal, Weight};
use crate::scene::{Basis, Grid};
use crate::{Error, Result};

/// Pieces of a map, for each thread, that a scatter is cut into.
const PIECES: usize = 4;
/// Entries of a row among which a texel of the sample before stands.
const NEARBY: usize = 12;

/// The rows of a light map over slices: E S.
///
/// Shapes  rows: view rays; elements: texels of the light map
/// Units   weights: dimensionless a steradian, as those of [`LightMapTraversal`]
/// Law     [`Traversal::walk`], gathers and scatters are the same matrix to rounding
/// Cost    a sample three steps, a ray 30 and one more for 256 samples at most (`sums.rs`); memory is that of samples and rays, not of non-zeros
#[derive(Debug, Clone)]
pub struct EpipolarTraversal {
    fans: Arc<Fans>,
    /// The places of each row's ray among those of the fans: one, or two where it is between two.
    places: Arc<[[u32; 2]]>,
    light_map: Grid,
    basis: Basis,
}

/// Of a row that shows nothing.
const NOWHERE: u32 = u32::MAX;

impl EpipolarTraversal {
    /// The rows of `exact`; `angle` is that between the ray of a row and those of neighbouring pixels, in radians.
    ///
    /// Errors: [`Error::Empty`] for rows through panes, with further weights or with another quadrature than the exact one.
    pub fn new(
        exact: &LightMapTraversal,
        angle: &(dyn Fn(usize) -> f64 + Sync),
        settings: EpipolarSettings,
    ) -> Result<Self> {
        let transport = exact.transport();
        let suns = exact.suns();
        let shadow_maps = match suns {
            None => vec![&*transport.shadow_map],
            Some(suns) => suns.shadow_maps.iter().map(|map| &**map).collect(),
        };
        refuse(exact)?;
        let finer = |pitch: f64, grid: &Grid| pitch.min(grid.density().recip().min_element());
        let light_map = transport.light_map;
        let pitch = shadow_maps.iter().map(|map| map.grid()).fold(f64::INFINITY, finer);
        let fans = Fans::new(
            &SlicedRays {
                rays: exact.rays(),
                reach: transport.reach(),
                angle,
                of_row: &|row| suns.map_or(0, |suns| suns.of_rows[row] as usize),
                shadow_maps,
                sigma_t: transport.sigma_t,
                region: light_map.extent,
                pitch: finer(pitch, &light_map),
            },
            settings,
        );
        Ok(Self::over(Arc::new(fans), light_map, transport.basis))
    }

    /// The texels of a light map over slices that are there.
    pub fn over(fans: Arc<Fans>, light_map: Grid, basis: Basis) -> Self {
        let mut places = vec![[NOWHERE; 2]; fans.rows()];
        for (place, ray) in fans.rays().iter().enumerate() {
            let [first, second] = &mut places[ray.row as usize];
            *(if *first == NOWHERE { first } else { second }) = place as u32;
        }
        Self { fans, places: places.into(), light_map, basis }
    }

    /// Its slices.
    pub fn fans(&self) -> &Fans {
        &self.fans
    }

    /// The texels.
    pub fn light_map(&self) -> &Grid {
        &self.light_map
    }

    /// Bytes that it takes.
    pub fn bytes(&self) -> u64 {
        self.fans.bytes() + size_of_val(&*self.places) as u64
    }

    /// Bytes that samples, rays and texels take while products with them are made.
    pub fn room_bytes(&self) -> u64 {
        let values = self.fans.samples_at_once() + self.fans.rays().len() + self.light_map.len();
        (values * size_of::<[f32; 4]>()) as u64
    }

    /// T x of all rows, in the order of their numbers.
    pub fn shown<X: Real>(&self, x: &[[X; 3]]) -> Vec<[X; 3]> {
        self.of_rows(&self.of_fans(x))
    }

    /// What rows show, of what all rays of the fans do.
    pub fn of_rows<X: Real>(&self, shown: &[[X; 4]]) -> Vec<[X; 3]> {
        let row = |places: &[u32; 2]| {
            let [r, g, b, _] = at(shown, places);
            [r, g, b]
        };
        self.places.par_iter().map(row).collect()
    }

    /// The light at some samples of a fan, which are none yet: that of the texels, or `outside` beside them.
    pub fn light_at<X: Real>(
        &self,
        x: &[[X; 3]],
        outside: [X; 3],
        fan: &Fan,
        which: impl Iterator<Item = usize>,
        samples: &mut [[X; 4]],
    ) {
        let ([r, g, b], is_beside) = (outside, self.beside(fan));
        let mut inside = Vec::with_capacity(samples.len());
        for (j, sample) in which.zip(samples) {
            debug_assert!(j < fan.slopes.len());
            match is_beside(fan.middle(j)) {
                true => *sample = [r, g, b, X::zero()],
                false => inside.push((j, sample)),
            }
        }
        match self.basis {
            Basis::Nearest => self.sampled::<X, 1, NearestTexel>(x, fan, inside.into_iter()),
            Basis::Bilinear => self.sampled::<X, 4, Bilinear>(x, fan, inside.into_iter()),
        }
    }

    /// The texels that light some samples of a fan, with their weights; none beside the light map.
    pub fn texels_of(
        &self,
        fan: &Fan,
        samples: impl Iterator<Item = usize>,
        visit: &mut impl FnMut(&[(usize, f64)]),
    ) {
        match self.basis {
            Basis::Nearest => self.texels_in::<1, NearestTexel>(fan, samples, visit),
            Basis::Bilinear => self.texels_in::<4, Bilinear>(fan, samples, visit),
        }
    }

    fn texels_in<const N: usize, B: TexelBasis<f64, 1, N>>(
        &self,
        fan: &Fan,
        samples: impl Iterator<Item = usize>,
        visit: &mut impl FnMut(&[(usize, f64)]),
    ) {
        let is_beside = self.beside(fan);
        let (cells, size) = (self.cells::<1, N, B>(fan), self.light_map.size);
        for xi in samples.map(|sample| fan.middle(sample)) {
            if is_beside(xi) {
                visit(&[]);
                continue;
            }
            let piece = cells.at(xi);
            let weights = B::sample(&piece, size);
            let texel = |number: usize| (B::texel(piece.cell, number, size), weights[number]);
            visit(&std::array::from_fn::<_, N, _>(texel));
        }
    }

    /// Whether a ξ of a fan is beside the light map.
    fn beside(&self, fan: &Fan) -> impl Fn(f64) -> bool {
        let [enter, leave] = fan.across(self.light_map.extent).unwrap_or([f64::INFINITY; 2]);
        move |xi| xi < enter || xi > leave
    }

    /// Whether each row is one ray.
    pub fn has_one_ray_a_row(&self) -> bool {
        self.places.iter().all(|[_, second]| *second == NOWHERE)
    }

    /// E S x of the rays of all fans.
    fn of_fans<X: Real>(&self, x: &[[X; 3]]) -> Vec<[X; 4]> {
        self.fans.gather::<X>(&|fan, samples| {
            let samples = fan.needed().iter().copied().map(usize::from).zip(samples);
            match self.basis {
                Basis::Nearest => self.sampled::<X, 1, NearestTexel>(x, fan, samples),
                Basis::Bilinear => self.sampled::<X, 4, Bilinear>(x, fan, samples),
            }
        })
    }

    /// Adds S x to samples, each with its number.
    fn sampled<'s, X: Real, const N: usize, B: TexelBasis<f64, 1, N>>(
        &self,
        x: &[[X; 3]],
        fan: &Fan,
        samples: impl Iterator<Item = (usize, &'s mut [X; 4])>,
    ) {
        let (cells, size) = (self.cells::<1, N, B>(fan), self.light_map.size);
        for (j, sample) in samples {
            let piece = cells.at(fan.middle(j));
            for (number, weight) in B::sample(&piece, size).into_iter().enumerate() {
                let (weight, texel) = (X::of(weight), x[B::texel(piece.cell, number, size)]);
                (0..3).for_each(|c| sample[c] += weight * texel[c]);
            }
        }
    }

    /// The samples of a fan as places of a ray through the cells of the basis.
    fn cells<const C: usize, const N: usize, B: TexelBasis<f64, C, N>>(&self, fan: &Fan) -> TexelRay<f64> {
        let (origin, direction) = (fan.eye.extend(0.0), fan.direction.extend(0.0));
        let line = ViewRay { origin, direction, length: f64::INFINITY, scattering: [1.0; 3] };
        TexelRay::new(&line, &self.light_map, B::SHIFT, B::EXTRA)
    }

    /// Sᵀ Eᵀ of what the rays of the fans are given.
    ///
    /// Each task alone writes to some rows of texels, and takes the fans and their samples in order: the same sums for any number of
    /// threads.
    fn spread<X: Real>(&self, y: &(dyn Fn(&FanRay) -> [X; 3] + Sync)) -> Vec<[X; 3]> {
        let [width, height] = self.light_map.size;
        // Written by all threads before anything is read: pages that are first read are faulted in twice.
        let mut x: Vec<_> = (0..width * height).into_par_iter().map(|_| [X::zero(); 4]).collect();
        let rows_at_once = height.div_ceil(PIECES * rayon::current_num_threads());
        self.fans.scatter(y, &mut |fans, samples| {
            x.par_chunks_mut(width * rows_at_once).enumerate().for_each(|(piece, x)| {
                let rows = piece * rows_at_once..piece * rows_at_once + x.len() / width;
                for (fan, samples) in fans.iter().zip(samples) {
                    match self.basis {
                        Basis::Nearest => self.spread_in::<X, 1, NearestTexel>(fan, samples, &rows, x),
                        Basis::Bilinear => self.spread_in::<X, 4, Bilinear>(fan, samples, &rows, x),
                    }
                }
            });
        });
        x.into_par_iter().map(|[r, g, b, _]| [r, g, b]).collect()
    }

    fn spread_in<X: Real, const N: usize, B: TexelBasis<f64, 1, N>>(
        &self,
        fan: &Fan,
        samples: &[[X; 4]],
        rows: &Range<usize>,
        x: &mut [[X; 4]],
    ) {
        let near = near(fan, &self.light_map, rows);
        if near.is_empty() {
            return;
        }
        let (cells, size) = (self.cells::<1, N, B>(fan), self.light_map.size);
        for (&sample, value) in fan.needed()[near.clone()].iter().zip(&samples[near]) {
            let piece = cells.at(fan.middle(usize::from(sample)));
            for (number, weight) in B::sample(&piece, size).into_iter().enumerate() {
                let texel = B::texel(piece.cell, number, size);
                let Some(element) = texel.checked_sub(rows.start * size[0]).and_then(|it| x.get_mut(it))
                else {
                    continue;
                };
                let weight = X::of(weight);
                (0..4).for_each(|c| element[c] += weight * value[c]);
            }
        }
    }

    fn walk_in<F: Real, const C: usize, const N: usize, B: TexelBasis<f64, C, N>>(
        &self,
        row: usize,
        visit: &mut impl FnMut(usize, Weight<F, C>),
    ) {
        let mut weights = Vec::new();
        let [first, second] = self.places[row];
        for place in [first, second].into_iter().filter(|&place| place != NOWHERE) {
            self.walk_place::<F, C, N, B>(place as usize, &mut weights);
        }
        if second != NOWHERE {
            // Neighbouring slices share texels.
            weights.sort_by_key(|(element, _)| *element);
            weights.dedup_by(|(element, weight), (kept, sum)| {
                let is_same = element == kept;
                if is_same {
                    add(sum, *weight);
                }
                is_same
            });
        }
        weights.into_iter().for_each(|(element, weight)| visit(element, weight));
    }

    /// Adds what a ray of the fans weighs.
    fn walk_place<F: Real, const C: usize, const N: usize, B: TexelBasis<f64, C, N>>(
        &self,
        place: usize,
        weights: &mut Vec<(usize, Weight<F, C>)>,
    ) {
        let size = self.light_map.size;
        let mut of_fan = None;
        self.fans.walk(place, |fan, needed, weight| {
            let cells = of_fan.get_or_insert_with(|| self.cells::<C, N, B>(fan));
            let piece = cells.at(fan.middle(usize::from(fan.needed()[needed])));
            for (number, share) in B::sample(&piece, size).into_iter().enumerate().filter(|it| it.1 != 0.0) {
                let weight = std::array::from_fn(|c| F::of(weight[c] * share));
                add_to(weights, B::texel(piece.cell, number, size), weight);
            }
        });
    }
}

/// Adds the weight of a texel. Those of one texel follow each other along a ray, so it is among the last of the list if it is there at all.
fn add_to<F: Real, const C: usize>(
    weights: &mut Vec<(usize, Weight<F, C>)>,
    element: usize,
    weight: Weight<F, C>,
) {
    match weights.iter_mut().rev().take(NEARBY).find(|(other, _)| *other == element) {
        Some((_, sum)) => add(sum, weight),
        None => weights.push((element, weight)),
    }
}

impl<F: Real, const C: usize> Traversal<F, C> for EpipolarTraversal {
    fn rows(&self) -> usize {
        self.places.len()
    }

    fn elements(&self) -> usize {
        self.light_map.len()
    }

    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<F, C>)) {
        match self.basis {
            Basis::Nearest => self.walk_in::<F, C, 1, NearestTexel>(row, visit),
            Basis::Bilinear => self.walk_in::<F, C, 4, Bilinear>(row, visit),
        }
    }

    fn gather_rows<X: Real>(
        &self,
        x: &[[X; 3]],
        row: &(dyn Fn(usize) -> usize + Sync),
        y: &mut [[X; 4]],
        _room: u64,
    ) {
        let shown = self.of_fans(x);
        y.par_iter_mut().enumerate().for_each(|(k, y)| {
            *y = at(&shown, &self.places[row(k)]);
        });
    }

    fn scatter_rows<X: Real>(
        &self,
        rows: usize,
        y: &(dyn Fn(usize) -> (usize, [X; 3]) + Sync),
        _room: u64,
    ) -> Option<Vec<[X; 3]>> {
        let mut of_rows = vec![[X::zero(); 3]; self.places.len()];
        for (row, value) in (0..rows).map(y) {
            of_rows[row] = value;
        }
        Some(self.spread(&|ray| of_rows[ray.row as usize]))
    }
}

/// The sum of what is at such places.
#[inline(always)]
fn at<X: Real>(shown: &[[X; 4]], places: &[u32; 2]) -> [X; 4] {
    let mut sum = [X::zero(); 4];
    for place in places.iter().filter(|&&place| place != NOWHERE) {
        (0..4).for_each(|c| sum[c] += shown[*place as usize][c]);
    }
    sum
}

/// The needed samples of a fan that may be near such rows of texels.
fn near(fan: &Fan, light_map: &Grid, rows: &Range<usize>) -> Range<usize> {
    let (samples, slope) = (fan.slopes.len(), fan.direction.y * light_map.density().y);
    let begin = light_map.grid_from_light(fan.eye).y;
    let reach = [rows.start as f64 - 1.0, rows.end as f64 + 1.0];
    if slope.abs() < 1e-12 {
        return if (reach[0]..=reach[1]).contains(&begin) { 0..fan.needed().len() } else { 0..0 };
    }
    let place = |row: f64| fan.edges.place((row - begin) / slope);
    let [a, b] = reach.map(place);
    let [a, b] =
        [a.min(b).floor() - 1.0, a.max(b).ceil() + 1.0].map(|j| j.clamp(0.0, samples as f64) as usize);
    if a >= b {
        return 0..0;
    }
    let number = |sample: usize| fan.needed().partition_point(|&needed| usize::from(needed) < sample);
    number(a)..number(b)
}

/// Errors: [`Error::Empty`] for rows that slices do not know.
fn refuse(rows: &LightMapTraversal) -> Result<()> {
    let sees_panes = (0..rows.rays().len()).any(|row| !rows.seen_by(row).is_empty());
    let maps = rows.suns().into_iter().flat_map(|suns| &suns.shadow_maps);
    let through_panes = maps.chain([&rows.transport().shadow_map]).any(|map| map.behind().is_some());
    let reason = if sees_panes || through_panes {
        "rows over slices know light and shadow alone, and light passes panes here (glass, or leaves that let light through)"
    } else if rows.further_weights().is_some() {
        "slices have texels alone, and `surroundings` are looked for, too"
    } else if rows.transport().quadrature != crate::scene::Quadrature::Exact {
        "slices have a quadrature of their own"
    } else {
        return Ok(());
    };
    Err(Error::Empty {
        reason: reason.to_owned(),
        remedy: "take the exact rows: solve.strategy=auto, or draw with method exact",
    })
}
