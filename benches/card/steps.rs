//! The steps of a run, in their order, and those that measure.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::bundle::Bundle;
use super::record::{Figure, Outcome, Step, short};
use super::trials;

/// What a step does, and how many seconds it has.
pub struct Plan {
    pub name: &'static str,
    pub seconds: u64,
    /// Whether a dry run has it, too.
    pub in_dry: bool,
    pub work: fn(&Bundle, &mut Step),
}

impl Plan {
    const fn new(name: &'static str, seconds: u64, work: fn(&Bundle, &mut Step)) -> Self {
        Self { name, seconds, in_dry: true, work }
    }
}

/// A light map within this is what the paper's interactive speed asks of a data-centre card.
const AIM_OF_A_RUN: f64 = 10e-3;
/// An iteration over 6 pictures of 1920 × 1080.
const AIM_OF_AN_ITERATION: f64 = 50e-3;
/// T x over slices of as many pictures: 2 ms each, which prefiltered shadow maps take (Klehm et al. 2014).
const AIM_OVER_SLICES: f64 = 12e-3;

pub const STEPS: &[Plan] = &[
    Plan::new("doctor and check", 45, trials::doctor),
    Plan::new("overhead", 20, |bundle, step| kernels(bundle, step, "^overhead/", None)),
    Plan::new("long vectors", 30, |bundle, step| kernels(bundle, step, "^vectors of", None)),
    Plan::new("kept rows", 40, |bundle, step| {
        kernels(bundle, step, "^light map.*/rows kept.*: (gather|scatter|squares|iteration)", None);
    }),
    Plan::new("tiles and depth pass", 30, |bundle, step| {
        kernels(bundle, step, "^(metric|depth pass)/", None);
    }),
    Plan::new("walked rows", 45, |bundle, step| {
        kernels(
            bundle,
            step,
            "^(light map.*/walked.*: (gather|scatter|squares|iteration)|fixed point/)",
            None,
        );
    }),
    Plan::new("fista", 60, |bundle, step| {
        kernels(bundle, step, "^light map.*: fista", Some(("rows kept: fista, a run of 32", AIM_OF_A_RUN)));
    }),
    Plan::new("rows over slices", 40, |bundle, step| {
        kernels(bundle, step, "^light map.*/over slices", None);
    }),
    Plan::new("walked volumes", 60, |bundle, step| kernels(bundle, step, "^volume.*/walked", None)),
    Plan::new("whole solves", 100, trials::solves),
    Plan::new("checks of all scenes", 60, trials::checks),
    Plan::new("ten deterministic runs", 40, trials::deterministic),
    Plan::new("simulated faults", 60, trials::faults),
    Plan::new("tests on the adapter", 120, trials::tests),
    Plan::new("first call", 40, |bundle, step| {
        trials::first_solve(bundle, step);
        kernels(bundle, step, "^first call/", None);
    }),
    Plan {
        name: "six full pictures",
        seconds: 60,
        in_dry: false,
        work: |bundle, step| {
            let aim = Some(("walked: iteration", AIM_OF_AN_ITERATION));
            measured(bundle, step, "large", "^light map.*/walked: iteration", aim);
        },
    },
    Plan {
        name: "six full pictures over slices",
        seconds: 90,
        in_dry: false,
        work: |bundle, step| {
            let aim = Some(("over slices: sweep_gather and sweep_shown", AIM_OVER_SLICES));
            measured(bundle, step, "large", "^light map.*/over slices", aim);
        },
    },
];

impl Plan {
    /// Does step `number`, whatever happens in it.
    pub fn run(&self, bundle: &Bundle, number: usize) -> Step {
        let mut step = Step::new(self.name);
        if bundle.is_dry && !self.in_dry {
            step.went_wrong(Outcome::LeftOut, "too large for a dry run".to_owned());
            return step;
        }
        if bundle.time_left().is_zero() {
            // A dry run is about all steps.
            let outcome = if bundle.is_dry { Outcome::TimedOut } else { Outcome::LeftOut };
            step.went_wrong(outcome, "the time was up before it began".to_owned());
            return step;
        }
        let clock = Instant::now();
        // A slow machine may be slow in a dry run.
        let limit = if bundle.is_dry { bundle.time_left() } else { Duration::from_secs(self.seconds) };
        bundle.begin(number, &self.name.replace(' ', "-"), limit);
        if catch_unwind(AssertUnwindSafe(|| (self.work)(bundle, &mut step))).is_err() {
            step.went_wrong(Outcome::Failed, "the runner has made a mistake here".to_owned());
        }
        step.seconds = clock.elapsed().as_secs_f64();
        step
    }
}

/// Benches of the kernels at the size of the paper, or at the smallest.
fn kernels(bundle: &Bundle, step: &mut Step, filter: &str, aim: Option<(&str, f64)>) {
    measured(bundle, step, if bundle.is_dry { "tiny" } else { "paper" }, filter, aim);
}

/// The figures of all benches whose name matches a filter; the one that ends as `aim` says stands against that many seconds.
fn measured(bundle: &Bundle, step: &mut Step, size: &str, filter: &str, aim: Option<(&str, f64)>) {
    let lines = bundle.scratch("figures.jsonl");
    let _ = std::fs::remove_file(&lines);
    let mut command = bundle.program("kernels");
    // A dry run measures each once.
    match bundle.is_dry {
        true => command.arg("--test"),
        false => command.args(["--bench", "--noplot", "--warm-up-time", "0.1", "--measurement-time", "0.3"]),
    };
    command
        .args(["--sample-size", "10", filter])
        .env("UNSCATTER_SIZE", size)
        .env("UNSCATTER_JSON", &lines)
        .env("CRITERION_HOME", bundle.scratch("criterion"));
    bundle.done(step, "kernels", &mut command);
    let text = std::fs::read_to_string(&lines).unwrap_or_default();
    let figures: Vec<Figure> = text
        .lines()
        .filter_map(|line| serde_json::from_str(line).ok())
        .map(|line| figure(line, aim))
        .collect();
    if figures.is_empty() {
        step.went_wrong(Outcome::Failed, "nothing was measured".to_owned());
    }
    step.figures.extend(figures);
}

/// A line that a bench has written, against the time that its bytes take, and the aim for it.
fn figure(measured: Value, aim: Option<(&str, f64)>) -> Figure {
    let number = |key: &str| measured[key].as_f64().unwrap_or_default();
    let what = measured["name"].as_str().unwrap_or_default().to_owned();
    let (unit, scale) = if number("seconds") < 1e-4 { ("µs", 1e6) } else { ("ms", 1e3) };
    let mut against = Vec::new();
    if let Some((_, seconds)) = aim.filter(|(name, _)| what.ends_with(name)) {
        against.push(format!("aim {} {unit}", short(scale * seconds)));
    }
    let (bytes, at_best) = (number("bytes"), number("at_best"));
    if bytes > 0.0 && at_best > 0.0 {
        let floor = short(scale * bytes / at_best);
        let (bytes, at_best) = (short(1e-6 * bytes), short(1e-9 * at_best));
        against.push(format!("floor {floor} {unit}: {bytes} MB at {at_best} GB/s"));
    }
    for (key, name) in [("dispatches", "dispatches"), ("round_trips", "round trips")] {
        if number(key) > 1.0 || number(key) > 0.0 && what.contains("iteration") {
            against.push(format!("{} {name}", short(number(key))));
        }
    }
    Figure { what, value: scale * number("seconds"), unit, against: against.join("; "), measured }
}
