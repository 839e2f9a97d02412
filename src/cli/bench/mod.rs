//! `unscatter bench`: run time against error.

mod cases;
mod counts;
mod laws;
mod log;
mod measure;
mod reference;
mod scaling;
mod skipping;
mod subject;
mod words;

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;
use std::time::Duration;

use super::args::{Backend, BenchArguments};
use super::engine::Engine;
use super::progress::{Steps, interrupted, watch_interrupt};
use super::results::Folder;
use super::{Done, Manners};
use crate::Result;
use crate::report::bench::{self as report, Held, Record, Skipped, Sweep};
use cases::{Between, Case, Level, Place, cases};
use counts::Counts;
use log::Log;
use measure::{Bench, Patience};
use reference::Sample;
use scaling::Scaling;
use skipping::Comparison;
use subject::Source;

/// Rows of a sample where nothing is said, and in a hurry.
const ROWS: usize = 1024;
const FEW_ROWS: usize = 256;

const QUICK: Patience = Patience {
    repetitions: [2, 9],
    repeating: Duration::from_millis(20),
    solving: Duration::from_secs(1),
    iterations: 300,
};
const USUAL: Patience = Patience {
    repetitions: [3, 31],
    repeating: Duration::from_millis(100),
    solving: Duration::from_secs(5),
    iterations: 2000,
};

/// What was measured of all scenes.
#[derive(Default)]
struct Found {
    records: Vec<Record>,
    scaling: Vec<Sweep>,
    skipping: Vec<Skipped>,
}

/// `unscatter bench`: every case of every scene, and what follows from them.
pub(super) fn run(arguments: &BenchArguments, manners: &Manners) -> Result<Done> {
    let level = match (arguments.quick, arguments.all) {
        (true, _) => Level::Quick,
        (_, true) => Level::All,
        _ => Level::Usual,
    };
    let sources = match arguments.scenes.is_empty() {
        true => Source::known(),
        false => arguments.scenes.iter().cloned().map(Source::File).collect(),
    };
    let rows = arguments.rows.map_or(if arguments.quick { FEW_ROWS } else { ROWS }, |rows| rows as usize);
    // Whatever is wrong with a scene is said before anything is measured.
    for source in &sources {
        source.load(&[])?;
    }
    let before = arguments.counts.as_deref().map(counts::read).transpose()?;
    let engine = Engine::choose(&arguments.backend)?;
    let job = Job {
        level,
        rows,
        places: places(&engine, arguments.backend.backend),
        bench: Bench {
            patience: if arguments.quick { QUICK } else { USUAL },
            #[cfg(feature = "gpu")]
            gpu: gpu(&engine),
        },
        only_cases: arguments.only_cases,
    };
    let folder = Folder::create(arguments.output.clone(), Path::new("bench"))?;
    let kind = format!("{:016x}", fingerprint(&sources, arguments, &job)?);
    let mut log = Log::open(folder.path(), &kind, arguments.resume)?;
    watch_interrupt()?;
    let mut steps = Steps::new(manners.quiet);
    let mut found = Found::default();
    for source in sources.iter().take_while(|_| !interrupted()) {
        job.scene(source, &mut log, &mut steps, &mut found)?;
    }
    steps.begin("writing", None);
    let bench = job.findings(found, &engine, before.as_deref().unwrap_or_default());
    folder.write_bytes("bench.json", bench.to_json()?.as_bytes())?;
    folder.write_bytes("bench.csv", report::csv(&bench.records)?.as_bytes())?;
    folder.write_bytes("counts.csv", counts::table(&bench.records)?.as_bytes())?;
    folder.write_bytes("bench.html", report::page(&bench)?.as_bytes())?;
    folder.publish()?;
    steps.finish();
    let told = words::summary(&bench, log.taken, folder.path(), arguments.counts.as_deref());
    manners.print(&bench.to_json()?, &told);
    Ok(match bench.held.hold == bench.held.of {
        false => Done::Broken,
        true if bench.complete => Done::Completely,
        true => Done::Interrupted,
    })
}

/// What is measured of every scene, and how.
struct Job {
    level: Level,
    rows: usize,
    places: Vec<Place>,
    bench: Bench,
    only_cases: bool,
}

