//! A binary hierarchy by binned surface-area splits, of bounded depth.
//!
//! The traversal's stack holds 32 levels and drops what lies deeper, so depth is bounded here: where a split by
//! area could leave too little depth for the rest, the primitives are halved instead. Equal boxes, on
//! which bottom-up clustering takes quadratic time, are halved as well.

use std::ops::Range;

use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;

/// Levels below the root.
pub(super) const DEPTH: u32 = 30;
const BINS: usize = 16;

/// The hierarchy over `boxes`, one box a leaf. There must be at least one and at most 2²⁸.
pub(super) fn build(boxes: &[Aabb]) -> Bvh2 {
    let mut builder = Builder {
        boxes,
        order: (0..boxes.len() as u32).collect(),
        nodes: Vec::with_capacity(2 * boxes.len()),
    };
    builder.nodes.push(Bvh2Node::default());
    builder.split(0, 0..boxes.len(), DEPTH);
    Bvh2 { nodes: builder.nodes, primitive_indices: builder.order, ..Bvh2::default() }
}

struct Builder<'a> {
    boxes: &'a [Aabb],
    order: Vec<u32>,
    nodes: Vec<Bvh2Node>,
}

impl Builder<'_> {
    fn split(&mut self, node: usize, range: Range<usize>, levels: u32) {
        let (bounds, centres) = self.extent(range.clone());
        if range.len() == 1 {
            self.nodes[node] = Bvh2Node::new(bounds, 1, range.start as u32);
            return;
        }
        let levels_of_halving = usize::BITS - (range.len() - 1).leading_zeros();
        let by_area =
            if levels > levels_of_halving { self.split_by_area(range.clone(), centres) } else { None };
        let middle = by_area.unwrap_or_else(|| self.halve(range.clone(), centres));
        let children = self.nodes.len();
        self.nodes[node] = Bvh2Node::new(bounds, 0, children as u32);
        self.nodes.extend([Bvh2Node::default(); 2]);
        let levels = levels.saturating_sub(1);
        self.split(children, range.start..middle, levels);
        self.split(children + 1, middle..range.end, levels);
    }

    /// The box around the primitives and the box around their centres.
    fn extent(&self, range: Range<usize>) -> (Aabb, Aabb) {
        let mut bounds = Aabb::INVALID;
        let mut centres = Aabb::INVALID;
        for &index in &self.order[range] {
            let aabb = self.boxes[index as usize];
            bounds = bounds.union(&aabb);
            centres.extend(aabb.center());
        }
        (bounds, centres)
    }

    fn halve(&mut self, range: Range<usize>, centres: Aabb) -> usize {
        let axis = centres.largest_axis();
        let half = range.len() / 2;
        let boxes = self.boxes;
        let centre = |index: &u32| boxes[*index as usize].center_axis(axis);
        self.order[range.clone()]
            .select_nth_unstable_by(half, |a, b| centre(a).total_cmp(&centre(b)).then(a.cmp(b)));
        range.start + half
    }

    /// Partitions at the cheapest of the bin borders; none where all centres coincide.
    fn split_by_area(&mut self, range: Range<usize>, centres: Aabb) -> Option<usize> {
        let bins = Binning::new(centres);
        let mut filled = [[(Aabb::INVALID, 0_u32); BINS]; 3];
        for &index in &self.order[range.clone()] {
            let aabb = &self.boxes[index as usize];
            let at = bins.of(aabb.center());
            for axis in 0..3 {
                let (bounds, count) = &mut filled[axis][at[axis]];
                *bounds = bounds.union(aabb);
                *count += 1;
            }
        }
        let (axis, border) = cheapest(&filled)?;
        let boxes = self.boxes;
        let part = &mut self.order[range.clone()];
        let mut middle = 0;
        for i in 0..part.len() {
            if bins.of(boxes[part[i] as usize].center())[axis] < border {
                part.swap(i, middle);
                middle += 1;
            }
        }
        Some(range.start + middle)
    }
}

struct Binning {
    origin: Vec3A,
    scale: Vec3A,
}

impl Binning {
    fn new(centres: Aabb) -> Self {
        // An axis without extent has one bin, and so no border to split at.
        let diagonal = centres.diagonal();
        let scale = Vec3A::select(diagonal.cmpgt(Vec3A::splat(1e-30)), BINS as f32 / diagonal, Vec3A::ZERO);
        Self { origin: centres.min, scale }
    }

    fn of(&self, centre: Vec3A) -> [usize; 3] {
        ((centre - self.origin) * self.scale).to_array().map(|bin| (bin as usize).min(BINS - 1))
    }
}

/// Axis and border (bins below it go left) of the least area times count.
fn cheapest(filled: &[[(Aabb, u32); BINS]; 3]) -> Option<(usize, usize)> {
    let mut best = None;
    let mut least = f32::INFINITY;
    for (axis, bins) in filled.iter().enumerate() {
        let mut right = [0.0; BINS];
        let mut bounds = Aabb::INVALID;
        let mut count = 0;
        for border in (1..BINS).rev() {
            bounds = bounds.union(&bins[border].0);
            count += bins[border].1;
            right[border] = cost(&bounds, count);
        }
        let (mut bounds, mut count) = (Aabb::INVALID, 0);
        for border in 1..BINS {
            bounds = bounds.union(&bins[border - 1].0);
            count += bins[border - 1].1;
            let sum = cost(&bounds, count) + right[border];
            if sum < least {
                least = sum;
                best = Some((axis, border));
            }
        }
    }
    best
}

/// Infinite for an empty side, which is no split.
fn cost(bounds: &Aabb, count: u32) -> f32 {
    if count == 0 { f32::INFINITY } else { bounds.half_area() * count as f32 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn depth(bvh: &Bvh2, node: usize) -> u32 {
        let node = &bvh.nodes[node];
        if node.is_leaf() {
            return 0;
        }
        let child = node.first_index as usize;
        1 + depth(bvh, child).max(depth(bvh, child + 1))
    }

    #[test]
    fn depth_is_bounded_where_splits_by_area_would_peel_off_one_box_at_a_time() {
        let peeling: Vec<Aabb> = (0..20_000)
            .map(|i| Aabb::from_point(Vec3A::splat(f32::powf(0.99, i as f32))))
            .chain((0..100).map(|i| Aabb::from_point(Vec3A::splat(f32::powi(0.5, i)))))
            .collect();
        let equal = vec![Aabb::new(Vec3A::ZERO, Vec3A::ONE); 20_000];
        for boxes in [peeling, equal, vec![Aabb::from_point(Vec3A::ZERO)]] {
            let bvh = build(&boxes);
            assert!(depth(&bvh, 0) <= DEPTH);
            let mut leaves = bvh.primitive_indices.clone();
            leaves.sort_unstable();
            assert!(leaves.iter().copied().eq(0..boxes.len() as u32));
        }
    }
}
