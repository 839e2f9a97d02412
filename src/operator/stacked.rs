use std::cell::RefCell;

use super::{LinearOperator, Scalars, Vector};
use crate::{Error, Result};

/// [A; B]: two operators on the same unknowns, one above the other.
///
/// A regularized problem is the plain least-squares problem of the transport stacked on its regularizers.
#[derive(Debug)]
pub struct Stacked<A: LinearOperator, B> {
    upper: A,
    lower: B,
    scratch: RefCell<A::Domain>,
}

impl<A: LinearOperator, B: LinearOperator<Domain = A::Domain>> Stacked<A, B> {
    /// Errors: [`Error::Shape`] when the two act on different numbers of unknowns.
    pub fn new(upper: A, lower: B) -> Result<Self> {
        super::expect_len("the lower operator's domain", &lower.domain(), upper.domain().len())?;
        let scratch = RefCell::new(upper.domain());
        Ok(Self { upper, lower, scratch })
    }
}

impl<A: LinearOperator, B: LinearOperator<Domain = A::Domain>> LinearOperator for Stacked<A, B> {
    type Domain = A::Domain;
    type Range = (A::Range, B::Range);

    fn domain(&self) -> A::Domain {
        self.upper.domain()
    }

    fn range(&self) -> Self::Range {
        (self.upper.range(), self.lower.range())
    }

    fn apply(&self, x: &A::Domain, y: &mut Self::Range) -> Result<()> {
        self.upper.apply(x, &mut y.0)?;
        self.lower.apply(x, &mut y.1)
    }

    fn apply_adjoint(&self, y: &Self::Range, x: &mut A::Domain) -> Result<()> {
        self.upper.apply_adjoint(&y.0, x)?;
        let mut from_lower = self.scratch.borrow_mut();
        self.lower.apply_adjoint(&y.1, &mut from_lower)?;
        x.axpby([1.0; 3], &from_lower, [1.0; 3]);
        Ok(())
    }
}

/// Two vectors, one above the other.
impl<A: Vector, B: Vector> Vector for (A, B) {
    fn len(&self) -> usize {
        self.0.len() + self.1.len()
    }

    fn zeros_like(&self) -> Self {
        (self.0.zeros_like(), self.1.zeros_like())
    }

    fn fill(&mut self, value: Scalars) {
        self.0.fill(value);
        self.1.fill(value);
    }

    fn copy_from(&mut self, other: &Self) {
        self.0.copy_from(&other.0);
        self.1.copy_from(&other.1);
    }

    fn axpby(&mut self, alpha: Scalars, x: &Self, beta: Scalars) {
        self.0.axpby(alpha, &x.0, beta);
        self.1.axpby(alpha, &x.1, beta);
    }

    fn scale(&mut self, factor: Scalars) {
        self.0.scale(factor);
        self.1.scale(factor);
    }

    fn multiply(&mut self, x: &Self) {
        self.0.multiply(&x.0);
        self.1.multiply(&x.1);
    }

    fn clamp_below(&mut self, bound: Scalars) {
        self.0.clamp_below(bound);
        self.1.clamp_below(bound);
    }

    fn dot(&self, other: &Self) -> Result<Scalars> {
        let (upper, lower) = (self.0.dot(&other.0)?, self.1.dot(&other.1)?);
        Ok(std::array::from_fn(|c| upper[c] + lower[c]))
    }

    fn to_host(&self) -> Result<Vec<[f64; 3]>> {
        let mut values = self.0.to_host()?;
        values.extend(self.1.to_host()?);
        Ok(values)
    }

    fn set_from_host(&mut self, values: &[[f64; 3]]) -> Result<()> {
        let (expected, got) = (self.len(), values.len());
        let (upper, lower) = values.split_at_checked(self.0.len()).ok_or(Error::Shape {
            what: "a stacked vector",
            expected,
            got,
        })?;
        self.0.set_from_host(upper)?;
        self.1.set_from_host(lower)
    }
}
