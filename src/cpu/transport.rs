use std::ops::Range;
use std::sync::{Mutex, MutexGuard};

use rayon::prelude::*;

use super::bands::Bands;
use super::rows::{CHUNK, Chunk, Padded, padded};
use crate::march::{Real, Traversal, Weight, channel};
use crate::operator::{CpuVector, LinearOperator, MatrixRows, Storage, WalkPlan, expect_len, lock, parallel};
use crate::scene::Strategy;
use crate::{Error, Result};

/// Memory for rows that are walked anew by a scatter, in bytes: small enough to stay near the processor.
const WALKED_AT_ONCE: u64 = 24 << 20;
/// The most elements for which tasks share rows and not bands. Where elements are so few, most rows meet many of them, and bands would
/// be few and their sums long.
const FEW: usize = 4096;
/// Chunks that one task adds up then.
const CHUNKS_AT_ONCE: usize = 64;
/// Elements that one task copies.
const PIECE: usize = 1 << 14;

/// Bytes that keeping all non-zeros takes on the processor, foreseen; `channels` weights of an `F` each.
pub fn kept_bytes<F>(plan: &WalkPlan, channels: usize) -> u64 {
    bytes_in::<F>(&Bands::for_plan(plan), plan, channels)
}

fn bytes_in<F>(bands: &Bands, plan: &WalkPlan, channels: usize) -> u64 {
    // A row has a run in every band at most, and none without a non-zero.
    let runs = plan.rows as f64 * plan.nonzeros_a_row().min(bands.len() as f64);
    let starts = plan.rows.div_ceil(CHUNK) * (bands.len() + 1) * size_of::<u32>();
    let nonzero = size_of::<u16>() + channels * size_of::<F>();
    (plan.nonzeros as f64 * nonzero as f64 + 8.0 * runs + starts as f64) as u64
}

/// `T` of a traversal as an operator: kept where memory allows, walked again where not.
///
/// Shapes  x: elements, y: rows, three channels each
/// Law     ⟨T x, y⟩ = ⟨x, Tᵀ y⟩, held by tests/suite/operator.rs
/// Cost    one multiplication a non-zero that is kept, one walk a row that is not; bit-identical for any
///         number of threads; kept and walked rows agree to rounding, not to the bit
#[derive(Debug)]
pub struct Transport<T, F, const C: usize> {
    traversal: T,
    kept: KeptRows<F, C>,
}

/// The rows that are kept, and what products with all rows need: it does not know what is walked.
#[derive(Debug)]
struct KeptRows<F, const C: usize> {
    rows: usize,
    /// The first element whose column is long.
    long_from: usize,
    bands: Bands,
    chunks: Vec<Chunk<F, C>>,
    /// Rows from here on are walked.
    first_walked: usize,
    /// Rows that a scatter walks before it adds them up.
    rows_at_once: usize,
    /// One padded vector of elements, kept from one application to the next: fresh memory costs more than the products.
    room: Mutex<Vec<Padded<F>>>,
}

/// Walks some rows.
type Walks<'a, F, const C: usize> = &'a dyn Fn(Range<usize>) -> Vec<Chunk<F, C>>;

/// What a chunk adds to the sums of a band.
type Scatters<'a, F, const C: usize> = &'a (dyn Fn(&Chunk<F, C>, usize, &mut [Padded<F>]) + Sync);

impl<T: Traversal<f64, C>, F: Real, const C: usize> Transport<T, F, C> {
    /// Keeps as many rows as `strategy` and the `budget` in bytes ask for. The plan must be of the same traversal.
    ///
    /// Errors: [`Error::TooLarge`] when all rows must be kept and do not fit.
    pub fn new(traversal: T, plan: &WalkPlan, strategy: Strategy, budget: u64) -> Result<Self> {
        let rows = traversal.rows();
        let bands = Bands::for_plan(plan);
        let bytes = bytes_in::<F>(&bands, plan, C);
        let kept_rows = match strategy {
            Strategy::MatrixFree => 0,
            _ if bytes <= budget => rows,
            Strategy::Assembled => {
                return Err(Error::TooLarge {
                    what: "the assembled transport".to_owned(),
                    needed: format!("{bytes} bytes"),
                    limit: format!("{budget} bytes"),
                    remedy: "raise solve.memory, lower the sizes, or choose the strategy `auto` or `matrix-free`",
                });
            }
            Strategy::Auto => (rows as f64 * budget as f64 / bytes as f64) as usize / CHUNK * CHUNK,
        };
        let bytes_a_row = bytes / rows.max(1) as u64 + 1;
        let rows_at_once = (WALKED_AT_ONCE / bytes_a_row) as usize / CHUNK * CHUNK;
        let kept = KeptRows {
            rows,
            long_from: traversal.long_from(),
            bands,
            chunks: Vec::new(),
            first_walked: kept_rows,
            rows_at_once: rows_at_once.max(4 * CHUNK),
            room: Mutex::new(Vec::new()),
        };
        let mut transport = Self { traversal, kept };
        transport.kept.chunks = transport.walk_chunks(0..kept_rows);
        Ok(transport)
    }

