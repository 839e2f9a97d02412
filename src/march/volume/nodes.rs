//! Nodes of a quadrature along a ray through trilinear cells, in f32: products with walked rows are made of them.
//!
//! A walk weighs its nodes once; a gather evaluates the elements there, and a scatter spreads to them. So the two match by construction.

use std::ops::ControlFlow;

use super::super::Weight;
use super::blocks::{AROUND, Blocks};
use super::cells::{CellRay, Slabs};
use super::density::Density;
use super::light::Towards;
use super::quadrature::{GAUSS_2, GAUSS_4};
use crate::scene::BRICK;
use crate::simd::{Kernel, Number, Simd, Single, Wide, dispatch};

/// Pieces that are worked on together.
const PIECES: usize = 8;
/// A slab has three more at most.
const ROOM: usize = PIECES + 3;
/// Optical depth of a piece over which a rule's nodes are accurate enough; deeper ones are halved.
const DEEPEST: f32 = 0.5;
/// Halvings of a piece at most: 5e5 of optical depth are resolved.
const HALVINGS: u32 = 20;
/// Where there is no element.
const NOWHERE: u32 = u32::MAX;

type Lanes = [f32; PIECES];

/// Gauss' rule of `N` nodes on [0, 1], and the integrals up to each node of what is interpolated between all: those of an implicit
/// Runge–Kutta method (Butcher 1964).
pub(super) struct Rule<const N: usize> {
    /// Where each is, and what it weighs.
    nodes: [[f64; 2]; N],
    before: [[f64; N]; N],
}

pub(super) const ONE: Rule<1> = Rule { nodes: [[0.5, 1.0]], before: [[0.5]] };
pub(super) const TWO: Rule<2> =
    Rule { nodes: GAUSS_2, before: [[0.25, -0.038_675_134_594_812_9], [0.538_675_134_594_812_9, 0.25]] };
pub(super) const FOUR: Rule<4> = Rule {
    nodes: GAUSS_4,
    before: [
        [
            0.086_963_711_284_363_45,
            -0.026_604_180_084_998_79,
            0.012_627_462_689_404_727,
            -0.003_555_149_685_795_686_4,
        ],
        [
            0.188_118_117_499_868,
            0.163_036_288_715_635_7,
            -0.027_880_428_602_470_905,
            0.006_735_500_594_538_15,
        ],
        [
            0.167_191_921_974_188_6,
            0.353_953_006_033_743_97,
            0.163_036_288_715_636_25,
            -0.014_190_694_931_141_138,
        ],
        [
            0.177_482_572_254_522_02,
            0.313_445_114_741_868_6,
            0.352_676_757_516_270_1,
            0.086_963_711_284_363_57,
        ],
    ],
};

/// A medium in blocks.
pub(super) struct Medium<'a, const C: usize> {
    density: &'a Density,
    blocks: Blocks<AROUND>,
    /// Extinction in 1/metre.
    sigma_t: Vec<[f32; C]>,
}

impl<'a, const C: usize> Medium<'a, C> {
    pub(super) fn of(density: &'a Density) -> Self {
        let grid = density.grid();
        let blocks = Blocks::of(density.cells(), grid.size());
        let sigma_t = blocks.filled(|voxel| density.sigma_t_of(voxel));
        Self { density, blocks, sigma_t }
    }
}

/// Takes the weighted nodes of a ray in order.
pub(super) trait Take {
    /// Where the elements of a brick begin, by its first cell; none where there are none.
    fn enter(&mut self, first_cell: [usize; 3]) -> Option<u32>;

    /// A node: the place of the first of the eight elements around, the shares of the four pairs along x, that of the second of a pair,
    /// and the weight of all.
    fn node<S: Simd>(&mut self, simd: S, place: usize, pairs: [f32; 4], second: f32, weight: [f32; 4]);
}

