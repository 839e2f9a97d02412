//! MPRGP: conjugate gradients on a face of the box, projected gradient steps to a larger face, and steps off the bounds.
//!
//! Problem       min ½‖A x − b‖², l ≤ x ≤ u.
//! Equivalences  Without bounds, or once the face no longer changes, CGLS in the metric of D.
//! Caveats       Every change of face costs an iteration and the conjugacy, so it is slow while there are many.
//!               The expansion step is taken in an iteration of its own, after the shortened conjugate step.
//! Convergence   Linear from the start, at a rate that depends on the spectrum alone; finite where the solution is not
//!               degenerate (Dostál and Schöberl 2005, theorems 4 and 5).
//! Source        Dostál 2009, *Optimal Quadratic Programming Algorithms*, algorithm 5.8 with Γ = 1.

use super::iterate::Iterate;
use super::{LeastSquares, Live, Measure, Method, MethodMemory, Vectors, chosen, ratio};
use crate::operator::{LinearOperator, Scalars, Vector};
use crate::{Error, Result};

/// The fixed step of an expansion, in parts of 1 / ‖D⁻¹ Aᵀ A‖; below 2.
const EXPANSION: f64 = 1.9;

/// Modified proportioning with reduced gradient projections.
#[derive(Debug)]
pub struct Mprgp<O: LinearOperator> {
    at: Iterate<O>,
    /// The direction of the step, and of the next conjugate one.
    p: O::Domain,
    /// The free gradient: g where x is inside.
    phi: O::Domain,
    z: O::Domain,
    /// A p.
    q: O::Range,
    /// ⟨φ, D⁻¹ φ⟩ where the last conjugate step began; 0 when the next one is the first.
    gamma: Scalars,
    /// 1 where the last step ended at a bound.
    met_bound: Scalars,
    /// ‖A d‖² ≤ `norm` dᵀ D d for every d met so far.
    norm: Scalars,
}

/// What a channel does in an iteration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum StepKind {
    Rest,
    Conjugate,
    Expansion,
    Proportioning,
}

impl<O: LinearOperator> Mprgp<O> {
    /// The vectors that it keeps.
    pub const VECTORS: Vectors = Vectors { domain: 5, range: 2 };

    /// The method for problems of this operator's shape.
    pub fn new(operator: &O) -> Self {
        Self {
            at: Iterate::new(operator),
            p: operator.domain(),
            phi: operator.domain(),
            z: operator.domain(),
            q: operator.range(),
            gamma: [0.0; 3],
            met_bound: [0.0; 3],
            norm: [1.0; 3],
        }
    }

    /// φ and D⁻¹ φ; gives ⟨φ, D⁻¹ φ⟩.
    fn free_gradient(&mut self, problem: &LeastSquares<O>) -> Result<Scalars> {
        self.phi.copy_from(&self.at.g);
        self.phi.hold_at_bounds(&self.at.x, problem.bounds());
        self.z.copy_from(&self.phi);
        problem.shrink(&mut self.z);
        self.phi.dot(&self.z)
    }

    /// d = P(x − step D⁻¹ φ) − x, given D⁻¹ φ in `z`; it is left in `z`.
    fn projected_step(&mut self, problem: &LeastSquares<O>) {
        self.z.axpby([1.0; 3], &self.at.x, self.norm.map(|norm| -EXPANSION / norm));
        self.z.clamp(problem.bounds());
        self.z.axpby([-1.0; 3], &self.at.x, [1.0; 3]);
    }

