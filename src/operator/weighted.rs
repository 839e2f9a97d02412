use std::sync::Mutex;

use super::{LinearOperator, Vector};
use crate::{Error, Result};

/// W T with W = diag(factors): the rows of an operator, each scaled by its own factor.
///
/// For constraint weights w the factors are √w, so that ‖W (T x − b)‖² = Σ w (T x − b)².
#[derive(Debug)]
pub struct Weighted<T: LinearOperator> {
    operator: T,
    factors: T::Range,
    scratch: Mutex<T::Range>,
}

impl<T: LinearOperator> Weighted<T> {
    /// Errors: [`Error::Shape`] when there is not one factor a row, [`Error::Value`] naming the first that is negative or
    /// not a number.
    pub fn new(operator: T, factors: T::Range) -> Result<Self> {
        super::expect_len("the weights", &factors, operator.range().len())?;
        let allowed = |factor: &f64| *factor >= 0.0 && factor.is_finite();
        for (row, factors) in factors.to_host()?.iter().enumerate() {
            if let Some(factor) = factors.iter().find(|factor| !allowed(factor)) {
                return Err(Error::value(format!("weights[{row}]"), factor, "finite and not negative"));
            }
        }
        let scratch = Mutex::new(factors.zeros_like());
        Ok(Self { operator, factors, scratch })
    }

    /// The operator without weights.
    pub fn inner(&self) -> &T {
        &self.operator
    }

    /// y ← W y: what the right-hand side becomes.
    pub fn weigh(&self, y: &mut T::Range) {
        y.multiply(&self.factors);
    }
}

impl<T: LinearOperator> LinearOperator for Weighted<T> {
    type Domain = T::Domain;
    type Range = T::Range;

    fn domain(&self) -> T::Domain {
        self.operator.domain()
    }

    fn range(&self) -> T::Range {
        self.operator.range()
    }

    fn apply(&self, x: &T::Domain, y: &mut T::Range) -> Result<()> {
        self.operator.apply(x, y)?;
        y.multiply(&self.factors);
        Ok(())
    }

    fn apply_adjoint(&self, y: &T::Range, x: &mut T::Domain) -> Result<()> {
        let mut weighted = super::lock(&self.scratch);
        weighted.copy_from(y);
        weighted.multiply(&self.factors);
        self.operator.apply_adjoint(&weighted, x)
    }
}
