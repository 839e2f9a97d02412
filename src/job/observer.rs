//! Who hears how a job goes, and may stop it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::solve::{Control, Progress};
use crate::{Error, Result};

/// A step of a job that begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Step<'a> {
    /// `tracing`, `lighting`, `walking`, `solving`, `assessing`, `rendering`, `turning`, `diffusing`, `writing`, or what a lab measures.
    pub name: &'a str,
    /// What it belongs to, such as `frame 12`; empty where there is one of each.
    pub within: &'a str,
    /// Its parts, where they can be counted.
    pub parts: Option<u64>,
}

/// An iteration of a solve that has ended.
#[derive(Debug, Clone, Copy)]
pub struct Iteration<'a> {
    /// How far it is.
    pub progress: &'a Progress,
    /// Iterations at most.
    pub limit: usize,
    /// The normal residual at which it ends.
    pub tolerance: f64,
}

/// What an observer wants after an iteration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Wish {
    /// To go on.
    GoOn,
    /// To see what there is so far: its pictures are written to the folder of the job, if it has one.
    Preview,
    /// To stop; what was computed is kept.
    Stop,
}

/// Hears how a job goes, and may stop it. Every method may be left as it is.
pub trait Observer {
    /// A step begins, and the one before has ended.
    fn begins(&mut self, _step: &Step<'_>) {}

    /// So many parts of the step are done.
    fn advances(&mut self, _done: u64, _remark: &str) {}

    /// After every iteration of a solve.
    fn iterated(&mut self, _at: &Iteration<'_>) -> Wish {
        Wish::GoOn
    }

    /// Whether to stop, asked between iterations, pictures and frames.
    fn stops(&self) -> bool {
        false
    }
}

/// Hears nothing and stops nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Quiet;

impl Observer for Quiet {}

impl<O: Observer + ?Sized> Observer for &mut O {
    fn begins(&mut self, step: &Step<'_>) {
        (**self).begins(step);
    }

    fn advances(&mut self, done: u64, remark: &str) {
        (**self).advances(done, remark);
    }

    fn iterated(&mut self, at: &Iteration<'_>) -> Wish {
        (**self).iterated(at)
    }

    fn stops(&self) -> bool {
        (**self).stops()
    }
}

/// Both hear everything; the stronger wish counts.
impl<A: Observer, B: Observer> Observer for (A, B) {
    fn begins(&mut self, step: &Step<'_>) {
        self.0.begins(step);
        self.1.begins(step);
    }

    fn advances(&mut self, done: u64, remark: &str) {
        self.0.advances(done, remark);
        self.1.advances(done, remark);
    }

    fn iterated(&mut self, at: &Iteration<'_>) -> Wish {
        self.0.iterated(at).max(self.1.iterated(at))
    }

    fn stops(&self) -> bool {
        self.0.stops() || self.1.stops()
    }
}

/// A request to stop that any thread may make, at any time; clones are the same one.
#[derive(Debug, Clone, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Asks to stop; whether somebody had asked before.
    pub fn ask(&self) -> bool {
        self.0.swap(true, Ordering::SeqCst)
    }

    /// Whether somebody has asked.
    pub fn is_asked(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }

    /// Takes the request back.
    pub fn withdraw(&self) {
        self.0.store(false, Ordering::SeqCst);
    }

    /// What a solve is told after an iteration.
    pub(crate) fn control(&self) -> Control {
        if self.is_asked() { Control::Stop } else { Control::Continue }
    }

    /// Between the parts of what is given up when somebody wants to stop.
    ///
    /// Errors: [`Error::Interrupted`].
    pub(crate) fn go_on(&self) -> Result<()> {
        if self.is_asked() { Err(Error::Interrupted) } else { Ok(()) }
    }
}
