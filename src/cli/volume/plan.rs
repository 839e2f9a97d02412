use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use super::super::args::SceneArguments;
use super::super::job::mebibytes;
use super::super::plan::{least_seconds, strategy};
use super::super::progress::Steps;
use super::super::{Done, Manners, job, machine, to_json};
use super::memory;
use crate::problem::VolumeProblem;
use crate::scene::{Find, Strategy, VolumeScene};
use crate::visibility::Geometry;
use crate::{Error, Result};

/// Rows that are timed.
const SAMPLE: usize = 16384;

#[derive(Serialize)]
struct Plan {
    scene: String,
    find: String,
    /// What is looked for one by one: voxels, or lights.
    unit: &'static str,
    views: usize,
    pixels: usize,
    rows: usize,
    /// Pixels whose rays meet nothing that is looked for, and those without a logarithm.
    beside: usize,
    without_logarithm: usize,
    candidates: usize,
    unknowns: usize,
    outside_hull: usize,
    empty_bricks: usize,
    bricks: usize,
    /// Foreseen from a sample of the rows.
    nonzeros: u64,
    matrix_bytes: u64,
    other_bytes: u64,
    budget_bytes: u64,
    strategy: &'static str,
    /// Share of the rows that is kept.
    kept: f64,
    set_up_seconds: f64,
    seconds_per_iteration: f64,
    iterations: usize,
}

/// `unscatter plan` of a volume: what its solves would take.
pub(in crate::cli) fn plan(arguments: &SceneArguments, manners: &Manners) -> Result<Done> {
    let mut steps = Steps::new(manners.quiet);
    steps.begin("reading", None);
    let mut plans = Vec::new();
    let scenes = job::load_volumes(arguments)?;
    let geometry = job::geometry_of(scenes.iter().map(|(_, scene)| scene))?;
    for (_, scene) in &scenes {
        plans.extend(plans_of(scene, &geometry, &mut steps)?);
    }
    steps.finish();
    let words: Vec<String> = plans.iter().map(words).collect();
    manners.print(&to_json(&plans)?, &words.join("\n"));
    Ok(Done::Completely)
}

/// What each stage of a scene would take.
fn plans_of(scene: &VolumeScene, geometry: &Arc<Geometry>, steps: &mut Steps) -> Result<Vec<Plan>> {
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
            Strategy::Auto if is_of_lights && problem.plan.bytes > budget => 0.0,
            _ => (budget as f64 / problem.plan.bytes.max(1) as f64).min(1.0),
        };
        let [empty_bricks, bricks] = problem.empty_bricks();
        plans.push(Plan {
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
            matrix_bytes: problem.plan.bytes,
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

fn words(plan: &Plan) -> String {
    let iteration = plan.seconds_per_iteration;
    format!(
        "{}, {}: {} views, {} pixels\n\
         rows        {} wanted pixels; {} more meet nothing that is looked for, {} have no logarithm\n\
         unknowns    {} of {} {}; {} are outside the visual hull, {} of {} bricks are empty\n\
         non-zeros   about {}\n\
         matrix      {} if kept, and {} for everything else; {} are allowed\n\
         strategy    {} ({:.0} % of the rows are kept)\n\
         time        {:.2} s to set up, then about {iteration:.3} s an iteration: at most {:.1} s for {} iterations",
        plan.scene,
        plan.find,
        plan.views,
        plan.pixels,
        plan.rows,
        plan.beside,
        plan.without_logarithm,
        plan.unknowns,
        plan.candidates,
        plan.unit,
        plan.outside_hull,
        plan.empty_bricks,
        plan.bricks,
        plan.nonzeros,
        mebibytes(plan.matrix_bytes),
        mebibytes(plan.other_bytes),
        mebibytes(plan.budget_bytes),
        plan.strategy,
        100.0 * plan.kept,
        plan.set_up_seconds,
        iteration * plan.iterations as f64,
        plan.iterations,
    )
}
