//! The laws of the traversals, in a binary of their own: a changed line in `march/` is tested without the rest of the crate's tests.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on should stop"
)]
#![allow(missing_docs, unreachable_pub, reason = "nothing here is public")]

mod glass;
mod light_map;
mod refraction;
#[path = "../scenes/mod.rs"]
mod scenes;
#[path = "../tolerances.rs"]
mod tolerances;
mod volume;
#[path = "../volumes/mod.rs"]
mod volumes;
