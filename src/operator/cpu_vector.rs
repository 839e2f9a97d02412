use std::ops::Range;
use std::sync::Arc;

use crate::march::Real;
use crate::{Error, Result};

use super::parallel::on_pieces;
use super::{Bounds, Indexed, NOWHERE, Scalars, Vector};

/// Elements a task: sums are taken a piece at a time, so their order does not depend on the threads.
const PIECE: usize = 8192;
/// Numbers that are worked on side by side: four elements, so that channels keep their place.
const LANES: usize = 12;

/// Three channels an element, in the memory of the host.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CpuVector<F = f32>(pub Vec<[F; 3]>);

impl<F: Real> CpuVector<F> {
    /// `len` elements of zero.
    pub fn zeros(len: usize) -> Self {
        Self(vec![[F::zero(); 3]; len])
    }

    /// From values in f64, rounded to the nearest.
    pub fn of(values: &[[f64; 3]]) -> Self {
        Self(values.iter().map(|value| value.map(F::of)).collect())
    }

    fn update<const N: usize>(
        &mut self,
        other: &Self,
        constants: [Scalars; N],
        change: impl Fn(&mut F, F, [F; N]) + Sync,
    ) {
        update(&mut self.0, [&other.0], constants, |mine, [other], constants| change(mine, other, constants));
    }

    fn each(&mut self, constants: Scalars, change: impl Fn(F, F) -> F + Sync) {
        each(&mut self.0, constants, change);
    }

    /// [`update`] with the bounds of each element for constants.
    fn update_within(&mut self, x: &Self, bounds: &Bounds, change: impl Fn(&mut F, F, [F; 2]) + Sync) {
        for (part, bounds) in bounds.parts(self.0.len()) {
            let x = [&x.0[part.clone()]];
            update(&mut self.0[part], x, bounds, |mine, [x], bounds| change(mine, x, bounds));
        }
    }
}

/// Changes every number by its partners in `theirs` and the constants of its channel.
fn update<F: Real, const M: usize, const N: usize>(
    mine: &mut [[F; 3]],
    theirs: [&[[F; 3]]; M],
    constants: [Scalars; N],
    change: impl Fn(&mut F, [F; M], [F; N]) + Sync,
) {
    debug_assert!(theirs.iter().all(|theirs| theirs.len() == mine.len()));
    let constants: [[F; N]; LANES] = std::array::from_fn(|lane| constants.map(|c| F::of(c[lane % 3])));
    on_pieces(mine, PIECE, &|first, mine| {
        let theirs =
            theirs.map(|theirs| theirs[first..first + mine.len()].as_flattened().as_chunks::<LANES>());
        let (mine, my_rest) = mine.as_flattened_mut().as_chunks_mut::<LANES>();
        for (chunk, mine) in mine.iter_mut().enumerate() {
            let theirs = theirs.map(|(chunks, _)| &chunks[chunk]);
            for lane in 0..LANES {
                change(&mut mine[lane], theirs.map(|theirs| theirs[lane]), constants[lane]);
            }
        }
        for (lane, mine) in my_rest.iter_mut().enumerate() {
            change(mine, theirs.map(|(_, rest)| rest[lane]), constants[lane]);
        }
    });
}

/// Changes every number by the constant of its channel.
fn each<F: Real>(mine: &mut [[F; 3]], constants: Scalars, change: impl Fn(F, F) -> F + Sync) {
    let constants = constants.map(F::of);
    on_pieces(mine, PIECE, &|_, piece| {
        piece.iter_mut().for_each(|element| {
            *element = std::array::from_fn(|c| change(element[c], constants[c]));
        });
    });
}

/// Whether channel c of an element x is at a bound and going down the gradient would leave the box.
fn holds<F: Real>(bounds: [Scalars; 2]) -> impl Fn(usize, F, F) -> bool + Sync {
    let [lower, upper] = bounds.map(|bounds| bounds.map(F::of));
    move |c, x, gradient| (x <= lower[c] && gradient > F::zero()) || (x >= upper[c] && gradient < F::zero())
}

fn add(a: Scalars, b: Scalars) -> Scalars {
    std::array::from_fn(|c| a[c] + b[c])
}

