//! What a solve would take.

use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use super::steps::Steps;
use super::volume::VolumePlan;
use super::{budget, machine};
use crate::Result;
use crate::operator::{LinearOperator, Vector};
use crate::problem::{LightMapProblem, Traced};
use crate::scene::{Scene, Strategy};
use crate::visibility::Geometry;

/// Rows that are timed.
const SAMPLE: usize = 16384;
/// How often.
const TRIALS: usize = 3;

/// What a solve would take, without doing it.
#[derive(Debug, Clone, Serialize)]
#[serde(untagged)]
pub enum Plan {
    /// Of a light map.
    LightMap(LightMapPlan),
    /// Of one stage of a volume.
    Volume(VolumePlan),
}

/// What the solve of a light map would take.
#[derive(Debug, Clone, Serialize)]
pub struct LightMapPlan {
    /// What the scene is called.
    pub scene: String,
    /// Its views.
    pub views: usize,
    /// Their pixels.
    pub pixels: usize,
    /// Painted pixels.
    pub rows: usize,
    /// Texels, and what is around them.
    pub unknowns: usize,
    /// Those of them that are not texels.
    pub surrounding_unknowns: usize,
    /// The bytes that those take beside the matrix.
    pub surrounding_bytes: u64,
    /// Foreseen from a sample of the rows.
    pub nonzeros: u64,
    /// Bytes of the matrix, if it is kept.
    pub matrix_bytes: u64,
    /// Bytes of everything else.
    pub other_bytes: u64,
    /// Bytes that may be used.
    pub budget_bytes: u64,
    /// `assembled`, `mixed` or `matrix-free`.
    pub strategy: &'static str,
    /// Share of the rows that is kept.
    pub kept: f64,
    /// Length of the rays over the light map, in texels.
    pub texels: f64,
    /// The part of it that is lit.
    pub lit_texels: f64,
    /// Seconds before the first iteration.
    pub set_up_seconds: f64,
    /// Seconds of both products.
    pub seconds_per_iteration: f64,
    /// Iterations at most.
    pub iterations: usize,
}

/// What a solve of a scene would take.
pub(super) fn plan(scene: &Scene, steps: &mut Steps<'_>) -> Result<LightMapPlan> {
    steps.begin("tracing", None);
    let geometry = Arc::new(Geometry::new(scene.mesh.clone())?);
    let clock = Instant::now();
    let problem = LightMapProblem::of(scene, &geometry, budget::painted(scene)?, &Traced)?;
    let set_up_seconds = clock.elapsed().as_secs_f64();
    let settings = budget::settled(scene, &problem);
    let budget = budget::budget(scene, &settings, &problem)?;
    let rows = problem.constraints.len();
    let kept = match settings.strategy {
        Strategy::MatrixFree => 0.0,
        _ => (budget as f64 / problem.kept_bytes().max(1) as f64).min(1.0),
    };
    let extents = (0..rows).map(|row| problem.traversal.extent(row));
    let (texels, lit_texels) =
        extents.fold((0.0, 0.0), |(all, lit), row| (all + row.texels, lit + row.lit_texels));
    Ok(LightMapPlan {
        scene: scene.name.clone(),
        views: scene.views.len(),
        pixels: scene.views.iter().map(|view| view.camera.size().iter().product::<usize>()).sum(),
        rows,
        unknowns: problem.elements(),
        surrounding_unknowns: problem.further_start.len(),
        surrounding_bytes: budget::surrounding_bytes(scene, &problem),
        nonzeros: problem.plan.nonzeros,
        matrix_bytes: problem.kept_bytes(),
        other_bytes: budget::fixed_bytes(scene, &settings, &problem),
        budget_bytes: settings.memory.unwrap_or_else(machine::default_budget),
        strategy: strategy(kept),
        kept,
        texels,
        lit_texels,
        set_up_seconds,
        seconds_per_iteration: seconds_per_iteration(&problem, kept)?,
        iterations: settings.iterations,
    })
}

/// Times both products on samples of the rows, kept and walked.
///
/// Part of the cost does not depend on the rows, so it takes two samples to foresee that of all.
fn seconds_per_iteration(problem: &LightMapProblem, kept: f64) -> Result<f64> {
    let rows = problem.constraints.len();
    let seconds = |strategy: Strategy| -> Result<f64> {
        let (few, many) =
            (timed(&problem.sampled(SAMPLE / 4), strategy)?, timed(&problem.sampled(SAMPLE), strategy)?);
        let slope = if many.0 > few.0 { (many.1 - few.1).max(0.0) / (many.0 - few.0) as f64 } else { 0.0 };
        Ok(many.1 + slope * rows.saturating_sub(many.0) as f64)
    };
    let kept_seconds = if kept > 0.0 { kept * seconds(Strategy::Assembled)? } else { 0.0 };
    let walked_seconds = if kept < 1.0 { (1.0 - kept) * seconds(Strategy::MatrixFree)? } else { 0.0 };
    Ok(kept_seconds + walked_seconds)
}

/// The number of rows, and the least seconds that both products took in a few trials.
fn timed(problem: &LightMapProblem, strategy: Strategy) -> Result<(usize, f64)> {
    Ok((problem.constraints.len(), least_seconds(&problem.operator_with(strategy, u64::MAX)?)?))
}

/// The least seconds that both products took in a few trials.
pub(super) fn least_seconds(operator: &impl LinearOperator) -> Result<f64> {
    let (mut x, mut y) = (operator.domain(), operator.range());
    x.fill([1.0; 3]);
    let mut least = f64::INFINITY;
    for _ in 0..TRIALS {
        let clock = Instant::now();
        operator.apply(&x, &mut y)?;
        operator.apply_adjoint(&y, &mut x)?;
        least = least.min(clock.elapsed().as_secs_f64());
    }
    Ok(least)
}

/// What keeping this share of the rows is called.
pub(super) fn strategy(kept: f64) -> &'static str {
    if kept >= 1.0 {
        "assembled"
    } else if kept > 0.0 {
        "mixed"
    } else {
        "matrix-free"
    }
}
