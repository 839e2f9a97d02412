//! Criterion's benches, and a table of rates at their end: rays, non-zeros and bytes a second, from the median of all rounds.
//!
//! What is measured is made when its bench is run, so a filter on the command line spares the others. With UNSCATTER_JSON=FILE every
//! figure is a line of JSON at the end of that file, too, as soon as it is measured.
#![allow(dead_code, reason = "each bench takes what it needs")]

use std::io::Write;
use std::time::{Duration, Instant};

use criterion::{Bencher, Criterion, SamplingMode};

/// What one round works through; 0 where there is no such thing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Work {
    pub rays: u64,
    pub nonzeros: u64,
    /// What must at least be moved.
    pub bytes: u64,
    /// Kernels that an adapter is given to run.
    pub dispatches: f64,
    /// How often the host waits for it.
    pub round_trips: f64,
}

/// A round of a bench: does its work, and says how long that took.
pub type Round<'a> = Box<dyn FnMut() -> Duration + 'a>;

/// Benches, and what they have measured.
pub struct Rates {
    criterion: Criterion,
    /// Bytes a second that the device moves at best, where that is known.
    at_best: Option<f64>,
    measured: Vec<(String, Work, Duration)>,
}

/// A round that is timed by the clock.
pub fn by_the_clock<'a, T>(mut work: impl FnMut() -> T + 'a) -> Round<'a> {
    Box::new(move || {
        let clock = Instant::now();
        std::hint::black_box(work());
        clock.elapsed()
    })
}

impl Rates {
    /// Benches of ten samples, together about so many seconds each, as the command line changes that.
    pub fn new(seconds: f64) -> Self {
        let criterion = Criterion::default()
            .sample_size(10)
            .warm_up_time(Duration::from_secs_f64(0.2 * seconds))
            .measurement_time(Duration::from_secs_f64(seconds))
            .configure_from_args();
        Self { criterion, at_best: None, measured: Vec::new() }
    }

    /// With a column of the share of so many bytes a second.
    pub fn beside(self, bytes_a_second: f64) -> Self {
        Self { at_best: Some(bytes_a_second), ..self }
    }

    /// Measures the rounds that `prepare` makes.
    pub fn bench<'a>(&mut self, group: &str, name: &str, prepare: impl FnOnce() -> (Work, Round<'a>)) {
        let (mut prepare, mut prepared, mut took) = (Some(prepare), None, Vec::new());
        let mut benches = self.criterion.benchmark_group(group);
        benches.sampling_mode(SamplingMode::Flat);
        benches.bench_function(name, |bencher: &mut Bencher| {
            let (_, round) = prepared.get_or_insert_with(|| prepare.take().unwrap()());
            bencher.iter_custom(|rounds| {
                (0..rounds)
                    .map(|_| {
                        let seconds = round().max(Duration::from_nanos(1));
                        took.push(seconds);
                        seconds
                    })
                    .sum()
            });
        });
        benches.finish();
        if let Some((work, _)) = prepared {
            took.sort();
            self.keep(format!("{group}/{name}"), work, &took);
        }
    }

    /// Keeps the median of sorted rounds, and adds them to the file of UNSCATTER_JSON.
    fn keep(&mut self, name: String, work: Work, took: &[Duration]) {
        let median = took[took.len() / 2];
        if let Ok(path) = std::env::var("UNSCATTER_JSON") {
            let [median, least, most] =
                [median, took[0], took[took.len() - 1]].map(|took| took.as_secs_f64());
            let line = serde_json::json!({
                "name": name, "seconds": median, "least": least, "most": most, "samples": took.len(),
                "rays": work.rays, "nonzeros": work.nonzeros, "bytes": work.bytes,
                "dispatches": work.dispatches, "round_trips": work.round_trips,
                "at_best": self.at_best, "share": self.at_best.map(|at_best| work.bytes as f64 / median / at_best),
            });
            let file = std::fs::OpenOptions::new().create(true).append(true).open(path);
            writeln!(file.unwrap(), "{line}").unwrap();
        }
        self.measured.push((name, work, median));
    }

    /// Prints the table.
    pub fn finish(self) {
        self.criterion.final_summary();
        if self.measured.is_empty() {
            return;
        }
        let share = if self.at_best.is_some() { " share |" } else { "" };
        println!("| | median | rays/s | non-zeros/s | bytes/s |{share}");
        println!("|---|---|---|---|---|{}", if share.is_empty() { "" } else { "---|" });
        for (name, work, took) in &self.measured {
            let seconds = took.as_secs_f64();
            let [rays, nonzeros, bytes] = [work.rays, work.nonzeros, work.bytes].map(|n| rate(n, seconds));
            let share = self.at_best.map_or(String::new(), |at_best| {
                format!(" {:.0} % |", 100.0 * work.bytes as f64 / seconds / at_best)
            });
            println!("| {name} | {} | {rays} | {nonzeros} | {bytes} |{share}", short(*took));
        }
    }
}

fn rate(number: u64, seconds: f64) -> String {
    let rate = number as f64 / seconds;
    match number {
        0 => "–".to_owned(),
        _ if rate >= 1e9 => format!("{:.2} G", 1e-9 * rate),
        _ if rate >= 1e6 => format!("{:.2} M", 1e-6 * rate),
        _ => format!("{:.2} k", 1e-3 * rate),
    }
}

fn short(took: Duration) -> String {
    let seconds = took.as_secs_f64();
    match seconds {
        1.0.. => format!("{seconds:.2} s"),
        1e-3.. => format!("{:.2} ms", 1e3 * seconds),
        _ => format!("{:.2} µs", 1e6 * seconds),
    }
}

/// The size that UNSCATTER_SIZE names, of some; the first where it is not set.
pub fn size_of<T: Copy>(sizes: &[(&'static str, T)]) -> (&'static str, T) {
    let Ok(asked) = std::env::var("UNSCATTER_SIZE") else { return sizes[0] };
    let names: Vec<&str> = sizes.iter().map(|(name, _)| *name).collect();
    *sizes.iter().find(|(name, _)| *name == asked).unwrap_or_else(|| {
        eprintln!("UNSCATTER_SIZE is {asked}; it can be {}", names.join(", "));
        std::process::exit(1)
    })
}
