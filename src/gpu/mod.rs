//! The operators and vectors on a graphics adapter, through wgpu; nothing else imports it.
//!
//! A [`Gpu`] records dispatches and hands them over when a number is asked for: that is a round trip, and they are
//! counted. What goes wrong on the device is kept and reported by the next call that returns a [`Result`](crate::Result).
//! Every kernel of `kernels/` is assembled in `kernel.rs`, and has a twin on the CPU.

mod adapter;
mod compile;
mod device;
mod fixed_point;
mod kernel;
mod known_answers;
mod layout;
mod light_map;
mod memory;
mod operator;
mod pace;
mod pass;
mod patience;
mod ray;
mod recorder;
mod rows;
mod sums;
mod surfaces;
mod tiles;
mod vector;
mod volume;
mod walk;
mod walked;

pub use adapter::{AdapterRecord, Choice, Fault, adapters, may_have_hardware};
pub use device::Gpu;
pub use fixed_point::Accumulation;
pub use kernel::{KernelText, kernel_texts};
pub use known_answers::known_answers;
pub use operator::{DeviceOperator, GpuOperator};
pub use patience::is_caught;
pub use rows::Kept;
pub use sums::DeviceSum;
pub use surfaces::surfaces_seen;
pub use tiles::TileMetric;
pub use vector::{GpuVector, Index};
pub use walked::Walked;
