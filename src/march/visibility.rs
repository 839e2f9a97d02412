//! The lit stretches of a ray, found through the min-max pyramid of the shadow map.

use super::Real;
use crate::scene::ShadowMap;

/// A ray in texels of a shadow map and in metres of stored depth, all affine in the distance t.
#[derive(Clone, Copy)]
pub(super) struct ShadowRay<'a, F> {
    pub(super) map: &'a ShadowMap,
    /// Position in texels at t = 0, and its change a metre.
    pub(super) origin: [F; 2],
    pub(super) slope: [F; 2],
    /// Depth along the light at t = 0 and its change a metre, in metres.
    pub(super) depth: F,
    pub(super) depth_slope: F,
}

/// A stretch of a ray under construction: neighbouring stretches become one.
struct Joined<F, V> {
    stretch: Option<[F; 2]>,
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
    /// the ray crosses its depth. Outside the map the ray is lit.
    pub(super) fn lit_stretches(&self, a: F, b: F, visit: impl FnMut(F, F)) {
        let mut joined = Joined { stretch: None, visit };
        let size = self.map.grid().size.map(|side| F::of(side as f64));
        match clip(self.origin, self.slope, size, a, b) {
            None => joined.add(a, b),
            Some([enter, leave]) => {
                if enter > a {
                    joined.add(a, enter);
                }
                self.descend(self.map.top(), [0, 0], enter, leave, &mut joined);
                if b > leave {
                    joined.add(leave, b);
                }
            }
        }
        if let Some([start, end]) = joined.stretch {
            (joined.visit)(start, end);
        }
    }

    fn descend<V: FnMut(F, F)>(&self, level: usize, [i, j]: [usize; 2], a: F, b: F, lit: &mut Joined<F, V>) {
        let [nearest, farthest] = self.map.range(level, i, j).map(|z| F::of(f64::from(z)));
        let (at_a, at_b) = (self.depth + self.depth_slope * a, self.depth + self.depth_slope * b);
        if at_a.max(at_b) <= nearest {
            return lit.add(a, b);
        }
        if at_a.min(at_b) > farthest {
            return;
        }
        if level == 0 {
            let crossing = ((nearest - self.depth) / self.depth_slope).max(a).min(b);
            return if at_b > at_a { lit.add(a, crossing) } else { lit.add(crossing, b) };
        }
        let half = 1usize << (level - 1);
        let middle = [(2 * i + 1) * half, (2 * j + 1) * half].map(|side| F::of(side as f64));
        let [first, second] = {
            let split = |axis: usize| ((middle[axis] - self.origin[axis]) / self.slope[axis]).max(a).min(b);
            let along = [0, 1].map(|axis| if self.slope[axis] == F::zero() { b } else { split(axis) });
            if along[0] <= along[1] { along } else { [along[1], along[0]] }
        };
        for (start, end) in [(a, first), (first, second), (second, b)] {
            if start < end {
                let t = F::of(0.5) * (start + end);
                let beyond = |axis: usize| self.origin[axis] + self.slope[axis] * t >= middle[axis];
                let child = [2 * i + usize::from(beyond(0)), 2 * j + usize::from(beyond(1))];
                self.descend(level - 1, child, start, end, lit);
            }
        }
    }
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
