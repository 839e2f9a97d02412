//! The solver against dense factorizations, and the promises of its driver.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use unscatter::cpu::{Transport, WalkPlan};
use unscatter::march::{Traversal, Weight};
use unscatter::operator::{CpuVector, Identity, LinearOperator, Stacked, Vector};
use unscatter::scene::Strategy;
use unscatter::solve::{Cgls, Control, LeastSquares, Limits, Method, Outcome, StopReason, drive};

use crate::scenes::Numbers;

/// A dense matrix as a traversal.
#[derive(Clone)]
struct Dense(DMatrix<f64>);

impl Traversal<f64, 1> for Dense {
    fn rows(&self) -> usize {
        self.0.nrows()
    }
    fn elements(&self) -> usize {
        self.0.ncols()
    }
    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f64, 1>)) {
        (0..self.0.ncols()).for_each(|element| visit(element, [self.0[(row, element)]]));
    }
}

fn operator(matrix: &DMatrix<f64>) -> Transport<Dense, f64, 1> {
    let dense = Dense(matrix.clone());
    let plan = WalkPlan::new::<f64, 1>(&dense);
    Transport::new(dense, &plan, Strategy::Auto, u64::MAX).unwrap()
}

fn random_matrix(rows: usize, columns: usize, seed: u64) -> DMatrix<f64> {
    let mut n = Numbers(seed | 1);
    DMatrix::from_fn(rows, columns, |_, _| n.uniform(-1.0, 1.0))
}

/// Three right-hand sides that differ by channel.
fn rhs(rows: usize, seed: u64) -> CpuVector<f64> {
    let mut n = Numbers(seed.wrapping_add(99) | 1);
    CpuVector((0..rows).map(|_| std::array::from_fn(|_| n.uniform(-1.0, 1.0))).collect())
}

fn limits(iterations: usize, tolerance: f64) -> Limits {
    Limits { iterations, tolerance, time: None }
}

fn run<O: LinearOperator>(operator: &O, b: &O::Range, limits: &Limits) -> (Cgls<O>, Outcome) {
    let mut method = Cgls::new(operator);
    let problem = LeastSquares { operator, rhs: b };
    let outcome =
        drive(&mut method, &problem, &operator.domain(), limits, None, |_, _| Ok(Control::Continue));
    (method, outcome.unwrap())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..Default::default() })]

    #[test]
    fn regularized_solutions_agree_with_a_dense_factorization(
        seed in 1u64.., rows in 1usize..40, columns in 1usize..30, exponent in -12i32..2
    ) {
        let (matrix, lambda) = (random_matrix(rows, columns, seed), f64::powi(2.0, exponent));
        let (operator, b) = (operator(&matrix), rhs(rows, seed));
        let identity = Identity::scaled(&operator.domain(), [lambda.sqrt(); 3]);
        let stacked = Stacked::new(&operator, identity).unwrap();
        let (method, outcome) = run(&stacked, &(b.clone(), operator.domain()), &limits(500, 1e-12));
        prop_assert_eq!(outcome.stop.reason, StopReason::Tolerance);
        let normal = matrix.transpose() * &matrix + DMatrix::identity(columns, columns) * lambda;
        for c in 0..3 {
            let right = matrix.transpose() * DVector::from_iterator(rows, b.0.iter().map(|b| b[c]));
            let truth = normal.clone().cholesky().unwrap().solve(&right);
            let x = DVector::from_iterator(columns, method.solution().0.iter().map(|x| x[c]));
            prop_assert!((x - &truth).norm() <= 1e-8 * truth.norm().max(1e-12));
        }
    }

    #[test]
    fn a_problem_of_any_scale_takes_the_same_iterations(seed in 1u64.., exponent in -12i32..=12) {
        let matrix = random_matrix(30, 12, seed);
        let iterations = |scale: f64| {
            let mut b = rhs(30, seed);
            b.scale([scale; 3]);
            run(&operator(&(matrix.clone() * scale)), &b, &limits(100, 1e-8)).1.stop.iteration
        };
        // A power of two changes no mantissa, so not a single bit of the path.
        prop_assert_eq!(iterations(f64::powi(8.0, exponent)), iterations(1.0));
    }
}

