//! From a problem to its solution, on whatever computes.

use std::time::Instant;

use super::Options;
use super::checkpoint::Keeper;
use super::engine::{Engine, On};
use super::memory::MemoryBudget;
use super::observer::Wish;
use super::steps::Steps;
use crate::operator::{CpuVector, FromHost, Storage, TransportOperator, adjoint_test};
use crate::problem::{OutOfReach, Paused, Problem, Solved, Transports, near, solve};
use crate::report::Work;
use crate::scene::{Rgb, SolveSettings};
use crate::solve::{Control, Outcome, StopReason};
use crate::{Error, Result, Warning};

/// The adjoint of this problem is tested with vectors made from this seed.
const SEED: u64 = 1;

/// An adjoint that is off by more says that the device computes something else: ten thousand roundings of f32.
const TRUSTED: f64 = 1e-3;

/// A share of what is missing that is worth a word when it is out of reach.
const UNREACHABLE: f64 = 0.1;
/// The part of what is looked for in which the pull to the start decides that is worth a word.
const PULLED: f64 = 0.5;
/// The part of the squared misfit at the start that must be left for that: a tenth of the wish.
const MISSED: f64 = 0.01;

/// What is still asked of the operator once elements have been found.
pub(super) type After<'a, T> = dyn Fn(&dyn FromHost, &[Rgb], &mut Steps<'_>) -> Result<T> + 'a;

/// A problem, and how it is to be solved.
pub(super) struct ProblemSolve<'a> {
    pub(super) problem: &'a dyn Problem,
    pub(super) settings: &'a SolveSettings,
    pub(super) memory: &'a MemoryBudget,
    pub(super) options: &'a Options,
    /// Where checkpoints go, if anywhere.
    pub(super) checkpoint: Option<&'a Keeper>,
    /// Shows all elements as they are so far.
    pub(super) preview: &'a dyn Fn(&[Rgb]) -> Result<()>,
}

/// What was found, and all there is to know about how.
#[derive(Debug)]
pub(crate) struct Computed {
    pub(crate) coverage: CpuVector,
    pub(crate) adjoint_error: f64,
    pub(crate) out_of_reach: OutOfReach,
    pub(crate) storage: Storage,
    pub(crate) solved: Solved,
    /// `cpu` or `gpu`, and its name.
    pub(crate) backend: &'static str,
    pub(crate) device: String,
    /// What a graphics adapter was given to do.
    pub(crate) work: Option<Work>,
    /// Bytes that everything but the kept rows takes.
    pub(crate) other_bytes: u64,
}

impl Computed {
    /// Whether it was stopped by a person.
    pub(crate) fn is_interrupted(&self) -> bool {
        self.solved.outcome.stop.reason == StopReason::Interrupted
    }
}

impl ProblemSolve<'_> {
    /// Solves; `after` may still ask the operator what the solution shows.
    pub(super) fn run<T>(
        &self,
        engine: &mut Engine,
        resumed: Option<Paused>,
        steps: &mut Steps<'_>,
        after: &After<'_, T>,
    ) -> Result<(Computed, T)> {
        let Self { problem, settings, options, .. } = *self;
        let near = near(problem, settings.strategy)?;
        let iterated = near.as_deref().unwrap_or(problem);
        let budget = self.memory.budget(settings, iterated)?;
        let other_bytes = self.memory.beside_rows(settings, iterated)?;
        let (computed, of_it) = engine.run(self.checkpoint, options.resume, resumed, |on, resumed| {
            steps.begin("walking", None);
            match on {
                On::Cpu => {
                    let near =
                        near.as_ref().map(|near| near.on_cpu(settings.strategy, budget)).transpose()?;
                    let operator = problem.on_cpu(settings.strategy, budget)?;
                    self.with((&operator, near.as_ref()), None, resumed, &mut || {}, steps, after)
                }
                #[cfg(feature = "gpu")]
                On::Gpu(gpu) => {
                    let on_gpu = |problem: &dyn Problem| {
                        problem.on_gpu(&gpu, settings.strategy, budget, options.deterministic)
                    };
                    let (operator, near) = (on_gpu(problem)?, near.as_deref().map(on_gpu).transpose()?);
                    let (record, mut trips) = (gpu.record(), Vec::new());
                    let mut each = || trips.push(gpu.round_trips());
                    let (computed, of_it) = self.with(
                        (&operator, near.as_ref()),
                        Some(&record.name),
                        resumed,
                        &mut each,
                        steps,
                        after,
                    )?;
                    let work = Some(work(&gpu, &trips, operator.is_deterministic()));
                    Ok((Computed { backend: "gpu", device: device(record), work, ..computed }, of_it))
                }
            }
        })?;
        Ok((Computed { other_bytes, ..computed }, of_it))
    }

    /// Tests an operator and solves with it: the observer hears of it, previews and checkpoints are written. `each` is called after
    /// every iteration.
    fn with<O: TransportOperator, T>(
        &self,
        (operator, near): (&O, Option<&O>),
        adapter: Option<&str>,
        resumed: Option<Paused>,
        each: &mut dyn FnMut(),
        steps: &mut Steps<'_>,
        after: &After<'_, T>,
    ) -> Result<(Computed, T)> {
        let coverage = operator.squares(&self.problem.weights())?;
        let mut adjoint_error = adjoint_test(operator, 1, SEED)?.error;
        if let Some(near) = near {
            adjoint_error = adjoint_error.max(adjoint_test(near, 1, SEED)?.error);
        }
        if let Some(adapter) = adapter {
            trust(adapter, adjoint_error)?;
        }
        let storage = operator.storage();
        tracing::info!(?storage, adjoint_error, "operator");

        let (limit, options) = (self.settings.iterations, self.options);
        steps.begin("solving", Some(limit as u64));
        let mut saved = Instant::now();
        let solved = solve(
            self.problem,
            Transports { exact: operator, near },
            &coverage,
            self.settings,
            resumed,
            |history, snapshot| {
                if snapshot.is_final() {
                    if let Some(checkpoint) = self.checkpoint {
                        checkpoint.finish(history, snapshot)?;
                    }
                    return Ok(Control::Stop);
                }
                each();
                let wish = history.progress.last().map(|last| steps.iterated(last, self.settings));
                if wish == Some(Wish::Preview) {
                    (self.preview)(&snapshot.elements()?)?;
                }
                if let Some(checkpoint) = self.checkpoint
                    && saved.elapsed() > options.checkpoint_every
                {
                    checkpoint.keep(history, snapshot);
                    saved = Instant::now();
                }
                Ok(if wish == Some(Wish::Stop) { Control::Stop } else { steps.control() })
            },
        )?;
        tell_of_limit(self.settings, &solved.outcome);
        if solved.gave_up_near {
            let text = "rows over slices brought the exact gradient no nearer any more, so exact rows were iterated with";
            Warning::new("slices-given-up", text, "take solve.strategy=auto where rows fit the memory")
                .tell();
        }
        let out_of_reach = OutOfReach::new(self.problem, operator, self.settings, &solved.x)?;
        // Whatever is missing where a solve has ended at the noise is noise.
        if solved.outcome.stop.reason != StopReason::HeldOut {
            tell_of_wishes(self.problem, &out_of_reach);
        }
        tell_of_pull(&coverage, &solved);
        let of_it = after(operator, &solved.x, steps)?;
        let (backend, device) = ("cpu", processor());
        let computed = Computed {
            coverage,
            adjoint_error,
            out_of_reach,
            storage,
            solved,
            backend,
            device,
            work: None,
            other_bytes: 0,
        };
        Ok((computed, of_it))
    }
}