    /// What is walked.
    pub fn traversal(&self) -> &T {
        &self.traversal
    }

    /// What is kept.
    pub fn storage(&self) -> Storage {
        Storage {
            kept_rows: self.kept.first_walked,
            walked_rows: self.traversal.rows() - self.kept.first_walked,
            kept_nonzeros: self.kept.chunks.iter().map(|chunk| chunk.nonzeros() as u64).sum(),
            bytes: self.kept.chunks.iter().map(|chunk| chunk.bytes() as u64).sum(),
            of_light_volumes: false,
        }
    }

    /// diag(Tᵀ diag(y) T): with constraint weights for y the coverage, and the diagonal of the normal matrix.
    ///
    /// Errors: [`Error::Shape`] when there is not one weight a row.
    pub fn squares(&self, y: &CpuVector<F>) -> Result<CpuVector<F>> {
        expect_len("the weights", y, self.traversal.rows())?;
        let mut x = self.domain();
        self.kept.scatter_with(&mut x, &|rows| self.walk_chunks(rows), &|chunk, band, x| {
            chunk.squares(band, &y.0, x);
        });
        Ok(x)
    }

    fn walk_chunks(&self, rows: Range<usize>) -> Vec<Chunk<F, C>> {
        parallel::map(rows.len().div_ceil(CHUNK), &|index| {
            let start = rows.start + index * CHUNK;
            Chunk::walk(&self.traversal, start..(start + CHUNK).min(rows.end), &self.kept.bands)
        })
    }
}

impl<F: Real, const C: usize> KeptRows<F, C> {
    /// Sends every chunk, kept or walked for the purpose, to every band of x.
    fn scatter_with(&self, x: &mut CpuVector<F>, walk: Walks<F, C>, scatter: Scatters<F, C>) {
        if x.0.len() <= FEW {
            return self.scatter_to_few(x, walk, scatter);
        }
        let mut room = self.room();
        room.par_chunks_mut(PIECE).for_each(|sums| sums.fill([F::zero(); 4]));
        let long = self.long_from;
        let add = |chunks: &[Chunk<F, C>], sums: &mut [Padded<F>]| {
            self.bands.split_slots(sums).into_par_iter().enumerate().for_each(|(band, sums)| {
                let range = self.bands.range(band);
                let short = Bands::slot(long.clamp(range.start, range.end) - range.start);
                let short = short.min(sums.len());
                let mut wide: Vec<[f64; 4]> = sums[short..].iter().map(|sum| sum.map(Real::wide)).collect();
                for chunk in chunks {
                    sums[short..].fill([F::zero(); 4]);
                    scatter(chunk, band, sums);
                    for (wide, sum) in wide.iter_mut().zip(&sums[short..]) {
                        (0..4).for_each(|lane| wide[lane] += sum[lane].wide());
                    }
                }
                sums[short..].iter_mut().zip(wide).for_each(|(sum, wide)| *sum = wide.map(F::of));
            });
        };
        add(&self.chunks, &mut room);
        let rows = self.rows;
        for start in (self.first_walked..rows).step_by(self.rows_at_once) {
            add(&walk(start..(start + self.rows_at_once).min(rows)), &mut room);
        }
        let bands = self.bands.split(&mut x.0).into_par_iter().zip(self.bands.split_slots(&mut room));
        bands.for_each(|(x, sums)| {
            for (x, sums) in Bands::runs_mut(x).zip(Bands::runs_of_slots(sums)) {
                x.iter_mut().zip(sums).for_each(|(element, &mut [r, g, b, _])| *element = [r, g, b]);
            }
        });
    }

