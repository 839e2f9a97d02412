use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::basis::{Bilinear, NearestTexel, Piece, TexelWindow};
use super::visibility::{ShadowRay, clip};
use super::{FurtherRows, FurtherWeights, Real, Traversal, Weight, least, most};
use crate::scene::{Basis, Grid, LightFrame, Medium, Quadrature, Ray};
use crate::visibility::ShadowMap;

/// Level of the pyramid of a mask at which the search along short stretches begins.
const NEARBY: usize = 3;

/// A view ray in the frame of the light, up to the first surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewRay {
    /// The eye, (u, v, w) in metres.
    pub origin: DVec3,
    /// Direction in the frame of the light; of unit length.
    pub direction: DVec3,
    /// Distance to the first surface in metres; infinite where there is none.
    pub length: f64,
    /// Scattering factor ρ f(θ) a channel, constant along the ray because the light is parallel.
    pub scattering: [f64; 3],
}

impl ViewRay {
    /// The ray in the frame of a light whose light travels along the frame's third axis. `length` is in metres up to
    /// the first surface, infinite where there is none.
    pub fn new(ray: &Ray, length: f64, frame: &LightFrame, medium: &Medium) -> Self {
        let direction = frame.light_from_world(ray.direction);
        // Light that travels along +w leaves towards the eye, against the view ray.
        let phase = medium.phase(-direction.z);
        Self {
            origin: frame.light_from_world(ray.origin),
            direction,
            length,
            scattering: medium.albedo.map(|albedo| albedo * phase),
        }
    }
}

/// What all rays of a light-map problem share.
#[derive(Debug, Clone)]
pub struct LightMapTransport {
    /// Extinction σ_t a channel, in 1/metre; above 0.
    pub sigma_t: [f64; 3],
    /// Which points are lit.
    pub shadow_map: Arc<ShadowMap>,
    /// Where the texels of the light map lie.
    pub light_map: Grid,
    /// What lies between their values.
    pub basis: Basis,
    /// How the integral is taken.
    pub quadrature: Quadrature,
    /// Transmittance at which the rest of a ray is skipped; inside (0, 1).
    pub transmittance_bound: f64,
    /// Which texels are worth a visit: those that this map lets light pass through. All of them without it.
    pub mask: Option<Arc<ShadowMap>>,
}

/// How much of a row there is, and how much of it is walked.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RowExtent {
    /// Nodes of the shadow map's pyramid, texels among them, that are looked at to find what is lit.
    pub shadow_nodes: usize,
    /// Length over the light map, in texels.
    pub texels: f64,
    /// The lit part of it; the rest is skipped.
    pub lit_texels: f64,
    /// Whether the ray ends before its surface, because the transmittance is below the bound. Rays without a surface do not count.
    pub cut_off: bool,
}

/// The traversal of view rays through light map and shadow map together.
///
/// Row k holds for texel i the weight `ρ f(θ) ∫₀ˢ σ_t e^{−σ_t t} V(t) vᵢ(t) dt`, with V the shadow map's
/// visibility and vᵢ the basis (Kol 2017, eq. 1, with the σ_t and the step length that its `T[k, j]` leaves out).
///
/// Shapes  rows: view rays; elements: texels of the light map, row by row, then the further ones of [`FurtherWeights`]
/// Units   weights: dimensionless a steradian (radiance of the picture per radiance of the map)
/// Cost    one cell of the light map after the other along the lit stretches of a ray
#[derive(Debug, Clone)]
pub struct LightMapTraversal {
    transport: LightMapTransport,
    rays: Arc<[ViewRay]>,
    further: Option<Arc<FurtherWeights>>,
}

impl LightMapTraversal {
    /// The rows of `rays`.
    pub fn new(transport: LightMapTransport, rays: Arc<[ViewRay]>) -> Self {
        Self { transport, rays, further: None }
    }

    /// The same rows, which have further weights, too: of elements behind the texels, one row of weights a ray.
    pub fn with_further(self, further: Arc<FurtherWeights>) -> Self {
        Self { further: Some(further), ..self }
    }

    /// The weights beside those of the texels along the rays.
    pub fn further_weights(&self) -> Option<&Arc<FurtherWeights>> {
        self.further.as_ref()
    }

