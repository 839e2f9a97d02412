//! What holds for every method.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use unscatter::Error;
use unscatter::operator::{Blocks, Bounds, CpuVector, Identity, LinearOperator, Stacked, Vector};
use unscatter::solve::{Beginning, Cgls, Control, LeastSquares, Limits, StopReason, drive, restore, save};

use super::{Dense, all, bounded, objective, random_matrix, rhs, run, unbounded};

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..Default::default() })]

    #[test]
    fn regularized_solutions_agree_with_a_dense_factorization(
        seed in 1u64.., rows in 1usize..40, columns in 1usize..30, exponent in -8i32..2
    ) {
        let (matrix, lambda) = (random_matrix(rows, columns, seed), f64::powi(2.0, exponent));
        let (dense, b) = (Dense::new(matrix.clone()), rhs(rows, seed));
        let pull = Identity::scaled(&dense.domain(), [lambda.sqrt(); 3]);
        let stacked = Stacked::new(&dense).over(pull).unwrap();
        let right = Blocks::new(b.clone(), vec![dense.domain()]);
        let normal = matrix.transpose() * &matrix + DMatrix::identity(columns, columns) * lambda;
        let truth: Vec<DVector<f64>> = (0..3).map(|c| {
            let right = matrix.transpose() * DVector::from_iterator(rows, b.0.iter().map(|b| b[c]));
            normal.clone().cholesky().unwrap().solve(&right)
        }).collect();
        // Without bounds, the methods that keep bounds solve the same problem.
        let problem = LeastSquares::new(&stacked, &right);
        for mut method in boxed(&stacked) {
            let outcome = run(&mut *method, &problem, &dense.domain(), &Limits::new(8000, 1e-11));
            prop_assert_eq!(outcome.stop.reason, StopReason::Tolerance, "{}", method.name());
            prop_assert!(outcome.true_normal_residual.iter().all(|&residual| residual <= 1.5e-11));
            for (c, truth) in truth.iter().enumerate() {
                let x = DVector::from_iterator(columns, method.solution().0.iter().map(|x| x[c]));
                prop_assert!((x - truth).norm() <= 1e-7 * truth.norm().max(1e-12), "{}", method.name());
            }
        }
    }

    #[test]
    fn a_problem_of_any_scale_takes_the_same_iterations(seed in 1u64.., exponent in -4i32..=4) {
        // A power of two changes no mantissa, so not a single bit of the path. From 2⁻⁴⁰, 1e-12, to 1e12.
        let iterations = |scale: f64| -> Vec<usize> {
            let dense = Dense::new(random_matrix(30, 12, seed) * scale);
            let mut b = rhs(30, seed);
            b.scale([scale; 3]);
            let scaling = dense.scaling();
            all(&dense).into_iter().map(|mut method| {
                let problem = LeastSquares::new(&dense, &b).bounded(Bounds::NOT_NEGATIVE).measured(&scaling);
                let mut start = dense.domain();
                start.fill([0.5; 3]);
                // Not more, because elements on their way to a bound must not become subnormal numbers.
                run(&mut *method, &problem, &start, &Limits::new(100, 1e-6)).stop.iteration
            }).collect()
        };
        prop_assert_eq!(iterations(f64::powi(2.0, 10 * exponent)), iterations(1.0));
    }
}

/// The methods that end at the solution, for operators that borrow.
fn boxed<'a>(
    operator: &Stacked<'a, CpuVector<f64>>,
) -> Vec<Box<dyn unscatter::solve::Method<Stacked<'a, CpuVector<f64>>> + 'a>> {
    vec![
        Box::new(Cgls::new(operator)),
        Box::new(unscatter::solve::Lsqr::new(operator)),
        Box::new(unscatter::solve::Lsmr::new(operator)),
        Box::new(unscatter::solve::Fista::new(operator)),
        Box::new(unscatter::solve::Spectral::new(operator)),
        Box::new(unscatter::solve::Lbfgs::new(operator)),
        Box::new(unscatter::solve::Mprgp::new(operator)),
    ]
}

