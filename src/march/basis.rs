//! The basis functions of a light map, integrated along the pieces of a ray, and what takes their weights.

use super::{Real, Weight, channel, exponential, least, most};

/// A piece of a ray inside one cell of the basis.
pub(super) struct Piece<F> {
    /// The cell; texels for [`NearestTexel`], the squares between texel centres for [`Bilinear`].
    pub(super) cell: [usize; 2],
    /// Position inside the cell at the start of the piece, in [0, 1] up to rounding.
    pub(super) start: [F; 2],
    /// Change of that position over the piece.
    pub(super) change: [F; 2],
}

/// A basis with N functions v that are not zero inside a cell.
pub(super) trait TexelBasis<F: Real, const C: usize, const N: usize> {
    /// How far cells are shifted against texels, and how many more there are a side.
    const SHIFT: f64;
    /// Cells beyond the number of texels.
    const EXTRA: usize;

    /// `∫₀¹ s e^{−su} v(u) du` over a piece for each of them, and the part of the light that is extinguished along it. `size` is that of the
    /// map. It is exactly zero for a texel that would be outside.
    fn integrate(piece: &Piece<F>, size: [usize; 2], s: [F; C]) -> ([Weight<F, C>; N], Weight<F, C>);

    /// `v` at the start of the piece.
    fn sample(piece: &Piece<F>, size: [usize; 2]) -> [F; N];

    /// Which texel one of them belongs to; any where that would be outside.
    fn texel(cell: [usize; 2], number: usize, size: [usize; 2]) -> usize;
}

/// Takes the weights of the N basis functions of one cell after the other, in the order of the ray.
pub(super) trait TexelSink<F, const C: usize, const N: usize> {
    fn add(&mut self, cell: [usize; 2], weights: [Weight<F, C>; N]);
}

/// The sum of weights times texels: a row of T x.
pub(super) struct Gathered<'a, X, F, B> {
    texels: &'a [[X; 3]],
    size: [usize; 2],
    pub(super) sum: [F; 3],
    basis: std::marker::PhantomData<B>,
}

impl<'a, X, F: Real, B> Gathered<'a, X, F, B> {
    pub(super) fn new(texels: &'a [[X; 3]], size: [usize; 2]) -> Self {
        Self { texels, size, sum: [F::zero(); 3], basis: std::marker::PhantomData }
    }
}

impl<X: Real, F: Real, B: TexelBasis<F, C, N>, const C: usize, const N: usize> TexelSink<F, C, N>
    for Gathered<'_, X, F, B>
{
    #[inline(always)]
    fn add(&mut self, cell: [usize; 2], weights: [Weight<F, C>; N]) {
        for (number, weight) in weights.iter().enumerate() {
            let texel = self.texels[B::texel(cell, number, self.size)];
            for c in 0..3 {
                self.sum[c] += channel(weight, c) * F::of(texel[c].wide());
            }
        }
    }
}

/// Constant in each texel.
pub(super) struct NearestTexel;

impl<F: Real, const C: usize> TexelBasis<F, C, 1> for NearestTexel {
    const SHIFT: f64 = 0.0;
    const EXTRA: usize = 0;

    #[inline(always)]
    fn integrate(_piece: &Piece<F>, _size: [usize; 2], s: [F; C]) -> ([Weight<F, C>; 1], Weight<F, C>) {
        let extinguished = s.map(exponential::extinguished);
        ([extinguished], extinguished)
    }

    #[inline(always)]
    fn sample(_piece: &Piece<F>, _size: [usize; 2]) -> [F; 1] {
        [F::one()]
    }

    #[inline(always)]
    fn texel([i, j]: [usize; 2], _number: usize, [width, _]: [usize; 2]) -> usize {
        j * width + i
    }
}

/// Visits each texel once, when the ray has left it, with all that it weighs.
///
/// The support of every basis function is convex, so a straight ray is inside it without interruption.
pub(super) struct NearestWindow<'v, V, F, const C: usize> {
    width: usize,
    element: usize,
    weight: Weight<F, C>,
    visit: &'v mut V,
}

impl<'v, V: FnMut(usize, Weight<F, C>), F: Real, const C: usize> NearestWindow<'v, V, F, C> {
    pub(super) fn new([width, _]: [usize; 2], visit: &'v mut V) -> Self {
        Self { width, element: usize::MAX, weight: [F::zero(); C], visit }
    }

    /// Visits what is left at the end of a ray.
    pub(super) fn finish(self) {
        if is_positive(self.weight) {
            (self.visit)(self.element, self.weight);
        }
    }
}

impl<V: FnMut(usize, Weight<F, C>), F: Real, const C: usize> TexelSink<F, C, 1>
    for NearestWindow<'_, V, F, C>
{
    #[inline(always)]
    fn add(&mut self, cell: [usize; 2], [weight]: [Weight<F, C>; 1]) {
        let element = cell[1] * self.width + cell[0];
        if element != self.element {
            if is_positive(self.weight) {
                (self.visit)(self.element, self.weight);
            }
            (self.element, self.weight) = (element, weight);
        } else {
            add(&mut self.weight, weight);
        }
    }
}

/// Bilinear between texel centres, constant beyond the outermost ones.
///
/// Cell (i, j) lies between texels i − 1 and i, j − 1 and j; the first and the last of a row are half
/// outside the map, where only the inner texel counts. The texels of a cell are (low, low), (high, low), (low, high), (high, high).
pub(super) struct Bilinear;

