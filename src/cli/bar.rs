use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::out;
use crate::job::{Iteration, Observer, Step, Wish};

/// How long nothing is said where there is no terminal.
const SILENCE: Duration = Duration::from_secs(30);

/// A bar on standard error that moves as a job goes; where that is no terminal, a line now and then.
#[derive(Debug)]
pub(crate) struct Bar {
    bar: ProgressBar,
    /// When the last line was written; none where the bar moves, or nothing is to be said.
    spoken: Option<Instant>,
    step: String,
    parts: Option<u64>,
    /// Of the solve that goes on the logarithm of the normal residual, iteration by iteration.
    course: Vec<f64>,
    /// How often to ask for pictures of what there is so far.
    preview_every: Option<usize>,
}

impl Bar {
    pub(crate) fn new(quiet: bool) -> Self {
        let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(None, target);
        bar.enable_steady_tick(Duration::from_millis(100));
        let spoken = (!quiet && !std::io::stderr().is_terminal()).then(Instant::now);
        let mut bar =
            Self { bar, spoken, step: String::new(), parts: None, course: Vec::new(), preview_every: None };
        bar.begins(&Step { name: "reading", within: "", parts: None });
        bar
    }

    /// The same, which asks for a preview every so many iterations.
    pub(crate) fn with_previews(self, every: Option<u32>) -> Self {
        Self { preview_every: every.map(|every| every as usize), ..self }
    }

    /// Says where it is, when nothing was said for long.
    fn speak(&mut self, how_far: &str) {
        if let Some(spoken) = self.spoken.filter(|spoken| spoken.elapsed() >= SILENCE) {
            out::remark(&format!("{}{how_far}\n", out::visible(&self.step)));
            self.spoken = Some(spoken + spoken.elapsed());
        }
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// Iterations that the course of a solve is judged by.
const JUDGED: usize = 12;

/// How long a solve will still take if it goes on falling as it did in the last iterations, and at most until its limit; none at first.
fn seconds_left(course: &[f64], at: &Iteration<'_>) -> Option<f64> {
    let [first, .., last] = course[course.len().saturating_sub(JUDGED)..] else { return None };
    let of_limit = at.limit.saturating_sub(at.progress.iteration) as f64;
    let fall = (first - last) / (course.len().min(JUDGED) - 1) as f64;
    let needed =
        if fall > 0.0 && at.tolerance > 0.0 { (last - at.tolerance.ln()) / fall } else { f64::INFINITY };
    let seconds = at.progress.seconds / at.progress.iteration.max(1) as f64;
    Some(needed.clamp(0.0, of_limit) * seconds).filter(|_| course.len() >= JUDGED / 2)
}

impl Observer for Bar {
    fn begins(&mut self, step: &Step<'_>) {
        let template = if step.parts.is_some() {
            "{msg:>12} [{bar:32.cyan/blue}] {pos}/{len} {elapsed} {prefix}"
        } else {
            "{msg:>12} {spinner} {elapsed}"
        };
        let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
        self.bar.set_style(style.progress_chars("━╸─"));
        self.bar.set_position(0);
        if let Some(parts) = step.parts {
            self.bar.set_length(parts);
        }
        self.bar.set_prefix("");
        self.bar.reset_elapsed();
        let comma = if step.within.is_empty() { "" } else { ", " };
        self.step = format!("{}{comma}{}", step.within, step.name);
        self.parts = step.parts;
        self.course.clear();
        self.bar.set_message(self.step.clone());
        self.speak("");
    }

    fn advances(&mut self, done: u64, remark: &str) {
        self.bar.set_position(done);
        self.bar.set_prefix(remark.to_owned());
        let parts = self.parts.map_or(String::new(), |parts| format!(" {done} of {parts}"));
        let comma = if remark.is_empty() { "" } else { ", " };
        self.speak(&format!("{parts}{comma}{remark}"));
    }

    fn iterated(&mut self, at: &Iteration<'_>) -> Wish {
        let worst = at.progress.normal_residual.iter().copied().fold(0.0, f64::max);
        self.course.push(worst.ln());
        let left = match seconds_left(&self.course, at) {
            Some(seconds) => format!(", about {} s left", seconds.ceil().max(1.0)),
            None => String::new(),
        };
        self.advances(at.progress.iteration as u64, &format!("normal residual {worst:.1e}{left}"));
        match self.preview_every {
            Some(every) if at.progress.iteration.is_multiple_of(every) => Wish::Preview,
            _ => Wish::GoOn,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::Progress;

    #[test]
    fn what_is_left_is_what_an_even_fall_takes() {
        let progress = Progress { iteration: 20, seconds: 4.0, ..Progress::default() };
        let at = |tolerance| Iteration { progress: &progress, limit: 100, tolerance };
        // A tenth in ten iterations; a hundredth is to come.
        let course: Vec<f64> = (0..=20).map(|k| -0.1 * f64::from(k) * 10f64.ln()).collect();
        let left = seconds_left(&course, &at(1e-4)).unwrap();
        assert!((left - 4.0).abs() < 1e-9, "{left}");
        // Not before there is a course, and never beyond the limit.
        assert_eq!(seconds_left(&course[..3], &at(1e-4)), None);
        assert_eq!(seconds_left(&[0.0; 20], &at(1e-4)), Some(16.0));
        assert_eq!(seconds_left(&course, &at(0.0)), Some(16.0));
    }
}
