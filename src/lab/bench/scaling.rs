//! How seconds and memory grow with one thing, all else as it was.

use std::collections::BTreeMap;
use std::time::Instant;

use super::log::Log;
use super::measure::Patience;
use super::subject::{self, SceneSource};
use crate::job::{AskedProblem, Scenes};
use crate::operator::{TransportOperator, Vector};
use crate::problem::{Problem, evenly};
use crate::report::bench::{Sweep, SweepPoint};
use crate::scene::{Find, Rgb, Strategy, VolumeScene};
use crate::{Error, Result};

/// Rows that are measured at most, all told.
const ROWS: usize = 32_768;
const FEW_ROWS: usize = 2048;
/// Texels along a side of a shadow map at least, as scene files have it.
const LEAST_SIDE: usize = 64;

/// Measures how the cost of a scene grows.
pub(super) struct ScalingSweeps<'a> {
    pub(super) patience: Patience,
    pub(super) source: &'a SceneSource,
    pub(super) quick: bool,
}

/// What grows.
enum Grows {
    /// The rows, to these parts of them all.
    Rows,
    /// The views that the rows are of, one after the other.
    Views,
    Threads,
    /// A size, which an override of the scene sets.
    Setting(Vec<(f64, String)>),
}

/// What grows, in words, and what does not.
struct SweepPlan {
    over: &'static str,
    held: &'static str,
    grows: Grows,
}

