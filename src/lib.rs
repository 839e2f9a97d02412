//! Inverse rendering of light in media.

#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
pub mod cpu;
mod error;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod io;
pub mod job;
pub mod lab;
pub mod march;
pub mod operator;
pub mod problem;
pub mod report;
pub mod scene;
mod simd;
pub mod solve;
pub mod sparse;
#[cfg(feature = "studio")]
pub mod studio;
pub mod visibility;
mod warning;

pub use error::{Error, Fault, Result};
pub use warning::Warning;

/// The examples of README.md and of the guide, compiled.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
#[doc = include_str!("../docs/guide.md")]
struct Documentation;
