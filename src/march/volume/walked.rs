//! Products with rows that are walked anew: elements are copied into blocks, and rows pass through those.

use rayon::prelude::*;

use super::super::{Real, Traversal, gathered_rows};
use super::blocks::{AROUND, Blocks, WITHIN};
use super::cells::CellRay;
use super::elements::{Quantity, VoxelElements};
use super::nodes::{FOUR, Medium, ONE, PAIRS, Rule, SPAN, Stretch, TWO, Take};
use super::{VolumeTransport, VolumeTraversal};
use crate::scene::{Interpolation, Quadrature, VoxelGrid};
use crate::simd::{Simd, Single};

/// Elements whose copying pays for a row.
const ELEMENTS_A_ROW: usize = 64;
/// Runs of rows whose sums are apart, and the rows of one at least.
const RUNS: usize = 16;
/// Runs that are walked at the same time where memory is short.
const ROOMS: u64 = 4;
const LEAST_RUN: usize = 1024;
/// An error of T x, relative, from which on these are taken: one node a slab, two a slab, and two a cell.
const ONE_A_SLAB: f64 = 2e-3;
const TWO_A_SLAB: f64 = 2e-4;
const TWO_A_CELL: f64 = 1e-5;

/// How the rows of a part are walked.
#[derive(Clone, Copy)]
enum Way {
    /// By nodes of a quadrature: its elements, and those of the medium, are trilinear between the centres of the same voxels.
    Nodes,
    /// By lengths in voxels.
    Lengths,
}

/// What is done with a row.
trait Pass: Take {
    /// A length in metres in a voxel, by the place of its element.
    fn length(&mut self, place: usize, length: f32);
}

/// A row of T x.
struct Gather<'a, const SIDE: usize> {
    blocks: &'a Blocks<SIDE>,
    x: &'a [[f32; 4]],
    sum: [f64; 4],
}

/// A row of y, on its way to Tᵀ y.
struct Scatter<'a, const SIDE: usize> {
    blocks: &'a Blocks<SIDE>,
    y: [f32; 4],
    sums: &'a mut [[f32; 4]],
    /// The last run that met each block, and the number of this one.
    met: &'a mut [u32],
    run: u32,
}

impl<const SIDE: usize> Take for Gather<'_, SIDE> {
    #[inline(always)]
    fn enter(&mut self, first_cell: [usize; 3]) -> Option<u32> {
        self.blocks.block(first_cell).map(|block| (block * Blocks::<SIDE>::LEN) as u32)
    }

    #[inline(always)]
    fn node<S: Simd>(&mut self, simd: S, place: usize, pairs: [f32; 4], second: f32, weight: [f32; 4]) {
        let Some(around) = self.x[place..].first_chunk::<SPAN>() else { return };
        let around = around.as_flattened();
        let mut sum = [0.0_f32; 8];
        for part in 0..8 / Single::<S>::LANES {
            let of = |pair: usize| {
                let values = &around[4 * PAIRS[pair]..4 * PAIRS[pair] + 8];
                Single::of(simd, values, part) * Single::splat(simd, pairs[pair])
            };
            (of(0) + of(1) + (of(2) + of(3))).store(&mut sum, part);
        }
        for c in 0..4 {
            let between = sum[c] + second * (sum[c + 4] - sum[c]);
            self.sum[c] += f64::from(weight[c] * between);
        }
    }
}

impl<const SIDE: usize> Pass for Gather<'_, SIDE> {
    #[inline(always)]
    fn length(&mut self, place: usize, length: f32) {
        for c in 0..4 {
            self.sum[c] += f64::from(length * self.x[place][c]);
        }
    }
}

impl<const SIDE: usize> Take for Scatter<'_, SIDE> {
    #[inline(always)]
    fn enter(&mut self, first_cell: [usize; 3]) -> Option<u32> {
        let block = self.blocks.block(first_cell)?;
        let first = block * Blocks::<SIDE>::LEN;
        if self.met[block] != self.run {
            self.met[block] = self.run;
            self.sums[first..first + Blocks::<SIDE>::LEN].fill([0.0; 4]);
        }
        Some(first as u32)
    }

    #[inline(always)]
    fn node<S: Simd>(&mut self, simd: S, place: usize, pairs: [f32; 4], second: f32, weight: [f32; 4]) {
        let Some(around) = self.sums[place..].first_chunk_mut::<SPAN>() else { return };
        let around = around.as_flattened_mut();
        let mut sent = [0.0_f32; 8];
        for c in 0..4 {
            let all = weight[c] * self.y[c];
            sent[c + 4] = second * all;
            sent[c] = all - sent[c + 4];
        }
        for pair in 0..4 {
            let values = &mut around[4 * PAIRS[pair]..4 * PAIRS[pair] + 8];
            for part in 0..8 / Single::<S>::LANES {
                let sent = Single::of(simd, &sent, part) * Single::splat(simd, pairs[pair]);
                (Single::of(simd, values, part) + sent).store(values, part);
            }
        }
    }
}

