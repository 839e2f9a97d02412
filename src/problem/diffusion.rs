//! Values spread from where they are known to where they are not: the heat equation at rest.

use std::sync::Arc;

use crate::march::Real;
use crate::operator::{CpuVector, Gradient, Lattices, LinearOperator, Neighbours, Restricted, Vector};
use crate::scene::Rgb;
use crate::solve::{Beginning, Cgls, Control, LeastSquares, Limits, Method, drive};
use crate::{Error, Result};

/// Places of a lattice, the first axis running fastest, and their colours.
#[derive(Debug, Clone, Copy)]
pub struct Known<'a> {
    /// Numbers of places, increasing.
    pub places: &'a [u32],
    /// The colour of each place, in any unit.
    pub colors: &'a [Rgb],
}

/// What has been spread, and how long it took.
#[derive(Debug, Clone)]
pub struct Diffused {
    /// The colour of each place that was empty, in their order.
    pub colors: Vec<Rgb>,
    /// Steps of conjugate gradients.
    pub iterations: usize,
}

/// The colours of the empty places of a lattice that make the sum of squared differences between neighbours least, with those of the
/// known places as they are. Places that are neither empty nor known do not take part. `F` is the precision of the solve.
///
/// Law     each empty place is the mean of its neighbours (the discrete Laplace equation), so no channel leaves the range that
///         the known ones span; held by tests/suite/volume/animation.rs
/// Caveat  empty places that no way over empty ones leads to a known one from are all alike: the mean of the known places
///         near them
/// Source  Klehm 2015, sec. 7.4.2 and 7.5.1, where it is a regularizer of the solve itself
/// Errors  [`Error::Empty`] when nothing is known; [`Error::Shape`] for another number of colours than places
/// Cost    a few vectors over the empty places and their edges, and 4 bytes a place of the lattice
pub fn diffuse<F: Real>(size: &[usize], known: &Known, empty: &[u32], limits: &Limits) -> Result<Diffused> {
    if known.places.len() != known.colors.len() {
        let (expected, got) = (known.places.len(), known.colors.len());
        return Err(Error::Shape { what: "known colours", expected, got });
    }
    if known.places.is_empty() {
        return Err(Error::Empty {
            reason: "there is no known value that could be spread".to_owned(),
            remedy: "let some view want something of the volume",
        });
    }
    if empty.is_empty() {
        return Ok(Diffused { colors: Vec::new(), iterations: 0 });
    }
    let rim = Rim::new(size, known, empty);
    let columns: Arc<[u32]> = rim.empty.into();
    let texels = CpuVector::<F>(rim.colors.iter().map(wide).collect());
    let gradient =
        Gradient::new(Arc::new(Neighbours::new(Lattices::new([size.to_vec()]), &rim.places)?), &texels)?;
    let start = CpuVector(nearest_mean(size, known, empty).iter().map(wide).collect());
    let (colors, iterations) = at_rest(&gradient, &texels, columns, &start, limits)?;
    let range = range(known.colors);
    let inside = |color: &[F; 3]| -> Rgb {
        std::array::from_fn(|c| (color[c].wide() as f32).clamp(range[0][c], range[1][c]))
    };
    Ok(Diffused { colors: colors.0.iter().map(inside).collect(), iterations })
}

/// The values `y` of some elements, the `columns`, that make ‖G x‖² least, x being `known` elsewhere and zero there; and the steps that took.
pub(super) fn at_rest<F: Real>(
    gradient: &impl LinearOperator<Domain = CpuVector<F>, Range = CpuVector<F>>,
    known: &CpuVector<F>,
    columns: Arc<[u32]>,
    start: &CpuVector<F>,
    limits: &Limits,
) -> Result<(CpuVector<F>, usize)> {
    // min ‖G (E y + x)‖² over y.
    let mut rhs = gradient.range();
    gradient.apply(known, &mut rhs)?;
    rhs.scale([-1.0; 3]);
    let operator = Restricted::new(gradient, columns)?;
    let mut method = Cgls::new(&operator);
    let least_squares = LeastSquares::new(&operator, &rhs);
    let outcome =
        drive(&mut method, &least_squares, Beginning::At(start), limits, |_, _| Ok(Control::Continue))?;
    let mut found = start.zeros_like();
    found.copy_from(method.solution());
    Ok((found, outcome.stop.iteration))
}

