//! How many rows one submission walks: few enough for drivers that stop what takes long, enough to keep the device busy.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use crate::gpu::device::Gpu;
use crate::gpu::kernels::{Kernel, RAYS};

/// What a submission should take. Drivers of desktop systems stop one that takes two seconds.
const AIM: Duration = Duration::from_millis(50);
/// Rows that are walked first, before anything is known.
const FIRST: usize = 256 * RAYS as usize;
/// Rows that are walked together at least: somebody else's work on the device must not leave thousands of submissions behind.
const LEAST: usize = 32 * RAYS as usize;
/// Pieces that are timed at most.
const TRIALS: usize = 12;

/// The pace of one kernel over the rows of one operator, found while it is used for the first time.
#[derive(Debug)]
struct Pace {
    rows: AtomicUsize,
    trials_left: AtomicUsize,
}

impl Default for Pace {
    fn default() -> Self {
        Self { rows: AtomicUsize::new(FIRST), trials_left: AtomicUsize::new(TRIALS) }
    }
}

/// The paces of the consumers.
#[derive(Debug, Default)]
pub(super) struct Paces([Pace; 3]);

impl Paces {
    /// Lets `record` record all rows for a consumer, so many a submission as its pace allows.
    pub(super) fn walk(
        &self,
        consumer: Kernel,
        gpu: &Gpu,
        rows: usize,
        record: &mut dyn FnMut(Range<usize>),
    ) {
        let pace = match consumer {
            Kernel::Gather => &self.0[0],
            Kernel::Scatter => &self.0[1],
            _ => &self.0[2],
        };
        pace.walk(gpu, rows, record);
    }
}

impl Pace {
    fn rows(&self) -> usize {
        self.rows.load(Ordering::Relaxed)
    }

    fn trials_left(&self) -> usize {
        self.trials_left.load(Ordering::Relaxed)
    }

    /// Lets `record` record all rows, a piece a submission; the last piece is left to be handed over with what follows.
    fn walk(&self, gpu: &Gpu, rows: usize, record: &mut dyn FnMut(Range<usize>)) {
        let mut first = 0;
        while first < rows {
            let count = self.rows().min(rows - first);
            let is_timed = self.trials_left() > 0;
            if is_timed {
                // What was recorded before is not timed. A failure is kept, and told by whoever asks next.
                let _kept = gpu.finish();
            }
            record(first..first + count);
            first += count;
            if is_timed {
                let begun = Instant::now();
                let _kept = gpu.finish();
                self.learn(count, count == rows, begun.elapsed());
            } else if first < rows {
                gpu.hand_over();
            }
        }
    }

    /// Takes note of how long some rows took.
    fn learn(&self, count: usize, is_all: bool, took: Duration) {
        let of_aim = took.as_secs_f64() / AIM.as_secs_f64();
        if of_aim < 2.0 && (is_all || of_aim > 0.5) {
            self.trials_left.store(0, Ordering::Relaxed);
            return;
        }
        // Another thread may have taken the last one.
        self.trials_left.store(self.trials_left().saturating_sub(1), Ordering::Relaxed);
        // The first time includes what the driver does once, so it may only halve the number.
        let next = (count as f64 / of_aim.clamp(0.125, 2.0)) as usize;
        // The last piece of many may be small, and says little then.
        if is_all || next < self.rows() || count == self.rows() {
            self.rows.store((next / RAYS as usize * RAYS as usize).max(LEAST), Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows a submission, when a row takes so long and the first submission so much longer.
    fn found(seconds_a_row: f64, once: f64, rows: usize) -> (usize, usize) {
        let (pace, mut once, mut timed) = (Pace::default(), once, 0);
        for _ in 0..100 {
            let mut first = 0;
            while first < rows && pace.trials_left() > 0 {
                let count = pace.rows().min(rows - first);
                let took = count as f64 * seconds_a_row + std::mem::take(&mut once);
                pace.learn(count, count == rows, Duration::from_secs_f64(took));
                first += count;
                timed += 1;
            }
        }
        (pace.rows().min(rows), timed)
    }

    #[test]
    fn a_submission_takes_about_what_it_should_whatever_the_device() {
        for seconds_a_row in [1e-9, 1e-7, 1e-6, 1e-5, 1e-4] {
            for once in [0.0, 0.5] {
                for rows in [100, 40_000, 12_000_000] {
                    let (at_once, timed) = found(seconds_a_row, once, rows);
                    let took = at_once as f64 * seconds_a_row;
                    let is_small = at_once == rows || at_once == LEAST;
                    assert!(took < 0.1 || at_once <= LEAST, "{seconds_a_row} {once} {rows}: {took} s");
                    assert!(took > 0.025 || is_small, "{seconds_a_row} {once} {rows}: {took} s");
                    assert!(timed <= TRIALS && at_once >= rows.min(LEAST));
                }
            }
        }
    }
}
