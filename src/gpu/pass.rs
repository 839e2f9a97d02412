//! Which dispatches walk all rows over all elements, where vectors and rows are seen slab by slab.

use std::ops::Range;

use super::layout::Pass;
use super::vector::{GpuVector, Slab};

/// One dispatch.
pub(super) struct Walking {
    /// Which slab of the rows, and which of its rows.
    pub(super) slab: usize,
    pub(super) rows: Range<usize>,
    pub(super) of_y: Slab,
    pub(super) of_x: Slab,
    pub(super) pass: Pass,
}

impl Walking {
    /// Some of its rows.
    pub(super) fn narrowed(&self, rows: &Range<usize>) -> (Range<usize>, Pass) {
        let pass =
            Pass { rows: rows.len() as u32, y_first: self.pass.y_first + rows.start as u32, ..self.pass };
        (self.rows.start + rows.start..self.rows.start + rows.end, pass)
    }
}

/// Dispatches over slabs of rows (the first one, and how many), of `y` and of `x`, for channels that are bound together.
pub(super) fn walkings(
    slabs: &[(usize, usize)],
    [y, x]: [&GpuVector; 2],
    channels: [u32; 2],
) -> Vec<Walking> {
    let mut all = Vec::new();
    for (slab, &(first, count)) in slabs.iter().enumerate() {
        for of_y in y.slabs(channels) {
            // Slabs of rows and of y are cut at the same rows, or y is in one piece.
            let begin = first.max(of_y.first);
            let end = (first + count).min(of_y.first + of_y.len);
            if begin >= end {
                continue;
            }
            for of_x in x.slabs(channels) {
                let pass = Pass {
                    rows: (end - begin) as u32,
                    y_first: (begin - of_y.first) as u32,
                    y_stride: y.stride as u32,
                    channel: channels[0],
                    x_first: of_x.first as u32,
                    x_len: of_x.len as u32,
                    x_stride: x.stride as u32,
                    pad: 0,
                };
                all.push(Walking { slab, rows: begin - first..end - first, of_y, of_x, pass });
            }
        }
    }
    all
}
