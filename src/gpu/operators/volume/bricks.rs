//! Volumes and sets of voxels as they lie on the device: bricks that hold nothing have no memory.

use rayon::prelude::*;

use crate::operator::NOWHERE;
use crate::scene::{BRICK, Interpolation, Volume, VoxelSet};

/// Values of a volume, brick by brick.
pub(super) struct Pool {
    /// Of each brick of cells which one it is among those that are kept, or [`NOWHERE`].
    pub(super) slots: Vec<u32>,
    /// Voxel by voxel inside a brick, x fastest; its channels side by side.
    pub(super) values: Vec<f32>,
}

impl Pool {
    /// The values that the cells of some bricks lie between. Trilinear cells share their voxels with the bricks beside, which are
    /// kept in both, and so are the outermost voxels beyond the rim: 9³ values a brick, where constant ones are 8³.
    pub(super) fn new(volume: &Volume, interpolation: Interpolation, keeps: impl Fn(usize) -> bool) -> Self {
        let (shift, extra) = interpolation.cells();
        let before = (2.0 * shift) as usize;
        let [across, down, deep] = volume.grid().size().map(|side| (side + extra).div_ceil(BRICK));
        let mut slots = vec![NOWHERE; across * down * deep];
        let kept: Vec<usize> = (0..slots.len()).filter(|&brick| keeps(brick)).collect();
        kept.iter().enumerate().for_each(|(slot, &brick)| slots[brick] = slot as u32);
        let (side, channels) = (BRICK + extra, volume.channels());
        let last = volume.grid().size().map(|side| side - 1);
        let mut values = vec![0.0; kept.len() * side * side * side * channels];
        let bricks = values.par_chunks_exact_mut(side * side * side * channels).zip(&kept);
        bricks.for_each(|(values, &brick)| {
            let corner = [brick % across, brick / across % down, brick / across / down].map(|i| i * BRICK);
            for (place, values) in values.chunks_exact_mut(channels).enumerate() {
                let inside = [place % side, place / side % side, place / side / side];
                let voxel = std::array::from_fn(|axis| {
                    (corner[axis] + inside[axis]).saturating_sub(before).min(last[axis])
                });
                let color = volume.color(volume.grid().index(voxel));
                values.copy_from_slice(&color[..channels]);
            }
        });
        Self { slots, values }
    }
}

/// Bricks of a set that are not empty, numbered.
pub(super) fn slots(set: &VoxelSet) -> Vec<u32> {
    let number = |(_, _, slices): (_, _, [u64; BRICK])| if slices == [0; BRICK] { NOWHERE } else { 0 };
    set.records().map(number).collect()
}

/// Appends where the record of each brick of a set stands, and those records: the number of its first voxel, how many are in the
/// slices before, and a bit a voxel.
pub(super) fn append_records(set: &VoxelSet, words: &mut Vec<u32>) {
    let begin = words.len();
    words.resize(begin + set.records().len(), NOWHERE);
    for (brick, (first, before, slices)) in set.records().enumerate() {
        if slices == [0; BRICK] {
            continue;
        }
        words[begin + brick] = words.len() as u32;
        words.push(first);
        words.extend(before.chunks_exact(2).map(|pair| u32::from(pair[0]) | u32::from(pair[1]) << 16));
        words.extend(slices.iter().flat_map(|&bits| [bits as u32, (bits >> 32) as u32]));
    }
}