impl<const SIDE: usize> Pass for Scatter<'_, SIDE> {
    #[inline(always)]
    fn length(&mut self, place: usize, length: f32) {
        for c in 0..4 {
            self.sums[place][c] += length * self.y[c];
        }
    }
}

/// The elements of a part, copied.
enum Copied {
    Around(Blocks<AROUND>, Vec<[f32; 4]>),
    Within(Blocks<WITHIN>, Vec<[f32; 4]>),
}

/// The elements of a part in blocks, from its part of x.
fn copied<const SIDE: usize, X: Real>(part: &VoxelElements, x: &[[X; 3]]) -> (Blocks<SIDE>, Vec<[f32; 4]>) {
    let blocks = Blocks::of(&part.cells, part.grid.size());
    let values = blocks.filled(|voxel| match part.voxels.number(voxel) {
        None => [0.0; 4],
        Some(number) => {
            let [r, g, b] = x[number as usize].map(|value| value.wide() as f32);
            [r, g, b, 0.0]
        }
    });
    (blocks, values)
}

impl VolumeTraversal {
    /// How the rows of each part are walked, if all can be.
    fn ways(&self) -> Option<Vec<Way>> {
        let VolumeTransport { basis, quadrature, ref density, .. } = self.transport;
        let way = |part: &VoxelElements| {
            let between = |grid: &VoxelGrid| *grid == part.grid && basis == Interpolation::Trilinear;
            let is_medium = between(density.grid()) && density.interpolation() == basis;
            match &part.quantity {
                Quantity::Emission if is_medium => Some(Way::Nodes),
                Quantity::Albedo(light) if is_medium => {
                    light.fields().iter().all(|field| between(field.radiance.grid())).then_some(Way::Nodes)
                }
                Quantity::Extinction if basis == Interpolation::Nearest => Some(Way::Lengths),
                _ => None,
            }
        };
        if quadrature != Quadrature::Exact { None } else { self.parts.iter().map(way).collect() }
    }

