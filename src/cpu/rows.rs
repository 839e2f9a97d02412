use std::ops::Range;

use super::bands::Bands;
use crate::march::{Real, Traversal, Weight};
use crate::operator::{RowOrder, WalkPlan};

/// Rows whose sums are in single precision, at most, where columns are long: f32 has room for no more.
pub(super) const PIECE: usize = 64;
/// The most rows of a chunk: what they have in a band should be long enough that memory streams.
const LONGEST: usize = 1024;
/// Chunks that the rows should make at least, so that threads can share them.
pub(super) const CHUNKS: usize = 64;
/// What one access to an element costs, in bytes of the rows that could be read meanwhile.
const ACCESS: usize = 9;

/// How rows are kept together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Packing {
    /// Rows a chunk, a multiple of [`PIECE`].
    pub(super) chunk: usize,
    /// Rows a block: 1, 4 or 8.
    pub(super) lanes: usize,
    /// Non-zeros for each element of a block.
    shared: f64,
}

impl Packing {
    /// The quickest one for the rows of a plan, `channels` weights of an `F` each.
    pub(super) fn quickest<F>(plan: &WalkPlan, channels: usize) -> Self {
        let single = Self::single(plan);
        let blocks = WalkPlan::NEIGHBOURS.into_iter().zip(plan.shared);
        let blocks = blocks.map(|(lanes, shared)| Self { lanes, shared, ..single });
        let cost = |packing: &Self| (packing.entry_bytes::<F>(channels) + ACCESS) as f64 / packing.shared;
        blocks.fold(single, |best, other| if cost(&other) < cost(&best) { other } else { best })
    }

    /// Rows one by one.
    pub(super) fn single(plan: &WalkPlan) -> Self {
        let chunk = (plan.rows / CHUNKS).clamp(PIECE, LONGEST) / PIECE * PIECE;
        Self { chunk, lanes: 1, shared: 1.0 }
    }

    /// Bytes that keeping all rows of a plan takes, foreseen.
    pub(super) fn bytes<F>(&self, plan: &WalkPlan, bands: &Bands, channels: usize) -> u64 {
        let entries = plan.nonzeros as f64 / self.shared;
        let blocks = plan.rows.div_ceil(self.lanes) as f64;
        // A block has a run in every band at most, and none without an element.
        let runs = blocks * (entries / blocks.max(1.0)).min(bands.len() as f64);
        let starts = plan.rows.div_ceil(self.chunk) * (bands.len() + 1) * size_of::<u32>();
        let bytes = entries * self.entry_bytes::<F>(channels) as f64 + runs * size_of::<Run>() as f64;
        bytes as u64 + (starts + plan.order.bytes()) as u64
    }

    fn entry_bytes<F>(&self, channels: usize) -> usize {
        size_of::<u16>() + self.lanes * channels * size_of::<F>()
    }
}

/// The non-zeros of some consecutive rows in blocks of neighbours, band by band and in each band block by block.
///
/// A block has an entry for each element that any of its rows meets: which element, and the weights of all its rows. Rays through
/// neighbouring pixels meet nearly the same elements, so there is one access to an element for many non-zeros. Only what a block has in
/// a band is there at all: a ray through a volume meets one band or two of many.
#[derive(Debug)]
pub(super) struct Chunk<F, const C: usize> {
    /// Positions of its rows.
    pub(super) rows: Range<usize>,
    /// Rows a block: 1, 4 or 8.
    pub(super) lanes: usize,
    /// Where the runs of each band begin; one more at the end.
    bands: Vec<u32>,
    runs: Vec<Run>,
    /// Which element of its band.
    pub(super) elements: Vec<u16>,
    /// For each of them, channel by channel, the weights of the rows of the block; zero where a row does not meet it.
    pub(super) weights: Vec<F>,
    nonzeros: usize,
}

/// What a block has in one band.
#[derive(Debug, Clone, Copy)]
struct Run {
    /// The block, from the first of the chunk on.
    block: u32,
    /// Where its entries end; they begin where those of the run before do.
    end: u32,
}

/// A block and its entries in one band.
pub(super) struct Stretch {
    pub(super) block: usize,
    pub(super) entries: Range<usize>,
}

