//! What is saved by what is skipped, and what it changes.

use std::time::Instant;

use super::cases::CaseBasis;
use super::measure::Patience;
use super::reference::{Sample, relative};
use super::subject::{self, SceneSource};
use crate::Result;
use crate::lab::check::AGAINST_EXPLICIT;
use crate::operator::{CpuVector, LinearOperator, Vector};
use crate::problem::{Problem, Solved, Unskipped};
use crate::report::bench::{Pair, Skipped};
use crate::scene::{Quadrature, Skipping, SolveSettings, SolverName, Strategy};

/// How far sums may be apart that differ only in their order, or in terms that are zero.
const ROUNDING: f64 = 1e-12;
/// How far solutions may be apart because they are handed over in f32.
const IN_F32: f64 = 1e-5;
/// Part of its start that the projected gradient of compared solutions falls to, where iterations allow.
const TOLERANCE: f64 = 1e-3;

/// Compares a scene with and without each thing that is skipped.
pub(super) struct Comparison<'a> {
    pub(super) patience: &'a Patience,
    pub(super) source: &'a SceneSource,
    pub(super) sample: &'a Sample,
    /// Rows of a sample.
    pub(super) rows: usize,
}

/// Something that is skipped.
struct Thing {
    what: &'static str,
    switch: &'static str,
    unit: &'static str,
}

