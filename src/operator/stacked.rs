use std::sync::Mutex;

use super::{Bounds, LinearOperator, PendingSum, Scalars, Vector};
use crate::{Error, Result};

/// Blocks below the data at most: what may regularize them.
const MOST_LOWER: usize = 7;

/// An operator of a stack, which threads may share.
type Block<'a, V, R> = Box<dyn LinearOperator<Domain = V, Range = R> + Send + Sync + 'a>;

/// [A; B; …]: operators on the same unknowns, one above the other.
///
/// A regularized problem is the plain least-squares problem of the transport stacked on its regularizers. Rows of the transport may live
/// elsewhere than the unknowns, which the regularizers are about.
pub struct Stacked<'a, V, R = V> {
    upper: Block<'a, V, R>,
    lower: Vec<Block<'a, V, V>>,
    scratch: Mutex<V>,
}

impl<'a, V: Vector, R: Vector> Stacked<'a, V, R> {
    /// One operator, to be stacked on others.
    pub fn new(upper: impl LinearOperator<Domain = V, Range = R> + Send + Sync + 'a) -> Self {
        Self { scratch: Mutex::new(upper.domain()), upper: Box::new(upper), lower: Vec::new() }
    }

    /// The same with another operator below.
    ///
    /// Errors: [`Error::Shape`] when it acts on another number of unknowns, or is one too many.
    pub fn over(
        mut self,
        lower: impl LinearOperator<Domain = V, Range = V> + Send + Sync + 'a,
    ) -> Result<Self> {
        if self.lower.len() == MOST_LOWER {
            return Err(Error::Shape {
                what: "a stack (blocks)",
                expected: MOST_LOWER + 1,
                got: MOST_LOWER + 2,
            });
        }
        super::expect_len("the lower operator's domain", &lower.domain(), super::lock(&self.scratch).len())?;
        self.lower.push(Box::new(lower));
        Ok(self)
    }

    /// The same stack with another operator in the place of its upper one.
    pub fn under<'b>(&'b self, upper: &'b dyn LinearOperator<Domain = V, Range = R>) -> Under<'b, V, R> {
        Under { upper, lower: &self.lower, scratch: &self.scratch }
    }

    /// Each lower operator applied to x.
    ///
    /// Errors: [`Error::Shape`](crate::Error::Shape) for an x of another length; those of the operators.
    pub fn below(&self, x: &V) -> Result<Vec<V>> {
        let apply = |operator: &Block<'a, V, V>| {
            let mut y = operator.range();
            operator.apply(x, &mut y)?;
            Ok(y)
        };
        self.lower.iter().map(apply).collect()
    }
}

impl<V, R> std::fmt::Debug for Stacked<'_, V, R> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Stacked of {}", 1 + self.lower.len())
    }
}

impl<V: Vector, R: Vector> LinearOperator for Stacked<'_, V, R> {
    type Domain = V;
    type Range = Blocks<R, V>;

    fn domain(&self) -> V {
        self.under(&*self.upper).domain()
    }

    fn range(&self) -> Blocks<R, V> {
        self.under(&*self.upper).range()
    }

    fn apply(&self, x: &V, y: &mut Blocks<R, V>) -> Result<()> {
        self.under(&*self.upper).apply(x, y)
    }

    fn apply_adjoint(&self, y: &Blocks<R, V>, x: &mut V) -> Result<()> {
        self.under(&*self.upper).apply_adjoint(y, x)
    }
}

/// A stack of whose operators the upper one is another: [`Stacked::under`].
pub struct Under<'a, V, R = V> {
    upper: &'a dyn LinearOperator<Domain = V, Range = R>,
    lower: &'a [Block<'a, V, V>],
    scratch: &'a Mutex<V>,
}

impl<V, R> std::fmt::Debug for Under<'_, V, R> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Under of {}", 1 + self.lower.len())
    }
}

impl<V: Vector, R: Vector> LinearOperator for Under<'_, V, R> {
    type Domain = V;
    type Range = Blocks<R, V>;

    fn domain(&self) -> V {
        super::lock(self.scratch).zeros_like()
    }

    fn range(&self) -> Blocks<R, V> {
        Blocks::new(self.upper.range(), self.lower.iter().map(|block| block.range()).collect())
    }

    fn apply(&self, x: &V, y: &mut Blocks<R, V>) -> Result<()> {
        y.expect(self.lower.len())?;
        self.upper.apply(x, &mut y.upper)?;
        self.lower.iter().zip(&mut y.lower).try_for_each(|(block, y)| block.apply(x, y))
    }

    fn apply_adjoint(&self, y: &Blocks<R, V>, x: &mut V) -> Result<()> {
        y.expect(self.lower.len())?;
        self.upper.apply_adjoint(&y.upper, x)?;
        let mut lower = super::lock(self.scratch);
        for (block, y) in self.lower.iter().zip(&y.lower) {
            block.apply_adjoint(y, &mut lower)?;
            x.axpby([1.0; 3], &lower, [1.0; 3]);
        }
        Ok(())
    }
}

/// Vectors, one above the others, which are of one type.
#[derive(Debug, Clone, PartialEq)]
pub struct Blocks<R, V = R> {
    /// Over the rows of the data.
    pub upper: R,
    /// Over the rows of the regularizers, one vector a regularizer.
    pub lower: Vec<V>,
}

impl<R: Vector, V: Vector> Blocks<R, V> {
    /// One vector above others.
    pub fn new(upper: R, lower: Vec<V>) -> Self {
        Self { upper, lower }
    }

    fn expect(&self, lower: usize) -> Result<()> {
        let (expected, got) = (lower + 1, self.lower.len() + 1);
        if got == expected {
            Ok(())
        } else {
            Err(Error::Shape { what: "a stacked vector (blocks)", expected, got })
        }
    }
}

