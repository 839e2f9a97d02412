//! Problems of rows in f32, solved as the command solves them, and judged by the explicit matrix in f64.

use super::case::{Measurements, Setting};
use super::rows::{AnyRows, RandomNumbers, worse};
use crate::Result;
use crate::cpu::HostOperator;
use crate::operator::{CpuVector, LinearOperator, TransportOperator, Vector, WalkPlan};
use crate::problem::{Formulation, Lattice, Part, Solved, Start, minimize};
use crate::scene::{Regularization, RegularizationWeight, Rgb, SolveSettings, SolverName, Strategy};
use crate::solve::{Control, StopReason};
use crate::sparse::ExplicitMatrix;

/// Products in f32 against the explicit matrix (ARCHITECTURE, Numbers).
pub(super) const AGAINST_EXPLICIT: f64 = 1e-5;
/// A true residual above the tolerance by more than this has not converged (ARCHITECTURE, Solving).
const PARTED: f64 = 1.5;
/// A channel that starts with less than this part of the largest squared norm is measured against that part.
const FLOOR: f64 = 1e-12;

/// What is asked of the rows.
pub(super) struct Question {
    pub(super) targets: Vec<Rgb>,
    pub(super) weights: Vec<Rgb>,
    /// What all elements start from.
    pub(super) start: Rgb,
    pub(super) settings: SolveSettings,
    pub(super) matrix: ExplicitMatrix,
}

/// What came of it.
pub(super) struct Answer {
    pub(super) solved: Solved,
    /// The certificate as the solve states it, and as the matrix in f64 has it; the worst channel's.
    pub(super) claimed: f64,
    pub(super) truth: f64,
    /// ‖projected gradient‖ at the start, the largest channel's.
    pub(super) at_start: f64,
}

impl Question {
    /// Which elements show what these rows would show of some that are drawn by lot, from 0.5 to 2.
    pub(super) fn answered_by(rows: &dyn AnyRows, tolerance: f64) -> Result<Self> {
        let matrix = ExplicitMatrix::new::<1>(&Setting::RIGHT.tested(rows), u64::MAX)?;
        let mut n = RandomNumbers(1);
        let (mut x, mut shown) = (matrix.domain(), matrix.range());
        x.0.iter_mut().for_each(|x| *x = std::array::from_fn(|_| n.uniform(0.5, 2.0)));
        matrix.apply(&x, &mut shown)?;
        Ok(Self {
            targets: shown.0.iter().map(|shown| shown.map(|value| value as f32)).collect(),
            weights: vec![[1.0; 3]; rows.rows()],
            start: [1.0; 3],
            settings: SolveSettings { tolerance, iterations: 2000, ..SolveSettings::default() },
            matrix,
        })
    }

    /// The same with another method.
    pub(super) fn by(mut self, solver: SolverName) -> Self {
        self.settings.solver = solver;
        self
    }

    /// The same with another pull to the start.
    pub(super) fn pulled(mut self, weight: f64) -> Self {
        let tikhonov = RegularizationWeight::Relative(weight);
        self.settings.regularization = Regularization { tikhonov, ..Regularization::default() };
        self
    }

    /// Solves it with rows that should be those of the matrix.
    pub(super) fn solved(&self, setting: &Setting, rows: &dyn AnyRows) -> Result<Answer> {
        let tested = setting.tested(rows);
        let plan = WalkPlan::new::<1>(&tested);
        let operator = HostOperator::<_, f32>::new(tested, true, &plan, Strategy::Auto, u64::MAX)?;
        let coverage = operator.squares(&CpuVector(self.weights.clone()))?;
        let elements = rows.elements();
        let size = [elements];
        let formulation = Formulation {
            held_out: None,
            targets: (&self.targets).into(),
            weights: self.weights.as_slice().into(),
            wanted: self.wanted(),
            parts: vec![Part {
                noun: "elements",
                start: Start::Everywhere(self.start, elements),
                bounds: self.settings.solver.kept(self.settings.bounds),
                pull: 1.0,
                lattice: Some(Lattice { size: &size, places: None }),
                pairs: &[],
                joined: &[],
                fade: 0.0,
                scale: 0,
            }],
            remedy: "raise the depth",
        };
        let go_on = |_: &_, _: &mut dyn crate::problem::Snapshot| Ok(Control::Continue);
        let solved = minimize(&formulation, &operator, &coverage, &self.settings, None, go_on)?;
        self.judged(solved)
    }