    /// The rows of the further weights alone, without the texels along the rays; none where there are no further weights.
    pub fn further_rows(&self) -> Option<FurtherRows> {
        let texels = self.transport.light_map.len();
        self.further.clone().map(|weights| FurtherRows { weights, texels })
    }

    /// Some of its rows.
    pub fn picked(&self, rows: &[usize]) -> Self {
        Self {
            transport: self.transport.clone(),
            rays: rows.iter().map(|&row| self.rays[row]).collect(),
            further: self.further.as_ref().map(|shown| Arc::new(shown.picked(rows))),
        }
    }

    /// The same rows, walked in another way.
    pub fn through(&self, transport: LightMapTransport) -> Self {
        Self { transport, ..self.clone() }
    }

    /// The rays, one a row.
    pub fn rays(&self) -> &[ViewRay] {
        &self.rays
    }

    /// What the rays share.
    pub fn transport(&self) -> &LightMapTransport {
        &self.transport
    }

    /// The weight of all light on a row, inside and outside the light map: the row sum of an unbounded map, exact
    /// whatever the quadrature. Outside the shadow map everything is lit.
    ///
    /// It walks lit stretches only, so a picture under constant light costs no walk through texels.
    pub fn lit_weight(&self, row: usize) -> [f64; 3] {
        self.weight_between(&self.rays[row], 0.0, self.end(&self.rays[row]))
    }

    /// The ray of a row with its lit stretches, which are found once and can be used more than once.
    pub fn lit_ray(&self, row: usize) -> LitRay<'_> {
        let (ray, end) = (&self.rays[row], self.end(&self.rays[row]));
        LitRay {
            transport: &self.transport,
            ray,
            end,
            stretches: lit_stretches(ray, &self.transport.shadow_map, end),
        }
    }

    /// The weight of light that reaches the row from outside the light map, exact whatever the quadrature.
    pub fn outside_weight(&self, row: usize) -> [f64; 3] {
        let (ray, end) = (&self.rays[row], self.end(&self.rays[row]));
        match self.transport.inside(ray, end) {
            None => self.weight_between(ray, 0.0, end),
            Some([enter, leave]) => {
                let (before, after) =
                    (self.weight_between(ray, 0.0, enter), self.weight_between(ray, leave, end));
                std::array::from_fn(|c| before[c] + after[c])
            }
        }
    }

    /// The weight of light that reaches the row from inside the light map: the row sum of the exact quadrature.
    pub fn inside_weight(&self, row: usize) -> [f64; 3] {
        let (all, outside) = (self.lit_weight(row), self.outside_weight(row));
        std::array::from_fn(|c| all[c] - outside[c])
    }

    /// The part of a row that is walked: from where to where it is over the light map, in metres from the eye.
    pub fn over_the_map(&self, row: usize) -> Option<[f64; 2]> {
        let ray = &self.rays[row];
        self.transport.inside(ray, self.end(ray))
    }

    /// The part of [a, b] of a row that is over the shadow map; beside it everything is lit.
    pub fn over_the_shadow_map(&self, row: usize, a: f64, b: f64) -> Option<[f64; 2]> {
        let grid = self.transport.shadow_map.grid();
        let [origin, slope] = grid_ray(&self.rays[row], grid);
        clip(origin.to_array(), slope.to_array(), grid.size.map(|side| side as f64), a, b)
    }

    /// What of a row is walked and what is skipped.
    pub fn extent(&self, row: usize) -> RowExtent {
        let (ray, end) = (&self.rays[row], self.end(&self.rays[row]));
        let mut extent =
            RowExtent { cut_off: end < ray.length && ray.length.is_finite(), ..RowExtent::default() };
        if let Some([enter, leave]) = self.transport.inside(ray, end) {
            let [_, slope] = grid_ray(ray, &self.transport.light_map);
            extent.texels = slope.length() * (leave - enter);
            let lit = shadow_ray::<f64>(ray, &self.transport.shadow_map);
            extent.shadow_nodes = lit.lit_stretches(enter, leave, &mut |start, end| {
                extent.lit_texels += slope.length() * (end - start);
            });
        }
        extent
    }

    /// Where the rest of a ray no longer counts.
    fn end(&self, ray: &ViewRay) -> f64 {
        ray.length.min(self.transport.reach())
    }

    fn weight_between(&self, ray: &ViewRay, a: f64, b: f64) -> [f64; 3] {
        weight_between(ray, self.transport.sigma_t, &self.transport.shadow_map, [a, b])
    }
}

