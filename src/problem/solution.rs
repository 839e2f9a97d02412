use super::fill::fill;
use super::system::{System, Weights};
use super::{LightMapProblem, TransportOperator};
use crate::operator::{CpuVector, Indexed, Stacked, Vector};
use crate::scene::{Rgb, SolveSettings, SolverName};
use crate::solve::{
    Beginning, Cgls, Control, Fista, FlexibleCgls, History, Lbfgs, LeastSquares, Lsmr, Lsqr, Measure, Method,
    Mprgp, Outcome, Spectral, State, Vectors, drive, restore, save,
};
use crate::{Error, Result};

/// A solved light map.
#[derive(Debug)]
pub struct Solved {
    /// Radiance of all texels, row by row; those that no painted ray reaches keep the start, or are filled.
    pub light_map: Vec<Rgb>,
    /// How the solve went.
    pub outcome: Outcome,
    /// λ of the regularizers.
    pub weights: Weights,
    /// The same relative to the mean squared column norm, as settings give them.
    pub relative_weights: Weights,
    /// Applications of the transport before the first iteration: the metric, the choice of λ.
    pub set_up_applications: usize,
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

/// A solve between two iterations.
pub trait Snapshot {
    /// The state to continue from.
    fn state(&mut self) -> Result<State>;

    /// All texels as they are.
    fn texels(&self) -> Result<Vec<Rgb>>;
}

/// What a light-map problem is to a method.
pub type SystemOperator<'a, V = CpuVector> = Stacked<'a, V>;

/// Minimizes `½ Σ w (T x − b)² + ½ Σ λᵢ ‖Rᵢ (x − x₀)‖², l ≤ x ≤ u` over the texels that painted rays reach.
///
/// `coverage` is diag(Tᵀ diag(w) T); texels where it is zero are not unknowns. `each` is called after every
/// iteration.
///
/// Errors: [`Error::Value`] naming a setting, [`Error::NonFinite`] naming the texel, [`Error::Empty`] when no texel is
/// reached, and what the method and `each` report.
pub fn solve(
    problem: &LightMapProblem,
    operator: &impl TransportOperator,
    coverage: &CpuVector,
    settings: &SolveSettings,
    resumed: Option<Paused>,
    mut each: impl FnMut(&History, &mut dyn Snapshot) -> Result<Control>,
) -> Result<Solved> {
    let system = System::new(problem, operator, coverage, settings)?;
    let limits = system.limits(problem, settings);
    let least_squares = system.problem();
    let mut method = method(settings.solver, system.operator());
    let beginning = match resumed {
        Some(paused) => {
            restore(&mut *method, &paused.state)?;
            Beginning::Resumed(paused.history)
        }
        None => Beginning::At(system.start()),
    };
    let outcome = drive(&mut *method, &least_squares, beginning, &limits, |history, method| {
        each(history, &mut Moment { method, system: &system, problem })
    })?;
    let light_map = finite(problem, system.all_texels(problem, method.solution())?)?;
    let light_map = if settings.fill { fill(problem, system.columns(), light_map)? } else { light_map };
    Ok(Solved {
        light_map,
        outcome,
        weights: system.absolute_weights(),
        relative_weights: system.relative_weights(),
        set_up_applications: system.applications(),
        state: save(&mut *method)?,
    })
}

/// The method of a name.
pub fn method<'a, V: Vector + 'a>(
    name: SolverName,
    operator: &SystemOperator<'a, V>,
) -> Box<dyn Method<SystemOperator<'a, V>> + 'a> {
    match name {
        SolverName::Fista => Box::new(Fista::new(operator)),
        SolverName::Spectral => Box::new(Spectral::new(operator)),
        SolverName::Lbfgs => Box::new(Lbfgs::new(operator)),
        SolverName::Mprgp => Box::new(Mprgp::new(operator)),
        SolverName::FlexibleCgls => Box::new(FlexibleCgls::new(operator)),
        SolverName::ClampedCgls => Box::new(Cgls::clamped(operator)),
        SolverName::Cgls => Box::new(Cgls::new(operator)),
        SolverName::Lsqr => Box::new(Lsqr::new(operator)),
        SolverName::Lsmr => Box::new(Lsmr::new(operator)),
    }
}

/// The vectors that a method keeps, and the loop beside it.
pub fn vectors(name: SolverName) -> Vectors {
    let Vectors { domain, range } = match name {
        SolverName::Fista => Fista::<SystemOperator>::VECTORS,
        SolverName::Spectral => Spectral::<SystemOperator>::VECTORS,
        SolverName::Lbfgs => Lbfgs::<SystemOperator>::VECTORS,
        SolverName::Mprgp => Mprgp::<SystemOperator>::VECTORS,
        SolverName::FlexibleCgls => FlexibleCgls::<SystemOperator>::VECTORS,
        SolverName::ClampedCgls | SolverName::Cgls => Cgls::<SystemOperator>::VECTORS,
        SolverName::Lsqr => Lsqr::<SystemOperator>::VECTORS,
        SolverName::Lsmr => Lsmr::<SystemOperator>::VECTORS,
    };
    Vectors { domain: domain + 1, range: range + 1 }
}

/// The squared residuals at x, moved into the bounds: what progress is relative to.
pub fn measure<V: Vector>(problem: &LeastSquares<SystemOperator<V>>, start: &V) -> Result<Measure> {
    let (mut r, mut g) = (problem.rhs().zeros_like(), start.zeros_like());
    let mut x = start.zeros_like();
    x.copy_from(start);
    x.clamp(problem.bounds());
    problem.residual(&x, &mut r)?;
    problem.gradient(&r, &mut g)?;
    Ok(Measure {
        residual: r.norm_squared()?,
        normal_residual: g.projected_norm_squared(&x, problem.bounds())?,
    })
}

/// The light map, or an error that names the texel which is not a number.
fn finite(problem: &LightMapProblem, light_map: Vec<Rgb>) -> Result<Vec<Rgb>> {
    match light_map.iter().position(|texel| !texel.iter().all(|value| value.is_finite())) {
        None => Ok(light_map),
        Some(index) => {
            let width = problem.maps.light_map.size[0];
            let place = format!("texel ({}, {})", index % width, index / width);
            Err(Error::NonFinite { what: "the light map".to_owned(), place })
        }
    }
}

struct Moment<'a, 'b, V: Indexed> {
    method: &'a mut (dyn Method<SystemOperator<'b, V>> + 'b),
    system: &'a System<'b, V>,
    problem: &'a LightMapProblem,
}

impl<V: Indexed + 'static> Snapshot for Moment<'_, '_, V> {
    fn state(&mut self) -> Result<State> {
        save(self.method)
    }

    fn texels(&self) -> Result<Vec<Rgb>> {
        self.system.all_texels(self.problem, self.method.solution())
    }
}
