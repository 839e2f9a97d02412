//! One case, measured.

use std::time::{Duration, Instant};

#[cfg(feature = "gpu")]
use super::cases::CaseBackend;
use super::cases::{Contender, Precision, Task};
use super::reference::Sample;
#[cfg(feature = "gpu")]
use crate::gpu::Gpu;
use crate::job::{Stop, peak_memory};
use crate::operator::{TransportOperator, Vector, adjoint_test};
use crate::problem::{Problem, Snapshot, Transports, near, solve};
use crate::report::bench::{Measured, Record};
use crate::scene::{Quadrature, SolveSettings, SolverName, Strategy};
use crate::{Error, Result};

/// A solve that says it has converged may have as many tolerances left: what `solve::drive` confirms.
const CONFIRMED: f64 = 1.5;

/// How long is measured, and how far is solved.
#[derive(Debug, Clone)]
pub(super) struct Patience {
    /// A request to stop, which is heard within a measurement.
    pub(super) stop: Stop,
    /// Repetitions of a product at least and at most.
    pub(super) repetitions: [usize; 2],
    /// No more repetitions after this.
    pub(super) repeating: Duration,
    /// A solve that takes longer is left where it is.
    pub(super) solving: Duration,
    /// Iterations after which a solve is left where it is.
    pub(super) iterations: usize,
}

impl Patience {
    /// Medians of what making an operator and applying it takes.
    pub(super) fn times<O: TransportOperator>(&self, make: impl Fn() -> Result<O>) -> Result<(O, Times)> {
        self.stop.go_on()?;
        let mut operator = make()?;
        self.stop.go_on()?;
        let set_up = self.median(|| {
            operator = make()?;
            Ok(())
        })?;
        let (mut x, mut y) = (operator.domain(), operator.range());
        x.fill([1.0; 3]);
        y.fill([1.0; 3]);
        // A norm waits for a device; on the processor it costs next to nothing.
        let forward = self.median(|| {
            operator.apply(&x, &mut y)?;
            y.norm_squared().map(drop)
        })?;
        let backward = self.median(|| {
            operator.apply_adjoint(&y, &mut x)?;
            x.norm_squared().map(drop)
        })?;
        Ok((operator, Times { set_up, forward, backward }))
    }

    /// The median of what something takes.
    fn median(&self, mut work: impl FnMut() -> Result<()>) -> Result<f64> {
        let [least, most] = self.repetitions;
        let (mut seconds, begun) = (Vec::new(), Instant::now());
        loop {
            let clock = Instant::now();
            work()?;
            seconds.push(clock.elapsed().as_secs_f64());
            let enough = seconds.len() >= least && begun.elapsed() >= self.repeating;
            if enough || seconds.len() >= most || self.stop.is_asked() {
                break;
            }
        }
        seconds.sort_by(f64::total_cmp);
        Ok(seconds[seconds.len() / 2])
    }
}

/// The medians of what a product takes.
pub(super) struct Times {
    pub(super) set_up: f64,
    pub(super) forward: f64,
    pub(super) backward: f64,
}

/// Measures cases.
pub(super) struct CaseMeter {
    pub(super) patience: Patience,
    #[cfg(feature = "gpu")]
    pub(super) gpu: Option<Gpu>,
}

impl CaseMeter {
    /// Measures a case; none where it is not possible, which is not wrong.
    ///
    /// Errors: [`Error::NonFinite`] naming the case, and those of the operator and the method.
    pub(super) fn measure(&self, scene: &str, case: &Contender, sample: &Sample) -> Result<Option<Record>> {
        let Some(mut problem) = sample.problem.integrated(case.quadrature, None) else { return Ok(None) };
        match self.run(scene, case, sample, &mut *problem) {
            // Adapters have no kernel for some of the cases, and slices know no panes.
            Err(error) if error.is_not_possible_here() || matches!(error, Error::Empty { .. }) => {
                tracing::warn!("{scene}/{} is left out: {error}", case.name());
                Ok(None)
            }
            Err(error) => Err(error),
            Ok(record) => finite(record).map(Some),
        }
    }

    fn run(
        &self,
        scene: &str,
        case: &Contender,
        sample: &Sample,
        problem: &mut dyn Problem,
    ) -> Result<Record> {
        let clock = Instant::now();
        problem.replan();
        let planning = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let sliced = near(problem, case.strategy)?;
        let planning = planning + clock.elapsed().as_secs_f64();
        let run = CaseRun { bench: self, scene, case, sample, problem, near: sliced.as_deref(), planning };
        let strategy = if sliced.is_some() { Strategy::MatrixFree } else { case.strategy };
        #[cfg(feature = "gpu")]
        if let (CaseBackend::Gpu, Some(gpu)) = (case.place, &self.gpu) {
            return run.with(|problem| problem.on_gpu(gpu, strategy, u64::MAX, false));
        }
        match case.precision {
            Precision::F64 => run.with(|problem| problem.wide(strategy)),
            Precision::F32 => run.with(|problem| problem.on_cpu(strategy, u64::MAX)),
        }
    }
}

