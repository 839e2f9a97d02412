use super::system::{System, Transports};
use super::{Formulation, Problem, Solved};
use crate::operator::{CpuVector, Indexed, LinearOperator, Stacked, TransportOperator, Vector};
use crate::scene::{Rgb, SolveSettings, SolverName};
use crate::solve::{
    Beginning, Cgls, Control, Correction, Fista, FlexibleCgls, History, Lbfgs, LeastSquares, Lsmr, Lsqr,
    Measure, Method, Mprgp, Spectral, State, Vectors, drive, hand_out, outline, restore,
};
use crate::{Error, Result};

/// The state of a solve that was left, to be continued.
#[derive(Debug, Clone, PartialEq)]
pub struct Paused {
    /// What has happened so far.
    pub history: History,
    /// State of the method.
    pub state: State,
}

/// A solve between two iterations, or after the last.
pub trait Snapshot {
    /// The lengths of the vectors of the state to continue from, and its scalars.
    fn outline(&mut self) -> (Vec<usize>, Vec<f64>);

    /// Gives those vectors away, one after the other, so that no more than one need be on the host.
    ///
    /// Errors: those of fetching the vectors from where they are, and of `put`.
    fn hand_out(&mut self, put: &mut dyn FnMut(Vec<[f64; 3]>) -> Result<()>) -> Result<()>;

    /// Whether the solve has ended here.
    fn is_final(&self) -> bool;

    /// The state to continue from.
    ///
    /// Errors: those of fetching the vectors from where they are.
    fn state(&mut self) -> Result<State> {
        let mut vectors = Vec::new();
        self.hand_out(&mut |vector| {
            vectors.push(vector);
            Ok(())
        })?;
        Ok(State { vectors, scalars: self.outline().1 })
    }

    /// All elements as they are.
    ///
    /// Errors: those of fetching them from where they are.
    fn elements(&self) -> Result<Vec<Rgb>>;
}

/// What a problem is to a method.
pub type SystemOperator<'a, V = CpuVector, R = V> = Stacked<'a, V, R>;

/// Solves a problem with [`minimize`], and completes what was found as the problem asks: a light map, for one, may be filled.
///
/// Errors: as [`minimize`]; [`crate::Error::NonFinite`] names the element.
pub fn solve<'a, 'b, O: TransportOperator + 'a>(
    problem: &dyn Problem,
    transports: impl Into<Transports<'a, O>>,
    coverage: &CpuVector,
    settings: &SolveSettings,
    begin: impl Into<Begin<'b>>,
    each: impl FnMut(&History, &mut dyn Snapshot) -> Result<Control>,
) -> Result<Solved> {
    let solved = minimize(&problem.formulation(settings)?, transports, coverage, settings, begin, each)?;
    problem.complete(settings, solved)
}

/// Where a solve begins.
#[derive(Debug)]
pub enum Begin<'a> {
    /// At x₀.
    AtTheStart,
    /// At other elements. The pull is still to x₀, and progress is relative to x₀.
    At(&'a [Rgb]),
    /// Where another solve was left.
    Resumed(Paused),
}

impl From<Option<Paused>> for Begin<'_> {
    fn from(paused: Option<Paused>) -> Self {
        paused.map_or(Self::AtTheStart, Self::Resumed)
    }
}

