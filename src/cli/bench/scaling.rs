//! How seconds and memory grow with one thing, all else as it was.

use std::time::Instant;

use super::log::Log;
use super::measure::Patience;
use super::subject::{Problem, Source, Stage};
use crate::cli::progress::interrupted;
use crate::operator::Vector;
use crate::problem::TransportOperator;
use crate::report::bench::{Point, Sweep};
use crate::scene::{Find, Rgb, Strategy};
use crate::{Error, Result};

/// Rows that are measured at most, all told.
const ROWS: usize = 32_768;
const FEW_ROWS: usize = 2048;
/// Texels along a side of a shadow map at least, as scene files have it.
const LEAST_SIDE: usize = 64;

/// Measures how the cost of a scene grows.
pub(super) struct Scaling<'a> {
    pub(super) patience: Patience,
    pub(super) source: &'a Source,
    pub(super) quick: bool,
}

/// A scene with one size changed: what the size is, and what makes it so.
type Sized<'a> = (f64, Box<dyn Fn() -> Result<Stage> + Sync + 'a>);

impl Scaling<'_> {
    /// All sweeps that make sense for the scene.
    pub(super) fn run(&self, log: &mut Log, begin: &mut dyn FnMut(&str)) -> Result<Vec<Sweep>> {
        let stage = self.source.load(&[])?;
        let mut sweeps = Vec::new();
        for (over, sizes) in self.sizes(&stage) {
            begin(over);
            let mut points = Vec::new();
            let largest = sizes.last().map_or(1.0, |(size, _)| *size);
            for (size, make) in sizes {
                if interrupted() {
                    return Ok(sweeps);
                }
                let case = format!("{}/scaling/{over}/{size}", self.source.name());
                let most = if self.quick { FEW_ROWS } else { ROWS };
                points.push(log.once(&case, || match over {
                    // What stands for the size is the part of them that is taken.
                    "painted pixels" => {
                        let point = self.point(size, &make()?, most, size as usize)?;
                        Ok(Point { size: point.rows as f64, ..point })
                    }
                    // More views have more painted pixels; that is what is asked about.
                    "views" => self.point(size, &make()?, (most as f64 * size / largest) as usize, 1),
                    "threads" => with_threads(size as usize, || self.point(size, &make()?, most, 1)),
                    _ => self.point(size, &make()?, most, 1),
                })?);
            }
            if points.len() > 1 {
                sweeps.push(Sweep::new(&self.source.name(), over, points));
            }
        }
        Ok(sweeps)
    }

    /// Measures one in `part` of at most so many rows.
    fn point(&self, size: f64, stage: &Stage, most: usize, part: usize) -> Result<Point> {
        let clock = Instant::now();
        let problem = stage.problem()?;
        let problem_seconds = clock.elapsed().as_secs_f64();
        let mut sample = problem.sampled(most).sampled(problem.len().min(most) / part);
        let clock = Instant::now();
        sample.replan();
        let planning = clock.elapsed().as_secs_f64();
        let (times, bytes) = match &sample {
            Problem::LightMap(p) => self.cost(|| p.operator_with(Strategy::Assembled, u64::MAX))?,
            Problem::Volume(_, p) => self.cost(|| p.operator(Strategy::Assembled, u64::MAX))?,
        };
        Ok(Point {
            size,
            rows: sample.len() as u64,
            problem_seconds,
            set_up_seconds: planning + times[0],
            seconds: times[1],
            bytes: bytes + sample.scene_bytes(),
        })
    }

    /// Seconds of set-up and of both products, and bytes of the operator and of a vector of each kind.
    fn cost<O: TransportOperator>(&self, make: impl Fn() -> Result<O>) -> Result<([f64; 2], u64)> {
        let (operator, times) = self.patience.times(make)?;
        let vectors = operator.domain().len() + operator.range().len();
        let bytes = operator.storage().bytes + (vectors * size_of::<Rgb>()) as u64;
        Ok(([times.set_up, times.forward + times.backward], bytes))
    }

    /// What grows, and to what.
    fn sizes(&self, stage: &Stage) -> Vec<(&'static str, Vec<Sized<'_>>)> {
        let parts: &[usize] = if self.quick { &[4, 1] } else { &[8, 4, 2, 1] };
        let rows = parts.iter().map(|&part| self.with(part as f64, Vec::new()));
        let mut sweeps = vec![
            ("painted pixels", rows.collect()),
            ("views", self.views(stage)),
            ("threads", self.threads()),
        ];
        match stage {
            Stage::LightMap(scene) => {
                let (light, shadow) = (scene.light_map.size, scene.shadow_map.size);
                sweeps.push(("light-map texels", self.maps("light_map", light, 4, parts)));
                sweeps.push(("shadow-map texels", self.maps("shadow_map", shadow, LEAST_SIDE, parts)));
            }
            Stage::Volume(scene) => {
                let size = scene.medium.extinction.grid().size();
                sweeps.push(("voxels", parts.iter().map(|&part| self.voxels(size, part)).collect()));
                if scene.stages.first() == Some(&Find::Environment) {
                    let counts = parts.iter().map(|part| 256 / part);
                    let with = |count: usize| {
                        self.with(count as f64, vec![format!("environment.lights={{\"count\":{count}}}")])
                    };
                    sweeps.push(("lights", counts.map(with).collect()));
                }
            }
        }
        sweeps
    }

    fn with(&self, size: f64, overrides: Vec<String>) -> Sized<'_> {
        (size, Box::new(move || self.source.load(&overrides)))
    }

    /// A map with its sides divided, from as long as that leaves sides that scenes may have.
    fn maps(&self, name: &str, sides: [usize; 2], least: usize, parts: &[usize]) -> Vec<Sized<'_>> {
        let longest = parts.iter().copied().max().unwrap_or(1);
        let one = |part: &usize| {
            let [w, h] = sides.map(|side| side.max(least * longest) / part);
            self.with((w * h) as f64, vec![format!("{name}.size=[{w},{h}]")])
        };
        parts.iter().map(one).collect()
    }

    /// A volume with its sides made so much shorter that it has a part of its voxels.
    fn voxels(&self, size: [usize; 3], part: usize) -> Sized<'_> {
        let factor = (part as f64).powf(-1.0 / 3.0);
        let [x, y, z] = size.map(|side| ((side as f64 * factor).round() as usize).max(1));
        self.with((x * y * z) as f64, vec![format!("volume.size=[{x},{y},{z}]")])
    }

    /// The first view, the first two, …
    fn views(&self, stage: &Stage) -> Vec<Sized<'_>> {
        let count = match stage {
            Stage::LightMap(scene) => scene.views.len(),
            Stage::Volume(scene) => scene.views.len(),
        };
        let step = count.div_ceil(if self.quick { 2 } else { 4 }).max(1);
        let counts = (1..=count).filter(|views| views % step == 0 || *views == count);
        let one = |views: usize| -> Sized<'_> {
            let make = move || {
                let mut stage = self.source.load(&[])?;
                match &mut stage {
                    Stage::LightMap(scene) => scene.views.truncate(views),
                    Stage::Volume(scene) => scene.views.truncate(views),
                }
                Ok(stage)
            };
            (views as f64, Box::new(make))
        };
        counts.map(one).collect()
    }

    fn threads(&self) -> Vec<Sized<'_>> {
        let most = rayon::current_num_threads();
        let powers = (0..).map(|power| 1usize << power).take_while(|&threads| threads < most);
        powers.chain([most]).map(|threads| self.with(threads as f64, Vec::new())).collect()
    }
}

fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|error| Error::Machine(format!("cannot start {threads} threads: {error}")))?.install(work)
}
