//! What of a ray light reaches: as it is, or coloured by panes on its way to the ray and from there to the eye.

use std::sync::Arc;

use super::texels::TexelRay;
use super::view_ray::ViewRay;
use super::visibility::{ShadowRay, shadow_ray};
use super::{Real, least, most};
use crate::visibility::{Behind, Pane, ShadowMap};

/// A stretch of a ray that light reaches, in metres from the eye, and what passes of that light on its whole way, a share a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LitStretch {
    /// Where it begins.
    pub from: f64,
    /// Where it ends.
    pub to: f64,
    /// Exactly one where no pane is on the way.
    pub passes: [f64; 3],
}

/// A pane between an eye and what it sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenPane {
    /// In metres from the eye.
    pub distance: f64,
    /// What passes of light from behind it and those before it.
    pub passes: [f64; 3],
}

/// The panes that the eye looks through, row by row.
#[derive(Debug, Clone)]
pub struct SeenPanes {
    /// Where those of each row begin; one more at the end.
    offsets: Vec<u32>,
    panes: Vec<SeenPane>,
}

impl SeenPane {
    /// Panes one behind the other, in the order of their distance.
    pub fn through(panes: &[Pane]) -> Vec<Self> {
        let mut passes = [1.0; 3];
        let seen = panes.iter().map(|pane| {
            passes = std::array::from_fn(|c| passes[c] * f64::from(pane.transmittance[c]));
            Self { distance: pane.distance, passes }
        });
        seen.collect()
    }
}

impl SeenPanes {
    /// Of rows one after the other; none where there are no panes at all.
    pub fn new<'a>(rows: impl IntoIterator<Item = &'a [SeenPane]>) -> Option<Arc<Self>> {
        let mut seen = Self { offsets: vec![0], panes: Vec::new() };
        for row in rows {
            seen.panes.extend_from_slice(row);
            seen.offsets.push(seen.panes.len() as u32);
        }
        (!seen.panes.is_empty()).then(|| Arc::new(seen))
    }

    /// Those of a row, from the eye on.
    #[inline]
    pub fn of(&self, row: usize) -> &[SeenPane] {
        &self.panes[self.offsets[row] as usize..self.offsets[row + 1] as usize]
    }
}

/// The stretches of a ray up to `end` metres that a light reaches, through panes or not, in its frame and in metres from the eye.
pub fn lit_stretches(ray: &ViewRay, shadow_map: &ShadowMap, end: f64) -> Vec<[f64; 2]> {
    let mut stretches = Vec::new();
    let solid = shadow_ray::<f64>(ray, reached(shadow_map));
    solid.lit_stretches(0.0, end, &mut |from, to| stretches.push([from, to]));
    stretches
}

/// The weight of a light's scattered light from between a and b metres along a ray in its frame, where its shadow map lets it pass.
/// The eye looks through `seen`.
pub fn weight_between(
    ray: &ViewRay,
    seen: &[SeenPane],
    sigma_t: [f64; 3],
    shadow_map: &ShadowMap,
    [a, b]: [f64; 2],
) -> [f64; 3] {
    let mut sum = [0.0; 3];
    if a < b {
        let light = Light::<f64>::new(ray, shadow_map, seen);
        light.each(a, b, &mut |from, to, passes| {
            add_extinguished(&mut sum, sigma_t, &LitStretch { from, to, passes });
        });
    }
    std::array::from_fn(|c| ray.scattering[c] * sum[c])
}

/// Adds the share of light that a stretch of a ray extinguishes.
#[inline(always)]
pub(super) fn add_extinguished(sum: &mut [f64; 3], sigma_t: [f64; 3], stretch: &LitStretch) {
    let weight = |sigma_t: f64| {
        (-sigma_t * stretch.from).exp()
            * super::exponential::extinguished(sigma_t * (stretch.to - stretch.from))
    };
    let weights = in_channels(sigma_t, weight);
    (0..3).for_each(|c| sum[c] += weights[c] * stretch.passes[c]);
}

/// A function of each channel's extinction, which is taken once where all are the same.
#[inline(always)]
pub(super) fn in_channels(sigma_t: [f64; 3], of: impl Fn(f64) -> f64) -> [f64; 3] {
    let [r, g, b] = sigma_t;
    if r == g && g == b { [of(r); 3] } else { sigma_t.map(of) }
}

/// The map of what light reaches at all.
pub(super) fn reached(shadow_map: &ShadowMap) -> &ShadowMap {
    shadow_map.behind().map_or(shadow_map, Behind::solid)
}

/// Is given a stretch, and what passes of the light that reaches it.
pub(super) type Visit<'a, F> = &'a mut dyn FnMut(F, F, [F; 3]);

/// What finds the lit stretches of [a, b] of a ray, in order.
pub(super) trait LitStretches<F> {
    fn each(&self, a: F, b: F, visit: Visit<'_, F>);
}

impl LitStretches<f64> for Vec<LitStretch> {
    fn each(&self, a: f64, b: f64, visit: Visit<'_, f64>) {
        let inside = self.iter().map(|it| (most(it.from, a), least(it.to, b), it.passes));
        inside.filter(|(from, to, _)| from < to).for_each(|(from, to, passes)| visit(from, to, passes));
    }
}

/// The stretches that are not as the light is.
pub(super) struct Colored<'a, F>(pub(super) Light<'a, F>);