/// A stretch of a ray through a medium, and what is done with its nodes.
pub(super) struct Stretch<'a, T, const C: usize, const N: usize> {
    pub(super) medium: &'a Medium<'a, C>,
    pub(super) ray: CellRay,
    pub(super) ends: [f64; 2],
    pub(super) rule: &'a Rule<N>,
    /// Whether a piece ends where a cell does; else where a slab does, of cells along the axis on which the ray is fastest.
    pub(super) by_cell: bool,
    /// What multiplies weights.
    pub(super) light: Option<&'a [Towards<'a>]>,
    /// Transmittance at which the rest of the ray is skipped.
    pub(super) bound: f64,
    pub(super) strength: &'a mut Weight<f64, C>,
    pub(super) take: &'a mut T,
}

impl<T: Take, const C: usize, const N: usize> Stretch<'_, T, C, N> {
    /// Walks it.
    pub(super) fn walk(self) {
        let Self { medium, ray, ends, rule, by_cell, light, bound, strength, take } = self;
        let top = if by_cell { 0.0 } else { (BRICK - 1) as f64 };
        let mut batch = Batch { medium, ray, rule, top, light, bound, strength, pieces: Pieces::new() };
        let walked = ray.bricks(medium.density.cells(), ends[0], ends[1], |low, high, a, b| {
            let Some(block) = medium.blocks.block(low) else { return ControlFlow::Continue(()) };
            let places = [(block * Blocks::<AROUND>::LEN) as u32, take.enter(low).unwrap_or(NOWHERE)];
            if by_cell {
                return ray.slabs(low, high, [a, b], &mut InCells { batch: &mut batch, take, low, places });
            }
            ray.each_slab(low, high, [a, b], |a, b| {
                batch.pieces.push(low.map(|cell| cell as f64), places, [a, b]);
                if batch.pieces.len >= PIECES { batch.settle(take) } else { ControlFlow::Continue(()) }
            })
        });
        if walked.is_continue() && batch.pieces.len > 0 {
            let _ends_here = batch.settle(take);
        }
    }
}

/// Takes the pieces of a brick in single cells.
struct InCells<'b, 'a, T, const C: usize, const N: usize> {
    batch: &'b mut Batch<'a, C, N>,
    take: &'b mut T,
    low: [usize; 3],
    places: [u32; 2],
}

impl<T: Take, const C: usize, const N: usize> Slabs for InCells<'_, '_, T, C, N> {
    #[inline(always)]
    fn piece(&mut self, cell: [usize; 3], a: f64, b: f64) {
        let mut from = 0;
        (0..3).for_each(|axis| from += (cell[axis] - self.low[axis]) * Blocks::<AROUND>::STRIDES[axis]);
        let places = self.places.map(|place| if place == NOWHERE { NOWHERE } else { place + from as u32 });
        self.batch.pieces.push(cell.map(|cell| cell as f64), places, [a, b]);
    }

    #[inline(always)]
    fn settle(&mut self) -> ControlFlow<()> {
        if self.batch.pieces.len >= PIECES { self.batch.settle(self.take) } else { ControlFlow::Continue(()) }
    }
}

/// Pieces of a ray that are waiting.
#[derive(Clone, Copy)]
struct Pieces {
    len: usize,
    /// Where they begin and end.
    from: [f64; ROOM],
    to: [f64; ROOM],
    /// The first cell of their brick, or their own.
    low: [[f64; ROOM]; 3],
    /// Where extinction and elements of that begin.
    places: [[u32; ROOM]; 2],
}

impl Pieces {
    fn new() -> Self {
        Self {
            len: 0,
            from: [0.0; ROOM],
            to: [0.0; ROOM],
            low: [[0.0; ROOM]; 3],
            places: [[0; ROOM], [NOWHERE; ROOM]],
        }
    }

