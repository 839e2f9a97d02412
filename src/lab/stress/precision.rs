//! f32 against f64.

use nalgebra::{DMatrix, DVector};

use super::case::{Case, Measurements, Setting};
use super::rows::{
    AnyRows, BASES, INTERPOLATIONS, RandomNumbers, WorldPlace, random_density, random_light_map, random_rays,
    volume_rows, worse,
};
use super::solved::{Question, certificate};
use crate::Result;
use crate::cpu::Transport;
use crate::march::{Quantity, Real};
use crate::operator::{CpuVector, LinearOperator, Vector, WalkPlan, adjoint_test};
use crate::scene::{Basis, SolverName, Strategy};
use crate::sparse::ExplicitMatrix;

pub(super) const CASES: [Case; 2] = [
    Case {
        name: "precision/products",
        law: "T x, T'y and their adjointness in f32 and f64, kept and walked, are those of the matrix in f64",
        why: "1e-5, and 1e-6 for the adjoint, in f32; 1e-13 in f64 (ARCHITECTURE, Numbers)",
        run: products,
    },
    Case {
        name: "precision/light-map",
        law: "what is found in f32 is what a dense factorization in f64 finds, by every method",
        why: "strong convexity: (certificate + 1e-5) / pull",
        run: found,
    },
];

fn products(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    for basis in BASES {
        let rows = random_light_map(2, 400, basis, 0.5, &WorldPlace::PLAIN)?;
        every_way(setting, measurements, &format!("light map, {basis:?}"), &rows)?;
    }
    for basis in INTERPOLATIONS {
        let rays = random_rays(&mut RandomNumbers(5), 400, &WorldPlace::PLAIN);
        let density = random_density(11, 1.0, &WorldPlace::PLAIN)?;
        let rows = volume_rows(density, Quantity::Emission, basis, &rays)?;
        every_way(setting, measurements, &format!("volume, {basis:?}"), &rows)?;
    }
    Ok(())
}

fn every_way(
    setting: &Setting,
    measurements: &mut Measurements,
    place: &str,
    rows: &dyn AnyRows,
) -> Result<()> {
    let matrix = ExplicitMatrix::new::<1>(&Setting::RIGHT.tested(rows), u64::MAX)?;
    for (name, strategy) in [("kept", Strategy::Assembled), ("walked", Strategy::MatrixFree)] {
        let place = format!("{place}, {name}");
        against::<f32>(
            setting,
            measurements,
            &format!("{place}, f32"),
            rows,
            &matrix,
            strategy,
            [1e-5, 1e-6],
        )?;
        against::<f64>(setting, measurements, &format!("{place}, f64"), rows, &matrix, strategy, [1e-13; 2])?;
    }
    Ok(())
}

fn against<F: Real>(
    setting: &Setting,
    measurements: &mut Measurements,
    place: &str,
    rows: &dyn AnyRows,
    matrix: &ExplicitMatrix,
    strategy: Strategy,
    [bound, adjoint]: [f64; 2],
) -> Result<()>
where
    CpuVector<F>: Vector,
{
    let plan = WalkPlan::new::<1>(&setting.tested(rows));
    let operator = Transport::<_, F, 1>::new(setting.tested(rows), &plan, strategy, u64::MAX)?;
    let mut n = RandomNumbers(41);
    let mut colors = |len: usize| -> Vec<[f64; 3]> {
        (0..len).map(|_| std::array::from_fn(|_| n.uniform(-1.0, 1.0))).collect()
    };
    let (on_x, on_y) = (colors(rows.elements()), colors(rows.rows()));
    let (mut x, mut y) = (operator.domain(), operator.range());
    x.set_from_host(&on_x)?;
    y.set_from_host(&on_y)?;
    // What is rounded on the way in is no error of the product.
    let (x64, y64) = (CpuVector(x.to_host()?), CpuVector(y.to_host()?));
    let (mut shown, mut arriving) = (operator.range(), operator.domain());
    operator.apply(&x, &mut shown)?;
    operator.apply_adjoint(&y, &mut arriving)?;
    let (mut true_shown, mut true_arriving) = (matrix.range(), matrix.domain());
    matrix.apply(&x64, &mut true_shown)?;
    matrix.apply_adjoint(&y64, &mut true_arriving)?;
    measurements.within(format!("{place}, T x"), difference(shown.to_host()?, &true_shown)?, bound);
    measurements.within(format!("{place}, T'y"), difference(arriving.to_host()?, &true_arriving)?, bound);
    measurements.within(format!("{place}, adjoint"), adjoint_test(&operator, 2, 1)?.error, adjoint);
    Ok(())
}

/// ‖a − b‖ / ‖b‖.
fn difference(a: Vec<[f64; 3]>, b: &CpuVector<f64>) -> Result<f64> {
    let mut difference = CpuVector(a);
    difference.axpby([-1.0; 3], b, [1.0; 3]);
    let norm = |vector: &CpuVector<f64>| vector.norm_squared().map(|squares| squares.iter().sum::<f64>());
    Ok((norm(&difference)? / norm(b)?).sqrt())
}

fn found(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let rows = random_light_map(4, 500, Basis::Bilinear, 0.5, &WorldPlace::PLAIN)?;
    for name in SolverName::ALL.into_iter().filter(|name| *name != SolverName::ClampedCgls) {
        let question = Question::answered_by(&rows, 1e-6)?.by(name).pulled(0.5);
        let answer = question.solved(setting, &rows)?;
        let lambda = answer.solved.weights.tikhonov;
        let matrix = question.matrix.channel(0);
        let mut dense = DMatrix::zeros(matrix.rows(), matrix.cols());
        for (&weight, (row, column)) in matrix {
            dense[(row, column)] = weight;
        }
        let mut normal = dense.tr_mul(&dense);
        (0..normal.nrows()).for_each(|index| normal[(index, index)] += lambda);
        let Some(factors) = normal.cholesky() else {
            measurements.must("the normal matrix has a factorization", false);
            continue;
        };
        let mut error = 0.0;
        for c in 0..3 {
            let b = DVector::from_iterator(dense.nrows(), question.targets.iter().map(|b| f64::from(b[c])));
            let right = dense.tr_mul(&b).add_scalar(lambda * f64::from(question.start[c]));
            let truth = factors.solve(&right);
            // An element that no row reaches keeps its start, which is what its pull alone says, too.
            let pairs = answer.solved.x.iter().zip(truth.iter());
            error = worse(error, pairs.map(|(x, t)| (f64::from(x[c]) - t).powi(2)).sum::<f64>().sqrt());
        }
        let place = format!("{}, {}", name.name(), answer.ending());
        measurements.within(place, error, answer.reach());
        certificate(measurements, name.name(), &answer, 1e-6);
    }
    Ok(())
}
