use std::sync::{Arc, Mutex, PoisonError};

use super::{LinearOperator, Vector};
use crate::{Error, Result};

/// G V + D, applied factor by factor.
///
/// Error   the factors' own; what is between them is rounded as their vectors are
/// Cost    that of the factors
#[derive(Debug)]
pub struct Product<G: LinearOperator, V: LinearOperator, D> {
    g: G,
    v: V,
    d: D,
    /// Between V and G, and what D gives, in both directions.
    room: Mutex<(V::Range, G::Range, V::Domain)>,
}

impl<G, V, D> Product<G, V, D>
where
    G: LinearOperator,
    V: LinearOperator<Range = G::Domain>,
    D: LinearOperator<Domain = V::Domain, Range = G::Range>,
{
    /// Errors: [`Error::Shape`] when the factors do not fit together.
    pub fn new(g: G, v: V, d: D) -> Result<Self> {
        let same = |what, expected: usize, got: usize| {
            if expected == got { Ok(()) } else { Err(Error::Shape { what, expected, got }) }
        };
        same("the inner rows", g.domain().len(), v.range().len())?;
        same("the added rows", g.range().len(), d.range().len())?;
        same("the added columns", v.domain().len(), d.domain().len())?;
        let room = Mutex::new((v.range(), d.range(), d.domain()));
        Ok(Self { g, v, d, room })
    }

    /// G, V and D.
    pub fn factors(&self) -> (&G, &V, &D) {
        (&self.g, &self.v, &self.d)
    }
}

impl<G, V, D> LinearOperator for Product<G, V, D>
where
    G: LinearOperator,
    V: LinearOperator<Range = G::Domain>,
    D: LinearOperator<Domain = V::Domain, Range = G::Range>,
{
    type Domain = V::Domain;
    type Range = G::Range;

    fn domain(&self) -> V::Domain {
        self.v.domain()
    }

    fn range(&self) -> G::Range {
        self.g.range()
    }

    fn apply(&self, x: &V::Domain, y: &mut G::Range) -> Result<()> {
        // A panic of another thread leaves numbers that are overwritten before they are read.
        let (inner, rows, _) = &mut *self.room.lock().unwrap_or_else(PoisonError::into_inner);
        self.v.apply(x, inner)?;
        self.g.apply(inner, y)?;
        self.d.apply(x, rows)?;
        y.axpby([1.0; 3], rows, [1.0; 3]);
        Ok(())
    }

    fn apply_adjoint(&self, y: &G::Range, x: &mut V::Domain) -> Result<()> {
        let (inner, _, columns) = &mut *self.room.lock().unwrap_or_else(PoisonError::into_inner);
        self.g.apply_adjoint(y, inner)?;
        self.v.apply_adjoint(inner, x)?;
        self.d.apply_adjoint(y, columns)?;
        x.axpby([1.0; 3], columns, [1.0; 3]);
        Ok(())
    }
}

/// An operator that is shared.
impl<O: LinearOperator> LinearOperator for Arc<O> {
    type Domain = O::Domain;
    type Range = O::Range;

    fn domain(&self) -> O::Domain {
        (**self).domain()
    }

    fn range(&self) -> O::Range {
        (**self).range()
    }

    fn apply(&self, x: &O::Domain, y: &mut O::Range) -> Result<()> {
        (**self).apply(x, y)
    }

    fn apply_adjoint(&self, y: &O::Range, x: &mut O::Domain) -> Result<()> {
        (**self).apply_adjoint(y, x)
    }
}