impl ScalingSweeps<'_> {
    /// All sweeps that make sense for the scene.
    pub(super) fn run(&self, log: &mut Log, begin: &mut dyn FnMut(&str)) -> Result<Vec<Sweep>> {
        let scenes = self.source.load(&[])?;
        let name = self.source.name();
        let mut sweeps = Vec::new();
        for plan in self.plans(&scenes) {
            if self.patience.stop.is_asked() {
                break;
            }
            begin(plan.over);
            // Points of one sweep are compared, so they are measured in one go.
            let points = log.once(&format!("{name}/scaling/{}", plan.over), || self.points(&plan.grows))?;
            let Some(points) = points.filter(|points| points.len() > 1) else { continue };
            sweeps.push(Sweep::new(&name, plan.over, &held(&plan, &points), points));
        }
        Ok(sweeps)
    }

    /// What is made of each, until somebody stops it.
    fn each<T, U>(
        &self,
        values: impl IntoIterator<Item = T>,
        make: impl FnMut(T) -> Result<U>,
    ) -> Result<Vec<U>> {
        values.into_iter().take_while(|_| !self.patience.stop.is_asked()).map(make).collect()
    }

    fn points(&self, grows: &Grows) -> Result<Vec<SweepPoint>> {
        match grows {
            Grows::Rows => self.over_rows(),
            Grows::Views => self.over_views(),
            Grows::Threads => self.over_threads(),
            Grows::Setting(sizes) => self.over_setting(sizes),
        }
    }

    /// The problem is made of all rows, however many are measured; so there are no seconds of making it.
    fn over_rows(&self) -> Result<Vec<SweepPoint>> {
        let problem = subject::problem(&self.source.load(&[])?)?.problem.sampled(self.most());
        self.each(self.shares(problem.rows()), |rows| self.point(rows as f64, None, problem.sampled(rows)))
    }

    /// As many rows of each view. Making the problem is timed with a scene of these views alone, each as it is painted. All else is
    /// measured with rows of the whole scene, through the same maps or medium.
    fn over_views(&self) -> Result<Vec<SweepPoint>> {
        let whole = subject::problem(&self.source.load(&[])?)?.problem;
        let mut rows = BTreeMap::<usize, Vec<usize>>::new();
        for row in 0..whole.rows() {
            rows.entry(whole.pixel(row)[0]).or_default().push(row);
        }
        let fewest = rows.values().map(Vec::len).min().unwrap_or(0);
        let each_view = fewest.min(self.most() / rows.len().max(1));
        self.each(self.shares(rows.len()), |count| {
            let views: Vec<usize> = rows.keys().copied().take(count).collect();
            let (_, seconds) = made(&subject::of_views(self.source.load(&[])?, &views))?;
            let some =
                |of: &Vec<usize>| evenly(each_view, of.len()).into_iter().map(|index| of[index]).collect();
            let picked: Vec<Vec<usize>> = rows.values().take(count).map(some).collect();
            self.point(count as f64, Some(seconds), whole.picked(&picked.concat()))
        })
    }

    fn over_threads(&self) -> Result<Vec<SweepPoint>> {
        let most = rayon::current_num_threads();
        let powers = (0..).map(|power| 1usize << power).take_while(|&threads| threads < most);
        self.each(powers.chain([most]), |threads| {
            with_threads(threads, || {
                let (problem, seconds) = made(&self.source.load(&[])?)?;
                self.point(threads as f64, Some(seconds), problem.sampled(self.most()))
            })
        })
    }

    /// Fewer voxels may be in fewer rows; of all sizes as many are measured as there are at the size with the fewest.
    fn over_setting(&self, sizes: &[(f64, String)]) -> Result<Vec<SweepPoint>> {
        let all = self.each(sizes, |(size, setting)| {
            let (problem, seconds) = made(&self.source.load(std::slice::from_ref(setting))?)?;
            Ok((*size, seconds, problem.sampled(self.most())))
        })?;
        let fewest = all.iter().map(|(.., problem)| problem.rows()).min().unwrap_or(0);
        self.each(all, |(size, seconds, problem)| self.point(size, Some(seconds), problem.sampled(fewest)))
    }

    fn point(
        &self,
        size: f64,
        problem_seconds: Option<f64>,
        mut problem: Box<dyn Problem>,
    ) -> Result<SweepPoint> {
        let clock = Instant::now();
        problem.replan();
        let planning = clock.elapsed().as_secs_f64();
        let (times, bytes) = self.cost(|| problem.on_cpu(Strategy::Assembled, u64::MAX))?;
        Ok(SweepPoint {
            size,
            rows: problem.rows() as u64,
            problem_seconds,
            set_up_seconds: planning + times[0],
            seconds: times[1],
            bytes: bytes + (problem.candidates() * size_of::<Rgb>()) as u64 + problem.prepared_bytes(),
        })
    }

    /// Seconds of set-up and of both products, and bytes of the operator and of a vector of each kind.
    fn cost<O: TransportOperator>(&self, make: impl Fn() -> Result<O>) -> Result<([f64; 2], u64)> {
        let (operator, times) = self.patience.times(make)?;
        let vectors = operator.domain().len() + operator.range().len();
        let bytes = operator.storage().bytes + (vectors * size_of::<Rgb>()) as u64;
        Ok(([times.set_up, times.forward + times.backward], bytes))
    }

    fn most(&self) -> usize {
        if self.quick { FEW_ROWS } else { ROWS }
    }

    /// What the full size is divided by, point by point.
    fn parts(&self) -> &'static [usize] {
        if self.quick { &[4, 1] } else { &[8, 4, 2, 1] }
    }

    /// The sizes of a sweep over so many, the full one last.
    fn shares(&self, all: usize) -> Vec<usize> {
        let mut shares: Vec<usize> = self.parts().iter().map(|part| (all / part).max(1)).collect();
        shares.dedup();
        shares
    }

    fn plans(&self, scenes: &Scenes) -> Vec<SweepPlan> {
        let plan = |over, held, grows| SweepPlan { over, held, grows };
        match scenes {
            Scenes::Animation(_) | Scenes::LightAnimation(_) => Vec::new(),
            Scenes::LightMap(scene) => vec![
                plan("painted pixels", "both maps", Grows::Rows),
                plan("views", "both maps", Grows::Views),
                plan("threads", "both maps", Grows::Threads),
                plan(
                    "light-map texels",
                    "its place, the shadow map",
                    self.maps("light_map", scene.light_map.size, 4),
                ),
                plan(
                    "shadow-map texels",
                    "its place, the light map",
                    self.maps("shadow_map", scene.shadow_map.size, LEAST_SIDE),
                ),
            ],
            Scenes::Volume(scene) => {
                let mut plans = vec![
                    plan("painted pixels", "the volume", Grows::Rows),
                    plan("views", "the volume", Grows::Views),
                    plan("threads", "the volume", Grows::Threads),
                ];
                let voxels = self.voxels(scene.medium.extinction.grid().size());
                if voxels.first().is_some_and(|smallest| self.has_voxels(smallest)) {
                    plans.push(plan("voxels", "their box", Grows::Setting(voxels)));
                }
                if scene.stages.first() == Some(&Find::Environment) {
                    let count = |part: &usize| 256 / part;
                    let set = |count| (count as f64, format!("environment.lights={{\"count\":{count}}}"));
                    let sizes = self.parts().iter().map(count).map(set).collect();
                    plans.push(plan("lights", "the volume", Grows::Setting(sizes)));
                }
                plans
            }
        }
    }

    /// A map with its sides divided, from as long as that leaves sides that scenes may have.
    fn maps(&self, name: &str, sides: [usize; 2], least: usize) -> Grows {
        let longest = self.parts().iter().copied().max().unwrap_or(1);
        let one = |part: &usize| {
            let [w, h] = sides.map(|side| side.max(least * longest) / part);
            ((w * h) as f64, format!("{name}.size=[{w},{h}]"))
        };
        Grows::Setting(self.parts().iter().map(one).collect())
    }

    /// A volume with its sides made so much shorter that it has a part of its voxels.
    fn voxels(&self, size: [usize; 3]) -> Vec<(f64, String)> {
        let one = |part: &usize| {
            let factor = (*part as f64).powf(-1.0 / 3.0);
            let [x, y, z] = size.map(|side| ((side as f64 * factor).round() as usize).max(1));
            ((x * y * z) as f64, format!("volume.size=[{x},{y},{z}]"))
        };
        self.parts().iter().map(one).collect()
    }
    /// Whether a scene has as many voxels as it is asked for; a file has its own number.
    fn has_voxels(&self, (count, setting): &(f64, String)) -> bool {
        let scenes = self.source.load(std::slice::from_ref(setting));
        let has = |scene: &VolumeScene| scene.medium.extinction.grid().len() as f64 == *count;
        scenes.is_ok_and(|scenes| matches!(&scenes, Scenes::Volume(scene) if has(scene)))
    }
}

/// What a sweep holds, in words.
fn held(plan: &SweepPlan, points: &[SweepPoint]) -> String {
    let Some(first) = points.first() else { return plan.held.to_owned() };
    let rows = match plan.grows {
        Grows::Rows => return format!("{}; the problem is made of all of them", plan.held),
        Grows::Views => format!("{} rows a view", first.rows / first.size as u64),
        _ => format!("{} rows", first.rows),
    };
    format!("{rows}, {}", plan.held)
}

/// The problem, and the seconds that making it takes once there is a hierarchy.
fn made(scenes: &Scenes) -> Result<(Box<dyn Problem>, f64)> {
    let AskedProblem { problem, seconds, .. } = subject::problem(scenes)?;
    Ok((problem, seconds))
}

fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|error| Error::Machine(format!("cannot start {threads} threads: {error}")))?.install(work)
}