fn wide<F: Real>(color: &Rgb) -> [F; 3] {
    color.map(|value| F::of(f64::from(value)))
}

/// Least and largest value of each channel.
fn range(colors: &[Rgb]) -> [Rgb; 2] {
    colors.iter().fold([[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]], |[low, high], color| {
        [std::array::from_fn(|c| low[c].min(color[c])), std::array::from_fn(|c| high[c].max(color[c]))]
    })
}

/// The empty places and the known ones beside them; others have no say.
struct Rim {
    places: Vec<u32>,
    /// Zero where a place is empty.
    colors: Vec<Rgb>,
    /// Which of the places are empty.
    empty: Vec<u32>,
}

impl Rim {
    fn new(size: &[usize], known: &Known, empty: &[u32]) -> Self {
        let mut is_empty = vec![false; size.iter().product()];
        empty.iter().for_each(|&place| is_empty[place as usize] = true);
        let is_beside = |&(&place, _): &(&u32, &Rgb)| {
            let (place, mut stride) = (place as usize, 1);
            size.iter().any(|&side| {
                let along = place / stride % side;
                let touches =
                    along > 0 && is_empty[place - stride] || along + 1 < side && is_empty[place + stride];
                stride *= side;
                touches
            })
        };
        let beside = known.places.iter().zip(known.colors).filter(is_beside);
        let mut all: Vec<(u32, Option<Rgb>)> = beside.map(|(&place, &color)| (place, Some(color))).collect();
        all.extend(empty.iter().map(|&place| (place, None)));
        all.sort_unstable_by_key(|&(place, _)| place);
        let is_unknown = |(index, (_, color)): (u32, &(u32, Option<Rgb>))| color.is_none().then_some(index);
        Self {
            empty: (0..).zip(&all).filter_map(is_unknown).collect(),
            colors: all.iter().map(|(_, color)| color.unwrap_or_default()).collect(),
            places: all.into_iter().map(|(place, _)| place).collect(),
        }
    }
}

/// For every empty place the mean of the known places near it: those in the smallest block around it that has any. The diffusion begins
/// there, so that it need not travel far; where it does not arrive, that is kept.
pub(super) fn nearest_mean(size: &[usize], known: &Known, empty: &[u32]) -> Vec<Rgb> {
    let mut levels: Vec<BlockSums> = Vec::new();
    let mut first = BlockSums::above(size);
    for (&place, &[r, g, b]) in known.places.iter().zip(known.colors) {
        first.add(size, place as usize, [r, g, b, 1.0]);
    }
    levels.push(first);
    while let Some(level) = levels.last().filter(|level| level.sums.len() > 1) {
        let mut above = BlockSums::above(&level.size);
        level.sums.iter().enumerate().for_each(|(place, &sum)| above.add(&level.size, place, sum));
        levels.push(above);
    }
    let mean = |&place: &u32| {
        let (mut below, mut place) = (size, place as usize);
        for level in &levels {
            place = level.parent(below, place);
            let [r, g, b, count] = level.sums[place];
            if count > 0.0 {
                return [r / count, g / count, b / count];
            }
            below = &level.size;
        }
        [0.0; 3]
    };
    empty.iter().map(mean).collect()
}

/// The sum and the number of the known colours in each block of a lattice.
struct BlockSums {
    size: Vec<usize>,
    sums: Vec<[f32; 4]>,
}

impl BlockSums {
    /// Blocks of two places along each axis.
    fn above(size: &[usize]) -> Self {
        let size: Vec<usize> = size.iter().map(|side| side.div_ceil(2)).collect();
        Self { sums: vec![[0.0; 4]; size.iter().product()], size }
    }

    /// The block that a place of the lattice below lies in.
    fn parent(&self, below: &[usize], place: usize) -> usize {
        let (mut rest, mut parent, mut stride) = (place, 0, 1);
        for (side, mine) in below.iter().zip(&self.size) {
            parent += rest % side / 2 * stride;
            rest /= side;
            stride *= mine;
        }
        parent
    }

    fn add(&mut self, below: &[usize], place: usize, sum: [f32; 4]) {
        let parent = self.parent(below, place);
        (0..4).for_each(|k| self.sums[parent][k] += sum[k]);
    }
}
