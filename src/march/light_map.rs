use std::sync::Arc;

use super::basis::{
    Bilinear, BilinearWindow, Gathered, NearestTexel, NearestWindow, TexelBasis, TexelSink, times,
};
use super::lit::{
    Colored, Light, LitStretch, LitStretches, SeenPane, SeenPanes, add_extinguished, reached, weight_between,
};
use super::row_order::by_direction;
use super::texels::{TexelRay, grid_ray};
use super::view_ray::ViewRay;
use super::visibility::{clip, shadow_ray};
use super::{FurtherWeights, Real, Traversal, Weight, gathered};
use crate::scene::{Basis, Grid, Quadrature};
use crate::visibility::ShadowMap;

/// Level of the pyramid of a mask at which the search along short stretches begins.
const NEARBY: usize = 3;

/// What all rays of a light-map problem share.
#[derive(Debug, Clone)]
pub struct LightMapTransport {
    /// Extinction σ_t a channel, in 1/metre; above 0.
    pub sigma_t: [f64; 3],
    /// Which points are lit, and through which panes.
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
/// visibility and vᵢ the basis (Kol 2017, eq. 1, with the σ_t and the step length that its `T[k, j]` leaves out). Where there are
/// panes, V is what they let through on the way of the light to t and from there to the eye, channel by channel.
///
/// Shapes  rows: view rays; elements: texels of the light map, row by row, then the further ones of [`FurtherWeights`]
/// Units   weights: dimensionless a steradian (radiance of the picture per radiance of the map)
/// Cost    one cell of the light map after the other along the lit stretches of a ray
#[derive(Debug, Clone)]
pub struct LightMapTraversal {
    transport: LightMapTransport,
    rays: Arc<[ViewRay]>,
    /// Panes that the eye looks through.
    seen: Option<Arc<SeenPanes>>,
    further: Option<Arc<FurtherWeights>>,
    /// The suns of rows that are not all under the transport's.
    suns: Option<Arc<RowSuns>>,
    /// Whether only what panes have coloured counts along the rays.
    only_colored: bool,
}

/// The suns that rows are under, where one light map is before several, one at a time. Each row's ray is in the frame of its own sun.
#[derive(Debug, Clone)]
pub struct RowSuns {
    /// What is lit under each.
    pub shadow_maps: Vec<Arc<ShadowMap>>,
    /// The number of each row's sun.
    pub of_rows: Vec<u32>,
}

impl LightMapTraversal {
    /// The rows of `rays`.
    pub fn new(transport: LightMapTransport, rays: Arc<[ViewRay]>) -> Self {
        Self { transport, rays, seen: None, further: None, suns: None, only_colored: false }
    }

    /// The same rows through panes before the eye, one row of panes a ray.
    pub fn through_panes(self, seen: Option<Arc<SeenPanes>>) -> Self {
        Self { seen, ..self }
    }

    /// The same rows, which have further weights, too: of elements behind the texels, one row of weights a ray.
    pub fn with_further(self, further: Arc<FurtherWeights>) -> Self {
        Self { further: Some(further), ..self }
    }

    /// The same rows, each under a sun of its own.
    pub fn under(self, suns: Arc<RowSuns>) -> Self {
        Self { suns: Some(suns), ..self }
    }

    /// The suns of rows that are not all under the transport's.
    pub fn suns(&self) -> Option<&Arc<RowSuns>> {
        self.suns.as_ref()
    }

    /// What is lit under the sun of a row.
    #[inline]
    fn shadow_map(&self, row: usize) -> &ShadowMap {
        match &self.suns {
            None => &self.transport.shadow_map,
            Some(suns) => &suns.shadow_maps[suns.of_rows[row] as usize],
        }
    }

    /// The weights beside those of the texels along the rays.
    pub fn further_weights(&self) -> Option<&Arc<FurtherWeights>> {
        self.further.as_ref()
    }

    /// The same rows, with panes as solid as all else on the way of the light and on that of the eye.
    pub fn before_panes(&self) -> Self {
        let first = |row: usize| self.seen_by(row).first().map_or(f64::INFINITY, |pane| pane.distance);
        let cut = |(row, ray): (usize, &ViewRay)| ViewRay { length: ray.length.min(first(row)), ..*ray };
        let rays = match self.seen {
            None => self.rays.clone(),
            Some(_) => self.rays.iter().enumerate().map(cut).collect(),
        };
        let suns = self.suns.as_ref().map(|suns| {
            let shadow_maps = suns.shadow_maps.iter().map(before_panes).collect();
            Arc::new(RowSuns { shadow_maps, of_rows: suns.of_rows.clone() })
        });
        Self { transport: self.transport.before_panes(), rays, seen: None, suns, ..self.clone() }
    }

