use std::ops::Range;

use super::bands::Bands;
use crate::march::{Real, Traversal, Weight, channel};

/// Rows a chunk: enough that the offsets cost little, few enough that a chunk's residuals stay in cache.
pub(super) const CHUNK: usize = 64;

/// The non-zeros of some consecutive rows, band by band and in each band row by row.
#[derive(Debug)]
pub(super) struct Chunk<F, const C: usize> {
    rows: Range<usize>,
    /// Where (band, row) begins: index `band · rows + row`; one more at the end.
    offsets: Vec<u32>,
    elements: Vec<u32>,
    weights: Vec<Weight<F, C>>,
}

impl<F: Real, const C: usize> Chunk<F, C> {
    /// Walks the rows and sorts what they visit by band.
    pub(super) fn walk(traversal: &impl Traversal<f64, C>, rows: Range<usize>, bands: &Bands) -> Self {
        let count = rows.len();
        let (mut visited, mut ends) = (Vec::<(u32, Weight<F, C>)>::new(), Vec::with_capacity(count));
        let mut offsets = vec![0u32; bands.len() * count + 1];
        for (local, row) in rows.clone().enumerate() {
            traversal.walk(row, &mut |element, weight| {
                let element = element as u32;
                visited.push((element, weight.map(F::of)));
                offsets[bands.of(element) * count + local + 1] += 1;
            });
            ends.push(visited.len());
        }
        for index in 1..offsets.len() {
            offsets[index] += offsets[index - 1];
        }
        let mut next = offsets.clone();
        let mut elements = vec![0; visited.len()];
        let mut weights = vec![[F::zero(); C]; visited.len()];
        let mut begin = 0;
        for (local, &end) in ends.iter().enumerate() {
            for &(element, weight) in &visited[begin..end] {
                let place = &mut next[bands.of(element) * count + local];
                elements[*place as usize] = element;
                weights[*place as usize] = weight;
                *place += 1;
            }
            begin = end;
        }
        Self { rows, offsets, elements, weights }
    }

    pub(super) fn rows(&self) -> Range<usize> {
        self.rows.clone()
    }

    pub(super) fn nonzeros(&self) -> usize {
        self.elements.len()
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.offsets[..]) + size_of_val(&self.elements[..]) + size_of_val(&self.weights[..])
    }

    /// y ← T x for these rows; `y` holds them alone.
    pub(super) fn gather(&self, x: &[[F; 3]], y: &mut [[F; 3]]) {
        let mut sums = [[0.0_f64; 3]; CHUNK];
        for (index, pair) in self.offsets.windows(2).enumerate() {
            let mut sum = [F::zero(); 3];
            let stretch = pair[0] as usize..pair[1] as usize;
            for (&element, weight) in self.elements[stretch.clone()].iter().zip(&self.weights[stretch]) {
                let x = x[element as usize];
                for c in 0..3 {
                    sum[c] += channel(weight, c) * x[c];
                }
            }
            let total = &mut sums[index % self.rows.len()];
            for c in 0..3 {
                total[c] += sum[c].wide();
            }
        }
        y.iter_mut().zip(sums).for_each(|(y, sum)| *y = sum.map(F::of));
    }

    /// x ← x + Tᵀ y for one band: `x` holds the elements from `first` on, `y` all rows.
    pub(super) fn scatter(&self, band: usize, y: &[[F; 3]], first: usize, x: &mut [[F; 3]]) {
        let count = self.rows.len();
        for (local, row) in self.rows.clone().enumerate() {
            let index = band * count + local;
            let stretch = self.offsets[index] as usize..self.offsets[index + 1] as usize;
            let y = y[row];
            for (&element, weight) in self.elements[stretch.clone()].iter().zip(&self.weights[stretch]) {
                let x = &mut x[element as usize - first];
                for c in 0..3 {
                    x[c] += channel(weight, c) * y[c];
                }
            }
        }
    }

    /// x ← x + diag(Tᵀ diag(y) T) for one band.
    pub(super) fn squares(&self, band: usize, y: &[[F; 3]], first: usize, x: &mut [[F; 3]]) {
        let count = self.rows.len();
        for (local, row) in self.rows.clone().enumerate() {
            let index = band * count + local;
            let stretch = self.offsets[index] as usize..self.offsets[index + 1] as usize;
            let y = y[row];
            for (&element, weight) in self.elements[stretch.clone()].iter().zip(&self.weights[stretch]) {
                let x = &mut x[element as usize - first];
                for c in 0..3 {
                    x[c] += channel(weight, c) * channel(weight, c) * y[c];
                }
            }
        }
    }
}
