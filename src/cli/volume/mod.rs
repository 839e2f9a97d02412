//! `unscatter volume`: from pictures to a volume.

mod animate;
mod findings;
mod memory;
mod plan;
mod render;
mod results;
mod stage;
mod staging;
mod turntable;

use std::sync::Arc;

use super::args::VolumeArguments;
use super::engine::Engine;
use super::environment::write_environment;
use super::progress::{Steps, watch_interrupt};
use super::results::Folder;
use super::{Done, Manners, job};
use crate::problem::{Desired, Model, Optics, VolumeProblem, VolumeRenderer, VolumeState};
use crate::report::{self, Report};
use crate::scene::{Find, Image, VolumeMedium, VolumeScene};
use crate::visibility::Geometry;
use crate::{Error, Result};
use findings::Findings;
use stage::Place;
use staging::Outcome;

pub(super) use animate::{animate, of_frame};
pub(super) use memory::{budget, check_keys, check_scene};
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

    let place = Place { solve: &arguments.solve, folder: &folder, prefix: "", is_later: false };
    steps.begin("lighting", None);
    let geometry = job::geometry_of([&scene])?;
    let outcome = staging::run(&scene, &geometry, &mut engine, place, &mut steps)?;
    let Outcome { state, optics, desired, last, .. } = &outcome;
    steps.begin("turning", None);
    let model = VolumeProblem::model(&scene, last.find);
    let renderer = VolumeRenderer::new(&scene, &state.medium, optics, model);
    let turns = turntable::pictures(&renderer, &scene, arguments.turntable as usize)?;
    steps.begin("writing", None);
    results::write_volumes(&folder, "", &scene.stages, &state.medium, &formats)?;
    let environment = match scene.stages.contains(&Find::Environment) {
        true => {
            let (basis, found) = (&scene.light_basis, &state.environment);
            Some(write_environment(&folder, "environment", basis, found, None, scene.exposure)?)
        }
        false => None,
    };
    let in_page = report::Pictures {
        views: results::write_views(&folder, "", &scene, desired, &outcome.before, &outcome.after)?,
        turntable: results::write_turntable(&folder, "", &turns, scene.exposure)?,
        environment,
        ..report::Pictures::default()
    };
    let report = Findings { scene: &scene, outcome: &outcome }.report(steps.finish());
    folder.write_bytes("report.json", report.to_json()?.as_bytes())?;
    folder.write_bytes("report.html", report::html(&report, &in_page)?.as_bytes())?;
    folder.publish()?;
    manners.print(&report.to_json()?, &summary(&report, &folder));
    Ok(if outcome.is_interrupted() { Done::Interrupted } else { Done::Completely })
}

/// The problems of a scene's stages, each from the scene's own medium.
pub(super) fn problems(
    scene: &VolumeScene,
    geometry: &Arc<Geometry>,
    steps: &mut Steps,
) -> Result<Vec<(Find, VolumeProblem)>> {
    let first = *scene.stages.first().ok_or_else(nothing_asked)?;
    steps.begin("lighting", None);
    let optics = Optics::new(scene, geometry, &VolumeState::of(scene)?)?;
    let renderer = VolumeRenderer::new(scene, &scene.medium, &optics, VolumeProblem::model(scene, first));
    let desired = Desired::of(scene, &|view| renderer.picture(view))?;
    steps.begin("tracing", None);
    let problem = |&find: &Find| {
        memory::check_light(scene, &optics, find)?;
        Ok((find, VolumeProblem::new(scene, &scene.medium, &optics, &desired, find)?))
    };
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

fn nothing_asked() -> Error {
    Error::Empty { reason: "nothing is looked for".to_owned(), remedy: "say what to `find`" }
}

fn summary(report: &Report, folder: &Folder) -> String {
    let mut lines = Vec::new();
    for stage in &report.stages {
        lines.push(format!(
            "{}: {} pixels, {} of {} {}, {} non-zeros; residual {:.4} → {:.4} after {} iterations ({}){}",
            stage.label(),
            stage.problem.rows,
            stage.problem.active_unknowns,
            stage.problem.unknowns,
            stage.unknowns(),
            stage.problem.nonzeros,
            stage.weighted_residual.before,
            stage.weighted_residual.after,
            stage.stop.iteration,
            stage.stop.reason,
            if stage.is_taken { "" } else { "; not taken, for it came no nearer" },
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
    if let Some(animation) = &report.animation {
        let spread: u64 = animation.keys.iter().map(|key| key.spread_voxels).sum();
        lines.push(format!(
            "{} of {} frames from {} keys, in which diffusion filled {spread} voxels",
            animation.drawn,
            animation.frames,
            animation.keys.len(),
        ));
    }
    lines.push(format!("results in {}", folder.path().join("report.html").display()));
    lines.join("\n")
}