    /// Chooses for every channel what to do, and composes the directions in `p`.
    fn choose(&mut self, problem: &LeastSquares<O>, live: Live) -> Result<[StepKind; 3]> {
        let gamma = self.free_gradient(problem)?;
        let beta = ratio(gamma, self.gamma);
        self.p.axpby([-1.0; 3], &self.z, beta);
        self.gamma = gamma;
        // The expansion, and how much of the free gradient it can use: ⟨φ̃, φ⟩.
        self.projected_step(problem);
        let used = self.z.dot(&self.phi)?;
        let expands = self.met_bound.map(|met| met > 0.0);
        let others = |replaced: Live| chosen(replaced.map(|replaced| !replaced));
        self.p.axpby(chosen(expands), &self.z, others(expands));
        // The chopped gradient β: what is left of the projected gradient at the bounds.
        self.z.copy_from(&self.at.g);
        self.z.hold(&self.at.x, &self.at.g, problem.bounds());
        self.z.axpby([-1.0; 3], &self.phi, [1.0; 3]);
        self.phi.copy_from(&self.z);
        problem.shrink(&mut self.z);
        let chopped = self.phi.dot(&self.z)?;
        let leaves: Live = std::array::from_fn(|c| {
            !expands[c] && chopped[c] > -used[c] * self.norm[c] / EXPANSION && chopped[c] > 0.0
        });
        self.p.axpby(chosen(leaves).map(|yes| -yes), &self.z, others(leaves));
        self.p.axpby([0.0; 3], &self.z, chosen(live));
        Ok(std::array::from_fn(|c| match (live[c], expands[c], leaves[c]) {
            (false, _, _) => StepKind::Rest,
            (_, true, _) => StepKind::Expansion,
            (_, _, true) => StepKind::Proportioning,
            _ => StepKind::Conjugate,
        }))
    }
}

impl<O: LinearOperator> Method<O> for Mprgp<O> {
    fn name(&self) -> &'static str {
        "mprgp"
    }

    fn keeps_bounds(&self) -> bool {
        true
    }

    fn vectors(&self) -> Vectors {
        Self::VECTORS
    }

    fn begin(&mut self, problem: &LeastSquares<O>, x: &O::Domain) -> Result<()> {
        self.at.begin(problem, x)?;
        (self.gamma, self.met_bound) = ([0.0; 3], [0.0; 3]);
        self.norm = [1.0; 3];
        if !problem.is_majorized() {
            self.norm = problem.curvature_along(&self.at.g, &mut self.z, &mut self.q)?;
        }
        Ok(())
    }

    fn step(&mut self, problem: &LeastSquares<O>, live: Live) -> Result<()> {
        let kinds = self.choose(problem, live)?;
        problem.apply(&self.p, &mut self.q)?;
        let (slope, curvature) = (self.at.g.dot(&self.p)?, self.q.norm_squared()?);
        if let Some(&value) = curvature.iter().find(|value| !value.is_finite()) {
            return Err(Error::Curvature { value, iteration: 0 });
        }
        self.z.copy_from(&self.p);
        problem.stretch(&mut self.z);
        let length = self.z.dot(&self.p)?;
        let room = self.p.largest_step(&self.at.x, problem.bounds())?;
        let mut alpha = [0.0; 3];
        for c in 0..3 {
            self.norm[c] = self.norm[c].max(ratio(curvature, length)[c]);
            if kinds[c] == StepKind::Rest {
                continue;
            }
            let best = if curvature[c] > 0.0 { -slope[c] / curvature[c] } else { 0.0 };
            // The fixed step of an expansion is safe once `norm` is; on the way there it is cut at the least objective.
            let wanted = if kinds[c] == StepKind::Expansion { best.min(1.0) } else { best };
            let meets = wanted > room[c] && kinds[c] != StepKind::Expansion;
            alpha[c] = if meets { room[c] } else { wanted };
            self.met_bound[c] = if meets { 1.0 } else { 0.0 };
            if kinds[c] != StepKind::Conjugate || meets {
                self.gamma[c] = 0.0;
            }
        }
        self.at.x.axpby(alpha, &self.p, [1.0; 3]);
        self.at.x.clamp(problem.bounds());
        self.at.r.axpby(alpha.map(|alpha| -alpha), &self.q, [1.0; 3]);
        self.at.look(problem)?;
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
            domain: vec![&mut self.at.x, &mut self.at.g, &mut self.p],
            range: vec![&mut self.at.r],
            scalars: vec![
                &mut self.gamma,
                &mut self.met_bound,
                &mut self.norm,
                &mut self.at.measure.residual,
                &mut self.at.measure.normal_residual,
            ],
        }
    }
}
