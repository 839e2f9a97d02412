//! Flexible CGLS within bounds: conjugate directions of a gradient that is scaled by the distance to the bounds.
//!
//! Problem       min ½‖A x − b‖², l ≤ x ≤ u.
//! Equivalences  With one remembered direction and l = 0, modified residual norm steepest descent with conjugation.
//! Caveats       It stays inside the box: an element that comes near a bound moves ever more slowly, and one that starts at a
//!               bound stays there. Good for a few iterations, slow to the end.
//! Convergence   The objective falls in every iteration; that the limit is a solution is not proven.
//! Source        Gazzola and Wiaux 2017, NN-FCGLS, with the distance to the nearer bound for x. Departs from it in that a
//!               step ends a little before the bound, and that the memory is lost there and not the iteration.

use super::iterate::Iterate;
use super::{LeastSquares, Live, Measure, Method, MethodMemory, Vectors, each, ratio};
use crate::Result;
use crate::operator::{LinearOperator, Scalars, Vector};

/// Directions that a new one is made conjugate to.
const REMEMBERED: usize = 8;
/// Part of the way to the bound that a step goes.
const SHORT_OF_BOUND: f64 = 0.99;

/// Flexible conjugate gradients that never leave the bounds.
#[derive(Debug)]
pub struct FlexibleCgls<O: LinearOperator> {
    at: Iterate<O>,
    d: O::Domain,
    /// A d.
    w: O::Range,
    /// The last directions and their images, the newest first.
    directions: Vec<O::Domain>,
    images: Vec<O::Range>,
    /// ‖A d‖² of each; 0 for one that the channel has forgotten.
    lengths: [Scalars; REMEMBERED],
}

impl<O: LinearOperator> FlexibleCgls<O> {
    /// The vectors that it keeps.
    pub const VECTORS: Vectors = Vectors { domain: 3 + REMEMBERED, range: 2 + REMEMBERED };

    /// The method for problems of this operator's shape.
    pub fn new(operator: &O) -> Self {
        Self {
            at: Iterate::new(operator),
            d: operator.domain(),
            w: operator.range(),
            directions: (0..REMEMBERED).map(|_| operator.domain()).collect(),
            images: (0..REMEMBERED).map(|_| operator.range()).collect(),
            lengths: [[0.0; 3]; REMEMBERED],
        }
    }
}

impl<O: LinearOperator> Method<O> for FlexibleCgls<O> {
    fn name(&self) -> &'static str {
        "flexible-cgls"
    }

    fn keeps_bounds(&self) -> bool {
        true
    }

    fn vectors(&self) -> Vectors {
        Self::VECTORS
    }

    fn begin(&mut self, problem: &LeastSquares<O>, x: &O::Domain) -> Result<()> {
        self.at.begin(problem, x)?;
        self.lengths = [[0.0; 3]; REMEMBERED];
        Ok(())
    }

    fn step(&mut self, problem: &LeastSquares<O>, live: Live) -> Result<()> {
        self.d.axpby([-1.0; 3], &self.at.g, [0.0; 3]);
        self.d.shorten(&self.at.x, problem.bounds());
        problem.apply(&self.d, &mut self.w)?;
        for (i, length) in self.lengths.iter().enumerate() {
            if *length == [0.0; 3] {
                continue;
            }
            let beta = ratio(self.w.dot(&self.images[i])?, *length);
            self.d.axpby(beta.map(|beta| -beta), &self.directions[i], [1.0; 3]);
            self.w.axpby(beta.map(|beta| -beta), &self.images[i], [1.0; 3]);
        }
        let length = self.w.norm_squared()?;
        let best = ratio(self.at.r.dot(&self.w)?, length);
        let room = self.d.largest_step(&self.at.x, problem.bounds())?.map(|room| SHORT_OF_BOUND * room);
        let step = each(|c| if live[c] { best[c].clamp(0.0, room[c]) } else { 0.0 });
        self.at.x.axpby(step, &self.d, [1.0; 3]);
        self.at.x.clamp(problem.bounds());
        self.at.r.axpby(step.map(|step| -step), &self.w, [1.0; 3]);
        self.at.look(problem)?;

        self.lengths.rotate_right(1);
        self.directions.rotate_right(1);
        self.images.rotate_right(1);
        self.lengths[0] = length;
        self.directions[0].copy_from(&self.d);
        self.images[0].copy_from(&self.w);
        if step != best {
            for known in &mut self.lengths {
                *known = each(|c| if step[c] == best[c] { known[c] } else { 0.0 });
            }
        }
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
        domain.extend(&mut self.directions);
        let mut range = vec![&mut self.at.r];
        range.extend(&mut self.images);
        let mut scalars = vec![&mut self.at.measure.residual, &mut self.at.measure.normal_residual];
        scalars.extend(&mut self.lengths);
        MethodMemory { domain, range, scalars }
    }
}
