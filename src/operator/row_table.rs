use std::ops::Range;

use rayon::prelude::*;

use super::parallel;
use crate::march::{Traversal, Weight};

/// Rows that one task reads.
const ROWS_AT_ONCE: usize = 1024;

/// The rows of a matrix, wherever they are.
pub trait MatrixRows<F, const C: usize>: Sync {
    /// The number of rows.
    fn rows(&self) -> usize;

    /// Visits the non-zeros of a row in any order, each element at most once.
    fn visit(&self, row: usize, visit: &mut impl FnMut(usize, Weight<F, C>));
}

/// A traversal's rows in f32.
struct Rounded<'a, T, const C: usize>(&'a T);

impl<T: Traversal<f64, C>, const C: usize> MatrixRows<f32, C> for Rounded<'_, T, C> {
    fn rows(&self) -> usize {
        self.0.rows()
    }

    fn visit(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f32, C>)) {
        self.0.walk_shared(row, &mut |element, weight| visit(element, weight.map(|weight| weight as f32)));
    }
}

/// Rows of a matrix on the host: where each begins, which elements it has, and their weights, one channel after the other.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RowTable {
    /// One more than rows.
    pub offsets: Vec<usize>,
    /// The element of each non-zero, row after row.
    pub elements: Vec<u32>,
    /// The weights of each channel, a number a non-zero: one channel for grey rows, else three.
    pub weights: Vec<Vec<f32>>,
}

impl RowTable {
    /// The rows of a matrix.
    pub fn of<const C: usize>(rows: &impl MatrixRows<f32, C>) -> Self {
        let part = |index: usize| {
            let start = index * ROWS_AT_ONCE;
            let mut part = Self { offsets: vec![0], elements: Vec::new(), weights: vec![Vec::new(); C] };
            for row in start..(start + ROWS_AT_ONCE).min(rows.rows()) {
                rows.visit(row, &mut |element, weight: Weight<f32, C>| {
                    part.elements.push(element as u32);
                    part.weights.iter_mut().zip(weight).for_each(|(weights, weight)| weights.push(weight));
                });
                part.offsets.push(part.elements.len());
            }
            part
        };
        let parts = parallel::map(rows.rows().div_ceil(ROWS_AT_ONCE), &part);
        Self::joined(&parts, C)
    }

    /// The rows of a traversal, walked in f64 and rounded; one channel for grey ones, else three.
    pub fn walked(traversal: &(impl Traversal<f64, 1> + Traversal<f64, 3>), is_grey: bool) -> Self {
        if is_grey { Self::of(&Rounded::<_, 1>(traversal)) } else { Self::of(&Rounded::<_, 3>(traversal)) }
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Adds some non-zeros of another table as a row.
    pub fn append(&mut self, other: &Self, range: Range<usize>) {
        self.elements.extend_from_slice(&other.elements[range.clone()]);
        for (mine, theirs) in self.weights.iter_mut().zip(&other.weights) {
            mine.extend_from_slice(&theirs[range.clone()]);
        }
        self.offsets.push(self.elements.len());
    }

    /// Tables one below the other.
    pub fn joined(parts: &[Self], channels: usize) -> Self {
        let mut all = Self { offsets: vec![0], elements: Vec::new(), weights: vec![Vec::new(); channels] };
        all.elements.reserve_exact(parts.iter().map(|part| part.elements.len()).sum());
        for part in parts {
            let begin = all.elements.len();
            all.offsets.extend(part.offsets.iter().skip(1).map(|offset| begin + offset));
            all.elements.extend_from_slice(&part.elements);
            all.weights.iter_mut().zip(&part.weights).for_each(|(all, part)| all.extend_from_slice(part));
        }
        all
    }

    /// Its transpose; elements keep the order of the rows.
    pub fn transposed(&self, elements: usize) -> Self {
        let mut offsets = vec![0; elements + 1];
        self.elements.iter().for_each(|&element| offsets[element as usize + 1] += 1);
        for element in 0..elements {
            offsets[element + 1] += offsets[element];
        }
        let mut rows = vec![0; self.elements.len()];
        let mut weights = vec![vec![0.0; self.elements.len()]; self.weights.len()];
        // Every task looks at all non-zeros and places those of its own columns, of which all have about as many.
        let share = self.elements.len().div_ceil(rayon::current_num_threads()).max(1);
        let mut tasks = Vec::new();
        let (mut rest, mut begin) = (&mut rows[..], 0);
        let mut rests: Vec<&mut [f32]> = weights.iter_mut().map(|weights| &mut weights[..]).collect();
        while begin < elements {
            let end =
                offsets.partition_point(|&offset| offset < offsets[begin] + share).clamp(begin + 1, elements);
            let len = offsets[end] - offsets[begin];
            let (mine, others) = rest.split_at_mut(len);
            rest = others;
            let (my_weights, other_weights): (Vec<_>, Vec<_>) =
                rests.into_iter().map(|weights| weights.split_at_mut(len)).unzip();
            rests = other_weights;
            tasks.push((begin..end, mine, my_weights));
            begin = end;
        }
        tasks.into_par_iter().for_each(|(columns, rows, mut weights)| {
            let first = offsets[columns.start];
            let mut next: Vec<usize> = offsets[columns.clone()].iter().map(|offset| offset - first).collect();
            for row in 0..self.rows() {
                for k in self.offsets[row]..self.offsets[row + 1] {
                    let column = self.elements[k] as usize;
                    if !columns.contains(&column) {
                        continue;
                    }
                    let place = &mut next[column - columns.start];
                    rows[*place] = row as u32;
                    for (to, from) in weights.iter_mut().zip(&self.weights) {
                        to[*place] = from[k];
                    }
                    *place += 1;
                }
            }
        });
        Self { offsets, elements: rows, weights }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transpose_has_every_entry_where_it_belongs_and_is_its_own_inverse() {
        let mut state = 7u32;
        let mut next = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % below
        };
        for elements in [1, 2, 37] {
            let part = |rows: u32, next: &mut dyn FnMut(u32) -> u32| {
                let mut part =
                    RowTable { offsets: vec![0], elements: Vec::new(), weights: vec![Vec::new(); 3] };
                for _ in 0..rows {
                    for element in (0..elements).filter(|_| next(3) == 0).collect::<Vec<_>>() {
                        part.elements.push(element);
                        part.weights.iter_mut().for_each(|weights| weights.push(next(100) as f32));
                    }
                    part.offsets.push(part.elements.len());
                }
                part
            };
            let parts = [part(11, &mut next), part(0, &mut next), part(5, &mut next)];
            let table = RowTable::joined(&parts, 3);
            assert_eq!(table.rows(), 16);
            let transposed = table.transposed(elements as usize);
            let entries = |table: &RowTable| -> Vec<(u32, u32, [f32; 3])> {
                (0..table.rows())
                    .flat_map(|row| (table.offsets[row]..table.offsets[row + 1]).map(move |k| (row, k)))
                    .map(|(row, k)| (row as u32, table.elements[k], [0, 1, 2].map(|c| table.weights[c][k])))
                    .collect()
            };
            let mut turned: Vec<_> = entries(&transposed).into_iter().map(|(a, b, w)| (b, a, w)).collect();
            turned.sort_by_key(|&(row, element, _)| (row, element));
            assert_eq!(turned, entries(&table));
            assert_eq!(transposed.transposed(table.rows()), table);
        }
    }
}
