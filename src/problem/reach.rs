//! Wishes that nothing within the bounds can fulfil.

use super::Problem;
use crate::Result;
use crate::operator::FromHost;
use crate::scene::{Rgb, SolveSettings};

/// What is out of reach of a row alone, whatever the others want: shares of Σ w ‖T x − b‖², which no solution is without.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OutOfReach {
    /// Of wishes for more than all elements at their upper bounds give.
    pub above: f64,
    /// Of wishes for less than all elements at their lower bounds give.
    pub below: f64,
    /// Σ w ‖T x − b‖² itself, relative to that at the start.
    pub missed: f64,
}

impl OutOfReach {
    /// Of a solution of a problem.
    ///
    /// Cost: 4 applications of T at most.
    /// Errors: those of the operator.
    pub fn new(
        problem: &dyn Problem,
        operator: &dyn FromHost,
        settings: &SolveSettings,
        elements: &[Rgb],
    ) -> Result<Self> {
        let formulation = problem.formulation(settings)?;
        let bounds = formulation.bounds()?;
        let size = [problem.rows(), elements.len()];
        let highest = most(operator, size, |element, c| bounds.of(element)[1][c])?;
        let least = most(operator, size, |element, c| -bounds.of(element)[0][c])?;
        let (shown, before) = (operator.shown(elements)?, operator.shown(&formulation.starts())?);
        let (mut all, mut at_start, mut above, mut below) = (0.0, 0.0, 0.0, 0.0);
        for (row, (target, weight)) in formulation.targets.iter().zip(formulation.weights.iter()).enumerate()
        {
            for c in 0..3 {
                let (b, w) = (f64::from(target[c]), f64::from(weight[c]));
                let missed = b - f64::from(shown[row][c]);
                all += w * missed.powi(2);
                at_start += w * (b - f64::from(before[row][c])).powi(2);
                // No more is out of reach than is missed; rounding may say otherwise.
                above += w * (b - f64::from(highest[row][c])).clamp(0.0, missed.max(0.0)).powi(2);
                below += w * (-f64::from(least[row][c]) - b).clamp(0.0, (-missed).max(0.0)).powi(2);
            }
        }
        let of = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
        Ok(Self { above: of(above, all), below: of(below, all), missed: of(all, at_start) })
    }
}

/// By which part of itself ½ Σ w ‖T x − b‖² would fall, to first order, were all upper bounds that hold elements back a tenth higher; at most 1.
///
/// Cost: an application of T and one of Tᵀ.
/// Errors: those of the operator.
pub fn held_back(
    problem: &dyn Problem,
    operator: &dyn FromHost,
    settings: &SolveSettings,
    elements: &[Rgb],
) -> Result<f64> {
    let formulation = problem.formulation(settings)?;
    let bounds = formulation.bounds()?;
    let mut residual = operator.shown(elements)?;
    let mut misfit = 0.0;
    for (row, (target, weight)) in formulation.targets.iter().zip(formulation.weights.iter()).enumerate() {
        for c in 0..3 {
            let missed = residual[row][c] - target[c];
            misfit += 0.5 * f64::from(weight[c]) * f64::from(missed).powi(2);
            residual[row][c] = weight[c] * missed;
        }
    }
    let gradient = operator.arriving(&residual)?;
    let mut gain = 0.0;
    for (element, (x, gradient)) in elements.iter().zip(&gradient).enumerate() {
        let [_, upper] = bounds.of(element);
        for c in (0..3).filter(|&c| upper[c].is_finite() && x[c] >= upper[c] as f32) {
            gain += 0.1 * upper[c] * f64::from(-gradient[c]).max(0.0);
        }
    }
    Ok(if misfit > 0.0 { (gain / misfit).min(1.0) } else { 0.0 })
}

/// What each row shows at most where no element exceeds its bound; infinite where nothing bounds one of those that it shows.
fn most(
    operator: &dyn FromHost,
    [rows, elements]: [usize; 2],
    bound: impl Fn(usize, usize) -> f64,
) -> Result<Vec<Rgb>> {
    let of = |value: &dyn Fn(f64) -> f64| -> Vec<Rgb> {
        (0..elements).map(|element| std::array::from_fn(|c| value(bound(element, c)) as f32)).collect()
    };
    let finite = of(&|bound| if bound.is_finite() { bound } else { 0.0 });
    let unbounded = of(&|bound| if bound.is_finite() { 0.0 } else { 1.0 });
    let is_dark = |elements: &[Rgb]| elements.iter().flatten().all(|&value| value == 0.0);
    let mut shown = if is_dark(&finite) { vec![[0.0; 3]; rows] } else { operator.shown(&finite)? };
    if !is_dark(&unbounded) {
        for (shown, reach) in shown.iter_mut().zip(&operator.shown(&unbounded)?) {
            (0..3).filter(|&c| reach[c] > 0.0).for_each(|c| shown[c] = f32::INFINITY);
        }
    }
    Ok(shown)
}
