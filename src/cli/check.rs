use serde::Serialize;

use super::args::CheckArguments;
use super::engine::Engine;
use super::progress::Steps;
use super::{Done, Manners, job, to_json};
use crate::Result;
use crate::march::Traversal;
use crate::operator::{CpuVector, LinearOperator, Vector, adjoint_test};
#[cfg(feature = "gpu")]
use crate::problem::GpuLightMapOperator;
use crate::problem::{LightMapProblem, TransportOperator};
use crate::scene::Strategy;
use crate::sparse::ExplicitMatrix;

/// Rows that are checked: enough to meet every case, few enough for an explicit matrix in f64.
const ROWS: usize = 4096;
/// Non-zeros that the explicit matrix may have.
const NONZEROS: u64 = 50_000_000;
/// Laws of DESIGN: both directions in f32 agree with the explicit matrix, the adjoint is the adjoint.
const AGAINST_EXPLICIT: f64 = 1e-5;
const ADJOINT: f64 = 1e-6;
const ADJOINT_EXPLICIT: f64 = 1e-13;
/// Central differences of a quadratic are exact but for rounding.
const FINITE_DIFFERENCE: f64 = 1e-8;

#[derive(Serialize)]
struct Verdict {
    law: &'static str,
    backend: String,
    error: f64,
    bound: f64,
    holds: bool,
}

/// `unscatter check`: the adjoint test, every way of applying T against the explicit matrix, finite differences.
pub(super) fn run(arguments: &CheckArguments, manners: &Manners) -> Result<Done> {
    let mut steps = Steps::new(manners.quiet);
    steps.begin("reading", None);
    let scene = job::load(&arguments.scene, &[])?;
    let engine = Engine::choose(&arguments.backend)?;
    steps.begin("tracing", None);
    let problem = LightMapProblem::new(&scene)?.sampled(ROWS);
    steps.begin("checking", None);
    let explicit = if problem.is_grey() {
        ExplicitMatrix::new::<1>(&problem.traversal, NONZEROS)?
    } else {
        ExplicitMatrix::new::<3>(&problem.traversal, NONZEROS)?
    };
    let mut verdicts = vec![verdict(
        "adjoint",
        "explicit matrix, f64",
        adjoint_test(&explicit, 3, 1)?.error,
        ADJOINT_EXPLICIT,
    )];
    for (name, strategy) in
        [("cpu, assembled", Strategy::Assembled), ("cpu, matrix-free", Strategy::MatrixFree)]
    {
        verdicts.extend(verdicts_of(name, &problem.operator_with(strategy, u64::MAX)?, &explicit)?);
    }
    #[cfg(feature = "gpu")]
    if let Engine::Gpu { gpu, .. } = &engine {
        for (name, strategy, deterministic) in [
            ("gpu, assembled", Strategy::Assembled, false),
            ("gpu, matrix-free", Strategy::MatrixFree, false),
            ("gpu, fixed point", Strategy::MatrixFree, true),
        ] {
            match GpuLightMapOperator::new(gpu, &problem, strategy, u64::MAX, deterministic) {
                Ok(operator) => verdicts.extend(verdicts_of(name, &operator, &explicit)?),
                // What is not possible is not wrong.
                Err(error @ crate::Error::TooLarge { .. }) => tracing::warn!("{name} is left out: {error}"),
                Err(error) => return Err(error),
            }
        }
    }
    #[cfg(not(feature = "gpu"))]
    let Engine::Cpu = engine;
    let error = finite_difference(&problem, &explicit)?;
    verdicts.push(verdict(
        "gradient by finite differences",
        "explicit matrix, f64",
        error,
        FINITE_DIFFERENCE,
    ));
    steps.finish();
    let rows = Traversal::<f64, 1>::rows(&problem.traversal);
    let mut words = vec![format!("{}: {rows} rows, {} non-zeros", scene.name, explicit.channel(0).nnz())];
    words.extend(verdicts.iter().map(|verdict| {
        let mark = if verdict.holds { "holds" } else { "BROKEN" };
        let Verdict { law, backend, error, bound, .. } = verdict;
        format!("  {mark:6}  {law:34} {backend:22} {error:8.1e}  (at most {bound:.0e})")
    }));
    manners.print(&to_json(&verdicts)?, &words.join("\n"));
    Ok(if verdicts.iter().all(|verdict| verdict.holds) { Done::Completely } else { Done::Broken })
}

fn verdict(law: &'static str, backend: &str, error: f64, bound: f64) -> Verdict {
    Verdict { law, backend: backend.to_owned(), error, bound, holds: error <= bound }
}

/// The laws of one way of applying T.
fn verdicts_of(
    name: &str,
    operator: &impl TransportOperator,
    explicit: &ExplicitMatrix,
) -> Result<[Verdict; 3]> {
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
fn finite_difference(problem: &LightMapProblem, explicit: &ExplicitMatrix) -> Result<f64> {
    let b = CpuVector(problem.targets.iter().map(|target| target.map(f64::from)).collect());
    let mut x = explicit.domain();
    x.fill(problem.start.map(f64::from));
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
