//! The consumers of a traversal on the CPU, on rayon: gather, scatter, squares, and
//! the blocks of a metric.
//!
//! Work is cut into pieces whose number depends on the problem alone, so results are bit-identical for
//! any number of threads.

mod bands;
mod dense;
mod host;
mod lighting;
mod mixed;
mod picked;
mod products;
mod rows;
mod tiles;
mod transport;

pub use dense::Dense;
pub use host::HostOperator;
pub use lighting::{Beam, light_columns, light_volume, near_medium};
pub use mixed::Mixed;
pub use tiles::TileMetric;
pub use transport::{Transport, kept_bytes};
