//! Projected L-BFGS: a quasi-Newton step on the elements that are free to move, bent into the bounds.
//!
//! Problem       min ½‖A x − b‖², l ≤ x ≤ u, any A.
//! Equivalences  Without bounds, L-BFGS with an exact line search, which on a quadratic gives the iterates of conjugate
//!               gradients preconditioned by D.
//! Caveats       An element leaves its bound only when the gradient says so; one that reaches a bound in the step shortens it
//!               for all. Where that gives no descent, a projected gradient step is taken and the memory is lost.
//! Convergence   The objective never rises. Two-metric projection converges where elements near a bound are held with it
//!               (Bertsekas 1982, proposition 2); here those at it are, so that is not proven.
//! Source        Nocedal 1980; two metrics: Bertsekas 1982, Kim, Sra and Dhillon 2010.

use super::iterate::Iterate;
use super::{LeastSquares, Live, Measure, Method, MethodMemory, Vectors, chosen, each, ratio};
use crate::Result;
use crate::operator::{LinearOperator, Scalars, Vector};

/// Steps that are remembered.
const REMEMBERED: usize = 5;

/// Projected limited-memory BFGS.
#[derive(Debug)]
pub struct Lbfgs<O: LinearOperator> {
    at: Iterate<O>,
    d: O::Domain,
    w: O::Domain,
    z: O::Domain,
    /// Steps of x, and what the gradient changed by, the newest first.
    steps: Vec<O::Domain>,
    changes: Vec<O::Domain>,
    /// 1 for the steps that a channel remembers.
    known: [Scalars; REMEMBERED],
    /// A d.
    q: O::Range,
    /// Length of a projected gradient step.
    alpha: Scalars,
}

impl<O: LinearOperator> Lbfgs<O> {
    /// The vectors that it keeps.
    pub const VECTORS: Vectors = Vectors { domain: 5 + 2 * REMEMBERED, range: 2 };

    /// The method for problems of this operator's shape.
    pub fn new(operator: &O) -> Self {
        Self {
            at: Iterate::new(operator),
            d: operator.domain(),
            w: operator.domain(),
            z: operator.domain(),
            steps: (0..REMEMBERED).map(|_| operator.domain()).collect(),
            changes: (0..REMEMBERED).map(|_| operator.domain()).collect(),
            known: [[0.0; 3]; REMEMBERED],
            q: operator.range(),
            alpha: [1.0; 3],
        }
    }

    /// d ← H g on the free elements, H the inverse of Aᵀ A as far as it is known: the two loops of L-BFGS.
    fn quasi_newton(&mut self, problem: &LeastSquares<O>) -> Result<()> {
        let bounds = problem.bounds();
        self.d.copy_from(&self.at.g);
        self.d.hold(&self.at.x, &self.at.g, bounds);
        let (mut rho, mut a) = ([[0.0; 3]; REMEMBERED], [[0.0; 3]; REMEMBERED]);
        let mut scale = self.alpha;
        let oldest = self.known.iter().rposition(|known| *known != [0.0; 3]).map_or(0, |last| last + 1);
        for i in 0..oldest {
            self.w.copy_from(&self.changes[i]);
            self.w.hold(&self.at.x, &self.at.g, bounds);
            let curvature = self.w.dot(&self.steps[i])?;
            let along = self.steps[i].dot(&self.d)?;
            let is_known = |c: usize| self.known[i][c] > 0.0 && curvature[c] > 0.0;
            rho[i] = each(|c| if is_known(c) { 1.0 / curvature[c] } else { 0.0 });
            a[i] = each(|c| rho[i][c] * along[c]);
            self.d.axpby(a[i].map(|a| -a), &self.w, [1.0; 3]);
            if i == 0 {
                self.z.copy_from(&self.w);
                problem.shrink(&mut self.z);
                let square = self.z.dot(&self.w)?;
                scale = each(|c| if is_known(c) { curvature[c] / square[c] } else { self.alpha[c] });
            }
        }
        problem.shrink(&mut self.d);
        self.d.scale(scale);
        for i in (0..oldest).rev() {
            let along = self.changes[i].dot(&self.d)?;
            self.d.axpby(each(|c| a[i][c] - rho[i][c] * along[c]), &self.steps[i], [1.0; 3]);
            self.d.hold(&self.at.x, &self.at.g, bounds);
        }
        Ok(())
    }