/// The stretches of a ray up to `end` metres that a light reaches, in its frame and in metres from the eye.
pub fn lit_stretches(ray: &ViewRay, shadow_map: &ShadowMap, end: f64) -> Vec<[f64; 2]> {
    let mut stretches = Vec::new();
    shadow_ray::<f64>(ray, shadow_map).lit_stretches(0.0, end, &mut |from, to| stretches.push([from, to]));
    stretches
}

/// The weight of a light's scattered light from between a and b metres along a ray in its frame, where its shadow map lets it pass.
pub fn weight_between(
    ray: &ViewRay,
    sigma_t: [f64; 3],
    shadow_map: &ShadowMap,
    [a, b]: [f64; 2],
) -> [f64; 3] {
    let mut sum = [0.0; 3];
    if a < b {
        let lit = shadow_ray::<f64>(ray, shadow_map);
        lit.lit_stretches(a, b, &mut |start, end| add_extinguished(&mut sum, sigma_t, [start, end]));
    }
    std::array::from_fn(|c| ray.scattering[c] * sum[c])
}

/// Adds the share of light that a stretch of a ray extinguishes.
#[inline(always)]
fn add_extinguished(sum: &mut [f64; 3], sigma_t: [f64; 3], [start, end]: [f64; 2]) {
    for c in 0..3 {
        let entering = (-sigma_t[c] * start).exp();
        sum[c] += entering * super::exponential::extinguished(sigma_t[c] * (end - start));
    }
}

/// A ray of a [`LightMapTraversal`] whose lit stretches are known: a matrix of one row, over the texels alone.
#[derive(Debug, Clone)]
pub struct LitRay<'a> {
    transport: &'a LightMapTransport,
    ray: &'a ViewRay,
    end: f64,
    /// In metres from the eye, in order.
    stretches: Vec<[f64; 2]>,
}

impl LitRay<'_> {
    /// What [`LightMapTraversal::lit_weight`] is of the row.
    pub fn weight(&self) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for &stretch in &self.stretches {
            add_extinguished(&mut sum, self.transport.sigma_t, stretch);
        }
        std::array::from_fn(|c| self.ray.scattering[c] * sum[c])
    }
}

impl<const C: usize> Traversal<f64, C> for LitRay<'_> {
    fn rows(&self) -> usize {
        1
    }

    fn elements(&self) -> usize {
        self.transport.light_map.len()
    }

    #[inline]
    fn walk(&self, _row: usize, visit: &mut impl FnMut(usize, Weight<f64, C>)) {
        self.transport.walk_any(self.ray, self.end, &self.stretches, visit);
    }
}

/// What finds the lit stretches of [a, b] of a ray.
trait LitStretches<F> {
    fn each(&self, a: F, b: F, visit: &mut dyn FnMut(F, F));
}

impl<F: Real> LitStretches<F> for ShadowRay<'_, F> {
    fn each(&self, a: F, b: F, visit: &mut dyn FnMut(F, F)) {
        self.lit_stretches(a, b, visit);
    }
}

impl LitStretches<f64> for Vec<[f64; 2]> {
    fn each(&self, a: f64, b: f64, visit: &mut dyn FnMut(f64, f64)) {
        let inside = self.iter().map(|&[start, end]| (most(start, a), least(end, b)));
        inside.filter(|(start, end)| start < end).for_each(|(start, end)| visit(start, end));
    }
}

impl<F: Real, const C: usize> Traversal<F, C> for LightMapTraversal {
    fn rows(&self) -> usize {
        self.rays.len()
    }

    fn elements(&self) -> usize {
        let further = self.further.as_ref().map_or(0, |shown| shown.further());
        self.transport.light_map.len() + further
    }

    fn long_from(&self) -> usize {
        self.further.as_ref().map_or(usize::MAX, |_| self.transport.light_map.len())
    }

    #[inline]
    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<F, C>)) {
        match &self.further {
            None => self.walk_texels(row, visit),
            Some(shown) => {
                let walk = |mut visit: &mut dyn FnMut(usize, Weight<F, C>)| self.walk_texels(row, &mut visit);
                shown.walk(row, self.transport.light_map.len(), walk, visit);
            }
        }
    }
}

