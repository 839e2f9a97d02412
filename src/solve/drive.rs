use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::stop::{Progressing, is_mostly_noise};
use super::{Control, Ending, LeastSquares, Limits, Live, Measure, Method, StopReason};
use crate::operator::{Bounds, LinearOperator, PendingSum, Scalars, Vector, expect_len};
use crate::{Error, Result};

/// Where a solve is after an iteration.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Progress {
    /// From 0, the start.
    pub iteration: usize,
    /// Seconds of solving.
    pub seconds: f64,
    /// Applications of A and Aᵀ so far.
    pub operator_applications: usize,
    /// ‖b − A x‖ relative to the start, a channel; 0 where the start was already exact.
    pub residual: Scalars,
    /// ‖Aᵀ (b − A x)‖, or with bounds the norm of the projected gradient, relative to the start; 0 where that was already optimal.
    pub normal_residual: Scalars,
    /// ‖b − A x‖ of rows that are kept out of the fit, in their unit; none where there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out: Option<f64>,
}

/// A solve so far; with the method's state, all that is needed to continue it.
#[derive(Debug, Clone, PartialEq)]
pub struct History {
    /// The start and every iteration since.
    pub progress: Vec<Progress>,
    /// The squared norms that progress is relative to: those at x₀.
    pub start: Measure,
    /// How often the method began again because its recursion had parted from the truth.
    pub restarts: usize,
    /// The least true normal residual at such a restart, relative to the start; infinite before the first.
    pub least_true: f64,
    /// Channels that are done, and are left as they are.
    pub settled: [bool; 3],
    /// Iterations of channels that were settled already, summed over the channels.
    pub spared: usize,
    /// Whether the solve still gets anywhere.
    pub progressing: Progressing,
}

/// Where a solve begins.
#[derive(Debug)]
pub enum Beginning<'a, V> {
    /// At x₀, which progress is relative to.
    At(&'a V),
    /// At x, where a similar problem was solved before. Progress is still relative to x₀, which costs two applications more.
    From {
        /// Where it begins.
        x: &'a V,
        /// x₀.
        reference: &'a V,
    },
    /// Where a method stands whose state has been restored.
    Resumed(History),
}

/// How a solve went.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// What happened on the way.
    pub history: History,
    /// Why it ended.
    pub stop: Ending,
    /// ‖b − A x‖ at the end relative to the start, computed anew and not by recursion.
    pub true_residual: Scalars,
    /// The certificate: ‖Aᵀ (b − A x)‖, or with bounds the norm of the projected gradient, at the end relative to the
    /// start, computed anew. Zero at a solution and nowhere else.
    pub true_normal_residual: Scalars,
}

/// A channel that starts with less than this part of the largest squared norm is measured against that part: its
/// start is rounding, and cannot be improved on.
const FLOOR: f64 = 1e-12;
/// A channel is solved whose residual at the start is at most this many roundings of its right-hand side.
const SOLVED: f64 = 8.0;
/// The factor above the tolerance from which on a true normal residual refutes the recursive one.
const PARTED: f64 = 1.5;
/// The part of a normal residual that a correction must leave at most to be worth another one.
const CORRECTED: f64 = 0.9;
/// The part of the tolerance down to which an operator that is corrected is iterated with: some of the rest is the correction's.
const AHEAD: f64 = 0.75;
/// The part of the last true normal residual down to which it is iterated with before the truth is looked at again: by then the two have
/// little in common.
const LOOKED: f64 = 0.02;
/// The part of what is left then that the tolerance is at most: nearer to it the look that confirms is enough.
const FAR: f64 = 0.1;

