//! `unscatter volume`: from pictures to a volume.

mod findings;
mod memory;
mod plan;
mod render;
mod results;
mod stage;
mod turntable;

use super::args::VolumeArguments;
use super::engine::Engine;
use super::progress::{Steps, watch_interrupt};
use super::results::Folder;
use super::{Done, Manners, job};
use crate::problem::{Desired, Model, Optics, VolumeProblem, VolumeRenderer};
use crate::report::{self, Report};
use crate::scene::{Find, Image, VolumeMedium, VolumeScene};
use crate::solve::StopReason;
use crate::{Error, Result};
use findings::Findings;
use stage::Stage;

pub(super) use memory::{budget, check_scene};
pub(super) use plan::plan;
pub(super) use render::render;

/// `unscatter volume`: finds what the scene asks for, stage by stage, and writes volumes, pictures and a report.
pub(super) fn run(arguments: &VolumeArguments, manners: &Manners) -> Result<Done> {
    let mut steps = Steps::new(manners.quiet);
    steps.begin("reading", None);
    let scene = job::load_volume(&arguments.scene, &arguments.overrides())?;
    let formats = arguments.formats()?;
    let mut engine = Engine::choose(&arguments.backend)?;
    let folder = Folder::create(arguments.output.output.clone(), &arguments.scene.scene)?;
    watch_interrupt()?;

    steps.begin("lighting", None);
    let first = *scene.stages.first().ok_or_else(nothing_asked)?;
    let optics = Optics::new(&scene, &scene.medium)?;
    let before = pictures(&scene, &scene.medium, &optics, VolumeProblem::model(&scene, first), &mut steps)?;
    let desired = Desired::of(&scene, &|view| Ok(before[view].clone()))?;

    let (mut medium, mut stages, mut optics) = (scene.medium.clone(), Vec::new(), optics);
    let mut after = before.clone();
    for &find in &scene.stages {
        if !stages.is_empty() {
            after = pictures(&scene, &medium, &optics, VolumeProblem::model(&scene, find), &mut steps)?;
        }
        let task = stage::Task { scene: &scene, medium: &medium, optics: &optics, desired: &desired, find };
        let stage = task.solve(&mut engine, arguments, &folder, &mut steps)?;
        let pictures_before = std::mem::take(&mut after);
        medium = stage.medium.clone();
        if find == Find::Extinction {
            // Only extinction changes how light comes through.
            steps.begin("lighting", None);
            optics = Optics::new(&scene, &medium)?;
        }
        after = pictures(&scene, &medium, &optics, VolumeProblem::model(&scene, find), &mut steps)?;
        let interrupted = stage.trial.solved.outcome.stop.reason == StopReason::Interrupted;
        stages.push(Stage {
            before: residuals(&desired, &pictures_before),
            after: residuals(&desired, &after),
            ..stage
        });
        if interrupted {
            break;
        }
    }
    let last = stages.last().ok_or_else(nothing_asked)?;

    steps.begin("turning", None);
    let model = VolumeProblem::model(&scene, last.find);
    let renderer = VolumeRenderer::new(&scene, &medium, &optics, model);
    let turns = turntable::pictures(&renderer, &scene, arguments.turntable as usize)?;
    steps.begin("writing", None);
    for stage in &stages {
        results::write_volumes(&folder, stage.find, &medium, &formats)?;
    }
    let in_page = report::Pictures {
        views: results::write_views(&folder, &scene, &desired, &before, &after)?,
        light_map: Vec::new(),
        turntable: results::write_turntable(&folder, &turns, scene.exposure)?,
        coverage: None,
    };
    let findings = Findings { scene: &scene, desired: &desired, stages: &stages };
    let report = findings.report(steps.finish());
    folder.write_bytes("report.json", report.to_json()?.as_bytes())?;
    folder.write_bytes("report.html", report::html(&report, &in_page)?.as_bytes())?;
    folder.publish()?;
    manners.print(&report.to_json()?, &summary(&report, &folder));
    let was_interrupted = last.trial.solved.outcome.stop.reason == StopReason::Interrupted;
    Ok(if was_interrupted { Done::Interrupted } else { Done::Completely })
}

/// The problems of a scene's stages, each from the scene's own medium.
pub(super) fn problems(scene: &VolumeScene, steps: &mut Steps) -> Result<Vec<(Find, VolumeProblem)>> {
    let first = *scene.stages.first().ok_or_else(nothing_asked)?;
    steps.begin("lighting", None);
    let optics = Optics::new(scene, &scene.medium)?;
    let renderer = VolumeRenderer::new(scene, &scene.medium, &optics, VolumeProblem::model(scene, first));
    let desired = Desired::of(scene, &|view| renderer.picture(view))?;
    steps.begin("tracing", None);
    let problem =
        |&find: &Find| Ok((find, VolumeProblem::new(scene, &scene.medium, &optics, &desired, find)?));
    scene.stages.iter().map(problem).collect()
}

/// The pictures of all views.
pub(super) fn pictures(
    scene: &VolumeScene,
    medium: &VolumeMedium,
    optics: &Optics,
    model: Model,
    steps: &mut Steps,
) -> Result<Vec<Image>> {
    steps.begin("rendering", Some(scene.views.len() as u64));
    let renderer = VolumeRenderer::new(scene, medium, optics, model);
    let draw = |view: usize| {
        let picture = renderer.picture(view)?;
        steps.advance(view as u64 + 1, String::new());
        Ok(picture)
    };
    (0..scene.views.len()).map(draw).collect()
}

/// How far the pictures are from what is wanted: view by view, and all together.
fn residuals(desired: &[Desired], pictures: &[Image]) -> (Vec<f64>, f64) {
    let (views, sums): (Vec<f64>, Vec<[f64; 2]>) =
        desired.iter().zip(pictures).map(|(desired, picture)| desired.residual(picture)).unzip();
    let [miss, all] = sums.iter().fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
    (views, if all > 0.0 { (miss / all).sqrt() } else { 0.0 })
}

fn nothing_asked() -> Error {
    Error::Empty { reason: "nothing is looked for".to_owned(), remedy: "say what to `find`" }
}

fn summary(report: &Report, folder: &Folder) -> String {
    let mut lines = Vec::new();
    for stage in &report.stages {
        lines.push(format!(
            "{}: {} pixels, {} of {} voxels, {} non-zeros; residual {:.4} → {:.4} after {} iterations ({})",
            stage.find,
            stage.problem.rows,
            stage.problem.active_unknowns,
            stage.problem.unknowns,
            stage.problem.nonzeros,
            stage.weighted_residual.before,
            stage.weighted_residual.after,
            stage.stop.iteration,
            stage.stop.reason,
        ));
    }
    for view in &report.matched {
        let residual = view.weighted_residual;
        lines.push(format!("  {:<16} residual {:.4} → {:.4}", view.view, residual.before, residual.after));
    }
    lines.push(format!(
        "residual {:.4} → {:.4}, {:.2} s in all",
        report.weighted_residual.before,
        report.weighted_residual.after,
        report.timings.get("total").copied().unwrap_or_default()
    ));
    lines.push(format!("results in {}", folder.path().join("report.html").display()));
    lines.join("\n")
}