/// Says where a solve has ended that was not asked to end early.
fn tell_of_limit(settings: &SolveSettings, Outcome { stop, true_normal_residual, .. }: &Outcome) {
    if stop.reason != StopReason::Iterations
        || settings.tolerance == 0.0
        || settings.iterations < SolveSettings::default().iterations
    {
        return;
    }
    let [red, green, blue] = true_normal_residual.map(|part| format!("{part:.1e}"));
    let text = format!(
        "the solve has ended at its limit of {} iterations: its gradient is {red}, {green} and {blue} of its start (red, green, blue), and \
         {:.0e} is asked for; what is found may still change",
        settings.iterations, settings.tolerance
    );
    Warning::new("iteration-limit", text, "raise solve.iterations").tell();
}

/// Says which part of what is missing nothing could bring.
fn tell_of_wishes(problem: &dyn Problem, OutOfReach { above, below, missed }: &OutOfReach) {
    let found = problem.nouns().found;
    let is_light_map = found == "light map";
    let darker = match is_light_map {
        true => {
            "set a larger `light_map.extent`, from outside of which light comes as it is; or paint less dark"
        }
        false => "ask for more there, or lower what else is seen there",
    };
    for (share, than, remedy) in
        [(*above, "brighter", "ask for less there, or raise the upper bound"), (*below, "darker", darker)]
    {
        if share > UNREACHABLE && *missed > MISSED {
            let share = 100.0 * share;
            let text = format!("{share:.0} % of what is missing is {than} than the {found} can make it");
            Warning::new("out-of-reach", text, remedy).tell();
        }
    }
}

/// Says where the pull to the start decides more than the pixels do.
fn tell_of_pull(coverage: &CpuVector, solved: &Solved) {
    let most = |squares: &Rgb| f64::from(squares.iter().copied().fold(0.0, f32::max));
    let reached = coverage.0.iter().map(most).filter(|&square| square > 0.0);
    let (mut all, mut weak) = (0usize, 0usize);
    reached.for_each(|square| (all, weak) = (all + 1, weak + usize::from(square < solved.weights.tikhonov)));
    if weak as f64 > PULLED * all as f64 {
        let share = 100.0 * weak as f64 / all as f64;
        let text = format!(
            "for {share:.0} % of what is looked for the pull to the start weighs more than all pixels that show it"
        );
        Warning::new("pull-outweighs-data", text, "lower `solve.tikhonov`").tell();
    }
}

/// The processor, in words.
fn processor() -> String {
    let instructions = crate::simd::instructions();
    format!("{}, {instructions}, {} threads", super::processor(), rayon::current_num_threads())
}

/// What a graphics adapter was given to do; `trips` counts its round trips after each iteration.
#[cfg(feature = "gpu")]
fn work(gpu: &crate::gpu::Gpu, trips: &[u64], deterministic: bool) -> Work {
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
        remedy: "compute on the processor, lower the maps' sizes, or update its driver",
    })
}
