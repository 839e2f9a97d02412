//! The part of a solve that what computes matters to: from the problem to its solution, and how well that does.

use std::time::{Duration, Instant};

use super::checkpoint::Keeper;
use super::observer::Wish;
use super::steps::Steps;
use crate::operator::{CpuVector, Storage, TransportOperator, adjoint_test};
use crate::problem::{Assessment, Assessor, LightMapProblem, Paused, Snapshot, Solved, solve};
use crate::report::Work;
use crate::scene::{Rgb, Scene, SolveSettings};
use crate::solve::{Control, History};
use crate::{Error, Result};

/// How often a checkpoint is written.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(10);
/// The adjoint of this problem is tested with vectors made from this seed.
const SEED: u64 = 1;

/// An adjoint that is off by more says that the device computes something else: ten thousand roundings of f32.
const TRUSTED: f64 = 1e-3;

/// What is watched while a problem is solved.
#[derive(Clone, Copy)]
pub(crate) struct Watch<'a> {
    /// Where checkpoints go, if anywhere.
    pub(crate) checkpoint: Option<&'a Keeper>,
    /// Iterations at most.
    pub(crate) iterations: usize,
    /// The graphics adapter that computes, if one does.
    pub(crate) adapter: Option<&'a str>,
}

/// What is called after every iteration.
pub(crate) type Each<'a> = dyn FnMut(&History, &mut dyn Snapshot) -> Result<Control> + 'a;

/// A solution, and what there is to know about the operator.
pub(crate) struct Trial {
    pub(crate) coverage: CpuVector,
    pub(crate) adjoint_error: f64,
    pub(crate) storage: Storage,
    pub(crate) solved: Solved,
}

impl Watch<'_> {
    /// Tests an operator and solves with it: the observer hears of it, previews and checkpoints are written. `each` is
    /// called after every iteration.
    pub(crate) fn solve<O: TransportOperator>(
        &self,
        operator: &O,
        weights: &CpuVector,
        each: &mut dyn FnMut(),
        steps: &mut Steps<'_>,
        preview: &dyn Fn(&[Rgb]) -> Result<()>,
        solve: impl FnOnce(&CpuVector, &mut Each) -> Result<Solved>,
    ) -> Result<Trial> {
        let coverage = operator.squares(weights)?;
        let adjoint_error = adjoint_test(operator, 1, SEED)?.error;
        if let Some(adapter) = self.adapter {
            trust(adapter, adjoint_error)?;
        }
        let storage = operator.storage();
        tracing::info!(?storage, adjoint_error, "operator");

        steps.begin("solving", Some(self.iterations as u64));
        let mut saved = Instant::now();
        let solved = solve(&coverage, &mut |history, snapshot| {
            if snapshot.is_final() {
                if let Some(checkpoint) = self.checkpoint {
                    checkpoint.finish(history, snapshot)?;
                }
                return Ok(Control::Stop);
            }
            each();
            let wish = history.progress.last().map(|last| steps.iterated(last, self.iterations));
            if wish == Some(Wish::Preview) {
                preview(&snapshot.elements()?)?;
            }
            if let Some(checkpoint) = self.checkpoint
                && saved.elapsed() > CHECKPOINT_EVERY
            {
                checkpoint.keep(history, snapshot);
                saved = Instant::now();
            }
            Ok(if wish == Some(Wish::Stop) { Control::Stop } else { steps.control() })
        })?;
        Ok(Trial { coverage, adjoint_error, storage, solved })
    }
}

/// The processor, in words.
pub(crate) fn processor() -> String {
    format!("{}, {} threads", super::machine::processor(), rayon::current_num_threads())
}

/// What a graphics adapter was given to do, given how often it had been waited for after each iteration.
#[cfg(feature = "gpu")]
pub(crate) fn work(gpu: &crate::gpu::Gpu, trips: &[u64], deterministic: bool) -> Work {
    Work {
        round_trips: gpu.round_trips(),
        round_trips_an_iteration: match trips {
            [first, .., last] => Some((last - first) as f64 / (trips.len() - 1) as f64),
            _ => None,
        },
        dispatches: gpu.dispatches(),
        bytes: gpu.held(),
        deterministic,
    }
}

/// A light-map problem on its way.
#[derive(Clone, Copy)]
pub(crate) struct Task<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) settings: &'a SolveSettings,
    pub(crate) problem: &'a LightMapProblem,
    pub(crate) watch: Watch<'a>,
}

