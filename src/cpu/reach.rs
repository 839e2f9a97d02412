use rayon::prelude::*;

use crate::march::{Part, VolumeTraversal};
use crate::scene::VoxelSet;

/// Rows that one task looks along.
const ROWS: usize = 1024;

/// The voxels of a part's grid, among those that are its elements, that some row sees.
///
/// Cost: one walk of every row.
pub fn reached<const C: usize>(traversal: &VolumeTraversal, part: &Part) -> VoxelSet {
    let words = part.grid.len().div_ceil(64);
    let rows: Vec<usize> = (0..traversal.rays().len()).collect();
    let tasks = rows.len().div_ceil(ROWS).div_ceil(rayon::current_num_threads()).max(1) * ROWS;
    let seen = rows
        .par_chunks(tasks)
        .map(|rows| {
            let mut seen = vec![0u64; words];
            for &row in rows {
                traversal.trace::<C>(row, part, &mut |voxel, _| {
                    let index = part.grid.index(voxel);
                    seen[index / 64] |= 1 << (index % 64);
                });
            }
            seen
        })
        .reduce(
            || vec![0u64; words],
            |mut all, seen| {
                all.iter_mut().zip(seen).for_each(|(all, seen)| *all |= seen);
                all
            },
        );
    part.grid.set(|index| seen[index / 64] >> (index % 64) & 1 == 1).intersection(part.voxels())
}
