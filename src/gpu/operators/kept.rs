//! Rows that are kept on the device, and their transpose: both directions gather, without atomics and always in the same order.

use std::sync::{Arc, Mutex};

use super::device_operator::DeviceOperator;
use crate::gpu::device::{Allocation, Gpu};
use crate::gpu::kernels::layout::RowsParams;
use crate::gpu::kernels::{Kernel, LANES, Program, Variant};
use crate::gpu::vectors::{GpuVector, Index};
use crate::operator::{Indexed, LinearOperator, RowTable, Storage, expect_len, lock};
use crate::{Error, Result};

/// Non-zeros that one row may have before it is cut up. The texels around an eye are in every row of its view, and a few
/// lanes would work on their columns long after all others are done.
const LONG: usize = 4096;

/// T whose non-zeros are kept on the device, by rows and by columns.
///
/// Shapes  x: elements, y: rows, three channels each
/// Cost    one multiplication a non-zero and channel; bit-identical in every run
#[derive(Debug)]
pub struct Kept {
    gpu: Gpu,
    by_row: Table,
    by_column: Table,
    nonzeros: usize,
}

#[derive(Debug)]
struct Table {
    rows: usize,
    colored: bool,
    sharers: u32,
    slabs: Vec<TableSlab>,
    long: Option<Box<Long>>,
}

/// Rows that are cut into pieces: each piece a sum, and each row the sum of its pieces.
#[derive(Debug)]
struct Long {
    pieces: Table,
    sums: Table,
    /// Which rows they are.
    index: Index,
    scratch: Mutex<[GpuVector; 2]>,
}

/// So many rows as can be seen at once.
#[derive(Debug)]
struct TableSlab {
    first: usize,
    rows: usize,
    nonzeros: usize,
    offsets: Allocation,
    elements: Allocation,
    weights: Allocation,
}

impl Kept {
    /// Hands the rows over.
    ///
    /// Errors: [`Error::AdapterMemory`]; [`Error::TooLarge`] for vectors, or single rows, that a kernel cannot see as a whole.
    pub fn new(gpu: &Gpu, rows: RowTable, elements: usize) -> Result<Self> {
        // Elements of a row lie anywhere, so a channel must be visible as a whole.
        let longest = elements.max(rows.rows()) as u64 * size_of::<f32>() as u64;
        gpu.expect_visible(
            "a channel of the rows that are kept",
            longest,
            "choose the strategy `matrix-free`",
        )?;
        Ok(Self {
            nonzeros: rows.elements.len(),
            by_column: Table::new(gpu, rows.transposed(elements))?,
            by_row: Table::new(gpu, rows)?,
            gpu: gpu.clone(),
        })
    }

    /// Bytes that the non-zeros of `T` take on a device.
    pub fn bytes(nonzeros: u64, rows: usize, elements: usize, channels: usize) -> u64 {
        2 * nonzeros * (4 + 4 * channels as u64) + 4 * (rows + elements) as u64
    }

    /// The number of non-zeros.
    pub fn nonzeros(&self) -> usize {
        self.nonzeros
    }
}

impl Long {
    /// Takes the long rows out of a table, which has none of them afterwards.
    fn cut_out(gpu: &Gpu, table: &mut RowTable) -> Result<Option<Box<Self>>> {
        let is_long = |table: &RowTable, row: usize| table.offsets[row + 1] - table.offsets[row] > LONG;
        let long: Arc<[u32]> =
            (0..table.rows()).filter(|&row| is_long(table, row)).map(|row| row as u32).collect();
        if long.is_empty() {
            return Ok(None);
        }
        let channels = table.weights.len();
        let empty =
            || RowTable { offsets: vec![0], elements: Vec::new(), weights: vec![Vec::new(); channels] };
        let (mut pieces, mut short) = (empty(), empty());
        let mut sums = RowTable { weights: vec![Vec::new()], ..empty() };
        for row in 0..table.rows() {
            let range = table.offsets[row]..table.offsets[row + 1];
            if is_long(table, row) {
                for first in range.clone().step_by(LONG) {
                    sums.elements.push(pieces.rows() as u32);
                    sums.weights[0].push(1.0);
                    pieces.append(table, first..(first + LONG).min(range.end));
                }
                sums.offsets.push(sums.elements.len());
                short.append(table, 0..0);
            } else {
                short.append(table, range);
            }
        }
        *table = short;
        let scratch = [GpuVector::zeros(gpu, pieces.rows()), GpuVector::zeros(gpu, long.len())];
        Ok(Some(Box::new(Self {
            index: scratch[0].index(&long)?,
            pieces: Table::new(gpu, pieces)?,
            sums: Table::new(gpu, sums)?,
            scratch: Mutex::new(scratch),
        })))
    }
}