    /// The medium in blocks, where a part needs it.
    fn medium<const C: usize>(&self, ways: &[Way]) -> Option<Medium<'_, C>> {
        let needs = ways.iter().any(|way| matches!(way, Way::Nodes));
        needs.then(|| Medium::of(&self.transport.density))
    }

    /// Bytes of the copied elements of each part.
    fn copies(&self, ways: &[Way]) -> Vec<u64> {
        let bytes = |(part, way): (&VoxelElements, &Way)| {
            let values = match way {
                Way::Nodes => Blocks::<AROUND>::values(&part.cells),
                Way::Lengths => Blocks::<WITHIN>::values(&part.cells),
            };
            (values * size_of::<[f32; 4]>()) as u64
        };
        self.parts.iter().zip(ways).map(bytes).collect()
    }

    fn medium_bytes<const C: usize>(&self, ways: &[Way]) -> u64 {
        let needs = ways.iter().any(|way| matches!(way, Way::Nodes));
        let values = if needs { Blocks::<AROUND>::values(self.transport.density.cells()) } else { 0 };
        (values * size_of::<[f32; C]>()) as u64
    }

    /// Bytes that the products ask for: those of a scatter of a few runs at once. The same for any number of threads, for what is kept
    /// depends on it.
    pub(super) fn room<const C: usize>(&self) -> u64 {
        self.ways().map_or(0, |ways| self.needed::<C>(&ways, ROOMS))
    }

    /// Bytes that both products take, of which a scatter walks so many runs at once.
    fn needed<const C: usize>(&self, ways: &[Way], runs: u64) -> u64 {
        let copies = self.copies(ways);
        let scatter = copies.iter().max().map_or(0, |copy| (1 + runs) * copy);
        self.medium_bytes::<C>(ways) + scatter.max(copies.iter().sum())
    }

    /// How the rows of each part are walked, where so many are enough to pay for copies, and the copies fit. One answer for both products,
    /// so that they match.
    fn fitting_ways<X: Real, const C: usize>(&self, rows: usize, room: u64) -> Option<Vec<Way>> {
        let elements: usize = self.parts.iter().map(|part| part.voxels.len()).sum();
        let pays = X::IS_SINGLE && rows * ELEMENTS_A_ROW >= elements;
        self.ways().filter(|ways| pays && self.needed::<C>(ways, 1) <= room)
    }

    /// Some rows of T x, as [`Traversal::gather_rows`] has them.
    pub(super) fn gathered_rows<X: Real, const C: usize>(
        &self,
        x: &[[X; 3]],
        row: &(dyn Fn(usize) -> usize + Sync),
        y: &mut [[X; 4]],
        room: u64,
    ) {
        let Some(ways) = self.fitting_ways::<X, C>(y.len(), room) else {
            return gathered_rows(y, &|k| Traversal::<f64, C>::gather(self, row(k), x).map(Real::wide));
        };
        let medium = self.medium::<C>(&ways);
        let mut rest = x;
        let mut parts = Vec::new();
        for (part, way) in self.parts.iter().zip(ways) {
            let (mine, others) = rest.split_at(part.voxels.len());
            rest = others;
            parts.push(match way {
                Way::Nodes => {
                    let (blocks, x) = copied(part, mine);
                    Copied::Around(blocks, x)
                }
                Way::Lengths => {
                    let (blocks, x) = copied(part, mine);
                    Copied::Within(blocks, x)
                }
            });
        }
        gathered_rows(y, &|k| {
            let mut sum = [0.0; 4];
            for (part, elements) in self.parts.iter().zip(&parts) {
                let of = match elements {
                    Copied::Around(blocks, x) => {
                        let mut gather = Gather { blocks, x, sum: [0.0; 4] };
                        self.pass_nodes(row(k), part, medium.as_ref(), &mut gather);
                        gather.sum
                    }
                    Copied::Within(blocks, x) => {
                        let mut gather = Gather { blocks, x, sum: [0.0; 4] };
                        self.pass_lengths(row(k), part, &mut gather);
                        gather.sum
                    }
                };
                (0..4).for_each(|c| sum[c] += of[c]);
            }
            [sum[0], sum[1], sum[2]]
        });
    }

    /// Tᵀ y of some rows, as [`Traversal::scatter_rows`] has it.
    pub(super) fn scattered_rows<X: Real, const C: usize>(
        &self,
        rows: usize,
        y: &(dyn Fn(usize) -> (usize, [X; 3]) + Sync),
        room: u64,
    ) -> Option<Vec<[X; 3]>> {
        let ways = self.fitting_ways::<X, C>(rows, room)?;
        let copy = self.copies(&ways).into_iter().max().unwrap_or(0).max(1);
        // One for all, and one for each run that is walked at the same time.
        let at_once = ((room - self.medium_bytes::<C>(&ways)) / copy).saturating_sub(1).max(1);
        let medium = self.medium::<C>(&ways);
        let y = |k: usize| {
            let (row, [r, g, b]) = y(k);
            (row, [r, g, b, X::zero()].map(|value| value.wide() as f32))
        };
        let mut x = Vec::new();
        for (part, way) in self.parts.iter().zip(ways) {
            match way {
                Way::Nodes => scattered::<X, AROUND>(part, (rows, at_once), &mut x, &|k, scatter| {
                    let row;
                    (row, scatter.y) = y(k);
                    self.pass_nodes(row, part, medium.as_ref(), scatter);
                }),
                Way::Lengths => scattered::<X, WITHIN>(part, (rows, at_once), &mut x, &|k, scatter| {
                    let row;
                    (row, scatter.y) = y(k);
                    self.pass_lengths(row, part, scatter);
                }),
            }
        }
        Some(x)
    }

    /// Walks a row by the nodes of a quadrature that is as exact as asked for.
    fn pass_nodes<const C: usize>(
        &self,
        row: usize,
        part: &VoxelElements,
        medium: Option<&Medium<'_, C>>,
        pass: &mut impl Take,
    ) {
        let Some(medium) = medium else { return };
        match self.transport.accuracy {
            accuracy if accuracy >= ONE_A_SLAB => self.pass_by(row, part, (medium, &ONE, false), pass),
            accuracy if accuracy >= TWO_A_SLAB => self.pass_by(row, part, (medium, &TWO, false), pass),
            accuracy if accuracy >= TWO_A_CELL => self.pass_by(row, part, (medium, &TWO, true), pass),
            _ => self.pass_by(row, part, (medium, &FOUR, true), pass),
        }
    }

    fn pass_by<const C: usize, const N: usize>(
        &self,
        row: usize,
        part: &VoxelElements,
        (medium, rule, by_cell): (&Medium<'_, C>, &Rule<N>, bool),
        take: &mut impl Take,
    ) {
        let bound = self.transport.transmittance_bound;
        let mut strength = [1.0; C];
        self.each_line(row, |line, a, b| {
            let ray = CellRay::new(line, &part.grid, 0.5);
            let Some(ends) = self.transport.density.clipped(&ray, a, b) else { return true };
            let light = part.quantity.light(line);
            let light = light.as_deref();
            Stretch { medium, ray, ends, rule, by_cell, light, bound, strength: &mut strength, take }.walk();
            strength.iter().any(|&left| left > bound)
        });
    }

    /// Walks a row by its lengths in voxels.
    fn pass_lengths(&self, row: usize, part: &VoxelElements, pass: &mut impl Pass) {
        let size = part.grid.size().map(|side| side as f64);
        self.each_line(row, |line, a, b| {
            let ray = CellRay::new(line, &part.grid, 0.0);
            let Some([a, b]) = ray.clip(0.0, size, a, b) else { return true };
            let _all_visited = ray.bricks(&part.cells, a, b, |low, high, a, b| {
                let Some(first) = pass.enter(low) else { return std::ops::ControlFlow::Continue(()) };
                ray.slabs(low, high, [a, b], &mut |voxel: [usize; 3], a: f64, b: f64| {
                    let mut place = first as usize;
                    (0..3).for_each(|axis| {
                        place += (voxel[axis] - low[axis]) * Blocks::<WITHIN>::STRIDES[axis]
                    });
                    pass.length(place, (b - a) as f32);
                })
            });
            true
        });
    }
}

