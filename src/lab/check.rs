//! The laws of an operator on a scene: its adjoint, the explicit matrix in f64, finite differences.

use serde::Serialize;

use crate::Result;
use crate::job::{AskedProblem, Engine, EngineChoice, Job, Observer, Step, Steps, Stop};
use crate::march::EpipolarSettings;
use crate::operator::{CpuVector, LinearOperator, TransportOperator, Vector, adjoint_test};
use crate::problem::Problem;
use crate::scene::{Rgb, SolveSettings, Strategy};
use crate::sparse::ExplicitMatrix;

/// Rows that are checked: enough to meet every case, few enough for an explicit matrix in f64.
const ROWS: usize = 4096;
/// Non-zeros that the explicit matrix may have.
const NONZEROS: u64 = 50_000_000;
/// How far T x and Tᵀ y in f32 may be from those of the explicit matrix.
pub(crate) const AGAINST_EXPLICIT: f64 = 1e-5;
/// The adjoint error that T may have in f32, and that of the explicit matrix in f64.
pub(crate) const ADJOINT: f64 = 1e-6;
pub(crate) const ADJOINT_EXPLICIT: f64 = 1e-13;
/// Central differences of a quadratic are exact but for rounding.
const FINITE_DIFFERENCE: f64 = 1e-8;

/// A law, and whether it holds.
#[derive(Debug, Clone, Serialize)]
pub struct CheckedLaw {
    /// What is compared.
    pub law: &'static str,
    /// What computes, and how.
    pub backend: String,
    /// How far the two are apart, relative to the larger.
    pub error: f64,
    /// How far they may be apart.
    pub bound: f64,
    /// Whether they are no farther apart.
    pub holds: bool,
}

/// The verdicts on one problem.
#[derive(Debug, Clone)]
pub struct Checked {
    /// The scene, and what is looked for in it.
    pub name: String,
    /// Rows that were checked.
    pub rows: usize,
    /// Non-zeros of those.
    pub nonzeros: usize,
    /// Law by law.
    pub verdicts: Vec<CheckedLaw>,
}

/// Checks every problem of a job on a sample of its rows.
///
/// Errors: those of making the problems and their explicit matrices, and of what computes.
pub fn check(job: &Job, engine: &EngineChoice, observer: &mut impl Observer) -> Result<Vec<Checked>> {
    let stop = Stop::default();
    let engine = Engine::open(engine, &stop)?;
    let scenes = job.scenes();
    let all = scenes.asked(&scenes.geometry()?, &mut Steps::new(observer, &stop, Vec::new()))?;
    let checks = all.into_iter().map(|AskedProblem { scene, find, problem, .. }| {
        observer.begins(&Step { name: "checking", within: "", parts: None });
        checked(&format!("{scene}, {find}"), &*problem.sampled(ROWS), &engine)
    });
    checks.collect()
}

/// The laws of one problem.
fn checked(name: &str, problem: &dyn Problem, engine: &Engine) -> Result<Checked> {
    let explicit = problem.explicit(NONZEROS)?;
    let error = adjoint_test(&explicit, 3, 1)?.error;
    let mut verdicts = vec![verdict("adjoint", "explicit matrix, f64", error, ADJOINT_EXPLICIT)];
    for (way, strategy) in
        [("cpu, assembled", Strategy::Assembled), ("cpu, matrix-free", Strategy::MatrixFree)]
    {
        verdicts.extend(verdicts_of(way, &problem.on_cpu(strategy, u64::MAX)?, &explicit)?);
    }
    // Rows over slices are only near the exact ones, and a matrix of their own.
    let sliced = match problem.sliced(EpipolarSettings::default()) {
        Some(Ok(sliced)) => Some((sliced.explicit(NONZEROS)?, sliced)),
        _ => None,
    };
    if let Some((own, sliced)) = &sliced {
        verdicts.extend(verdicts_of("cpu, epipolar", &sliced.on_cpu(Strategy::MatrixFree, u64::MAX)?, own)?);
    }
    #[cfg(feature = "gpu")]
    if let Some(gpu) = engine.gpu() {
        let mut check = |way, strategy, deterministic, (problem, explicit): (&dyn Problem, &_)| {
            match problem.on_gpu(gpu, strategy, u64::MAX, deterministic) {
                Ok(operator) => verdicts.extend(verdicts_of(way, &operator, explicit)?),
                // What is not possible is not wrong.
                Err(error) if error.is_not_possible_here() => tracing::warn!("{way} is left out: {error}"),
                Err(error) => return Err(error),
            }
            Ok(())
        };
        check("gpu, assembled", Strategy::Assembled, false, (problem, &explicit))?;
        check("gpu, matrix-free", Strategy::MatrixFree, false, (problem, &explicit))?;
        check("gpu, fixed point", Strategy::MatrixFree, true, (problem, &explicit))?;
        if let Some((own, sliced)) = &sliced {
            check("gpu, epipolar", Strategy::MatrixFree, false, (&**sliced, own))?;
        }
    }
    #[cfg(not(feature = "gpu"))]
    let Engine::Cpu = engine;
    let error = finite_difference(problem, &explicit)?;
    let law = "gradient by finite differences";
    verdicts.push(verdict(law, "explicit matrix, f64", error, FINITE_DIFFERENCE));
    Ok(Checked { name: name.to_owned(), rows: problem.rows(), nonzeros: explicit.channel(0).nnz(), verdicts })
}