impl Job {
    fn scene(&self, source: &Source, log: &mut Log, steps: &mut Steps, found: &mut Found) -> Result<()> {
        let name = source.name();
        let mut samples: [Option<Sample>; 2] = [None, None];
        // A scene is only made when something of it is not known yet.
        let sample = |samples: &mut [Option<Sample>; 2], between: Between| -> Result<()> {
            let place = &mut samples[between as usize];
            if place.is_none() {
                *place = Some(Sample::new(source.load(&[])?, between, self.rows)?);
            }
            Ok(())
        };
        let marches = source.load(&[])?.can_march();
        let all = cases(self.level, &self.places, marches);
        steps.begin(&name, Some(all.len() as u64));
        for (index, case) in all.iter().enumerate() {
            if interrupted() {
                return Ok(());
            }
            steps.advance(index as u64, case.name());
            let record = log.once(&format!("{name}/{}", case.name()), || {
                sample(&mut samples, case.between)?;
                match &samples[case.between as usize] {
                    Some(sample) => self.bench.measure(&name, case, sample),
                    None => Ok(None),
                }
            })?;
            found.records.extend(record.flatten());
        }
        if self.only_cases || interrupted() {
            return Ok(());
        }
        let skipping = log.once(&format!("{name}/skipping"), || {
            sample(&mut samples, Between::Linear)?;
            match &samples[Between::Linear as usize] {
                Some(sample) => {
                    Comparison { patience: self.bench.patience, source, sample, rows: self.rows }.run()
                }
                None => Ok(Vec::new()),
            }
        })?;
        found.skipping.extend(skipping.unwrap_or_default());
        let scaling = Scaling { patience: self.bench.patience, source, quick: self.level == Level::Quick };
        let mut begin = |over: &str| steps.begin(&format!("{name}, {over}"), None);
        found.scaling.extend(scaling.run(log, &mut begin)?);
        Ok(())
    }

    fn findings(&self, found: Found, engine: &Engine, before: &[Counts]) -> report::Bench {
        let complete = !interrupted();
        let mut laws = laws::laws(&found.records, &found.skipping);
        laws.extend(counts::laws(before, &found.records, complete));
        report::Bench {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command: std::env::args().skip(1).collect::<Vec<_>>().join(" "),
            machine: super::machine::processor(),
            threads: rayon::current_num_threads(),
            adapter: adapter(engine),
            most_rows: self.rows,
            complete,
            held: Held { hold: laws.iter().filter(|law| law.holds).count(), of: laws.len() },
            laws,
            against: report::compare(&found.records),
            records: found.records,
            scaling: found.scaling,
            skipping: found.skipping,
        }
    }
}

/// What computes: the processor, an adapter, or both.
fn places(engine: &Engine, asked: Backend) -> Vec<Place> {
    #[cfg(feature = "gpu")]
    match (engine, asked) {
        (Engine::Gpu { .. }, Backend::Gpu) => return vec![Place::Gpu],
        (Engine::Gpu { .. }, _) => return vec![Place::Cpu, Place::Gpu],
        _ => {}
    }
    let _only_the_processor = (engine, asked);
    vec![Place::Cpu]
}

#[cfg(feature = "gpu")]
fn gpu(engine: &Engine) -> Option<crate::gpu::Gpu> {
    match engine {
        Engine::Gpu { gpu, .. } => Some(gpu.clone()),
        Engine::Cpu => None,
    }
}

/// The adapter in words.
fn adapter(engine: &Engine) -> Option<String> {
    match engine {
        #[cfg(feature = "gpu")]
        Engine::Gpu { gpu, .. } => Some(super::compute::device(gpu.record())),
        Engine::Cpu => None,
    }
}

/// Tells runs apart that measure different things: their records are not to be mixed.
fn fingerprint(sources: &[Source], arguments: &BenchArguments, job: &Job) -> Result<u64> {
    let mut hasher = DefaultHasher::new();
    for source in sources {
        source.name().hash(&mut hasher);
        source.bytes()?.hash(&mut hasher);
    }
    let names: Vec<String> = cases(job.level, &job.places, true).iter().map(Case::name).collect();
    (env!("CARGO_PKG_VERSION"), names, job.rows, arguments.quick).hash(&mut hasher);
    (rayon::current_num_threads(), super::machine::processor()).hash(&mut hasher);
    Ok(hasher.finish())
}
