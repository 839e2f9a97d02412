//! The tests of the library and the command, in one binary.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on should stop"
)]
#![allow(missing_docs, unreachable_pub, reason = "nothing here is public")]

#[cfg(feature = "cli")]
mod command;
mod demo_scenes;
#[cfg(feature = "gpu")]
mod gpu;
mod layers;
mod mutation;
mod operator;
mod render;
#[path = "../scenes/mod.rs"]
mod scenes;
mod solve;
mod surroundings;
mod tolerances;
mod traversal;
mod vdb_peer;
mod volume;