    /// What the rows have beside texels along the rays up to panes: light that panes have coloured, and further weights. None where that
    /// is nothing.
    pub fn beside(&self) -> Option<Self> {
        let maps = self.suns.iter().flat_map(|suns| &suns.shadow_maps);
        let passes = maps.chain([&self.transport.shadow_map]).any(|map| map.behind().is_some());
        let is_something = self.further.is_some() || self.seen.is_some() || passes;
        is_something.then(|| Self { only_colored: true, ..self.clone() })
    }

    /// Whether light on a row passes a pane, on its way to the ray or to the eye.
    pub fn is_colored(&self, row: usize) -> bool {
        let ray = &self.rays[row];
        let mut is_colored = false;
        let light = Colored(Light::<f64>::new(ray, self.shadow_map(row), self.seen_by(row)));
        light.each(0.0, self.end(ray), &mut |_, _, _| is_colored = true);
        is_colored
    }

    /// The panes that the eye looks through on a row.
    pub fn seen_by(&self, row: usize) -> &[SeenPane] {
        self.seen.as_ref().map_or(&[], |seen| seen.of(row))
    }

    /// Some of its rows.
    pub fn picked(&self, rows: &[usize]) -> Self {
        Self {
            transport: self.transport.clone(),
            rays: rows.iter().map(|&row| self.rays[row]).collect(),
            seen: self.seen.as_ref().and_then(|seen| SeenPanes::new(rows.iter().map(|&row| seen.of(row)))),
            further: self.further.as_ref().map(|shown| Arc::new(shown.picked(rows))),
            suns: self.suns.as_ref().map(|suns| {
                let of_rows = rows.iter().map(|&row| suns.of_rows[row]).collect();
                Arc::new(RowSuns { of_rows, ..(**suns).clone() })
            }),
            only_colored: self.only_colored,
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
        self.weight_between(row, 0.0, self.end(&self.rays[row]))
    }

    /// The ray of a row with its lit stretches, which are found once and can be used more than once.
    pub fn lit_ray(&self, row: usize) -> LitRay<'_> {
        let (ray, end) = (&self.rays[row], self.end(&self.rays[row]));
        let mut stretches = Vec::new();
        let light = Light::<f64>::new(ray, self.shadow_map(row), self.seen_by(row));
        light.each(0.0, end, &mut |from, to, passes| stretches.push(LitStretch { from, to, passes }));
        LitRay { transport: &self.transport, ray, end, stretches }
    }

    /// The weight of light that reaches the row from outside the light map, exact whatever the quadrature.
    pub fn outside_weight(&self, row: usize) -> [f64; 3] {
        let (ray, end) = (&self.rays[row], self.end(&self.rays[row]));
        match self.transport.inside(ray, end) {
            None => self.weight_between(row, 0.0, end),
            Some([enter, leave]) => {
                let (before, after) =
                    (self.weight_between(row, 0.0, enter), self.weight_between(row, leave, end));
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
        let grid = self.shadow_map(row).grid();
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
            let lit = shadow_ray::<f64>(ray, reached(self.shadow_map(row)));
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

    fn weight_between(&self, row: usize, a: f64, b: f64) -> [f64; 3] {
        let sigma_t = self.transport.sigma_t;
        weight_between(&self.rays[row], self.seen_by(row), sigma_t, self.shadow_map(row), [a, b])
    }
}

/// A ray of a [`LightMapTraversal`] whose lit stretches are known: a matrix of one row, over the texels alone.
#[derive(Debug, Clone)]
pub struct LitRay<'a> {
    transport: &'a LightMapTransport,
    ray: &'a ViewRay,
    end: f64,
    /// In order.
    stretches: Vec<LitStretch>,
}

impl LitRay<'_> {
    /// What [`LightMapTraversal::lit_weight`] is of the row.
    pub fn weight(&self) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for stretch in &self.stretches {
            add_extinguished(&mut sum, self.transport.sigma_t, stretch);
        }
        std::array::from_fn(|c| self.ray.scattering[c] * sum[c])
    }

