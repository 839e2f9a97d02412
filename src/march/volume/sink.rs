//! What the samples of a ray are added to.

use super::super::basis::{add, times};
use super::super::{Weight, exponential};
use super::cells::CellRay;
use super::light::Towards;
use super::window::{Trilinear, Visit, VoxelWindow};
use crate::scene::{Interpolation, Volume};

/// Takes the samples of a ray in order.
pub(super) trait Sink<const C: usize> {
    /// Whether it is added to where the ray is, so that it can take the eight voxels around a cell at once.
    const IS_LOCAL: bool;

    /// What multiplies weights at t; none where nothing does.
    fn light(&self) -> Option<impl Fn(f64) -> Weight<f64, C>>;

    /// All of a trilinear cell: the weights of the eight voxels around.
    fn cell(&mut self, cell: [usize; 3], weights: [Weight<f64, C>; 8]);

    /// The piece [a, b] in a cell in which all but light is constant, and light a cubic: `tau` is its optical depth, `weight` what
    /// is extinguished in it.
    fn piece(&mut self, cell: [usize; 3], piece: [f64; 2], tau: Weight<f64, C>, weight: Weight<f64, C>);

    /// A node of a quadrature at t, at position `at` (in cells) inside `cell`.
    fn node(&mut self, cell: [usize; 3], at: [f64; 3], t: f64, weight: Weight<f64, C>);
}

/// The elements of a basis, lit or not.
pub(super) struct LitSink<'a, 'v, const C: usize, W> {
    pub(super) light: Option<&'a [Towards<'a>]>,
    pub(super) window: &'a mut W,
    pub(super) visit: &'a mut Visit<'v, C>,
}

impl<const C: usize, W: VoxelWindow<C>> Sink<C> for LitSink<'_, '_, C, W> {
    const IS_LOCAL: bool = true;

    fn light(&self) -> Option<impl Fn(f64) -> Weight<f64, C>> {
        self.light.map(|light| move |t| sum(light, t))
    }

    #[inline(always)]
    fn cell(&mut self, cell: [usize; 3], weights: [Weight<f64, C>; 8]) {
        self.window.add(cell, weights, self.visit);
    }

    #[inline(always)]
    fn piece(&mut self, cell: [usize; 3], piece: [f64; 2], tau: Weight<f64, C>, weight: Weight<f64, C>) {
        let weight = match self.light {
            None => weight,
            Some(light) => times(weight, mean(light, piece, tau)),
        };
        self.window.sample(cell, [0.0; 3], weight, self.visit);
    }

    #[inline(always)]
    fn node(&mut self, cell: [usize; 3], at: [f64; 3], t: f64, weight: Weight<f64, C>) {
        let weight = match self.light {
            None => weight,
            Some(light) => times(weight, sum(light, t)),
        };
        self.window.sample(cell, at, weight, self.visit);
    }
}

/// What all sources scatter at t.
#[inline(always)]
fn sum<const C: usize>(light: &[Towards], t: f64) -> Weight<f64, C> {
    let mut sum = [0.0; C];
    for source in light {
        let radiance = source.at(t);
        (0..C).for_each(|c| sum[c] += radiance[c]);
    }
    sum
}

/// The mean of that over what is extinguished in a piece, where it is a cubic.
#[inline(always)]
fn mean<const C: usize>(light: &[Towards], piece: [f64; 2], tau: Weight<f64, C>) -> Weight<f64, C> {
    let mut mean = [0.0; C];
    nodes(piece, tau, |t, share| {
        let at_node: Weight<f64, C> = sum(light, t);
        (0..C).for_each(|c| mean[c] += share[c] * at_node[c]);
    });
    mean
}

/// Visits places in a piece, each with its share of what is extinguished there a channel. Exact for cubics.
#[inline(always)]
fn nodes<const C: usize>([a, b]: [f64; 2], tau: Weight<f64, C>, mut visit: impl FnMut(f64, Weight<f64, C>)) {
    if tau.iter().all(|&other| other == tau[0]) {
        for [u, share] in exponential::gauss_2(tau[0]) {
            visit(a + u * (b - a), [share; C]);
        }
        return;
    }
    for c in 0..C {
        for [u, share] in exponential::gauss_2(tau[c]) {
            let mut mine = [0.0; C];
            mine[c] = share;
            visit(a + u * (b - a), mine);
        }
    }
}

/// The voxels of a cached light, trilinear between their centres, that an albedo scatters.
pub(super) struct ScatteredSink<'a, 'v, const C: usize> {
    /// The albedo, its value where that is the same everywhere, and what lies between its values.
    pub(super) albedo: &'a Volume,
    pub(super) uniform: Option<[f64; 3]>,
    pub(super) basis: Interpolation,
    /// The ray in cells of the light, and in voxels of the albedo.
    pub(super) in_light: CellRay,
    pub(super) in_albedo: CellRay,
    /// Voxels of the light.
    pub(super) size: [usize; 3],
    pub(super) window: &'a mut Trilinear<C>,
    pub(super) visit: &'a mut Visit<'v, C>,
}

impl<const C: usize> ScatteredSink<'_, '_, C> {
    #[inline(always)]
    fn sample(&mut self, t: f64, weight: Weight<f64, C>) {
        let at = self.in_light.at(t);
        // The cast rounds towards zero, and takes what lies before the first cell to it.
        let cell = std::array::from_fn(|axis| (at[axis] as usize).min(self.size[axis]));
        self.window.sample(cell, at, weight, self.visit);
    }

    #[inline(always)]
    fn albedo_of(&self, cell: [usize; 3]) -> Weight<f64, C> {
        if let Some(color) = self.uniform {
            return std::array::from_fn(|c| color[c]);
        }
        let color = self.albedo.color(self.albedo.grid().index(cell));
        std::array::from_fn(|c| f64::from(color[c]))
    }
}

impl<const C: usize> Sink<C> for ScatteredSink<'_, '_, C> {
    const IS_LOCAL: bool = false;

    fn light(&self) -> Option<impl Fn(f64) -> Weight<f64, C>> {
        None::<fn(f64) -> Weight<f64, C>>
    }

    fn cell(&mut self, _cell: [usize; 3], _weights: [Weight<f64, C>; 8]) {
        unreachable!("its elements are those of another grid")
    }

    #[inline(always)]
    fn piece(&mut self, cell: [usize; 3], piece: [f64; 2], tau: Weight<f64, C>, weight: Weight<f64, C>) {
        let weight = times(weight, self.albedo_of(cell));
        nodes(piece, tau, |t, share| self.sample(t, times(weight, share)));
    }

    #[inline(always)]
    fn node(&mut self, cell: [usize; 3], _at: [f64; 3], t: f64, weight: Weight<f64, C>) {
        let albedo = match self.basis {
            Interpolation::Trilinear if self.uniform.is_none() => {
                let color = self.albedo.interpolated(self.in_albedo.at(t));
                std::array::from_fn(|c| f64::from(color[c]))
            }
            _ => self.albedo_of(cell),
        };
        self.sample(t, times(weight, albedo));
    }
}

/// Adds up what one voxel gets from a ray that comes back to it.
pub(super) fn merged<const C: usize>(mut seen: Vec<([usize; 3], Weight<f64, C>)>, visit: &mut Visit<C>) {
    seen.sort_by_key(|&([i, j, k], _)| [k, j, i]);
    for same in seen.chunk_by(|a, b| a.0 == b.0) {
        let mut sum = [0.0; C];
        same.iter().for_each(|(_, weight)| add(&mut sum, *weight));
        visit(same[0].0, sum);
    }
}