    /// The same for few elements: tasks share the rows and each has sums of its own, in f64 from chunk to chunk.
    fn scatter_to_few(&self, x: &mut CpuVector<F>, walk: Walks<F, C>, scatter: Scatters<F, C>) {
        let slots = self.bands.all_slots();
        let mut sums = vec![[0.0_f64; 3]; slots];
        let sum = |chunks: &[Chunk<F, C>]| {
            let (mut sums, mut run) = (vec![[0.0_f64; 3]; slots], vec![[F::zero(); 4]; slots]);
            for chunk in chunks {
                run.fill([F::zero(); 4]);
                let bands = self.bands.split_slots(&mut run).into_iter().enumerate();
                bands.for_each(|(band, run)| scatter(chunk, band, run));
                for (sum, run) in sums.iter_mut().zip(&run) {
                    (0..3).for_each(|c| sum[c] += run[c].wide());
                }
            }
            sums
        };
        let mut add = |chunks: &[Chunk<F, C>]| {
            let parts: Vec<Vec<[f64; 3]>> = chunks.par_chunks(CHUNKS_AT_ONCE).map(sum).collect();
            for part in &parts {
                sums.iter_mut().zip(part).for_each(|(sum, part)| (0..3).for_each(|c| sum[c] += part[c]));
            }
        };
        add(&self.chunks);
        let rows = self.rows;
        for start in (self.first_walked..rows).step_by(self.rows_at_once) {
            add(&walk(start..(start + self.rows_at_once).min(rows)));
        }
        for (x, sums) in self.bands.split(&mut x.0).into_iter().zip(self.bands.split_slots(&mut sums)) {
            for (x, sums) in Bands::runs_mut(x).zip(Bands::runs_of_slots(sums)) {
                x.iter_mut().zip(sums).for_each(|(x, sum)| *x = sum.map(F::of));
            }
        }
    }

    /// y ← T x of the rows that are kept.
    fn gather(&self, x: &[[F; 3]], y: &mut [[F; 3]]) {
        if self.chunks.is_empty() {
            return;
        }
        let mut room = self.room();
        let bands = self.bands.split_slots(&mut room).into_par_iter().enumerate();
        bands.for_each(|(band, room)| {
            let x = Bands::runs(&x[self.bands.range(band)]);
            for (room, x) in Bands::runs_of_slots(room).zip(x) {
                room.iter_mut().zip(x).for_each(|(room, &element)| *room = padded(element));
            }
        });
        let rows = y.par_chunks_mut(CHUNK).zip(&self.chunks);
        rows.for_each(|(y, chunk)| chunk.gather(&self.bands, &room, y));
    }

    /// Room for one padded vector of elements in their slots.
    fn room(&self) -> MutexGuard<'_, Vec<Padded<F>>> {
        let mut room = lock(&self.room);
        room.resize(self.bands.all_slots(), [F::zero(); 4]);
        room
    }
}

impl<T: Traversal<f64, C>, F: Real, const C: usize> MatrixRows<F, C> for Transport<T, F, C> {
    fn rows(&self) -> usize {
        self.traversal.rows()
    }

    fn visit(&self, row: usize, visit: &mut impl FnMut(usize, Weight<F, C>)) {
        match self.kept.chunks.get(row / CHUNK).filter(|_| row < self.kept.first_walked) {
            Some(chunk) => chunk.visit(row, &self.kept.bands, visit),
            None => self.traversal.walk_shared(row, &mut |element, weight| visit(element, weight.map(F::of))),
        }
    }
}

impl<T: Traversal<f64, C>, F: Real, const C: usize> LinearOperator for Transport<T, F, C> {
    type Domain = CpuVector<F>;
    type Range = CpuVector<F>;

    fn domain(&self) -> CpuVector<F> {
        CpuVector::zeros(self.traversal.elements())
    }

    fn range(&self) -> CpuVector<F> {
        CpuVector::zeros(self.traversal.rows())
    }

    fn apply(&self, x: &CpuVector<F>, y: &mut CpuVector<F>) -> Result<()> {
        expect_len("x", x, self.traversal.elements())?;
        expect_len("y", y, self.traversal.rows())?;
        let first_walked = self.kept.first_walked;
        let (kept, walked) = y.0.split_at_mut(first_walked);
        self.kept.gather(&x.0, kept);
        parallel::on_pieces(walked, CHUNK, &|first, y| {
            for (local, y) in y.iter_mut().enumerate() {
                *y = gather(&self.traversal, first_walked + first + local, &x.0);
            }
        });
        Ok(())
    }

    fn apply_adjoint(&self, y: &CpuVector<F>, x: &mut CpuVector<F>) -> Result<()> {
        expect_len("x", x, self.traversal.elements())?;
        expect_len("y", y, self.traversal.rows())?;
        self.kept.scatter_with(x, &|rows| self.walk_chunks(rows), &|chunk, band, x| {
            chunk.scatter(band, &y.0, x);
        });
        Ok(())
    }
}

/// One element of T x, walked.
pub(crate) fn gather<F: Real, const C: usize>(
    traversal: &impl Traversal<f64, C>,
    row: usize,
    x: &[[F; 3]],
) -> [F; 3] {
    let mut sum = [0.0_f64; 3];
    traversal.walk(row, &mut |element, weight| {
        let x = x[element];
        for c in 0..3 {
            sum[c] += F::of(channel(&weight, c)).wide() * x[c].wide();
        }
    });
    sum.map(F::of)
}
