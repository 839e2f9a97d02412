//! What runs on an adapter, as text: which kernels there are, in which variants, and what they bind. Nothing here knows a device.
//!
//! To add a kernel, write its operation into `kernels/NAME.wgsl` and a row into the table of `table.rs`. A struct of parameters that
//! is new goes into `layout.rs`. [`Gpu::dispatch`](super::Gpu) records it.

/// A text of `kernels/prelude/`.
macro_rules! prelude {
    ($name:literal) => {
        include_str!(concat!("../../../kernels/prelude/", $name, ".wgsl"))
    };
}

mod access;
pub(super) mod layout;
mod program;
mod table;
mod variant;
mod walk;

pub(super) use access::Access;
pub use program::{KernelText, kernel_texts};
pub(super) use program::{Program, SURFACES};
pub(super) use table::Kernel;
pub use variant::Accumulation;
pub(super) use variant::{TileOperation, Variant};
pub(super) use walk::{LightMapWalk, VolumeWalk, Walk};

/// Lanes of a workgroup that works on vectors and kept rows.
pub(super) const LANES: u32 = 256;
/// Elements that one workgroup of a reduction takes: sixteen a lane.
pub(super) const PIECE: u32 = 16 * LANES;
/// Lanes that share a kept row at most.
pub(super) const SHARERS: u32 = 32;
/// Rays of a workgroup.
pub(super) const RAYS: u32 = 64;
/// Storage buffers that one kernel binds at most; a test counts them.
pub(super) const STORAGE_BUFFERS: u32 = 8;

#[cfg(test)]
mod tests;
