use std::ops::Range;
use std::sync::{Mutex, MutexGuard};

use rayon::prelude::*;

use super::bands::Bands;
use super::products::{Padded, padded};
use super::rows::{CHUNKS, Chunk, PIECE, Packing};
use crate::march::{Real, Traversal, Weight};
use crate::operator::{
    CpuVector, LinearOperator, MatrixRows, RowOrder, Storage, WalkPlan, expect_len, lock, parallel,
};
use crate::scene::Strategy;
use crate::{Error, Result};

/// Memory for rows that are walked anew by a scatter, in bytes: small enough to stay near the processor.
const WALKED_AT_ONCE: u64 = 24 << 20;
/// The most elements for which tasks share rows and not bands. Where elements are so few, most rows meet many of them, and bands would
/// be few and their sums long.
const FEW: usize = 4096;
/// Rows that one task adds up then.
const ROWS_AT_ONCE: usize = 4096;
/// Elements, or rows, that one task copies.
const COPIED: usize = 1 << 14;

/// Bytes that keeping all non-zeros takes on the processor, foreseen; `channels` weights of an `F` each.
pub fn kept_bytes<F>(plan: &WalkPlan, channels: usize) -> u64 {
    Packing::quickest::<F>(plan, channels).bytes::<F>(plan, &Bands::for_plan(plan), channels)
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
pub(super) struct KeptRows<F, const C: usize> {
    rows: usize,
    /// The order in which rows are kept and walked; what follows counts by it.
    order: RowOrder,
    /// The first element whose column is long.
    long_from: usize,
    bands: Bands,
    chunks: Vec<Chunk<F, C>>,
    /// Rows from here on are walked.
    first_walked: usize,
    /// Rows of a chunk.
    chunk: usize,
    /// Rows that a scatter walks before it adds them up.
    rows_at_once: usize,
    /// Bytes that products with rows that are walked may take.
    walking: u64,
    room: Mutex<Room<F>>,
}

/// Vectors that are kept from one application to the next: fresh memory costs more than the products.
#[derive(Debug, Default)]
struct Room<F> {
    /// Elements in their slots.
    elements: Vec<Padded<F>>,
    /// Rows in their order, and as many as a block may lack at its end.
    rows: Vec<Padded<F>>,
}

/// Walks some rows.
pub(super) type Walks<'a, F, const C: usize> = &'a dyn Fn(Range<usize>) -> Vec<Chunk<F, C>>;

/// What some blocks of a chunk add to the sums of a band, of the rows in their order.
pub(super) type Sends<F, const C: usize> =
    fn(&Chunk<F, C>, (usize, Range<usize>), &[Padded<F>], &mut [Padded<F>]);

impl<T: Traversal<f64, C>, F: Real, const C: usize> Transport<T, F, C> {
    /// Keeps as many rows as `strategy` and the `budget` in bytes ask for. The plan must be of the same traversal.
    ///
    /// Errors: [`Error::TooLarge`] when all rows must be kept and do not fit.
    pub fn new(traversal: T, plan: &WalkPlan, strategy: Strategy, budget: u64) -> Result<Self> {
        let rows = traversal.rows();
        let (bands, packing) = (Bands::for_plan(plan), Packing::quickest::<F>(plan, C));
        let bytes = packing.bytes::<F>(plan, &bands, C);
        // Walks are fast where they have some room; rows take the rest.
        let (whole, walking) = (budget, traversal.room().min(budget / 2));
        let budget = whole - walking;
        let kept_rows = match strategy {
            Strategy::MatrixFree => 0,
            _ if bytes <= whole => rows,
            Strategy::Assembled => {
                return Err(Error::TooLarge {
                    what: "the assembled transport".to_owned(),
                    needed: format!("{bytes} bytes"),
                    limit: format!("{whole} bytes"),
                    remedy: "raise solve.memory, lower the sizes, or choose the strategy `auto` or `matrix-free`",
                });
            }
            Strategy::Auto | Strategy::Epipolar => {
                let order = plan.order.bytes() as u64;
                let share = budget.saturating_sub(order) as f64 / (bytes - order) as f64;
                (rows as f64 * share) as usize / packing.chunk * packing.chunk
            }
        };
        // Blocks would not pay for rows that are walked for one product.
        let single = Packing::single(plan);
        let bytes_a_row = single.bytes::<F>(plan, &bands, C) / rows.max(1) as u64 + 1;
        let rows_at_once = (WALKED_AT_ONCE / bytes_a_row) as usize / single.chunk * single.chunk;
        let kept = KeptRows {
            rows,
            order: plan.order.clone(),
            long_from: traversal.long_from(),
            bands,
            chunks: Vec::new(),
            first_walked: kept_rows,
            chunk: single.chunk,
            rows_at_once: rows_at_once.max(4 * single.chunk),
            walking: if kept_rows == 0 { whole } else { walking },
            room: Mutex::default(),
        };
        let mut transport = Self { traversal, kept };
        transport.kept.chunks = transport.walk_chunks(0..kept_rows, packing.lanes);
        if kept_rows < rows {
            transport.kept.keep_within(budget);
        }
        Ok(transport)
    }

    /// What is walked.
    pub fn traversal(&self) -> &T {
        &self.traversal
    }

    /// What is kept.
    pub fn storage(&self) -> Storage {
        self.kept.storage()
    }

    /// diag(Tᵀ diag(y) T): with constraint weights for y the coverage, and the diagonal of the normal matrix.
    ///
    /// Errors: [`Error::Shape`] when there is not one weight a row.
    pub fn squares(&self, y: &CpuVector<F>) -> Result<CpuVector<F>> {
        expect_len("the weights", y, self.traversal.rows())?;
        let mut x = self.domain();
        self.kept.send(y, &mut x, &|rows| self.walk_chunks(rows, 1), Chunk::squares);
        Ok(x)
    }

    /// What is kept of its rows.
    pub(super) fn kept(&self) -> &KeptRows<F, C> {
        &self.kept
    }

    fn walk_chunks(&self, rows: Range<usize>, lanes: usize) -> Vec<Chunk<F, C>> {
        let kept = &self.kept;
        parallel::map(rows.len().div_ceil(kept.chunk), &|index| {
            let start = rows.start + index * kept.chunk;
            let rows = start..(start + kept.chunk).min(rows.end);
            Chunk::walk(&self.traversal, (&kept.order, rows), lanes, &kept.bands)
        })
    }
}

impl<F: Real, const C: usize> KeptRows<F, C> {
    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    pub(super) fn elements(&self) -> usize {
        self.bands.elements()
    }

    pub(super) fn storage(&self) -> Storage {
        Storage {
            kept_rows: self.first_walked,
            walked_rows: self.rows - self.first_walked,
            kept_nonzeros: self.chunks.iter().map(|chunk| chunk.nonzeros() as u64).sum(),
            bytes: self.bytes(),
            of_light_volumes: false,
        }
    }

    /// The rows of all blocks that hold some of these rows, in the order in which they are kept, and what is kept of them; none where not
    /// all rows are.
    pub(super) fn picked(&self, rows: &[usize]) -> Option<(Vec<usize>, Self)> {
        let lanes = self.chunks.first().filter(|_| self.first_walked == self.rows)?.lanes;
        let mut blocks: Vec<usize> = rows.iter().map(|&row| self.order.position(row) / lanes).collect();
        blocks.sort_unstable();
        blocks.dedup();
        let positions = blocks.iter().flat_map(|block| block * lanes..((block + 1) * lanes).min(self.rows));
        let covered: Vec<usize> = positions.map(|position| self.order.row(position)).collect();
        let at = |block: &usize| {
            let position = block * lanes;
            (&self.chunks[position / self.chunk], position % self.chunk / lanes)
        };
        let chunk = (covered.len() / CHUNKS).clamp(PIECE, self.chunk.max(PIECE)) / PIECE * PIECE;
        let parts: Vec<&[usize]> = blocks.chunks(chunk / lanes).collect();
        let chunks = parallel::map(parts.len(), &|part| {
            let rows = part * chunk..((part + 1) * chunk).min(covered.len());
            Chunk::of_blocks(&parts[part].iter().map(at).collect::<Vec<_>>(), (rows, lanes), self.bands.len())
        });
        let kept = Self {
            rows: covered.len(),
            order: RowOrder::default(),
            long_from: self.long_from,
            bands: self.bands.clone(),
            chunks,
            first_walked: covered.len(),
            chunk,
            rows_at_once: self.rows_at_once,
            walking: 0,
            room: Mutex::default(),
        };
        Some((covered, kept))
    }

    /// Visits the non-zeros of a row that is kept.
    pub(super) fn visit(&self, row: usize, visit: &mut impl FnMut(usize, Weight<F, C>)) {
        let position = self.order.position(row);
        self.chunks[position / self.chunk].visit(position, &self.bands, visit);
    }

    /// y ← T x: the kept rows from what is kept, and `walk` sees to the others, which it is given in their order.
    pub(super) fn gather(&self, x: &CpuVector<F>, y: &mut CpuVector<F>, walk: impl FnOnce(&mut [Padded<F>])) {
        let mut room = self.room();
        let (gathered, walked) = room.rows[..self.rows].split_at_mut(self.first_walked);
        let gathered = gathered.par_chunks_mut(self.chunk).zip(&self.chunks);
        gathered.for_each(|(y, chunk)| chunk.gather(&self.bands, &x.0, y));
        walk(walked);
        let rows = &room.rows[..];
        parallel::on_pieces(&mut y.0, COPIED, &|first, y| {
            for (row, y) in (first..).zip(y) {
                let [r, g, b, _] = rows[self.order.position(row)];
                *y = [r, g, b];
            }
        });
    }

    fn bytes(&self) -> u64 {
        let order = if self.chunks.is_empty() { 0 } else { self.order.bytes() };
        self.chunks.iter().map(Chunk::bytes).sum::<usize>() as u64 + order as u64
    }

    /// Drops rows that were foreseen to be shorter.
    fn keep_within(&mut self, budget: u64) {
        while self.bytes() > budget {
            self.first_walked = self.chunks.pop().map_or(0, |chunk| chunk.rows.start);
        }
    }

    /// Sends what every row has to every band of x, walking anew what is not kept.
    pub(super) fn send(&self, y: &CpuVector<F>, x: &mut CpuVector<F>, walk: Walks<F, C>, send: Sends<F, C>) {
        let mut room = self.room();
        let Room { elements, rows } = &mut *room;
        parallel::on_pieces(&mut rows[..self.rows], COPIED, &|first, rows| {
            for (position, value) in (first..).zip(rows) {
                *value = padded(y.0[self.order.row(position)]);
            }
        });
        let rows = &rows[..];
        if x.0.len() <= FEW {
            return self.send_to_few(rows, x, walk, send);
        }
        parallel::on_pieces(elements, COPIED, &|_, sums| sums.fill([F::zero(); 4]));
        let add = |chunks: &[Chunk<F, C>], sums: &mut [Padded<F>]| {
            self.bands.split_slots(sums).into_par_iter().enumerate().for_each(|(band, sums)| {
                self.send_to_band(band, rows, chunks, sums, send);
            });
        };
        add(&self.chunks, elements);
        for start in (self.first_walked..self.rows).step_by(self.rows_at_once) {
            add(&walk(start..(start + self.rows_at_once).min(self.rows)), elements);
        }
        let bands = self.bands.split(&mut x.0).into_par_iter().zip(self.bands.split_slots(elements));
        bands.for_each(|(x, sums)| {
            for (x, sums) in Bands::runs_mut(x).zip(Bands::runs_of_slots(sums)) {
                x.iter_mut().zip(sums).for_each(|(element, &mut [r, g, b, _])| *element = [r, g, b]);
            }
        });
    }

    /// Adds what chunks send to a band; sums of long columns are in f64 from piece to piece.
    fn send_to_band(
        &self,
        band: usize,
        rows: &[Padded<F>],
        chunks: &[Chunk<F, C>],
        sums: &mut [Padded<F>],
        send: Sends<F, C>,
    ) {
        let range = self.bands.range(band);
        let short = Bands::slot(self.long_from.clamp(range.start, range.end) - range.start).min(sums.len());
        if short == sums.len() {
            chunks.iter().for_each(|chunk| send(chunk, (band, chunk.blocks()), rows, sums));
            return;
        }
        let mut wide: Vec<[f64; 4]> = sums[short..].iter().map(|sum| sum.map(Real::wide)).collect();
        for chunk in chunks {
            for piece in chunk.pieces() {
                sums[short..].fill([F::zero(); 4]);
                send(chunk, (band, piece), rows, sums);
                for (wide, sum) in wide.iter_mut().zip(&sums[short..]) {
                    (0..4).for_each(|lane| wide[lane] += sum[lane].wide());
                }
            }
        }
        sums[short..].iter_mut().zip(wide).for_each(|(sum, wide)| *sum = wide.map(F::of));
    }

    /// The same for few elements: tasks share the rows and each has sums of its own, in f64 from piece to piece.
    fn send_to_few(&self, rows: &[Padded<F>], x: &mut CpuVector<F>, walk: Walks<F, C>, send: Sends<F, C>) {
        let slots = self.bands.all_slots();
        let mut sums = vec![[0.0_f64; 3]; slots];
        let sum = |chunks: &[Chunk<F, C>]| {
            let (mut sums, mut run) = (vec![[0.0_f64; 3]; slots], vec![[F::zero(); 4]; slots]);
            for chunk in chunks {
                for piece in chunk.pieces() {
                    run.fill([F::zero(); 4]);
                    let bands = self.bands.split_slots(&mut run).into_iter().enumerate();
                    bands.for_each(|(band, run)| send(chunk, (band, piece.clone()), rows, run));
                    for (sum, run) in sums.iter_mut().zip(&run) {
                        (0..3).for_each(|c| sum[c] += run[c].wide());
                    }
                }
            }
            sums
        };
        let mut add = |chunks: &[Chunk<F, C>]| {
            let parts: Vec<Vec<[f64; 3]>> = chunks.par_chunks(ROWS_AT_ONCE / self.chunk).map(sum).collect();
            for part in &parts {
                sums.iter_mut().zip(part).for_each(|(sum, part)| (0..3).for_each(|c| sum[c] += part[c]));
            }
        };
        add(&self.chunks);
        for start in (self.first_walked..self.rows).step_by(self.rows_at_once) {
            add(&walk(start..(start + self.rows_at_once).min(self.rows)));
        }
        for (x, sums) in self.bands.split(&mut x.0).into_iter().zip(self.bands.split_slots(&mut sums)) {
            for (x, sums) in Bands::runs_mut(x).zip(Bands::runs_of_slots(sums)) {
                x.iter_mut().zip(sums).for_each(|(x, sum)| *x = sum.map(F::of));
            }
        }
    }

    fn room(&self) -> MutexGuard<'_, Room<F>> {
        let mut room = lock(&self.room);
        room.elements.resize(self.bands.all_slots(), [F::zero(); 4]);
        room.rows.resize(self.rows + WalkPlan::NEIGHBOURS[1], [F::zero(); 4]);
        room
    }
}