/// Minimizes `½ Σ w (T x − b)² + ½ Σ λᵢ ‖Rᵢ (x − x₀)‖², l ≤ x ≤ u` over the elements that some row reaches.
///
/// Where another operator stands for T, residuals and gradients are those of T where the method ends, and it goes on until these agree
/// (`solve/correction.rs`).
///
/// `coverage` is diag(Tᵀ diag(w) T); elements where it is zero are not unknowns. `each` is called after every
/// iteration, and once more at the end.
///
/// Errors: [`crate::Error::Value`] naming a setting, [`crate::Error::Empty`] when no element is reached, and what the method and `each`
/// report. The elements may be infinite where the targets are; the caller can name them better.
pub fn minimize<'a, 'b, O: TransportOperator + 'a>(
    problem: &Formulation,
    transports: impl Into<Transports<'a, O>>,
    coverage: &CpuVector,
    settings: &SolveSettings,
    begin: impl Into<Begin<'b>>,
    mut each: impl FnMut(&History, &mut dyn Snapshot) -> Result<Control>,
) -> Result<Solved> {
    let transports = transports.into();
    if transports.near.is_some() {
        check_corrects(settings.solver)?;
    }
    let system = System::new(problem, transports, coverage, settings)?;
    let exact = system.exact();
    let correction = exact.as_ref().map(|exact| Correction::new(exact));
    let limits = system.limits(problem, settings);
    let misfit =
        |x: &_| problem.held_out.map_or(Ok(0.0), |rows| rows.misfit(&system.all_elements(problem, x)?));
    let least_squares = match problem.held_out {
        Some(_) => system.problem().holding_out(&misfit),
        None => system.problem(),
    };
    let least_squares = match &correction {
        Some(correction) => least_squares.corrected(correction),
        None => least_squares,
    };
    let mut method = method(settings.solver, system.operator());
    let at;
    let beginning = match begin.into() {
        Begin::Resumed(paused) => {
            restored(&mut *method, correction.as_ref(), paused.state)?;
            Beginning::Resumed(paused.history)
        }
        Begin::AtTheStart => Beginning::At(system.start()),
        Begin::At(elements) => {
            at = system.unknown(elements)?;
            Beginning::From { x: &at, reference: system.start() }
        }
    };
    let outcome = drive(&mut *method, &least_squares, beginning, &limits, |history, method| {
        each(
            history,
            &mut Moment {
                method,
                correction: correction.as_ref(),
                system: &system,
                problem,
                is_final: false,
            },
        )
    })?;
    let correction = correction.as_ref();
    each(
        &outcome.history,
        &mut Moment { method: &mut *method, correction, system: &system, problem, is_final: true },
    )?;
    Ok(Solved {
        x: system.all_elements(problem, method.solution())?,
        columns: system.columns().to_vec(),
        outcome,
        weights: system.absolute_weights(),
        relative_weights: system.relative_weights(),
        set_up_applications: system.applications(),
        gave_up_near: correction.is_some_and(Correction::is_exact),
    })
}

/// Errors: [`Error::Value`] for a method that cannot be corrected.
fn check_corrects(solver: SolverName) -> Result<()> {
    match solver {
        SolverName::Fista | SolverName::Cgls | SolverName::ClampedCgls => Ok(()),
        // Their line searches know ‖b − A x‖ alone, or they recur a gradient that is linear in it.
        _ => Err(Error::value(
            "solver",
            format!("{solver:?}").to_lowercase(),
            "fista, cgls or clamped-cgls where strategy is epipolar",
        )),
    }
}

/// Puts a method, and what corrects its operator, where they were left.
fn restored<O: LinearOperator>(
    method: &mut (impl Method<O> + ?Sized),
    correction: Option<&Correction<'_, O>>,
    mut state: State,
) -> Result<()> {
    if let Some(correction) = correction {
        let own = state.vectors.split_off(state.vectors.len().saturating_sub(2));
        let numbers = state.scalars.split_off(state.scalars.len().saturating_sub(3));
        correction.restore(&own, &numbers)?;
    }
    restore(method, &state)
}

/// The method of a name.
pub fn method<'a, O: LinearOperator + 'a>(name: SolverName, operator: &O) -> Box<dyn Method<O> + 'a> {
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

/// How many vectors a method and the loop that drives it keep.
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
///
/// Errors: those of the operator and its vectors.
pub fn measure<V: Vector, R: Vector>(
    problem: &LeastSquares<SystemOperator<V, R>>,
    start: &V,
) -> Result<Measure> {
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

struct Moment<'a, 'b, V: Indexed, R: Vector> {
    method: &'a mut (dyn Method<SystemOperator<'b, V, R>> + 'b),
    correction: Option<&'a Correction<'a, SystemOperator<'b, V, R>>>,
    system: &'a System<'b, V, R>,
    problem: &'a Formulation<'a>,
    is_final: bool,
}

impl<V: Indexed + 'static, R: Vector + 'static> Snapshot for Moment<'_, '_, V, R> {
    fn outline(&mut self) -> (Vec<usize>, Vec<f64>) {
        let (mut lengths, mut scalars) = outline(self.method);
        if let Some(correction) = self.correction {
            let (own, numbers) = correction.outline();
            lengths.extend(own);
            scalars.extend(numbers);
        }
        (lengths, scalars)
    }

    fn hand_out(&mut self, put: &mut dyn FnMut(Vec<[f64; 3]>) -> Result<()>) -> Result<()> {
        hand_out(self.method, put)?;
        self.correction.map_or(Ok(()), |it| it.hand_out(put))
    }

    fn is_final(&self) -> bool {
        self.is_final
    }

    fn elements(&self) -> Result<Vec<Rgb>> {
        self.system.all_elements(self.problem, self.method.solution())
    }
}
