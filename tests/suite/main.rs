//! The tests of the library and the command, in one binary; those of the traversals alone are in `tests/march/`.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on should stop"
)]
#![allow(missing_docs, unreachable_pub, reason = "nothing here is public")]

mod bounds;
#[cfg(unix)]
mod card;
mod circles;
#[cfg(feature = "cli")]
mod command;
mod corpus;
mod demo_scenes;
mod epipolar;
mod glass;
#[cfg(feature = "gpu")]
mod gpu;
mod heterogeneity;
mod job;
mod layers;
mod licences;
mod looks;
mod mutation;
mod operator;
mod problems;
mod render;
#[path = "../scenes/mod.rs"]
mod scenes;
mod solve;
mod split_rows;
#[cfg(feature = "studio")]
mod studio;
#[cfg(feature = "studio")]
mod studio_looks;
mod suns;
mod surfaces;
mod surroundings;
mod threads;
mod together;
#[path = "../tolerances.rs"]
mod tolerances;
mod transfer;
mod vdb_peer;
mod volume;
#[path = "../volumes/mod.rs"]
mod volumes;

use std::path::PathBuf;

/// The folder of the package: what the environment says, so that this binary runs wherever it and the files lie, else where it was built.
pub fn root() -> PathBuf {
    in_environment("CARGO_MANIFEST_DIR", env!("CARGO_MANIFEST_DIR"))
}

/// The command, found in the same way.
#[cfg(feature = "cli")]
pub fn program() -> PathBuf {
    in_environment("UNSCATTER_PROGRAM", env!("CARGO_BIN_EXE_unscatter"))
}

fn in_environment(variable: &str, built: &str) -> PathBuf {
    std::env::var_os(variable).map_or_else(|| PathBuf::from(built), PathBuf::from)
}