/// Fraction towards the high texel at the start of the piece, and its change.
#[inline(always)]
fn fraction<F: Real>(piece: &Piece<F>, size: [usize; 2], axis: usize) -> (F, F) {
    match piece.cell[axis] {
        0 => (F::one(), F::zero()),
        last if last == size[axis] => (F::zero(), F::zero()),
        _ => (least(most(piece.start[axis], F::zero()), F::one()), piece.change[axis]),
    }
}

impl<F: Real, const C: usize> TexelBasis<F, C, 4> for Bilinear {
    const SHIFT: f64 = 0.5;
    const EXTRA: usize = 1;

    #[inline(always)]
    fn integrate(piece: &Piece<F>, size: [usize; 2], s: [F; C]) -> ([Weight<F, C>; 4], Weight<F, C>) {
        let ((x, dx), (y, dy)) = (fraction(piece, size, 0), fraction(piece, size, 1));
        let (mut weights, mut extinguished) = ([[F::zero(); C]; 4], [F::zero(); C]);
        for c in 0..C {
            let [m0, m1, m2] = exponential::moments(s[c]);
            extinguished[c] = m0;
            let along_x = x * m0 + dx * m1;
            let along_y = y * m0 + dy * m1;
            let along_both = x * y * m0 + (x * dy + y * dx) * m1 + dx * dy * m2;
            // Grouped so that it is exactly zero where either texel lies outside.
            weights[0][c] = (m0 - along_x) - (along_y - along_both);
            weights[1][c] = along_x - along_both;
            weights[2][c] = along_y - along_both;
            weights[3][c] = along_both;
        }
        (weights, extinguished)
    }

    #[inline(always)]
    fn sample(piece: &Piece<F>, size: [usize; 2]) -> [F; 4] {
        let (x, y) = (fraction(piece, size, 0).0, fraction(piece, size, 1).0);
        let one = F::one();
        [(one - x) * (one - y), x * (one - y), (one - x) * y, x * y]
    }

    #[inline(always)]
    fn texel(cell: [usize; 2], number: usize, size: [usize; 2]) -> usize {
        let along = |axis: usize| (cell[axis] + (number >> axis & 1)).clamp(1, size[axis]) - 1;
        along(1) * size[0] + along(0)
    }
}

/// The same as [`NearestWindow`] for [`Bilinear`].
pub(super) struct BilinearWindow<'v, V, F, const C: usize> {
    size: [usize; 2],
    cell: [usize; 2],
    taps: [Weight<F, C>; 4],
    visit: &'v mut V,
}

impl<'v, V: FnMut(usize, Weight<F, C>), F: Real, const C: usize> BilinearWindow<'v, V, F, C> {
    pub(super) fn new(size: [usize; 2], visit: &'v mut V) -> Self {
        Self { size, cell: [0, 0], taps: [[F::zero(); C]; 4], visit }
    }

    /// Moves the window over `cell`, visits the texels that it leaves and keeps the others.
    #[inline(always)]
    fn move_to(&mut self, cell: [usize; 2]) {
        if cell == self.cell {
            return;
        }
        let moved = [0, 1].map(|axis| cell[axis] as isize - self.cell[axis] as isize);
        let old = std::mem::replace(&mut self.taps, [[F::zero(); C]; 4]);
        for (tap, weight) in old.into_iter().enumerate() {
            let (x, y) = ((tap & 1) as isize - moved[0], (tap >> 1) as isize - moved[1]);
            if (0..2).contains(&x) && (0..2).contains(&y) {
                self.taps[(y * 2 + x) as usize] = weight;
            } else {
                self.leave(tap, weight);
            }
        }
        self.cell = cell;
    }

    #[inline(always)]
    fn leave(&mut self, tap: usize, weight: Weight<F, C>) {
        // A weight is zero where its texel would be outside; rounding can make a vanishing one negative.
        if is_positive(weight) {
            let (i, j) = (self.cell[0] + (tap & 1) - 1, self.cell[1] + (tap >> 1) - 1);
            (self.visit)(j * self.size[0] + i, weight);
        }
    }

    /// Visits what is left at the end of a ray.
    pub(super) fn finish(mut self) {
        for (tap, weight) in self.taps.into_iter().enumerate() {
            self.leave(tap, weight);
        }
    }
}

impl<V: FnMut(usize, Weight<F, C>), F: Real, const C: usize> TexelSink<F, C, 4>
    for BilinearWindow<'_, V, F, C>
{
    #[inline(always)]
    fn add(&mut self, cell: [usize; 2], weights: [Weight<F, C>; 4]) {
        self.move_to(cell);
        for (tap, weight) in self.taps.iter_mut().zip(weights) {
            add(tap, weight);
        }
    }
}

#[inline(always)]
pub(super) fn add<F: Real, const C: usize>(sum: &mut Weight<F, C>, term: Weight<F, C>) {
    for c in 0..C {
        sum[c] += term[c];
    }
}

#[inline(always)]
pub(super) fn times<F: Real, const C: usize>(a: Weight<F, C>, b: Weight<F, C>) -> Weight<F, C> {
    std::array::from_fn(|c| a[c] * b[c])
}

#[inline(always)]
fn is_positive<F: Real, const C: usize>(weight: Weight<F, C>) -> bool {
    weight.iter().any(|&value| value > F::zero())
}