impl<F: Real, const C: usize> Chunk<F, C> {
    /// Walks the rows at some positions, and packs what they meet.
    pub(super) fn walk(
        traversal: &impl Traversal<f64, C>,
        (order, rows): (&RowOrder, Range<usize>),
        lanes: usize,
        bands: &Bands,
    ) -> Self {
        let mut visited = Visited::default();
        let mut parts: Vec<Part<F>> = (0..bands.len()).map(|_| Part::default()).collect();
        let mut places = Places::new(lanes);
        let mut nonzeros = 0;
        for (block, first) in rows.clone().step_by(lanes).enumerate() {
            visited.walk(traversal, order, first..(first + lanes).min(rows.end), bands);
            nonzeros += visited.elements.len();
            for same in visited.visits.chunk_by(|a, b| a.band == b.band) {
                parts[same[0].band as usize].add(block, (&visited, same), &mut places);
            }
        }
        let mut chunk = Self {
            rows,
            lanes,
            bands: Vec::with_capacity(parts.len() + 1),
            runs: Vec::with_capacity(parts.iter().map(|part| part.runs.len()).sum()),
            elements: Vec::with_capacity(parts.iter().map(|part| part.elements.len()).sum()),
            weights: Vec::with_capacity(parts.iter().map(|part| part.weights.len()).sum()),
            nonzeros,
        };
        for part in parts {
            chunk.bands.push(chunk.runs.len() as u32);
            let before = chunk.elements.len() as u32;
            chunk.runs.extend(part.runs.iter().map(|run| Run { end: before + run.end, ..*run }));
            chunk.elements.extend_from_slice(&part.elements);
            chunk.weights.extend_from_slice(&part.weights);
        }
        chunk.bands.push(chunk.runs.len() as u32);
        chunk
    }

    /// Some blocks of other chunks, in the order of those, for rows at other positions.
    pub(super) fn of_blocks(
        blocks: &[(&Self, usize)],
        (rows, lanes): (Range<usize>, usize),
        bands: usize,
    ) -> Self {
        let mut chunk = Self {
            rows,
            lanes,
            bands: Vec::with_capacity(bands + 1),
            runs: Vec::new(),
            elements: Vec::new(),
            weights: Vec::new(),
            nonzeros: 0,
        };
        for band in 0..bands {
            chunk.bands.push(chunk.runs.len() as u32);
            for (number, &(from, block)) in blocks.iter().enumerate() {
                for Stretch { entries, .. } in from.stretches(band, block..block + 1) {
                    let all = entries.start * C * lanes..entries.end * C * lanes;
                    chunk.elements.extend_from_slice(&from.elements[entries]);
                    chunk.weights.extend_from_slice(&from.weights[all]);
                    chunk.runs.push(Run { block: number as u32, end: chunk.elements.len() as u32 });
                }
            }
        }
        chunk.bands.push(chunk.runs.len() as u32);
        let met = |entry: &[F]| {
            let is_met = |lane: &usize| (0..C).any(|c| entry[c * lanes + lane] != F::zero());
            (0..lanes).filter(is_met).count()
        };
        chunk.nonzeros = chunk.weights.chunks_exact(C * lanes).map(met).sum();
        chunk
    }

    pub(super) fn nonzeros(&self) -> usize {
        self.nonzeros
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.bands[..])
            + size_of_val(&self.runs[..])
            + size_of_val(&self.elements[..])
            + size_of_val(&self.weights[..])
    }

    /// Visits the non-zeros of the row at a position, band by band.
    pub(super) fn visit(&self, position: usize, bands: &Bands, visit: &mut impl FnMut(usize, Weight<F, C>)) {
        let (block, lane) =
            ((position - self.rows.start) / self.lanes, (position - self.rows.start) % self.lanes);
        for band in 0..bands.len() {
            let start = bands.range(band).start;
            for Stretch { entries, .. } in self.stretches(band, block..block + 1) {
                for entry in entries {
                    let weight: Weight<F, C> =
                        std::array::from_fn(|c| self.weights[(entry * C + c) * self.lanes + lane]);
                    if weight.iter().any(|&weight| weight != F::zero()) {
                        visit(start + usize::from(self.elements[entry]), weight);
                    }
                }
            }
        }
    }

    /// Its blocks, cut into pieces of [`PIECE`] rows.
    pub(super) fn pieces(&self) -> impl Iterator<Item = Range<usize>> {
        let blocks = self.blocks();
        let piece = PIECE / self.lanes;
        (0..blocks.end).step_by(piece).map(move |first| first..(first + piece).min(blocks.end))
    }

    /// All its blocks.
    pub(super) fn blocks(&self) -> Range<usize> {
        0..self.rows.len().div_ceil(self.lanes)
    }

    /// What those of some blocks have in a band that have anything there, in order.
    #[inline(always)]
    pub(super) fn stretches(&self, band: usize, blocks: Range<usize>) -> impl Iterator<Item = Stretch> {
        let all = self.bands[band] as usize..self.bands[band + 1] as usize;
        let before = |block: usize| {
            all.start + self.runs[all.clone()].partition_point(|run| (run.block as usize) < block)
        };
        let runs = match blocks == self.blocks() {
            true => all.clone(),
            false => before(blocks.start)..before(blocks.end),
        };
        let mut start = if runs.start == 0 { 0 } else { self.runs[runs.start - 1].end as usize };
        self.runs[runs].iter().map(move |run| {
            let entries = start..run.end as usize;
            start = entries.end;
            Stretch { block: run.block as usize, entries }
        })
    }
}

