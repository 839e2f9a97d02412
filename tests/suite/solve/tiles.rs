//! The metric of tiles against its definition.

use nalgebra::{DMatrix, DVector};
use unscatter::cpu::TileMetric;
use unscatter::march::Weight;
use unscatter::operator::{Bounds, CpuVector, LinearOperator, MatrixRows, Metric, Tiling, Vector};
use unscatter::solve::{Cgls, Fista, LeastSquares, Limits, Mprgp, StopReason};

use super::{Dense, objective, rhs, run};
use crate::scenes::Numbers;

/// A sparse matrix without negative weights over a lattice of 19 × 13.
struct Sparse(DMatrix<f64>);

const SIZE: [usize; 2] = [19, 13];
const ROWS: usize = 90;

impl MatrixRows<f64, 1> for Sparse {
    fn rows(&self) -> usize {
        ROWS
    }

    fn visit(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f64, 1>)) {
        let entries = self.0.row(row);
        entries
            .iter()
            .enumerate()
            .filter(|(_, value)| **value > 0.0)
            .for_each(|(k, value)| visit(k, [*value]));
    }
}

/// The whole matrix; the unknown columns, which are those that it reaches; and the matrix of them alone.
fn problem() -> (Sparse, Vec<u32>, Dense, Vec<f64>, Vec<f64>) {
    let mut n = Numbers(17);
    let elements = SIZE[0] * SIZE[1];
    let mut full = DMatrix::from_fn(ROWS, elements, |_, column| {
        let drawn = n.uniform(0.0, 1.0);
        if column % 7 != 3 && drawn < 0.2 { n.uniform(0.1, 1.0) } else { 0.0 }
    });
    full.row_mut(4).fill(0.0);
    let columns: Vec<u32> = (0..elements as u32).filter(|&k| full.column(k as usize).sum() > 0.0).collect();
    let weights: Vec<f64> = (0..ROWS).map(|_| n.uniform(0.2, 2.0)).collect();
    let added = (0..columns.len()).map(|k| 0.02 * (k % 3) as f64).collect();
    let unknown = DMatrix::from_fn(ROWS, columns.len(), |row, k| {
        weights[row].sqrt() * full[(row, columns[k] as usize)]
    });
    (Sparse(full), columns, Dense::new(unknown), weights, added)
}

/// M, column by column.
fn explicit(metric: &TileMetric<f64, 1>, unknowns: usize, channel: usize) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(unknowns, unknowns);
    for k in 0..unknowns {
        let mut unit = CpuVector::<f64>::zeros(unknowns);
        unit.0[k] = [1.0; 3];
        metric.stretch(&mut unit);
        unit.0.iter().enumerate().for_each(|(row, value)| matrix[(row, k)] = value[channel]);
    }
    matrix
}

#[test]
fn blocks_are_their_definition_and_majorize_the_normal_matrix() {
    let (sparse, columns, dense, weights, added) = problem();
    let tiling = Tiling::new(SIZE, &columns);
    let metric = TileMetric::new(&sparse, &tiling, &weights, &added).unwrap();
    assert!(metric.majorizes() && metric.bytes() > 0);
    let tile_of = |k: usize| {
        let column = columns[k] as usize;
        (column % SIZE[0] / 8, column / SIZE[0] / 8)
    };
    for channel in 0..3 {
        let mut expected = DMatrix::zeros(columns.len(), columns.len());
        for row in 0..ROWS {
            let a = dense.matrix.row(row);
            for i in 0..columns.len() {
                let same: Vec<usize> = (0..columns.len()).filter(|&j| tile_of(i) == tile_of(j)).collect();
                let inside: f64 = same.iter().map(|&j| a[j]).sum();
                for j in same.into_iter().filter(|_| inside > 0.0) {
                    expected[(i, j)] += a.sum() / inside * a[i] * a[j];
                }
            }
        }
        (0..columns.len()).for_each(|k| expected[(k, k)] += added[k]);
        let got = explicit(&metric, columns.len(), channel);
        let difference = (&got - &expected).norm() / expected.norm();
        assert!(difference <= 1e-12, "{difference:e} {} {}", got[(0, 0)], expected[(0, 0)]);
        let normal = dense.matrix.transpose() * &dense.matrix;
        let least = (&got - &normal).symmetric_eigenvalues().min();
        assert!(least >= -1e-12 * expected.norm(), "{least:e}");
        // Half of it would not.
        assert!((got * 0.5 - normal).symmetric_eigenvalues().min() < 0.0);
    }
}

