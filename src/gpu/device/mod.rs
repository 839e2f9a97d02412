//! An adapter at work: opening it, its memory, recording and handing over, waiting. Nothing here knows what a kernel computes.
//!
//! [`Gpu`] is one type, and each file adds what it can do of one kind.

mod adapter;
mod compile;
mod failure;
mod gpu;
mod memory;
mod patience;
mod recorder;
mod results;
mod submission;

pub use adapter::{AdapterRecord, Choice, SimulatedFault, Tactics, adapters, may_have_hardware};
pub use gpu::Gpu;
pub(super) use memory::Allocation;
pub use patience::is_caught;
pub(super) use recorder::Binding;
pub(super) use results::{CAPACITY, Fold, Pieces, Waiting};
