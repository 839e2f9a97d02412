//! Run time against error.

mod cases;
mod counts;
mod laws;
mod log;
mod measure;
mod pictures;
mod reference;
mod scaling;
mod skipping;
mod subject;

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::PathBuf;
use std::time::Duration;

use crate::Result;
use crate::io::scene_file::SceneFile;
use crate::job::{Backend, Engine, EngineChoice, Folder, Observer, Step, Stop, processor};
use crate::report::bench::{self as report, Held, PictureRecord, Record, Skipped, Sweep};
pub use cases::Level;
use cases::{CaseBackend, CaseBasis, Contender, cases};
use counts::Counts;
#[cfg(feature = "cli")]
pub(crate) use counts::LEFT_OUT;
use log::Log;
use measure::{CaseMeter, Patience};
use reference::Sample;
use scaling::ScalingSweeps;
use skipping::Comparison;
use subject::SceneSource;

/// Rows of a sample where nothing is said, and in a hurry.
const ROWS: usize = 1024;
const FEW_ROWS: usize = 256;

/// How long is measured.
fn patience(level: Level, stop: &Stop) -> Patience {
    match level {
        Level::Quick => Patience {
            stop: stop.clone(),
            repetitions: [2, 9],
            repeating: Duration::from_millis(20),
            solving: Duration::from_secs(1),
            iterations: 300,
        },
        Level::Usual | Level::All => Patience {
            stop: stop.clone(),
            repetitions: [3, 31],
            repeating: Duration::from_millis(100),
            solving: Duration::from_secs(5),
            iterations: 2000,
        },
    }
}

/// What was measured of all scenes.
#[derive(Default)]
struct SceneResults {
    records: Vec<Record>,
    scaling: Vec<Sweep>,
    skipping: Vec<Skipped>,
    pictures: Vec<PictureRecord>,
}

/// What is measured.
#[derive(Debug)]
pub struct Benchmark {
    /// Scene files; two small scenes that the library knows by heart when there is none.
    pub scenes: Vec<PathBuf>,
    /// Which of the cases are run.
    pub level: Level,
    /// Rows that are sampled of each scene at most.
    pub rows: Option<usize>,
    /// Leaves out how cost grows, and what skipping saves.
    pub only_cases: bool,
    /// Draws pictures of scattered light in every way, and leaves all else out.
    pub pictures: bool,
    /// Goes on after the last case in `records.jsonl` of the folder.
    pub resume: bool,
    /// Counts of an earlier run that must not rise.
    pub counts: Option<PathBuf>,
    /// What computes, beside the processor.
    pub engine: EngineChoice,
    /// The command line that asked for it, which the results quote.
    pub command: String,
    /// Where results go.
    pub folder: PathBuf,
    /// A request to stop, which is heard between measurements.
    pub stop: Stop,
}

impl Benchmark {
    /// Measures every case of every scene, and writes what follows from them to the folder. Gives that back, and how many cases were
    /// taken from an earlier run.
    ///
    /// Errors: those of scenes and of the engine; [`crate::Error::File`].
    pub fn run(&self, observer: &mut impl Observer) -> Result<(report::Bench, usize)> {
        let sources = match self.scenes.is_empty() {
            true => SceneSource::known(),
            false => {
                let read = |path| Ok(SceneSource::File(SceneFile::read(path)?));
                self.scenes.iter().map(read).collect::<Result<_>>()?
            }
        };
        let rows = self.rows.unwrap_or(if self.level == Level::Quick { FEW_ROWS } else { ROWS });
        // Whatever is wrong with a scene is said before anything is measured.
        for source in &sources {
            source.load(&[])?;
        }
        let before = self.counts.as_deref().map(counts::read).transpose()?;
        let engine = Engine::open(&self.engine, &self.stop)?;
        let session = Session {
            asked: self,
            rows,
            places: places(&engine, self.engine.backend),
            bench: CaseMeter {
                patience: patience(self.level, &self.stop),
                #[cfg(feature = "gpu")]
                gpu: engine.gpu().cloned(),
            },
        };
        let folder = Folder::create(&self.folder)?;
        let kind = format!("{:016x}", fingerprint(&sources, &session)?);
        let mut log = Log::open(folder.path(), &kind, self.resume, &self.stop)?;
        let mut found = SceneResults::default();
        for source in sources.iter().take_while(|_| !self.stop.is_asked()) {
            session.scene(source, &mut log, observer, &mut found)?;
        }
        observer.begins(&Step { name: "writing", within: "", parts: None });
        let bench = session.findings(found, &engine, before.as_deref().unwrap_or_default());
        folder.write_bytes("bench.json", bench.to_json()?.as_bytes())?;
        folder.write_bytes("bench.csv", report::csv(&bench.records)?.as_bytes())?;
        folder.write_bytes("counts.csv", counts::table(&bench.records)?.as_bytes())?;
        folder.write_bytes("bench.html", report::page(&bench)?.as_bytes())?;
        folder.publish()?;
        Ok((bench, log.taken))
    }
}