#[test]
fn what_the_rows_do_not_determine_keeps_its_start() {
    // Rank 2 of 5, and one column that is zero.
    let mut matrix = random_matrix(2, 5, 3);
    matrix.column_mut(4).fill(0.0);
    let dense = Dense::new(matrix.clone());
    let mut start = dense.domain();
    start.fill([0.7; 3]);
    let b = rhs(2, 3);
    let problem = LeastSquares::new(&dense, &b);
    let mut methods = unbounded(&dense);
    methods.extend(bounded(&dense));
    for mut method in methods {
        let outcome = run(&mut *method, &problem, &start, &Limits::new(4000, 1e-12));
        assert!(outcome.true_residual.iter().all(|&residual| residual < 1e-8), "{}", method.name());
        assert_eq!(method.solution().0[4], [0.7; 3], "{}", method.name());
        // The step away from the start lies in the row space.
        let step = DVector::from_iterator(5, method.solution().0.iter().map(|x| x[0] - 0.7));
        let projected =
            matrix.transpose() * (&matrix * matrix.transpose()).cholesky().unwrap().solve(&(&matrix * &step));
        assert!((projected - step).norm() < 1e-8, "{}", method.name());
    }
}

#[test]
fn solved_at_the_start_zero_rhs_one_unknown_one_row_and_none() {
    for (rows, columns) in [(1, 1), (1, 5), (5, 1), (0, 3), (3, 0), (0, 0), (4, 4)] {
        let dense = Dense::new(random_matrix(rows, columns, 8));
        for bounds in [Bounds::NONE, Bounds::new([-0.1; 3], [0.2; 3]).unwrap()] {
            for mut method in all(&dense) {
                let name = format!("{} {rows} × {columns}", method.name());
                let zero = dense.range();
                let problem = LeastSquares::new(&dense, &zero).bounded(bounds.clone());
                let outcome = run(&mut *method, &problem, &dense.domain(), &Limits::new(10, 1e-9));
                assert_eq!(
                    (outcome.stop.reason, outcome.stop.iteration),
                    (StopReason::Tolerance, 0),
                    "{name}"
                );
                assert!(method.solution().0.iter().all(|x| *x == [0.0; 3]), "{name}");
                let b = rhs(rows, 1);
                let problem = LeastSquares::new(&dense, &b).bounded(bounds.clone());
                let outcome = run(&mut *method, &problem, &dense.domain(), &Limits::new(3000, 1e-7));
                if !["flexible-cgls", "clamped-cgls"].contains(&method.name()) {
                    assert_eq!(outcome.stop.reason, StopReason::Tolerance, "{name} {outcome:?}");
                }
            }
        }
    }
}

