use rayon::prelude::*;

use crate::march::Real;
use crate::{Error, Result};

use super::{Indexed, Scalars, Vector};

/// Elements a task: sums are taken a piece at a time, so their order does not depend on the threads.
const PIECE: usize = 8192;

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

    fn update(&mut self, other: &Self, update: impl Fn(&mut [F; 3], &[F; 3]) + Sync) {
        debug_assert_eq!(self.0.len(), other.0.len());
        self.0
            .par_chunks_mut(PIECE)
            .zip(other.0.par_chunks(PIECE))
            .for_each(|(mine, theirs)| mine.iter_mut().zip(theirs).for_each(|(a, b)| update(a, b)));
    }

    fn each(&mut self, update: impl Fn(&mut [F; 3]) + Sync) {
        self.0.par_chunks_mut(PIECE).for_each(|piece| piece.iter_mut().for_each(&update));
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
        let value = value.map(F::of);
        self.each(|element| *element = value);
    }

    fn copy_from(&mut self, other: &Self) {
        self.0.copy_from_slice(&other.0);
    }

    fn axpby(&mut self, alpha: Scalars, x: &Self, beta: Scalars) {
        let (alpha, beta) = (alpha.map(F::of), beta.map(F::of));
        self.update(x, |mine, x| {
            for c in 0..3 {
                let kept = if beta[c] == F::zero() { F::zero() } else { beta[c] * mine[c] };
                mine[c] = alpha[c] * x[c] + kept;
            }
        });
    }

    fn scale(&mut self, factor: Scalars) {
        let factor = factor.map(F::of);
        self.each(|element| *element = std::array::from_fn(|c| element[c] * factor[c]));
    }

    fn multiply(&mut self, x: &Self) {
        self.update(x, |mine, x| *mine = std::array::from_fn(|c| mine[c] * x[c]));
    }

    fn clamp_below(&mut self, bound: Scalars) {
        let bound = bound.map(F::of);
        self.each(|element| *element = std::array::from_fn(|c| element[c].max(bound[c])));
    }

    fn dot(&self, other: &Self) -> Result<Scalars> {
        let pieces: Vec<Scalars> = self
            .0
            .par_chunks(PIECE)
            .zip(other.0.par_chunks(PIECE))
            .map(|(a, b)| {
                let mut sum = [0.0; 3];
                for (a, b) in a.iter().zip(b) {
                    for c in 0..3 {
                        sum[c] += a[c].wide() * b[c].wide();
                    }
                }
                sum
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
        self.each(|element| *element = [F::zero(); 3]);
        index.iter().zip(&other.0).for_each(|(&i, element)| self.0[i as usize] = *element);
    }

    fn zeros(&self, len: usize) -> Self {
        Self::zeros(len)
    }
}
