use std::path::PathBuf;

use super::args::BenchArguments;
use super::bar::Bar;
use super::{Done, Manners, bench_words, watch_interrupt};
use crate::Result;
use crate::job::Stop;
use crate::lab::bench::{Benchmark, Level};

/// `unscatter bench`: every case of every scene, and what follows from them.
pub(super) fn run(arguments: &BenchArguments, manners: &Manners) -> Result<Done> {
    let benchmark = Benchmark {
        scenes: arguments.scenes.clone(),
        level: match (arguments.quick, arguments.all) {
            (true, _) => Level::Quick,
            (_, true) => Level::All,
            _ => Level::Usual,
        },
        rows: arguments.rows.map(|rows| rows as usize),
        only_cases: arguments.only_cases,
        pictures: arguments.pictures,
        resume: arguments.resume,
        counts: arguments.counts.clone(),
        engine: arguments.backend.choice(),
        command: std::env::args().skip(1).collect::<Vec<_>>().join(" "),
        folder: arguments.output.clone().unwrap_or_else(|| PathBuf::from("out/bench")),
        stop: Stop::default(),
    };
    watch_interrupt(&benchmark.stop, Some(benchmark.folder.clone()))?;
    let mut bar = Bar::new(manners.quiet);
    let (bench, taken) = benchmark.run(&mut bar)?;
    bar.finish();
    let told = bench_words::summary(&bench, taken, &benchmark.folder, arguments.counts.as_deref());
    manners.print(&bench.to_json()?, &told)?;
    Ok(match bench.held.hold == bench.held.of {
        false => Done::Broken,
        true if bench.complete => Done::Completely,
        true => Done::Interrupted,
    })
}
