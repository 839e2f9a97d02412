use super::Transport;
use crate::Result;
use crate::march::{Real, Traversal, Weight};
use crate::operator::{CpuVector, LinearOperator, MatrixRows, Storage, Vector, WalkPlan, expect_len};
use crate::scene::Strategy;

/// `T` of rows of which most have one weight for all channels, and some one a channel.
///
/// Cost    that of its two parts, and one addition an element
#[derive(Debug)]
pub struct Mixed<T, F> {
    parts: Box<Parts<T, F>>,
    /// Which rows are grey, in increasing order.
    grey_rows: Vec<usize>,
    /// Which are not.
    colored_rows: Vec<usize>,
}

#[derive(Debug)]
struct Parts<T, F> {
    grey: Transport<T, F, 1>,
    colored: Transport<T, F, 3>,
}

impl<T: Traversal<f64, 1> + Traversal<f64, 3>, F: Real> Mixed<T, F> {
    /// Keeps as many rows as `strategy` and the `budget` in bytes ask for, grey ones first. `colored_rows` says in increasing order which
    /// of all rows those of `colored` are; between them are those of `grey`.
    ///
    /// Errors: [`crate::Error::TooLarge`] when all rows must be kept and do not fit.
    pub fn new(
        [grey, colored]: [T; 2],
        colored_rows: &[usize],
        strategy: Strategy,
        budget: u64,
    ) -> Result<Self> {
        let colored_rows = colored_rows.to_vec();
        let rows = Traversal::<f64, 1>::rows(&grey) + colored_rows.len();
        let grey_rows = (0..rows).filter(|row| colored_rows.binary_search(row).is_err()).collect();
        let plans = [WalkPlan::new::<1>(&grey), WalkPlan::new::<3>(&colored)];
        let grey = Transport::new(grey, &plans[0], strategy, budget)?;
        let left = budget.saturating_sub(grey.storage().bytes);
        let colored = Transport::new(colored, &plans[1], strategy, left)?;
        Ok(Self { parts: Box::new(Parts { grey, colored }), grey_rows, colored_rows })
    }

    /// What is kept.
    pub fn storage(&self) -> Storage {
        let [grey, colored] = [self.parts.grey.storage(), self.parts.colored.storage()];
        Storage {
            kept_rows: grey.kept_rows + colored.kept_rows,
            walked_rows: grey.walked_rows + colored.walked_rows,
            kept_nonzeros: grey.kept_nonzeros + colored.kept_nonzeros,
            bytes: grey.bytes + colored.bytes,
            ..grey
        }
    }

    /// diag(Tᵀ diag(y) T).
    ///
    /// Errors: [`crate::Error::Shape`] when there is not one weight a row.
    pub fn squares(&self, y: &CpuVector<F>) -> Result<CpuVector<F>> {
        expect_len("the weights", y, self.rows())?;
        let mut x = self.parts.grey.squares(&of(y, &self.grey_rows))?;
        x.axpby([1.0; 3], &self.parts.colored.squares(&of(y, &self.colored_rows))?, [1.0; 3]);
        Ok(x)
    }

    fn rows(&self) -> usize {
        self.grey_rows.len() + self.colored_rows.len()
    }
}

/// Some elements of a vector.
fn of<F: Real>(y: &CpuVector<F>, rows: &[usize]) -> CpuVector<F> {
    CpuVector(rows.iter().map(|&row| y.0[row]).collect())
}

impl<T: Traversal<f64, 1> + Traversal<f64, 3>, F: Real> MatrixRows<F, 3> for Mixed<T, F> {
    fn rows(&self) -> usize {
        self.rows()
    }

    fn visit(&self, row: usize, visit: &mut impl FnMut(usize, Weight<F, 3>)) {
        match self.colored_rows.binary_search(&row) {
            Ok(colored) => self.parts.colored.visit(colored, visit),
            // So many rows before it are colored.
            Err(before) => {
                self.parts.grey.visit(row - before, &mut |element, [weight]| visit(element, [weight; 3]));
            }
        }
    }
}

impl<T: Traversal<f64, 1> + Traversal<f64, 3>, F: Real> LinearOperator for Mixed<T, F> {
    type Domain = CpuVector<F>;
    type Range = CpuVector<F>;

    fn domain(&self) -> CpuVector<F> {
        self.parts.grey.domain()
    }

    fn range(&self) -> CpuVector<F> {
        CpuVector::zeros(self.rows())
    }

    fn apply(&self, x: &CpuVector<F>, y: &mut CpuVector<F>) -> Result<()> {
        expect_len("y", y, self.rows())?;
        let (mut grey, mut colored) = (self.parts.grey.range(), self.parts.colored.range());
        self.parts.grey.apply(x, &mut grey)?;
        self.parts.colored.apply(x, &mut colored)?;
        self.grey_rows.iter().zip(&grey.0).for_each(|(&row, value)| y.0[row] = *value);
        self.colored_rows.iter().zip(&colored.0).for_each(|(&row, value)| y.0[row] = *value);
        Ok(())
    }

    fn apply_adjoint(&self, y: &CpuVector<F>, x: &mut CpuVector<F>) -> Result<()> {
        expect_len("y", y, self.rows())?;
        let mut colored = self.parts.colored.domain();
        self.parts.grey.apply_adjoint(&of(y, &self.grey_rows), x)?;
        self.parts.colored.apply_adjoint(&of(y, &self.colored_rows), &mut colored)?;
        x.axpby([1.0; 3], &colored, [1.0; 3]);
        Ok(())
    }
}
