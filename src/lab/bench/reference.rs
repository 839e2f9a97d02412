//! What cases are measured against: the explicit matrix in f64, and solutions in f64.

use std::cell::OnceCell;

use super::cases::CaseBasis;
use super::subject;
use crate::job::{AskedProblem, MemoryBudget, Scenes, Stop};
use crate::operator::{Blocks, CpuVector, LinearOperator, OnHost, TransportOperator, Vector};
use crate::problem::{Problem, Snapshot, Solved, System, measure, solve};
use crate::scene::{MetricName, Quadrature, Rgb, SolveSettings, SolverName, Strategy};
use crate::{Error, Result};

/// Non-zeros that an explicit matrix may have.
const NONZEROS: u64 = 50_000_000;
/// Part of its start that the projected gradient of a reference solution falls to.
const TOLERANCE: f64 = 1e-10;
/// A reference solution that ends farther off is none.
const ENOUGH: f64 = 1e-7;
const ITERATIONS: usize = 20_000;

/// A sample of the rows of a scene in one basis, with the exact matrix and what follows from it.
pub(super) struct Sample {
    /// Its rows, exact.
    pub(super) problem: Box<dyn Problem>,
    /// How it is asked to be solved, and the memory for that.
    settings: SolveSettings,
    memory: MemoryBudget,
    /// x and E x; y and Eᵀ y.
    forward: [CpuVector<f64>; 2],
    backward: [CpuVector<f64>; 2],
    /// The rows kept in f64, and their coverage.
    wide: OnHost<f64>,
    coverage: CpuVector,
    /// A request to stop, which ends the search for solutions.
    stop: Stop,
    /// The solutions without and within bounds.
    references: [OnceCell<Reference>; 2],
}

/// A solution in f64.
pub(super) struct Reference {
    x: Vec<Rgb>,
    /// The objective there and at the start.
    objective: [f64; 2],
    /// ‖x₀ − x*‖.
    from_start: f64,
    /// Squared projected gradient at the start, and the curvature that the regularization guarantees; none without any.
    steepness: Option<[f64; 2]>,
}

impl Sample {
    /// Samples at most so many rows of a scene.
    pub(super) fn new(scenes: Scenes, basis: CaseBasis, rows: usize, stop: &Stop) -> Result<Self> {
        let AskedProblem { problem, settings, memory, .. } = subject::problem(&subject::with(scenes, basis))?;
        let problem = problem.sampled(rows);
        let problem = problem.integrated(Quadrature::Exact, None).unwrap_or(problem);
        stop.go_on()?;
        let explicit = problem.explicit(NONZEROS)?;
        stop.go_on()?;
        let wide = problem.wide(Strategy::Assembled)?;
        let coverage = wide.squares(&problem.weights())?;
        Ok(Self {
            settings: SolveSettings { time_limit: None, ..settings },
            memory,
            forward: products(|x, y| explicit.apply(x, y), explicit.domain(), explicit.range())?,
            backward: products(|y, x| explicit.apply_adjoint(y, x), explicit.range(), explicit.domain())?,
            wide,
            coverage,
            problem,
            stop: stop.clone(),
            references: [OnceCell::new(), OnceCell::new()],
        })
    }

    /// ‖difference‖ / ‖truth‖ of both products.
    pub(super) fn differences(&self, operator: &impl TransportOperator) -> Result<[f64; 2]> {
        let (mut x, mut y) = (operator.domain(), operator.range());
        x.set_from_host(&self.forward[0].0)?;
        operator.apply(&x, &mut y)?;
        let forward = relative(y.to_host()?, &self.forward[1])?;
        y.set_from_host(&self.backward[0].0)?;
        operator.apply_adjoint(&y, &mut x)?;
        Ok([forward, relative(x.to_host()?, &self.backward[1])?])
    }

    /// The solution within bounds or without, found when first asked for.
    ///
    /// Errors: [`Error::NonFinite`] where it cannot be found.
    pub(super) fn reference(&self, bounded: bool) -> Result<&Reference> {
        let cell = &self.references[usize::from(bounded)];
        if let Some(known) = cell.get() {
            return Ok(known);
        }
        let reference = self.find(bounded)?;
        Ok(cell.get_or_init(|| reference))
    }

    /// How far a solution is from the reference, relative to the start, in itself and in its objective.
    pub(super) fn distances(
        &self,
        reference: &Reference,
        solver: SolverName,
        x: &[Rgb],
    ) -> Result<(f64, f64)> {
        let [least, start] = reference.objective;
        let objective = self.objective(solver, x)?;
        let distance = distance(x, &reference.x) / reference.from_start.max(f64::MIN_POSITIVE);
        Ok((distance, (objective - least) / (start - least).max(f64::MIN_POSITIVE)))
    }

    /// What the excess of a solution may be whose projected gradient has fallen to a part of its start: F is at least as curved
    /// everywhere as its Tikhonov term, so 2 (F(x) − F(x*)) ≤ ‖projected gradient‖² / λ. None where there is no such term.
    pub(super) fn bound(&self, reference: &Reference, part: f64) -> Option<f64> {
        let [least, start] = reference.objective;
        let [gradient, curvature] = reference.steepness?;
        Some(part.powi(2) * gradient / curvature / (start - least).max(f64::MIN_POSITIVE))
    }

    /// How far two solutions are apart in what they show and what pulls at them: ‖A (x − x')‖ relative to √(F(x₀) − F(x*)). Half of
    /// the most that it may be is the root of [`Self::bound`], for ‖A (x − x*)‖² ≤ F(x) − F(x*) within bounds.
    pub(super) fn apart(&self, reference: &Reference, solver: SolverName, x: [&[Rgb]; 2]) -> Result<f64> {
        let [least, start] = reference.objective;
        let [mut difference, other] = [self.residual(solver, x[0])?, self.residual(solver, x[1])?];
        difference.axpby([-1.0; 3], &other, [1.0; 3]);
        let square = difference.norm_squared()?.iter().sum::<f64>();
        Ok((square / (start - least).max(f64::MIN_POSITIVE)).sqrt())
    }