impl Table {
    fn new(gpu: &Gpu, mut table: RowTable) -> Result<Self> {
        let long = Long::cut_out(gpu, &mut table)?;
        let rows = table.rows();
        let channels = table.weights.len();
        let at_once = gpu.binding_limit() as usize / (size_of::<f32>() * channels);
        let mean = table.elements.len() / rows.max(1);
        let sharers = match mean {
            0..16 => 1,
            16..128 => 8,
            _ => 32,
        };
        let (mut slabs, mut first) = (Vec::new(), 0);
        while first < rows {
            let begin = table.offsets[first];
            // All rows that fit, and at least one.
            let within = table.offsets[first..].partition_point(|&end| end - begin <= at_once) - 1;
            let count = within.min(at_once - 1).min(rows - first).max(1);
            let range = begin..table.offsets[first + count];
            if range.len() > at_once {
                return Err(Error::TooLarge {
                    what: "a row that is kept".to_owned(),
                    needed: format!("{} non-zeros", range.len()),
                    limit: format!("{at_once} non-zeros"),
                    remedy: "choose the strategy `matrix-free`",
                });
            }
            let offsets: Vec<u32> =
                table.offsets[first..=first + count].iter().map(|&offset| (offset - begin) as u32).collect();
            let weights: Vec<f32> =
                table.weights.iter().flat_map(|weights| &weights[range.clone()]).copied().collect();
            slabs.push(TableSlab {
                first,
                rows: count,
                nonzeros: range.len(),
                offsets: gpu.upload("the rows", &offsets)?,
                elements: gpu.upload("the rows", &table.elements[range])?,
                weights: gpu.upload("the rows", &weights)?,
            });
            first += count;
        }
        Ok(Self { rows, colored: channels == 3, sharers, slabs, long })
    }

    /// y ← the rows times x.
    fn gather(&self, gpu: &Gpu, x: &GpuVector, y: &GpuVector, squared: bool) {
        for [channel, channels] in GpuVector::channels(&[x, y]) {
            let (colored, sharers) = (self.colored, self.sharers);
            let program = Program::new(Kernel::Rows, Variant::Rows { colored, channels, squared, sharers });
            let of_x = x.slabs([channel, channels]).next();
            let of_y = y.slabs([channel, channels]).next();
            let (Some(of_x), Some(of_y)) = (of_x, of_y) else { continue };
            for (number, slab) in self.slabs.iter().enumerate() {
                // What exceeds a binding takes long enough for a submission of its own.
                if number > 0 {
                    gpu.hand_over();
                }
                let params = RowsParams {
                    rows: slab.rows as u32,
                    y_first: slab.first as u32,
                    y_stride: y.stride as u32,
                    channel,
                    x_stride: x.stride as u32,
                    nonzeros: slab.nonzeros as u32,
                    ..RowsParams::default()
                };
                let bindings = [
                    y.binding(of_y),
                    x.binding(of_x),
                    slab.offsets.whole(),
                    slab.elements.whole(),
                    slab.weights.whole(),
                ];
                gpu.dispatch(program, &params, &[&bindings], gpu.grid(slab.rows, LANES / sharers));
            }
        }
        if let Some(long) = &self.long {
            let [pieces, sums] = &*lock(&long.scratch);
            long.pieces.gather(gpu, x, pieces, squared);
            long.sums.gather(gpu, pieces, sums, false);
            y.overwrite(sums, &long.index);
        }
    }
}

impl LinearOperator for Kept {
    type Domain = GpuVector;
    type Range = GpuVector;

    fn domain(&self) -> GpuVector {
        GpuVector::zeros(&self.gpu, self.by_column.rows)
    }

    fn range(&self) -> GpuVector {
        GpuVector::zeros(&self.gpu, self.by_row.rows)
    }

    fn apply(&self, x: &GpuVector, y: &mut GpuVector) -> Result<()> {
        expect_len("x", x, self.by_column.rows)?;
        expect_len("y", y, self.by_row.rows)?;
        self.by_row.gather(&self.gpu, x, y, false);
        self.gpu.check()
    }

    fn apply_adjoint(&self, y: &GpuVector, x: &mut GpuVector) -> Result<()> {
        expect_len("x", x, self.by_column.rows)?;
        expect_len("y", y, self.by_row.rows)?;
        self.by_column.gather(&self.gpu, y, x, false);
        self.gpu.check()
    }
}

impl DeviceOperator for Kept {
    fn squares(&self, y: &GpuVector, x: &mut GpuVector) -> Result<bool> {
        expect_len("x", x, self.by_column.rows)?;
        expect_len("y", y, self.by_row.rows)?;
        self.by_column.gather(&self.gpu, y, x, true);
        self.gpu.check()?;
        Ok(true)
    }

    fn is_deterministic(&self) -> bool {
        true
    }

    fn storage(&self) -> Storage {
        Storage { kept_rows: self.by_row.rows, kept_nonzeros: self.nonzeros as u64, ..Storage::default() }
    }
}
