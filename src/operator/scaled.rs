use super::{LinearOperator, Scalars, Vector};
use crate::Result;

/// α T, with one α a channel.
#[derive(Debug, Clone)]
pub struct Scaled<T> {
    operator: T,
    factor: Scalars,
}

impl<T: LinearOperator> Scaled<T> {
    /// The operator times `factor`.
    pub fn new(operator: T, factor: Scalars) -> Self {
        Self { operator, factor }
    }
}

impl<T: LinearOperator> LinearOperator for Scaled<T> {
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
        y.scale(self.factor);
        Ok(())
    }

    fn apply_adjoint(&self, y: &T::Range, x: &mut T::Domain) -> Result<()> {
        self.operator.apply_adjoint(y, x)?;
        x.scale(self.factor);
        Ok(())
    }
}

/// α on vectors like its prototype, with one α a channel.
#[derive(Debug, Clone)]
pub struct Identity<V> {
    prototype: V,
    factor: Scalars,
}

impl<V: Vector> Identity<V> {
    /// `factor` times the identity on vectors shaped like `prototype`.
    pub fn scaled(prototype: &V, factor: Scalars) -> Self {
        Self { prototype: prototype.zeros_like(), factor }
    }
}

impl<V: Vector> LinearOperator for Identity<V> {
    type Domain = V;
    type Range = V;

    fn domain(&self) -> V {
        self.prototype.zeros_like()
    }

    fn range(&self) -> V {
        self.prototype.zeros_like()
    }

    fn apply(&self, x: &V, y: &mut V) -> Result<()> {
        super::expect_len("x", x, y.len())?;
        y.axpby(self.factor, x, [0.0; 3]);
        Ok(())
    }

    fn apply_adjoint(&self, y: &V, x: &mut V) -> Result<()> {
        self.apply(y, x)
    }
}