/// What the rows of one block have met.
struct Visited<F, const C: usize> {
    /// In order of their bands.
    visits: Vec<Visit>,
    elements: Vec<u16>,
    weights: Vec<Weight<F, C>>,
}

/// What a row visits in one band without interruption.
struct Visit {
    band: u32,
    lane: u32,
    visited: Range<usize>,
}

impl<F, const C: usize> Default for Visited<F, C> {
    fn default() -> Self {
        Self { visits: Vec::new(), elements: Vec::new(), weights: Vec::new() }
    }
}

impl<F: Real, const C: usize> Visited<F, C> {
    fn walk(
        &mut self,
        traversal: &impl Traversal<f64, C>,
        order: &RowOrder,
        positions: Range<usize>,
        bands: &Bands,
    ) {
        let Self { visits, elements, weights } = self;
        visits.clear();
        elements.clear();
        weights.clear();
        for (position, lane) in positions.zip(0..) {
            let mut band = 0..0;
            traversal.walk(order.row(position), &mut |element, weight| {
                if !band.contains(&element) {
                    let (number, range) = bands.of(element);
                    close(visits, elements.len());
                    let visited = elements.len()..usize::MAX;
                    visits.push(Visit { band: number as u32, lane, visited });
                    band = range;
                }
                elements.push((element - band.start) as u16);
                weights.push(weight.map(F::of));
            });
            close(visits, elements.len());
        }
        // Stable, so that what a row visits in a band stays in the order of its ray.
        visits.sort_by_key(|visit| visit.band);
    }
}

fn close(visits: &mut [Visit], end: usize) {
    if let Some(visit) = visits.last_mut().filter(|visit| visit.visited.end == usize::MAX) {
        visit.visited.end = end;
    }
}

/// Where the elements of a band stand among the entries of a block.
struct Places {
    lanes: usize,
    /// None are needed where a block is a row, which meets an element once.
    of: Vec<u32>,
}

impl Places {
    const NOWHERE: u32 = u32::MAX;

    fn new(lanes: usize) -> Self {
        Self { lanes, of: if lanes == 1 { Vec::new() } else { vec![Self::NOWHERE; Bands::LONGEST] } }
    }
}

/// What the blocks of a chunk have in one band.
struct Part<F> {
    runs: Vec<Run>,
    elements: Vec<u16>,
    weights: Vec<F>,
}

impl<F> Default for Part<F> {
    fn default() -> Self {
        Self { runs: Vec::new(), elements: Vec::new(), weights: Vec::new() }
    }
}

impl<F: Real> Part<F> {
    /// Adds what a block visits in this band.
    fn add<const C: usize>(
        &mut self,
        block: usize,
        (all, visits): (&Visited<F, C>, &[Visit]),
        places: &mut Places,
    ) {
        let first = self.elements.len();
        for Visit { lane, visited, .. } in visits {
            let (elements, weights) = (&all.elements[visited.clone()], &all.weights[visited.clone()]);
            if places.lanes == 1 {
                self.elements.extend_from_slice(elements);
                self.weights.extend_from_slice(weights.as_flattened());
            } else {
                self.add_lane(*lane as usize, (elements, weights), places);
            }
        }
        if places.lanes > 1 {
            for &element in &self.elements[first..] {
                places.of[usize::from(element)] = Places::NOWHERE;
            }
        }
        self.runs.push(Run { block: block as u32, end: self.elements.len() as u32 });
    }

    fn add_lane<const C: usize>(
        &mut self,
        lane: usize,
        (elements, weights): (&[u16], &[Weight<F, C>]),
        places: &mut Places,
    ) {
        let lanes = places.lanes;
        for (&element, weight) in elements.iter().zip(weights) {
            let place = &mut places.of[usize::from(element)];
            if *place == Places::NOWHERE {
                *place = self.elements.len() as u32;
                self.elements.push(element);
                self.weights.resize(self.weights.len() + C * lanes, F::zero());
            }
            let first = *place as usize * C * lanes + lane;
            for c in 0..C {
                self.weights[first + c * lanes] += weight[c];
            }
        }
    }
}
