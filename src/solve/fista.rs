//! FISTA with restart: projected gradient steps from a point ahead of the iterate.
//!
//! Problem       min ½‖A x − b‖², l ≤ x ≤ u, any A.
//! Equivalences  With A = I one step. Without momentum, the projected Landweber iteration; with D = Aᵀ A 1, SIRT.
//! Caveats       Neither the objective nor the projected gradient falls monotonically; a restart follows each rise along
//!               the step. Both are computed and not recurred, so rounding does not add up.
//!               Without a majorizing scaling its step length is found on the way, and a step may be taken again.
//! Convergence   Objective within O(1/k²) of the least one, linear once the free elements no longer change.
//! Source        Beck and Teboulle 2009; restart: O'Donoghue and Candès 2015, sec. 3.2 (gradient scheme); diagonal metric:
//!               Kim, Ramani and Fessler 2015.
//!
//! The gradient is affine in x. So that of the point ahead, y = x + m (x − x₋), is g + m (g − g₋), and two
//! applications an iteration give r, g and the KKT residual of the iterate itself.

use super::iterate::Iterate;
use super::{LeastSquares, Live, Measure, Method, MethodMemory, Vectors, chosen, each};
use crate::Result;
use crate::operator::{LinearOperator, PendingSum, Scalars, Vector};

/// By how much ‖A d‖² may exceed its bound through rounding.
const ROUNDING: f64 = 1e-3;

/// Projected accelerated gradient.
#[derive(Debug)]
pub struct Fista<O: LinearOperator> {
    at: Iterate<O>,
    /// x one iteration ago; in a step the point ahead, y.
    x_before: O::Domain,
    /// g one iteration ago; in a step the gradient at y.
    g_before: O::Domain,
    /// Where the step leads.
    next: O::Domain,
    g_next: O::Domain,
    /// ‖A d‖² ≤ `norm` dᵀ D d.
    norm: Scalars,
    /// The t of the momentum; 1 is none.
    t: Scalars,
}

impl<O: LinearOperator> Fista<O> {
    /// The vectors that it keeps.
    pub const VECTORS: Vectors = Vectors { domain: 6, range: 1 };

    /// The method for problems of this operator's shape.
    pub fn new(operator: &O) -> Self {
        Self {
            at: Iterate::new(operator),
            x_before: operator.domain(),
            g_before: operator.domain(),
            next: operator.domain(),
            g_next: operator.domain(),
            norm: [1.0; 3],
            t: [1.0; 3],
        }
    }

    /// x₊ and its gradient from y and the gradient there, which are in `x_before` and `g_before`.
    fn project(&mut self, problem: &LeastSquares<O>, live: Live) -> Result<()> {
        self.next.copy_from(&self.g_before);
        problem.descend(&mut self.next, &self.x_before, self.norm);
        if live != [true; 3] {
            self.next.axpby(chosen(live.map(|live| !live)), &self.at.x, chosen(live));
        }
        problem.residual(&self.next, &mut self.at.r)?;
        problem.gradient(&self.at.r, &mut self.g_next)
    }
}

impl<O: LinearOperator> Method<O> for Fista<O> {
    fn name(&self) -> &'static str {
        "fista"
    }

    fn keeps_bounds(&self) -> bool {
        true
    }

    fn vectors(&self) -> Vectors {
        Self::VECTORS
    }

    fn begin(&mut self, problem: &LeastSquares<O>, x: &O::Domain) -> Result<()> {
        self.at.begin(problem, x)?;
        self.t = [1.0; 3];
        self.norm = [1.0; 3];
        if !problem.is_majorized() {
            self.norm = problem.curvature_along(&self.at.g, &mut self.next, &mut self.at.r)?;
            problem.residual(&self.at.x, &mut self.at.r)?;
        }
        Ok(())
    }

    fn step(&mut self, problem: &LeastSquares<O>, live: Live) -> Result<()> {
        let t = self.t.map(|t| (1.0 + (1.0 + 4.0 * t * t).sqrt()) / 2.0);
        let ahead = each(|c| if self.t[c] > 1.0 { (self.t[c] - 1.0) / t[c] } else { 0.0 });
        self.x_before.extrapolate(&self.at.x, ahead);
        self.g_before.extrapolate(&self.at.g, ahead);
        self.project(problem, live)?;

        // d = y − x₊ takes the place of y, D d that of the gradient at y.
        self.x_before.axpby([-1.0; 3], &self.next, [1.0; 3]);
        let along = match problem.is_majorized() {
            true => None,
            false => Some([self.g_before.dot_later(&self.x_before)?, self.g_next.dot_later(&self.x_before)?]),
        };
        self.g_before.copy_from(&self.x_before);
        problem.stretch(&mut self.g_before);
        if let Some([before, after]) = along {
            let length = self.g_before.dot(&self.x_before)?;
            let (before, after) = (before.value()?, after.value()?);
            let curvature = each(|c| before[c] - after[c]);
            let too_long: Live = std::array::from_fn(|c| {
                live[c] && curvature[c] > (1.0 + ROUNDING) * self.norm[c] * length[c] && length[c] > 0.0
            });
            if too_long.contains(&true) {
                for c in (0..3).filter(|&c| too_long[c]) {
                    self.norm[c] = curvature[c] / length[c];
                }
                // Once more, from x and without momentum.
                self.t = [1.0; 3];
                return self.step(problem, live);
            }
        }
        let (forth, back) = (self.g_before.dot_later(&self.next)?, self.g_before.dot_later(&self.at.x)?);
        let before = self.at.measure.residual;

        std::mem::swap(&mut self.at.x, &mut self.x_before);
        std::mem::swap(&mut self.at.x, &mut self.next);
        std::mem::swap(&mut self.at.g, &mut self.g_before);
        std::mem::swap(&mut self.at.g, &mut self.g_next);
        self.at.take_measure(problem)?;
        let (forth, back) = (forth.value()?, back.value()?);
        let objective = self.at.measure.residual;
        let rounding = 1.0 + 8.0 * self.at.x.epsilon();
        let turns = |c: usize| forth[c] > back[c] || objective[c] > rounding * before[c];
        self.t = each(|c| if turns(c) { 1.0 } else { t[c] });
        Ok(())
    }

    fn solution(&self) -> &O::Domain {
        &self.at.x
    }

    fn measure(&self) -> Measure {
        self.at.measure
    }

    fn residual(&self) -> Option<&O::Range> {
        Some(&self.at.r)
    }

    fn memory(&mut self) -> MethodMemory<'_, O> {
        MethodMemory {
            domain: vec![&mut self.at.x, &mut self.x_before, &mut self.at.g, &mut self.g_before],
            range: vec![&mut self.at.r],
            scalars: vec![
                &mut self.norm,
                &mut self.t,
                &mut self.at.measure.residual,
                &mut self.at.measure.normal_residual,
            ],
        }
    }
}
