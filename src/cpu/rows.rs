use std::ops::Range;

use super::bands::Bands;
use crate::march::{Real, Traversal, Weight, channel};

/// Rows a chunk: enough that the offsets cost little, few enough that a chunk's residuals stay in cache.
pub(super) const CHUNK: usize = 64;

/// The non-zeros of some consecutive rows, band by band and in each band row by row.
///
/// Only what a row has in a band is there at all: a ray through a volume meets one band or two of many.
#[derive(Debug)]
pub(super) struct Chunk<F, const C: usize> {
    rows: Range<usize>,
    /// Where the runs of each band begin; one more at the end.
    bands: Vec<u32>,
    runs: Vec<Run>,
    /// Which slot of its band.
    elements: Vec<u16>,
    weights: Vec<Weight<F, C>>,
}

/// What a row has in one band.
#[derive(Debug, Clone, Copy)]
struct Run {
    /// The row, from the first of the chunk on.
    row: u32,
    /// Where its non-zeros end; they begin where those of the run before do.
    end: u32,
}

/// What a row visits in one band without interruption.
struct Visit {
    band: u32,
    row: u32,
    visited: Range<usize>,
}

impl<F: Real, const C: usize> Chunk<F, C> {
    /// Walks the rows and sorts what they visit by band.
    pub(super) fn walk(traversal: &impl Traversal<f64, C>, rows: Range<usize>, bands: &Bands) -> Self {
        let (mut elements, mut weights, mut visits) = (Vec::new(), Vec::new(), Vec::<Visit>::new());
        for (row, local) in rows.clone().zip(0..) {
            let mut band = 0..0;
            traversal.walk(row, &mut |element, weight| {
                if !band.contains(&element) {
                    let (number, range) = bands.of(element);
                    close(&mut visits, elements.len());
                    let visited = elements.len()..usize::MAX;
                    visits.push(Visit { band: number as u32, row: local, visited });
                    band = range;
                }
                elements.push(Bands::slot(element - band.start) as u16);
                weights.push(weight.map(F::of));
            });
            close(&mut visits, elements.len());
        }
        // Stable, so that what a row visits in a band stays in the order of its ray.
        visits.sort_by_key(|visit| (visit.band, visit.row));
        Self { rows, ..Self::sorted(&visits, &elements, &weights, bands.len()) }
    }

    /// Moves what was visited to where its band and row belong; a ray meets a band once as a rule, so it is long.
    fn sorted(visits: &[Visit], visited: &[u16], visited_weights: &[Weight<F, C>], bands: usize) -> Self {
        let mut elements = Vec::with_capacity(visited.len());
        let mut weights = Vec::with_capacity(visited.len());
        let mut runs: Vec<Run> = Vec::with_capacity(visits.len());
        let mut starts = Vec::with_capacity(bands + 1);
        for same in visits.chunk_by(|a, b| (a.band, a.row) == (b.band, b.row)) {
            while starts.len() <= same[0].band as usize {
                starts.push(runs.len() as u32);
            }
            for visit in same {
                elements.extend_from_slice(&visited[visit.visited.clone()]);
                weights.extend_from_slice(&visited_weights[visit.visited.clone()]);
            }
            runs.push(Run { row: same[0].row, end: elements.len() as u32 });
        }
        starts.resize(bands + 1, runs.len() as u32);
        runs.shrink_to_fit();
        Self { rows: 0..0, bands: starts, runs, elements, weights }
    }