    /// d ← P(x − d) − x, or P(x − α D⁻¹ g) − x in channels where that does not lead down; gives ⟨g, d⟩.
    fn bend(&mut self, problem: &LeastSquares<O>, live: Live) -> Result<Scalars> {
        self.d.axpby([1.0; 3], &self.at.x, [-1.0; 3]);
        self.d.clamp(problem.bounds());
        self.d.axpby([-1.0; 3], &self.at.x, [1.0; 3]);
        let slope = self.at.g.dot(&self.d)?;
        let fails = slope.map(|slope| slope >= 0.0 || slope.is_nan());
        if fails.contains(&true) {
            self.z.copy_from(&self.at.g);
            problem.descend(&mut self.z, &self.at.x, self.alpha.map(|alpha| 1.0 / alpha));
            self.z.axpby([-1.0; 3], &self.at.x, [1.0; 3]);
            self.d.axpby(chosen(fails), &self.z, chosen(fails.map(|fails| !fails)));
            for known in &mut self.known {
                *known = each(|c| if fails[c] { 0.0 } else { known[c] });
            }
        }
        self.d.axpby([0.0; 3], &self.z, chosen(live));
        self.at.g.dot(&self.d)
    }
}

impl<O: LinearOperator> Method<O> for Lbfgs<O> {
    fn name(&self) -> &'static str {
        "lbfgs"
    }

    fn keeps_bounds(&self) -> bool {
        true
    }

    fn vectors(&self) -> Vectors {
        Self::VECTORS
    }

    fn begin(&mut self, problem: &LeastSquares<O>, x: &O::Domain) -> Result<()> {
        self.at.begin(problem, x)?;
        self.known = [[0.0; 3]; REMEMBERED];
        self.alpha = [1.0; 3];
        if !problem.is_majorized() {
            let curvature = problem.curvature_along(&self.at.g, &mut self.z, &mut self.q)?;
            self.alpha = curvature.map(|curvature| 1.0 / curvature);
        }
        Ok(())
    }

    fn step(&mut self, problem: &LeastSquares<O>, live: Live) -> Result<()> {
        self.quasi_newton(problem)?;
        let slope = self.bend(problem, live)?;
        problem.apply(&self.d, &mut self.q)?;
        let curvature = self.q.norm_squared()?;
        let best = ratio(slope, curvature);
        let step = each(|c| (-best[c]).clamp(0.0, 1.0));
        self.at.x.axpby(step, &self.d, [1.0; 3]);
        // Rounding may have led out of the box by a digit.
        self.at.x.clamp(problem.bounds());
        self.at.r.axpby(step.map(|step| -step), &self.q, [1.0; 3]);

        self.steps.rotate_right(1);
        self.changes.rotate_right(1);
        self.known.rotate_right(1);
        self.steps[0].axpby(step, &self.d, [0.0; 3]);
        self.changes[0].copy_from(&self.at.g);
        problem.gradient(&self.at.r, &mut self.at.g)?;
        self.changes[0].axpby([1.0; 3], &self.at.g, [-1.0; 3]);
        self.known[0] = each(|c| if step[c] > 0.0 && curvature[c] > 0.0 { 1.0 } else { 0.0 });
        self.at.take_measure(problem)?;
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
        let mut domain = vec![&mut self.at.x, &mut self.at.g];
        domain.extend(&mut self.steps);
        domain.extend(&mut self.changes);
        let mut scalars =
            vec![&mut self.alpha, &mut self.at.measure.residual, &mut self.at.measure.normal_residual];
        scalars.extend(&mut self.known);
        MethodMemory { domain, range: vec![&mut self.at.r], scalars }
    }
}