    /// Adds a piece, if it has a length.
    #[inline(always)]
    fn push(&mut self, low: [f64; 3], places: [u32; 2], [a, b]: [f64; 2]) {
        let at = self.len;
        (self.from[at], self.to[at]) = (a, b);
        (0..3).for_each(|axis| self.low[axis][at] = low[axis]);
        (0..2).for_each(|k| self.places[k][at] = places[k]);
        self.len += usize::from(b > a);
    }

    /// Forgets those that were worked on.
    #[inline(always)]
    fn forget(&mut self) {
        self.from.copy_within(PIECES.., 0);
        self.to.copy_within(PIECES.., 0);
        (0..3).for_each(|axis| self.low[axis].copy_within(PIECES.., 0));
        (0..2).for_each(|k| self.places[k].copy_within(PIECES.., 0));
        self.len = self.len.saturating_sub(PIECES);
    }

    /// Both halves of half of them.
    fn halved(&self, part: usize) -> Self {
        let mut halves = Self::new();
        for n in part * PIECES / 2..self.len.min((part + 1) * PIECES / 2) {
            let (a, b) = (self.from[n], self.to[n]);
            let middle = 0.5 * (a + b);
            let low = std::array::from_fn(|axis| self.low[axis][n]);
            let places = std::array::from_fn(|k| self.places[k][n]);
            halves.push(low, places, [a, middle]);
            halves.push(low, places, [middle, b]);
        }
        halves
    }
}

struct Batch<'a, const C: usize, const N: usize> {
    medium: &'a Medium<'a, C>,
    ray: CellRay,
    rule: &'a Rule<N>,
    /// How far the last cell of a piece can be from the first.
    top: f64,
    light: Option<&'a [Towards<'a>]>,
    bound: f64,
    strength: &'a mut Weight<f64, C>,
    pieces: Pieces,
}

/// Where nodes lie.
struct Placed<const N: usize> {
    /// How far behind the first value of their pieces, and between the two cells along each axis.
    local: [[u32; PIECES]; N],
    within: [[Lanes; N]; 3],
    /// The shares of the four pairs of values along x.
    pairs: [[Lanes; 4]; N],
}

/// What is extinguished.
struct Gone<const C: usize, const N: usize> {
    /// Of light of strength 1 that enters the piece, at each node.
    nodes: [[Lanes; N]; C],
    all: [Lanes; C],
    /// The largest optical depth that a node stands for.
    deepest: f32,
}

/// What came of pieces.
enum Settled {
    /// The ray goes on.
    GoesOn,
    /// Too little is left.
    Ends,
    /// Nothing: they are too deep.
    TooDeep,
}

