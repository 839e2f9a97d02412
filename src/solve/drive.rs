use std::time::{Duration, Instant};

use super::{LeastSquares, Measure, Method};
use crate::operator::{LinearOperator, Scalars, Vector};
use crate::{Error, Result};

/// When to stop.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits {
    /// Iterations at most.
    pub iterations: usize,
    /// Stop when the normal residual has fallen to this part of its start, in every channel, each relative to its own.
    pub tolerance: f64,
    /// Stop after this long.
    pub time: Option<Duration>,
}

/// Where a solve is after an iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// From 0, the start.
    pub iteration: usize,
    /// Seconds of solving.
    pub seconds: f64,
    /// Applications of A and Aᵀ so far.
    pub operator_applications: usize,
    /// ‖b − A x‖ relative to the start.
    pub residual: Scalars,
    /// ‖Aᵀ (b − A x)‖ relative to the start.
    pub normal_residual: Scalars,
}

/// A solve so far; with the method's state, all that is needed to continue it.
#[derive(Debug, Clone, PartialEq)]
pub struct History {
    /// The start and every iteration since.
    pub progress: Vec<Progress>,
    /// The squared norms that progress is relative to: those of the start.
    pub start: Measure,
    /// How often the method began again because its recursion had parted from the truth.
    pub restarts: usize,
    /// The least true normal residual found at such a moment; infinite before the first.
    pub least_true: f64,
}

/// Why a solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum StopReason {
    /// The normal residual reached the tolerance, and the true residual confirmed it.
    Tolerance,
    /// The iteration limit.
    Iterations,
    /// The time limit.
    Time,
    /// Rounding: the recursion believes to have converged and the true residual no longer falls.
    Stagnation,
    /// The caller asked for it.
    Interrupted,
}

impl StopReason {
    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tolerance => "tolerance",
            Self::Iterations => "iterations",
            Self::Time => "time",
            Self::Stagnation => "stagnation",
            Self::Interrupted => "interrupted",
        }
    }
}

/// Why and when a solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stop {
    /// Why.
    pub reason: StopReason,
    /// After how many iterations.
    pub iteration: usize,
}

/// What a callback wants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// Go on.
    Continue,
    /// Stop here.
    Stop,
}

/// How a solve went.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// What happened on the way.
    pub history: History,
    /// Why it ended.
    pub stop: Stop,
    /// ‖b − A x‖ at the end relative to the start, computed anew and not by recursion.
    pub true_residual: Scalars,
    /// ‖Aᵀ (b − A x)‖ at the end relative to the start, computed anew.
    pub true_normal_residual: Scalars,
}

/// A channel that starts with less than this part of the largest squared norm is measured against that part: its
/// start is rounding, and cannot be improved on.
const FLOOR: f64 = 1e-12;
/// A true normal residual above the tolerance by more than this factor gives the lie to the recursive one.
const PARTED: f64 = 1.5;

/// Runs a method until it should stop.
///
/// `resumed` is the history of a method whose state has been restored; without it the method begins at `x0`.
/// `each` is called after every iteration, not at the start. Not reaching the tolerance is not an error.
///
/// Errors: [`Error::NonFinite`] naming the iteration, and what the method and `each` report.
pub fn drive<O: LinearOperator, M: Method<O>>(
    method: &mut M,
    problem: &LeastSquares<O>,
    x0: &O::Domain,
    limits: &Limits,
    resumed: Option<History>,
    mut each: impl FnMut(&History, &M) -> Result<Control>,
) -> Result<Outcome> {
    let clock = Instant::now();
    let mut history = match resumed {
        Some(history) => history,
        None => {
            method.begin(problem, x0)?;
            let start = floored(finite(method.measure(), 0)?);
            let progress = vec![progress(0, 0.0, method, &start)];
            History { progress, start, restarts: 0, least_true: f64::INFINITY }
        }
    };
    let before = history.progress.last().map_or(0.0, |last| last.seconds);
    loop {
        let seconds = before + clock.elapsed().as_secs_f64();
        let iteration = history.progress.last().map_or(0, |last| last.iteration);
        if let Some(mut reason) = reason_to_stop(&history, limits, seconds) {
            let outcome = finish(method, problem, &history, reason)?;
            let truth = outcome.true_normal_residual;
            let parted =
                reason == StopReason::Tolerance && truth.iter().any(|&r| r > PARTED * limits.tolerance);
            if !parted {
                return Ok(outcome);
            }
            // The recursion believes to be done and is not: begin again from the truth, while that still helps.
            let helps = largest(truth) < 0.5 * history.least_true;
            if !helps || iteration >= limits.iterations {
                reason = if helps { StopReason::Iterations } else { StopReason::Stagnation };
                return Ok(Outcome { stop: Stop { reason, iteration }, ..outcome });
            }
            history.least_true = largest(truth);
            history.restarts += 1;
            method.begin(problem, &copy(method.solution()))?;
        }
        method.step(problem)?;
        finite(method.measure(), iteration + 1)?;
        let seconds = before + clock.elapsed().as_secs_f64();
        history.progress.push(progress(iteration + 1, seconds, method, &history.start));
        if each(&history, method)? == Control::Stop {
            return finish(method, problem, &history, StopReason::Interrupted);
        }
    }
}

/// What there is to say at the end, with the residuals computed anew.
fn finish<O: LinearOperator, M: Method<O>>(
    method: &M,
    problem: &LeastSquares<O>,
    history: &History,
    reason: StopReason,
) -> Result<Outcome> {
    let (true_residual, true_normal_residual) = relative(&true_measure(method, problem)?, &history.start);
    let iteration = history.progress.last().map_or(0, |last| last.iteration);
    Ok(Outcome {
        history: history.clone(),
        stop: Stop { reason, iteration },
        true_residual,
        true_normal_residual,
    })
}

/// A start to be relative to, in which no channel is mere rounding.
fn floored(start: Measure) -> Measure {
    let floor = |norms: Scalars| norms.map(|norm| norm.max(FLOOR * largest(norms)));
    Measure { residual: floor(start.residual), normal_residual: floor(start.normal_residual) }
}

fn reason_to_stop(history: &History, limits: &Limits, seconds: f64) -> Option<StopReason> {
    let last = history.progress.last()?;
    if last.normal_residual.iter().all(|&residual| residual <= limits.tolerance) {
        Some(StopReason::Tolerance)
    } else if last.iteration >= limits.iterations {
        Some(StopReason::Iterations)
    } else if limits.time.is_some_and(|limit| seconds >= limit.as_secs_f64()) {
        Some(StopReason::Time)
    } else {
        None
    }
}

fn progress<O: LinearOperator, M: Method<O>>(
    iteration: usize,
    seconds: f64,
    method: &M,
    start: &Measure,
) -> Progress {
    let (residual, normal_residual) = relative(&method.measure(), start);
    Progress { iteration, seconds, operator_applications: method.applications(), residual, normal_residual }
}

fn true_measure<O: LinearOperator, M: Method<O>>(method: &M, problem: &LeastSquares<O>) -> Result<Measure> {
    let (mut r, mut s) = (problem.operator.range(), problem.operator.domain());
    problem.residual(method.solution(), &mut r)?;
    problem.operator.apply_adjoint(&r, &mut s)?;
    Ok(Measure { residual: r.norm_squared()?, normal_residual: s.norm_squared()? })
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

fn copy<V: Vector>(vector: &V) -> V {
    let mut copied = vector.zeros_like();
    copied.copy_from(vector);
    copied
}
