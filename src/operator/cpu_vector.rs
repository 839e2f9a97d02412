use rayon::prelude::*;

use crate::march::Real;
use crate::{Error, Result};

use super::{Indexed, Scalars, Vector};

/// Elements a task: sums are taken a piece at a time, so their order does not depend on the threads.
const PIECE: usize = 8192;
/// Numbers that are worked on side by side: four elements, so that channels keep their place.
const LANES: usize = 12;

/// Three channels an element, in the memory of the host.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CpuVector<F = f32>(pub Vec<[F; 3]>);

impl<F: Real> CpuVector<F> {
    /// `len` elements of zero.
    pub fn zeros(len: usize) -> Self {
        Self(vec![[F::zero(); 3]; len])
    }

    /// From values in f64, rounded to the nearest.
    pub fn of(values: &[[f64; 3]]) -> Self {
        Self(values.iter().map(|value| value.map(F::of)).collect())
    }

    /// Changes every number by its partner in `other` and the constants of its channel.
    fn update<const N: usize>(
        &mut self,
        other: &Self,
        constants: [Scalars; N],
        change: impl Fn(&mut F, F, [F; N]) + Sync,
    ) {
        debug_assert_eq!(self.0.len(), other.0.len());
        let constants: [[F; N]; LANES] = std::array::from_fn(|lane| constants.map(|c| F::of(c[lane % 3])));
        self.0.par_chunks_mut(PIECE).zip(other.0.par_chunks(PIECE)).for_each(|(mine, theirs)| {
            let (mine, my_rest) = mine.as_flattened_mut().as_chunks_mut::<LANES>();
            let (theirs, their_rest) = theirs.as_flattened().as_chunks::<LANES>();
            for (mine, theirs) in mine.iter_mut().zip(theirs) {
                for lane in 0..LANES {
                    change(&mut mine[lane], theirs[lane], constants[lane]);
                }
            }
            for (lane, (mine, theirs)) in my_rest.iter_mut().zip(their_rest).enumerate() {
                change(mine, *theirs, constants[lane]);
            }
        });
    }

    fn each(&mut self, constants: Scalars, change: impl Fn(F, F) -> F + Sync) {
        let constants = constants.map(F::of);
        self.0.par_chunks_mut(PIECE).for_each(|piece| {
            piece.iter_mut().for_each(|element| {
                *element = std::array::from_fn(|c| change(element[c], constants[c]));
            });
        });
    }
}

impl<F: Real> Vector for CpuVector<F> {
    fn len(&self) -> usize {
        self.0.len()
    }

    fn zeros_like(&self) -> Self {
        Self::zeros(self.0.len())
    }

    fn fill(&mut self, value: Scalars) {
        self.each(value, |_, value| value);
    }

    fn copy_from(&mut self, other: &Self) {
        self.0.copy_from_slice(&other.0);
    }

    fn axpby(&mut self, alpha: Scalars, x: &Self, beta: Scalars) {
        if beta == [0.0; 3] {
            self.update(x, [alpha], |mine, x, [alpha]| *mine = alpha * x);
        } else if beta == [1.0; 3] {
            self.update(x, [alpha], |mine, x, [alpha]| *mine += alpha * x);
        } else {
            self.update(x, [alpha, beta], |mine, x, [alpha, beta]| {
                let kept = if beta == F::zero() { F::zero() } else { beta * *mine };
                *mine = alpha * x + kept;
            });
        }
    }

    fn scale(&mut self, factor: Scalars) {
        self.each(factor, |mine, factor| mine * factor);
    }

    fn multiply(&mut self, x: &Self) {
        self.update(x, [], |mine, x, []| *mine = *mine * x);
    }

    fn clamp_below(&mut self, bound: Scalars) {
        self.each(bound, F::max);
    }

    fn dot(&self, other: &Self) -> Result<Scalars> {
        let pieces: Vec<Scalars> = self
            .0
            .par_chunks(PIECE)
            .zip(other.0.par_chunks(PIECE))
            .map(|(a, b)| {
                let (a, a_rest) = a.as_flattened().as_chunks::<LANES>();
                let (b, b_rest) = b.as_flattened().as_chunks::<LANES>();
                let mut lanes = [0.0; LANES];
                for (a, b) in a.iter().zip(b) {
                    for lane in 0..LANES {
                        lanes[lane] += a[lane].wide() * b[lane].wide();
                    }
                }
                for (lane, (a, b)) in a_rest.iter().zip(b_rest).enumerate() {
                    lanes[lane] += a.wide() * b.wide();
                }
                std::array::from_fn(|c| (0..LANES / 3).map(|k| lanes[3 * k + c]).sum::<f64>())
            })
            .collect();
        Ok(pieces.iter().fold([0.0; 3], |sum, piece| std::array::from_fn(|c| sum[c] + piece[c])))
    }

    fn to_host(&self) -> Result<Vec<[f64; 3]>> {
        Ok(self.0.iter().map(|element| element.map(Real::wide)).collect())
    }

    fn set_from_host(&mut self, values: &[[f64; 3]]) -> Result<()> {
        if values.len() != self.0.len() {
            return Err(Error::Shape { what: "a vector", expected: self.0.len(), got: values.len() });
        }
        self.0.iter_mut().zip(values).for_each(|(element, value)| *element = value.map(F::of));
        Ok(())
    }
}

impl<F: Real> Indexed for CpuVector<F> {
    fn pick(&mut self, other: &Self, index: &[u32]) {
        self.0.par_chunks_mut(PIECE).zip(index.par_chunks(PIECE)).for_each(|(piece, index)| {
            piece.iter_mut().zip(index).for_each(|(element, &i)| *element = other.0[i as usize]);
        });
    }

    fn place(&mut self, other: &Self, index: &[u32]) {
        self.fill([0.0; 3]);
        index.iter().zip(&other.0).for_each(|(&i, element)| self.0[i as usize] = *element);
    }

    fn zeros(&self, len: usize) -> Self {
        Self::zeros(len)
    }
}