/// Halves a range until it is a piece, and puts the pieces together pair by pair: the same order for any number of
/// threads, and no memory taken.
fn reduce(
    range: Range<usize>,
    together: fn(Scalars, Scalars) -> Scalars,
    piece: &(dyn Fn(Range<usize>) -> Scalars + Sync),
) -> Scalars {
    if range.len() <= PIECE {
        return piece(range);
    }
    let middle = range.start + (range.len() / PIECE).div_ceil(2) * PIECE;
    let halves = rayon::join(
        || reduce(range.start..middle, together, piece),
        || reduce(middle..range.end, together, piece),
    );
    together(halves.0, halves.1)
}

/// ⟨a, b⟩ of one piece.
fn dot<F: Real>(a: &[[F; 3]], b: &[[F; 3]]) -> Scalars {
    let (a, a_rest) = a.as_flattened().as_chunks::<LANES>();
    let (b, b_rest) = b.as_flattened().as_chunks::<LANES>();
    let mut lanes = [0.0; LANES];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..LANES {
            lanes[lane] += a[lane].wide() * b[lane].wide();
        }
    }
    for (lane, (a, b)) in a_rest.iter().zip(b_rest).enumerate() {
        lanes[lane] += a.wide() * b.wide();
    }
    std::array::from_fn(|c| (0..LANES / 3).map(|k| lanes[3 * k + c]).sum::<f64>())
}

impl<F: Real> Vector for CpuVector<F> {
    type Sum = Scalars;

    fn len(&self) -> usize {
        self.0.len()
    }

    fn zeros_like(&self) -> Self {
        Self::zeros(self.0.len())
    }

    fn fill(&mut self, value: Scalars) {
        self.each(value, |_, value| value);
    }

    fn copy_from(&mut self, other: &Self) {
        self.0.copy_from_slice(&other.0);
    }

    fn axpby(&mut self, alpha: Scalars, x: &Self, beta: Scalars) {
        if beta == [0.0; 3] {
            self.update(x, [alpha], |mine, x, [alpha]| *mine = alpha * x);
        } else if beta == [1.0; 3] {
            self.update(x, [alpha], |mine, x, [alpha]| *mine += alpha * x);
        } else {
            self.update(x, [alpha, beta], |mine, x, [alpha, beta]| {
                let kept = if beta == F::zero() { F::zero() } else { beta * *mine };
                *mine = alpha * x + kept;
            });
        }
    }

    fn scale(&mut self, factor: Scalars) {
        self.each(factor, |mine, factor| mine * factor);
    }

    fn multiply(&mut self, x: &Self) {
        self.update(x, [], |mine, x, []| *mine = *mine * x);
    }

    fn invert(&mut self) {
        self.each([0.0; 3], |mine, zero| if mine == zero { zero } else { mine.recip() });
    }

    fn extrapolate(&mut self, x: &Self, factor: Scalars) {
        self.update(x, [factor], |mine, x, [factor]| *mine = x + factor * (x - *mine));
    }

    fn step_within(&mut self, factor: Scalars, x: &Self, y: &Self, bounds: &Bounds) {
        for (part, [lower, upper]) in bounds.parts(self.0.len()) {
            let partners = [&x.0[part.clone()], &y.0[part.clone()]];
            let constants = [factor, lower, upper];
            update(&mut self.0[part], partners, constants, |mine, [x, y], [factor, lower, upper]| {
                *mine = (y + factor * (*mine * x)).max(lower).min(upper);
            });
        }
    }

    fn clamp(&mut self, bounds: &Bounds) {
        for (part, [lower, upper]) in bounds.parts(self.0.len()) {
            each(&mut self.0[part.clone()], lower, F::max);
            if upper != [f64::INFINITY; 3] {
                each(&mut self.0[part], upper, F::min);
            }
        }
    }

    fn hold(&mut self, x: &Self, gradient: &Self, bounds: &Bounds) {
        for (part, bounds) in bounds.parts(self.0.len()) {
            let held = holds::<F>(bounds);
            let (x, gradient) = (&x.0[part.clone()], &gradient.0[part.clone()]);
            on_pieces(&mut self.0[part], PIECE, &|first, mine| {
                let partners = x[first..].iter().zip(&gradient[first..]);
                for (mine, (x, gradient)) in mine.iter_mut().zip(partners) {
                    for c in 0..3 {
                        if held(c, x[c], gradient[c]) {
                            mine[c] = F::zero();
                        }
                    }
                }
            });
        }
    }

    fn hold_at_bounds(&mut self, x: &Self, bounds: &Bounds) {
        self.update_within(x, bounds, |mine, x, [lower, upper]| {
            if x <= lower || x >= upper {
                *mine = F::zero();
            }
        });
    }

