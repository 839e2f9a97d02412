//! The part of `light-map` that what computes matters to: from the problem to its solution, and how well that does.

use std::time::{Duration, Instant};

use super::progress::{Steps, interrupted};
use super::resume::Keeper;
use crate::cpu::Storage;
use crate::operator::{CpuVector, adjoint_test};
use crate::problem::{Assessment, Assessor, LightMapProblem, Paused, Solved, TransportOperator, solve};
use crate::report::Work;
use crate::scene::{Rgb, Scene};
use crate::solve::Control;
use crate::{Error, Result};

/// How often a checkpoint is written.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(10);
/// The adjoint of this problem is tested with vectors made from this seed.
const SEED: u64 = 1;

/// An adjoint that is off by more says that the device computes something else: ten thousand roundings of f32.
const TRUSTED: f64 = 1e-3;

/// A light-map problem on its way.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub(super) scene: &'a Scene,
    pub(super) problem: &'a LightMapProblem,
    pub(super) checkpoint: &'a Keeper,
    /// How often to call what shows the light map so far.
    pub(super) preview_every: Option<usize>,
    /// The graphics adapter that computes, if one does.
    pub(super) adapter: Option<&'a str>,
}

/// A light map, and what there is to know about it.
pub(super) struct Computed {
    pub(super) coverage: CpuVector,
    pub(super) adjoint_error: f64,
    pub(super) storage: Storage,
    pub(super) solved: Solved,
    pub(super) before: Assessment,
    pub(super) after: Assessment,
    /// `cpu` or `gpu`, and its name.
    pub(super) backend: &'static str,
    pub(super) device: String,
    /// What a graphics adapter was given to do.
    pub(super) work: Option<Work>,
}

impl Task<'_> {
    /// Solves with the operator that `make` makes, and assesses the solution; `each` is called after every iteration.
    pub(super) fn compute<O: TransportOperator>(
        &self,
        make: impl FnOnce() -> Result<O>,
        each: &mut dyn FnMut(),
        resumed: Option<Paused>,
        steps: &mut Steps,
        preview: &dyn Fn(&[Rgb]) -> Result<()>,
    ) -> Result<(Computed, O)> {
        let (scene, problem) = (self.scene, self.problem);
        steps.begin("walking", None);
        let operator = make()?;
        let coverage = operator.squares(&problem.weights())?;
        let adjoint_error = adjoint_test(&operator, 1, SEED)?.error;
        if let Some(adapter) = self.adapter {
            trust(adapter, adjoint_error)?;
        }
        let storage = operator.storage();
        tracing::info!(?storage, adjoint_error, "operator");

        steps.begin("solving", Some(scene.solve.iterations as u64));
        let mut saved = Instant::now();
        let solved = solve(problem, &operator, &coverage, &scene.solve, resumed, |history, snapshot| {
            each();
            if let Some(last) = history.progress.last() {
                let worst = last.normal_residual.iter().copied().fold(0.0, f64::max);
                steps.advance(last.iteration as u64, format!("normal residual {worst:.1e}"));
                if self.preview_every.is_some_and(|every| last.iteration % every == 0) {
                    preview(&snapshot.elements()?)?;
                }
            }
            if saved.elapsed() > CHECKPOINT_EVERY {
                self.checkpoint.keep(history, &snapshot.state()?);
                saved = Instant::now();
            }
            Ok(if interrupted() { Control::Stop } else { Control::Continue })
        })?;

        steps.begin("assessing", None);
        let views = scene.views.len();
        let assessor = Assessor::new(problem, &operator)?;
        let start = vec![problem.start; problem.maps.light_map.len()];
        let before = assessor.assess(&start, views)?;
        let after = assessor.assess(&solved.x, views)?;
        let computed = Computed {
            coverage,
            adjoint_error,
            storage,
            solved,
            before,
            after,
            backend: "cpu",
            device: format!("{}, {} threads", super::machine::processor(), rayon::current_num_threads()),
            work: None,
        };
        Ok((computed, operator))
    }

    /// The same on the processor.
    pub(super) fn on_cpu(
        &self,
        resumed: Option<Paused>,
        steps: &mut Steps,
        preview: &dyn Fn(&[Rgb]) -> Result<()>,
    ) -> Result<Computed> {
        let make = || self.problem.operator(self.scene, super::job::budget(self.scene, self.problem)?);
        Ok(self.compute(make, &mut || {}, resumed, steps, preview)?.0)
    }

    /// The same on a graphics adapter.
    #[cfg(feature = "gpu")]
    pub(super) fn on_gpu(
        &self,
        gpu: &crate::gpu::Gpu,
        deterministic: bool,
        resumed: Option<Paused>,
        steps: &mut Steps,
        preview: &dyn Fn(&[Rgb]) -> Result<()>,
    ) -> Result<Computed> {
        use crate::problem::GpuLightMapOperator;
        let make = || {
            let budget = super::job::budget(self.scene, self.problem)?;
            GpuLightMapOperator::new(gpu, self.problem, self.scene.solve.strategy, budget, deterministic)
        };
        let mut trips = Vec::new();
        let mut each = || trips.push(gpu.round_trips());
        let record = gpu.record();
        let task = Task { adapter: Some(&record.name), ..*self };
        let (computed, operator) = task.compute(make, &mut each, resumed, steps, preview)?;
        Ok(Computed {
            backend: "gpu",
            device: format!("{} ({}, {})", record.name, record.interface, record.driver),
            work: Some(Work {
                round_trips: gpu.round_trips(),
                round_trips_an_iteration: match trips[..] {
                    [first, .., last] => Some((last - first) as f64 / (trips.len() - 1) as f64),
                    _ => None,
                },
                dispatches: gpu.dispatches(),
                bytes: gpu.held(),
                deterministic: operator.is_deterministic(),
            }),
            ..computed
        })
    }
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
