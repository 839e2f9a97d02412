use std::fmt::Display;
use std::time::Instant;

use serde::Serialize;

use super::rows::{AnyRows, Tested};
use crate::job::Engine;
use crate::{Error, Fault, Result};

/// How cases are run.
#[derive(Debug)]
pub(super) struct Setting {
    /// Whether every sweep is thinned out.
    pub(super) quick: bool,
    /// Whether one weight of every row of what is tested is wrong, so that every verdict should turn.
    pub(super) faulty: bool,
    /// What computes the cases of an adapter.
    #[cfg_attr(not(feature = "gpu"), expect(dead_code, reason = "without adapters there is but one"))]
    pub(super) engine: Engine,
}

impl Setting {
    /// What faulty rows are compared with.
    pub(super) const RIGHT: Self = Self { quick: false, faulty: false, engine: Engine::Cpu };

    /// The values of a sweep; of a short one every third, and the last.
    pub(super) fn some<T: Copy>(&self, all: &[T]) -> Vec<T> {
        let last = all.len().saturating_sub(1);
        let takes = |index: usize| !self.quick || index.is_multiple_of(3) || index == last;
        all.iter().enumerate().filter(|(index, _)| takes(*index)).map(|(_, value)| *value).collect()
    }

    /// Rows as they are tested.
    pub(super) fn tested<'a>(&self, rows: &'a dyn AnyRows) -> Tested<'a> {
        Tested { rows, faulty: self.faulty }
    }
}

/// One law, and what puts it under stress.
pub(super) struct Case {
    pub(super) name: &'static str,
    /// What must be true.
    pub(super) law: &'static str,
    /// Why the bound is what it is.
    pub(super) why: &'static str,
    pub(super) run: fn(&Setting, &mut Measurements) -> Result<()>,
}

impl Case {
    /// Errors: those of the machine alone; any other is the verdict.
    pub(super) fn verdict(&self, setting: &Setting) -> Result<Verdict> {
        let clock = Instant::now();
        let mut samples = Measurements::default();
        let error = match (self.run)(setting, &mut samples) {
            Ok(()) => None,
            Err(error) if error.fault() == Fault::Machine => return Err(error),
            Err(error) => Some(error.to_string()),
        };
        let samples = samples.0;
        // A case that measured nothing has shown nothing.
        let holds = error.is_none() && !samples.is_empty() && samples.iter().all(Measurement::holds);
        let worst = (0..samples.len()).max_by(|&a, &b| samples[a].strain().total_cmp(&samples[b].strain()));
        Ok(Verdict {
            case: self.name,
            law: self.law,
            why: self.why,
            holds,
            error,
            worst: worst.map(|index| samples[index].clone()),
            samples,
            seconds: clock.elapsed().as_secs_f64(),
        })
    }
}

/// One measurement.
#[derive(Debug, Clone, Serialize)]
pub struct Measurement {
    /// Where in the sweep, and how it went.
    pub place: String,
    /// What was measured.
    pub measured: f64,
    /// What it may be.
    pub bound: f64,
}

impl Measurement {
    // Not `measured > bound`: a NaN must not pass.
    fn holds(&self) -> bool {
        self.measured <= self.bound
    }

    /// How much of the bound is used; a NaN uses more than all of it.
    fn strain(&self) -> f64 {
        match (self.measured, self.bound) {
            (measured, bound) if measured.is_nan() || bound.is_nan() => f64::INFINITY,
            (measured, bound) if bound > 0.0 => measured / bound,
            (measured, _) if measured > 0.0 => f64::INFINITY,
            _ => 0.0,
        }
    }
}

/// What a case has measured.
#[derive(Debug, Default)]
pub(super) struct Measurements(Vec<Measurement>);

impl Measurements {
    /// `measured` must be at most `bound`.
    pub(super) fn within(&mut self, place: impl Display, measured: f64, bound: f64) {
        self.0.push(Measurement { place: place.to_string(), measured, bound });
    }

    /// This must be.
    pub(super) fn must(&mut self, place: impl Display, holds: bool) {
        self.within(place, if holds { 0.0 } else { 1.0 }, 0.0);
    }

    /// This must fail with an error of such a kind, and say something.
    pub(super) fn refused<T>(&mut self, place: impl Display, result: Result<T>, kind: fn(&Error) -> bool) {
        match result {
            Ok(_) => self.must(format!("{place}: not refused"), false),
            Err(error) => self.must(format!("{place}: {error}"), kind(&error)),
        }
    }
}

/// What came of a case.
#[derive(Debug, Clone, Serialize)]
pub struct Verdict {
    /// Which case.
    pub case: &'static str,
    /// What must be true.
    pub law: &'static str,
    /// Why the bound is what it is.
    pub why: &'static str,
    /// Whether it is true.
    pub holds: bool,
    /// The error that ended the case.
    pub error: Option<String>,
    /// The sample that used most of its bound.
    pub worst: Option<Measurement>,
    /// All measurements.
    pub samples: Vec<Measurement>,
    /// What it took.
    pub seconds: f64,
}