/// Works on the pieces that are ready.
struct Settle<'s, 'a, T, const C: usize, const N: usize>(&'s mut Batch<'a, C, N>, &'s mut T, bool);

impl<T: Take, const C: usize, const N: usize> Kernel for Settle<'_, '_, T, C, N> {
    type Output = Settled;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Settled {
        let Self(batch, take, may_halve) = self;
        let placed = batch.placed(simd);
        let gone = batch.gone(simd, &placed);
        if gone.deepest > DEEPEST && may_halve {
            Settled::TooDeep
        } else {
            batch.spend(simd, &placed, &gone, take)
        }
    }
}

impl<const C: usize, const N: usize> Batch<'_, C, N> {
    /// Works on what is ready; says whether the ray goes on.
    #[inline(always)]
    fn settle(&mut self, take: &mut impl Take) -> ControlFlow<()> {
        match dispatch(Settle(self, take, true)) {
            Settled::GoesOn => {}
            Settled::Ends => return ControlFlow::Break(()),
            Settled::TooDeep => self.settle_halves(take, HALVINGS)?,
        }
        self.pieces.forget();
        ControlFlow::Continue(())
    }

    /// The same for pieces that are too deep.
    #[inline(never)]
    fn settle_halves(&mut self, take: &mut impl Take, halvings: u32) -> ControlFlow<()> {
        let all = self.pieces;
        for part in 0..2 {
            self.pieces = all.halved(part);
            match dispatch(Settle(self, take, halvings > 1)) {
                Settled::GoesOn => {}
                Settled::Ends => return ControlFlow::Break(()),
                Settled::TooDeep => self.settle_halves(take, halvings - 1)?,
            }
        }
        self.pieces = all;
        ControlFlow::Continue(())
    }

    /// Where the nodes lie.
    #[inline(always)]
    fn placed<S: Simd>(&self, simd: S) -> Placed<N> {
        // The lowest bits of a number between 2^52 and 2^53 are its integer part.
        const INTEGER: f64 = (1_u64 << 52) as f64;
        let (ray, pieces) = (&self.ray, &self.pieces);
        let mut placed = Placed {
            local: [[0; PIECES]; N],
            within: [[[0.0; PIECES]; N]; 3],
            pairs: [[[0.0; PIECES]; 4]; N],
        };
        let splat = |value: f64| Wide::splat(simd, value);
        let (none, top) = (splat(0.0), splat(self.top));
        for n in 0..N {
            let mut local = [0.0; PIECES];
            let mut within = [[0.0; PIECES]; 3];
            for part in 0..PIECES / Wide::<S>::LANES {
                let from = Wide::of(simd, &pieces.from[..PIECES], part);
                let to = Wide::of(simd, &pieces.to[..PIECES], part);
                let t = from + (to - from) * self.rule.nodes[n][0];
                let mut sum = splat(INTEGER);
                for axis in 0..3 {
                    let low = Wide::of(simd, &pieces.low[axis][..PIECES], part);
                    let at = splat(ray.origin[axis]) + t * ray.slope[axis] - low;
                    // The integer below, or the same one: the sum is rounded to an integer.
                    let cell = (at + splat(INTEGER - 0.5)) - splat(INTEGER);
                    let cell = cell.larger(none).smaller(top);
                    sum = sum + cell * Blocks::<AROUND>::STRIDES[axis] as f64;
                    (at - cell).store(&mut within[axis], part);
                }
                sum.store(&mut local, part);
            }
            for lane in 0..PIECES {
                placed.local[n][lane] = local[lane].to_bits() as u32;
            }
            for axis in 0..3 {
                for lane in 0..PIECES {
                    placed.within[axis][n][lane] = within[axis][lane] as f32;
                }
            }
            for part in 0..PIECES / Single::<S>::LANES {
                let y = Single::of(simd, &placed.within[1][n], part);
                let z = Single::of(simd, &placed.within[2][n], part);
                let both = y * z;
                (Single::splat(simd, 1.0) - y - (z - both)).store(&mut placed.pairs[n][0], part);
                (y - both).store(&mut placed.pairs[n][1], part);
                (z - both).store(&mut placed.pairs[n][2], part);
                both.store(&mut placed.pairs[n][3], part);
            }
        }
        placed
    }

    /// Extinction at a node of each piece.
    #[inline(always)]
    fn corners(&self, local: &[u32; PIECES]) -> [[Lanes; 8]; C] {
        let mut corners = [[[0.0_f32; PIECES]; 8]; C];
        for lane in 0..PIECES {
            let place = (self.pieces.places[0][lane] + local[lane]) as usize;
            let Some(around) = self.medium.sigma_t[place..].first_chunk::<SPAN>() else { continue };
            for c in 0..C {
                for tap in 0..8 {
                    corners[c][tap][lane] = around[STEPS[tap]][c];
                }
            }
        }
        corners
    }

    /// What is extinguished.
    #[inline(always)]
    fn gone<S: Simd>(&self, simd: S, placed: &Placed<N>) -> Gone<C, N> {
        let (pieces, rule) = (&self.pieces, self.rule);
        let mut lengths = [0.0; PIECES];
        for lane in 0..PIECES {
            lengths[lane] = (pieces.to[lane] - pieces.from[lane]) as f32;
        }
        let mut gone = Gone { nodes: [[[0.0; PIECES]; N]; C], all: [[0.0; PIECES]; C], deepest: 0.0 };
        let none = Single::splat(simd, 0.0);
        let mut tau = [[[0.0_f32; PIECES]; N]; C];
        for n in 0..N {
            let corners = self.corners(&placed.local[n]);
            for c in 0..C {
                for part in 0..PIECES / Single::<S>::LANES {
                    let of = |lanes: &Lanes| Single::of(simd, lanes, part);
                    let mut corner = [none; 8];
                    for tap in 0..8 {
                        corner[tap] = of(&corners[c][tap]);
                    }
                    let x = of(&placed.within[0][n]);
                    let (y, z) = (of(&placed.within[1][n]), of(&placed.within[2][n]));
                    let low = between(between(corner[0], corner[1], x), between(corner[2], corner[3], x), y);
                    let high = between(between(corner[4], corner[5], x), between(corner[6], corner[7], x), y);
                    (between(low, high, z) * of(&lengths)).store(&mut tau[c][n], part);
                }
            }
        }
        let mut deepest = [0.0_f32; PIECES];
        for c in 0..C {
            for part in 0..PIECES / Single::<S>::LANES {
                let mut here = [none; N];
                let mut depth = none;
                let mut most = Single::of(simd, &deepest, part);
                for n in 0..N {
                    here[n] = Single::of(simd, &tau[c][n], part);
                    depth = depth + here[n] * rule.nodes[n][1];
                    most = most.larger(here[n]);
                }
                most.store(&mut deepest, part);
                let mut mine = [none; N];
                let mut sum = Single::splat(simd, 1e-30);
                for n in 0..N {
                    let mut before = none;
                    for m in 0..N {
                        before = before + here[m] * rule.before[n][m];
                    }
                    mine[n] = (here[n] - here[n] * extinguished(before)) * rule.nodes[n][1];
                    sum = sum + mine[n];
                }
                // What is extinguished at the nodes is what is missing behind the piece.
                let all = extinguished(depth);
                let scale = all / sum;
                all.store(&mut gone.all[c], part);
                for n in 0..N {
                    (mine[n] * scale).store(&mut gone.nodes[c][n], part);
                }
            }
        }
        for lane in 0..pieces.len.min(PIECES) {
            gone.deepest = gone.deepest.max(deepest[lane]);
        }
        gone
    }

    /// Hands the weighted nodes on.
    #[inline(always)]
    fn spend<S: Simd>(
        &mut self,
        simd: S,
        placed: &Placed<N>,
        gone: &Gone<C, N>,
        take: &mut impl Take,
    ) -> Settled {
        let pieces = &self.pieces;
        for lane in 0..pieces.len.min(PIECES) {
            let mut entering = [0.0_f32; C];
            for c in 0..C {
                entering[c] = self.strength[c] as f32;
                self.strength[c] -= self.strength[c] * f64::from(gone.all[c][lane]);
            }
            if pieces.places[1][lane] == NOWHERE || is_zero(&gone.all, lane) {
                continue;
            }
            for n in 0..N {
                let mut weight = [entering[0] * gone.nodes[0][n][lane]; 4];
                for c in 1..C {
                    weight[c] = entering[c] * gone.nodes[c][n][lane];
                }
                if let Some(light) = self.light {
                    let t = pieces.from[lane] + self.rule.nodes[n][0] * (pieces.to[lane] - pieces.from[lane]);
                    let lit = lit(light, t);
                    (0..3).for_each(|c| weight[c] *= lit[c]);
                }
                let place = (pieces.places[1][lane] + placed.local[n][lane]) as usize;
                let mut pairs = [0.0; 4];
                for pair in 0..4 {
                    pairs[pair] = placed.pairs[n][pair][lane];
                }
                take.node(simd, place, pairs, placed.within[0][n][lane], weight);
            }
        }
        let mut goes_on = false;
        for c in 0..C {
            goes_on |= self.strength[c] > self.bound;
        }
        if goes_on { Settled::GoesOn } else { Settled::Ends }
    }
}

