//! Krylov methods over 10,000 iterations, long after rounding has taken their orthogonality.

use nalgebra::{DMatrix, DVector};

use super::case::{Case, Measurements, Setting};
use super::dense::{DenseOperator, DenseProblem, colors, image};
use super::rows::worse;
use crate::Result;
use crate::operator::{Bounds, CpuVector, LinearOperator, Vector};
use crate::problem::method;
use crate::scene::SolverName;
use crate::solve::{Beginning, Control, LeastSquares, Limits, StopReason, drive};

pub(super) const CASES: [Case; 3] = [
    Case {
        name: "krylov/ten-thousand",
        law: "over 10,000 iterations, 100 times what exact arithmetic needs, no residual parts from the truth",
        why: "Greenbaum 1997: iterations * epsilon * (|A| |x| + |b|)",
        run: ten_thousand,
    },
    Case {
        name: "krylov/hilbert",
        law: "on a Hilbert matrix a method that calls itself done is, or it begins again, or says it cannot",
        why: "the tolerance, and rounding of A'(Ax - b)",
        run: hilbert,
    },
    Case {
        name: "krylov/orthogonality",
        law: "normal residuals that were orthogonal are not any more, and the solve ends right in spite of that",
        why: "the tolerance; that orthogonality is lost is measured, so that the case is the one it claims to be",
        run: orthogonality,
    },
];

const METHODS: [SolverName; 3] = [SolverName::Cgls, SolverName::Lsqr, SolverName::Lsmr];

/// 100 unknowns whose scales fall from 1 to 1e-6, mixed by a reflection, and 20 rows more, which nothing can meet.
fn graded() -> DenseProblem {
    const SIDE: usize = 100;
    let scale = |index: usize| 1e-6f64.powf(index as f64 / (SIDE - 1) as f64);
    let v = DVector::from_element(SIDE, (2.0 / SIDE as f64).sqrt());
    let reflection = DMatrix::identity(SIDE, SIDE) - &v * v.transpose();
    let scaled = DMatrix::from_diagonal(&DVector::from_fn(SIDE, |index, _| scale(index))) * reflection;
    let matrix = scaled.resize_vertically(SIDE + 20, 0.0);
    let mut b = image(&matrix, &colors(SIDE, 3));
    b[SIDE..].fill([0.5; 3]);
    DenseProblem { matrix, b, x0: vec![[0.0; 3]; SIDE], bounds: Bounds::NONE }
}

fn hilbert_matrix(side: usize) -> DenseProblem {
    let matrix = DMatrix::from_fn(side, side, |i, j| 1.0 / (i + j + 1) as f64);
    let b = image(&matrix, &colors(side, 4));
    DenseProblem { matrix, b, x0: vec![[0.0; 3]; side], bounds: Bounds::NONE }
}

fn ten_thousand(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    const STEPS: usize = 10_000;
    let problem = graded();
    for name in METHODS {
        let operator = DenseOperator::of(&problem, setting);
        let b = CpuVector(problem.b.clone());
        let least_squares = LeastSquares::new(&operator, &b);
        let mut method = method(name, &operator);
        method.begin(&least_squares, &operator.domain())?;
        let mut largest = [0.0_f64; 3];
        for _ in 0..STEPS {
            method.step(&least_squares, [true; 3])?;
            let norms = method.solution().norm_squared()?;
            (0..3).for_each(|c| largest[c] = largest[c].max(norms[c].sqrt()));
        }
        let believed = method.measure().residual;
        let norm = problem.matrix.norm();
        let (mut error, mut bound) = (0.0, f64::INFINITY);
        for c in 0..3 {
            let truth = problem.residual(&method.solution().0, c);
            let length = super::dense::channel(&problem.b, c).norm();
            error = worse(error, (truth - believed[c].sqrt()).abs() / length);
            bound = bound.min(STEPS as f64 * f64::EPSILON * (norm * largest[c] / length + 1.0));
        }
        measurements.within(name.name(), error, bound);
    }
    Ok(())
}

fn hilbert(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    for side in setting.some(&[4, 8, 12, 20]) {
        let problem = hilbert_matrix(side);
        for tolerance in [1e-4, 1e-8, 1e-12, 0.0] {
            for name in METHODS {
                let ended = problem.run(setting, name, &Limits::new(1000, tolerance))?;
                let stop = ended.outcome.stop;
                let restarts = ended.outcome.history.restarts;
                let place = format!(
                    "{side} x {side}, {} to {tolerance:e}, {} after {}, {restarts} restarts",
                    name.name(),
                    stop.reason.name(),
                    stop.iteration
                );
                measurements.within(&place, (ended.truth - ended.claimed).abs(), ended.rounding);
                if stop.reason == StopReason::Tolerance {
                    measurements.within(place, ended.truth, 1.5 * tolerance + ended.rounding);
                }
            }
        }
    }
    Ok(())
}

fn orthogonality(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    const TOLERANCE: f64 = 1e-10;
    let problem = graded();
    let operator = DenseOperator::of(&problem, setting);
    let (b, x0) = (CpuVector(problem.b.clone()), operator.domain());
    let least_squares = LeastSquares::new(&operator, &b);
    let mut method = method(SolverName::Cgls, &operator);
    let mut slopes: Vec<DVector<f64>> = Vec::new();
    let limits = Limits::new(10_000, TOLERANCE);
    let outcome = drive(&mut *method, &least_squares, Beginning::At(&x0), &limits, |_, method| {
        if slopes.len() < 200 {
            let x = super::dense::channel(&method.solution().0, 0);
            let r = super::dense::channel(&problem.b, 0) - &problem.matrix * x;
            slopes.push(problem.matrix.tr_mul(&r).normalize());
        }
        Ok(Control::Continue)
    })?;
    let cosines = (0..slopes.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    let lost = cosines.map(|(i, j)| slopes[i].dot(&slopes[j]).abs()).fold(0.0, worse);
    let ended = problem.judged(SolverName::Cgls, method.solution().0.clone(), outcome);
    let stop = ended.outcome.stop;
    let place = format!("cosine {lost:.2}, {} after {}", stop.reason.name(), stop.iteration);
    measurements.must(&place, lost > 0.1);
    measurements.within(&place, (ended.truth - ended.claimed).abs(), ended.rounding);
    measurements.within(place, ended.truth, 1.5 * TOLERANCE + ended.rounding);
    Ok(())
}
