use std::sync::Mutex;

use super::{LinearOperator, Vector};
use crate::{Error, Result};

/// A B, applied factor by factor.
///
/// Error   the factors' own; what is between them is rounded as their vectors are
/// Cost    that of the factors
#[derive(Debug)]
pub struct Composed<A, B: LinearOperator> {
    a: A,
    b: B,
    /// Between B and A, in both directions.
    room: Mutex<B::Range>,
}

impl<A, B> Composed<A, B>
where
    A: LinearOperator,
    B: LinearOperator<Range = A::Domain>,
{
    /// Errors: [`Error::Shape`] when the factors do not fit together.
    pub fn new(a: A, b: B) -> Result<Self> {
        let inner = b.range();
        let expected = a.domain().len();
        if inner.len() != expected {
            return Err(Error::Shape { what: "the inner rows", expected, got: inner.len() });
        }
        Ok(Self { a, b, room: Mutex::new(inner) })
    }

    /// A and B.
    pub fn factors(&self) -> (&A, &B) {
        (&self.a, &self.b)
    }
}

impl<A, B> LinearOperator for Composed<A, B>
where
    A: LinearOperator,
    B: LinearOperator<Range = A::Domain>,
{
    type Domain = B::Domain;
    type Range = A::Range;

    fn domain(&self) -> B::Domain {
        self.b.domain()
    }

    fn range(&self) -> A::Range {
        self.a.range()
    }

    fn apply(&self, x: &B::Domain, y: &mut A::Range) -> Result<()> {
        let inner = &mut *super::lock(&self.room);
        self.b.apply(x, inner)?;
        self.a.apply(inner, y)
    }

    fn apply_adjoint(&self, y: &A::Range, x: &mut B::Domain) -> Result<()> {
        let inner = &mut *super::lock(&self.room);
        self.a.apply_adjoint(y, inner)?;
        self.b.apply_adjoint(inner, x)
    }
}