    /// Σ w L².
    fn wanted(&self) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (target, weight) in self.targets.iter().zip(&self.weights) {
            (0..3).for_each(|c| sum[c] += f64::from(weight[c]) * f64::from(target[c]).powi(2));
        }
        sum
    }

    fn judged(&self, solved: Solved) -> Result<Answer> {
        let start = self.gradient(&solved, &vec![self.start; solved.x.len()])?;
        let end = self.gradient(&solved, &solved.x)?;
        let largest = start.iter().copied().fold(0.0, f64::max);
        let part = |c: usize| (end[c] / start[c].max(FLOOR * largest)).sqrt();
        let truth = (0..3).map(part).fold(0.0, worse);
        let claimed = solved.outcome.true_normal_residual.into_iter().fold(0.0, worse);
        Ok(Answer { solved, claimed, truth, at_start: largest.sqrt() })
    }

    /// ‖Tᵀ W² (T x − b) + λ (x − x₀)‖² over the unknowns, without what only the bounds hold back.
    fn gradient(&self, solved: &Solved, x: &[Rgb]) -> Result<[f64; 3]> {
        let wide = |colors: &[Rgb]| CpuVector(colors.iter().map(|color| color.map(f64::from)).collect());
        let (mut r, mut g) = (self.matrix.range(), self.matrix.domain());
        self.matrix.apply(&wide(x), &mut r)?;
        r.axpby([-1.0; 3], &wide(&self.targets), [1.0; 3]);
        r.multiply(&wide(&self.weights));
        self.matrix.apply_adjoint(&r, &mut g)?;
        let [lower, upper] = self.settings.solver.kept(self.settings.bounds);
        let mut sum = [0.0; 3];
        for &column in &solved.columns {
            let (index, x) = (column as usize, x[column as usize]);
            for c in 0..3 {
                let pull = solved.weights.tikhonov * (f64::from(x[c]) - f64::from(self.start[c]));
                let slope = g.0[index][c] + pull;
                let x = f64::from(x[c]);
                let held = (x <= lower[c] && slope > 0.0) || (x >= upper[c] && slope < 0.0);
                sum[c] += if held { 0.0 } else { slope * slope };
            }
        }
        Ok(sum)
    }
}

impl Answer {
    /// Why it ended, as remarks say it.
    pub(super) fn ending(&self) -> String {
        let stop = self.solved.outcome.stop;
        format!("{} after {}", stop.reason.name(), stop.iteration)
    }

    /// How far from the solution what it claims allows an element to be, for all rows pull with λ.
    pub(super) fn reach(&self) -> f64 {
        (self.claimed + AGAINST_EXPLICIT) * self.at_start / self.solved.weights.tikhonov
    }
}

/// The law of every solve: what it claims is true, and what is called converged is.
pub(super) fn certificate(measurements: &mut Measurements, place: &str, answer: &Answer, tolerance: f64) {
    let place = format!("{place}, {}", answer.ending());
    let finite = answer.solved.x.iter().flatten().all(|value| value.is_finite());
    let difference = if finite { (answer.truth - answer.claimed).abs() } else { f64::NAN };
    measurements.within(&place, difference, AGAINST_EXPLICIT);
    if answer.solved.outcome.stop.reason == StopReason::Tolerance {
        measurements.within(place, answer.truth, PARTED * tolerance + AGAINST_EXPLICIT);
    }
}