/// Runs a method until it should stop.
///
/// `each` is called after every iteration, not at the start. Not reaching the tolerance is not an error.
/// Vectors: one of the domain and one of the range beside the method's, for the certificate.
///
/// Errors: [`Error::NonFinite`] naming the iteration, [`Error::Value`] naming a limit, and what the method and `each`
/// report.
pub fn drive<O: LinearOperator, M: Method<O> + ?Sized>(
    method: &mut M,
    problem: &LeastSquares<O>,
    beginning: Beginning<O::Domain>,
    limits: &Limits,
    mut each: impl FnMut(&History, &mut M) -> Result<Control>,
) -> Result<Outcome> {
    limits.check()?;
    problem.check()?;
    let clock = Instant::now();
    let mut judge = Judge { problem, limits, r: problem.operator().range(), s: problem.operator().domain() };
    let before_us = problem.applications();
    let mut history = match beginning {
        // The limits may be others than before, so who is done is found out anew.
        Beginning::Resumed(history) => History { settled: [false; 3], ..history },
        Beginning::At(x0) => {
            expect_len("the start", x0, method.solution().len())?;
            judge.begin(method, x0, None)?
        }
        Beginning::From { x, reference } => {
            expect_len("the start", x, method.solution().len())?;
            expect_len("the reference", reference, method.solution().len())?;
            let reference = judge.measure(method, reference)?;
            judge.begin(method, x, Some(reference))?
        }
    };
    let [seconds_before, applications_before] = history
        .progress
        .last()
        .filter(|last| last.iteration > 0)
        .map_or([0.0; 2], |last| [last.seconds, last.operator_applications as f64]);
    let applied = |extra: usize| applications_before as usize + problem.applications() - before_us - extra;
    let mut certifying = judge.settle(method, &mut history)?;
    loop {
        let seconds = seconds_before + clock.elapsed().as_secs_f64();
        let iteration = history.progress.last().map_or(0, |last| last.iteration);
        let stop = judge.reason_to_stop(&history, seconds);
        if let Some(reason) = stop.or_else(|| judge.has_gone_far(&history).then_some(StopReason::Tolerance)) {
            let outcome = judge.finish(method, &history, reason)?;
            certifying += 2;
            let believed = matches!(reason, StopReason::Tolerance | StopReason::Discrepancy);
            let parted = believed && !judge.confirms(&outcome)?;
            if !parted {
                return Ok(outcome);
            }
            // The method believes to be done and is not: begin again from the truth, while that still helps.
            let truth = largest(outcome.true_normal_residual);
            let enough = if problem.is_corrected() { CORRECTED } else { 0.5 };
            let helps = truth < enough * history.least_true;
            let goes_on = helps || iteration < limits.iterations && problem.give_up_correcting();
            if !goes_on || iteration >= limits.iterations {
                let reason = if goes_on { StopReason::Iterations } else { StopReason::Stagnation };
                return Ok(Outcome { stop: Ending { reason, iteration }, ..outcome });
            }
            history.least_true = truth;
            history.restarts += 1;
            history.settled = [false; 3];
            history.progressing = Progressing::START;
            problem.correct(method.solution(), (&judge.r, &judge.s))?;
            judge.s.copy_from(method.solution());
            method.begin(problem, &judge.s)?;
            judge.settle_by_tolerance(&mut history, method.measure());
        }
        let live: Live = history.settled.map(|settled| limits.carry_on || !settled);
        history.spared += live.iter().filter(|live| !**live).count();
        method.step(problem, live).map_err(|error| error.in_iteration(iteration + 1))?;
        finite(method.measure(), iteration + 1)?;
        let seconds = seconds_before + clock.elapsed().as_secs_f64();
        let held_out = problem.held_out(method.solution())?;
        let entry = Progress {
            held_out,
            ..progress(iteration + 1, seconds, applied(certifying), method.measure(), &history.start)
        };
        history.progress.push(entry);
        judge.note(method, &mut history, &entry);
        certifying += judge.settle(method, &mut history)?;
        match each(&history, method)? {
            Control::Continue => {}
            Control::Stop => return judge.finish(method, &history, StopReason::Interrupted),
            Control::Pause => return Ok(outcome(method.measure(), &history, StopReason::Interrupted)),
        }
    }
}

/// Decides when to stop, and computes what is needed for that.
struct Judge<'a, O: LinearOperator> {
    problem: &'a LeastSquares<'a, O>,
    limits: &'a Limits,
    r: O::Range,
    s: O::Domain,
}

