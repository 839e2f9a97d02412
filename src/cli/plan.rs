use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use super::args::SceneArguments;
use super::progress::Steps;
use super::{Done, Manners, job, machine, to_json};
use crate::io::scene_file::Subject;
use crate::operator::{LinearOperator, Vector};
use crate::problem::{LightMapProblem, Traced};
use crate::scene::Strategy;
use crate::visibility::Geometry;
use crate::{Result, io};

/// Rows that are timed.
const SAMPLE: usize = 16384;
/// How often.
const TRIALS: usize = 3;

#[derive(Serialize)]
struct Plan {
    scene: String,
    views: usize,
    pixels: usize,
    rows: usize,
    unknowns: usize,
    /// Those of them that are not texels, and the bytes that they take beside the matrix.
    surrounding_unknowns: usize,
    surrounding_bytes: u64,
    /// Foreseen from a sample of the rows.
    nonzeros: u64,
    matrix_bytes: u64,
    other_bytes: u64,
    budget_bytes: u64,
    strategy: &'static str,
    /// Share of the rows that is kept.
    kept: f64,
    /// Length of the rays over the light map, in texels, and the part of it that is lit.
    texels: f64,
    lit_texels: f64,
    set_up_seconds: f64,
    seconds_per_iteration: f64,
    iterations: usize,
}

/// `unscatter plan`: what a solve would take.
pub(super) fn run(arguments: &SceneArguments, manners: &Manners) -> Result<Done> {
    if io::scene_file::subject(&arguments.scene)? != Subject::LightMap {
        return super::volume::plan(arguments, manners);
    }
    let mut steps = Steps::new(manners.quiet);
    steps.begin("reading", None);
    let mut scene = job::load(arguments, &[])?;
    job::check_surroundings(&scene)?;
    steps.begin("tracing", None);
    let geometry = Arc::new(Geometry::new(scene.mesh.clone())?);
    let clock = Instant::now();
    let problem = LightMapProblem::with(&scene, &geometry, &Traced)?;
    let set_up_seconds = clock.elapsed().as_secs_f64();
    job::settle_metric(&mut scene, &problem);
    let budget = job::budget(&scene, &problem)?;
    let rows = problem.constraints.len();
    let kept = match scene.solve.strategy {
        Strategy::MatrixFree => 0.0,
        _ => (budget as f64 / problem.plan.bytes.max(1) as f64).min(1.0),
    };
    let extents = (0..rows).map(|row| problem.traversal.extent(row));
    let (texels, lit_texels) =
        extents.fold((0.0, 0.0), |(all, lit), row| (all + row.texels, lit + row.lit_texels));
    let plan = Plan {
        scene: scene.name.clone(),
        views: scene.views.len(),
        pixels: scene.views.iter().map(|view| view.camera.size().iter().product::<usize>()).sum(),
        rows,
        unknowns: problem.elements(),
        surrounding_unknowns: problem.further_start.len(),
        surrounding_bytes: job::surrounding_bytes(&scene, &problem),
        nonzeros: problem.plan.nonzeros,
        matrix_bytes: problem.plan.bytes,
        other_bytes: job::fixed_bytes(&scene, &problem),
        budget_bytes: scene.solve.memory.unwrap_or_else(machine::default_budget),
        strategy: strategy(kept),
        kept,
        texels,
        lit_texels,
        set_up_seconds,
        seconds_per_iteration: seconds_per_iteration(&problem, kept)?,
        iterations: scene.solve.iterations,
    };
    steps.finish();
    manners.print(&to_json(&plan)?, &words(&plan));
    Ok(Done::Completely)
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

fn words(plan: &Plan) -> String {
    let iteration = plan.seconds_per_iteration;
    format!(
        "{}: {} views, {} pixels\n\
         rows        {} painted pixels; the other pixels are skipped\n\
         unknowns    {} texels, of which only those that painted rays reach are solved for{}\n\
         non-zeros   about {}; {:.0} % of the rays' length over the map is in shadow and skipped\n\
         matrix      {} if kept, and {} for everything else; {} are allowed\n\
         strategy    {} ({:.0} % of the rows are kept)\n\
         time        {:.2} s to set up, then about {iteration:.3} s an iteration: at most {:.1} s for {} iterations",
        plan.scene,
        plan.views,
        plan.pixels,
        plan.rows,
        plan.unknowns - plan.surrounding_unknowns,
        match plan.surrounding_unknowns {
            0 => String::new(),
            further => format!(
                "; and {further} around them, for {} of shadow maps and weights",
                job::mebibytes(plan.surrounding_bytes)
            ),
        },
        plan.nonzeros,
        100.0 * (1.0 - plan.lit_texels / plan.texels.max(f64::MIN_POSITIVE)),
        job::mebibytes(plan.matrix_bytes),
        job::mebibytes(plan.other_bytes),
        job::mebibytes(plan.budget_bytes),
        plan.strategy,
        100.0 * plan.kept,
        plan.set_up_seconds,
        iteration * plan.iterations as f64,
        plan.iterations,
    )
}