    /// How the scene is solved by another method, with the metric that suits it.
    pub(super) fn settings(
        &self,
        solver: SolverName,
        tolerance: f64,
        iterations: usize,
    ) -> Result<SolveSettings> {
        let settings = SolveSettings { solver, tolerance, iterations, ..self.settings.clone() };
        self.memory.settled(settings, &*self.problem)
    }

    /// A solve of the rows kept in f64.
    pub(super) fn solve(&self, settings: &SolveSettings) -> Result<Solved> {
        let go_on = |_: &_, _: &mut dyn Snapshot| Ok(self.stop.control());
        solve(&*self.problem, &self.wide, &self.coverage, settings, None, go_on)
    }

    fn find(&self, bounded: bool) -> Result<Reference> {
        let mut best: Option<(f64, Vec<Rgb>)> = None;
        let solvers: &[SolverName] = match bounded {
            true => &[SolverName::Fista, SolverName::Lbfgs],
            false => &[SolverName::Cgls, SolverName::Lsmr],
        };
        for &solver in solvers {
            let solved = self.solve(&self.settings(solver, TOLERANCE, ITERATIONS)?)?;
            let worst = solved.outcome.true_normal_residual.iter().copied().fold(0.0, f64::max);
            tracing::info!(
                worst,
                solver = solver.name(),
                iterations = solved.outcome.stop.iteration,
                "reference"
            );
            if best.as_ref().is_none_or(|(least, _)| worst < *least) {
                best = Some((worst, solved.x));
            }
            if worst <= 10.0 * TOLERANCE || self.stop.is_asked() {
                break;
            }
        }
        let solver = solvers[0];
        let Some((_, x)) = best.filter(|(worst, _)| *worst <= ENOUGH) else {
            return Err(Error::NonFinite {
                what: "the reference solution, which could not be found in f64".to_owned(),
                place: format!("{} iterations of each of {} solvers", ITERATIONS, solvers.len()),
            });
        };
        let start = self.problem.formulation(&self.settings)?.starts();
        Ok(Reference {
            objective: [self.objective(solver, &x)?, self.objective(solver, &start)?],
            from_start: distance(&start, &x),
            steepness: self.steepness(solver)?,
            x,
        })
    }

    fn steepness(&self, solver: SolverName) -> Result<Option<[f64; 2]>> {
        let settings = SolveSettings { solver, metric: MetricName::None, ..self.settings.clone() };
        let formulation = self.problem.formulation(&settings)?;
        let system = System::new(&formulation, &self.wide, &self.coverage, &settings)?;
        let pull = formulation.parts.iter().map(|part| part.pull).fold(f64::INFINITY, f64::min);
        let curvature = system.relative_weights().tikhonov * pull;
        let gradient = measure(&system.problem(), system.start())?.normal_residual.iter().sum::<f64>();
        Ok((curvature > 0.0).then_some([gradient, curvature]))
    }

    /// ‖[W T E; √λ R] x − …‖² in f64, whatever x was found with.
    fn objective(&self, solver: SolverName, x: &[Rgb]) -> Result<f64> {
        Ok(self.residual(solver, x)?.norm_squared()?.iter().sum())
    }

    /// b − [W T E; √λ R] x in f64.
    fn residual(&self, solver: SolverName, x: &[Rgb]) -> Result<Blocks<CpuVector<f64>>> {
        let settings = SolveSettings { solver, metric: MetricName::None, ..self.settings.clone() };
        let formulation = self.problem.formulation(&settings)?;
        let system = System::new(&formulation, &self.wide, &self.coverage, &settings)?;
        let problem = system.problem();
        let picked: Vec<[f64; 3]> =
            system.columns().iter().map(|&column| x[column as usize].map(f64::from)).collect();
        let (x, mut r) = (CpuVector(picked), problem.operator().range());
        problem.residual(&x, &mut r)?;
        Ok(r)
    }
}

/// A smooth vector, and what an operator makes of it.
fn products(
    apply: impl Fn(&CpuVector<f64>, &mut CpuVector<f64>) -> Result<()>,
    mut from: CpuVector<f64>,
    mut to: CpuVector<f64>,
) -> Result<[CpuVector<f64>; 2]> {
    // Every one is a number of f32, so that only what is computed differs.
    let wave = |index: usize, c: usize| f64::from((1.0 + (index as f64 * 0.37 + c as f64).sin()) as f32);
    let elements = from.0.iter_mut().enumerate();
    elements.for_each(|(index, element)| *element = std::array::from_fn(|c| wave(index, c)));
    apply(&from, &mut to)?;
    Ok([from, to])
}

pub(super) fn relative(got: Vec<[f64; 3]>, truth: &CpuVector<f64>) -> Result<f64> {
    let mut difference = CpuVector(got);
    difference.axpby([-1.0; 3], truth, [1.0; 3]);
    let norm =
        |vector: &CpuVector<f64>| vector.norm_squared().map(|squares| squares.iter().sum::<f64>().sqrt());
    Ok(norm(&difference)? / norm(truth)?.max(f64::MIN_POSITIVE))
}

fn distance(a: &[Rgb], b: &[Rgb]) -> f64 {
    let square = |a: &f32, b: &f32| (f64::from(*a) - f64::from(*b)).powi(2);
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| square(a, b)).sum::<f64>().sqrt()
}
