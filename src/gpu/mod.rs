//! The operators and vectors on a graphics adapter, through wgpu; nothing else imports it.
//!
//! A [`Gpu`] records dispatches and hands them over when a number is asked for: that is a round trip, and they are
//! counted. What goes wrong on the device is kept and reported by the next call that returns a [`Result`](crate::Result).
//!
//! Its layers, lowest first: `kernels` (texts and what they bind), `device` (an adapter at work), `vectors`, `operators`. Above them
//! stand `surfaces`, which draws, and `known_answers`, which tries everything.

mod device;
mod kernels;
mod known_answers;
mod operators;
mod surfaces;
mod vectors;

pub use device::{
    AdapterRecord, Choice, Gpu, SimulatedFault, Tactics, adapters, is_caught, may_have_hardware,
};
pub use kernels::{Accumulation, KernelText, kernel_texts};
pub use known_answers::known_answers;
pub use operators::{
    DepthPyramid, DeviceOperator, GpuOperator, Kept, LightPicture, Marched, MarchedPicture,
    PrefilteredPicture, SweptPicture, TileMetric, Walked, swept,
};
pub use surfaces::surfaces_seen;
pub use vectors::{DeviceSum, GpuVector, Index};
