use rayon::prelude::*;

use super::products::{Padded, padded, padded_weight, plus, times};
use crate::march::{Real, Weight, channel};
use crate::operator::{
    Bounds, CpuVector, MatrixRows, Metric, Scalars, TILE_SIDE as SIDE, TileBlocks, Tiling, parallel,
};
use crate::{Error, Result};

/// Rows that are sorted by tile before the tiles add them up.
const ROWS_AT_ONCE: usize = 4096;
/// Tiles that one task adds up: enough tasks to share out, few enough that looking for their runs costs little.
const SHARDS: usize = 32;

/// A metric of dense blocks, one a tile: it majorizes Tᵀ diag(w) T, and knows how neighbours pull at each other.
///
/// With a_kB the part of row k inside tile B, the block of B is `Σ_k w_k (|a_k| / |a_kB|) a_kB a_kBᵀ`, |·| the sum of
/// the (non-negative) weights. By convexity Σ_B of its quadratic forms is at least ‖W T x‖²; with tiles of one element it is
/// the separable quadratic surrogate, with one tile it is Tᵀ W T itself.
///
/// Inverting takes one symmetric sweep of Gauss and Seidel, which is exact in a metric S ⪰ M; within bounds, each
/// element is moved to the bound that it meets.
#[derive(Debug)]
pub struct TileMetric<F, const C: usize> {
    tiles: Vec<Tile<F, C>>,
    /// The unknowns in the order of the tiles.
    order: Vec<u32>,
}

#[derive(Debug)]
struct Tile<F, const C: usize> {
    /// Row by row; symmetric.
    matrix: Vec<[F; C]>,
    /// The reciprocals of the diagonal.
    inverse: Vec<[F; C]>,
    /// The reciprocals of the sums of the rows: the inverse of the separable surrogate.
    inverse_sums: Vec<[F; C]>,
}

/// The part of some rows inside the tiles, run by run.
struct Runs<F, const C: usize> {
    /// Tile, factor, and where the run ends in `entries`.
    runs: Vec<(u32, [f64; C], usize)>,
    entries: Entries<F, C>,
}

/// Places inside a tile, and what a row weighs there.
type Entries<F, const C: usize> = Vec<(u8, Weight<F, C>)>;

/// What a tile computes on its part of a vector, given which unknowns that are.
type Work<'a, F, const C: usize> = &'a (dyn Fn(&Tile<F, C>, &mut [Padded<F>], &[u32]) + Sync);

impl<F: Real, const C: usize> TileMetric<F, C> {
    /// Σ_k w_k (|a_k| / |a_kB|) a_kB a_kBᵀ of every tile, with `added` on its diagonal, unknown by unknown.
    ///
    /// Cost: one visit of all rows, and the square of its length inside a tile for every run.
    ///
    /// Errors: [`Error::Shape`] when there is not one weight a row, or not one addition an unknown.
    pub fn new(
        rows: &impl MatrixRows<F, C>,
        tiling: &Tiling,
        weights: &[f64],
        added: &[f64],
    ) -> Result<Self> {
        let sorted = |of: &[usize]| Runs::sorted(rows, tiling, weights, of);
        Self::of_runs(rows.rows(), &sorted, tiling, weights, added)
    }

    /// The same, where `sorted` gives the runs of some rows.
    fn of_runs(
        rows: usize,
        sorted: &(dyn Fn(&[usize]) -> Runs<F, C> + Sync),
        tiling: &Tiling,
        weights: &[f64],
        added: &[f64],
    ) -> Result<Self> {
        let unknowns = tiling.members().iter().map(Vec::len).sum();
        if weights.len() != rows {
            return Err(Error::Shape { what: "the weights", expected: rows, got: weights.len() });
        }
        if added.len() != unknowns {
            return Err(Error::Shape { what: "the diagonal", expected: unknowns, got: added.len() });
        }
        let mut matrices: Vec<Vec<[F; C]>> =
            tiling.members().iter().map(|members| vec![[F::zero(); C]; members.len().pow(2)]).collect();
        let at_once: Vec<usize> = (0..rows).collect();
        for batch in at_once.chunks(ROWS_AT_ONCE) {
            let pieces: Vec<&[usize]> = batch.chunks(64).collect();
            let runs = parallel::map(pieces.len(), &|piece| sorted(pieces[piece]));
            let shard = matrices.len().div_ceil(SHARDS).max(1);
            parallel::on_pieces(&mut matrices, shard, &|first, matrices| {
                runs.iter().for_each(|runs| runs.add_to(matrices, first));
            });
        }
        let mut order = Vec::with_capacity(unknowns);
        let tiles = matrices.into_iter().zip(tiling.members()).map(|(matrix, members)| {
            order.extend_from_slice(members);
            Tile::new(matrix, members, added)
        });
        let tiles = tiles.collect();
        Ok(Self { tiles, order })
    }

