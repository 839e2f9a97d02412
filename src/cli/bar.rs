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
    /// How often to ask for pictures of what there is so far.
    preview_every: Option<usize>,
}

impl Bar {
    pub(crate) fn new(quiet: bool) -> Self {
        let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(None, target);
        bar.enable_steady_tick(Duration::from_millis(100));
        let spoken = (!quiet && !std::io::stderr().is_terminal()).then(Instant::now);
        let mut bar = Self { bar, spoken, step: String::new(), parts: None, preview_every: None };
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
        self.advances(at.progress.iteration as u64, &format!("normal residual {worst:.1e}"));
        match self.preview_every {
            Some(every) if at.progress.iteration.is_multiple_of(every) => Wish::Preview,
            _ => Wish::GoOn,
        }
    }
}
