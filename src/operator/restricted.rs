use std::sync::{Arc, Mutex};

use super::{Indexed, LinearOperator, Vector};
use crate::{Error, Result};

/// T E: the columns of an operator that are unknown, the others left out.
///
/// Solvers see vectors of the unknown elements only; one full vector is kept here to talk to `T`.
#[derive(Debug)]
pub struct Restricted<T: LinearOperator<Domain: Indexed>> {
    operator: T,
    columns: Arc<[u32]>,
    index: <T::Domain as Indexed>::Index,
    full: Mutex<T::Domain>,
}

impl<T: LinearOperator<Domain: Indexed>> Restricted<T> {
    /// The columns named by `columns`, in that order.
    ///
    /// Errors: [`Error::Value`] for an index that is not a column or does not increase.
    pub fn new(operator: T, columns: impl Into<Arc<[u32]>>) -> Result<Self> {
        let columns = columns.into();
        let full = operator.domain();
        let increasing = columns.windows(2).all(|pair| pair[0] < pair[1]);
        if !increasing || columns.last().is_some_and(|&last| last as usize >= full.len()) {
            return Err(Error::value("columns", columns.len(), "increasing indices of columns"));
        }
        let index = full.index(&columns)?;
        Ok(Self { operator, columns, index, full: Mutex::new(full) })
    }

    /// The operator with all its columns.
    pub fn inner(&self) -> &T {
        &self.operator
    }

    /// The unknown columns.
    pub fn columns(&self) -> &[u32] {
        &self.columns
    }

    /// The unknown elements of a full vector.
    pub fn pick(&self, full: &T::Domain) -> T::Domain {
        let mut picked = self.domain();
        picked.pick(full, &self.index);
        picked
    }
}

impl<T: LinearOperator<Domain: Indexed>> LinearOperator for Restricted<T> {
    type Domain = T::Domain;
    type Range = T::Range;

    fn domain(&self) -> T::Domain {
        super::lock(&self.full).zeros(self.columns.len())
    }

    fn range(&self) -> T::Range {
        self.operator.range()
    }

    fn apply(&self, x: &T::Domain, y: &mut T::Range) -> Result<()> {
        super::expect_len("x", x, self.columns.len())?;
        let mut full = super::lock(&self.full);
        full.place(x, &self.index);
        self.operator.apply(&full, y)
    }

    fn apply_adjoint(&self, y: &T::Range, x: &mut T::Domain) -> Result<()> {
        super::expect_len("x", x, self.columns.len())?;
        let mut full = super::lock(&self.full);
        self.operator.apply_adjoint(y, &mut full)?;
        x.pick(&full, &self.index);
        Ok(())
    }
}