/// Appends what some rows send to the elements of a part; `pass` walks one.
///
/// Runs of rows have sums of their own, which are added in the order of the runs: the same bits for any number of threads.
fn scattered<X: Real, const SIDE: usize>(
    part: &VoxelElements,
    (rows, at_once): (usize, u64),
    x: &mut Vec<[X; 3]>,
    pass: &(dyn Fn(usize, &mut Scatter<SIDE>) + Sync),
) {
    let blocks = &Blocks::<SIDE>::of(&part.cells, part.grid.size());
    let run = rows.div_ceil(RUNS).max(LEAST_RUN);
    let runs = rows.div_ceil(run);
    let values = blocks.len() * Blocks::<SIDE>::LEN;
    let mut all = vec![[0.0_f32; 4]; values];
    let at_once = rayon::current_num_threads().min(runs).min(at_once as usize);
    let mut rooms: Vec<_> =
        (0..at_once).map(|_| (vec![[0.0_f32; 4]; values], vec![u32::MAX; blocks.len()])).collect();
    for first in (0..runs).step_by(at_once) {
        rooms.par_iter_mut().enumerate().for_each(|(n, (sums, met))| {
            let number = first + n;
            let mut scatter = Scatter { blocks, y: [0.0; 4], sums, met, run: number as u32 };
            (number * run..((number + 1) * run).min(rows)).for_each(|k| pass(k, &mut scatter));
        });
        all.par_chunks_mut(Blocks::<SIDE>::LEN).enumerate().for_each(|(block, all)| {
            for (n, (sums, met)) in rooms.iter().enumerate() {
                if met[block] == (first + n) as u32 {
                    let sums = &sums[block * Blocks::<SIDE>::LEN..];
                    all.iter_mut().zip(sums).for_each(|(all, sum)| (0..4).for_each(|c| all[c] += sum[c]));
                }
            }
        });
    }
    let indices = part.voxels.indices();
    x.par_extend(indices.par_iter().map(|&index| {
        let mut sum = [0.0_f32; 4];
        blocks.each_copy(part.grid.voxel(index as usize), |place| {
            (0..4).for_each(|c| sum[c] += all[place][c]);
        });
        [sum[0], sum[1], sum[2]].map(|sum| X::of(sum.into()))
    }));
}
