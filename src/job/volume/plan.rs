use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use super::super::machine;
use super::super::plan::{least_seconds, strategy};
use super::super::steps::Steps;
use super::memory;
use crate::problem::VolumeProblem;
use crate::scene::{Find, Strategy, VolumeScene};
use crate::visibility::Geometry;
use crate::{Error, Result};

/// Rows that are timed.
const SAMPLE: usize = 16384;

/// What the solve of one stage of a volume would take.
#[derive(Debug, Clone, Serialize)]
pub struct VolumePlan {
    /// What the scene is called.
    pub scene: String,
    /// What is looked for.
    pub find: String,
    /// What is looked for one by one: voxels, or lights.
    pub unit: &'static str,
    /// The scene's views.
    pub views: usize,
    /// Their pixels.
    pub pixels: usize,
    /// Wanted pixels.
    pub rows: usize,
    /// Pixels whose rays meet nothing that is looked for.
    pub beside: usize,
    /// Pixels without a logarithm.
    pub without_logarithm: usize,
    /// Voxels or lights that could be unknowns.
    pub candidates: usize,
    /// Those that are.
    pub unknowns: usize,
    /// Voxels outside the visual hull.
    pub outside_hull: usize,
    /// Bricks that hold nothing, of all.
    pub empty_bricks: usize,
    /// All bricks.
    pub bricks: usize,
    /// Foreseen from a sample of the rows.
    pub nonzeros: u64,
    /// Bytes of the matrix, if it is kept.
    pub matrix_bytes: u64,
    /// Bytes of everything else.
    pub other_bytes: u64,
    /// Bytes that may be used.
    pub budget_bytes: u64,
    /// `assembled`, `mixed`, `matrix-free` or `light volumes`.
    pub strategy: &'static str,
    /// Share of the rows that is kept.
    pub kept: f64,
    /// Seconds before the first iteration, of all stages.
    pub set_up_seconds: f64,
    /// Seconds of both products.
    pub seconds_per_iteration: f64,
    /// Iterations at most.
    pub iterations: usize,
}

/// What each stage of a scene would take.
pub(in crate::job) fn plans(
    scene: &VolumeScene,
    geometry: &Arc<Geometry>,
    steps: &mut Steps<'_>,
) -> Result<Vec<VolumePlan>> {
    let clock = Instant::now();
    let problems = super::problems(scene, geometry, steps)?;
    let set_up_seconds = clock.elapsed().as_secs_f64();
    let mut plans = Vec::with_capacity(problems.len());
    for (find, problem) in problems {
        let mut settings = VolumeProblem::settings(scene, find);
        memory::settle_metric(scene, &mut settings, &problem);
        let budget = memory::budget(scene, &settings, &problem)?;
        let is_of_lights = find == Find::Environment;
        let kept = match settings.strategy {
            Strategy::MatrixFree => 0.0,
            // Lights that do not fit are not kept in part: light volumes take their place.
            Strategy::Auto if is_of_lights && problem.kept_bytes() > budget => 0.0,
            _ => (budget as f64 / problem.kept_bytes().max(1) as f64).min(1.0),
        };
        let [empty_bricks, bricks] = problem.empty_bricks();
        plans.push(VolumePlan {
            scene: scene.name.clone(),
            find: find.name().to_owned(),
            unit: if is_of_lights { "lights" } else { "voxels" },
            views: scene.views.len(),
            pixels: scene.views.iter().map(|view| view.view.camera.size().iter().product::<usize>()).sum(),
            rows: problem.targets.len(),
            beside: problem.left_out.beside,
            without_logarithm: problem.left_out.without_logarithm,
            candidates: problem.candidates(),
            unknowns: problem.start.len(),
            outside_hull: problem.outside_hull,
            empty_bricks,
            bricks,
            nonzeros: problem.plan.nonzeros,
            matrix_bytes: problem.kept_bytes(),
            other_bytes: memory::stage_bytes(scene, &settings, &problem),
            budget_bytes: settings.memory.unwrap_or_else(machine::default_budget),
            strategy: if is_of_lights && kept == 0.0 { "light volumes" } else { strategy(kept) },
            kept,
            set_up_seconds,
            seconds_per_iteration: seconds_per_iteration(&problem, kept)?,
            iterations: settings.iterations,
        });
    }
    Ok(plans)
}

/// Times both products on a sample of the rows, and scales to all of them.
fn seconds_per_iteration(problem: &VolumeProblem, kept: f64) -> Result<f64> {
    let sample = problem.sampled(SAMPLE);
    let share = problem.targets.len() as f64 / sample.targets.len() as f64;
    let seconds =
        |strategy: Strategy| Ok::<_, Error>(share * least_seconds(&sample.operator(strategy, u64::MAX)?)?);
    let kept_seconds = if kept > 0.0 { kept * seconds(Strategy::Assembled)? } else { 0.0 };
    let walked_seconds = if kept < 1.0 { (1.0 - kept) * seconds(Strategy::MatrixFree)? } else { 0.0 };
    Ok(kept_seconds + walked_seconds)
}