impl Comparison<'_> {
    /// Compares with and without everything that the scene has something of to skip.
    pub(super) fn run(&self) -> Result<Vec<Skipped>> {
        let mut all = vec![self.kept_rows()?];
        let others = [
            self.unpainted_pixels()?,
            self.emptiness()?,
            self.far_ends()?,
            self.unreached()?,
            self.converged_channels()?,
        ];
        all.extend(others.into_iter().flatten());
        Ok(all)
    }

    /// Geometry and visibility, once and not in every application.
    fn kept_rows(&self) -> Result<Skipped> {
        let problem = &*self.sample.problem;
        let kept = self.cost(problem, Strategy::Assembled)?;
        let walked = self.cost(problem, Strategy::MatrixFree)?;
        let thing = Thing {
            what: "walks of rows that are kept",
            switch: "solve.strategy=matrix-free",
            unit: "walks a product",
        };
        let difference = relative(kept.shown.0, &walked.shown)?;
        let seconds = [kept.seconds, walked.seconds];
        Ok(self.skipped(thing, [0.0, problem.rows() as f64], seconds, [difference, AGAINST_EXPLICIT]))
    }

    /// Rows without weight; none where something is wanted of every pixel.
    fn unpainted_pixels(&self) -> Result<Option<Skipped>> {
        let scenes = self.source.load(&["solve.skip.pixels=false".to_owned()])?;
        let all = subject::problem(&subject::with(scenes, CaseBasis::Linear))?.problem;
        let weighs = |problem: &dyn Problem| -> Vec<usize> {
            let weights = problem.weights().0;
            (0..weights.len()).filter(|&row| weights[row] != [0.0; 3]).collect()
        };
        let painted = weighs(&*all).len();
        if painted == all.rows() {
            return Ok(None);
        }
        let all = all.sampled((self.rows as f64 * all.rows() as f64 / painted as f64) as usize);
        let painted = all.picked(&weighs(&*all));
        let thing = Thing { what: "unpainted pixels", switch: "solve.skip.pixels=false", unit: "rows" };
        let work = [painted.rows() as f64, all.rows() as f64];
        self.products(thing, work, [&*painted, &*all]).map(Some)
    }

    /// Nodes of a shadow map's pyramid, bricks of a volume that hold nothing; none where rows skip neither.
    fn emptiness(&self) -> Result<Option<Skipped>> {
        let problem = &*self.sample.problem;
        let Some(Unskipped { what, switch, unit, work, problem: entered }) = problem.unskipped() else {
            return Ok(None);
        };
        self.products(Thing { what, switch, unit }, work, [problem, &*entered]).map(Some)
    }

    /// The rest of a ray beyond the transmittance bound; none where what that can change is not known.
    fn far_ends(&self) -> Result<Option<Skipped>> {
        let problem = &*self.sample.problem;
        let Some(lost) = problem.most_lost() else { return Ok(None) };
        let Some(whole) = problem.integrated(Quadrature::Exact, Some(f64::MIN_POSITIVE)) else {
            return Ok(None);
        };
        let [cut, uncut] = [problem, &*whole].map(|problem| self.cost(problem, Strategy::MatrixFree));
        let (cut, uncut) = (cut?, uncut?);
        let norm = uncut.shown.norm_squared()?.iter().sum::<f64>().sqrt();
        let thing =
            Thing { what: "far ends of rays", switch: "solve.transmittance_bound=1e-300", unit: "non-zeros" };
        let work = [problem, &*whole].map(|problem| problem.plan().nonzeros as f64);
        let difference = relative(cut.shown.0, &uncut.shown)?;
        // Rounding may add to it.
        let bound = lost / norm.max(f64::MIN_POSITIVE) + ROUNDING;
        Ok(Some(self.skipped(thing, work, [cut.seconds, uncut.seconds], [difference, bound])))
    }

    /// Unknowns that no row reaches; none where neighbours are pulled together, for then they are another problem.
    fn unreached(&self) -> Result<Option<Skipped>> {
        let thing =
            Thing { what: "unreached unknowns", switch: "solve.skip.unknowns=false", unit: "unknowns" };
        let all = Skipping { unknowns: false, ..Skipping::default() };
        self.solves(thing, all, |solved| solved.columns.len() as f64)
    }

    fn converged_channels(&self) -> Result<Option<Skipped>> {
        let thing = Thing {
            what: "channels that have converged",
            switch: "solve.skip.channels=false",
            unit: "iterations of channels",
        };
        let all = Skipping { channels: false, ..Skipping::default() };
        self.solves(thing, all, |solved| {
            let outcome = &solved.outcome;
            (3 * outcome.stop.iteration - outcome.history.spared) as f64
        })
    }

    /// Compares two ways to walk the same rows: Tᵀ W T 1.
    fn products(&self, thing: Thing, work: [f64; 2], problems: [&dyn Problem; 2]) -> Result<Skipped> {
        let [with, without] = problems.map(|problem| self.cost(problem, Strategy::MatrixFree));
        let (with, without) = (with?, without?);
        let difference = relative(with.arriving.0, &without.arriving)?;
        Ok(self.skipped(thing, work, [with.seconds, without.seconds], [difference, ROUNDING]))
    }

    /// Compares the solution with that of a solve that skips less; none where nothing is known of how far they may be apart.
    fn solves(
        &self,
        thing: Thing,
        without: Skipping,
        work: impl Fn(&Solved) -> f64,
    ) -> Result<Option<Skipped>> {
        let with = self.sample.settings(SolverName::default(), TOLERANCE, self.patience.iterations)?;
        let without = SolveSettings { skip: without, ..with.clone() };
        let neighbours = [with.regularization.gradient, with.regularization.laplacian];
        if !without.skip.unknowns && neighbours != [crate::scene::RegularizationWeight::Relative(0.0); 2] {
            return Ok(None);
        }
        let reference = self.sample.reference(true)?;
        let timed = |settings: &SolveSettings| -> Result<_> {
            let clock = Instant::now();
            let solved = self.sample.solve(settings)?;
            Ok((solved, clock.elapsed().as_secs_f64()))
        };
        let solver = with.solver;
        let ((with, seconds), (without, seconds_without)) = (timed(&with)?, timed(&without)?);
        // Each is as near to the solution as what is left of its gradient proves.
        let nearness = |solved: &Solved| {
            let left = solved.outcome.true_normal_residual.iter().copied().fold(0.0, f64::max);
            self.sample.bound(reference, left).map(f64::sqrt)
        };
        let (Some(near), Some(near_without)) = (nearness(&with), nearness(&without)) else { return Ok(None) };
        let difference = self.sample.apart(reference, solver, [&with.x, &without.x])?;
        let bound = near + near_without + IN_F32;
        let seconds = [seconds, seconds_without];
        Ok(Some(self.skipped(thing, [work(&with), work(&without)], seconds, [difference, bound])))
    }

    fn skipped(
        &self,
        Thing { what, switch, unit }: Thing,
        work: [f64; 2],
        seconds: [f64; 2],
        [difference, bound]: [f64; 2],
    ) -> Skipped {
        let pair = |[with, without]: [f64; 2]| Pair { with, without };
        Skipped {
            scene: self.source.name(),
            what: what.to_owned(),
            switch: switch.to_owned(),
            unit: unit.to_owned(),
            work: pair(work),
            seconds: pair(seconds),
            difference,
            bound,
        }
    }

    fn cost(&self, problem: &dyn Problem, strategy: Strategy) -> Result<Cost> {
        let (operator, times) = self.patience.times(|| problem.wide(strategy))?;
        let (mut arriving, mut shown) = (operator.domain(), operator.range());
        arriving.fill([1.0; 3]);
        operator.apply(&arriving, &mut shown)?;
        let weighted = shown.0.iter().zip(problem.weights().0);
        let weighted =
            weighted.map(|(shown, weight)| std::array::from_fn(|c| shown[c] * f64::from(weight[c])));
        operator.apply_adjoint(&CpuVector(weighted.collect()), &mut arriving)?;
        Ok(Cost { shown, arriving, seconds: times.forward + times.backward })
    }
}

/// What both products take, and what they give.
struct Cost {
    /// T 1.
    shown: CpuVector<f64>,
    /// Tᵀ W T 1.
    arriving: CpuVector<f64>,
    seconds: f64,
}
