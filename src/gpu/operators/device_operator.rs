//! What operators on a device promise beside applying themselves.

use std::fmt::Debug;

use crate::Result;
use crate::gpu::vectors::GpuVector;
use crate::operator::{LinearOperator, Storage};

/// `T` on a device, in one of the ways there are.
pub trait DeviceOperator:
    LinearOperator<Domain = GpuVector, Range = GpuVector> + Debug + Send + Sync
{
    /// x ← diag(Tᵀ diag(y) T). False where only the host can; x is then what it was.
    ///
    /// Errors: [`Error::Shape`](crate::Error::Shape) when a vector does not fit, and what has gone wrong on the device.
    fn squares(&self, y: &GpuVector, x: &mut GpuVector) -> Result<bool>;

    /// Whether its products are the same bits in every run.
    fn is_deterministic(&self) -> bool;

    /// How much of it is kept.
    fn storage(&self) -> Storage;
}
