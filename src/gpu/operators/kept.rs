//! Rows that are kept on the device, and their transpose: both directions gather, without atomics and always in the same order.

use std::ops::Range;
use std::sync::Mutex;

use super::device_operator::DeviceOperator;
use crate::Result;
use crate::gpu::device::{Allocation, Gpu};
use crate::gpu::kernels::layout::{RowsGroup, RowsParams};
use crate::gpu::kernels::{Kernel, LANES, Program, SHARERS, Variant};
use crate::gpu::vectors::GpuVector;
use crate::operator::{LinearOperator, RowTable, Storage, Vector, expect_len, lock};

/// Non-zeros that one row may have before it is cut into pieces: sixteen a lane. The texels around an eye are in every row of its view, and
/// a few lanes would work on their columns long after all others are done.
const LONG: usize = 512;

/// T whose non-zeros are kept on the device, by rows and by columns.
///
/// Shapes  x: elements, y: rows, three channels each
/// Cost    one multiplication a non-zero and channel; bit-identical in every run
#[derive(Debug)]
pub struct Kept {
    by_row: KeptRows,
    by_column: KeptRows,
}

/// The rows of a matrix, to gather with.
#[derive(Debug)]
pub(super) struct KeptRows {
    gpu: Gpu,
    table: Table,
    elements: usize,
    nonzeros: usize,
    /// Bound where rows have no pieces.
    unused: GpuVector,
    /// A vector whose channels lie side by side, where rows look up such ones. Who has it may also use the pieces.
    together: Mutex<Option<Allocation>>,
}

/// Rows, sorted by how many lanes share one, so that the lanes of a workgroup end together.
#[derive(Debug)]
struct Table {
    rows: usize,
    colored: bool,
    slabs: Vec<TableSlab>,
    long: Option<Long>,
}

/// What becomes of the pieces of rows that are cut.
#[derive(Debug)]
struct Long {
    pieces: GpuVector,
    /// The rows that are cut, over their pieces.
    sums: Vec<TableSlab>,
}

/// So many rows as can be seen at once.
#[derive(Debug)]
struct TableSlab {
    nonzeros: usize,
    workgroups: usize,
    groups: Allocation,
    rows: Allocation,
    elements: Allocation,
    weights: Allocation,
}

/// A row, or a piece of one: its non-zeros, and where its sum goes.
type Item = (Range<usize>, u32);

/// What is gathered from, and where to.
struct Gathering<'a> {
    x: &'a GpuVector,
    /// The same with its channels side by side.
    together: Option<&'a Allocation>,
    y: &'a GpuVector,
    pieces: &'a GpuVector,
    colored: bool,
    squared: bool,
}

impl Kept {
    /// Hands the rows over.
    ///
    /// Errors: [`Error::AdapterMemory`](crate::Error::AdapterMemory); [`Error::TooLarge`](crate::Error::TooLarge) for vectors that a kernel cannot see as a whole.
    pub fn new(gpu: &Gpu, rows: RowTable, elements: usize) -> Result<Self> {
        let by_column = KeptRows::new(gpu, &rows.transposed(elements), rows.rows())?;
        Ok(Self { by_row: KeptRows::new(gpu, &rows, elements)?, by_column })
    }

    /// Bytes that the non-zeros of `T` take on a device.
    pub fn bytes(nonzeros: u64, rows: usize, elements: usize, channels: usize) -> u64 {
        let of_rows = size_of::<[u32; 2]>() + size_of::<RowsGroup>() + size_of::<[f32; 4]>();
        2 * nonzeros * (4 + 4 * channels as u64) + (of_rows * (rows + elements)) as u64
    }

    /// The number of non-zeros.
    pub fn nonzeros(&self) -> usize {
        self.by_row.nonzeros
    }
}

impl KeptRows {
    /// Hands rows over that have so many elements.
    ///
    /// Errors: as [`Kept::new`].
    pub(super) fn new(gpu: &Gpu, rows: &RowTable, elements: usize) -> Result<Self> {
        let table = Table::new(gpu, rows)?;
        // Elements of a row lie anywhere, so a channel must be visible as a whole.
        let bytes = elements.max(rows.rows()).max(table.pieces()) * size_of::<f32>();
        gpu.expect_visible(
            "a channel of the rows that are kept",
            bytes as u64,
            "choose the strategy `matrix-free`",
        )?;
        let together = (elements * size_of::<[f32; 4]>()) as u64;
        let is_together = gpu.tactics().interleaved && together <= gpu.binding_limit();
        let together = is_together.then(|| gpu.try_allocate("a vector", together)).transpose()?;
        Ok(Self {
            table,
            elements,
            nonzeros: rows.elements.len(),
            unused: GpuVector::zeros(gpu, 1),
            together: Mutex::new(together),
            gpu: gpu.clone(),
        })
    }

