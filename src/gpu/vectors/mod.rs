//! Vectors in the memory of a device, and sums over them.

mod fixed_sums;
mod sums;
mod vector;

pub(super) use fixed_sums::FixedSums;
pub use sums::DeviceSum;
pub use vector::{GpuVector, Index};
pub(super) use vector::{Slab, bound, numbers};
