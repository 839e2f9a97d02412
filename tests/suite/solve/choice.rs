//! Regularizers on the lattice of the unknowns, and weights chosen by the data.

use std::sync::Arc;

use nalgebra::DMatrix;
use unscatter::operator::{
    CpuVector, Gradient, Identity, Indexed, Laplacian, Lattices, LinearOperator, Neighbours, Vector,
    adjoint_test,
};
use unscatter::solve::{LeastSquares, Rule, Term, choose_weight};

use super::{Dense, random_matrix, rhs};
use crate::tolerances::ADJOINT_F64;

/// An L of unknowns on a lattice of 4 × 3, two of its elements cut off from the others.
const COLUMNS: [u32; 8] = [0, 1, 2, 4, 6, 8, 9, 11];

fn operators() -> (Arc<Neighbours>, Gradient<CpuVector<f64>>, Laplacian<CpuVector<f64>>) {
    let neighbours = Arc::new(Neighbours::new([4, 3], &COLUMNS).unwrap());
    let prototype = CpuVector::<f64>::zeros(COLUMNS.len());
    (
        neighbours.clone(),
        Gradient::new(neighbours.clone(), &prototype).unwrap(),
        Laplacian::new(neighbours, &prototype).unwrap(),
    )
}

fn explicit<O>(operator: &O) -> DMatrix<f64>
where
    O: LinearOperator<Domain = CpuVector<f64>, Range = CpuVector<f64>>,
{
    let (mut unit, mut image) = (operator.domain(), operator.range());
    let mut matrix = DMatrix::zeros(image.len(), unit.len());
    for column in 0..unit.len() {
        unit.fill([0.0; 3]);
        unit.0[column] = [1.0; 3];
        operator.apply(&unit, &mut image).unwrap();
        image.0.iter().enumerate().for_each(|(row, value)| matrix[(row, column)] = value[1]);
    }
    matrix
}

#[test]
fn differences_are_those_of_the_neighbours_and_nothing_else() {
    let (neighbours, gradient, laplacian) = operators();
    let g = explicit(&gradient);
    let mut pairs: Vec<(u32, u32)> = (0..g.nrows())
        .map(|row| {
            let entries: Vec<f64> = g.row(row).iter().copied().filter(|value| *value != 0.0).collect();
            assert_eq!(entries.len(), 2);
            assert_eq!(entries.iter().sum::<f64>(), 0.0);
            let at = |sign: f64| COLUMNS[g.row(row).iter().position(|value| *value == sign).unwrap()];
            (at(-1.0), at(1.0))
        })
        .collect();
    pairs.sort_unstable();
    assert_eq!(pairs, [(0, 1), (0, 4), (1, 2), (2, 6), (4, 8), (8, 9)]);
    assert_eq!(neighbours.edges(), 6);
    // The Laplacian is Gᵀ G: symmetric, and zero for a constant, at the boundary as well.
    let l = explicit(&laplacian);
    assert_eq!(l, g.transpose() * &g);
    assert!((&l * DMatrix::from_element(COLUMNS.len(), 1, 3.5)).iter().all(|value| *value == 0.0));
    // 11 has no neighbour, so nothing pulls at it.
    assert!(l.column(7).iter().all(|value| *value == 0.0));
    assert!(adjoint_test(&gradient, 3, 1).unwrap().error <= ADJOINT_F64);
    assert!(adjoint_test(&laplacian, 3, 1).unwrap().error <= ADJOINT_F64);
}

#[test]
fn their_majorizers_are_the_sums_of_absolute_values() {
    let (neighbours, gradient, laplacian) = operators();
    for (matrix, diagonal) in [
        (explicit(&gradient), neighbours.gradient_majorizer()),
        (explicit(&laplacian), neighbours.laplacian_majorizer()),
    ] {
        let absolute = matrix.abs();
        let sums = absolute.transpose() * absolute.column_sum();
        assert_eq!(sums.as_slice(), diagonal);
    }
    for outside_or_twice in [&[24][..], &[3, 3]] {
        assert!(Neighbours::new([4, 3], outside_or_twice).is_err());
    }
    // Twelve places in a plane, then two along a line, then a cube.
    let lattices = Lattices::new([vec![4, 3], vec![2], vec![2; 3]]);
    let several = Neighbours::new(lattices, &[11, 12, 13, 14, 18, 21]).unwrap();
    assert_eq!(
        (several.edges(), several.degrees()),
        (2, vec![0, 1, 1, 1, 1, 0]),
        "lattices are no neighbours"
    );
    let volume = Neighbours::new([2, 2, 2], &[0, 1, 2, 3, 4, 5, 6, 7]).unwrap();
    assert_eq!((volume.edges(), volume.degrees()), (12, vec![3; 8]));
    let mut picked = CpuVector::<f64>::zeros(2);
    picked.pick(&CpuVector(vec![[1.0; 3], [2.0; 3]]), &vec![1, u32::MAX].into());
    assert_eq!(picked.0, [[2.0; 3], [0.0; 3]]);
}

