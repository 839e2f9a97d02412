//! Work shared by all threads, behind one call for all that is worked on: a loop of rayon's is some two thousand lines of code for the
//! compiler, and generic callers would have it compiled anew for each of their types.

use rayon::prelude::*;

/// The values of a function from 0 to below `count`, in order.
pub(crate) fn map<R: Send>(count: usize, value: &(dyn Fn(usize) -> R + Sync)) -> Vec<R> {
    (0..count).into_par_iter().map(value).collect()
}

/// Works on pieces of so many items, the last may have fewer: `work` is given the number of the first item, and the piece.
pub(crate) fn on_pieces<T: Send>(items: &mut [T], piece: usize, work: &(dyn Fn(usize, &mut [T]) + Sync)) {
    items.par_chunks_mut(piece).enumerate().for_each(|(index, items)| work(index * piece, items));
}
