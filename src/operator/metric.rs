use super::{Bounds, Scalars, Vector};

/// A symmetric positive definite M, which lengths of steps are measured in: ‖x‖² = xᵀ M x.
///
/// The nearer M is to Aᵀ A, the fewer iterations a method takes.
pub trait Metric<V>: Send + Sync {
    /// v ← M v.
    fn stretch(&self, v: &mut V);

    /// v ← M⁻¹ v, or S⁻¹ v for an S ⪰ M that is easier to invert: symmetric, and the same S every time.
    fn shrink(&self, v: &mut V);

    /// x ← a point within bounds at which ⟨g, x − y⟩ + ½ norm ‖x − y‖² is least, or at any rate smaller than at y. On entry x holds
    /// g.
    fn descend(&self, x: &mut V, y: &V, norm: Scalars, bounds: &Bounds);

    /// Whether xᵀ M x ≥ ‖A x‖² is known for all x.
    fn majorizes(&self) -> bool;
}

/// A diagonal metric. Bounds of an element stay bounds of that element.
#[derive(Debug, Clone)]
pub struct Scaling<V> {
    diagonal: V,
    inverse: V,
    majorizes: bool,
}

impl<V: Vector> Scaling<V> {
    /// A scaling; elements where it is zero are not moved. `majorizes` promises xᵀ D x ≥ ‖A x‖² for all x, as is true of
    /// D = |A|ᵀ |A| 1, the separable quadratic surrogate (De Pierro 1995; Erdoğan and Fessler 1999).
    pub fn new(diagonal: V, majorizes: bool) -> Self {
        let mut inverse = diagonal.zeros_like();
        inverse.copy_from(&diagonal);
        inverse.invert();
        Self { diagonal, inverse, majorizes }
    }
}

impl<V: Vector> Metric<V> for Scaling<V> {
    fn stretch(&self, v: &mut V) {
        v.multiply(&self.diagonal);
    }

    fn shrink(&self, v: &mut V) {
        v.multiply(&self.inverse);
    }

    fn descend(&self, x: &mut V, y: &V, norm: Scalars, bounds: &Bounds) {
        x.step_within(norm.map(|norm| -1.0 / norm), &self.inverse, y, bounds);
    }

    fn majorizes(&self) -> bool {
        self.majorizes
    }
}