impl LightMapTraversal {
    #[inline]
    fn walk_texels<F: Real, const C: usize>(&self, row: usize, visit: &mut impl FnMut(usize, Weight<F, C>)) {
        let ray = &self.rays[row];
        let lit = shadow_ray::<F>(ray, &self.transport.shadow_map);
        self.transport.walk_any(ray, self.end(ray), &lit, visit);
    }
}

impl LightMapTransport {
    /// The distance at which the clearest channel's transmittance is the bound, in metres.
    fn reach(&self) -> f64 {
        -self.transmittance_bound.ln() / self.sigma_t.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The part of [0, end] that lies over the light map.
    fn inside(&self, ray: &ViewRay, end: f64) -> Option<[f64; 2]> {
        let cells = TexelRay::<f64>::new(ray, &self.light_map, 0.0, 0);
        clip(cells.origin, cells.slope, self.light_map.size.map(|side| side as f64), 0.0, end)
    }

    #[inline]
    fn walk_any<F: Real, const C: usize>(
        &self,
        ray: &ViewRay,
        end: f64,
        lit: &dyn LitStretches<F>,
        visit: &mut impl FnMut(usize, Weight<F, C>),
    ) {
        match self.basis {
            Basis::Nearest => self.walk::<F, C, NearestTexel<F, C>>(ray, end, lit, visit),
            Basis::Bilinear => self.walk::<F, C, Bilinear<F, C>>(ray, end, lit, visit),
        }
    }

    #[inline]
    fn walk<F: Real, const C: usize, W: TexelWindow<F, C>>(
        &self,
        ray: &ViewRay,
        end: f64,
        lit: &dyn LitStretches<F>,
        visit: &mut impl FnMut(usize, Weight<F, C>),
    ) {
        let Some([enter, leave]) = self.inside(ray, end) else { return };
        let sigma_t: [F; C] = std::array::from_fn(|c| F::of(self.sigma_t[c]));
        let scattering: [F; C] = std::array::from_fn(|c| F::of(ray.scattering[c]));
        let at = |t: F| std::array::from_fn(|c| scattering[c] * (-sigma_t[c] * t).exp());
        let cells = TexelRay::<F>::new(ray, &self.light_map, W::SHIFT, W::EXTRA);
        let mut reached = cells.cell(F::of(enter));
        let mut window = W::new(self.light_map.size);
        let mut integrate = |a: F, b: F| match self.quadrature {
            Quadrature::Exact => {
                let mut strength: [F; C] = at(a);
                cells.pieces(&mut reached, a, b, |piece, length| {
                    let s = sigma_t.map(|sigma| sigma * length);
                    let extinguished = window.integrate(piece, s, strength, visit);
                    for c in 0..C {
                        strength[c] = strength[c] * (F::one() - extinguished[c]);
                    }
                });
            }
            Quadrature::March { steps } => {
                let step = F::of(leave / f64::from(steps));
                let index = |t: F| (t / step - F::of(0.5)).ceil().max(F::zero()).wide() as u32;
                for j in index(a)..index(b).min(steps) {
                    let t = (F::of(f64::from(j)) + F::of(0.5)) * step;
                    let strength: [F; C] = at(t);
                    let strength = std::array::from_fn(|c| strength[c] * sigma_t[c] * step);
                    window.sample(&cells.at(t), strength, visit);
                }
            }
        };
        match &self.mask {
            None => lit.each(F::of(enter), F::of(leave), &mut integrate),
            Some(mask) => {
                let mask = shadow_ray::<F>(ray, mask);
                lit.each(F::of(enter), F::of(leave), &mut |a, b| {
                    mask.lit_stretches_from(NEARBY, a, b, &mut integrate);
                });
            }
        }
        window.finish(visit);
    }
}

/// A view ray in the texels and depths of a shadow map.
fn shadow_ray<'a, F: Real>(ray: &ViewRay, map: &'a ShadowMap) -> ShadowRay<'a, F> {
    let [origin, slope] = grid_ray(ray, map.grid());
    ShadowRay {
        map,
        origin: [F::of(origin.x), F::of(origin.y)],
        slope: [F::of(slope.x), F::of(slope.y)],
        inverse: [inverse(F::of(slope.x)), inverse(F::of(slope.y))],
        depth: F::of(ray.origin.z - map.depth_origin()),
        depth_slope: F::of(ray.direction.z),
    }
}

