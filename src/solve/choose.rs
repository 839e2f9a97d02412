//! Weights of regularizers chosen by the data: generalized cross-validation and the L-curve.
//!
//! Problem  For min ½‖A x − b‖² + ½ Σ λᵢ ‖Rᵢ (x − x₀)‖² the one λ that is not given.
//! Method   A few steps of bidiagonalization, kept orthogonal, project the problem onto a Krylov space; there it is
//!          so small that it is solved for many λ. The bounds play no part.
//! Caveats  Both rules think of b as exact data with noise: strokes that contradict each other are not noise, and
//!          may lead to a λ that is smaller than one would like. The L-curve's corner smooths too little where the truth is
//!          very smooth (Hanke 1996); GCV seldom does.
//! Source   GCV: Golub, Heath and Wahba 1979; L-curve: Hansen 1992; projection: Chung and Gazzola 2024, sec. 3.

use nalgebra::{DMatrix, DVector};

use super::LeastSquares;
use super::bidiagonal::{Bidiagonal, normalized};
use crate::operator::{LinearOperator, Scalars, Vector};
use crate::{Error, Result};

/// How a weight is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rule {
    /// The weight with which every row is best predicted by the others.
    Gcv,
    /// The corner of log ‖R (x − x₀)‖ over log ‖A x − b‖.
    LCurve,
}

/// A regularizer R, and its λ; none where it is to be chosen.
pub struct Term<'a, V> {
    /// R.
    pub operator: &'a dyn LinearOperator<Domain = V, Range = V>,
    /// λ.
    pub weight: Option<f64>,
}

/// Steps of bidiagonalization: two applications each.
const STEPS: usize = 30;
/// Length of a step along the L-curve, in its logarithms, below which it has no direction.
const STANDS_STILL: f64 = 1e-3;
/// Weights that are tried, evenly in the logarithm over so many decades below ‖A‖².
const TRIED: usize = 121;
const DECADES: f64 = 12.0;

/// The λ of the one term that has none, chosen by `rule` for all three channels together.
///
/// Cost: 60 applications, and 30 vectors of the domain and 30 of each regularizer's range while it lasts.
///
/// Errors: [`Error::Value`] when not exactly one weight is to be chosen; [`Error::Empty`] when the data say nothing.
pub fn choose_weight<O: LinearOperator>(
    problem: &LeastSquares<O>,
    x0: &O::Domain,
    terms: &[Term<O::Domain>],
    rule: Rule,
) -> Result<f64> {
    let wanted: Vec<usize> = (0..terms.len()).filter(|&i| terms[i].weight.is_none()).collect();
    let &[wanted] = &wanted[..] else {
        return Err(Error::value("weights", format!("{} to be chosen", wanted.len()), "one at a time"));
    };
    let projected = Projected::new(problem, x0, terms)?;
    let largest = projected.bidiagonal.iter().map(|b| b.norm_squared()).fold(0.0, f64::max);
    if largest <= 0.0 {
        return Err(Error::Empty {
            reason: "no weight can be chosen, for the start solves the problem already".to_owned(),
            remedy: "give the weight as a number",
        });
    }
    let tried = |index: usize| largest * 10f64.powf(-DECADES * index as f64 / (TRIED - 1) as f64);
    let points: Vec<(f64, Point)> = (0..TRIED)
        .map(tried)
        .map_while(|lambda| Some((lambda, projected.solve(terms, wanted, lambda)?)))
        .collect();
    let best = match rule {
        Rule::Gcv => points.iter().map(|(_, point)| -point.gcv).collect(),
        Rule::LCurve => curvatures(&points),
    };
    let best = (0..points.len()).max_by(|&a, &b| best[a].total_cmp(&best[b])).unwrap_or(0);
    Ok(points.get(best).map_or(largest, |(lambda, _)| *lambda))
}

/// What a weight leads to, the channels together.
struct Point {
    /// ‖A x − b‖².
    residual: f64,
    /// ‖R (x − x₀)‖² of the term that is being weighed.
    roughness: f64,
    gcv: f64,
}

/// The problem on the Krylov space, a matrix a channel.
struct Projected {
    rows: usize,
    /// B: A V = U B.
    bidiagonal: Vec<DMatrix<f64>>,
    /// ‖b − A x₀‖.
    beta: Scalars,
    /// (R V)ᵀ (R V) of each term, of each channel.
    grams: Vec<Vec<DMatrix<f64>>>,
}