/// Whether nothing is extinguished in a piece.
#[inline(always)]
fn is_zero<const C: usize>(all: &[Lanes; C], lane: usize) -> bool {
    let mut is_zero = true;
    for c in 0..C {
        is_zero &= all[c][lane] == 0.0;
    }
    is_zero
}

/// From one number to another, as f goes from 0 to 1.
#[inline(always)]
fn between<T: Number>(low: T, high: T, f: T) -> T {
    low + f * (high - low)
}

/// What all sources scatter at t.
fn lit(light: &[Towards], t: f64) -> [f32; 3] {
    let mut sum = [0.0; 3];
    for source in light {
        let radiance = source.at(t);
        (0..3).for_each(|c| sum[c] += radiance[c]);
    }
    sum.map(|radiance| radiance as f32)
}

/// 1 − e^{−τ} for τ up to 2 [`DEEPEST`], to 5e-6, and up to it to 2e-8: its series.
#[inline(always)]
fn extinguished<T: Number>(tau: T) -> T {
    const FACTORIALS: [f64; 7] = [5040.0, 720.0, 120.0, 24.0, 6.0, 2.0, 1.0];
    let mut sum = tau.constant(1.0 / 40_320.0);
    for factorial in FACTORIALS {
        sum = tau.constant(1.0 / factorial) - tau * sum;
    }
    tau * sum
}