#[test]
fn what_the_rows_do_not_determine_keeps_its_start() {
    // Rank 2 of 5, and one column that is zero.
    let mut matrix = random_matrix(2, 5, 3);
    matrix.column_mut(4).fill(0.0);
    let operator = operator(&matrix);
    let mut method = Cgls::new(&operator);
    let mut start = operator.domain();
    start.fill([0.7; 3]);
    let b = rhs(2, 3);
    let problem = LeastSquares { operator: &operator, rhs: &b };
    let outcome =
        drive(&mut method, &problem, &start, &limits(50, 1e-13), None, |_, _| Ok(Control::Continue)).unwrap();
    assert!(outcome.true_residual.iter().all(|&residual| residual < 1e-10));
    assert_eq!(method.solution().0[4], [0.7; 3]);
    // The step away from the start lies in the row space.
    let step = DVector::from_iterator(5, method.solution().0.iter().map(|x| x[0] - 0.7));
    let projected =
        matrix.transpose() * (&matrix * matrix.transpose()).cholesky().unwrap().solve(&(&matrix * &step));
    assert!((projected - step).norm() < 1e-10);
}

#[test]
fn solved_at_the_start_zero_rhs_one_unknown_one_row_and_none() {
    for (rows, columns) in [(1, 1), (1, 5), (5, 1), (0, 3), (4, 4)] {
        let operator = operator(&random_matrix(rows, columns, 8));
        let (method, outcome) = run(&operator, &operator.range(), &limits(10, 1e-9));
        assert_eq!((outcome.stop.reason, outcome.stop.iteration), (StopReason::Tolerance, 0));
        assert!(method.solution().0.iter().all(|x| *x == [0.0; 3]));
        let (_, outcome) = run(&operator, &rhs(rows, 1), &limits(60, 1e-9));
        assert_eq!(outcome.stop.reason, StopReason::Tolerance, "{rows} × {columns}");
    }
}

#[test]
fn limits_are_reasons_and_not_errors() {
    let operator = operator(&random_matrix(40, 30, 2));
    let b = rhs(40, 2);
    assert_eq!(run(&operator, &b, &limits(3, 1e-12)).1.stop.reason, StopReason::Iterations);
    let time = Limits { time: Some(std::time::Duration::ZERO), ..limits(1000, 1e-12) };
    assert_eq!(run(&operator, &b, &time).1.stop.reason, StopReason::Time);
    let mut method = Cgls::new(&operator);
    let problem = LeastSquares { operator: &operator, rhs: &b };
    let stop_at_4 = |history: &unscatter::solve::History, _: &_| {
        Ok(if history.progress.len() > 4 { Control::Stop } else { Control::Continue })
    };
    let outcome =
        drive(&mut method, &problem, &operator.domain(), &limits(99, 1e-12), None, stop_at_4).unwrap();
    assert_eq!((outcome.stop.reason, outcome.stop.iteration), (StopReason::Interrupted, 4));
}

#[test]
fn a_resumed_solve_takes_the_same_path_to_the_last_bit() {
    let operator = operator(&random_matrix(60, 40, 4));
    let b = rhs(60, 4);
    let problem = LeastSquares { operator: &operator, rhs: &b };
    let (whole, outcome) = run(&operator, &b, &limits(20, 1e-30));
    let mut first = Cgls::new(&operator);
    let half = drive(&mut first, &problem, &operator.domain(), &limits(9, 1e-30), None, |_, _| {
        Ok(Control::Continue)
    })
    .unwrap();
    let mut second = Cgls::new(&operator);
    second.restore(&first.save().unwrap()).unwrap();
    let resumed =
        drive(&mut second, &problem, &operator.domain(), &limits(20, 1e-30), Some(half.history), |_, _| {
            Ok(Control::Continue)
        })
        .unwrap();
    assert_eq!(second.solution(), whole.solution());
    let residuals =
        |outcome: &Outcome| outcome.history.progress.iter().map(|p| p.residual).collect::<Vec<_>>();
    assert_eq!(residuals(&resumed), residuals(&outcome));
    assert!(second.restore(&unscatter::solve::State::default()).is_err());
}

#[test]
fn a_nan_in_the_matrix_is_an_error() {
    let mut matrix = random_matrix(5, 5, 1);
    matrix[(2, 2)] = f64::NAN;
    let operator = operator(&matrix);
    let mut method = Cgls::new(&operator);
    let b = rhs(5, 1);
    let problem = LeastSquares { operator: &operator, rhs: &b };
    let outcome = drive(&mut method, &problem, &operator.domain(), &limits(9, 1e-9), None, |_, _| {
        Ok(Control::Continue)
    });
    assert!(matches!(outcome, Err(unscatter::Error::NonFinite { .. })), "{outcome:?}");
}

#[test]
fn clamped_iterates_are_not_negative() {
    let operator = operator(&random_matrix(30, 20, 6));
    let b = rhs(30, 6);
    let problem = LeastSquares { operator: &operator, rhs: &b };
    let mut method = Cgls::clamped(&operator);
    drive(&mut method, &problem, &operator.domain(), &limits(9, 1e-9), None, |_, method| {
        assert!(method.solution().0.iter().flatten().all(|&x| x >= 0.0));
        Ok(Control::Continue)
    })
    .unwrap();
}
