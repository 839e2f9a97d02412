//! Gauss–Newton with steps that are halved until they help.
//!
//! Problem       min ‖f(x) − b‖, l ≤ x ≤ u, f not linear.
//! Equivalences  With f linear one step of [`drive`](super::drive).
//! Caveats       What is nearest after a step is measured with f itself; a step of which no part comes nearer is not taken, and is the last.
//!               Ends at a point where no step helps, which need not be the nearest of all.
//!               Which part of b is noise is known to whoever states the problem.
//! Convergence   ‖f(x) − b‖ falls with every step that is taken; quadratically near a solution where f(x) = b.
//! Source        Nocedal and Wright 2006, sec. 10.3; for extinction Klehm 2015, sec. 7.4.
//!
//! It knows nothing of operators: the linear problem of each step is solved by whoever states the nonlinear one.

use super::Control;
use crate::Result;

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussNewton {
    /// Steps at most.
    pub steps: usize,
    /// Least part of the distance by which a step must bring f nearer; one that gains less is the last.
    pub least_gain: f64,
    /// How many shares of a step are tried: all of it, a half, a quarter, and so on.
    pub tries: i32,
}

impl GaussNewton {
    /// So many steps at most.
    pub fn new(steps: usize) -> Self {
        Self { steps, least_gain: 1e-3, tries: 7 }
    }
}

/// Where a share of a step leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Looked {
    /// Nearer: it is taken.
    Nearer,
    /// Nearer only to the noise of b: neither it nor a share of it is taken.
    NearerToNoise,
    /// Farther away: a smaller share of it may be nearer.
    Farther,
}

/// A problem that is solved by linear ones.
pub trait NonLinear {
    /// A solution of the linear problem around the present point, with all that a caller wants to hear of it.
    type Step;

    /// ‖f(x) − b‖ where it stands.
    fn distance(&self) -> f64;

    /// Solves the problem that is linear where it stands.
    fn step(&mut self) -> Result<Self::Step>;

    /// Where a share of a step leads.
    fn look(&mut self, step: &Self::Step, share: f32) -> Result<Looked>;

    /// Stands where it has looked last.
    fn take(&mut self, step: &Self::Step);

    /// Hears of every step, taken or not, and may stop.
    fn told(&mut self, step: Self::Step, taken: Taken) -> Result<Control>;
}

/// What became of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Taken {
    /// Which step, from 0.
    pub number: usize,
    /// The share of the step that was taken, from 0 to 1; none where no share of it came nearer.
    pub share: Option<f32>,
    /// ‖f(x) − b‖ before and after the step.
    pub distance: [f64; 2],
}

/// Takes steps until one of them does not help enough, or somebody stops it.
///
/// Errors: those of the problem's steps and looks.
pub fn gauss_newton<N: NonLinear>(problem: &mut N, settings: &GaussNewton) -> Result<()> {
    for number in 0..settings.steps {
        let step = problem.step()?;
        let before = problem.distance();
        let mut share = None;
        for halvings in 0..settings.tries {
            let part = 0.5f32.powi(halvings);
            match problem.look(&step, part)? {
                Looked::Farther => {}
                Looked::NearerToNoise => break,
                Looked::Nearer => {
                    problem.take(&step);
                    share = Some(part);
                    break;
                }
            }
        }
        let after = problem.distance();
        let control = problem.told(step, Taken { number, share, distance: [before, after] })?;
        if control != Control::Continue || before - after <= settings.least_gain * before {
            break;
        }
    }
    Ok(())
}