fn verdict(law: &'static str, backend: &str, error: f64, bound: f64) -> CheckedLaw {
    CheckedLaw { law, backend: backend.to_owned(), error, bound, holds: error <= bound }
}

/// The laws of one way of applying T.
fn verdicts_of(
    name: &str,
    operator: &impl TransportOperator,
    explicit: &ExplicitMatrix,
) -> Result<[CheckedLaw; 3]> {
    let [forward, backward] = differences(operator, explicit)?;
    Ok([
        verdict("adjoint", name, adjoint_test(operator, 3, 1)?.error, ADJOINT),
        verdict("T x against the explicit matrix", name, forward, AGAINST_EXPLICIT),
        verdict("Tᵀ y against the explicit matrix", name, backward, AGAINST_EXPLICIT),
    ])
}

/// ‖difference‖ / ‖truth‖ of both products, for a smooth x and for y the products themselves.
fn differences(operator: &impl TransportOperator, explicit: &ExplicitMatrix) -> Result<[f64; 2]> {
    let wave = |index: usize| std::array::from_fn(|c| 1.0 + (index as f64 * 0.37 + c as f64).sin());
    let (mut x, mut y) = (operator.domain(), operator.range());
    let on_x = CpuVector((0..x.len()).map(wave).collect());
    let on_y = CpuVector((0..y.len()).map(wave).collect());
    x.set_from_host(&on_x.0)?;
    operator.apply(&x, &mut y)?;
    let forward = y.to_host()?;
    y.set_from_host(&on_y.0)?;
    operator.apply_adjoint(&y, &mut x)?;
    let backward = x.to_host()?;
    let (mut true_forward, mut true_backward) = (explicit.range(), explicit.domain());
    explicit.apply(&on_x, &mut true_forward)?;
    explicit.apply_adjoint(&on_y, &mut true_backward)?;
    Ok([relative(forward, &true_forward)?, relative(backward, &true_backward)?])
}

fn relative(got: Vec<[f64; 3]>, truth: &CpuVector<f64>) -> Result<f64> {
    let mut difference = CpuVector(got);
    difference.axpby([-1.0; 3], truth, [1.0; 3]);
    let norm =
        |vector: &CpuVector<f64>| vector.norm_squared().map(|squares| squares.iter().sum::<f64>().sqrt());
    Ok(norm(&difference)? / norm(truth)?.max(f64::MIN_POSITIVE))
}

/// The slope of ½‖T x − b‖² along a direction, by central differences and as ⟨Tᵀ(T x − b), d⟩.
fn finite_difference(problem: &dyn Problem, explicit: &ExplicitMatrix) -> Result<f64> {
    let start = problem.formulation(&SolveSettings::default())?.starts();
    let wide = |colors: &[Rgb]| CpuVector(colors.iter().map(|color| color.map(f64::from)).collect());
    let (b, x) = (wide(problem.targets()), wide(&start));
    let mut d = explicit.domain();
    d.0.iter_mut().enumerate().for_each(|(index, d)| *d = [(index as f64 * 0.61).cos(); 3]);
    let residual = |step: f64| -> Result<CpuVector<f64>> {
        let mut moved = x.clone();
        moved.axpby([step; 3], &d, [1.0; 3]);
        let mut r = explicit.range();
        explicit.apply(&moved, &mut r)?;
        r.axpby([-1.0; 3], &b, [1.0; 3]);
        Ok(r)
    };
    let value = |step: f64| -> Result<f64> { Ok(residual(step)?.norm_squared()?.iter().sum::<f64>() * 0.5) };
    let mut gradient = explicit.domain();
    explicit.apply_adjoint(&residual(0.0)?, &mut gradient)?;
    let slope: f64 = gradient.dot(&d)?.iter().sum();
    let difference = (value(0.5)? - value(-0.5)?) - slope;
    let scale =
        gradient.norm_squared()?.iter().sum::<f64>().sqrt() * d.norm_squared()?.iter().sum::<f64>().sqrt();
    Ok(difference.abs() / scale.max(f64::MIN_POSITIVE))
}
