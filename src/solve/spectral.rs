//! SPG: projected gradient steps whose length is that of the last step, seen through the curvature met there.
//!
//! Problem       min ½‖A x − b‖², l ≤ x ≤ u, any A.
//! Equivalences  Without bounds the Barzilai–Borwein method in the metric of D, long and short steps in turn.
//! Caveats       The objective may rise for some iterations; never above the largest of the last ten. Slow where A is
//!               ill-conditioned and many elements are at their bounds.
//! Convergence   Every limit point is a solution (Birgin, Martínez and Raydan 2000, theorem 2.2).
//! Source        Birgin, Martínez and Raydan 2000, algorithm SPG2; steps: Barzilai and Borwein 1988, eq. 5 and 6 in turn.
//!               The objective is quadratic, so the step along the segment is exact instead of searched for.

use super::iterate::Iterate;
use super::{LeastSquares, Live, Measure, Method, MethodMemory, Vectors, chosen, each, ratio};
use crate::Result;
use crate::operator::{LinearOperator, Scalars, Vector};

/// Objectives that the next one may not exceed the largest of.
const REMEMBERED: usize = 10;
/// Part of the slope that a step must gain.
const SUFFICIENT: f64 = 1e-4;

/// Spectral projected gradient.
#[derive(Debug)]
pub struct Spectral<O: LinearOperator> {
    at: Iterate<O>,
    /// The direction, from x to where the projected gradient step leads.
    d: O::Domain,
    /// What the gradient changes by.
    y: O::Domain,
    z: O::Domain,
    /// A d.
    q: O::Range,
    /// Length of the next projected gradient step.
    alpha: Scalars,
    /// 1 where the step before was a long one, else −1.
    long: Scalars,
    /// ‖r‖² of the last iterations, the newest first.
    objectives: [Scalars; REMEMBERED],
}

impl<O: LinearOperator> Spectral<O> {
    /// The vectors that it keeps.
    pub const VECTORS: Vectors = Vectors { domain: 5, range: 2 };

    /// The method for problems of this operator's shape.
    pub fn new(operator: &O) -> Self {
        Self {
            at: Iterate::new(operator),
            d: operator.domain(),
            y: operator.domain(),
            z: operator.domain(),
            q: operator.range(),
            alpha: [1.0; 3],
            long: [-1.0; 3],
            objectives: [[0.0; 3]; REMEMBERED],
        }
    }

    /// The part of d to go: all of it, or to the least objective along it where all would be too far.
    fn step_length(&self, slope: Scalars, curvature: Scalars) -> Scalars {
        each(|c| {
            let most = self.objectives.iter().map(|objective| objective[c]).fold(0.0, f64::max);
            let full = self.at.measure.residual[c] + 2.0 * slope[c] + curvature[c];
            let best = if curvature[c] > 0.0 { (-slope[c] / curvature[c]).clamp(0.0, 1.0) } else { 1.0 };
            if full > most + 2.0 * SUFFICIENT * slope[c] { best } else { 1.0 }
        })
    }
}

impl<O: LinearOperator> Method<O> for Spectral<O> {
    fn name(&self) -> &'static str {
        "spectral"
    }

    fn keeps_bounds(&self) -> bool {
        true
    }

    fn vectors(&self) -> Vectors {
        Self::VECTORS
    }

    fn begin(&mut self, problem: &LeastSquares<O>, x: &O::Domain) -> Result<()> {
        self.at.begin(problem, x)?;
        self.objectives = [self.at.measure.residual; REMEMBERED];
        self.long = [-1.0; 3];
        self.alpha = [1.0; 3];
        if !problem.is_majorized() {
            let curvature = problem.curvature_along(&self.at.g, &mut self.z, &mut self.q)?;
            self.alpha = curvature.map(|curvature| 1.0 / curvature);
        }
        Ok(())
    }

    fn step(&mut self, problem: &LeastSquares<O>, live: Live) -> Result<()> {
        self.d.copy_from(&self.at.g);
        problem.shrink(&mut self.d);
        self.d.axpby([1.0; 3], &self.at.x, self.alpha.map(|alpha| -alpha));
        self.d.clamp(problem.bounds());
        self.d.axpby(chosen(live).map(|live| -live), &self.at.x, chosen(live));
        problem.apply(&self.d, &mut self.q)?;
        let curvature = self.q.norm_squared()?;
        let step = self.step_length(self.at.g.dot(&self.d)?, curvature);
        self.at.x.axpby(step, &self.d, [1.0; 3]);
        // Rounding may have led out of the box by a digit.
        self.at.x.clamp(problem.bounds());
        self.at.r.axpby(step.map(|step| -step), &self.q, [1.0; 3]);
        self.y.copy_from(&self.at.g);
        problem.gradient(&self.at.r, &mut self.at.g)?;
        self.y.axpby([1.0; 3], &self.at.g, [-1.0; 3]);

        let gained = each(|c| step[c] * curvature[c]);
        self.long = self.long.map(|long| -long);
        let next = if self.long[0] > 0.0 {
            self.z.copy_from(&self.d);
            problem.stretch(&mut self.z);
            let length = self.z.dot(&self.d)?;
            ratio(each(|c| step[c] * length[c]), gained)
        } else {
            self.z.copy_from(&self.y);
            problem.shrink(&mut self.z);
            ratio(each(|c| step[c] * gained[c]), self.z.dot(&self.y)?)
        };
        self.alpha = each(|c| if next[c] > 0.0 && next[c].is_finite() { next[c] } else { self.alpha[c] });
        self.at.take_measure(problem)?;
        self.objectives.rotate_right(1);
        self.objectives[0] = self.at.measure.residual;
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
        let mut scalars = vec![
            &mut self.alpha,
            &mut self.long,
            &mut self.at.measure.residual,
            &mut self.at.measure.normal_residual,
        ];
        scalars.extend(&mut self.objectives);
        MethodMemory { domain: vec![&mut self.at.x, &mut self.at.g], range: vec![&mut self.at.r], scalars }
    }
}
