use std::cell::Cell;

use super::correction::{Correction, Defect};
use crate::Result;
use crate::operator::{Bounds, LinearOperator, Metric, PendingSum, Scalars, Vector, expect_len};

/// ‖A x − b‖ of other rows, at an x.
pub type Misfit<'a, V> = &'a dyn Fn(&V) -> Result<f64>;

/// `min ½‖A x − b‖², l ≤ x ≤ u`, channel by channel; it counts how often its operator is applied.
pub struct LeastSquares<'a, O: LinearOperator> {
    /// A: the weighted transport stacked on its regularizers.
    operator: &'a O,
    /// b: the weighted targets stacked on what the regularizers pull to.
    rhs: &'a O::Range,
    bounds: Bounds,
    metric: Option<&'a dyn Metric<O::Domain>>,
    held_out: Option<Misfit<'a, O::Domain>>,
    correction: Option<&'a Correction<'a, O>>,
    applications: Cell<usize>,
}

impl<O: LinearOperator> std::fmt::Debug for LeastSquares<'_, O> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LeastSquares").field("bounds", &self.bounds).finish_non_exhaustive()
    }
}

impl<'a, O: LinearOperator> LeastSquares<'a, O> {
    /// Without bounds and metric.
    pub fn new(operator: &'a O, rhs: &'a O::Range) -> Self {
        Self {
            operator,
            rhs,
            bounds: Bounds::NONE,
            metric: None,
            held_out: None,
            correction: None,
            applications: Cell::new(0),
        }
    }

    /// With bounds, for the methods that keep them; the others solve the problem without.
    pub fn bounded(self, bounds: Bounds) -> Self {
        Self { bounds, ..self }
    }

    /// With a metric, for the methods that use one. All but [`super::Fista`] and [`super::Cgls`] take it to be diagonal.
    pub fn measured(self, metric: &'a dyn Metric<O::Domain>) -> Self {
        Self { metric: Some(metric), ..self }
    }

    /// With rows that are kept out of the fit: a solve ends where it brings them no nearer any more.
    pub fn holding_out(self, misfit: Misfit<'a, O::Domain>) -> Self {
        Self { held_out: Some(misfit), ..self }
    }

    /// With what makes residuals and gradients those of an exact operator, where they are looked at.
    pub fn corrected(self, correction: &'a Correction<'a, O>) -> Self {
        Self { correction: Some(correction), ..self }
    }

    /// Whether the operator is only near an exact one.
    pub(super) fn is_corrected(&self) -> bool {
        self.correction().is_some()
    }

    /// The correction, while it is in use.
    fn correction(&self) -> Option<&'a Correction<'a, O>> {
        self.correction.filter(|correction| !correction.is_exact())
    }

    /// Takes the exact operator from now on, where another one was iterated with. False where it was not.
    pub(super) fn give_up_correcting(&self) -> bool {
        self.correction().inspect(|correction| correction.give_up()).is_some()
    }

    /// The residual `r = b − Â x` and the gradient `g = −Âᵀ r` of the exact operator.
    pub(super) fn truth_at(&self, x: &O::Domain, r: &mut O::Range, g: &mut O::Domain) -> Result<()> {
        let Some(correction) = self.correction() else {
            self.residual(x, r)?;
            return self.gradient(r, g);
        };
        self.applications.set(self.applications.get() + 2);
        correction.exact().apply(x, r)?;
        r.axpby([1.0; 3], self.rhs, [-1.0; 3]);
        correction.exact().apply_adjoint(r, g)?;
        g.scale([-1.0; 3]);
        Ok(())
    }

    /// Makes residual and gradient at x what they truly are there: [`Self::truth_at`] has told.
    pub(super) fn correct(&self, x: &O::Domain, (r, g): (&O::Range, &O::Domain)) -> Result<()> {
        let Some(correction) = self.correction() else { return Ok(()) };
        let Defect { of_rows, of_elements } = &mut *correction.defect();
        // Â x is b − r, and Âᵀ r is −g.
        self.apply(x, of_rows)?;
        of_rows.axpby([1.0; 3], self.rhs, [-1.0; 3]);
        of_rows.axpby([-1.0; 3], r, [1.0; 3]);
        self.apply_adjoint(r, of_elements)?;
        of_elements.axpby([-1.0; 3], g, [-1.0; 3]);
        Ok(())
    }

    /// ‖A x − b‖ of the rows that are kept out of the fit; none where there are none.
    pub(super) fn held_out(&self, x: &O::Domain) -> Result<Option<f64>> {
        self.held_out.map(|misfit| misfit(x)).transpose()
    }

