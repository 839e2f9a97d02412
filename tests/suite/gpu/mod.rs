//! The GPU backend against its twins on the CPU and the explicit matrix in f64.
//!
//! Where there is no adapter these tests are ignored, and seen to be; `./test.sh` installs a software adapter and runs them.

mod live;
mod pictures;
mod slices;
mod solving;
mod surfaces;
mod transport;
mod twins;
mod vectors;
mod volume;

use unscatter::gpu::{Choice, Gpu, Tactics};
use unscatter::operator::{CpuVector, Indexed, LinearOperator, Vector};

use crate::scenes::Numbers;

/// Any adapter, with its usual abilities.
pub fn gpu() -> Gpu {
    open(Choice::default())
}

/// Any adapter, that lets kernels see so many bytes of a buffer.
pub fn narrow(binding_limit: u64) -> Gpu {
    open(Choice { binding_limit: Some(binding_limit), ..Choice::default() })
}

/// Any adapter, used as hardware is.
pub fn as_on_hardware() -> Gpu {
    open(Choice { tactics: Some(Tactics::HARDWARE), ..Choice::default() })
}

/// The adapter that UNSCATTER_ADAPTER names a part of, else any.
pub fn open(choice: Choice) -> Gpu {
    let name = std::env::var("UNSCATTER_ADAPTER").ok();
    Gpu::open(&Choice { name, software: true, ..choice }).unwrap()
}

/// The same values in [-1, 1) wherever the vector lives; others where UNSCATTER_SEED is set to another number.
pub fn random<V: Vector>(mut vector: V, seed: u64) -> V {
    let others: u64 = std::env::var("UNSCATTER_SEED").map_or(0, |seed| seed.parse().unwrap());
    let mut n = Numbers((seed ^ others.wrapping_mul(0x9e37_79b9_7f4a_7c15)) | 1);
    // What f32 can hold, so that all precisions start from the same.
    let values: Vec<[f64; 3]> =
        (0..vector.len()).map(|_| std::array::from_fn(|_| f64::from(n.uniform(-1.0, 1.0) as f32))).collect();
    vector.set_from_host(&values).unwrap();
    vector
}

pub fn relative_difference(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let difference = norm(&mut a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a - b));
    difference / norm(&mut b.iter().flatten().copied()).max(1e-300)
}

/// Both products of an operator with random vectors, on the host.
pub fn products<T: LinearOperator>(operator: &T, seed: u64) -> [Vec<[f64; 3]>; 2] {
    let (x, mut y) = (random(operator.domain(), seed), operator.range());
    operator.apply(&x, &mut y).unwrap();
    let forward = y.to_host().unwrap();
    let (mut x, y) = (x, random(y, seed + 1));
    operator.apply_adjoint(&y, &mut x).unwrap();
    [forward, x.to_host().unwrap()]
}

/// Zeros in f32 on the host.
pub fn host(len: usize) -> CpuVector {
    CpuVector::zeros(len)
}

/// Zeros on a device.
pub fn device(gpu: &Gpu, len: usize) -> unscatter::gpu::GpuVector {
    unscatter::gpu::GpuVector::zeros(gpu, 0).zeros(len)
}
