//! A graphics adapter under the same laws.

use super::case::{Case, Measurements, Setting};
use super::hall::{Hall, problem};
use super::rows::{FAULT, worse};
use super::solved::AGAINST_EXPLICIT;
use crate::Result;
use crate::gpu::Gpu;
use crate::operator::{CpuVector, FromHost, LinearOperator, adjoint_test};
use crate::problem::{LightMapProblem, Problem};
use crate::scene::{Rgb, Strategy};
use crate::sparse::ExplicitMatrix;

pub(super) const CASES: [Case; 2] = [
    Case {
        name: "adapter/products",
        law: "on the adapter T x and T'y are those of the matrix in f64, kept, walked and in fixed point",
        why: "1e-5, and 1e-6 for the adjoint (ARCHITECTURE, Numbers)",
        run: products,
    },
    Case {
        name: "adapter/same-bits",
        law: "ten deterministic runs are the same to the last bit, ten with atomics to rounding",
        why: "0; f32 sums in any order are right to 1e-5",
        run: same_bits,
    },
];

fn gpu(setting: &Setting) -> Option<&Gpu> {
    setting.engine.gpu()
}

/// The problem of a hall far away, for that is where f32 has it hardest.
fn hall() -> Result<LightMapProblem> {
    let place = super::rows::WorldPlace { scale: 1.0, offset: glam::DVec3::new(7e3, -5e2, 6e3) };
    Ok(problem(&Hall { place, ..Hall::PLAIN })?.1)
}

fn wave(len: usize) -> Vec<Rgb> {
    (0..len).map(|index| std::array::from_fn(|c| 1.0 + (index as f32 * 0.37 + c as f32).sin())).collect()
}

/// max |a − b| / max |b|.
fn apart(a: &[Rgb], b: &[[f64; 3]]) -> f64 {
    let largest = b.iter().flatten().fold(0.0, |largest: f64, b| largest.max(b.abs()));
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, worse) / largest
}

fn bent(setting: &Setting, mut numbers: Vec<Rgb>) -> Vec<Rgb> {
    if setting.faulty {
        numbers.iter_mut().for_each(|color| *color = color.map(|value| value * FAULT as f32));
    }
    numbers
}

fn products(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let Some(gpu) = gpu(setting) else { return Ok(()) };
    let problem = hall()?;
    let matrix = ExplicitMatrix::new::<1>(&problem.traversal, u64::MAX)?;
    let (x, y) = (wave(problem.maps.light_map.len()), wave(problem.constraints.len()));
    let wide = |colors: &[Rgb]| CpuVector(colors.iter().map(|color| color.map(f64::from)).collect());
    let (mut shown, mut arriving) = (matrix.range(), matrix.domain());
    matrix.apply(&wide(&x), &mut shown)?;
    matrix.apply_adjoint(&wide(&y), &mut arriving)?;
    for (name, strategy, deterministic) in [
        ("kept", Strategy::Assembled, false),
        ("walked", Strategy::MatrixFree, false),
        ("fixed point", Strategy::MatrixFree, true),
    ] {
        let operator = problem.on_gpu(gpu, strategy, u64::MAX, deterministic)?;
        let found = bent(setting, operator.shown(&x)?);
        measurements.within(format!("{name}, T x"), apart(&found, &shown.0), AGAINST_EXPLICIT);
        let found = bent(setting, operator.arriving(&y)?);
        measurements.within(format!("{name}, T'y"), apart(&found, &arriving.0), AGAINST_EXPLICIT);
        measurements.within(format!("{name}, adjoint"), adjoint_test(&operator, 3, 1)?.error, 1e-6);
    }
    Ok(())
}

fn same_bits(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let Some(gpu) = gpu(setting) else { return Ok(()) };
    let problem = hall()?;
    let y = wave(problem.constraints.len());
    for (name, deterministic, bound) in [("fixed point", true, 0.0), ("atomics", false, AGAINST_EXPLICIT)] {
        let operator = problem.on_gpu(gpu, Strategy::MatrixFree, u64::MAX, deterministic)?;
        let first = operator.arriving(&y)?;
        let largest = f64::from(first.iter().flatten().copied().fold(0.0, f32::max));
        for run in 2..=10 {
            let found = bent(setting, operator.arriving(&y)?);
            let pairs = first.iter().flatten().zip(found.iter().flatten());
            let gap = pairs.map(|(a, b)| f64::from((a - b).abs()) / largest).fold(0.0, worse);
            measurements.within(format!("{name}, run {run}"), gap, bound);
        }
    }
    Ok(())
}
