use std::sync::Mutex;

use super::{Bounds, LinearOperator, PendingSum, Scalars, Vector};
use crate::{Error, Result};

/// Blocks of a stack at most: the data and what may regularize them.
const MOST_BLOCKS: usize = 8;

/// An operator of a stack, which threads may share.
type Block<'a, V> = dyn LinearOperator<Domain = V, Range = V> + Send + Sync + 'a;

/// [A; B; …]: operators on the same unknowns, one above the other.
///
/// A regularized problem is the plain least-squares problem of the transport stacked on its regularizers.
pub struct Stacked<'a, V> {
    blocks: Vec<Box<Block<'a, V>>>,
    scratch: Mutex<V>,
}

impl<'a, V: Vector> Stacked<'a, V> {
    /// One operator, to be stacked on others.
    pub fn new(uppermost: impl LinearOperator<Domain = V, Range = V> + Send + Sync + 'a) -> Self {
        let scratch = Mutex::new(uppermost.domain());
        Self { blocks: vec![Box::new(uppermost)], scratch }
    }

    /// The same with another operator below.
    ///
    /// Errors: [`Error::Shape`] when it acts on another number of unknowns, or is one too many.
    pub fn over(
        mut self,
        lower: impl LinearOperator<Domain = V, Range = V> + Send + Sync + 'a,
    ) -> Result<Self> {
        if self.blocks.len() == MOST_BLOCKS {
            return Err(Error::Shape {
                what: "a stack (blocks)",
                expected: MOST_BLOCKS,
                got: MOST_BLOCKS + 1,
            });
        }
        super::expect_len("the lower operator's domain", &lower.domain(), super::lock(&self.scratch).len())?;
        self.blocks.push(Box::new(lower));
        Ok(self)
    }

    /// The operator of block `index`, from the top.
    pub fn block(&self, index: usize) -> &(dyn LinearOperator<Domain = V, Range = V> + 'a) {
        &*self.blocks[index]
    }

    /// The number of blocks.
    pub fn blocks(&self) -> usize {
        self.blocks.len()
    }
}

impl<V> std::fmt::Debug for Stacked<'_, V> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Stacked of {}", self.blocks.len())
    }
}

impl<V: Vector> LinearOperator for Stacked<'_, V> {
    type Domain = V;
    type Range = Blocks<V>;

    fn domain(&self) -> V {
        super::lock(&self.scratch).zeros_like()
    }

    fn range(&self) -> Blocks<V> {
        Blocks(self.blocks.iter().map(|block| block.range()).collect())
    }

    fn apply(&self, x: &V, y: &mut Blocks<V>) -> Result<()> {
        y.expect(self.blocks.len())?;
        self.blocks.iter().zip(&mut y.0).try_for_each(|(block, y)| block.apply(x, y))
    }

    fn apply_adjoint(&self, y: &Blocks<V>, x: &mut V) -> Result<()> {
        y.expect(self.blocks.len())?;
        self.blocks[0].apply_adjoint(&y.0[0], x)?;
        let mut lower = super::lock(&self.scratch);
        for (block, y) in self.blocks.iter().zip(&y.0).skip(1) {
            block.apply_adjoint(y, &mut lower)?;
            x.axpby([1.0; 3], &lower, [1.0; 3]);
        }
        Ok(())
    }
}

/// Vectors, one above the other.
#[derive(Debug, Clone, PartialEq)]
pub struct Blocks<V>(pub Vec<V>);

impl<V: Vector> Blocks<V> {
    fn expect(&self, blocks: usize) -> Result<()> {
        let got = self.0.len();
        if got == blocks {
            Ok(())
        } else {
            Err(Error::Shape { what: "a stacked vector (blocks)", expected: blocks, got })
        }
    }

    fn pairs<'a>(&'a mut self, other: &'a Self) -> impl Iterator<Item = (&'a mut V, &'a V)> {
        self.0.iter_mut().zip(&other.0)
    }

    fn sum(&self, part: impl Fn(usize, &V) -> Result<V::Sum>) -> Result<BlockSum<V::Sum>> {
        let mut parts = [const { None }; MOST_BLOCKS];
        for (index, block) in self.0.iter().enumerate() {
            parts[index] = Some(part(index, block)?);
        }
        Ok(BlockSum(parts))
    }
}

