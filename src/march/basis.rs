//! The basis functions of a light map, integrated along a ray and gathered into one weight a texel.

use super::{Real, Weight, exponential, least, most};

/// A piece of a ray inside one cell of the basis.
pub(super) struct Piece<F> {
    /// The cell; texels for [`NearestTexel`], the squares between texel centres for [`Bilinear`].
    pub(super) cell: [usize; 2],
    /// Position inside the cell at the start of the piece, in [0, 1] up to rounding.
    pub(super) start: [F; 2],
    /// Change of that position over the piece.
    pub(super) change: [F; 2],
}

/// A basis that takes pieces of a ray in order and visits each texel once, when the ray has left it.
///
/// The support of every basis function is convex, so a straight ray is inside it without interruption.
pub(super) trait TexelWindow<F: Real, const C: usize> {
    /// How far cells are shifted against texels, and how many more there are a side.
    const SHIFT: f64;
    /// Cells beyond the number of texels.
    const EXTRA: usize;

    fn new(size: [usize; 2]) -> Self;

    /// Adds `strength · ∫₀¹ s e^{−su} v(u) du` over the piece for every basis function v;
    /// returns the part of the light that is extinguished along it.
    fn integrate(
        &mut self,
        piece: &Piece<F>,
        s: [F; C],
        strength: Weight<F, C>,
        visit: &mut impl FnMut(usize, Weight<F, C>),
    ) -> Weight<F, C>;

    /// Adds `strength · v` at the start of the piece.
    fn sample(
        &mut self,
        piece: &Piece<F>,
        strength: Weight<F, C>,
        visit: &mut impl FnMut(usize, Weight<F, C>),
    );

    /// Visits what is left at the end of a ray.
    fn finish(self, visit: &mut impl FnMut(usize, Weight<F, C>));
}

/// Constant in each texel.
pub(super) struct NearestTexel<F, const C: usize> {
    width: usize,
    element: usize,
    weight: Weight<F, C>,
}

impl<F: Real, const C: usize> NearestTexel<F, C> {
    #[inline(always)]
    fn add(&mut self, cell: [usize; 2], weight: Weight<F, C>, visit: &mut impl FnMut(usize, Weight<F, C>)) {
        let element = cell[1] * self.width + cell[0];
        if element != self.element {
            if is_positive(self.weight) {
                visit(self.element, self.weight);
            }
            (self.element, self.weight) = (element, weight);
        } else {
            add(&mut self.weight, weight);
        }
    }
}

impl<F: Real, const C: usize> TexelWindow<F, C> for NearestTexel<F, C> {
    const SHIFT: f64 = 0.0;
    const EXTRA: usize = 0;

    fn new(size: [usize; 2]) -> Self {
        Self { width: size[0], element: usize::MAX, weight: [F::zero(); C] }
    }

    #[inline(always)]
    fn integrate(
        &mut self,
        piece: &Piece<F>,
        s: [F; C],
        strength: Weight<F, C>,
        visit: &mut impl FnMut(usize, Weight<F, C>),
    ) -> Weight<F, C> {
        let extinguished = s.map(exponential::extinguished);
        self.add(piece.cell, times(strength, extinguished), visit);
        extinguished
    }

    #[inline(always)]
    fn sample(
        &mut self,
        piece: &Piece<F>,
        strength: Weight<F, C>,
        visit: &mut impl FnMut(usize, Weight<F, C>),
    ) {
        self.add(piece.cell, strength, visit);
    }

    fn finish(self, visit: &mut impl FnMut(usize, Weight<F, C>)) {
        if is_positive(self.weight) {
            visit(self.element, self.weight);
        }
    }
}

/// Bilinear between texel centres, constant beyond the outermost ones.
///
/// Cell (i, j) lies between texels i − 1 and i, j − 1 and j; the first and the last of a row are half
/// outside the map, where only the inner texel counts.
pub(super) struct Bilinear<F, const C: usize> {
    size: [usize; 2],
    cell: [usize; 2],
    /// Weights of the texels at (low, low), (high, low), (low, high), (high, high).
    taps: [Weight<F, C>; 4],
}

impl<F: Real, const C: usize> Bilinear<F, C> {
    /// Moves the window over `cell`, visits the texels that it leaves and keeps the others.
    #[inline(always)]
    fn move_to(&mut self, cell: [usize; 2], visit: &mut impl FnMut(usize, Weight<F, C>)) {
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
                self.leave(tap, weight, visit);
            }
        }
        self.cell = cell;
    }

    #[inline(always)]
    fn leave(&self, tap: usize, weight: Weight<F, C>, visit: &mut impl FnMut(usize, Weight<F, C>)) {
        // A weight is zero where its texel would be outside; rounding can make a vanishing one negative.
        if is_positive(weight) {
            let (i, j) = (self.cell[0] + (tap & 1) - 1, self.cell[1] + (tap >> 1) - 1);
            visit(j * self.size[0] + i, weight);
        }
    }

    /// Fraction towards the high texel at the start of the piece, and its change.
    #[inline(always)]
    fn fraction(&self, piece: &Piece<F>, axis: usize) -> (F, F) {
        match piece.cell[axis] {
            0 => (F::one(), F::zero()),
            last if last == self.size[axis] => (F::zero(), F::zero()),
            _ => (least(most(piece.start[axis], F::zero()), F::one()), piece.change[axis]),
        }
    }
}

impl<F: Real, const C: usize> TexelWindow<F, C> for Bilinear<F, C> {
    const SHIFT: f64 = 0.5;
    const EXTRA: usize = 1;

    fn new(size: [usize; 2]) -> Self {
        Self { size, cell: [0, 0], taps: [[F::zero(); C]; 4] }
    }

    #[inline(always)]
    fn integrate(
        &mut self,
        piece: &Piece<F>,
        s: [F; C],
        strength: Weight<F, C>,
        visit: &mut impl FnMut(usize, Weight<F, C>),
    ) -> Weight<F, C> {
        self.move_to(piece.cell, visit);
        let ((x, dx), (y, dy)) = (self.fraction(piece, 0), self.fraction(piece, 1));
        let mut extinguished = [F::zero(); C];
        for c in 0..C {
            let [m0, m1, m2] = exponential::moments(s[c]);
            extinguished[c] = m0;
            let along_x = x * m0 + dx * m1;
            let along_y = y * m0 + dy * m1;
            let along_both = x * y * m0 + (x * dy + y * dx) * m1 + dx * dy * m2;
            // Grouped so that it is exactly zero where either texel lies outside.
            self.taps[0][c] += strength[c] * ((m0 - along_x) - (along_y - along_both));
            self.taps[1][c] += strength[c] * (along_x - along_both);
            self.taps[2][c] += strength[c] * (along_y - along_both);
            self.taps[3][c] += strength[c] * along_both;
        }
        extinguished
    }

    #[inline(always)]
    fn sample(
        &mut self,
        piece: &Piece<F>,
        strength: Weight<F, C>,
        visit: &mut impl FnMut(usize, Weight<F, C>),
    ) {
        self.move_to(piece.cell, visit);
        let (x, y) = (self.fraction(piece, 0).0, self.fraction(piece, 1).0);
        let one = F::one();
        let parts = [(one - x) * (one - y), x * (one - y), (one - x) * y, x * y];
        for (tap, part) in self.taps.iter_mut().zip(parts) {
            add(tap, strength.map(|value| value * part));
        }
    }

    fn finish(self, visit: &mut impl FnMut(usize, Weight<F, C>)) {
        for (tap, &weight) in self.taps.iter().enumerate() {
            self.leave(tap, weight, visit);
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