/// How far behind the first the values around a cell stand; x in the lowest bit of the place, then y, then z.
const STEPS: [usize; 8] = {
    let mut steps = [0; 8];
    let mut tap = 0;
    while tap < 8 {
        let [x, y, z] = Blocks::<AROUND>::STRIDES;
        steps[tap] = (tap >> 2) * z + (tap >> 1 & 1) * y + (tap & 1) * x;
        tap += 1;
    }
    steps
};
/// The first values of the four pairs along x.
pub(super) const PAIRS: [usize; 4] = [STEPS[0], STEPS[2], STEPS[4], STEPS[6]];
/// Values from the first around a cell to the last.
pub(super) const SPAN: usize = STEPS[7] + 1;

#[cfg(test)]
mod tests {
    use super::*;

    /// How far a rule's integrals of u, u², … up to its nodes and to 1 are off, at most.
    fn off<const N: usize>(rule: &Rule<N>) -> f64 {
        let mut worst = 0.0_f64;
        for power in 0..N as i32 {
            let integral = |u: f64| u.powi(power + 1) / f64::from(power + 1);
            let at = |m: usize| rule.nodes[m][0].powi(power);
            for n in 0..N {
                let before: f64 = (0..N).map(|m| rule.before[n][m] * at(m)).sum();
                worst = worst.max((before - integral(rule.nodes[n][0])).abs());
            }
            let all: f64 = (0..N).map(|m| rule.nodes[m][1] * at(m)).sum();
            worst = worst.max((all - integral(1.0)).abs());
        }
        worst
    }

    #[test]
    fn rules_integrate_polynomials() {
        assert!([off(&ONE), off(&TWO), off(&FOUR)].iter().all(|off| *off < 1e-14));
        let mut other = FOUR;
        other.before[2][1] += 1e-13;
        assert!(off(&other) > 1e-14);
    }

    #[test]
    fn what_is_extinguished_is_that_of_the_exponential() {
        let worst = |most: f32| {
            let taus = (1..=1000).map(|k| f64::from(most) * f64::from(k) / 1000.0);
            taus.map(|tau| (extinguished(tau) / -(-tau).exp_m1() - 1.0).abs()).fold(0.0, f64::max)
        };
        assert!(worst(DEEPEST) <= 2e-8, "{:e}", worst(DEEPEST));
        assert!(worst(2.0 * DEEPEST) <= 5e-6, "{:e}", worst(2.0 * DEEPEST));
        assert!(worst(4.0 * DEEPEST) > 5e-6);
    }
}
