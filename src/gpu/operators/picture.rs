//! Pictures of light that a device draws.

use std::fmt::Debug;

use crate::Result;
use crate::gpu::vectors::GpuVector;

/// What the rays of a picture show of a light map, whatever the light.
pub trait LightPicture: Debug + Send + Sync {
    /// Of texels, and behind them one element more: the light beside the light map.
    ///
    /// Errors: [`Error::Shape`](crate::Error::Shape) for another number of texels, and what has gone wrong on the device.
    fn shown(&self, x: &GpuVector) -> Result<GpuVector>;
}
