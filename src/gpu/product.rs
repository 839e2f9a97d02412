use std::cell::RefCell;

use super::rows::Kept;
use super::vector::GpuVector;
use crate::operator::{LinearOperator, Vector};
use crate::{Error, Result};

/// G V + D of rows that are kept on a device: an application takes as much as their non-zeros do.
///
/// Shapes  x: columns of V and D, y: rows of G and D, three channels each
/// Cost    one multiplication a non-zero and channel; bit-identical in every run
#[derive(Debug)]
pub struct Product {
    g: Kept,
    v: Kept,
    d: Kept,
    /// Between V and G, and what D gives, in both directions.
    room: RefCell<[GpuVector; 3]>,
}

impl Product {
    /// Errors: [`Error::Shape`] when the factors do not fit together.
    pub fn new(g: Kept, v: Kept, d: Kept) -> Result<Self> {
        let same = |what, expected: usize, got: usize| {
            if expected == got { Ok(()) } else { Err(Error::Shape { what, expected, got }) }
        };
        same("the inner rows", g.domain().len(), v.range().len())?;
        same("the added rows", g.range().len(), d.range().len())?;
        same("the added columns", v.domain().len(), d.domain().len())?;
        let room = RefCell::new([v.range(), d.range(), d.domain()]);
        Ok(Self { g, v, d, room })
    }

    /// The number of non-zeros of all factors.
    pub fn nonzeros(&self) -> usize {
        self.g.nonzeros() + self.v.nonzeros() + self.d.nonzeros()
    }
}

impl LinearOperator for Product {
    type Domain = GpuVector;
    type Range = GpuVector;

    fn domain(&self) -> GpuVector {
        self.d.domain()
    }

    fn range(&self) -> GpuVector {
        self.d.range()
    }

    fn apply(&self, x: &GpuVector, y: &mut GpuVector) -> Result<()> {
        let [inner, rows, _] = &mut *self.room.borrow_mut();
        self.v.apply(x, inner)?;
        self.g.apply(inner, y)?;
        self.d.apply(x, rows)?;
        y.axpby([1.0; 3], rows, [1.0; 3]);
        Ok(())
    }

    fn apply_adjoint(&self, y: &GpuVector, x: &mut GpuVector) -> Result<()> {
        let [inner, _, columns] = &mut *self.room.borrow_mut();
        self.g.apply_adjoint(y, inner)?;
        self.v.apply_adjoint(inner, x)?;
        self.d.apply_adjoint(y, columns)?;
        x.axpby([1.0; 3], columns, [1.0; 3]);
        Ok(())
    }
}
