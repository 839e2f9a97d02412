//! The consumers of a traversal on the CPU, on rayon: gather, scatter, squares.
//!
//! Work is cut into pieces whose number depends on the problem alone, so results are bit-identical for
//! any number of threads.

mod bands;
mod rows;
mod transport;

pub(crate) use transport::gather;
pub use transport::{Storage, Transport, WalkPlan};
