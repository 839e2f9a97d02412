//! The lit stretches of a ray, found through the min-max pyramid of the shadow map.

use super::{Real, least, most};
use crate::scene::ShadowMap;

/// A ray in texels of a shadow map and in metres of stored depth, all affine in the distance t.
#[derive(Clone, Copy)]
pub(super) struct ShadowRay<'a, F> {
    pub(super) map: &'a ShadowMap,
    /// Position in texels at t = 0, its change a metre, and one over that.
    pub(super) origin: [F; 2],
    pub(super) slope: [F; 2],
    pub(super) inverse: [F; 2],
    /// Depth along the light at t = 0 and its change a metre, in metres.
    pub(super) depth: F,
    pub(super) depth_slope: F,
}

/// A stretch of a ray under construction: neighbouring stretches become one.
struct Joined<F, V> {
    stretch: Option<[F; 2]>,
    /// Nodes that were looked at.
    nodes: usize,
    visit: V,
}

impl<F: Real, V: FnMut(F, F)> Joined<F, V> {
    #[inline(always)]
    fn add(&mut self, a: F, b: F) {
        match &mut self.stretch {
            Some([_, end]) if *end == a => *end = b,
            pending => {
                if let Some([start, end]) = pending.replace([a, b]) {
                    (self.visit)(start, end);
                }
            }
        }
    }
}

impl<F: Real> ShadowRay<'_, F> {
    /// Visits the maximal lit stretches inside [a, b], in order.
    ///
    /// Nodes of the pyramid that are lit or shadowed as a whole are not descended into; a texel is cut where
    /// the ray crosses its depth. Outside the map the ray is lit. Gives back how many nodes were looked at.
    pub(super) fn lit_stretches(&self, a: F, b: F, visit: impl FnMut(F, F)) -> usize {
        let mut joined = Joined { stretch: None, nodes: 0, visit };
        let size = self.map.grid().size.map(|side| F::of(side as f64));
        match clip(self.origin, self.slope, size, a, b) {
            None => joined.add(a, b),
            Some([enter, leave]) => {
                if enter > a {
                    joined.add(a, enter);
                }
                let inside = [enter, leave].map(|t| self.at(t));
                self.descend(self.map.top(), [0, 0], inside, &mut joined);
                if b > leave {
                    joined.add(leave, b);
                }
            }
        }
        if let Some([start, end]) = joined.stretch {
            (joined.visit)(start, end);
        }
        joined.nodes
    }

    fn at(&self, t: F) -> Instant<F> {
        Instant { t, depth: self.depth + self.depth_slope * t }
    }

    fn descend<V: FnMut(F, F)>(
        &self,
        level: usize,
        [i, j]: [usize; 2],
        [a, b]: [Instant<F>; 2],
        lit: &mut Joined<F, V>,
    ) {
        lit.nodes += 1;
        let [nearest, farthest] = self.map.range(level, i, j).map(|z| F::of(f64::from(z)));
        if a.depth <= nearest && b.depth <= nearest {
            return lit.add(a.t, b.t);
        }
        if a.depth > farthest && b.depth > farthest {
            return;
        }
        if level == 0 {
            let crossing = least(most((nearest - self.depth) / self.depth_slope, a.t), b.t);
            return if b.depth > a.depth { lit.add(a.t, crossing) } else { lit.add(crossing, b.t) };
        }
        let half = 1usize << (level - 1);
        let split = [(2 * i + 1) * half, (2 * j + 1) * half];
        let split = [self.split(0, split[0], a.t, b.t), self.split(1, split[1], a.t, b.t)];
        let (first, second) = if split[0] <= split[1] { (split[0], split[1]) } else { (split[1], split[0]) };
        let mut start = a;
        for end in [self.at(first), self.at(second), b] {
            if start.t < end.t {
                let beyond = |axis: usize| {
                    let past = start.t >= split[axis];
                    usize::from(past == (self.slope[axis] >= F::zero()))
                };
                self.descend(level - 1, [2 * i + beyond(0), 2 * j + beyond(1)], [start, end], lit);
                start = end;
            }
        }
    }

    /// When the ray crosses a grid line, kept inside [a, b]; one that never does has always crossed the lines before it.
    #[inline(always)]
    fn split(&self, axis: usize, line: usize, a: F, b: F) -> F {
        let distance = F::of(line as f64) - self.origin[axis];
        if self.slope[axis] == F::zero() {
            return if distance <= F::zero() { a } else { b };
        }
        least(most(distance * self.inverse[axis], a), b)
    }
}

/// A point of a ray and its depth along the light.
#[derive(Clone, Copy)]
struct Instant<F> {
    t: F,
    depth: F,
}

/// The part of [a, b] in which `origin + slope t` lies inside [0, size] on both axes.
#[inline]
pub(super) fn clip<F: Real>(origin: [F; 2], slope: [F; 2], size: [F; 2], a: F, b: F) -> Option<[F; 2]> {
    let (mut a, mut b) = (a, b);
    for axis in 0..2 {
        if slope[axis] == F::zero() {
            if origin[axis] < F::zero() || origin[axis] >= size[axis] {
                return None;
            }
        } else {
            let to = |edge: F| (edge - origin[axis]) / slope[axis];
            let (near, far) = (to(F::zero()), to(size[axis]));
            a = a.max(near.min(far));
            b = b.min(near.max(far));
        }
    }
    (a < b).then_some([a, b])
}
