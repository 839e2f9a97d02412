//! Inverse rendering of light in media.

mod error;
pub mod io;
pub mod problem;
pub mod report;
pub mod scene;

pub use error::{Error, Fault, Result};
