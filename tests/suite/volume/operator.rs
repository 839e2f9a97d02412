//! Operators of volumes against the explicit matrix and each other.

use unscatter::cpu::{Transport, kept_bytes};
use unscatter::march::{Real, Refraction};
use unscatter::operator::{CpuVector, LinearOperator, Vector, WalkPlan, adjoint_test};
use unscatter::problem::Problem;
use unscatter::scene::{Find, Strategy};
use unscatter::sparse::ExplicitMatrix;

use super::*;
use crate::scenes::volume::Cloud;
use crate::tolerances::{ADJOINT_F32, ADJOINT_F64, AGAINST_EXPLICIT};

const ROWS: usize = 700;

/// Kept, in part kept, and walked.
fn stored<F: Real, const C: usize>(traversal: &VolumeTraversal) -> [Transport<VolumeTraversal, F, C>; 3] {
    let plan = WalkPlan::new::<C>(traversal);
    [
        (Strategy::Assembled, u64::MAX),
        (Strategy::Auto, kept_bytes::<F>(&plan, C) / 2),
        (Strategy::MatrixFree, 0),
    ]
    .map(|(strategy, budget)| {
        let operator = Transport::new(traversal.clone(), &plan, strategy, budget).unwrap();
        let storage = operator.storage();
        match strategy {
            Strategy::Epipolar | Strategy::Auto => assert!(storage.kept_rows > 0 && storage.walked_rows > 0),
            Strategy::Assembled => assert_eq!(storage.walked_rows, 0),
            Strategy::MatrixFree => assert_eq!(storage.kept_rows, 0),
        }
        operator
    })
}

fn random_vector(len: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut n = numbers(seed);
    (0..len).map(|_| std::array::from_fn(|_| n.uniform(-1.0, 1.0))).collect()
}

fn relative(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let norm = |values: Vec<f64>| values.iter().map(|v| v * v).sum::<f64>().sqrt();
    let differences = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a - b).collect();
    norm(differences) / norm(b.iter().flatten().copied().collect()).max(1e-300)
}

/// T x and Tᵀ y, on the host.
fn products<T: LinearOperator>(operator: &T) -> [Vec<[f64; 3]>; 2] {
    let (mut x, mut y) = (operator.domain(), operator.range());
    x.set_from_host(&random_vector(x.len(), 21)).unwrap();
    operator.apply(&x, &mut y).unwrap();
    let forward = y.to_host().unwrap();
    y.set_from_host(&random_vector(y.len(), 22)).unwrap();
    operator.apply_adjoint(&y, &mut x).unwrap();
    [forward, x.to_host().unwrap()]
}

fn agrees<const C: usize>(traversal: &VolumeTraversal) {
    let explicit = ExplicitMatrix::new::<C>(traversal, u64::MAX).unwrap();
    let truth = products(&explicit);
    for operator in stored::<f32, C>(traversal) {
        let products = products(&operator);
        assert!((0..2).all(|way| relative(&products[way], &truth[way]) <= AGAINST_EXPLICIT));
        assert!(adjoint_test(&operator, 2, 3).unwrap().error <= ADJOINT_F32);
    }
    for operator in stored::<f64, C>(traversal) {
        let products = products(&operator);
        assert!((0..2).all(|way| relative(&products[way], &truth[way]) <= 1e-13));
        assert!(adjoint_test(&operator, 2, 3).unwrap().error <= ADJOINT_F64);
        squares_are_the_diagonal(&operator, &explicit);
    }
}

fn squares_are_the_diagonal<const C: usize>(
    operator: &Transport<VolumeTraversal, f64, C>,
    explicit: &ExplicitMatrix,
) {
    let weights: Vec<[f64; 3]> = (0..ROWS).map(|row| [row as f64, 1.0, 0.5]).collect();
    let squares = operator.squares(&CpuVector(weights.clone())).unwrap();
    let mut truth = vec![[0.0; 3]; squares.0.len()];
    for c in 0..3 {
        for (&value, (row, element)) in explicit.channel(c) {
            truth[element][c] += weights[row][c] * value * value;
        }
    }
    assert!(relative(&squares.0, &truth) <= 1e-13);
}

