use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::solve::Control;
use crate::{Error, Result};

/// Set by Ctrl-C.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Lets Ctrl-C end the work in order; a second one ends it at once.
pub(crate) fn watch_interrupt() -> Result<()> {
    ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::SeqCst) {
            std::process::exit(super::INTERRUPTED);
        }
    })
    .map_err(|error| Error::Machine(format!("cannot watch for Ctrl-C: {error}")))
}

pub(crate) fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}

/// What a solve is told after an iteration.
pub(crate) fn until_interrupted() -> Control {
    if interrupted() { Control::Stop } else { Control::Continue }
}

/// Between the steps of what is given up on Ctrl-C.
///
/// Errors: [`Error::Machine`] after Ctrl-C.
pub(crate) fn unless_interrupted() -> Result<()> {
    if interrupted() { Err(Error::Machine("interrupted".to_owned())) } else { Ok(()) }
}

/// Steps of a job on standard error, timed; nothing is drawn where that is not a terminal.
#[derive(Debug)]
pub(crate) struct Steps {
    bar: ProgressBar,
    timings: Vec<(String, f64)>,
    begun: Option<(String, Instant)>,
    clock: Instant,
    /// What the steps belong to, where there are several of each.
    within: String,
}

impl Steps {
    pub(crate) fn new(quiet: bool) -> Self {
        let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(None, target);
        bar.enable_steady_tick(Duration::from_millis(100));
        Self { bar, timings: Vec::new(), begun: None, clock: Instant::now(), within: String::new() }
    }

    /// Says what the steps from now on belong to.
    pub(crate) fn within(&mut self, what: String) {
        self.within = what;
    }

    /// Ends the step before and begins one called `name`, of `length` parts where they can be counted.
    pub(crate) fn begin(&mut self, name: &str, length: Option<u64>) {
        self.end();
        let template = if length.is_some() {
            "{msg:>12} [{bar:32.cyan/blue}] {pos}/{len} {elapsed} {prefix}"
        } else {
            "{msg:>12} {spinner} {elapsed}"
        };
        let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
        self.bar.set_style(style.progress_chars("━╸─"));
        self.bar.set_position(0);
        if let Some(length) = length {
            self.bar.set_length(length);
        }
        self.bar.set_prefix("");
        self.bar.reset_elapsed();
        let comma = if self.within.is_empty() { "" } else { ", " };
        self.bar.set_message(format!("{}{comma}{name}", self.within));
        self.begun = Some((name.to_owned(), Instant::now()));
    }

    /// Moves the bar of the current step.
    pub(crate) fn advance(&self, position: u64, remark: String) {
        self.bar.set_position(position);
        self.bar.set_prefix(remark);
    }

    /// Ends the current step.
    pub(crate) fn end(&mut self) {
        if let Some((name, begun)) = self.begun.take() {
            let seconds = begun.elapsed().as_secs_f64();
            // A job of several stages takes some steps more than once.
            match self.timings.iter_mut().find(|(known, _)| *known == name) {
                Some((_, sum)) => *sum += seconds,
                None => self.timings.push((name, seconds)),
            }
        }
    }

    /// Takes the bar away; returns the seconds of each step, and of all.
    pub(crate) fn finish(&mut self) -> Vec<(String, f64)> {
        self.end();
        self.bar.finish_and_clear();
        let mut timings = self.timings.clone();
        timings.push(("total".to_owned(), self.clock.elapsed().as_secs_f64()));
        timings
    }
}