    pub(super) fn nonzeros(&self) -> usize {
        self.elements.len()
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.bands[..])
            + size_of_val(&self.runs[..])
            + size_of_val(&self.elements[..])
            + size_of_val(&self.weights[..])
    }

    /// y ← T x for these rows; `y` holds them alone, `x` all slots.
    pub(super) fn gather(&self, bands: &Bands, x: &[Padded<F>], y: &mut [[F; 3]]) {
        let mut sums = [[0.0_f64; 3]; CHUNK];
        for band in 0..bands.len() {
            let x = &x[bands.slots(band)];
            for (row, elements, weights) in self.stretches(band) {
                let sum = dot(elements, weights, x);
                for c in 0..3 {
                    sums[row][c] += sum[c].wide();
                }
            }
        }
        y.iter_mut().zip(sums).for_each(|(y, sum)| *y = sum.map(F::of));
    }

    /// x ← x + Tᵀ y for one band: `x` holds its slots, `y` all rows.
    pub(super) fn scatter(&self, band: usize, y: &[[F; 3]], x: &mut [Padded<F>]) {
        self.send(band, y, x, |weight| weight);
    }

    /// x ← x + diag(Tᵀ diag(y) T) for one band.
    pub(super) fn squares(&self, band: usize, y: &[[F; 3]], x: &mut [Padded<F>]) {
        self.send(band, y, x, |weight| weight.map(|value| value * value));
    }

    #[inline(always)]
    fn send(
        &self,
        band: usize,
        y: &[[F; 3]],
        x: &mut [Padded<F>],
        weigh: impl Fn(Weight<F, C>) -> Weight<F, C>,
    ) {
        let y = &y[self.rows.clone()];
        for (row, elements, weights) in self.stretches(band) {
            let y = padded(y[row]);
            for (&element, &weight) in elements.iter().zip(weights) {
                add_product(&mut x[usize::from(element)], padded_weight(&weigh(weight)), y);
            }
        }
    }

    /// Visits the non-zeros of one row, band by band.
    pub(super) fn visit(&self, row: usize, bands: &Bands, visit: &mut impl FnMut(usize, Weight<F, C>)) {
        for band in 0..bands.len() {
            let start = bands.range(band).start;
            for (_, elements, weights) in
                self.stretches(band).filter(|(local, ..)| self.rows.start + local == row)
            {
                for (&element, &weight) in elements.iter().zip(weights) {
                    visit(start + Bands::element(usize::from(element)), weight);
                }
            }
        }
    }

    /// The non-zeros of each row that has any in a band.
    #[inline(always)]
    fn stretches(&self, band: usize) -> impl Iterator<Item = (usize, &[u16], &[Weight<F, C>])> {
        let runs = self.bands[band] as usize..self.bands[band + 1] as usize;
        let mut start = if runs.start == 0 { 0 } else { self.runs[runs.start - 1].end as usize };
        self.runs[runs].iter().map(move |run| {
            let stretch = start..run.end as usize;
            start = stretch.end;
            (run.row as usize, &self.elements[stretch.clone()], &self.weights[stretch])
        })
    }
}

/// Three channels and a fourth number that nobody reads: one processor register.
pub(super) type Padded<F> = [F; 4];

#[inline(always)]
pub(super) fn padded<F: Real>([r, g, b]: [F; 3]) -> Padded<F> {
    [r, g, b, F::zero()]
}

#[inline(always)]
fn padded_weight<F: Real, const C: usize>(weight: &Weight<F, C>) -> Padded<F> {
    [channel(weight, 0), channel(weight, 1), channel(weight, 2), channel(weight, 0)]
}

/// Σ w x over some elements, in four sums side by side so that no addition waits for the one before.
#[inline(always)]
fn dot<F: Real, const C: usize>(elements: &[u16], weights: &[Weight<F, C>], x: &[Padded<F>]) -> Padded<F> {
    let (fours, rest) = elements.as_chunks::<4>();
    let (weights_of_fours, weights_of_rest) = weights.as_chunks::<4>();
    let mut sums = [[F::zero(); 4]; 4];
    for (elements, weights) in fours.iter().zip(weights_of_fours) {
        for k in 0..4 {
            add_product(&mut sums[k], padded_weight(&weights[k]), x[usize::from(elements[k])]);
        }
    }
    for (&element, weight) in rest.iter().zip(weights_of_rest) {
        add_product(&mut sums[0], padded_weight(weight), x[usize::from(element)]);
    }
    std::array::from_fn(|c| (sums[0][c] + sums[1][c]) + (sums[2][c] + sums[3][c]))
}

#[inline(always)]
fn add_product<F: Real>(sum: &mut Padded<F>, a: Padded<F>, b: Padded<F>) {
    for lane in 0..4 {
        sum[lane] += a[lane] * b[lane];
    }
}

fn close(visits: &mut [Visit], end: usize) {
    if let Some(visit) = visits.last_mut().filter(|visit| visit.visited.end == usize::MAX) {
        visit.visited.end = end;
    }
}
