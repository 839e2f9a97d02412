//! The rays of all rows as kernels read them, and which dispatches walk them: rays, rows and elements are seen slab by slab.

use std::ops::Range;

use bytemuck::Pod;
use rayon::prelude::*;

use crate::Result;
use crate::gpu::device::{Allocation, Binding, Gpu};
use crate::gpu::kernels::layout::WalkParams;
use crate::gpu::vectors::{GpuVector, Slab};

/// The records of all rows, so many of each.
#[derive(Debug)]
pub(super) struct Rays {
    bytes_a_row: usize,
    slabs: Vec<RaySlab>,
    /// Σ_k Σ_i w_ki at most, and the same of the squared row sums.
    pub(super) row_sums: [f64; 2],
}

/// So many rows as can be seen at once.
#[derive(Debug)]
struct RaySlab {
    first: usize,
    rows: usize,
    records: Allocation,
}

/// One dispatch.
pub(super) struct Walking<'a> {
    slab: &'a RaySlab,
    bytes_a_row: usize,
    /// Which rows of the slab.
    rows: Range<usize>,
    pub(super) of_y: Slab,
    pub(super) of_x: Slab,
    params: WalkParams,
}

impl Rays {
    /// `row` gives the records of a row, and what its weights sum up to at most.
    ///
    /// Errors: [`crate::Error::AdapterMemory`].
    pub(super) fn new<R: Pod + Send, const N: usize>(
        gpu: &Gpu,
        rows: usize,
        row: impl Fn(usize) -> ([R; N], f64) + Sync,
    ) -> Result<Self> {
        let bytes_a_row = size_of::<[R; N]>();
        let at_once = gpu.rays_at_once(bytes_a_row);
        let (mut slabs, mut row_sums) = (Vec::new(), [0.0; 2]);
        for first in (0..rows).step_by(at_once) {
            let count = at_once.min(rows - first);
            let found: Vec<_> = (first..first + count).into_par_iter().map(&row).collect();
            for (_, sum) in &found {
                row_sums = [row_sums[0] + sum, row_sums[1] + sum * sum];
            }
            let records: Vec<R> = found.into_iter().flat_map(|(records, _)| records).collect();
            slabs.push(RaySlab { first, rows: count, records: gpu.upload("the rays", &records)? });
        }
        Ok(Self { bytes_a_row, slabs, row_sums })
    }

    /// The dispatches that walk all rows over those of so many `elements` that are in x, for channels that are bound together.
    pub(super) fn walkings(
        &self,
        [y, x]: [&GpuVector; 2],
        elements: &Range<usize>,
        channels: [u32; 2],
    ) -> Vec<Walking<'_>> {
        let mut all = Vec::new();
        for slab in &self.slabs {
            for of_y in y.slabs(channels) {
                // Slabs of rows and of y are cut at the same rows, or y is in one piece.
                let begin = slab.first.max(of_y.first);
                let end = (slab.first + slab.rows).min(of_y.first + of_y.len);
                if begin >= end {
                    continue;
                }
                for of_x in x.slabs(channels) {
                    if of_x.first >= elements.end || of_x.first + of_x.len <= elements.start {
                        continue;
                    }
                    let params = WalkParams {
                        rows: (end - begin) as u32,
                        y_first: (begin - of_y.first) as u32,
                        y_stride: y.stride as u32,
                        channel: channels[0],
                        // Counted from the first of the elements, and wrapped where the slab begins before.
                        x_first: (of_x.first as u32).wrapping_sub(elements.start as u32),
                        x_len: of_x.len as u32,
                        x_stride: x.stride as u32,
                        pad: 0,
                    };
                    let rows = begin - slab.first..end - slab.first;
                    all.push(Walking { slab, bytes_a_row: self.bytes_a_row, rows, of_y, of_x, params });
                }
            }
        }
        all
    }
}

impl Walking<'_> {
    /// How many rows it walks.
    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    /// Parameters and records of some of its rows.
    pub(super) fn of_rows(&self, rows: &Range<usize>) -> (WalkParams, Binding) {
        let y_first = self.params.y_first + rows.start as u32;
        let params = WalkParams { rows: rows.len() as u32, y_first, ..self.params };
        let [offset, size] =
            [self.rows.start + rows.start, rows.len()].map(|rows| (rows * self.bytes_a_row) as u64);
        (params, self.slab.records.part(offset, size))
    }
}