/// Does the same to every block, with its partners in other stacks.
macro_rules! each {
    ($stack:expr, $mine:ident => $change:expr) => {{
        let $mine = &mut $stack.upper;
        $change;
        $stack.lower.iter_mut().for_each(|$mine| $change);
    }};
    ($stack:expr, $mine:ident, $($other:ident),+ => $change:expr) => {{
        {
            let ($mine, $($other),+) = (&mut $stack.upper, $(&$other.upper),+);
            $change;
        }
        for (index, $mine) in $stack.lower.iter_mut().enumerate() {
            $(let $other = &$other.lower[index];)+
            $change;
        }
    }};
}

/// A sum over all blocks of which the block's sums are under way; it takes no memory.
#[derive(Debug)]
pub struct BlockSum<R, V> {
    upper: R,
    lower: [Option<V>; MOST_LOWER],
}

impl<R: PendingSum, V: PendingSum> PendingSum for BlockSum<R, V> {
    fn value(self) -> Result<Scalars> {
        self.lower.into_iter().flatten().try_fold(self.upper.value()?, |sum, part| {
            let part = part.value()?;
            Ok(std::array::from_fn(|c| sum[c] + part[c]))
        })
    }
}

/// A sum over all blocks, given that of a block and its partner.
macro_rules! sum {
    ($stack:expr, $other:expr, |$mine:ident, $theirs:ident| $part:expr) => {{
        let (upper, mut lower) = {
            let ($mine, $theirs) = (&$stack.upper, &$other.upper);
            ($part?, [const { None }; MOST_LOWER])
        };
        for (sum, ($mine, $theirs)) in lower.iter_mut().zip($stack.lower.iter().zip(&$other.lower)) {
            *sum = Some($part?);
        }
        Ok(BlockSum { upper, lower })
    }};
}

impl<R: Vector, V: Vector> Vector for Blocks<R, V> {
    type Sum = BlockSum<R::Sum, V::Sum>;

    fn len(&self) -> usize {
        self.upper.len() + self.lower.iter().map(V::len).sum::<usize>()
    }

    fn zeros_like(&self) -> Self {
        Self::new(self.upper.zeros_like(), self.lower.iter().map(V::zeros_like).collect())
    }

    fn fill(&mut self, value: Scalars) {
        each!(self, mine => mine.fill(value));
    }

    fn copy_from(&mut self, other: &Self) {
        each!(self, mine, other => mine.copy_from(other));
    }

    fn axpby(&mut self, alpha: Scalars, x: &Self, beta: Scalars) {
        each!(self, mine, x => mine.axpby(alpha, x, beta));
    }

    fn scale(&mut self, factor: Scalars) {
        each!(self, mine => mine.scale(factor));
    }

    fn multiply(&mut self, x: &Self) {
        each!(self, mine, x => mine.multiply(x));
    }

    fn invert(&mut self) {
        each!(self, mine => mine.invert());
    }

    fn extrapolate(&mut self, x: &Self, factor: Scalars) {
        each!(self, mine, x => mine.extrapolate(x, factor));
    }

    fn step_within(&mut self, factor: Scalars, x: &Self, y: &Self, bounds: &Bounds) {
        each!(self, mine, x, y => mine.step_within(factor, x, y, bounds));
    }

    fn clamp(&mut self, bounds: &Bounds) {
        each!(self, mine => mine.clamp(bounds));
    }

    fn hold(&mut self, x: &Self, gradient: &Self, bounds: &Bounds) {
        each!(self, mine, x, gradient => mine.hold(x, gradient, bounds));
    }

    fn hold_at_bounds(&mut self, x: &Self, bounds: &Bounds) {
        each!(self, mine, x => mine.hold_at_bounds(x, bounds));
    }

    fn shorten(&mut self, x: &Self, bounds: &Bounds) {
        each!(self, mine, x => mine.shorten(x, bounds));
    }

    fn largest_step(&self, x: &Self, bounds: &Bounds) -> Result<Scalars> {
        let least = self.upper.largest_step(&x.upper, bounds)?;
        self.lower.iter().zip(&x.lower).try_fold(least, |least, (block, x)| {
            let step = block.largest_step(x, bounds)?;
            Ok(std::array::from_fn(|c| least[c].min(step[c])))
        })
    }

    fn projected_norm_squared_later(&self, x: &Self, bounds: &Bounds) -> Result<Self::Sum> {
        sum!(self, x, |mine, x| mine.projected_norm_squared_later(x, bounds))
    }

    fn dot_later(&self, other: &Self) -> Result<Self::Sum> {
        sum!(self, other, |mine, other| mine.dot_later(other))
    }

    fn upper_norm_squared(&self) -> Result<Scalars> {
        self.upper.norm_squared()
    }

    fn epsilon(&self) -> f64 {
        self.lower.iter().map(V::epsilon).fold(self.upper.epsilon(), f64::max)
    }

    fn to_host(&self) -> Result<Vec<[f64; 3]>> {
        let lower = self.lower.iter().map(V::to_host).collect::<Result<Vec<_>>>()?;
        Ok([self.upper.to_host()?, lower.concat()].concat())
    }

    fn set_from_host(&mut self, values: &[[f64; 3]]) -> Result<()> {
        if values.len() != self.len() {
            return Err(Error::Shape { what: "a stacked vector", expected: self.len(), got: values.len() });
        }
        let (upper, mut rest) = values.split_at(self.upper.len());
        self.upper.set_from_host(upper)?;
        for block in &mut self.lower {
            let (mine, others) = rest.split_at(block.len());
            block.set_from_host(mine)?;
            rest = others;
        }
        Ok(())
    }
}