    fn shorten(&mut self, x: &Self, bounds: &Bounds) {
        self.update_within(x, bounds, |mine, x, [lower, upper]| {
            let room = F::min(x - lower, upper - x);
            if room.is_finite() {
                *mine = *mine * room;
            }
        });
    }

    fn dot_later(&self, other: &Self) -> Result<Scalars> {
        debug_assert_eq!(self.0.len(), other.0.len());
        Ok(reduce(0..self.0.len(), add, &|piece| dot(&self.0[piece.clone()], &other.0[piece])))
    }

    fn largest_step(&self, x: &Self, bounds: &Bounds) -> Result<Scalars> {
        let least = |a: Scalars, b: Scalars| std::array::from_fn(|c| a[c].min(b[c]));
        Ok(reduce(0..self.0.len(), least, &|piece| {
            let mut largest = [f64::INFINITY; 3];
            for (part, [lower, upper]) in bounds.parts_of(piece) {
                for (step, x) in self.0[part.clone()].iter().zip(&x.0[part]) {
                    for c in 0..3 {
                        let step = step[c].wide();
                        if step != 0.0 {
                            let bound = if step < 0.0 { lower[c] } else { upper[c] };
                            largest[c] = largest[c].min(((bound - x[c].wide()) / step).max(0.0));
                        }
                    }
                }
            }
            largest
        }))
    }

    fn projected_norm_squared_later(&self, x: &Self, bounds: &Bounds) -> Result<Scalars> {
        Ok(reduce(0..self.0.len(), add, &|piece| {
            let mut sum = [0.0; 3];
            for (part, bounds) in bounds.parts_of(piece) {
                let held = holds::<F>(bounds);
                for (gradient, x) in self.0[part.clone()].iter().zip(&x.0[part]) {
                    for c in 0..3 {
                        let kept = if held(c, x[c], gradient[c]) { 0.0 } else { gradient[c].wide() };
                        sum[c] += kept * kept;
                    }
                }
            }
            sum
        }))
    }

    fn epsilon(&self) -> f64 {
        F::epsilon().wide()
    }

    fn to_host(&self) -> Result<Vec<[f64; 3]>> {
        Ok(self.0.iter().map(|element| element.map(Real::wide)).collect())
    }

    fn set_from_host(&mut self, values: &[[f64; 3]]) -> Result<()> {
        if values.len() != self.0.len() {
            return Err(Error::Shape { what: "a vector", expected: self.0.len(), got: values.len() });
        }
        self.0.iter_mut().zip(values).for_each(|(element, value)| *element = value.map(F::of));
        Ok(())
    }
}

impl<F: Real> CpuVector<F> {
    /// Changes every element by what two indices point at in `other`, zero for nowhere.
    fn look_up(&mut self, other: &Self, a: &[u32], b: &[u32], change: impl Fn(&mut F, F, F) + Sync) {
        let at = |i: u32| if i == NOWHERE { [F::zero(); 3] } else { other.0[i as usize] };
        on_pieces(&mut self.0, PIECE, &|first, piece| {
            for ((element, &a), &b) in piece.iter_mut().zip(&a[first..]).zip(&b[first..]) {
                let (a, b) = (at(a), at(b));
                (0..3).for_each(|c| change(&mut element[c], a[c], b[c]));
            }
        });
    }
}

impl<F: Real> Indexed for CpuVector<F> {
    type Index = Arc<[u32]>;

    fn index(&self, index: &Arc<[u32]>) -> Result<Arc<[u32]>> {
        Ok(index.clone())
    }

    fn pick(&mut self, other: &Self, index: &Arc<[u32]>) {
        self.look_up(other, index, index, |mine, other, _| *mine = other);
    }

    fn place(&mut self, other: &Self, index: &Arc<[u32]>) {
        self.fill([0.0; 3]);
        index.iter().zip(&other.0).for_each(|(&i, element)| self.0[i as usize] = *element);
    }

    fn difference(&mut self, x: &Self, heads: &Arc<[u32]>, tails: &Arc<[u32]>) {
        self.look_up(x, heads, tails, |mine, head, tail| *mine = head - tail);
    }

    fn divergence(&mut self, y: &Self, into: &Arc<[u32]>, out_of: &Arc<[u32]>) {
        self.look_up(y, into, out_of, |mine, into, out_of| *mine += into - out_of);
    }

    fn zeros(&self, len: usize) -> Self {
        Self::zeros(len)
    }
}
