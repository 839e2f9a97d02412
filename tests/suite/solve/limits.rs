//! Every reason to stop, and channels that are done.

use std::time::Duration;

use unscatter::operator::{Blocks, Bounds, CpuVector, Identity, LinearOperator, Stacked, Vector};
use unscatter::solve::{
    Beginning, Cgls, Control, Fista, LeastSquares, Limits, Lsqr, Method, StopReason, drive,
};

use super::{Dense, all, random_matrix, rhs, run};

#[test]
fn limits_are_reasons_and_not_errors() {
    let dense = Dense::new(random_matrix(40, 30, 2));
    let b = rhs(40, 2);
    let problem = LeastSquares::new(&dense, &b);
    for mut method in all(&dense) {
        let start = dense.domain();
        let iterations = run(&mut *method, &problem, &start, &Limits::new(3, 1e-12));
        assert_eq!((iterations.stop.reason, iterations.stop.iteration), (StopReason::Iterations, 3));
        let limits = Limits { time: Some(Duration::ZERO), ..Limits::new(1000, 1e-12) };
        assert_eq!(run(&mut *method, &problem, &start, &limits).stop.reason, StopReason::Time);
        let limits = Limits::new(99, 1e-12);
        let stopped = drive(&mut *method, &problem, Beginning::At(&start), &limits, |history, _| {
            Ok(if history.progress.len() > 4 { Control::Stop } else { Control::Continue })
        })
        .unwrap();
        assert_eq!((stopped.stop.reason, stopped.stop.iteration), (StopReason::Interrupted, 4));
    }
}

/// A problem with noise of known norm, and regularization stacked below it.
#[test]
fn the_discrepancy_principle_stops_at_the_noise_of_the_data() {
    let dense = Dense::new(random_matrix(80, 30, 12));
    let mut truth = dense.domain();
    truth.0.iter_mut().enumerate().for_each(|(k, x)| *x = [(k as f64).sin(), 1.0, (k % 3) as f64]);
    let (mut b, noise) = (dense.range(), rhs(80, 77));
    dense.apply(&truth, &mut b).unwrap();
    b.axpby([0.3; 3], &noise, [1.0; 3]);
    let level = 0.09 * noise.norm_squared().unwrap().iter().sum::<f64>();
    let pull = Identity::scaled(&truth, [0.1; 3]);
    let stacked = Stacked::new(&dense).over(pull).unwrap();
    let right = Blocks::new(b.clone(), vec![dense.domain()]);
    let problem = LeastSquares::new(&stacked, &right);
    let limits = Limits { discrepancy: Some(level), ..Limits::new(500, 1e-10) };
    // One that keeps the residual, and one for which it is computed.
    let mut fista = Fista::new(&stacked);
    let mut lsqr = Lsqr::new(&stacked);
    let methods: [&mut dyn Method<Stacked<CpuVector<f64>>>; 2] = [&mut fista, &mut lsqr];
    for method in methods {
        let outcome = run(method, &problem, &dense.domain(), &limits);
        assert_eq!(outcome.stop.reason, StopReason::Discrepancy, "{}", method.name());
        let data = LeastSquares::new(&dense, &b);
        let fit = 2.0 * super::objective(&data, method.solution()).iter().sum::<f64>();
        assert!(fit <= level && fit > 0.25 * level, "{fit:?} {level:?}");
        let all = run(method, &problem, &dense.domain(), &Limits::new(2000, 1e-10));
        assert!(all.stop.iteration > outcome.stop.iteration);
    }
}

#[test]
fn channels_that_are_done_are_left_alone() {
    let dense = Dense::new(random_matrix(40, 30, 3));
    // The first channel begins at its solution, the second needs a few iterations, the third has no target.
    let mut truth = dense.domain();
    truth.fill([0.5, 2.0, 0.0]);
    let mut b = rhs(40, 3);
    let mut exact = dense.range();
    dense.apply(&truth, &mut exact).unwrap();
    b.0.iter_mut().zip(&exact.0).for_each(|(b, exact)| *b = [exact[0], b[1], 0.0]);
    let mut start = dense.domain();
    start.fill([0.5, 0.0, 0.0]);
    let scaling = dense.scaling();
    let problem = LeastSquares::new(&dense, &b).measured(&scaling);
    for mut method in all(&dense) {
        let outcome = run(&mut *method, &problem, &start, &Limits::new(40, 1e-13));
        assert!(outcome.history.settled[0], "{}", method.name());
        assert_eq!(outcome.history.spared, 2 * outcome.stop.iteration, "{}", method.name());
        assert!(method.solution().0.iter().all(|x| x[0] == 0.5 && x[2] == 0.0), "{}", method.name());
        assert!(method.solution().0.iter().any(|x| x[1] != 0.0));
    }
}