#[test]
fn every_storage_is_the_explicit_matrix_and_has_its_adjoint() {
    for basis in BOTH {
        agrees::<1>(&random_traversal(3, ROWS, 1, basis));
        agrees::<3>(&random_traversal(4, ROWS, 3, basis));
    }
}

#[test]
fn clouds_of_the_benches_obey_the_same_laws() {
    for basis in BOTH {
        for is_full in [false, true] {
            let cloud = Cloud::seen_twice(is_full, basis).shrunk(8);
            let problem = cloud.problem(Find::Emission);
            assert_eq!(problem.targets.len() + problem.left_out.beside, 2 * 60 * 60);
            let truth = products(&ExplicitMatrix::new::<1>(&problem.traversal, u64::MAX).unwrap());
            for strategy in [Strategy::Assembled, Strategy::MatrixFree] {
                let operator = problem.on_cpu(strategy, u64::MAX).unwrap();
                let products = products(&operator);
                assert!((0..2).all(|way| relative(&products[way], &truth[way]) <= AGAINST_EXPLICIT));
                assert!(adjoint_test(&operator, 2, 3).unwrap().error <= ADJOINT_F32);
            }
            // The other basis is another matrix.
            let other = if basis == BOTH[0] { BOTH[1] } else { BOTH[0] };
            let other = Cloud { basis: other, ..cloud }.problem(Find::Emission);
            let shown = products(&ExplicitMatrix::new::<1>(&other.traversal, u64::MAX).unwrap());
            let same = shown[0].len() == truth[0].len() && shown[1].len() == truth[1].len();
            assert!(!same || relative(&shown[1], &truth[1]) > AGAINST_EXPLICIT);
        }
    }
}

#[test]
fn bent_rays_have_an_adjoint_as_well() {
    let mut traversal = random_traversal(6, ROWS, 1, Interpolation::Trilinear);
    let mut n = numbers(8);
    let cube = DAffine3::from_scale(DVec3::splat(3.0)) * DAffine3::from_translation(DVec3::splat(-0.5));
    let grid = VoxelGrid::over_cube([5, 6, 7], cube).unwrap();
    let samples = (0..grid.len()).map(|_| n.uniform(1.0, 1.3) as f32).collect();
    let index = Arc::new(Volume::new(grid, 1, Samples::F32(samples)).unwrap());
    let mut transport = traversal.transport().clone();
    transport.refraction = Some(Arc::new(Refraction::new(index, 0.1).unwrap()));
    traversal = VolumeTraversal::new(transport, traversal.rays().clone(), traversal.parts().to_vec());
    agrees::<1>(&traversal);
}

#[test]
fn results_are_bit_identical_for_any_number_of_threads() {
    let traversal = random_traversal(3, 3000, 1, Interpolation::Trilinear);
    assert!(WalkPlan::new::<1>(&traversal).nonzeros > 10_000);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| stored::<f32, 1>(&traversal).map(|operator| products(&operator)))
    };
    let alone = run(1);
    assert!(run(2) == alone && run(5) == alone);
}

#[test]
fn two_quantities_are_two_matrices_side_by_side() {
    for basis in BOTH {
        let both = random_traversal(9, 60, 3, basis);
        let [first, second] = [0, 1].map(|index| both.over(vec![both.parts()[index].clone()]));
        for row in 0..60 {
            let mut beside = dense::<3>(&first, row);
            beside.extend(dense::<3>(&second, row));
            assert!(dense::<3>(&both, row) == beside);
        }
    }
}

#[test]
fn the_comparison_notices_one_ray() {
    let traversal = random_traversal(3, ROWS, 1, Interpolation::Nearest);
    let truth = products(&ExplicitMatrix::new::<1>(&traversal, u64::MAX).unwrap());
    let sum = |&row: &usize| dense::<1>(&traversal, row).iter().map(|weight| weight[0]).sum::<f64>();
    let brightest = (0..ROWS).max_by(|a, b| sum(a).total_cmp(&sum(b))).unwrap();
    let mut rows: Vec<usize> = (0..ROWS).collect();
    rows[brightest] = (brightest + 1) % ROWS;
    let wrong = traversal.along(traversal.rays().picked(&rows));
    let wrong = products(&ExplicitMatrix::new::<1>(&wrong, u64::MAX).unwrap());
    assert!((0..2).all(|way| relative(&wrong[way], &truth[way]) > 100.0 * AGAINST_EXPLICIT));
}
