use super::{LightMapOperator, LightMapProblem};
use crate::operator::{CpuVector, Identity, LinearOperator, Restricted, Stacked, Vector, Weighted};
use crate::scene::{Rgb, SolveSettings, SolverName};
use crate::solve::{Cgls, Control, History, LeastSquares, Limits, Method, Outcome, State, drive};
use crate::{Error, Result};

/// A solved light map.
#[derive(Debug)]
pub struct Solved {
    /// Radiance of all texels, row by row; those that no painted ray reaches keep the start.
    pub light_map: Vec<Rgb>,
    /// How the solve went.
    pub outcome: Outcome,
    /// λ of ½ λ ‖x − x₀‖².
    pub tikhonov: f64,
    /// The state to continue from.
    pub state: State,
}

/// What a solve was in when it was left, to be continued.
#[derive(Debug, Clone, PartialEq)]
pub struct Paused {
    /// What has happened so far.
    pub history: History,
    /// State of the method.
    pub state: State,
}

/// Minimizes `½ Σ w (T x − b)² + ½ λ ‖x − x₀‖²` over the texels that painted rays reach.
///
/// `coverage` is diag(Tᵀ diag(w) T); texels where it is zero are not unknowns. `each` is called after every
/// iteration with the history, a way to get the state to continue from, and a way to get all texels.
///
/// Errors: [`Error::NonFinite`] naming the texel, [`Error::Empty`] when no texel is reached, and what the method and
/// `each` report.
pub fn solve(
    problem: &LightMapProblem,
    operator: &LightMapOperator,
    coverage: &CpuVector,
    settings: &SolveSettings,
    resumed: Option<Paused>,
    mut each: impl FnMut(&History, &dyn Fn() -> Result<State>, &dyn Fn() -> Vec<Rgb>) -> Result<Control>,
) -> Result<Solved> {
    let columns = reached(coverage);
    if columns.is_empty() {
        return Err(Error::Empty {
            reason: "the light of the painted pixels is too weak to be computed with".to_owned(),
            remedy: "raise medium.sigma_t or medium.albedo",
        });
    }
    // Rows are divided by the norm of a typical column, so that f32 serves media of any density alike; λ becomes
    // what the settings say.
    let norm = mean_squared_column_norm(coverage, columns.len()).sqrt();
    let factors = problem.constraints.iter().map(|pixel| [(f64::from(pixel.weight).sqrt() / norm) as f32; 3]);
    let weighted = Weighted::new(Restricted::new(operator, columns.clone())?, CpuVector(factors.collect()))?;
    let mut start = weighted.domain();
    start.fill(problem.start.map(f64::from));
    let mut targets = CpuVector(problem.targets.clone());
    weighted.weigh(&mut targets);
    let pull = [settings.regularization.tikhonov.sqrt(); 3];
    let mut pulled = start.clone();
    pulled.scale(pull);
    let rhs = (targets, pulled);
    let regularized = Stacked::new(weighted, Identity::scaled(&start, pull))?;
    let system = LeastSquares { operator: &regularized, rhs: &rhs };
    let mut method = match settings.solver {
        SolverName::Cgls => Cgls::new(&regularized),
        SolverName::ClampedCgls => Cgls::clamped(&regularized),
    };
    let limits =
        Limits { iterations: settings.iterations, tolerance: settings.tolerance, time: settings.time_limit };
    let history = match resumed {
        Some(paused) => {
            method.restore(&paused.state)?;
            Some(paused.history)
        }
        None => None,
    };
    let all_texels = |x: &CpuVector| {
        let mut texels = vec![problem.start; coverage.len()];
        columns.iter().zip(&x.0).for_each(|(&column, &value)| texels[column as usize] = value);
        texels
    };
    let outcome = drive(&mut method, &system, &start, &limits, history, |history, method| {
        each(history, &|| method.save(), &|| all_texels(method.solution()))
    })?;
    let light_map = all_texels(method.solution());
    if let Some(index) = light_map.iter().position(|texel| !texel.iter().all(|value| value.is_finite())) {
        let width = problem.maps.light_map.size[0];
        let place = format!("texel ({}, {})", index % width, index / width);
        return Err(Error::NonFinite { what: "the light map".to_owned(), place });
    }
    Ok(Solved {
        light_map,
        outcome,
        tikhonov: settings.regularization.tikhonov * norm * norm,
        state: method.save()?,
    })
}

/// The elements that some painted ray reaches.
fn reached(coverage: &CpuVector) -> Vec<u32> {
    let is_reached = |&(_, squares): &(usize, &Rgb)| squares.iter().any(|&value| value > 0.0);
    coverage.0.iter().enumerate().filter(is_reached).map(|(index, _)| index as u32).collect()
}

/// Mean over reached elements and channels of ‖W T eᵢ‖².
fn mean_squared_column_norm(coverage: &CpuVector, reached: usize) -> f64 {
    let sum: f64 = coverage.0.iter().flatten().map(|&value| f64::from(value)).sum();
    sum / (3 * reached.max(1)) as f64
}
