//! Whether the loops of one ray end by themselves.

use crate::gpu::device::Gpu;
use crate::{Error, Result};

/// Rounds of loops that a ray may take: Mesa's software adapter counts those of all loops of an invocation, and leaves them in
/// silence after 65535.
const ROUNDS: usize = 60_000;

/// Refuses rays that need more rounds than a software adapter makes.
///
/// Errors: [`Error::TooLarge`].
pub(super) fn check(gpu: &Gpu, needed: impl FnOnce() -> usize, remedy: &'static str) -> Result<()> {
    if gpu.record().is_hardware() {
        return Ok(());
    }
    let needed = needed();
    if needed <= ROUNDS {
        return Ok(());
    }
    Err(Error::TooLarge {
        what: "a ray on a software adapter".to_owned(),
        needed: format!("{needed} rounds of its loops"),
        limit: ROUNDS.to_string(),
        remedy,
    })
}