#[test]
fn shrinking_is_symmetric_and_falls_short_of_the_inverse() {
    let (sparse, columns, _, weights, added) = problem();
    let metric = TileMetric::new(&sparse, &Tiling::new(SIZE, &columns), &weights, &added).unwrap();
    let count = columns.len();
    let mut inverse = DMatrix::zeros(count, count);
    for k in 0..count {
        let mut unit = CpuVector::<f64>::zeros(count);
        unit.0[k] = [1.0; 3];
        metric.shrink(&mut unit);
        unit.0.iter().enumerate().for_each(|(row, value)| inverse[(row, k)] = value[0]);
    }
    assert!((&inverse - inverse.transpose()).norm() <= 1e-12 * inverse.norm());
    let difference = explicit(&metric, count, 0).try_inverse().unwrap() - &inverse;
    assert!(difference.symmetric_eigenvalues().min() >= -1e-10 * inverse.norm());
    assert!(inverse.symmetric_eigenvalues().min() > 0.0);
}

#[test]
fn a_step_stays_inside_and_leads_down() {
    let (sparse, columns, dense, weights, added) = problem();
    let metric = TileMetric::new(&sparse, &Tiling::new(SIZE, &columns), &weights, &added).unwrap();
    let bounds = Bounds::new([0.0, -1.0, 0.2], [0.6, f64::INFINITY, 0.2]).unwrap();
    let mut n = Numbers(3);
    let mut y = dense.domain();
    y.0.iter_mut().for_each(|y| *y = [n.uniform(0.0, 0.6), n.uniform(-1.0, 2.0), 0.2]);
    let mut g = dense.domain();
    g.0.iter_mut().for_each(|g| *g = std::array::from_fn(|_| n.uniform(-3.0, 3.0)));
    let norm = [1.0, 2.0, 0.5];
    let mut x = g.clone();
    metric.descend(&mut x, &y, norm, &bounds);
    for channel in 0..3 {
        let column = |v: &CpuVector<f64>| DVector::from_iterator(v.len(), v.0.iter().map(|v| v[channel]));
        let d = column(&x) - column(&y);
        let matrix = explicit(&metric, columns.len(), channel);
        let change = column(&g).dot(&d) + 0.5 * norm[channel] * d.dot(&(matrix * &d));
        assert!(change <= 0.0 && (channel == 2 || change < 0.0), "{channel}: {change}");
        let (low, high) = (bounds.of(0)[0][channel], bounds.of(0)[1][channel]);
        assert!(x.0.iter().all(|x| low <= x[channel] && x[channel] <= high));
    }
}

/// The step of [`Metric::descend`] number by number, the bounds looked up for each.
fn plain_step(
    matrix: &DMatrix<f64>,
    [g, y]: [&CpuVector<f64>; 2],
    (norm, channel): (f64, usize),
    bounds: &Bounds,
) -> Vec<f64> {
    let bound = |k: usize| bounds.of(k).map(|bound| bound[channel]);
    let at = |k: usize| y.0[k][channel];
    let limit = |k: usize, d: f64| d.max(bound(k)[0] - at(k)).min(bound(k)[1] - at(k));
    let slope = |k: usize| g.0[k][channel] / norm;
    let mut d = DVector::from_fn(y.len(), |k, _| limit(k, -slope(k) / matrix.row(k).sum()));
    for k in (0..y.len()).chain((0..y.len()).rev()) {
        let step = (slope(k) + (matrix.row(k) * &d)[0]) / matrix[(k, k)];
        d[k] = limit(k, d[k] - step);
    }
    (0..y.len()).map(|k| (at(k) + d[k]).max(bound(k)[0]).min(bound(k)[1])).collect()
}