    /// y ← the rows times x, their weights squared where that is asked for.
    ///
    /// Errors: [`Error::Shape`](crate::Error::Shape) when a vector does not fit, and what has gone wrong on the device.
    pub(super) fn gather(&self, x: &GpuVector, y: &mut GpuVector, squared: bool) -> Result<()> {
        expect_len("the elements", x, self.elements)?;
        expect_len("the rows", y, self.table.rows)?;
        let y = &*y;
        let together = lock(&self.together);
        let together = together.as_ref().filter(|_| x.fits() && y.fits());
        together.iter().for_each(|together| x.interleave(together));
        let (colored, unused) = (self.table.colored, &self.unused);
        let pieces = self.table.long.as_ref().map_or(unused, |long| &long.pieces);
        let gathering = Gathering { x, together, y, pieces, colored, squared };
        gathering.record(&self.gpu, self.table.rows, &self.table.slabs);
        if let Some(long) = &self.table.long {
            let sums =
                Gathering { x: pieces, pieces: unused, together: None, colored: false, squared: false, y };
            sums.record(&self.gpu, self.table.rows, &long.sums);
        }
        self.gpu.check()
    }

    /// A vector over the rows.
    pub(super) fn range(&self) -> GpuVector {
        GpuVector::zeros(&self.gpu, self.table.rows)
    }
}

impl Table {
    fn new(gpu: &Gpu, table: &RowTable) -> Result<Self> {
        let rows = table.rows();
        let (mut items, mut long) = (Vec::with_capacity(rows), Vec::new());
        let mut pieces = 0;
        for (row, ends) in table.offsets.windows(2).enumerate() {
            let range = ends[0]..ends[1];
            if range.len() <= LONG {
                items.push((range, row as u32));
                continue;
            }
            let first = pieces;
            for begin in range.clone().step_by(LONG) {
                items.push((begin..(begin + LONG).min(range.end), (rows + pieces) as u32));
                pieces += 1;
            }
            long.push((first..pieces, row as u32));
        }
        let slabs = slabs_of(gpu, table, items)?;
        let long = if pieces == 0 {
            None
        } else {
            let elements = (0..pieces as u32).collect();
            let sums = RowTable { offsets: Vec::new(), elements, weights: vec![vec![1.0; pieces]] };
            Some(Long { pieces: GpuVector::zeros(gpu, pieces), sums: slabs_of(gpu, &sums, long)? })
        };
        Ok(Self { rows, colored: table.weights.len() == 3, slabs, long })
    }

    fn pieces(&self) -> usize {
        self.long.as_ref().map_or(0, |long| long.pieces.len())
    }
}

/// Lanes that share so many non-zeros.
fn sharers(nonzeros: usize) -> u32 {
    match nonzeros {
        0..16 => 1,
        16..128 => 8,
        _ => SHARERS,
    }
}

/// The rows as a device has them.
fn slabs_of(gpu: &Gpu, table: &RowTable, mut items: Vec<Item>) -> Result<Vec<TableSlab>> {
    items.sort_by_key(|(range, _)| sharers(range.len()));
    let limit = gpu.binding_limit() as usize;
    let most_rows = limit / size_of::<RowsGroup>() - 1;
    let most = (limit / (size_of::<f32>() * table.weights.len())).max(LONG);
    let (mut slabs, mut rest) = (Vec::new(), &items[..]);
    while !rest.is_empty() {
        // All that fit, and at least one.
        let mut nonzeros = 0;
        let mut fits = |(range, _): &Item| {
            nonzeros += range.len();
            nonzeros <= most
        };
        let count = rest.iter().take(most_rows).position(|item| !fits(item));
        let (here, behind) = rest.split_at(count.unwrap_or(rest.len().min(most_rows)).max(1));
        slabs.push(TableSlab::new(gpu, table, here)?);
        rest = behind;
    }
    Ok(slabs)
}