/// A benchmark on its way.
struct Session<'a> {
    asked: &'a Benchmark,
    rows: usize,
    places: Vec<CaseBackend>,
    bench: CaseMeter,
}

impl Session<'_> {
    fn scene(
        &self,
        source: &SceneSource,
        log: &mut Log,
        observer: &mut dyn Observer,
        found: &mut SceneResults,
    ) -> Result<()> {
        let stop = &self.asked.stop;
        let name = source.name();
        if self.asked.pictures {
            let mut begin = |what: &str| observer.begins(&Step { name: what, within: &name, parts: None });
            let is_quick = self.asked.level == Level::Quick;
            found.pictures.extend(pictures::pictures(source, is_quick, (log, stop), &mut begin)?);
            return Ok(());
        }
        let mut samples: [Option<Sample>; 2] = [None, None];
        // A scene is only made when something of it is not known yet.
        let sample = |samples: &mut [Option<Sample>; 2], basis: CaseBasis| -> Result<()> {
            let place = &mut samples[basis as usize];
            if place.is_none() {
                *place = Some(Sample::new(source.load(&[])?, basis, self.rows, stop)?);
            }
            Ok(())
        };
        let scenes = source.load(&[])?;
        let kinds = [subject::can_march(&scenes), subject::has_slices(&scenes)];
        let all = cases(self.asked.level, &self.places, kinds);
        observer.begins(&Step { name: &name, within: "", parts: Some(all.len() as u64) });
        for (index, case) in all.iter().enumerate() {
            if stop.is_asked() {
                return Ok(());
            }
            observer.advances(index as u64, &case.name());
            let record = log.once(&format!("{name}/{}", case.name()), || {
                sample(&mut samples, case.basis)?;
                match &samples[case.basis as usize] {
                    Some(sample) => self.bench.measure(&name, case, sample),
                    None => Ok(None),
                }
            })?;
            found.records.extend(record.flatten());
        }
        if self.asked.only_cases || stop.is_asked() {
            return Ok(());
        }
        let skipping = log.once(&format!("{name}/skipping"), || {
            sample(&mut samples, CaseBasis::Linear)?;
            match &samples[CaseBasis::Linear as usize] {
                Some(sample) => {
                    Comparison { patience: &self.bench.patience, source, sample, rows: self.rows }.run()
                }
                None => Ok(Vec::new()),
            }
        })?;
        found.skipping.extend(skipping.unwrap_or_default());
        let quick = self.asked.level == Level::Quick;
        let scaling = ScalingSweeps { patience: self.bench.patience.clone(), source, quick };
        let mut begin = |over: &str| observer.begins(&Step { name: over, within: &name, parts: None });
        found.scaling.extend(scaling.run(log, &mut begin)?);
        Ok(())
    }

    fn findings(&self, found: SceneResults, engine: &Engine, before: &[Counts]) -> report::Bench {
        let complete = !self.asked.stop.is_asked();
        let mut laws = laws::laws(&found.records, &found.skipping);
        laws.extend(counts::laws(before, &found.records, complete));
        report::Bench {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command: self.asked.command.clone(),
            machine: processor(),
            threads: rayon::current_num_threads(),
            adapter: adapter(engine),
            most_rows: self.rows,
            complete,
            held: Held { hold: laws.iter().filter(|law| law.holds).count(), of: laws.len() },
            laws,
            against: report::compare(&found.records),
            records: found.records,
            scaling: found.scaling,
            pictures: found.pictures,
            skipping: found.skipping,
        }
    }
}

/// What computes: the processor, an adapter, or both.
fn places(engine: &Engine, asked: Backend) -> Vec<CaseBackend> {
    #[cfg(feature = "gpu")]
    match (engine, asked) {
        (Engine::Gpu { .. }, Backend::Gpu) => return vec![CaseBackend::Gpu],
        (Engine::Gpu { .. }, _) => return vec![CaseBackend::Cpu, CaseBackend::Gpu],
        _ => {}
    }
    let _only_the_processor = (engine, asked);
    vec![CaseBackend::Cpu]
}

/// The adapter in words.
fn adapter(engine: &Engine) -> Option<String> {
    match engine {
        #[cfg(feature = "gpu")]
        Engine::Gpu { gpu, .. } => Some(crate::job::device(gpu.record())),
        Engine::Cpu => None,
    }
}

/// Tells runs apart that measure different things: their records are not to be mixed.
fn fingerprint(sources: &[SceneSource], session: &Session<'_>) -> Result<u64> {
    let mut hasher = DefaultHasher::new();
    for source in sources {
        source.name().hash(&mut hasher);
        source.bytes().hash(&mut hasher);
    }
    let names: Vec<String> =
        cases(session.asked.level, &session.places, [true; 2]).iter().map(Contender::name).collect();
    let is_quick = session.asked.level == Level::Quick;
    (env!("CARGO_PKG_VERSION"), names, session.rows, is_quick, session.asked.pictures).hash(&mut hasher);
    (rayon::current_num_threads(), processor()).hash(&mut hasher);
    Ok(hasher.finish())
}