#[test]
fn every_member_of_a_tile_is_held_to_the_bounds_of_its_part() {
    let (sparse, columns, dense, weights, added) = problem();
    let metric = TileMetric::new(&sparse, &Tiling::new(SIZE, &columns), &weights, &added).unwrap();
    let mut n = Numbers(29);
    let mut uniform = |low: f64, high: f64| {
        let mut v = dense.domain();
        v.0.iter_mut().for_each(|v| *v = std::array::from_fn(|_| n.uniform(low, high)));
        v
    };
    let (g, norm) = (uniform(-3.0, 3.0), [1.0, 2.0, 0.5]);
    let of = |lower: f64, upper: f64| Bounds::new([lower; 3], [upper; 3]).unwrap();
    // Tiles are 8 × 8 of 19 × 13, so every boundary goes through several.
    let two = of(0.0, 0.6).then(31, of(-0.4, 0.1));
    let three = two.clone().then(33, of(0.2, f64::INFINITY));
    let four = three.clone().then(101, of(f64::NEG_INFINITY, 0.3));
    for bounds in [of(0.0, 0.6), two, three, four.clone()] {
        let mut y = uniform(-1.0, 1.0);
        y.clamp(&bounds);
        let mut x = g.clone();
        metric.descend(&mut x, &y, norm, &bounds);
        let apart = |bounds: &Bounds| -> f64 {
            let of_channel = |c: usize| {
                let matrix = explicit(&metric, columns.len(), c);
                let plain = plain_step(&matrix, [&g, &y], (norm[c], c), bounds);
                x.0.iter().zip(plain).map(|(x, plain)| (x[c] - plain).abs()).fold(0.0, f64::max)
            };
            (0..3).map(of_channel).fold(0.0, f64::max)
        };
        assert!(apart(&bounds) <= 1e-12, "{:e}", apart(&bounds));
        if bounds == four {
            assert!(apart(&four.clone().then(102, of(0.0, 1.0))) > 1e-6);
        }
    }
}

#[test]
fn methods_that_use_it_find_the_same_solution_in_fewer_iterations() {
    let (sparse, columns, dense, weights, _) = problem();
    let added = vec![0.0; columns.len()];
    let metric = TileMetric::new(&sparse, &Tiling::new(SIZE, &columns), &weights, &added).unwrap();
    let mut b = rhs(ROWS, 8);
    b.0.iter_mut().for_each(|b| *b = b.map(|b| 3.0 * b + 2.0));
    let scaling = dense.scaling();
    let mut start = dense.domain();
    start.fill([0.3; 3]);
    let limits = Limits::new(40_000, 1e-8);
    let bounded = || LeastSquares::new(&dense, &b).bounded(Bounds::NOT_NEGATIVE);
    use unscatter::solve::Method;
    let (mut with, mut without, mut other) = (Fista::new(&dense), Fista::new(&dense), Mprgp::new(&dense));
    let with_outcome = run(&mut with, &bounded().measured(&metric), &start, &limits);
    let without_outcome = run(&mut without, &bounded().measured(&scaling), &start, &limits);
    run(&mut other, &bounded().measured(&scaling), &start, &limits);
    assert_eq!(with_outcome.stop.reason, StopReason::Tolerance);
    assert!(with_outcome.stop.iteration < without_outcome.stop.iteration);
    let found = |x: &CpuVector<f64>| objective(&bounded(), x);
    let (a, b_, c) = (found(with.solution()), found(without.solution()), found(other.solution()));
    assert!((0..3).all(|k| (a[k] - b_[k]).abs() < 1e-8 * a[k] && (a[k] - c[k]).abs() < 1e-8 * a[k]));
    // CGLS, without bounds.
    let plain = LeastSquares::new(&dense, &b);
    let (mut with, mut without) = (Cgls::new(&dense), Cgls::new(&dense));
    let with_outcome = run(&mut with, &LeastSquares::new(&dense, &b).measured(&metric), &start, &limits);
    let without_outcome = run(&mut without, &plain, &start, &limits);
    assert!(with_outcome.stop.iteration < without_outcome.stop.iteration);
    let (a, c) = (objective(&plain, with.solution()), objective(&plain, without.solution()));
    assert!((0..3).all(|k| (a[k] - c[k]).abs() <= 1e-8 * c[k].max(1e-6)), "{a:?} {c:?}");
}

#[test]
fn sizes_that_do_not_belong_together_are_errors() {
    let (sparse, columns, _, weights, added) = problem();
    let tiling = Tiling::new(SIZE, &columns);
    assert!(TileMetric::new(&sparse, &tiling, &weights[1..], &added).is_err());
    assert!(TileMetric::new(&sparse, &tiling, &weights, &added[1..]).is_err());
}
