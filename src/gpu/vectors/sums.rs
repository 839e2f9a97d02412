//! Sums that the device has been asked for: they come back together, with one round trip.

use std::sync::{Arc, MutexGuard, OnceLock};

use crate::gpu::device::{CAPACITY, Gpu, Waiting};
use crate::operator::{PendingSum, Scalars, lock};
use crate::{Error, Result};

/// A number a channel that may still be on the device.
#[derive(Debug, Clone)]
pub struct DeviceSum {
    pub(super) gpu: Gpu,
    pub(super) answer: Arc<OnceLock<Scalars>>,
}

impl PendingSum for DeviceSum {
    fn value(self) -> Result<Scalars> {
        let mut waiting = lock(&self.gpu.0.waiting);
        if self.answer.get().is_none() {
            self.gpu.fetch(&mut waiting)?;
        }
        self.answer.get().copied().ok_or_else(|| {
            self.gpu.check().err().unwrap_or_else(|| Error::Machine("a sum is lost".to_owned()))
        })
    }
}

impl Gpu {
    /// What is under way, with room for so many pieces more.
    ///
    /// Errors: [`Error::TooLarge`] for vectors of 1.4 billion elements and more.
    pub(super) fn room_for_pieces(&self, numbers: u32) -> Result<MutexGuard<'_, Waiting>> {
        if numbers > CAPACITY {
            return Err(Error::TooLarge {
                what: "a sum on an adapter".to_owned(),
                needed: format!("{numbers} pieces"),
                limit: CAPACITY.to_string(),
                remedy: "lower the sizes, or compute on the processor",
            });
        }
        let mut waiting = lock(&self.0.waiting);
        if !waiting.has_room(numbers) {
            self.fetch(&mut waiting)?;
        }
        Ok(waiting)
    }

    /// Everything that is under way.
    fn fetch(&self, waiting: &mut Waiting) -> Result<()> {
        self.check()?;
        let (results, staging, bytes) = waiting.under_way();
        // Sums over nothing have no pieces.
        let numbers = if bytes == 0 { Vec::new() } else { self.copy_and_read(results, staging, bytes)? };
        waiting.answer(&numbers);
        Ok(())
    }
}