    /// Whether all channels pass alike.
    pub fn is_grey(&self) -> bool {
        self.stretches.iter().all(|stretch| stretch.passes == [stretch.passes[0]; 3])
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

    #[inline]
    fn gather<X: Real>(&self, _row: usize, x: &[[X; 3]]) -> [f64; 3] {
        self.transport.gather_any::<X, f64, C>(self.ray, self.end, &self.stretches, x)
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

    fn row_order(&self) -> Option<Vec<u32>> {
        Some(by_direction(&self.rays))
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

    fn gather<X: Real>(&self, row: usize, x: &[[X; 3]]) -> [F; 3] {
        if self.further.is_some() || self.only_colored {
            return gathered::<F, C, X>(self, row, x);
        }
        let ray = &self.rays[row];
        let light = Light::<F>::new(ray, self.shadow_map(row), self.seen_by(row));
        self.transport.gather_any::<X, F, C>(ray, self.end(ray), &light, x)
    }
}

impl LightMapTraversal {
    #[inline]
    fn walk_texels<F: Real, const C: usize>(&self, row: usize, visit: &mut impl FnMut(usize, Weight<F, C>)) {
        let ray = &self.rays[row];
        let light = Light::<F>::new(ray, self.shadow_map(row), self.seen_by(row));
        if self.only_colored {
            self.transport.walk_any(ray, self.end(ray), &Colored(light), visit);
        } else {
            self.transport.walk_any(ray, self.end(ray), &light, visit);
        }
    }
}

/// The same map, with panes as solid as all else.
fn before_panes(shadow_map: &Arc<ShadowMap>) -> Arc<ShadowMap> {
    match shadow_map.behind() {
        None => shadow_map.clone(),
        Some(_) => Arc::new((**shadow_map).clone().with_solid_panes()),
    }
}

impl LightMapTransport {
    /// The same, with panes as solid as all else.
    pub fn before_panes(&self) -> Self {
        Self { shadow_map: before_panes(&self.shadow_map), ..self.clone() }
    }

    /// The distance at which the clearest channel's transmittance is the bound, in metres.
    pub(super) fn reach(&self) -> f64 {
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
        let size = self.light_map.size;
        match self.basis {
            Basis::Nearest => {
                let mut window = NearestWindow::new(size, visit);
                self.walk::<F, C, 1, NearestTexel>(ray, end, lit, &mut window);
                window.finish();
            }
            Basis::Bilinear => {
                let mut window = BilinearWindow::new(size, visit);
                self.walk::<F, C, 4, Bilinear>(ray, end, lit, &mut window);
                window.finish();
            }
        }
    }

    /// The sum of what [`Self::walk_any`] visits times these texels: the same pieces, evaluated where they are.
    #[inline]
    fn gather_any<X: Real, F: Real, const C: usize>(
        &self,
        ray: &ViewRay,
        end: f64,
        lit: &dyn LitStretches<F>,
        texels: &[[X; 3]],
    ) -> [F; 3] {
        let size = self.light_map.size;
        match self.basis {
            Basis::Nearest => {
                let mut gathered = Gathered::<X, F, NearestTexel>::new(texels, size);
                self.walk::<F, C, 1, NearestTexel>(ray, end, lit, &mut gathered);
                gathered.sum
            }
            Basis::Bilinear => {
                let mut gathered = Gathered::<X, F, Bilinear>::new(texels, size);
                self.walk::<F, C, 4, Bilinear>(ray, end, lit, &mut gathered);
                gathered.sum
            }
        }
    }

    #[inline]
    fn walk<F: Real, const C: usize, const N: usize, B: TexelBasis<F, C, N>>(
        &self,
        ray: &ViewRay,
        end: f64,
        lit: &dyn LitStretches<F>,
        sink: &mut impl TexelSink<F, C, N>,
    ) {
        let Some([enter, leave]) = self.inside(ray, end) else { return };
        let size = self.light_map.size;
        let sigma_t: [F; C] = std::array::from_fn(|c| F::of(self.sigma_t[c]));
        let scattering: [F; C] = std::array::from_fn(|c| F::of(ray.scattering[c]));
        let at = |t: F, passes: [F; 3]| {
            std::array::from_fn(|c| scattering[c] * passes[c] * (-sigma_t[c] * t).exp())
        };
        let cells = TexelRay::<F>::new(ray, &self.light_map, B::SHIFT, B::EXTRA);
        let mut reached = cells.cell(F::of(enter));
        let mut integrate = |a: F, b: F, passes: [F; 3]| match self.quadrature {
            Quadrature::Exact => {
                let mut strength: [F; C] = at(a, passes);
                cells.pieces(&mut reached, a, b, |piece, length| {
                    let s = sigma_t.map(|sigma| sigma * length);
                    let (weights, extinguished) = B::integrate(piece, size, s);
                    sink.add(piece.cell, weights.map(|weight| times(strength, weight)));
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
                    let strength: [F; C] = at(t, passes);
                    let strength: [F; C] = std::array::from_fn(|c| strength[c] * sigma_t[c] * step);
                    let piece = cells.at(t);
                    let weights = B::sample(&piece, size).map(|v| strength.map(|strength| strength * v));
                    sink.add(piece.cell, weights);
                }
            }
        };
        match &self.mask {
            None => lit.each(F::of(enter), F::of(leave), &mut integrate),
            Some(mask) => {
                let mask = shadow_ray::<F>(ray, mask);
                lit.each(F::of(enter), F::of(leave), &mut |a, b, passes| {
                    mask.lit_stretches_from(NEARBY, a, b, &mut |a, b| integrate(a, b, passes));
                });
            }
        }
    }
}
