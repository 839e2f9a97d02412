//! The products with a chunk of kept rows.
//!
//! All rows of a block are in lanes of a register: a gather multiplies the weights of an entry with one element, and a scatter adds to one
//! element what all rows of the block send there.

use std::ops::Range;

use super::bands::Bands;
use super::rows::{Chunk, Stretch};
use crate::march::{Real, Weight, channel};
use crate::simd::{Kernel, Simd, dispatch};

/// Three channels and a fourth number that nobody reads: one processor register.
pub(super) type Padded<F> = [F; 4];

#[inline(always)]
pub(super) fn padded<F: Real>([r, g, b]: [F; 3]) -> Padded<F> {
    [r, g, b, F::zero()]
}

#[inline(always)]
pub(super) fn padded_weight<F: Real, const C: usize>(weight: &Weight<F, C>) -> Padded<F> {
    [channel(weight, 0), channel(weight, 1), channel(weight, 2), channel(weight, 0)]
}

#[inline(always)]
pub(super) fn times<F: Real>(a: Padded<F>, b: Padded<F>) -> Padded<F> {
    std::array::from_fn(|lane| a[lane] * b[lane])
}

#[inline(always)]
pub(super) fn plus<F: Real>(a: Padded<F>, b: Padded<F>) -> Padded<F> {
    std::array::from_fn(|lane| a[lane] + b[lane])
}

impl<F: Real, const C: usize> Chunk<F, C> {
    /// y ← T x for these rows; `y` holds them alone, `x` all elements.
    pub(super) fn gather(&self, bands: &Bands, x: &[[F; 3]], y: &mut [Padded<F>]) {
        let chunk = self;
        match self.lanes {
            8 => dispatch(Gather::<F, C, 8> { chunk, bands, x, y }),
            4 => dispatch(Gather::<F, C, 4> { chunk, bands, x, y }),
            _ => dispatch(Gather::<F, C, 1> { chunk, bands, x, y }),
        }
    }

    /// x ← x + Tᵀ y for one band: `x` holds its slots; `y` all rows by their positions, and behind them as many zeros as the last block
    /// may lack of rows.
    pub(super) fn scatter(&self, of: (usize, Range<usize>), y: &[Padded<F>], x: &mut [Padded<F>]) {
        self.send::<false>(of, y, x);
    }

    /// x ← x + diag(Tᵀ diag(y) T) for one band.
    pub(super) fn squares(&self, of: (usize, Range<usize>), y: &[Padded<F>], x: &mut [Padded<F>]) {
        self.send::<true>(of, y, x);
    }

    fn send<const SQUARED: bool>(
        &self,
        (band, blocks): (usize, Range<usize>),
        y: &[Padded<F>],
        x: &mut [Padded<F>],
    ) {
        let (chunk, y) = (self, &y[self.rows.start..]);
        match self.lanes {
            8 => dispatch(Send::<F, C, 8, SQUARED> { chunk, band, blocks, y, x }),
            4 => dispatch(Send::<F, C, 4, SQUARED> { chunk, band, blocks, y, x }),
            _ => dispatch(Send::<F, C, 1, SQUARED> { chunk, band, blocks, y, x }),
        }
    }

    /// The entries of a stretch: elements, and the weights of each, channel by channel.
    #[inline(always)]
    fn entries<const L: usize>(&self, entries: Range<usize>) -> (&[u16], &[[[F; L]; C]]) {
        let weights = self.weights.as_chunks::<L>().0.as_chunks::<C>().0;
        (&self.elements[entries.clone()], &weights[entries])
    }
}

struct Gather<'a, F, const C: usize, const L: usize> {
    chunk: &'a Chunk<F, C>,
    bands: &'a Bands,
    x: &'a [[F; 3]],
    y: &'a mut [Padded<F>],
}

impl<F: Real, const C: usize, const L: usize> Kernel for Gather<'_, F, C, L> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let Self { chunk, bands, x, y } = self;
        let mut sums = vec![[[0.0_f64; L]; 3]; chunk.blocks().end];
        for band in 0..bands.len() {
            let x = &x[bands.range(band)];
            for Stretch { block, entries } in chunk.stretches(band, chunk.blocks()) {
                let (elements, weights) = chunk.entries::<L>(entries);
                // Two sums side by side, so that no addition waits for the one before.
                let mut sum = [[[F::zero(); L]; 3]; 2];
                let ((pairs, rest), (weight_pairs, weight_rest)) =
                    (elements.as_chunks::<2>(), weights.as_chunks::<2>());
                for (elements, weights) in pairs.iter().zip(weight_pairs) {
                    for k in 0..2 {
                        add_lanes(&mut sum[k], &weights[k], x[usize::from(elements[k])]);
                    }
                }
                for (&element, weights) in rest.iter().zip(weight_rest) {
                    add_lanes(&mut sum[0], weights, x[usize::from(element)]);
                }
                for c in 0..3 {
                    for lane in 0..L {
                        sums[block][c][lane] += (sum[0][c][lane] + sum[1][c][lane]).wide();
                    }
                }
            }
        }
        for (y, sum) in y.chunks_mut(L).zip(&sums) {
            for (lane, y) in y.iter_mut().enumerate() {
                *y = padded([0, 1, 2].map(|c| F::of(sum[c][lane])));
            }
        }
    }
}

/// sum ← sum + w x, of all rows of a block.
#[inline(always)]
fn add_lanes<F: Real, const C: usize, const L: usize>(
    sum: &mut [[F; L]; 3],
    weights: &[[F; L]; C],
    x: [F; 3],
) {
    for c in 0..3 {
        let weights = &weights[if C == 1 { 0 } else { c }];
        for lane in 0..L {
            sum[c][lane] += weights[lane] * x[c];
        }
    }
}

struct Send<'a, F, const C: usize, const L: usize, const SQUARED: bool> {
    chunk: &'a Chunk<F, C>,
    band: usize,
    blocks: Range<usize>,
    y: &'a [Padded<F>],
    x: &'a mut [Padded<F>],
}

impl<F: Real, const C: usize, const L: usize, const SQUARED: bool> Kernel for Send<'_, F, C, L, SQUARED> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let Self { chunk, band, blocks, y, x } = self;
        let (y, _) = y.as_chunks::<L>();
        for Stretch { block, entries } in chunk.stretches(band, blocks) {
            let y = y[block];
            let (elements, weights) = chunk.entries::<L>(entries);
            for (&element, weights) in elements.iter().zip(weights) {
                let weight = |lane: usize| -> Padded<F> {
                    let weight: Weight<F, C> = std::array::from_fn(|c| weights[c][lane]);
                    padded_weight(&if SQUARED { weight.map(|weight| weight * weight) } else { weight })
                };
                let mut sum = times(weight(0), y[0]);
                if L > 1 {
                    // Two sums again.
                    let mut other = times(weight(1), y[1]);
                    for lane in (2..L).step_by(2) {
                        sum = plus(sum, times(weight(lane), y[lane]));
                        other = plus(other, times(weight(lane + 1), y[lane + 1]));
                    }
                    sum = plus(sum, other);
                }
                let slot = &mut x[Bands::slot(usize::from(element))];
                *slot = plus(*slot, sum);
            }
        }
    }
}