#[test]
fn within_bounds_the_solution_is_kept_and_the_certificate_is_true() {
    let mut matrix = random_matrix(40, 25, 21);
    // Exactly repeated rows, a zero row and a zero column.
    let repeated = matrix.row(3).clone_owned();
    matrix.row_mut(7).copy_from(&repeated);
    matrix.row_mut(8).fill(0.0);
    matrix.column_mut(5).fill(0.0);
    let dense = Dense::new(matrix);
    let scaling = dense.scaling();
    let b = rhs(40, 21);
    let bounds = Bounds::new([0.0, -0.2, f64::NEG_INFINITY], [f64::INFINITY, 0.1, 0.0]).unwrap();
    let mut start = dense.domain();
    start.fill([0.4, 0.05, -0.3]);
    let mut found: Vec<CpuVector<f64>> = Vec::new();
    for with_metric in [true, false] {
        let problem = LeastSquares::new(&dense, &b).bounded(bounds.clone());
        let problem = if with_metric { problem.measured(&scaling) } else { problem };
        for mut method in bounded(&dense) {
            let limits = Limits::new(20_000, 1e-10);
            let outcome = drive(&mut *method, &problem, Beginning::At(&start), &limits, |_, method| {
                for x in &method.solution().0 {
                    assert!((0..3).all(|c| bounds.of(0)[0][c] <= x[c] && x[c] <= bounds.of(0)[1][c]));
                }
                Ok(Control::Continue)
            })
            .unwrap();
            assert_eq!(outcome.stop.reason, StopReason::Tolerance, "{}", method.name());
            // The KKT conditions, from their definition.
            let mut r = dense.range();
            dense.apply(method.solution(), &mut r).unwrap();
            r.axpby([-1.0; 3], &b, [1.0; 3]);
            let mut g = dense.domain();
            dense.apply_adjoint(&r, &mut g).unwrap();
            for (x, g) in method.solution().0.iter().zip(&g.0) {
                for c in 0..3 {
                    let held_low = x[c] == bounds.of(0)[0][c] && g[c] >= 0.0;
                    let held_high = x[c] == bounds.of(0)[1][c] && g[c] <= 0.0;
                    assert!(held_low || held_high || g[c].abs() < 1e-8, "{} {x:?} {g:?}", method.name());
                }
            }
            // The zero column keeps its start, moved into the bounds.
            assert_eq!(method.solution().0[5], [0.4, 0.05, -0.3], "{}", method.name());
            found.push(method.solution().clone());
        }
    }
    for other in &found[1..] {
        for (a, b) in found[0].0.iter().flatten().zip(other.0.iter().flatten()) {
            assert!((a - b).abs() < 1e-6);
        }
    }
}

#[test]
fn the_papers_clamped_variant_fails_where_the_default_does_not() {
    // Strokes that contradict each other: many rows over few elements, targets that no x ≥ 0 meets.
    let matrix = random_matrix(60, 30, 5).abs();
    let dense = Dense::new(matrix);
    let mut b = rhs(60, 5);
    b.scale([5.0; 3]);
    let scaling = dense.scaling();
    let mut start = dense.domain();
    start.fill([1.0; 3]);
    let problem = LeastSquares::new(&dense, &b).bounded(Bounds::NOT_NEGATIVE).measured(&scaling);
    let limits = Limits::new(500, 1e-6);
    let mut clamped = Cgls::clamped(&dense);
    let failed = run(&mut clamped, &problem, &start, &limits);
    let mut default = unscatter::solve::Fista::new(&dense);
    let solved = run(&mut default, &problem, &start, &limits);
    use unscatter::solve::Method;
    assert_eq!(solved.stop.reason, StopReason::Tolerance);
    let (worse, best) = (objective(&problem, clamped.solution()), objective(&problem, default.solution()));
    assert!((0..3).all(|c| worse[c] > 1.01 * best[c]), "{worse:?} {best:?}");
    assert!(failed.true_normal_residual.iter().any(|&residual| residual > 1e-3), "{failed:?}");
}

#[test]
fn a_resumed_solve_takes_the_same_path_to_the_last_bit() {
    let dense = Dense::new(random_matrix(60, 40, 4));
    let b = rhs(60, 4);
    let scaling = dense.scaling();
    let problem = LeastSquares::new(&dense, &b).bounded(Bounds::NOT_NEGATIVE).measured(&scaling);
    let mut start = dense.domain();
    start.fill([0.3; 3]);
    for ((mut whole, mut first), mut second) in all(&dense).into_iter().zip(all(&dense)).zip(all(&dense)) {
        let outcome = run(&mut *whole, &problem, &start, &Limits::new(20, 1e-30));
        let half = run(&mut *first, &problem, &start, &Limits::new(9, 1e-30));
        let state = save(&mut *first).unwrap();
        restore(&mut *second, &state).unwrap();
        let resumed = drive(
            &mut *second,
            &problem,
            Beginning::Resumed(half.history),
            &Limits::new(20, 1e-30),
            |_, _| Ok(Control::Continue),
        )
        .unwrap();
        assert_eq!(second.solution(), whole.solution(), "{}", whole.name());
        let path = |outcome: &unscatter::solve::Outcome| {
            let progress = &outcome.history.progress;
            progress.iter().map(|p| (p.residual, p.operator_applications)).collect::<Vec<_>>()
        };
        assert_eq!(path(&resumed), path(&outcome), "{}", whole.name());
        assert!(restore(&mut *second, &unscatter::solve::State::default()).is_err());
    }
}

