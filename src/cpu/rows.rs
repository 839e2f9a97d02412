use std::ops::Range;

use super::bands::Bands;
use crate::march::{Real, Traversal, Weight, channel};

/// Rows a chunk: enough that the offsets cost little, few enough that a chunk's residuals stay in cache.
pub(super) const CHUNK: usize = 64;

/// The non-zeros of some consecutive rows, band by band and in each band row by row.
#[derive(Debug)]
pub(super) struct Chunk<F, const C: usize> {
    rows: Range<usize>,
    /// Where (band, row) begins: index `band · rows + row`; one more at the end.
    offsets: Vec<u32>,
    /// Which element of its band.
    elements: Vec<u16>,
    weights: Vec<Weight<F, C>>,
}

/// What a row visits in one band without interruption.
struct Run {
    /// Index of (band, row) in [`Chunk::offsets`].
    index: usize,
    visited: Range<usize>,
}

impl<F: Real, const C: usize> Chunk<F, C> {
    /// Walks the rows and sorts what they visit by band.
    pub(super) fn walk(traversal: &impl Traversal<f64, C>, rows: Range<usize>, bands: &Bands) -> Self {
        let count = rows.len();
        let (mut elements, mut weights, mut runs) = (Vec::new(), Vec::new(), Vec::<Run>::new());
        for (local, row) in rows.clone().enumerate() {
            let mut band = 0..0;
            traversal.walk(row, &mut |element, weight| {
                if !band.contains(&element) {
                    let (number, range) = bands.of(element);
                    close(&mut runs, elements.len());
                    runs.push(Run { index: number * count + local, visited: elements.len()..usize::MAX });
                    band = range;
                }
                elements.push((element - band.start) as u16);
                weights.push(weight.map(F::of));
            });
            close(&mut runs, elements.len());
        }
        Self { rows, ..Self::sorted(&runs, &elements, &weights, bands.len() * count) }
    }

    /// Moves the runs to where their band and row belong; a ray meets a band once as a rule, so runs are long.
    fn sorted(runs: &[Run], visited: &[u16], visited_weights: &[Weight<F, C>], places: usize) -> Self {
        let mut offsets = vec![0u32; places + 1];
        for run in runs {
            offsets[run.index + 1] += run.visited.len() as u32;
        }
        for index in 1..offsets.len() {
            offsets[index] += offsets[index - 1];
        }
        let mut next = offsets.clone();
        let mut elements = vec![0; visited.len()];
        let mut weights = vec![[F::zero(); C]; visited.len()];
        for Run { index, visited: run } in runs {
            let start = next[*index] as usize;
            let place = start..start + run.len();
            elements[place.clone()].copy_from_slice(&visited[run.clone()]);
            weights[place].copy_from_slice(&visited_weights[run.clone()]);
            next[*index] += run.len() as u32;
        }
        Self { rows: 0..0, offsets, elements, weights }
    }

    pub(super) fn nonzeros(&self) -> usize {
        self.elements.len()
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.offsets[..]) + size_of_val(&self.elements[..]) + size_of_val(&self.weights[..])
    }

    /// y ← T x for these rows; `y` holds them alone.
    pub(super) fn gather(&self, bands: &Bands, x: &[Padded<F>], y: &mut [[F; 3]]) {
        let mut sums = [[0.0_f64; 3]; CHUNK];
        for band in 0..bands.len() {
            let x = &x[bands.range(band)];
            for (local, (elements, weights)) in self.stretches(band).enumerate() {
                let sum = dot(elements, weights, x);
                for c in 0..3 {
                    sums[local][c] += sum[c].wide();
                }
            }
        }
        y.iter_mut().zip(sums).for_each(|(y, sum)| *y = sum.map(F::of));
    }

    /// x ← x + Tᵀ y for one band: `x` holds its elements, `y` all rows.
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
        for ((elements, weights), &y) in self.stretches(band).zip(&y[self.rows.clone()]) {
            let y = padded(y);
            for (&element, &weight) in elements.iter().zip(weights) {
                add_product(&mut x[usize::from(element)], padded_weight(&weigh(weight)), y);
            }
        }
    }

    /// Visits the non-zeros of one row, band by band.
    pub(super) fn visit(&self, row: usize, bands: &Bands, visit: &mut impl FnMut(usize, Weight<F, C>)) {
        let (count, local) = (self.rows.len(), row - self.rows.start);
        for band in 0..bands.len() {
            let start = bands.range(band).start;
            let place = band * count + local;
            let stretch = self.offsets[place] as usize..self.offsets[place + 1] as usize;
            for (&element, &weight) in self.elements[stretch.clone()].iter().zip(&self.weights[stretch]) {
                visit(start + usize::from(element), weight);
            }
        }
    }

    /// The non-zeros of each row in a band.
    #[inline(always)]
    fn stretches(&self, band: usize) -> impl Iterator<Item = (&[u16], &[Weight<F, C>])> {
        let count = self.rows.len();
        self.offsets[band * count..=(band + 1) * count].windows(2).map(|pair| {
            let stretch = pair[0] as usize..pair[1] as usize;
            (&self.elements[stretch.clone()], &self.weights[stretch])
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

fn close(runs: &mut [Run], end: usize) {
    if let Some(run) = runs.last_mut().filter(|run| run.visited.end == usize::MAX) {
        run.visited.end = end;
    }
}