impl<O: LinearOperator> Judge<'_, O> {
    /// The squared norms at x, moved into the bounds that the method keeps.
    fn measure<M: Method<O> + ?Sized>(&mut self, method: &M, x: &O::Domain) -> Result<Measure> {
        let bounds = if method.keeps_bounds() { self.problem.bounds() } else { &Bounds::NONE };
        let mut at = x.zeros_like();
        at.copy_from(x);
        at.clamp(bounds);
        self.problem.residual(&at, &mut self.r)?;
        self.problem.gradient(&self.r, &mut self.s)?;
        Ok(Measure {
            residual: self.r.norm_squared()?,
            normal_residual: self.s.projected_norm_squared(&at, bounds)?,
        })
    }

    /// Begins at x; progress is relative to what is measured there, or to `reference`.
    fn begin<M: Method<O> + ?Sized>(
        &self,
        method: &mut M,
        x: &O::Domain,
        reference: Option<Measure>,
    ) -> Result<History> {
        let before = self.problem.applications();
        method.begin(self.problem, x)?;
        let measure = finite(method.measure(), 0)?;
        let reference = reference.unwrap_or(measure);
        let mut start = floored(reference);
        let (rhs, rounding) = (self.problem.rhs().norm_squared()?, SOLVED * x.epsilon());
        for c in 0..3 {
            // Nothing but rounding is left, and there is nothing to be relative to.
            if reference.residual[c] <= rounding.powi(2) * rhs[c] {
                start.normal_residual[c] = f64::INFINITY;
            }
        }
        let applications = self.problem.applications() - before;
        Ok(History {
            progress: vec![progress(0, 0.0, applications, measure, &start)],
            start,
            restarts: 0,
            least_true: f64::INFINITY,
            settled: [false; 3],
            spared: 0,
            progressing: Progressing::START,
        })
    }

    /// The normal residual at which a method is done.
    fn asked(&self) -> f64 {
        self.limits.tolerance * if self.problem.is_corrected() { AHEAD } else { 1.0 }
    }

    fn settle_by_tolerance(&self, history: &mut History, measure: Measure) {
        let (_, normal) = relative(&measure, &history.start);
        for c in 0..3 {
            history.settled[c] |= normal[c] <= self.asked();
        }
    }

    /// Takes note of the progress that an iteration has made.
    fn note<M: Method<O> + ?Sized>(&self, method: &M, history: &mut History, last: &Progress) {
        let unsettled = (0..3).filter(|&c| !history.settled[c]).map(|c| last.normal_residual[c]);
        let epsilon = method.solution().epsilon();
        history.progressing.note(unsettled.fold(0.0, f64::max), last.residual, epsilon);
    }

    /// Marks the channels that are done; gives the number of applications that took.
    fn settle<M: Method<O> + ?Sized>(&mut self, method: &M, history: &mut History) -> Result<usize> {
        self.settle_by_tolerance(history, method.measure());
        let Some(noise) = self.limits.discrepancy.filter(|_| history.settled != [true; 3]) else {
            return Ok(0);
        };
        let (data, applications) = match method.residual() {
            Some(r) => (r.upper_norm_squared()?, 0),
            None => {
                self.problem.residual(method.solution(), &mut self.r)?;
                (self.r.upper_norm_squared()?, 1)
            }
        };
        if data.iter().sum::<f64>() <= noise {
            history.settled = [true; 3];
        }
        Ok(applications)
    }

    fn reason_to_stop(&self, history: &History, seconds: f64) -> Option<StopReason> {
        let last = history.progress.last()?;
        let limits = self.limits;
        if history.settled == [true; 3] {
            let by_tolerance = last.normal_residual.iter().all(|&residual| residual <= self.asked());
            Some(if by_tolerance { StopReason::Tolerance } else { StopReason::Discrepancy })
        } else if last.iteration >= limits.iterations {
            Some(StopReason::Iterations)
        } else if limits.time.is_some_and(|limit| seconds >= limit.as_secs_f64()) {
            Some(StopReason::Time)
        } else if follows_noise(&history.progress, &history.start) {
            Some(StopReason::HeldOut)
        } else if history.progressing.has_stagnated() {
            Some(StopReason::Stagnation)
        } else {
            None
        }
    }

    /// Whether an operator that is corrected has been iterated with so far that the truth is worth a look.
    fn has_gone_far(&self, history: &History) -> bool {
        let is_far = |last: &Progress| {
            let normal = last.normal_residual.into_iter().fold(0.0, f64::max);
            normal <= LOOKED * history.least_true.min(1.0) && self.asked() <= FAR * normal
        };
        self.problem.is_corrected() && history.progress.last().is_some_and(is_far)
    }

    /// The outcome, with the residuals computed anew; they stay in `r` and `s`.
    fn finish<M: Method<O> + ?Sized>(
        &mut self,
        method: &M,
        history: &History,
        reason: StopReason,
    ) -> Result<Outcome> {
        self.problem.truth_at(method.solution(), &mut self.r, &mut self.s)?;
        let bounds = if method.keeps_bounds() { self.problem.bounds() } else { &Bounds::NONE };
        let residual = self.r.dot_later(&self.r)?;
        let normal_residual = self.s.projected_norm_squared_later(method.solution(), bounds)?;
        let truth = Measure { residual: residual.value()?, normal_residual: normal_residual.value()? };
        Ok(outcome(truth, history, reason))
    }

    /// Whether the residuals computed anew agree that every channel is done, by tolerance or by discrepancy.
    fn confirms(&self, outcome: &Outcome) -> Result<bool> {
        let data: f64 = self.r.upper_norm_squared()?.iter().sum();
        // Where the truth is another operator's, it is asked for and not only confirmed.
        let parted = if self.problem.is_corrected() { 1.0 } else { PARTED };
        let fits = self.limits.discrepancy.is_some_and(|noise| data <= parted * noise);
        let is_small = |residual: &f64| *residual <= parted * self.limits.tolerance;
        Ok(fits || outcome.true_normal_residual.iter().all(is_small))
    }
}

