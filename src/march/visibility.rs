//! The lit stretches of a ray, found through the min-max pyramid of the shadow map.

use super::texels::{grid_ray, inverse};
use super::view_ray::ViewRay;
use super::{Real, least, most};
use crate::visibility::ShadowMap;

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
struct Joined<'a, F> {
    stretch: Option<[F; 2]>,
    visit: &'a mut dyn FnMut(F, F),
}

impl<F: Real> Joined<'_, F> {
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

/// A view ray in the texels and depths of a shadow map.
pub(super) fn shadow_ray<'a, F: Real>(ray: &ViewRay, map: &'a ShadowMap) -> ShadowRay<'a, F> {
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

impl<F: Real> ShadowRay<'_, F> {
    /// Visits the maximal lit stretches inside [a, b], in order.
    ///
    /// Nodes of the pyramid that are lit or shadowed as a whole are not descended into; a texel is cut where
    /// the ray crosses its depth. Outside the map the ray is lit. Gives back how many nodes were looked at.
    ///
    /// Who visits is called once a stretch, not once a texel, so that all share one copy of this search.
    pub(super) fn lit_stretches(&self, a: F, b: F, visit: &mut dyn FnMut(F, F)) -> usize {
        self.lit_stretches_from(self.map.top(), a, b, visit)
    }

    /// The same of a short part of a ray: `level` is that of the node to begin with.
    pub(super) fn lit_stretches_from(&self, level: usize, a: F, b: F, visit: &mut dyn FnMut(F, F)) -> usize {
        let mut joined = Joined { stretch: None, visit };
        let mut nodes = 0;
        let size = self.map.grid().size.map(|side| F::of(side as f64));
        match clip(self.origin, self.slope, size, a, b) {
            None => joined.add(a, b),
            Some([enter, leave]) => {
                if enter > a {
                    joined.add(a, enter);
                }
                nodes = self.lit_inside(level.min(self.map.top()), enter, leave, &mut joined);
                if b > leave {
                    joined.add(leave, b);
                }
            }
        }
        if let Some([start, end]) = joined.stretch {
            (joined.visit)(start, end);
        }
        nodes
    }

    /// Goes from node to node of the pyramid: a level down where a node is neither lit nor shadowed as a whole, on to the next
    /// where it is, and a level up with each step into another node above.
    ///
    /// Every crossing is computed from its own grid line, so rounding does not add up along the ray.
    fn lit_inside(&self, mut level: usize, a: F, b: F, lit: &mut Joined<F>) -> usize {
        let (top, size) = (self.map.top(), self.map.grid().size);
        let ahead = [self.slope[0] > F::zero(), self.slope[1] > F::zero()];
        // The cast rounds towards zero, and takes what rounding has put before the first texel to it.
        let texel = |axis: usize| (self.origin[axis] + self.slope[axis] * a).wide() as usize;
        let at_first = |axis: usize| texel(axis).min(size[axis] - 1) >> level;
        let mut node = [at_first(0), at_first(1)];
        let (mut start, mut nodes) = (self.at(a), 0);
        loop {
            nodes += 1;
            let crossing =
                |axis: usize| self.crossing(axis, (node[axis] + usize::from(ahead[axis])) << level);
            let (x, y) = (crossing(0), crossing(1));
            let axis = usize::from(y < x);
            let mut next = node;
            next[axis] = if ahead[axis] { node[axis] + 1 } else { node[axis].wrapping_sub(1) };
            // Only rounding at the rim of the map can lead outside before b, by less than it can resolve.
            let is_last = next[axis] << level >= size[axis];
            let end = self.at(if is_last { b } else { least(most(least(x, y), start.t), b) });
            let [nearest, farthest] = self.map.range(level, node[0], node[1]);
            let (nearest, farthest) = (F::of(f64::from(nearest)), F::of(f64::from(farthest)));
            if start.depth <= nearest && end.depth <= nearest {
                lit.add(start.t, end.t);
            } else if start.depth <= farthest || end.depth <= farthest {
                if level > 0 {
                    level -= 1;
                    let half = |axis: usize| {
                        2 * node[axis] + self.half(axis, (2 * node[axis] + 1) << level, start.t)
                    };
                    node = [half(0), half(1)];
                    continue;
                }
                let crossing = (nearest - self.depth) / self.depth_slope;
                let crossing = least(most(crossing, start.t), end.t);
                match end.depth > start.depth {
                    true => lit.add(start.t, crossing),
                    false => lit.add(crossing, end.t),
                }
            }
            if end.t >= b {
                return nodes;
            }
            if next[axis] >> 1 != node[axis] >> 1 && level < top {
                level += 1;
                next = [next[0] >> 1, next[1] >> 1];
            }
            (node, start) = (next, end);
        }
    }

    fn at(&self, t: F) -> Instant<F> {
        Instant { t, depth: self.depth + self.depth_slope * t }
    }

    /// When the ray crosses a grid line; never where it runs beside it, or so slowly that one over its slope overflows.
    #[inline(always)]
    fn crossing(&self, axis: usize, line: usize) -> F {
        if self.inverse[axis].is_infinite() {
            return F::infinity();
        }
        (F::of(line as f64) - self.origin[axis]) * self.inverse[axis]
    }

    /// On which side of a grid line the ray is at t: 0 below, 1 above.
    #[inline(always)]
    fn half(&self, axis: usize, line: usize, t: F) -> usize {
        if self.inverse[axis].is_infinite() {
            return usize::from(self.origin[axis] >= F::of(line as f64));
        }
        let is_past = t >= self.crossing(axis, line);
        usize::from(is_past == (self.slope[axis] > F::zero()))
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