#[test]
fn rounding_ends_a_solve_and_says_so() {
    // In f32 no method gets to 1e-12; each must say why it stops, long before the limit.
    let matrix = random_matrix(50, 20, 9);
    let single = Single(Dense::new(matrix));
    let b = CpuVector::<f32>::of(&rhs(50, 9).0);
    let problem = LeastSquares::new(&single, &b).bounded(Bounds::NOT_NEGATIVE);
    let mut start = single.domain();
    start.fill([0.1; 3]);
    for mut method in all(&single) {
        let outcome = run(&mut *method, &problem, &start, &Limits::new(100_000, 1e-12));
        if ["flexible-cgls", "clamped-cgls"].contains(&method.name()) {
            continue;
        }
        assert!(
            matches!(outcome.stop.reason, StopReason::Stagnation | StopReason::Tolerance),
            "{} {:?}",
            method.name(),
            outcome.stop
        );
        assert!(outcome.stop.iteration < 20_000, "{} {:?}", method.name(), outcome.stop);
        assert!(outcome.true_normal_residual.iter().all(|&r| r < 1e-5), "{} {outcome:?}", method.name());
    }
}

/// The same matrix in f32.
struct Single(Dense);

impl LinearOperator for Single {
    type Domain = CpuVector<f32>;
    type Range = CpuVector<f32>;

    fn domain(&self) -> CpuVector {
        CpuVector::zeros(self.0.matrix.ncols())
    }

    fn range(&self) -> CpuVector {
        CpuVector::zeros(self.0.matrix.nrows())
    }

    fn apply(&self, x: &CpuVector, y: &mut CpuVector) -> unscatter::Result<()> {
        let mut wide = self.0.range();
        self.0.apply(&CpuVector(x.to_host()?), &mut wide)?;
        y.set_from_host(&wide.0)
    }

    fn apply_adjoint(&self, y: &CpuVector, x: &mut CpuVector) -> unscatter::Result<()> {
        let mut wide = self.0.domain();
        self.0.apply_adjoint(&CpuVector(y.to_host()?), &mut wide)?;
        x.set_from_host(&wide.0)
    }
}

#[test]
fn a_recursion_that_parts_from_the_truth_begins_again() {
    // Hilbert's matrix: CGLS believes to have converged long before it has.
    let dense = Dense::new(nalgebra::DMatrix::from_fn(12, 12, |i, j| 1.0 / (i + j + 1) as f64));
    let b = rhs(12, 4);
    let problem = LeastSquares::new(&dense, &b);
    let mut method = Cgls::new(&dense);
    let outcome = run(&mut method, &problem, &dense.domain(), &Limits::new(5000, 1e-12));
    let truth = outcome.true_normal_residual.iter().copied().fold(0.0, f64::max);
    match outcome.stop.reason {
        StopReason::Tolerance => assert!(truth <= 1.5e-12),
        reason => assert!(reason == StopReason::Stagnation || outcome.history.restarts > 0, "{outcome:?}"),
    }
}

#[test]
fn a_start_that_is_the_solution_but_for_rounding_is_kept() {
    let single = Single(Dense::new(random_matrix(50, 20, 9).abs()));
    let mut start = single.domain();
    start.fill([0.3, 1.7, 0.9]);
    let mut b = single.range();
    single.apply(&start, &mut b).unwrap();
    // The third channel has something to do.
    b.0.iter_mut().step_by(3).for_each(|b| b[2] *= 1.5);
    let problem = LeastSquares::new(&single, &b).bounded(Bounds::NOT_NEGATIVE);
    for mut method in all(&single) {
        let outcome = run(&mut *method, &problem, &start, &Limits::new(300, 1e-3));
        assert!(outcome.history.settled[0] && outcome.history.settled[1], "{}", method.name());
        assert!(method.solution().0.iter().all(|x| x[0] == 0.3 && x[1] == 1.7), "{}", method.name());
        assert_eq!(outcome.true_normal_residual[..2], [0.0, 0.0]);
    }
}

#[test]
fn a_ripple_of_momentum_is_no_stagnation() {
    // Near the end the objective no longer tells steps apart, and a restarted method's gradient goes up and down.
    let (seed, rows, columns) = (9_845_165_538_170_905_592, 18, 16);
    let dense = Dense::new(random_matrix(rows, columns, seed));
    let (pull, b) = (Identity::scaled(&dense.domain(), [f64::powi(2.0, -6).sqrt(); 3]), rhs(rows, seed));
    let stacked = Stacked::new(&dense).over(pull).unwrap();
    let right = Blocks::new(b, vec![dense.domain()]);
    let mut method = Fista::new(&stacked);
    let problem = LeastSquares::new(&stacked, &right);
    let outcome = run(&mut method, &problem, &dense.domain(), &Limits::new(8000, 1e-11));
    assert_eq!(
        outcome.stop.reason,
        StopReason::Tolerance,
        "{:?} {:?}",
        outcome.stop,
        outcome.true_normal_residual
    );
}