/// Iterations over which rows that are kept out of the fit are compared with the others.
const WINDOW: usize = 3;

/// Whether what was gained in the last iterations is mostly noise; the first is never asked.
fn follows_noise(progress: &[Progress], start: &Measure) -> bool {
    let &[_, .., before, _, _, last] = progress else { return false };
    debug_assert_eq!(last.iteration, before.iteration + WINDOW);
    let fit = |at: Progress| (0..3).map(|c| start.residual[c] * at.residual[c].powi(2)).sum::<f64>().sqrt();
    match (before.held_out, last.held_out) {
        (Some(held_before), Some(held)) => is_mostly_noise([fit(before), fit(last)], [held_before, held]),
        _ => false,
    }
}

/// A start to be relative to, in which no channel is mere rounding.
fn floored(start: Measure) -> Measure {
    let floor = |norms: Scalars| norms.map(|norm| norm.max(FLOOR * largest(norms)));
    Measure { residual: floor(start.residual), normal_residual: floor(start.normal_residual) }
}

fn progress(
    iteration: usize,
    seconds: f64,
    operator_applications: usize,
    measure: Measure,
    start: &Measure,
) -> Progress {
    let (residual, normal_residual) = relative(&measure, start);
    Progress { iteration, seconds, operator_applications, residual, normal_residual, held_out: None }
}

fn outcome(end: Measure, history: &History, reason: StopReason) -> Outcome {
    let (true_residual, true_normal_residual) = relative(&end, &history.start);
    let iteration = history.progress.last().map_or(0, |last| last.iteration);
    let stop = Ending { reason, iteration };
    Outcome { history: history.clone(), stop, true_residual, true_normal_residual }
}

/// Norms relative to the start; a channel that starts at zero is at zero.
fn relative(now: &Measure, start: &Measure) -> (Scalars, Scalars) {
    let ratio = |now: Scalars, start: Scalars| {
        std::array::from_fn(|c| if start[c] > 0.0 { (now[c] / start[c]).sqrt() } else { 0.0 })
    };
    (ratio(now.residual, start.residual), ratio(now.normal_residual, start.normal_residual))
}

/// The measure itself, or an error where a NaN or an overflow has crept in.
fn finite(measure: Measure, iteration: usize) -> Result<Measure> {
    if measure.residual.iter().chain(&measure.normal_residual).all(|value| value.is_finite()) {
        Ok(measure)
    } else {
        Err(Error::NonFinite { what: "the residual".to_owned(), place: format!("iteration {iteration}") })
    }
}

fn largest(values: Scalars) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}