impl<T: Traversal<f64, C>, F: Real, const C: usize> MatrixRows<F, C> for Transport<T, F, C> {
    fn rows(&self) -> usize {
        self.traversal.rows()
    }

    fn visit(&self, row: usize, visit: &mut impl FnMut(usize, Weight<F, C>)) {
        let kept = &self.kept;
        let position = kept.order.position(row);
        if position >= kept.first_walked {
            let mut visit = |element: usize, weight: Weight<f64, C>| visit(element, weight.map(F::of));
            return self.traversal.walk_shared(row, &mut visit);
        }
        kept.visit(row, visit);
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
        let kept = &self.kept;
        let row = |k: usize| kept.order.row(kept.first_walked + k);
        kept.gather(x, y, |walked| self.traversal.gather_rows(&x.0, &row, walked, kept.walking));
        Ok(())
    }

    fn apply_adjoint(&self, y: &CpuVector<F>, x: &mut CpuVector<F>) -> Result<()> {
        expect_len("x", x, self.traversal.elements())?;
        expect_len("y", y, self.traversal.rows())?;
        let kept = &self.kept;
        let row = |k: usize| kept.order.row(kept.first_walked + k);
        let walked = match kept.rows - kept.first_walked {
            0 => None,
            rows => self.traversal.scatter_rows(rows, &|k| (row(k), y.0[row(k)]), kept.walking),
        };
        let Some(walked) = walked else {
            kept.send(y, x, &|rows| self.walk_chunks(rows, 1), Chunk::scatter);
            return Ok(());
        };
        if kept.chunks.is_empty() {
            x.0 = walked;
            return Ok(());
        }
        kept.send(y, x, &|_| Vec::new(), Chunk::scatter);
        x.0.par_iter_mut().zip(&walked).for_each(|(x, walked)| (0..3).for_each(|c| x[c] += walked[c]));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::picked::picked;
    use super::*;
    use crate::march::channel;
    use crate::operator::Picked;

    /// Rows of which `alike` in a row meet nearly the same elements, in an order that is not that of their numbers.
    #[derive(Debug, Clone, Copy)]
    struct Neighbours {
        rows: usize,
        alike: usize,
        /// By how much one weight is wrong.
        off: f64,
    }

    const ELEMENTS: usize = 70_000;

    impl Neighbours {
        fn weight(&self, row: usize, element: usize) -> [f64; 3] {
            let off =
                if (row, element) == (self.rows / 2, self.first(self.rows / 2)) { self.off } else { 0.0 };
            [1.0, 0.5, 0.25].map(|share| share * (1 + (row * 7 + element * 5) % 11) as f64 * (1.0 + off))
        }

        fn first(&self, row: usize) -> usize {
            let position = self.rows - 1 - row;
            position / self.alike * 5309 % (ELEMENTS - 64) + 2 * (position % self.alike % 3)
        }
    }

    impl<const C: usize> Traversal<f64, C> for Neighbours {
        fn rows(&self) -> usize {
            self.rows
        }

        fn elements(&self) -> usize {
            ELEMENTS
        }

        fn row_order(&self) -> Option<Vec<u32>> {
            Some((0..self.rows as u32).rev().collect())
        }

        fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f64, C>)) {
            for element in (0..30).map(|step| self.first(row) + 2 * step) {
                let weight = self.weight(row, element);
                visit(element, std::array::from_fn(|c| weight[c]));
            }
        }
    }

    fn values(len: usize) -> CpuVector<f32> {
        CpuVector((0..len).map(|i| [(i % 13) as f32, 1.0, (i * i % 7) as f32 - 3.0]).collect())
    }

    /// The largest differences of T x, Tᵀ y and diag(Tᵀ diag(y) T) from sums in f64, and how far the visited rows are off.
    fn errors<const C: usize>(of: &Neighbours, truth: &Neighbours, lanes: usize) -> [f64; 4] {
        let plan = WalkPlan::new::<C>(of);
        let kept = Transport::<_, f32, C>::new(*of, &plan, Strategy::Assembled, u64::MAX).unwrap();
        assert!(kept.kept.chunks.iter().all(|chunk| chunk.lanes == lanes));
        assert_eq!(kept.storage().kept_nonzeros, 30 * of.rows as u64);
        let (x, y) = (values(ELEMENTS), values(of.rows));
        let (mut forward, mut back) = (kept.range(), kept.domain());
        kept.apply(&x, &mut forward).unwrap();
        kept.apply_adjoint(&y, &mut back).unwrap();
        let squares = kept.squares(&y).unwrap();
        let mut sums = [vec![[0.0; 3]; of.rows], vec![[0.0; 3]; ELEMENTS], vec![[0.0; 3]; ELEMENTS]];
        let mut visited = 0.0_f64;
        for row in 0..of.rows {
            let mut weights = std::collections::BTreeMap::new();
            kept.visit(row, &mut |element, weight: Weight<f32, C>| {
                assert!(weights.insert(element, weight).is_none());
            });
            assert_eq!(weights.len(), 30);
            Traversal::<f64, 3>::walk(truth, row, &mut |element, weight| {
                let weight: [f64; 3] = std::array::from_fn(|c| channel(&weight, if C == 1 { 0 } else { c }));
                for c in 0..3 {
                    let [x, y] = [x.0[element][c], y.0[row][c]].map(f64::from);
                    sums[0][row][c] += weight[c] * x;
                    sums[1][element][c] += weight[c] * y;
                    sums[2][element][c] += weight[c] * weight[c] * y;
                    visited = visited.max((f64::from(channel(&weights[&element], c)) - weight[c]).abs());
                }
            });
        }
        let apart = |found: &[[f32; 3]], sums: &[[f64; 3]]| {
            let off = found.iter().flatten().zip(sums.iter().flatten());
            off.map(|(found, sum)| (f64::from(*found) - sum).abs()).fold(0.0, f64::max)
                / sums.iter().flatten().fold(1.0, |most: f64, sum| most.max(sum.abs()))
        };
        [apart(&forward.0, &sums[0]), apart(&back.0, &sums[1]), apart(&squares.0, &sums[2]), visited]
    }

    #[test]
    fn rows_in_blocks_are_the_rows() {
        for (alike, lanes) in [(1, 1), (4, 4), (24, 8)] {
            let rows = Neighbours { rows: 3000 + 5, alike, off: 0.0 };
            for errors in [errors::<1>(&rows, &rows, lanes), errors::<3>(&rows, &rows, lanes)] {
                assert!(errors.iter().all(|&error| error <= 2e-7), "{alike} alike: {errors:?}");
            }
            let off = Neighbours { off: 1e-3, ..rows };
            let noticed = errors::<1>(&off, &rows, lanes);
            assert!(noticed.iter().all(|&error| error > 2e-7), "{alike} alike: {noticed:?}");
        }
    }

    /// Of few rows, and of most: what is picked is what is kept, and rows that come along are told.
    #[test]
    fn picked_rows_are_those_that_are_kept() {
        for (alike, lanes) in [(1, 1), (4, 4), (24, 8)] {
            let rows = Neighbours { rows: 3000 + 5, alike, off: 0.0 };
            let all =
                Transport::<_, f32, 1>::new(rows, &WalkPlan::new::<1>(&rows), Strategy::Assembled, u64::MAX);
            let all = all.unwrap();
            for asked in [vec![0, 1, 7, 1800, 3004], (0..3005).filter(|row| row % 5 > 0).collect()] {
                let Picked { rows, operator } = picked(all.kept(), &asked).unwrap();
                assert!(asked.iter().all(|row| rows.contains(row)));
                assert!(rows.len() <= lanes * asked.len());
                assert_eq!(operator.storage().kept_nonzeros, 30 * rows.len() as u64);
                let x = values(ELEMENTS);
                let (mut shown, mut of_all) = (operator.range(), all.range());
                operator.apply(&x, &mut shown).unwrap();
                all.apply(&x, &mut of_all).unwrap();
                assert!(rows.iter().zip(&shown.0).all(|(&row, shown)| *shown == of_all.0[row]));
                let (few, mut y) = (values(rows.len()), all.range());
                rows.iter().zip(&few.0).for_each(|(&row, value)| y.0[row] = *value);
                let (mut sent, mut of_all) = (operator.domain(), all.domain());
                operator.apply_adjoint(&few, &mut sent).unwrap();
                all.apply_adjoint(&y, &mut of_all).unwrap();
                assert_eq!(sent, of_all);
                assert_eq!(operator.squares(&few).unwrap(), all.squares(&y).unwrap());
            }
        }
        let rows = Neighbours { rows: 640, alike: 4, off: 0.0 };
        let walked = Transport::<_, f32, 1>::new(rows, &WalkPlan::new::<1>(&rows), Strategy::MatrixFree, 0);
        assert!(picked(walked.unwrap().kept(), &[3]).is_none());
    }
}