/// A smoothing matrix of rapidly falling singular values, a smooth truth, and noise of a known size in b.
fn blurred(noise: f64) -> (Dense, CpuVector<f64>, CpuVector<f64>) {
    let size = 40;
    let matrix = DMatrix::from_fn(size, size, |i, j| (-((i as f64 - j as f64) / 2.5).powi(2)).exp());
    let dense = Dense::new(matrix);
    let wave = |k: usize| {
        let t = k as f64 / size as f64;
        [(6.0 * t).sin() + 1.0, 2.0 * t, (3.0 * t).cos()]
    };
    let truth = CpuVector((0..size).map(wave).collect());
    let mut b = dense.range();
    dense.apply(&truth, &mut b).unwrap();
    b.axpby([noise; 3], &rhs(size, 5), [1.0; 3]);
    (dense, truth, b)
}

/// The distance of the regularized solution to the truth.
fn error(dense: &Dense, b: &CpuVector<f64>, truth: &CpuVector<f64>, r: &DMatrix<f64>, lambda: f64) -> f64 {
    let a = &dense.matrix;
    let factors = (a.transpose() * a + r.transpose() * r * lambda).cholesky().unwrap();
    let matrix = |vector: &CpuVector<f64>| DMatrix::from_fn(vector.len(), 3, |k, c| vector.0[k][c]);
    (factors.solve(&(a.transpose() * matrix(b))) - matrix(truth)).norm()
}

#[test]
fn a_chosen_weight_is_about_as_good_as_the_best() {
    for noise in [1e-3, 1e-2, 1e-1] {
        let (dense, truth, b) = blurred(noise);
        let columns: Vec<u32> = (0..40).collect();
        let neighbours = Arc::new(Neighbours::new([40], &columns).unwrap());
        let identity = Identity::scaled(&dense.domain(), [1.0; 3]);
        let gradient = Gradient::new(neighbours, &dense.domain()).unwrap();
        let problem = LeastSquares::new(&dense, &b);
        let operators: [&dyn LinearOperator<Domain = _, Range = _>; 2] = [&identity, &gradient];
        let matrices = [explicit(&identity), explicit(&gradient)];
        for (operator, matrix) in operators.into_iter().zip(&matrices) {
            let error = |lambda: f64| error(&dense, &b, &truth, matrix, lambda);
            let weights: Vec<f64> = (-80..12).map(|k| 10f64.powf(f64::from(k) / 10.0)).collect();
            let best = weights.iter().copied().map(error).fold(f64::INFINITY, f64::min);
            let choose = |rule| {
                choose_weight(&problem, &dense.domain(), &[Term { operator, weight: None }], rule).unwrap()
            };
            let got = error(choose(Rule::Gcv));
            assert!(got < 3.0 * best, "GCV at noise {noise}: {got:.2e}, best {best:.2e}");
            // The corner is a matter of definition: it must be that of the whole problem's curve.
            let (corner, got) = (corner(&dense, &b, matrix, &weights), choose(Rule::LCurve));
            assert!(
                (0.5..2.0).contains(&(got / corner)),
                "L-curve at noise {noise}: {got:.1e}, {corner:.1e}"
            );
            assert!(error(got) < 0.2 * error(1e-12), "any corner is better than none");
        }
    }
}

/// The weight at the corner of the L-curve of the whole problem, by dense factorizations.
fn corner(dense: &Dense, b: &CpuVector<f64>, r: &DMatrix<f64>, weights: &[f64]) -> f64 {
    let a = &dense.matrix;
    let b = DMatrix::from_fn(b.len(), 3, |k, c| b.0[k][c]);
    let curve: Vec<[f64; 2]> = weights
        .iter()
        .map(|&lambda| {
            let factors = (a.transpose() * a + r.transpose() * r * lambda).cholesky().unwrap();
            let x = factors.solve(&(a.transpose() * &b));
            [(a * &x - &b).norm().ln(), (r * x).norm().ln()]
        })
        .collect();
    let curvature = |i: usize| {
        let [before, here, after] = [curve[i - 1], curve[i], curve[i + 1]];
        let first = [0, 1].map(|k| 0.5 * (after[k] - before[k]));
        let second = [0, 1].map(|k| after[k] - 2.0 * here[k] + before[k]);
        // Towards larger λ the curve turns left at its corner.
        (first[0] * second[1] - first[1] * second[0]) / first[0].hypot(first[1]).powi(3)
    };
    let best = (1..curve.len() - 1).max_by(|&i, &j| curvature(i).total_cmp(&curvature(j))).unwrap();
    weights[best]
}

#[test]
fn only_one_weight_is_chosen_at_a_time_and_from_data_that_say_something() {
    let dense = Dense::new(random_matrix(6, 4, 1));
    let b = rhs(6, 1);
    let problem = LeastSquares::new(&dense, &b);
    let identity = Identity::scaled(&dense.domain(), [1.0; 3]);
    let term = |weight| Term { operator: &identity as _, weight };
    assert!(choose_weight(&problem, &dense.domain(), &[term(None), term(None)], Rule::Gcv).is_err());
    assert!(choose_weight(&problem, &dense.domain(), &[term(Some(1.0))], Rule::Gcv).is_err());
    assert!(choose_weight(&problem, &dense.domain(), &[term(None), term(Some(0.1))], Rule::LCurve).is_ok());
    let zero = dense.range();
    let solved = LeastSquares::new(&dense, &zero);
    assert!(choose_weight(&solved, &dense.domain(), &[term(None)], Rule::Gcv).is_err());
}