/// One over a slope, and infinite for zero of either sign: such a line is never crossed.
fn inverse<F: Real>(slope: F) -> F {
    if slope == F::zero() { F::infinity() } else { F::one() / slope }
}

/// Position in a grid at t = 0 and its change a metre.
fn grid_ray(ray: &ViewRay, grid: &Grid) -> [DVec2; 2] {
    let slope = DVec2::new(ray.direction.x, ray.direction.y) * grid.density();
    [grid.grid_from_light(DVec2::new(ray.origin.x, ray.origin.y)), slope]
}

/// A ray in cells of the basis.
struct TexelRay<F> {
    origin: [F; 2],
    slope: [F; 2],
    /// 1 / slope, infinite where the slope is zero.
    inverse: [F; 2],
    last: [usize; 2],
}

impl<F: Real> TexelRay<F> {
    fn new(ray: &ViewRay, grid: &Grid, shift: f64, extra: usize) -> Self {
        let [origin, slope] = grid_ray(ray, grid);
        Self {
            origin: [F::of(origin.x + shift), F::of(origin.y + shift)],
            slope: [F::of(slope.x), F::of(slope.y)],
            inverse: [inverse(F::of(slope.x)), inverse(F::of(slope.y))],
            last: grid.size.map(|side| side + extra - 1),
        }
    }

    #[inline(always)]
    fn cell(&self, t: F) -> [usize; 2] {
        std::array::from_fn(|axis| {
            // The cast rounds towards zero, and takes what rounding has put before the first cell to it.
            let index = (self.origin[axis] + self.slope[axis] * t).wide() as usize;
            index.min(self.last[axis])
        })
    }

    #[inline(always)]
    fn at(&self, t: F) -> Piece<F> {
        self.piece(self.cell(t), t, F::zero())
    }

    #[inline(always)]
    fn piece(&self, cell: [usize; 2], t: F, length: F) -> Piece<F> {
        let start = |axis: usize| self.origin[axis] + self.slope[axis] * t - F::of(cell[axis] as f64);
        Piece { cell, start: [start(0), start(1)], change: [self.slope[0] * length, self.slope[1] * length] }
    }

    /// Visits the pieces of [a, b] cell by cell, in order (Amanatides and Woo 1987).
    ///
    /// Every crossing is computed from its own grid line, so rounding does not add up along the ray. Which axis comes
    /// next is hard to predict, so both are advanced without a branch, one of them by nothing.
    ///
    /// `reached` is the cell in which the stretch before has ended; whatever the rounding, none begins behind it.
    #[inline(always)]
    fn pieces(&self, reached: &mut [usize; 2], a: F, b: F, mut visit: impl FnMut(&Piece<F>, F)) {
        let (ahead, step) = (self.slope.map(|slope| slope > F::zero()), self.slope.map(F::signum));
        let begin = self.cell(a);
        let mut cell = std::array::from_fn(|axis| match ahead[axis] {
            true => begin[axis].max(reached[axis]),
            false => begin[axis].min(reached[axis]),
        });
        let mut line: [F; 2] = std::array::from_fn(|axis| match self.slope[axis] == F::zero() {
            true => F::infinity(),
            false => F::of((cell[axis] + usize::from(ahead[axis])) as f64),
        });
        let crossing = |line: [F; 2], axis: usize| (line[axis] - self.origin[axis]) * self.inverse[axis];
        let mut next = [crossing(line, 0), crossing(line, 1)];
        let mut t = a;
        loop {
            let x_first = next[0] <= next[1];
            let end = least(least(next[0], next[1]), b);
            if end > t {
                visit(&self.piece(cell, t, end - t), end - t);
                t = end;
                *reached = cell;
            }
            if end >= b {
                break;
            }
            for (axis, comes) in [(0, x_first), (1, !x_first)] {
                line[axis] += if comes { step[axis] } else { F::zero() };
                let onwards = if ahead[axis] { 1 } else { usize::MAX };
                cell[axis] = cell[axis].wrapping_add(if comes { onwards } else { 0 });
            }
            // Only rounding at the rim of the map can lead outside, by less than what it can resolve.
            if cell[0] > self.last[0] || cell[1] > self.last[1] {
                break;
            }
            next = [crossing(line, 0), crossing(line, 1)];
        }
    }
}