    /// Bytes that it takes.
    pub fn bytes(&self) -> u64 {
        self.tiles.iter().map(|tile| size_of_val(&tile.matrix[..]) as u64).sum()
    }

    /// Lets every tile compute on its part of v, given which unknowns that are.
    fn each(&self, v: &mut CpuVector<F>, work: Work<F, C>) {
        let mut packed: Vec<Padded<F>> =
            self.order.par_iter().map(|&unknown| padded(v.0[unknown as usize])).collect();
        let mut parts = Vec::with_capacity(self.tiles.len());
        let (mut rest, mut order) = (&mut packed[..], &self.order[..]);
        for tile in &self.tiles {
            let (mine, others) = rest.split_at_mut(tile.inverse.len());
            let (members, other_members) = order.split_at(tile.inverse.len());
            parts.push((tile, mine, members));
            (rest, order) = (others, other_members);
        }
        parts.into_par_iter().for_each(|(tile, part, members)| work(tile, part, members));
        self.order
            .iter()
            .zip(&packed)
            .for_each(|(&unknown, &[r, g, b, _])| v.0[unknown as usize] = [r, g, b]);
    }
}

impl<F: Real, const C: usize> Runs<F, C> {
    /// The runs of some rows.
    fn sorted(rows: &impl MatrixRows<F, C>, tiling: &Tiling, weights: &[f64], of: &[usize]) -> Self {
        let mut found = Self { runs: Vec::new(), entries: Vec::new() };
        let mut open: Vec<(u32, [f64; C], Entries<F, C>)> = Vec::new();
        let mut spare: Vec<Entries<F, C>> = Vec::new();
        // A row without weight adds nothing.
        for &row in of.iter().filter(|&&row| weights[row] != 0.0) {
            let mut whole = [0.0; C];
            rows.visit(row, &mut |element, weight| {
                let Some((tile, place)) = tiling.place(element) else { return };
                // A ray goes from tile to tile, so the one it is in is among the last.
                let at = open.iter().rposition(|(open, ..)| *open == tile).unwrap_or_else(|| {
                    open.push((tile, [0.0; C], spare.pop().unwrap_or_default()));
                    open.len() - 1
                });
                let (_, sum, entries) = &mut open[at];
                for c in 0..C {
                    sum[c] += weight[c].wide();
                    whole[c] += weight[c].wide();
                }
                entries.push((place, weight));
            });
            for (tile, sum, mut entries) in open.drain(..) {
                let factor = |c: usize| if sum[c] > 0.0 { weights[row] * whole[c] / sum[c] } else { 0.0 };
                found.entries.append(&mut entries);
                found.runs.push((tile, std::array::from_fn(factor), found.entries.len()));
                spare.push(entries);
            }
        }
        found
    }

    /// Adds the runs of the tiles from `first` on to their matrices.
    fn add_to(&self, matrices: &mut [Vec<[F; C]>], first: usize) {
        let mut begin = 0;
        for &(tile, factor, end) in &self.runs {
            let entries = &self.entries[begin..end];
            begin = end;
            let Some(matrix) = (tile as usize).checked_sub(first).and_then(|tile| matrices.get_mut(tile))
            else {
                continue;
            };
            let side = matrix.len().isqrt();
            for &(i, a) in entries {
                let a: [F; C] = std::array::from_fn(|c| F::of(factor[c] * a[c].wide()));
                let row = &mut matrix[usize::from(i) * side..][..side];
                for &(j, b) in entries {
                    for c in 0..C {
                        row[usize::from(j)][c] += a[c] * b[c];
                    }
                }
            }
        }
    }
}

impl<F: Real, const C: usize> Tile<F, C> {
    fn new(mut matrix: Vec<[F; C]>, members: &[u32], added: &[f64]) -> Self {
        let side = members.len();
        for (k, &unknown) in members.iter().enumerate() {
            for c in 0..C {
                matrix[k * side + k][c] += F::of(added[unknown as usize]);
            }
        }
        let reciprocals = |x: [F; C]| x.map(|x| if x > F::zero() { x.recip() } else { F::zero() });
        let inverse = (0..side).map(|k| reciprocals(matrix[k * side + k])).collect();
        let sum = |row: &[[F; C]]| {
            reciprocals(std::array::from_fn(|c| row.iter().fold(F::zero(), |sum, weight| sum + weight[c])))
        };
        let inverse_sums = matrix.chunks(side).map(sum).collect();
        Self { matrix, inverse, inverse_sums }
    }

