//! Defect correction: an operator that is cheap and near stands for one that is exact and dear.

use std::cell::{Cell, RefCell, RefMut};

use super::Vectors;
use crate::operator::{LinearOperator, Vector};
use crate::{Error, Result};

/// How an operator A differs from the exact one Â, as far as it was looked at: `d = (Â − A) x̄` and `c = (Â − A)ᵀ r̄` at an x̄ and its
/// residual r̄.
///
/// With both, residual and gradient are exact at x̄: `r = b − A x − d` and `g = −Aᵀ r − c`. They stay affine in x with the curvature of A, so a
/// method steps as it would with A alone. Where it has come to is looked at anew, until both agree there (Hackbusch, *Multi-Grid Methods
/// and Applications*, section 14; Stetter 1978).
///
/// Where that no longer brings much, Â itself is iterated with.
///
/// Cost    one application of each a look, and one of A and of Aᵀ more where a solve goes on from there
pub struct Correction<'a, O: LinearOperator> {
    exact: &'a dyn LinearOperator<Domain = O::Domain, Range = O::Range>,
    defect: RefCell<Defect<O>>,
    /// Whether Â is iterated with, because A brings no more.
    is_exact: Cell<bool>,
}

/// d and c.
pub(super) struct Defect<O: LinearOperator> {
    pub(super) of_rows: O::Range,
    pub(super) of_elements: O::Domain,
}

impl<O: LinearOperator> std::fmt::Debug for Correction<'_, O> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Correction").finish_non_exhaustive()
    }
}

impl<'a, O: LinearOperator> Correction<'a, O> {
    /// The vectors that it keeps.
    pub const VECTORS: Vectors = Vectors { domain: 1, range: 1 };

    /// As if both were alike, until they are looked at.
    pub fn new(exact: &'a dyn LinearOperator<Domain = O::Domain, Range = O::Range>) -> Self {
        let defect = Defect { of_rows: exact.range(), of_elements: exact.domain() };
        Self { exact, defect: RefCell::new(defect), is_exact: Cell::new(false) }
    }

    /// Whether Â is iterated with.
    pub fn is_exact(&self) -> bool {
        self.is_exact.get()
    }

    /// Iterates with Â from now on.
    pub(super) fn give_up(&self) {
        self.is_exact.set(true);
    }

    pub(super) fn exact(&self) -> &dyn LinearOperator<Domain = O::Domain, Range = O::Range> {
        self.exact
    }

    pub(super) fn defect(&self) -> RefMut<'_, Defect<O>> {
        self.defect.borrow_mut()
    }

    /// r ← r − d.
    pub(super) fn correct_residual(&self, r: &mut O::Range) {
        r.axpby([-1.0; 3], &self.defect.borrow().of_rows, [1.0; 3]);
    }

    /// s ← s + c.
    pub(super) fn correct_descent(&self, s: &mut O::Domain) {
        s.axpby([1.0; 3], &self.defect.borrow().of_elements, [1.0; 3]);
    }

    /// The lengths of c and d, which a solve needs beside its method's state to go on, and a number for each channel.
    pub fn outline(&self) -> ([usize; 2], [f64; 3]) {
        let defect = self.defect.borrow();
        let is_exact = f64::from(u8::from(self.is_exact.get()));
        ([defect.of_elements.len(), defect.of_rows.len()], [is_exact; 3])
    }

    /// Gives c and d away, one after the other.
    ///
    /// Errors: those of fetching them from where they are, and of `put`.
    pub fn hand_out(&self, put: &mut dyn FnMut(Vec<[f64; 3]>) -> Result<()>) -> Result<()> {
        let defect = self.defect.borrow();
        put(defect.of_elements.to_host()?)?;
        put(defect.of_rows.to_host()?)
    }

    /// Takes c, d and the numbers as they were handed out.
    ///
    /// Errors: [`Error::Shape`] where they are those of another problem.
    pub fn restore(&self, vectors: &[Vec<[f64; 3]>], numbers: &[f64]) -> Result<()> {
        let [of_elements, of_rows] = vectors else {
            return Err(Error::Shape {
                what: "a saved correction (vectors)",
                expected: 2,
                got: vectors.len(),
            });
        };
        self.is_exact.set(numbers.first().is_some_and(|&is_exact| is_exact > 0.0));
        let mut defect = self.defect.borrow_mut();
        defect.of_elements.set_from_host(of_elements)?;
        defect.of_rows.set_from_host(of_rows)
    }
}