    /// Errors: [`crate::Error::Shape`] when the right-hand side does not fit the operator.
    pub(super) fn check(&self) -> Result<()> {
        expect_len("the right-hand side", self.rhs, self.operator.range().len())
    }

    /// A.
    pub fn operator(&self) -> &O {
        self.operator
    }

    /// b.
    pub fn rhs(&self) -> &O::Range {
        self.rhs
    }

    /// l and u.
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// Applications of A and of Aᵀ so far, each counted as one.
    pub fn applications(&self) -> usize {
        self.applications.get()
    }

    /// y ← A x.
    ///
    /// Errors: those of the operator, [`Error::Shape`](crate::Error::Shape) for vectors that do not fit among them.
    pub fn apply(&self, x: &O::Domain, y: &mut O::Range) -> Result<()> {
        self.applications.set(self.applications.get() + 1);
        match self.correction.filter(|correction| correction.is_exact()) {
            Some(correction) => correction.exact().apply(x, y),
            None => self.operator.apply(x, y),
        }
    }

    /// x ← Aᵀ y.
    ///
    /// Errors: those of the operator, [`Error::Shape`](crate::Error::Shape) for vectors that do not fit among them.
    pub fn apply_adjoint(&self, y: &O::Range, x: &mut O::Domain) -> Result<()> {
        self.applications.set(self.applications.get() + 1);
        match self.correction.filter(|correction| correction.is_exact()) {
            Some(correction) => correction.exact().apply_adjoint(y, x),
            None => self.operator.apply_adjoint(y, x),
        }
    }

    /// r ← b − A x.
    ///
    /// Errors: those of the operator, [`Error::Shape`](crate::Error::Shape) for vectors that do not fit among them.
    pub fn residual(&self, x: &O::Domain, r: &mut O::Range) -> Result<()> {
        self.apply(x, r)?;
        r.axpby([1.0; 3], self.rhs, [-1.0; 3]);
        if let Some(correction) = self.correction() {
            correction.correct_residual(r);
        }
        Ok(())
    }

    /// g ← Aᵀ (A x − b), given r = b − A x.
    ///
    /// Errors: those of the operator, [`Error::Shape`](crate::Error::Shape) for vectors that do not fit among them.
    pub fn gradient(&self, r: &O::Range, g: &mut O::Domain) -> Result<()> {
        self.descent(r, g)?;
        g.scale([-1.0; 3]);
        Ok(())
    }

    /// s ← Aᵀ (b − A x), given r = b − A x.
    ///
    /// Errors: as [`Self::gradient`].
    pub fn descent(&self, r: &O::Range, s: &mut O::Domain) -> Result<()> {
        self.apply_adjoint(r, s)?;
        if let Some(correction) = self.correction() {
            correction.correct_descent(s);
        }
        Ok(())
    }

    /// v ← M⁻¹ v.
    pub fn shrink(&self, v: &mut O::Domain) {
        if let Some(metric) = self.metric {
            metric.shrink(v);
        }
    }

    /// v ← M v.
    pub fn stretch(&self, v: &mut O::Domain) {
        if let Some(metric) = self.metric {
            metric.stretch(v);
        }
    }

    /// x ← where the projected step from y leads, given the gradient there in x: [`Metric::descend`].
    pub fn descend(&self, x: &mut O::Domain, y: &O::Domain, norm: Scalars) {
        match self.metric {
            Some(metric) => metric.descend(x, y, norm, &self.bounds),
            None => {
                x.axpby([1.0; 3], y, norm.map(|norm| -1.0 / norm));
                x.clamp(&self.bounds);
            }
        }
    }

    /// ‖A z‖² / zᵀ M z for z = M⁻¹ g: how strongly the problem curves down the gradient; 1 where g is zero.
    ///
    /// `z` and `image` are overwritten.
    pub(super) fn curvature_along(
        &self,
        g: &O::Domain,
        z: &mut O::Domain,
        image: &mut O::Range,
    ) -> Result<Scalars> {
        z.copy_from(g);
        self.shrink(z);
        self.apply(z, image)?;
        let (curvature, length) = (image.dot_later(image)?, z.dot_later(g)?);
        let (curvature, length) = (curvature.value()?, length.value()?);
        Ok(std::array::from_fn(|c| if curvature[c] > 0.0 { curvature[c] / length[c] } else { 1.0 }))
    }

    /// Whether ‖A x‖² ≤ xᵀ M x is known.
    pub fn is_majorized(&self) -> bool {
        // The metric is that of the operator that is iterated with at first.
        self.correction.is_none_or(|it| !it.is_exact()) && self.metric.is_some_and(Metric::majorizes)
    }
}