    /// (M d)_k.
    #[inline(always)]
    fn times(&self, k: usize, d: &[Padded<F>]) -> Padded<F> {
        let side = d.len();
        let row = &self.matrix[k * side..(k + 1) * side];
        let mut sums = [[F::zero(); 4]; 4];
        let (fours, rest) = row.as_chunks::<4>();
        let (d_fours, d_rest) = d.as_chunks::<4>();
        for (weights, d) in fours.iter().zip(d_fours) {
            for lane in 0..4 {
                sums[lane] = plus(sums[lane], times(padded_weight(&weights[lane]), d[lane]));
            }
        }
        for (weight, d) in rest.iter().zip(d_rest) {
            sums[0] = plus(sums[0], times(padded_weight(weight), *d));
        }
        plus(plus(sums[0], sums[1]), plus(sums[2], sums[3]))
    }

    /// One symmetric sweep for ⟨g, d⟩ + ½ dᵀ M d from the present d, with d kept so that `limit` allows it.
    #[inline(always)]
    fn sweep(&self, g: &[Padded<F>], d: &mut [Padded<F>], limit: impl Fn(usize, usize, F) -> F) {
        let side = d.len();
        for k in (0..side).chain((0..side).rev()) {
            let slope = self.times(k, d);
            for c in 0..3 {
                let step = (g[k][c] + slope[c]) * channel(&self.inverse[k], c);
                d[k][c] = limit(k, c, d[k][c] - step);
            }
        }
    }
}

/// Room for one tile.
type Room<F> = [Padded<F>; SIDE * SIDE];

impl<const C: usize> TileBlocks for TileMetric<f32, C> {
    fn channels(&self) -> usize {
        C
    }

    fn blocks(&self) -> Box<dyn Iterator<Item = (&[u32], &[f32])> + '_> {
        let mut order = &self.order[..];
        Box::new(self.tiles.iter().map(move |tile| {
            let (members, others) = order.split_at(tile.inverse.len());
            order = others;
            (members, tile.matrix.as_flattened())
        }))
    }
}

impl<F: Real, const C: usize> Metric<CpuVector<F>> for TileMetric<F, C> {
    fn stretch(&self, v: &mut CpuVector<F>) {
        self.each(v, &|tile, part, _| {
            let mut room: Room<F> = [[F::zero(); 4]; SIDE * SIDE];
            let d = &mut room[..part.len()];
            d.copy_from_slice(part);
            part.iter_mut().enumerate().for_each(|(k, value)| *value = tile.times(k, d));
        });
    }

    fn shrink(&self, v: &mut CpuVector<F>) {
        self.each(v, &|tile, part, _| {
            let mut room: Room<F> = [[F::zero(); 4]; SIDE * SIDE];
            let d = &mut room[..part.len()];
            // For −v the least is at M⁻¹ v.
            part.iter_mut().for_each(|value| *value = value.map(|value| -value));
            tile.sweep(part, d, |_, _, value| value);
            part.copy_from_slice(d);
        });
    }

    fn descend(&self, x: &mut CpuVector<F>, y: &CpuVector<F>, norm: Scalars, bounds: &Bounds) {
        let shorter: [F; 3] = norm.map(|norm| F::of(1.0 / norm));
        self.each(x, &|tile, part, members| {
            let [mut room, mut least, mut most]: [Room<F>; 3] = [[[F::zero(); 4]; SIDE * SIDE]; 3];
            let d = &mut room[..part.len()];
            part.iter_mut().for_each(|g| (0..3).for_each(|c| g[c] = g[c] * shorter[c]));
            // Members of a tile may belong to different parts of the bounds.
            let bounds_of = |unknown: u32| bounds.of(unknown as usize).map(|bounds| bounds.map(F::of));
            for (k, &unknown) in members.iter().enumerate() {
                let (y, [lower, upper]) = (y.0[unknown as usize], bounds_of(unknown));
                (0..3).for_each(|c| (least[k][c], most[k][c]) = (lower[c] - y[c], upper[c] - y[c]));
            }
            let limit = |k: usize, c: usize, value: F| F::min(F::max(value, least[k][c]), most[k][c]);
            // A sweep alone is slow where d is smooth, which is where the step of the separable surrogate is exact.
            for (k, g) in part.iter().enumerate() {
                (0..3).for_each(|c| d[k][c] = limit(k, c, -g[c] * channel(&tile.inverse_sums[k], c)));
            }
            tile.sweep(part, d, limit);
            for ((value, d), &unknown) in part.iter_mut().zip(d).zip(members) {
                let (y, [lower, upper]) = (y.0[unknown as usize], bounds_of(unknown));
                // A bound is met to the last digit.
                (0..3).for_each(|c| value[c] = F::min(F::max(y[c] + d[c], lower[c]), upper[c]));
            }
        });
    }

    fn majorizes(&self) -> bool {
        true
    }
}