impl<F: Real> LitStretches<F> for Colored<'_, F> {
    fn each(&self, a: F, b: F, visit: Visit<'_, F>) {
        if self.0.behind.is_none() && self.0.seen.is_empty() {
            return;
        }
        self.0.each(a, b, &mut |from, to, passes| {
            if passes != [F::one(); 3] {
                visit(from, to, passes);
            }
        });
    }
}

/// A light as a ray meets it.
pub(super) struct Light<'a, F> {
    /// Up to the first surfaces.
    clear: ShadowRay<'a, F>,
    /// Behind panes.
    behind: Option<ThroughPanes<'a, F>>,
    /// Before the eye.
    seen: &'a [SeenPane],
}

impl<'a, F: Real> Light<'a, F> {
    pub(super) fn new(ray: &ViewRay, map: &'a ShadowMap, seen: &'a [SeenPane]) -> Self {
        let behind = map.behind().map(|behind| ThroughPanes {
            behind,
            solid: shadow_ray(ray, behind.solid()),
            texels: TexelRay::new(ray, map.grid(), 0.0, 0),
        });
        Self { clear: shadow_ray(ray, map), behind, seen }
    }

    /// Cuts a stretch where the eye looks through a pane.
    fn cut(&self, from: F, to: F, passes: [F; 3], visit: Visit<'_, F>) {
        let (mut start, mut seen) = (from, [F::one(); 3]);
        let mut lit = |start: F, end: F, seen: [F; 3]| {
            let passes = std::array::from_fn(|c| passes[c] * seen[c]);
            if start < end && passes != [F::zero(); 3] {
                visit(start, end, passes);
            }
        };
        for pane in self.seen {
            let end = most(start, least(F::of(pane.distance), to));
            lit(start, end, seen);
            (start, seen) = (end, pane.passes.map(F::of));
        }
        lit(start, to, seen);
    }
}

impl<F: Real> LitStretches<F> for Light<'_, F> {
    fn each(&self, a: F, b: F, visit: Visit<'_, F>) {
        if self.behind.is_none() && self.seen.is_empty() {
            self.clear.lit_stretches(a, b, &mut |from, to| visit(from, to, [F::one(); 3]));
            return;
        }
        let mut joined =
            Joined { stretch: None, visit: &mut |from, to, passes| self.cut(from, to, passes, visit) };
        match &self.behind {
            None => _ = self.clear.lit_stretches(a, b, &mut |from, to| joined.add(from, to, [F::one(); 3])),
            // What light reaches, but not as it is, it reaches through panes.
            Some(through) => {
                _ = through.solid.lit_stretches(a, b, &mut |from, to| {
                    let mut passed = from;
                    self.clear.lit_stretches(from, to, &mut |start, end| {
                        through.each(passed, start, &mut joined);
                        joined.add(start, end, [F::one(); 3]);
                        passed = end;
                    });
                    through.each(passed, to, &mut joined);
                })
            }
        }
        joined.finish();
    }
}

/// Light behind panes as a ray meets it.
struct ThroughPanes<'a, F> {
    behind: &'a Behind,
    solid: ShadowRay<'a, F>,
    texels: TexelRay<F>,
}

impl<F: Real> ThroughPanes<'_, F> {
    /// Goes through [a, b], all of which is above the first solid surface, texel by texel and from pane to pane.
    fn each(&self, a: F, b: F, lit: &mut Joined<'_, F>) {
        if a < b {
            let (mut reached, mut from) = (self.texels.cell(a), a);
            self.texels.pieces(&mut reached, a, b, |piece, length| {
                let to = least(from + length, b);
                self.in_texel(self.behind, piece.cell, [from, to], lit);
                from = to;
            });
        }
    }

    fn in_texel(&self, behind: &Behind, [i, j]: [usize; 2], [from, to]: [F; 2], lit: &mut Joined<'_, F>) {
        let panes = behind.panes(i, j);
        let depth_of = |pane: usize| F::of(f64::from(panes[pane].depth));
        let before = |t: F| {
            let depth = self.solid.depth + self.solid.depth_slope * t;
            (0..panes.len()).take_while(|&pane| depth_of(pane) < depth).count()
        };
        let passes = |passed: usize| match passed.checked_sub(1) {
            None => [F::one(); 3],
            Some(last) => panes[last].passes.map(|share| F::of(f64::from(share))),
        };
        let (mut passed, last, mut start) = (before(from), before(to), from);
        while passed != last {
            let (pane, next) = if passed < last { (passed, passed + 1) } else { (passed - 1, passed - 1) };
            let crossing = (depth_of(pane) - self.solid.depth) / self.solid.depth_slope;
            let crossing = least(most(crossing, start), to);
            lit.add(start, crossing, passes(passed));
            (start, passed) = (crossing, next);
        }
        lit.add(start, to, passes(passed));
    }
}

/// Stretches one after the other, those of the same light joined.
struct Joined<'a, F> {
    stretch: Option<(F, F, [F; 3])>,
    visit: Visit<'a, F>,
}

impl<F: Real> Joined<'_, F> {
    fn add(&mut self, from: F, to: F, passes: [F; 3]) {
        match &mut self.stretch {
            Some((_, end, same)) if *end == from && *same == passes => *end = to,
            pending if from < to => {
                if let Some((start, end, passes)) = pending.replace((from, to, passes)) {
                    (self.visit)(start, end, passes);
                }
            }
            _ => {}
        }
    }

    fn finish(self) {
        if let Some((start, end, passes)) = self.stretch {
            (self.visit)(start, end, passes);
        }
    }
}
