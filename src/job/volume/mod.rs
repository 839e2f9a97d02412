//! From pictures to a volume, and to its light.

mod animate;
mod pictures;
mod results;
mod stage;
mod staging;

use std::sync::Arc;

use super::engine::Engine;
use super::environment::write_environment;
use super::folder::Folder;
use super::steps::{Steps, Timings};
use super::{Options, memory, warnings};
use crate::Result;
use crate::problem::{Canvas, Desired, Optics, VolumeProblem, VolumeRenderer, VolumeState};
use crate::report::{self, Report};
use crate::scene::{Camera, Find, Image, VolumeScene};
use crate::visibility::Geometry;
pub(super) use pictures::nothing_asked;
use pictures::turntable;
use stage::Place;
use staging::{Attained, StagesOutcome};

pub(super) use animate::{FoundAnimation, solve_keys};

/// A volume that was found, and all there is to know about it.
pub(crate) struct FoundVolume {
    outcome: StagesOutcome,
    turns: Vec<Image>,
}

/// Finds what a scene asks for, stage by stage; checkpoints and previews go to the folder, if there is one.
pub(super) fn solve(
    scene: &VolumeScene,
    options: &Options,
    engine: &mut Engine,
    folder: Option<&Folder>,
    steps: &mut Steps<'_>,
) -> Result<FoundVolume> {
    let place = Place { options, folder, prefix: "", is_later: false };
    steps.begin("lighting", None);
    let geometry = Arc::new(Geometry::new(scene.mesh.clone())?);
    let outcome = staging::run(scene, &geometry, engine, place, steps)?;
    steps.begin("turning", None);
    let model = VolumeProblem::model(scene, outcome.last.problem.find);
    let renderer =
        VolumeRenderer::new(scene, &outcome.attained.state.medium, &outcome.attained.optics, model);
    let turns = if options.pictures { options.turntable } else { 0 };
    let turns = turntable(&renderer, scene, turns, engine, steps)?;
    Ok(FoundVolume { outcome, turns })
}

impl FoundVolume {
    pub(super) fn is_interrupted(&self) -> bool {
        self.outcome.is_interrupted()
    }

    pub(super) fn state(&self) -> &VolumeState {
        &self.outcome.attained.state
    }

    /// The picture of a view, by its number.
    pub(super) fn picture(&self, view: usize) -> Option<&Image> {
        self.outcome.attained.after.get(view)
    }

    /// What is wanted of a view, pixel by pixel, and its weights.
    pub(super) fn wanted(&self, view: usize) -> Option<&[[f32; 4]]> {
        self.outcome.attained.desired.get(view).map(|desired| &desired.pixels[..])
    }

    /// What a camera sees that is none of a view's.
    pub(super) fn picture_from(&self, scene: &VolumeScene, camera: &Camera) -> Result<Image> {
        let Attained { state, optics, .. } = &self.outcome.attained;
        let model = VolumeProblem::model(scene, self.outcome.last.problem.find);
        VolumeRenderer::new(scene, &state.medium, optics, model).picture_from(camera, &Canvas::Processor)
    }

    pub(super) fn report(&self, scene: &VolumeScene, timings: &Timings) -> Result<Report> {
        self.outcome.report(scene, timings)
    }

    /// Writes everything but the report; what of it the page shows.
    pub(super) fn write(
        &self,
        scene: &VolumeScene,
        options: &Options,
        folder: &Folder,
    ) -> Result<report::Pictures> {
        let Attained { state, desired, before, after, .. } = &self.outcome.attained;
        results::write_volumes(folder, "", &scene.stages, &state.medium, &options.formats)?;
        let environment = match scene.stages.contains(&Find::Environment) {
            true => {
                let (basis, found) = (&scene.light_basis, &state.environment);
                Some(write_environment(folder, "environment", basis, found, None, scene.exposure)?)
            }
            false => None,
        };
        let views = match options.pictures {
            true => results::write_views(folder, "", scene, desired, before, after)?,
            false => Vec::new(),
        };
        Ok(report::Pictures {
            views,
            turntable: results::write_turntable(folder, "", &self.turns, scene.exposure)?,
            environment,
            ..report::Pictures::default()
        })
    }
}

/// Draws the views of a scene as they are and a turn around it; false when somebody stopped it.
pub(super) fn draw(
    scene: &VolumeScene,
    geometry: &Arc<Geometry>,
    prefix: &str,
    turns: usize,
    (engine, folder): (&mut Engine, &Folder),
    steps: &mut Steps<'_>,
    written: &mut Vec<String>,
) -> Result<bool> {
    warnings::tell_of_hidden(geometry);
    steps.begin("lighting", None);
    let optics = Optics::new(scene, geometry, &VolumeState::of(scene)?)?;
    let last = *scene.stages.last().ok_or_else(nothing_asked)?;
    let renderer = VolumeRenderer::new(scene, &scene.medium, &optics, VolumeProblem::model(scene, last));
    steps.begin("rendering", Some(scene.views.len() as u64));
    for (view, seen) in scene.views.iter().enumerate() {
        if steps.stops() {
            return Ok(false);
        }
        let name = format!("{prefix}{}", seen.view.name);
        folder.write_picture(
            &name,
            &engine.draw(|canvas| renderer.picture(view, canvas))?,
            scene.exposure,
        )?;
        written.push(format!("{name}.png"));
        steps.advance(view as u64 + 1, "");
    }
    let turns = turntable(&renderer, scene, turns, engine, steps)?;
    results::write_turntable(folder, prefix, &turns, scene.exposure)?;
    written.extend((0..turns.len()).map(|index| format!("{prefix}turntable_{index:03}.png")));
    Ok(true)
}

/// The problems of a scene's stages, each from the scene's own medium.
pub(super) fn problems(
    scene: &VolumeScene,
    geometry: &Arc<Geometry>,
    steps: &mut Steps<'_>,
) -> Result<Vec<VolumeProblem>> {
    let first = *scene.stages.first().ok_or_else(nothing_asked)?;
    steps.begin("lighting", None);
    let optics = Optics::new(scene, geometry, &VolumeState::of(scene)?)?;
    let renderer = VolumeRenderer::new(scene, &scene.medium, &optics, VolumeProblem::model(scene, first));
    let desired = Desired::of(scene, &|view| renderer.picture(view, &Canvas::Processor))?;
    steps.begin("tracing", None);
    let problem = |&find: &Find| {
        memory::check_light(scene, &optics, find)?;
        VolumeProblem::new(scene, &scene.medium, &optics, &desired, find)
    };
    scene.stages.iter().map(problem).collect()
}
