use super::super::Options;
use super::super::checkpoint::Keeper;
use super::super::compute::{Computed, ProblemSolve};
use super::super::engine::Engine;
use super::super::findings::Findings;
use super::super::folder::Folder;
use super::super::memory::{MemoryBudget, check_light};
use super::super::steps::Steps;
use crate::problem::{Canvas, Desired, HoldOut, Optics, VolumeProblem, VolumeRenderer, VolumeState};
use crate::scene::{Find, Rgb, SolveSettings, VolumeScene};
use crate::{Error, Result};

/// How solves are run, and where their files go.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    pub(super) options: &'a Options,
    /// Where checkpoints and previews go, if anywhere.
    pub(super) folder: Option<&'a Folder>,
    /// What the names of their files begin with.
    pub(super) prefix: &'a str,
    /// Whether others were solved before, so that there need not be a checkpoint to resume from.
    pub(super) is_later: bool,
}

/// One property to be found.
#[derive(Clone, Copy)]
pub(super) struct PropertySearch<'a> {
    pub(super) scene: &'a VolumeScene,
    pub(super) state: &'a VolumeState,
    pub(super) optics: &'a Optics,
    pub(super) desired: &'a [Desired],
    /// The pixels that are kept out of the fit.
    pub(super) held_out: Option<&'a HoldOut>,
    pub(super) find: Find,
}

/// A property that was found, and what there is to know about it.
pub(super) struct Stage {
    pub(super) problem: VolumeProblem,
    settings: SolveSettings,
    pub(super) computed: Computed,
    /// The state with what was found.
    pub(super) state: VolumeState,
}

impl Stage {
    pub(super) fn findings(&self) -> Findings<'_> {
        Findings { problem: &self.problem, settings: &self.settings, computed: &self.computed }
    }
}

impl PropertySearch<'_> {
    pub(super) fn solve(&self, engine: &mut Engine, place: Place, steps: &mut Steps<'_>) -> Result<Stage> {
        steps.begin("tracing", None);
        check_light(self.scene, self.optics, self.find)?;
        let problem =
            VolumeProblem::new(self.scene, &self.state.medium, self.optics, self.desired, self.find)?;
        let problem = match self.held_out {
            Some(pixels) => problem.holding_out(pixels, self.scene.solve.strategy)?,
            None => problem,
        };
        steps.go_on()?;
        let memory = MemoryBudget::of_volume(self.scene);
        let settings = memory.settled(VolumeProblem::settings(self.scene, self.find), &problem)?;
        let name = format!("{}checkpoint", place.prefix);
        let keeper = |folder| Keeper::new(folder, &name, &settings, &problem);
        let checkpoint = place.folder.map(keeper).transpose()?;
        let resumed = match &checkpoint {
            Some(checkpoint) if place.options.resume => match checkpoint.resumed(place.is_later) {
                // The checkpoint of a later stage; this one is quickly done again.
                Err(Error::Checkpoint { .. }) if self.scene.stages.len() > 1 => None,
                resumed => resumed?,
            },
            _ => None,
        };
        let task = ProblemSolve {
            problem: &problem,
            settings: &settings,
            memory: &memory,
            options: place.options,
            checkpoint: checkpoint.as_ref(),
            preview: &|x| self.preview(&problem, place, x),
        };
        let (computed, ()) = task.run(engine, resumed, steps, &|_, _, _| Ok(()))?;
        let state = problem.apply(self.state, &computed.solved.x)?;
        Ok(Stage { problem, settings, computed, state })
    }

    fn preview(&self, problem: &VolumeProblem, place: Place, x: &[Rgb]) -> Result<()> {
        let Some(folder) = place.folder else { return Ok(()) };
        let state = problem.apply(self.state, x)?;
        let optics = Optics::new(self.scene, self.optics.geometry(), &state)?;
        let model = VolumeProblem::model(self.scene, self.find);
        let renderer = VolumeRenderer::new(self.scene, &state.medium, &optics, model);
        for (view, seen) in self.scene.views.iter().enumerate() {
            let name = format!("{}{}_after", place.prefix, seen.view.name);
            folder.write_picture(&name, &renderer.picture(view, &Canvas::Processor)?, self.scene.exposure)?;
        }
        folder.publish_preview()
    }
}