impl TableSlab {
    fn new(gpu: &Gpu, table: &RowTable, items: &[Item]) -> Result<Self> {
        let mut begin = 0;
        let mut rows: Vec<[u32; 2]> = Vec::with_capacity(items.len() + 1);
        for (range, place) in items {
            rows.push([begin, *place]);
            begin += range.len() as u32;
        }
        rows.push([begin, 0]);
        let mut groups = Vec::new();
        let mut first = 0;
        for alike in items.chunk_by(|(a, _), (b, _)| sharers(a.len()) == sharers(b.len())) {
            let (end, sharers) = (first + alike.len() as u32, sharers(alike[0].0.len()));
            let each = LANES / sharers;
            let group = |first: u32| RowsGroup { first, end: (first + each).min(end), sharers, pad: 0 };
            groups.extend((first..end).step_by(each as usize).map(group));
            first = end;
        }
        let of = |range: &Range<usize>| table.elements[range.clone()].iter().copied();
        let elements: Vec<u32> = items.iter().flat_map(|(range, _)| of(range)).collect();
        let weights = table.weights.iter();
        let of = |weights: &'_ Vec<f32>| -> Vec<f32> {
            items.iter().flat_map(|(range, _)| &weights[range.clone()]).copied().collect()
        };
        let weights: Vec<f32> = weights.flat_map(of).collect();
        Ok(Self {
            nonzeros: elements.len(),
            workgroups: groups.len(),
            groups: gpu.upload("the rows", &groups)?,
            rows: gpu.upload("the rows", &rows)?,
            elements: gpu.upload("the rows", &elements)?,
            weights: gpu.upload("the rows", &weights)?,
        })
    }
}

impl Gathering<'_> {
    /// Records all rows of some slabs; so many places are those of `y`, and those behind them of the pieces.
    fn record(&self, gpu: &Gpu, places: usize, slabs: &[TableSlab]) {
        let Self { x, together, y, pieces, colored, squared } = *self;
        for [channel, channels] in GpuVector::channels(&[x, y, pieces]) {
            let interleaved = together.is_some() && channels == 3;
            let program =
                Program::new(Kernel::Rows, Variant::Rows { colored, channels, squared, interleaved });
            let bound = |vector: &GpuVector| {
                let slab = vector.slabs([channel, channels]).next();
                slab.map(|slab| vector.binding(slab))
            };
            let (Some(of_x), Some(of_y), Some(of_pieces)) = (bound(x), bound(y), bound(pieces)) else {
                continue;
            };
            let of_x = together.filter(|_| interleaved).map_or(of_x, Allocation::whole);
            for (number, slab) in slabs.iter().enumerate() {
                // What exceeds a binding takes long enough for a submission of its own.
                if number > 0 {
                    gpu.hand_over();
                }
                let params = RowsParams {
                    nonzeros: slab.nonzeros as u32,
                    channel,
                    x_stride: x.stride as u32,
                    y_stride: y.stride as u32,
                    pieces_stride: pieces.stride as u32,
                    places: places as u32,
                    groups: slab.workgroups as u32,
                    pad: 0,
                };
                let bindings = [
                    of_y.clone(),
                    of_x.clone(),
                    of_pieces.clone(),
                    slab.groups.whole(),
                    slab.rows.whole(),
                    slab.elements.whole(),
                    slab.weights.whole(),
                ];
                gpu.dispatch(program, &params, &[&bindings], gpu.grid(slab.workgroups, 1));
            }
        }
    }
}

impl LinearOperator for Kept {
    type Domain = GpuVector;
    type Range = GpuVector;

    fn domain(&self) -> GpuVector {
        self.by_column.range()
    }

    fn range(&self) -> GpuVector {
        self.by_row.range()
    }

    fn apply(&self, x: &GpuVector, y: &mut GpuVector) -> Result<()> {
        self.by_row.gather(x, y, false)
    }

    fn apply_adjoint(&self, y: &GpuVector, x: &mut GpuVector) -> Result<()> {
        self.by_column.gather(y, x, false)
    }
}

impl DeviceOperator for Kept {
    fn squares(&self, y: &GpuVector, x: &mut GpuVector) -> Result<bool> {
        self.by_column.gather(y, x, true)?;
        Ok(true)
    }

    fn is_deterministic(&self) -> bool {
        true
    }

    fn storage(&self) -> Storage {
        let rows = self.by_row.table.rows;
        Storage { kept_rows: rows, kept_nonzeros: self.nonzeros() as u64, ..Storage::default() }
    }
}
