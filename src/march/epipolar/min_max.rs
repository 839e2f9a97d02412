//! Lit stretches of a slice by a tree of least and largest slopes.

use super::fan::{Fan, FanRay};

/// A binary tree over the samples of a fan, each node with the least and the largest slope below it: the 1D min-max mipmap of Chen et al.
/// 2011. It knows where a ray is lit and not what colour the light has there.
///
/// Cost    O(log n) a lit stretch: from one node for open ground to nearly all of them under leaves
#[derive(Debug)]
pub struct MinMaxTree<'a> {
    fan: &'a Fan,
    /// Level after level, the samples themselves first.
    nodes: Vec<[f32; 2]>,
    /// Where each level begins.
    levels: Vec<usize>,
}

impl<'a> MinMaxTree<'a> {
    /// Over the samples of a fan.
    pub fn new(fan: &'a Fan) -> Self {
        let mut nodes: Vec<[f32; 2]> = fan.slopes.iter().map(|&slope| [slope; 2]).collect();
        let (mut levels, mut begin) = (vec![0], 0);
        while nodes.len() - begin > 1 {
            let end = nodes.len();
            for left in (begin..end).step_by(2) {
                let ([low, high], [other_low, other_high]) = (nodes[left], nodes[(left + 1).min(end - 1)]);
                nodes.push([low.min(other_low), high.max(other_high)]);
            }
            begin = end;
            levels.push(begin);
        }
        Self { fan, nodes, levels }
    }

    /// Visits the lit stretches of a ray in ξ, in order, neighbouring ones joined. Gives back how many nodes were looked at.
    ///
    /// Behind a node that is lit or dark as a whole comes the widest one that begins there, whose level is the number of trailing zeros of
    /// that place; any other is left for its first half.
    pub fn stretches(&self, ray: &FanRay, mut visit: impl FnMut(f64, f64)) -> usize {
        let (fan, end) = (self.fan, f64::from(ray.end));
        let samples = fan.samples_before(end);
        let top = self.levels.len() - 1;
        let (mut at, mut level, mut looked_at, mut lit_from) = (0, top, 0, None);
        while at < samples {
            let [low, high] = self.nodes[self.levels[level] + (at >> level)];
            looked_at += 1;
            if ray.kappa <= low {
                lit_from.get_or_insert(at);
            } else if ray.kappa > high {
                if let Some(from) = lit_from.take() {
                    visit(fan.edge(from), fan.edge(at));
                }
            } else {
                level -= 1;
                continue;
            }
            at += 1 << level;
            level = (at.trailing_zeros() as usize).min(top);
        }
        if let Some(from) = lit_from {
            visit(fan.edge(from), end.min(fan.last()));
        }
        looked_at
    }

    /// The weight of light of 1 along the samples of a ray, and how many nodes were looked at.
    pub fn weight(&self, ray: &FanRay, sigma_t: [f64; 3]) -> ([f64; 3], usize) {
        let mut weight = [0.0; 3];
        let looked_at = self.stretches(ray, |from, to| {
            let stretch = ray.extinguished(sigma_t, from, to);
            (0..3).for_each(|c| weight[c] += stretch[c]);
        });
        (weight, looked_at)
    }
}