/// The sum over all blocks, each of them under way; it takes no memory.
#[derive(Debug)]
pub struct BlockSum<S>([Option<S>; MOST_BLOCKS]);

impl<S: PendingSum> PendingSum for BlockSum<S> {
    fn value(self) -> Result<Scalars> {
        self.0.into_iter().flatten().try_fold([0.0; 3], |sum, part| {
            let part = part.value()?;
            Ok(std::array::from_fn(|c| sum[c] + part[c]))
        })
    }
}

impl<V: Vector> Vector for Blocks<V> {
    type Sum = BlockSum<V::Sum>;

    fn len(&self) -> usize {
        self.0.iter().map(V::len).sum()
    }

    fn zeros_like(&self) -> Self {
        Self(self.0.iter().map(V::zeros_like).collect())
    }

    fn fill(&mut self, value: Scalars) {
        self.0.iter_mut().for_each(|block| block.fill(value));
    }

    fn copy_from(&mut self, other: &Self) {
        self.pairs(other).for_each(|(mine, other)| mine.copy_from(other));
    }

    fn axpby(&mut self, alpha: Scalars, x: &Self, beta: Scalars) {
        self.pairs(x).for_each(|(mine, x)| mine.axpby(alpha, x, beta));
    }

    fn scale(&mut self, factor: Scalars) {
        self.0.iter_mut().for_each(|block| block.scale(factor));
    }

    fn multiply(&mut self, x: &Self) {
        self.pairs(x).for_each(|(mine, x)| mine.multiply(x));
    }

    fn invert(&mut self) {
        self.0.iter_mut().for_each(V::invert);
    }

    fn clamp(&mut self, bounds: &Bounds) {
        self.0.iter_mut().for_each(|block| block.clamp(bounds));
    }

    fn hold(&mut self, x: &Self, gradient: &Self, bounds: &Bounds) {
        self.pairs(x).zip(&gradient.0).for_each(|((mine, x), gradient)| mine.hold(x, gradient, bounds));
    }

    fn hold_at_bounds(&mut self, x: &Self, bounds: &Bounds) {
        self.pairs(x).for_each(|(mine, x)| mine.hold_at_bounds(x, bounds));
    }

    fn shorten(&mut self, x: &Self, bounds: &Bounds) {
        self.pairs(x).for_each(|(mine, x)| mine.shorten(x, bounds));
    }

    fn largest_step(&self, x: &Self, bounds: &Bounds) -> Result<Scalars> {
        self.0.iter().zip(&x.0).try_fold([f64::INFINITY; 3], |least, (block, x)| {
            let step = block.largest_step(x, bounds)?;
            Ok(std::array::from_fn(|c| least[c].min(step[c])))
        })
    }

    fn projected_norm_squared_later(&self, x: &Self, bounds: &Bounds) -> Result<Self::Sum> {
        self.sum(|index, block| block.projected_norm_squared_later(&x.0[index], bounds))
    }

    fn dot_later(&self, other: &Self) -> Result<Self::Sum> {
        self.sum(|index, block| block.dot_later(&other.0[index]))
    }

    fn upper_norm_squared(&self) -> Result<Scalars> {
        self.0.first().map_or(Ok([0.0; 3]), V::norm_squared)
    }

    fn epsilon(&self) -> f64 {
        self.0.iter().map(V::epsilon).fold(0.0, f64::max)
    }

    fn to_host(&self) -> Result<Vec<[f64; 3]>> {
        Ok(self.0.iter().map(V::to_host).collect::<Result<Vec<_>>>()?.concat())
    }

    fn set_from_host(&mut self, values: &[[f64; 3]]) -> Result<()> {
        if values.len() != self.len() {
            return Err(Error::Shape { what: "a stacked vector", expected: self.len(), got: values.len() });
        }
        let mut rest = values;
        for block in &mut self.0 {
            let (mine, others) = rest.split_at(block.len());
            block.set_from_host(mine)?;
            rest = others;
        }
        Ok(())
    }
}