impl Projected {
    fn new<O: LinearOperator>(
        problem: &LeastSquares<O>,
        x0: &O::Domain,
        terms: &[Term<O::Domain>],
    ) -> Result<Self> {
        let steps = STEPS.min(x0.len()).min(problem.rhs().len());
        let mut process = Bidiagonal::new(problem.operator());
        process.begin(problem, x0)?;
        let beta = process.beta;
        let mut bidiagonal = vec![DMatrix::zeros(steps + 1, steps); 3];
        let mut space: Vec<O::Domain> = Vec::with_capacity(steps);
        for step in 0..steps {
            let mut kept = process.v.zeros_like();
            kept.copy_from(&process.v);
            space.push(kept);
            let alpha = process.alpha;
            process.step(problem)?;
            // Orthogonal again; once is enough where u is left as it is (Simon and Zha 2000).
            for v in &space {
                let along = v.dot(&process.v)?;
                process.v.axpby(along.map(|along| -along), v, [1.0; 3]);
            }
            normalized(&mut process.v)?;
            for c in 0..3 {
                bidiagonal[c][(step, step)] = alpha[c];
                bidiagonal[c][(step + 1, step)] = process.beta[c];
            }
        }
        let grams = terms.iter().map(|term| gram(term.operator, &space)).collect::<Result<_>>()?;
        Ok(Self { rows: problem.rhs().len(), bidiagonal, beta, grams })
    }

    /// The solution for one weight; none where the matrix is no longer positive definite.
    fn solve<V>(&self, terms: &[Term<V>], wanted: usize, lambda: f64) -> Option<Point> {
        let (mut residual, mut roughness, mut fitted) = (0.0, 0.0, 0.0);
        for (c, b) in self.bidiagonal.iter().enumerate() {
            if self.beta[c] <= 0.0 {
                continue;
            }
            let normal = b.transpose() * b;
            let mut matrix = normal.clone();
            for (term, gram) in terms.iter().zip(&self.grams) {
                matrix += &gram[c] * term.weight.unwrap_or(lambda);
            }
            let factors = matrix.cholesky()?;
            let mut rhs = DVector::zeros(b.nrows());
            rhs[0] = self.beta[c];
            let y = factors.solve(&(b.transpose() * &rhs));
            residual += (b * &y - rhs).norm_squared();
            roughness += y.dot(&(&self.grams[wanted][c] * &y));
            fitted += factors.solve(&normal).trace();
        }
        let freedom = (3 * self.rows) as f64 - fitted;
        Some(Point { residual, roughness, gcv: residual / (freedom * freedom).max(f64::MIN_POSITIVE) })
    }
}

/// (R V)ᵀ (R V), a matrix a channel.
fn gram<V: Vector>(
    operator: &dyn LinearOperator<Domain = V, Range = V>,
    space: &[V],
) -> Result<Vec<DMatrix<f64>>> {
    let mut images = Vec::with_capacity(space.len());
    for v in space {
        let mut image = operator.range();
        operator.apply(v, &mut image)?;
        images.push(image);
    }
    let mut grams = vec![DMatrix::zeros(space.len(), space.len()); 3];
    for i in 0..images.len() {
        for j in 0..=i {
            let product = images[i].dot(&images[j])?;
            for c in 0..3 {
                grams[c][(i, j)] = product[c];
                grams[c][(j, i)] = product[c];
            }
        }
    }
    Ok(grams)
}

/// The curvature of the L-curve at each point, from its neighbours; positive at a corner, −∞ at the ends.
fn curvatures(points: &[(f64, Point)]) -> Vec<f64> {
    let place = |point: &Point| {
        [0.5 * point.residual.max(f64::MIN_POSITIVE).ln(), 0.5 * point.roughness.max(f64::MIN_POSITIVE).ln()]
    };
    let curve: Vec<[f64; 2]> = points.iter().map(|(_, point)| place(point)).collect();
    (0..curve.len())
        .map(|i| {
            let (Some(before), Some(after)) = (i.checked_sub(1), curve.get(i + 1)) else {
                return f64::NEG_INFINITY;
            };
            let (before, here) = (curve[before], curve[i]);
            let first: [f64; 2] = std::array::from_fn(|k| 0.5 * (after[k] - before[k]));
            let second: [f64; 2] = std::array::from_fn(|k| after[k] - 2.0 * here[k] + before[k]);
            let length = first[0].hypot(first[1]);
            // Towards smaller λ: the residual falls, then the roughness rises.
            let turn = first[1] * second[0] - first[0] * second[1];
            // Where the curve stands still, its direction is rounding.
            if length > STANDS_STILL { turn / length.powi(3) } else { f64::NEG_INFINITY }
        })
        .collect()
}
