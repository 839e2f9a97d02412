use super::super::Options;
use super::super::checkpoint::{self, Keeper};
use super::super::compute::{Trial, Watch, processor};
#[cfg(feature = "gpu")]
use super::super::compute::{device, work};
use super::super::engine::{Engine, On};
use super::super::folder::Folder;
use super::super::steps::Steps;
use super::memory;
use crate::operator::{TransportOperator, Vector};
use crate::problem::{Desired, Optics, Paused, VolumeProblem, VolumeRenderer, VolumeState, minimize};
use crate::report::Work;
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
pub(super) struct Task<'a> {
    pub(super) scene: &'a VolumeScene,
    pub(super) state: &'a VolumeState,
    pub(super) optics: &'a Optics,
    pub(super) desired: &'a [Desired],
    pub(super) find: Find,
}

/// A property that was found, and what there is to know about it.
pub(super) struct Stage {
    pub(super) find: Find,
    pub(super) problem: VolumeProblem,
    pub(super) settings: SolveSettings,
    pub(super) trial: Trial,
    /// The state with what was found.
    pub(super) state: VolumeState,
    /// `cpu` or `gpu`, and its name.
    pub(super) backend: &'static str,
    pub(super) device: String,
    /// What a graphics adapter was given to do.
    pub(super) work: Option<Work>,
    /// Bytes that everything but the kept rows takes.
    pub(super) other_bytes: u64,
}

impl Task<'_> {
    pub(super) fn solve(&self, engine: &mut Engine, place: Place, steps: &mut Steps<'_>) -> Result<Stage> {
        steps.begin("tracing", None);
        let mut settings = VolumeProblem::settings(self.scene, self.find);
        memory::check_light(self.scene, self.optics, self.find)?;
        let problem =
            VolumeProblem::new(self.scene, &self.state.medium, self.optics, self.desired, self.find)?;
        memory::settle_metric(self.scene, &mut settings, &problem);
        let budget = memory::budget(self.scene, &settings, &problem)?;
        let name = format!("{}checkpoint", place.prefix);
        let keeper = |folder| Keeper::new(folder, &name, checkpoint::of_volume(&settings, &problem));
        let checkpoint = place.folder.map(keeper);
        let resumed = match &checkpoint {
            Some(checkpoint) if place.options.resume => match checkpoint.read() {
                Ok(paused) => Some(paused),
                // The checkpoint of a later stage; this one is quickly done again.
                Err(Error::Checkpoint { .. }) if self.scene.stages.len() > 1 => None,
                Err(Error::File { source, .. })
                    if place.is_later && source.kind() == std::io::ErrorKind::NotFound =>
                {
                    None
                }
                Err(error) => return Err(error),
            },
            _ => None,
        };
        let watch = Watch { checkpoint: checkpoint.as_ref(), iterations: settings.iterations, adapter: None };
        let preview = |x: &[Rgb]| self.preview(&problem, place, x);
        let other_bytes = memory::stage_bytes(self.scene, &settings, &problem);
        let run = Run { problem: &problem, settings: &settings };
        let (trial, backend, device, work) =
            engine.run(checkpoint.as_ref(), place.options.resume, resumed, |on, resumed| match on {
                On::Cpu => {
                    steps.begin("walking", None);
                    let operator = problem.operator(settings.strategy, budget)?;
                    let trial = run.with(&operator, &watch, resumed, &mut || {}, steps, &preview)?;
                    Ok((trial, "cpu", processor(), None))
                }
                #[cfg(feature = "gpu")]
                On::Gpu(gpu) => {
                    steps.begin("walking", None);
                    let deterministic = place.options.deterministic;
                    let operator = problem.on_gpu(&gpu, settings.strategy, budget, deterministic)?;
                    let mut trips = Vec::new();
                    let record = gpu.record();
                    let watch = Watch { adapter: Some(&record.name), ..watch };
                    let mut each = || trips.push(gpu.round_trips());
                    let trial = run.with(&operator, &watch, resumed, &mut each, steps, &preview)?;
                    let work = work(&gpu, &trips, operator.is_deterministic());
                    Ok((trial, "gpu", device(record), Some(work)))
                }
            })?;
        let state = problem.apply(self.state, &trial.solved.x)?;
        Ok(Stage { find: self.find, problem, settings, trial, state, backend, device, work, other_bytes })
    }

    fn preview(&self, problem: &VolumeProblem, place: Place, x: &[Rgb]) -> Result<()> {
        let Some(folder) = place.folder else { return Ok(()) };
        let state = problem.apply(self.state, x)?;
        let optics = Optics::new(self.scene, self.optics.geometry(), &state)?;
        let model = VolumeProblem::model(self.scene, self.find);
        let renderer = VolumeRenderer::new(self.scene, &state.medium, &optics, model);
        for (view, seen) in self.scene.views.iter().enumerate() {
            let name = format!("{}{}_after", place.prefix, seen.view.name);
            folder.write_picture(&name, &renderer.picture(view)?, self.scene.exposure)?;
        }
        folder.publish()
    }
}

struct Run<'a> {
    problem: &'a VolumeProblem,
    settings: &'a SolveSettings,
}

impl Run<'_> {
    fn with<O: TransportOperator>(
        &self,
        operator: &O,
        watch: &Watch,
        resumed: Option<Paused>,
        each: &mut dyn FnMut(),
        steps: &mut Steps<'_>,
        preview: &dyn Fn(&[Rgb]) -> Result<()>,
    ) -> Result<Trial> {
        let formulation = self.problem.formulation();
        let weights = self.problem.row_weights();
        debug_assert!(!weights.is_empty());
        watch.solve(operator, &weights, each, steps, preview, |coverage, each| {
            minimize(&formulation, operator, coverage, self.settings, resumed, each)
        })
    }
}
