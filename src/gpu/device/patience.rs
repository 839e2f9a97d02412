//! Waiting for a device that may be slow, lost or stuck.
//!
//! A device is slow as long as it ends a submission now and then; it hangs when it ends none for [`PATIENCE`], or for [`GRACE`] once
//! somebody wants to stop. One that hangs, or that the driver has lost, is left alone from then on: to free its memory would mean to wait
//! for it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::adapter::SimulatedFault;
use super::failure::note;
use super::gpu::Gpu;
use crate::operator::lock;
use crate::{Error, Result};

/// How long a device may take to end one submission. Rows that are walked are handed over in pieces of a twentieth of a second.
const PATIENCE: Duration = Duration::from_secs(60);
/// The same, once it was asked whether to go on and the answer was no.
pub(in crate::gpu) const GRACE: Duration = Duration::from_secs(5);
/// The same of a device that only pretends to hang.
const SIMULATED: Duration = Duration::from_millis(500);
/// How often to ask whether to go on.
const GLANCE: Duration = Duration::from_millis(50);
/// How long to ask again and again before sleeping, where that is the device's way.
const SPIN: Duration = Duration::from_micros(300);
/// How wgpu begins to panic where a driver loses the device while it is waited for.
const LOST: &str = "Error in Device::poll";

/// Whether a panic is one that waiting for a device catches, because wgpu has no error for a device that is lost meanwhile. A
/// program that has a panic hook can keep quiet about it.
pub fn is_caught(panic: &std::panic::PanicHookInfo) -> bool {
    let message = panic.payload().downcast_ref::<String>();
    message.is_some_and(|message| message.starts_with(LOST))
}

/// What a glance at a device shows.
enum Glance {
    Done,
    Busy,
    Lost,
}

impl Gpu {
    /// Ends a wait early, with an error, when the device is stuck and this says so.
    pub fn give_up_when(&self, wanted: impl Fn() -> bool + Send + Sync + 'static) {
        *lock(&self.0.gives_up) = Some(Arc::new(wanted));
    }

    /// Waits until all that was handed over is done: a round trip.
    ///
    /// Errors: [`Error::Adapter`] for a device that is lost or hangs; what has gone wrong before.
    pub(in crate::gpu) fn wait(&self) -> Result<()> {
        self.check()?;
        let round_trips = self.0.round_trips.fetch_add(1, Ordering::Relaxed) + 1;
        if self.0.fault == Some(SimulatedFault::Loss(round_trips)) {
            self.destroy();
        }
        let ended = || self.0.ended.load(Ordering::Relaxed);
        let (mut last, mut since) = (ended(), Instant::now());
        loop {
            match self.glance()? {
                Glance::Done => return self.check(),
                Glance::Lost => return Err(self.leave_alone("was lost in the middle of the work")),
                Glance::Busy => self.check()?,
            }
            if ended() != last {
                (last, since) = (ended(), Instant::now());
            }
            let gives_up = lock(&self.0.gives_up).clone();
            let is_unwanted = gives_up.is_some_and(|gives_up| gives_up());
            let patience = match self.0.fault {
                Some(SimulatedFault::Hang(_)) => SIMULATED,
                _ if is_unwanted => GRACE,
                _ => PATIENCE,
            };
            if since.elapsed() > patience {
                let problem = format!("has not answered for {:.1} s", since.elapsed().as_secs_f64());
                return Err(self.leave_alone(&problem));
            }
        }
    }

    /// Waits for a moment.
    fn glance(&self) -> Result<Glance> {
        let round_trips = self.round_trips();
        if matches!(self.0.fault, Some(SimulatedFault::Hang(begins)) if round_trips >= begins) {
            sleep(GLANCE);
            return Ok(Glance::Busy);
        }
        let polled = catch_unwind(AssertUnwindSafe(|| {
            if matches!(self.0.fault, Some(SimulatedFault::Crash(begins)) if round_trips >= begins) {
                #[allow(clippy::panic, reason = "wgpu does, and that is what is simulated")]
                {
                    panic!("{LOST}: simulated");
                }
            }
            self.poll()
        }));
        match polled {
            Ok(Ok(_)) => Ok(Glance::Done),
            Ok(Err(wgpu::PollError::Timeout)) => Ok(Glance::Busy),
            Ok(Err(other)) => Err(self.failed(&format!("cannot be waited for: {other}"))),
            Err(_) => Ok(Glance::Lost),
        }
    }

    /// Waits until all is done or a [`GLANCE`] has passed.
    fn poll(&self) -> std::result::Result<wgpu::PollStatus, wgpu::PollError> {
        let begun = Instant::now();
        while self.0.tactics.spins && begun.elapsed() < SPIN {
            let status = self.0.device.poll(wgpu::PollType::Poll)?;
            if status.is_queue_empty() {
                return Ok(status);
            }
            std::hint::spin_loop();
        }
        self.0.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(GLANCE) })
    }

    /// Keeps a failure, and what belongs to the device for ever: dropping it would wait for it.
    fn leave_alone(&self, problem: &str) -> Error {
        std::mem::forget(self.clone());
        let error = self.failed(problem);
        note(&self.0.failure, self.failed(problem));
        error
    }
}
