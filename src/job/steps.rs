//! The steps of a job: told to its observer, and timed.

use std::time::Instant;

use super::observer::{Iteration, Observer, Step, Stop, Wish};
use crate::scene::SolveSettings;
use crate::solve::{Control, Progress};
use crate::{Error, Result};

/// Seconds of each step, in the order in which they were first taken.
pub(crate) type Timings = Vec<(String, f64)>;

/// Steps on their way.
pub(crate) struct Steps<'a> {
    observer: &'a mut dyn Observer,
    stop: &'a Stop,
    timings: Timings,
    begun: Option<(String, Instant)>,
    within: String,
}

impl<'a> Steps<'a> {
    /// Goes on from steps that were timed before.
    pub(crate) fn new(observer: &'a mut dyn Observer, stop: &'a Stop, timings: Timings) -> Self {
        Self { observer, stop, timings, begun: None, within: String::new() }
    }

    /// Says what the steps from now on belong to.
    pub(crate) fn within(&mut self, what: String) {
        self.within = what;
    }

    /// Ends the step before and begins one called `name`, of `parts` where they can be counted.
    pub(crate) fn begin(&mut self, name: &str, parts: Option<u64>) {
        self.end();
        self.observer.begins(&Step { name, within: &self.within, parts });
        self.begun = Some((name.to_owned(), Instant::now()));
    }

    /// So many parts of the current step are done.
    pub(crate) fn advance(&mut self, done: u64, remark: &str) {
        self.observer.advances(done, remark);
    }

    /// Tells of an iteration of a solve with these settings.
    pub(crate) fn iterated(&mut self, progress: &Progress, settings: &SolveSettings) -> Wish {
        let SolveSettings { iterations: limit, tolerance, .. } = *settings;
        self.observer.iterated(&Iteration { progress, limit, tolerance })
    }

    /// Whether somebody wants to stop.
    pub(crate) fn stops(&self) -> bool {
        self.stop.is_asked() || self.observer.stops()
    }

    /// Between the parts of what is given up when somebody wants to stop.
    ///
    /// Errors: [`Error::Interrupted`].
    pub(crate) fn go_on(&self) -> Result<()> {
        if self.stops() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// What a solve is told after an iteration.
    pub(crate) fn control(&self) -> Control {
        if self.stops() { Control::Stop } else { Control::Continue }
    }

    fn end(&mut self) {
        if let Some((name, begun)) = self.begun.take() {
            let seconds = begun.elapsed().as_secs_f64();
            // A job of several stages takes some steps more than once.
            match self.timings.iter_mut().find(|(known, _)| *known == name) {
                Some((_, sum)) => *sum += seconds,
                None => self.timings.push((name, seconds)),
            }
        }
    }

    /// Ends the last step; the seconds of each.
    pub(crate) fn finish(mut self) -> Timings {
        self.end();
        self.timings
    }
}