/// A case, and what it is measured with.
struct CaseRun<'a> {
    bench: &'a CaseMeter,
    scene: &'a str,
    case: &'a Contender,
    sample: &'a Sample,
    problem: &'a dyn Problem,
    /// The rows that stand for its own.
    near: Option<&'a dyn Problem>,
    /// Seconds that foreseeing the rows took.
    planning: f64,
}

impl CaseRun<'_> {
    fn with<O: TransportOperator>(&self, make: impl Fn(&dyn Problem) -> Result<O>) -> Result<Record> {
        match self.case.task {
            Task::Product => self.product(|| make(self.near.unwrap_or(self.problem))),
            Task::Solve(solver, tolerance) => self.solve(make, solver, tolerance),
        }
    }

    fn product<O: TransportOperator>(&self, make: impl Fn() -> Result<O>) -> Result<Record> {
        let (operator, times) = self.bench.patience.times(make)?;
        self.bench.patience.stop.go_on()?;
        let [forward, backward] = self.sample.differences(&operator)?;
        Ok(Record {
            error: forward,
            adjoint_against_explicit: Some(backward),
            adjoint_error: Some(adjoint_test(&operator, 3, 1)?.error),
            applications: 1,
            set_up_seconds: self.planning + times.set_up,
            seconds: times.forward,
            adjoint_seconds: Some(times.backward),
            ..self.record(&operator, Measured::Product)
        })
    }

    fn solve<O: TransportOperator>(
        &self,
        make: impl Fn(&dyn Problem) -> Result<O>,
        solver: SolverName,
        tolerance: f64,
    ) -> Result<Record> {
        let reference = self.sample.reference(solver.keeps_bounds())?;
        let patience = &self.bench.patience;
        let settings = SolveSettings {
            time_limit: Some(patience.solving),
            ..self.sample.settings(solver, tolerance, patience.iterations)?
        };
        let clock = Instant::now();
        let (operator, near) = (make(self.problem)?, self.near.map(&make).transpose()?);
        let set_up = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let coverage = operator.squares(&self.problem.weights())?;
        let go_on = |_: &_, _: &mut dyn Snapshot| Ok(patience.stop.control());
        let transports = Transports { exact: &operator, near: near.as_ref() };
        let solved = solve(self.problem, transports, &coverage, &settings, None, go_on)?;
        let seconds = clock.elapsed().as_secs_f64();
        let iterated = solved.outcome.history.progress.last().map_or(0, |last| last.operator_applications);
        let (error, excess) = self.sample.distances(reference, solver, &solved.x)?;
        Ok(Record {
            solver: Some(solver.name().to_owned()),
            tolerance: Some(tolerance),
            error,
            excess: Some(excess),
            excess_bound: self.sample.bound(reference, CONFIRMED * tolerance),
            stop: Some(solved.outcome.stop.reason.name().to_owned()),
            applications: (iterated + solved.set_up_applications) as u64,
            set_up_seconds: self.planning + set_up,
            seconds,
            ..self.record(&operator, Measured::Solve)
        })
    }

    /// What records of both kinds share.
    fn record(&self, operator: &impl TransportOperator, measured: Measured) -> Record {
        let [backend, basis, precision, strategy] = self.case.words().map(str::to_owned);
        Record {
            case: format!("{}/{}", self.scene, self.case.name()),
            scene: self.scene.to_owned(),
            measured,
            solver: None,
            tolerance: None,
            backend,
            steps: match self.case.quadrature {
                Quadrature::Exact => None,
                Quadrature::March { steps } => Some(steps),
            },
            basis,
            precision,
            strategy,
            rows: self.problem.rows() as u64,
            elements: operator.domain().len() as u64,
            nonzeros: self.near.unwrap_or(self.problem).plan().nonzeros,
            error: 0.0,
            adjoint_against_explicit: None,
            adjoint_error: None,
            excess: None,
            excess_bound: None,
            stop: None,
            applications: 0,
            set_up_seconds: 0.0,
            seconds: 0.0,
            adjoint_seconds: None,
            kept_bytes: operator.storage().bytes,
            peak_bytes: peak_memory(),
        }
    }
}

/// The record, where its errors are numbers.
fn finite(record: Record) -> Result<Record> {
    let errors = [Some(record.error), record.adjoint_against_explicit, record.adjoint_error, record.excess];
    if errors.iter().flatten().all(|error| error.is_finite()) {
        return Ok(record);
    }
    Err(Error::NonFinite { what: "an error".to_owned(), place: format!("case {}", record.case) })
}