#[test]
fn a_solve_is_resumed_with_a_tighter_tolerance() {
    let dense = Dense::new(random_matrix(60, 40, 4));
    let (b, scaling) = (rhs(60, 4), dense.scaling());
    let problem = LeastSquares::new(&dense, &b).measured(&scaling);
    for mut method in unbounded(&dense).into_iter().chain(bounded(&dense)) {
        let loose = run(&mut *method, &problem, &dense.domain(), &Limits::new(5000, 0.1));
        assert!(loose.true_normal_residual.iter().any(|&residual| residual > 1e-6));
        let begun = Beginning::Resumed(loose.history);
        let tight =
            drive(&mut *method, &problem, begun, &Limits::new(5000, 1e-8), |_, _| Ok(Control::Continue))
                .unwrap();
        assert_eq!(tight.stop.reason, StopReason::Tolerance, "{}", method.name());
        assert!(tight.true_normal_residual.iter().all(|&residual| residual <= 1.5e-8), "{}", method.name());
    }
}

#[test]
fn a_nan_in_the_matrix_is_an_error() {
    let mut matrix = random_matrix(5, 5, 1);
    matrix[(2, 2)] = f64::NAN;
    let dense = Dense::new(matrix);
    let b = rhs(5, 1);
    let problem = LeastSquares::new(&dense, &b);
    for mut method in all(&dense) {
        let outcome =
            drive(&mut *method, &problem, Beginning::At(&dense.domain()), &Limits::new(9, 1e-9), |_, _| {
                Ok(Control::Continue)
            });
        assert!(matches!(outcome, Err(Error::NonFinite { .. })), "{} {outcome:?}", method.name());
    }
}

#[test]
fn clamped_iterates_are_not_negative() {
    let dense = Dense::new(random_matrix(30, 20, 6));
    let b = rhs(30, 6);
    let problem = LeastSquares::new(&dense, &b).bounded(Bounds::NOT_NEGATIVE);
    let mut method = Cgls::clamped(&dense);
    drive(&mut method, &problem, Beginning::At(&dense.domain()), &Limits::new(9, 1e-9), |_, method| {
        use unscatter::solve::Method;
        assert!(method.solution().0.iter().flatten().all(|&x| x >= 0.0));
        Ok(Control::Continue)
    })
    .unwrap();
}

#[test]
fn settings_that_make_no_sense_are_errors_by_name() {
    let dense = Dense::new(random_matrix(5, 4, 1));
    let b = rhs(5, 1);
    let problem = LeastSquares::new(&dense, &b);
    let fails = |problem: &LeastSquares<Dense>, start: &CpuVector<f64>, limits: Limits| {
        let mut method = Cgls::new(&dense);
        let result = drive(&mut method, problem, Beginning::At(start), &limits, |_, _| Ok(Control::Continue));
        result.unwrap_err().to_string()
    };
    let start = dense.domain();
    assert!(fails(&problem, &start, Limits::new(5, -1e-9)).contains("tolerance"));
    assert!(fails(&problem, &start, Limits::new(5, f64::NAN)).contains("tolerance"));
    let noise = Limits { discrepancy: Some(-1.0), ..Limits::new(5, 0.1) };
    assert!(fails(&problem, &start, noise).contains("discrepancy"));
    assert!(fails(&problem, &CpuVector::zeros(3), Limits::new(5, 0.1)).contains("the start has 3"));
    let short = CpuVector::zeros(2);
    let wrong = LeastSquares::new(&dense, &short);
    assert!(fails(&wrong, &start, Limits::new(5, 0.1)).contains("right-hand side"));
}
