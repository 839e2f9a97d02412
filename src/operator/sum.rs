use std::sync::Mutex;

use super::{LinearOperator, Vector};
use crate::{Error, Result};

/// A + B, applied one after the other.
///
/// Error   the operators' own
/// Cost    that of the operators
#[derive(Debug)]
pub struct Sum<A: LinearOperator, B> {
    a: A,
    b: B,
    /// What B gives, in both directions.
    room: Mutex<(A::Range, A::Domain)>,
}

impl<A, B> Sum<A, B>
where
    A: LinearOperator,
    B: LinearOperator<Domain = A::Domain, Range = A::Range>,
{
    /// Errors: [`Error::Shape`] when the operators are of different shapes.
    pub fn new(a: A, b: B) -> Result<Self> {
        let same = |what, expected: usize, got: usize| {
            if expected == got { Ok(()) } else { Err(Error::Shape { what, expected, got }) }
        };
        same("the added rows", a.range().len(), b.range().len())?;
        same("the added columns", a.domain().len(), b.domain().len())?;
        let room = Mutex::new((a.range(), a.domain()));
        Ok(Self { a, b, room })
    }

    /// A and B.
    pub fn terms(&self) -> (&A, &B) {
        (&self.a, &self.b)
    }
}

impl<A, B> LinearOperator for Sum<A, B>
where
    A: LinearOperator,
    B: LinearOperator<Domain = A::Domain, Range = A::Range>,
{
    type Domain = A::Domain;
    type Range = A::Range;

    fn domain(&self) -> A::Domain {
        self.a.domain()
    }

    fn range(&self) -> A::Range {
        self.a.range()
    }

    fn apply(&self, x: &A::Domain, y: &mut A::Range) -> Result<()> {
        let (rows, _) = &mut *super::lock(&self.room);
        self.a.apply(x, y)?;
        self.b.apply(x, rows)?;
        y.axpby([1.0; 3], rows, [1.0; 3]);
        Ok(())
    }

    fn apply_adjoint(&self, y: &A::Range, x: &mut A::Domain) -> Result<()> {
        let (_, columns) = &mut *super::lock(&self.room);
        self.a.apply_adjoint(y, x)?;
        self.b.apply_adjoint(y, columns)?;
        x.axpby([1.0; 3], columns, [1.0; 3]);
        Ok(())
    }
}