/// A light map, and what there is to know about it.
#[derive(Debug)]
pub(crate) struct Computed {
    pub(crate) coverage: CpuVector,
    pub(crate) adjoint_error: f64,
    pub(crate) storage: Storage,
    pub(crate) solved: Solved,
    pub(crate) before: Assessment,
    pub(crate) after: Assessment,
    /// `cpu` or `gpu`, and its name.
    pub(crate) backend: &'static str,
    pub(crate) device: String,
    /// What a graphics adapter was given to do.
    pub(crate) work: Option<Work>,
}

impl Task<'_> {
    /// Solves with the operator that `make` makes, and assesses the solution; `each` is called after every iteration.
    fn compute<O: TransportOperator>(
        &self,
        make: impl FnOnce() -> Result<O>,
        each: &mut dyn FnMut(),
        resumed: Option<Paused>,
        steps: &mut Steps<'_>,
        preview: &dyn Fn(&[Rgb]) -> Result<()>,
    ) -> Result<(Computed, O)> {
        let (scene, problem) = (self.scene, self.problem);
        steps.begin("walking", None);
        let operator = make()?;
        let trial =
            self.watch.solve(&operator, &problem.weights(), each, steps, preview, |coverage, each| {
                solve(problem, &operator, coverage, self.settings, resumed, each)
            })?;
        steps.begin("assessing", None);
        let views = scene.views.len();
        let assessor = Assessor::new(problem, &operator)?;
        let before = assessor.assess(&problem.starts(), views)?;
        let after = assessor.assess(&trial.solved.x, views)?;
        let Trial { coverage, adjoint_error, storage, solved } = trial;
        let computed = Computed {
            coverage,
            adjoint_error,
            storage,
            solved,
            before,
            after,
            backend: "cpu",
            device: processor(),
            work: None,
        };
        Ok((computed, operator))
    }

    fn budget(&self) -> Result<u64> {
        super::budget::budget(self.scene, self.settings, self.problem)
    }

    /// The same on the processor.
    pub(crate) fn on_cpu(
        &self,
        resumed: Option<Paused>,
        steps: &mut Steps<'_>,
        preview: &dyn Fn(&[Rgb]) -> Result<()>,
    ) -> Result<Computed> {
        let make = || self.problem.operator(self.scene, self.budget()?);
        Ok(self.compute(make, &mut || {}, resumed, steps, preview)?.0)
    }

    /// The same on a graphics adapter.
    #[cfg(feature = "gpu")]
    pub(crate) fn on_gpu(
        &self,
        gpu: &crate::gpu::Gpu,
        deterministic: bool,
        resumed: Option<Paused>,
        steps: &mut Steps<'_>,
        preview: &dyn Fn(&[Rgb]) -> Result<()>,
    ) -> Result<Computed> {
        let make = || self.problem.on_gpu(gpu, self.settings.strategy, self.budget()?, deterministic);
        let mut trips = Vec::new();
        let mut each = || trips.push(gpu.round_trips());
        let record = gpu.record();
        let task = Task { watch: Watch { adapter: Some(&record.name), ..self.watch }, ..*self };
        let (computed, operator) = task.compute(make, &mut each, resumed, steps, preview)?;
        Ok(Computed {
            backend: "gpu",
            device: device(record),
            work: Some(work(gpu, &trips, operator.is_deterministic())),
            ..computed
        })
    }
}

/// A graphics adapter, in words.
#[cfg(feature = "gpu")]
pub(crate) fn device(record: &crate::gpu::AdapterRecord) -> String {
    format!("{} ({}, {})", record.name, record.interface, record.driver)
}

/// Errors: [`Error::Adapter`] when T and Tᵀ of an adapter do not match, so that nothing it says can be trusted.
fn trust(adapter: &str, adjoint_error: f64) -> Result<()> {
    // Not `>`: a NaN must not pass.
    if adjoint_error <= TRUSTED {
        return Ok(());
    }
    Err(Error::Adapter {
        adapter: adapter.to_owned(),
        problem: format!(
            "computes a matrix and a transpose that do not match (adjoint error {adjoint_error:.0e})"
        ),
        remedy: "use --backend cpu, lower the maps' sizes, or update its driver",
    })
}
