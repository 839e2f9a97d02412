//! The thread that solves: it makes changes of strokes, goes on from where the light map is, and sends pictures as they improve.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError};
use std::time::{Duration, Instant};

use tokio::sync::broadcast;

use super::document::{Change, Document, Saved, Strokes};
use super::messages::{Asked, Kind, News, Phase, Sent, Stage, Told, ViewRecord, Wish, hex, picture};
use crate::io::image::rgba_bytes;
use crate::io::scene_file::{Extent, Paint, SceneFile};
use crate::job::{
    EngineChoice, Job, LiveJob, LivePictures, Observer, Options, Preview, Quiet, Scenes, Step, Stop, readable,
};
use crate::scene::{Image, Rgb, Scene};
use crate::{Error, Result};

/// How long the pen rests before the full resolution follows.
const REST: Duration = Duration::from_millis(250);
/// How often to look whether somebody wants to stop, and whether another program has changed the scene.
const LOOK: Duration = Duration::from_millis(500);
/// Pictures of a preview follow each other at least so far apart, once the first is there.
const APART: Duration = Duration::from_millis(120);
/// Preview widths in pixels, from the finest that is tried to the coarsest.
const WIDTHS: [usize; 4] = [320, 240, 160, 96];
/// Iterations between two pictures at most.
const MOST: usize = 8;
/// Brush colours beside those of a scene; pages have white and black.
const PALETTE: [&str; 7] = ["#ffb347", "#ff7a2f", "#e0352b", "#c030f0", "#2f6bff", "#20b8d8", "#40c060"];

/// What the worker is told to do.
pub(super) enum Order {
    /// A page is there; its number.
    Joined(u64),
    Left(u64),
    Asked(u64, Asked),
    /// A solve of the full pictures has ended, for the strokes of that number.
    Full(u64, Result<Full>),
    Exporting(String, Option<f64>),
    Exported(Result<PathBuf>),
}

/// What the command finds: its pictures.
pub(super) struct Full {
    views: Vec<Image>,
    /// Relative to the light.
    light_map: Image,
    iterations: usize,
    gradient: f64,
    met: Option<f64>,
    /// What stands in the way of the paint.
    remarks: Vec<String>,
}

/// What is at hand when the studio opens.
#[derive(Debug, Clone)]
pub(super) struct Setting {
    pub(super) path: PathBuf,
    pub(super) overrides: Vec<String>,
    pub(super) engine: EngineChoice,
    pub(super) folder: PathBuf,
}

pub(super) struct Worker {
    setting: Setting,
    document: Document,
    scene: Scene,
    live: LiveJob,
    records: Vec<ViewRecord>,
    palette: Vec<String>,
    /// Threads that leave one core to the browser.
    few: Option<rayon::ThreadPool>,
    /// Threads that work when no other do, for the full resolution: the next stroke does not wait until they have heard of it.
    patient: Option<Arc<rayon::ThreadPool>>,
    orders: Receiver<Order>,
    mine: Sender<Order>,
    pages: broadcast::Sender<Sent>,
    watched: HashMap<u64, Vec<Kind>>,
    /// What all pictures are brightened by.
    exposure: f64,
    is_pen_down: bool,
    state: State,
    /// Counts pictures, and changes of strokes.
    serial: u64,
    changes: u64,
    /// The change up to which the preview has followed.
    followed: u64,
    /// What pictures are brightened by at first.
    readable: f64,
    full: Option<Full>,
    solving: Option<Stop>,
    exporting: Option<Stop>,
    began: Instant,
    last_picture: Instant,
    is_told_of_change: bool,
    /// Whether the light map lies elsewhere than when pages saw all pictures last.
    is_moved: bool,
    /// How far the solve was when pages were told last.
    standing: Option<Standing>,
    /// What the first page is told.
    news: Vec<(News, String)>,
}

/// What has changed since pictures were sent.
#[derive(Clone, Copy, PartialEq)]
enum Changes {
    /// The light map.
    Light,
    /// The paint, and the light map with it.
    Paint,
    /// What pages show, or how bright.
    All,
}

impl Changes {
    fn reach(self, kind: Kind) -> bool {
        match kind {
            Kind::After | Kind::Difference | Kind::LightMap => true,
            Kind::Target => self != Self::Light,
            Kind::Before | Kind::Coverage => self == Self::All,
        }
    }
}

/// How far a solve is, as pages know it.
#[derive(Clone, Copy)]
struct Standing {
    phase: Phase,
    iteration: usize,
    gradient: f64,
    met: Option<f64>,
    at: Duration,
}

/// How far the preview is.
#[derive(Clone, Copy, PartialEq)]
enum State {
    /// It goes on, with so many iterations next.
    Improving(usize),
    /// It is done since then; the full resolution follows when the pen rests.
    Rests(Instant),
    /// The full resolution is under way or there, or nothing is to do.
    Still,
}

impl Worker {
    /// Reads the scene, and keeps the rows of its previews.
    ///
    /// Errors: those of reading a scene; [`Error::Empty`] for one without a light map; [`Error::TooLarge`] where not even the coarsest
    /// preview fits; those of [`Document::open`].
    pub(super) fn open(
        setting: Setting,
        text: String,
        (orders, mine): (Receiver<Order>, Sender<Order>),
        pages: broadcast::Sender<Sent>,
    ) -> Result<Self> {
        let mut news = Vec::new();
        // What is wrong in a scene is told with its place, and before anything is written beside it.
        let (job, scene) = (setting.job(&text)?, setting.scene(&text)?);
        let (document, brought_back, set_aside) = Document::open(&setting.path, text)?;
        if brought_back > 0 {
            let text = format!("{brought_back} changes that were not saved have been brought back");
            news.push((News::Done, text));
        }
        if let Some(path) = set_aside {
            let text = format!(
                "the scene was changed after strokes that were never saved; those are kept in {}",
                path.display()
            );
            news.push((News::Warning, text));
        }
        if scene.surroundings.is_some() {
            return Err(Error::Empty {
                reason: "the studio shows no lights around a scene that are looked for".to_owned(),
                remedy: "leave `surroundings` away while you paint",
            });
        }
        let (live, width) = warm(&job, &setting)?;
        if width < WIDTHS[0] {
            let text = format!("previews are {width} pixels wide, finer ones would exceed solve.memory");
            news.push((News::Warning, text));
        }
        let records = scene.views.iter().map(|view| {
            let (name, size) = (view.name.clone(), view.camera.size());
            Ok(ViewRecord { preview: live.size(&name)?, name, size })
        });
        let records = records.collect::<Result<Vec<_>>>()?;
        let cores = std::thread::available_parallelism().map_or(1, Into::into);
        let few = rayon::ThreadPoolBuilder::new().num_threads(cores.saturating_sub(1).max(1)).build().ok();
        let now = Instant::now();
        let mut worker = Self {
            palette: palette(&document),
            setting,
            document,
            scene,
            live,
            records,
            few,
            patient: patient_threads(),
            orders,
            mine,
            pages,
            watched: HashMap::new(),
            exposure: 1.0,
            is_pen_down: false,
            state: State::Improving(1),
            serial: 0,
            changes: 0,
            followed: 0,
            readable: 1.0,
            full: None,
            solving: None,
            exporting: None,
            began: now,
            last_picture: now,
            is_told_of_change: false,
            is_moved: false,
            standing: None,
            news,
        };
        let views = if brought_back > 0 { worker.records.len() } else { 0 };
        for view in 0..views {
            if let Err(problem) = worker.repaint(view, &worker.document.strokes()[view].clone()) {
                let name = &worker.records[view].name;
                worker.news.push((News::Warning, format!("not all paint of `{name}` is seen: {problem}")));
            }
        }
        worker.readable = worker.readable()?;
        worker.exposure = worker.readable;
        Ok(worker)
    }

    /// Works until somebody asks to stop, or nobody can give orders any more.
    pub(super) fn work(mut self, stop: &Stop) {
        while !stop.is_asked() {
            match self.next() {
                Ok(Some(order)) => self.obey(order),
                Ok(None) => {}
                Err(()) => break,
            }
            match self.state {
                State::Improving(iterations) => self.improve(iterations),
                State::Rests(since) if since.elapsed() >= REST && !self.is_pen_down => self.begin_full(),
                _ => {}
            }
        }
        self.solving.iter().chain(&self.exporting).for_each(|stop| {
            stop.ask();
        });
    }

    /// The next order: at once where there is something to do meanwhile.
    fn next(&mut self) -> std::result::Result<Option<Order>, ()> {
        let wait = match self.state {
            State::Improving(_) => {
                return match self.orders.try_recv() {
                    Ok(order) => Ok(Some(order)),
                    Err(TryRecvError::Empty) => Ok(None),
                    Err(TryRecvError::Disconnected) => Err(()),
                };
            }
            State::Rests(since) => REST.saturating_sub(since.elapsed()).max(Duration::from_millis(5)),
            State::Still => LOOK,
        };
        match self.orders.recv_timeout(wait) {
            Ok(order) => Ok(Some(order)),
            Err(RecvTimeoutError::Timeout) => {
                self.look_at_the_file();
                Ok(None)
            }
            Err(RecvTimeoutError::Disconnected) => Err(()),
        }
    }

    fn obey(&mut self, order: Order) {
        match order {
            Order::Joined(page) => {
                self.watched.insert(page, vec![Kind::After]);
                self.greet();
            }
            Order::Left(page) => {
                self.watched.remove(&page);
                // It may have left in the middle of a stroke.
                self.is_pen_down = false;
            }
            Order::Asked(_, Asked::Change(change)) => self.change(&change),
            Order::Asked(page, Asked::Wish(wish)) => self.grant(page, wish),
            Order::Full(changes, found) => self.take_full(changes, found),
            Order::Exporting(text, part) => self.tell(&Told::Exporting { text, part, is_running: true }),
            Order::Exported(written) => self.take_export(written),
        }
    }

    fn grant(&mut self, page: u64, wish: Wish) {
        match wish {
            Wish::Pen { down } => self.is_pen_down = down,
            Wish::Save => self.save(),
            Wish::Export => self.export(),
            Wish::Cancel => self.exporting.iter().for_each(|stop| {
                stop.ask();
            }),
            Wish::Fit => self.fit(),
            Wish::Exposure { value } if value.is_finite() && value > 0.0 => {
                self.exposure = value;
                self.show(Changes::All);
            }
            Wish::Exposure { .. } => {
                self.notice(News::Error, "the exposure must be a number above 0".to_owned())
            }
            Wish::Watch { pictures } => {
                self.watched.insert(page, pictures);
                self.show(Changes::All);
            }
            Wish::Reach { view, x, y } => self.reach(view, [x, y]),
        }
    }

    fn tell(&self, told: &Told<'_>) {
        // Where nobody listens nobody needs to be told.
        _ = self.pages.send(told.sent());
    }

    fn notice(&self, kind: News, text: String) {
        self.tell(&Told::Notice { kind, text });
    }

    fn greet(&mut self) {
        self.tell(&Told::Hello {
            scene: &self.scene.name,
            path: self.setting.path.display().to_string(),
            version: env!("CARGO_PKG_VERSION"),
            views: &self.records,
            exposure: self.readable,
            palette: &self.palette,
        });
        self.tell_strokes();
        for (kind, text) in std::mem::take(&mut self.news) {
            self.notice(kind, text);
        }
        self.show(Changes::All);
        self.tell_progress();
    }

    fn tell_strokes(&self) {
        let views = self.document.strokes().iter();
        self.tell(&Told::Strokes {
            views: views.map(|strokes| strokes.iter().map(|stroke| &**stroke).collect()).collect(),
            revision: self.changes,
            can_undo: self.document.can_undo(),
            can_redo: self.document.can_redo(),
            is_saved: self.document.is_saved(),
        });
    }

    /// Paints a preview anew.
    fn repaint(&mut self, view: usize, strokes: &Strokes) -> std::result::Result<(), String> {
        let ViewRecord { name, size, .. } = &self.records[view];
        let built = strokes.iter().map(|stroke| stroke.on(*size)).collect::<std::result::Result<_, _>>()?;
        self.live.repaint(name, built).map_err(|error| error.to_string())
    }

    fn change(&mut self, change: &Change) {
        let Some((view, strokes)) = self.document.after(change) else {
            self.tell_strokes();
            return;
        };
        if let Err(problem) = self.repaint(view, &strokes) {
            self.notice(News::Error, format!("that stroke cannot be: {problem}"));
            self.tell_strokes();
            return;
        }
        if let Err(error) = self.document.make(change, (view, strokes)) {
            self.notice(News::Error, format!("the journal cannot be written, so save often: {error}"));
        }
        self.changes += 1;
        self.full = None;
        self.solving.take().iter().for_each(|stop| {
            stop.ask();
        });
        self.began = Instant::now();
        self.state = State::Improving(1);
        self.tell_strokes();
    }

    /// Goes on with the preview, and shows what has come of it.
    fn improve(&mut self, iterations: usize) {
        if self.document.strokes().iter().all(Vec::is_empty) && self.is_bare() {
            self.live.begin_anew();
            self.followed = self.changes;
            self.state = State::Still;
            self.show(Changes::Paint);
            self.progress(Phase::NothingPainted, 0, f64::NAN, None);
            return;
        }
        let live = &mut self.live;
        let advanced = match &self.few {
            Some(few) if self.is_pen_down => few.install(|| live.advance(iterations)),
            _ => live.advance(iterations),
        };
        let standing = match advanced {
            Ok(standing) => standing,
            Err(error) => {
                self.state = State::Still;
                self.notice(News::Error, error.to_string());
                return;
            }
        };
        self.followed = self.changes;
        let is_done = standing.stop != crate::solve::StopReason::Iterations
            || standing.iterations >= self.scene.solve.iterations;
        self.state =
            if is_done { State::Rests(Instant::now()) } else { State::Improving((2 * iterations).min(MOST)) };
        let is_first = standing.iterations <= 1;
        if is_first || is_done || self.last_picture.elapsed() > APART {
            let changes = match (std::mem::take(&mut self.is_moved), is_first) {
                (true, _) => Changes::All,
                (false, true) => Changes::Paint,
                (false, false) => Changes::Light,
            };
            let met = self.show(changes);
            let gradient = standing.gradient.iter().copied().fold(0.0, f64::max);
            self.progress(Phase::Preview, standing.iterations, gradient, met);
        }
    }

    /// Whether no view has layers that are paint.
    fn is_bare(&self) -> bool {
        self.scene.views.iter().all(|view| view.layers.is_empty())
    }

    fn progress(&mut self, phase: Phase, iteration: usize, gradient: f64, met: Option<f64>) {
        // JSON knows no NaN.
        let gradient = if gradient.is_finite() { gradient } else { 1.0 };
        self.standing = Some(Standing { phase, iteration, gradient, met, at: self.began.elapsed() });
        self.tell_progress();
    }

    fn tell_progress(&self) {
        let Some(Standing { phase, iteration, gradient, met, at }) = self.standing else { return };
        let remarks = self.full.as_ref().map_or(&[][..], |full| &full.remarks);
        self.tell(&Told::Progress { phase, iteration, gradient, met, seconds: at.as_secs_f64(), remarks });
    }

    fn watches(&self, kind: Kind) -> bool {
        self.watched.values().any(|kinds| kinds.contains(&kind))
    }

    /// Sends the pictures that have changed, of those that some page shows; the share of the paint that is met.
    fn show(&mut self, changes: Changes) -> Option<f64> {
        self.last_picture = Instant::now();
        match self.shown(changes) {
            Ok(met) => met,
            Err(error) => {
                self.notice(News::Error, error.to_string());
                None
            }
        }
    }

    fn shown(&mut self, changes: Changes) -> Result<Option<f64>> {
        let kinds: Vec<Kind> =
            [Kind::After, Kind::Before, Kind::Target, Kind::Difference, Kind::Coverage, Kind::LightMap]
                .into_iter()
                .filter(|&kind| self.watches(kind) && changes.reach(kind))
                .collect();
        let (exposure, views) = (self.exposure, self.records.len());
        let mut all = Vec::new();
        let light_map =
            if kinds.contains(&Kind::LightMap) { Some(self.preview_of_light_map()?) } else { None };
        let full = self.full.take();
        let pictures = self.live.pictures()?;
        let met = pictures.met();
        for &kind in &kinds {
            if kind == Kind::LightMap {
                let (stage, map) = match (&full, &light_map) {
                    (Some(full), _) => (Stage::Full, &full.light_map),
                    (None, Some(map)) => (Stage::Preview, map),
                    _ => continue,
                };
                all.push((kind, None, stage, map.size(), rgba_bytes(map, 1.0)));
                continue;
            }
            for view in 0..views {
                let (stage, size, bytes) = match (&full, kind) {
                    (Some(full), Kind::After) => {
                        let shown = &full.views[view];
                        (Stage::Full, shown.size(), rgba_bytes(shown, exposure))
                    }
                    _ => preview_of(&pictures, kind, view, exposure),
                };
                all.push((kind, Some(view), stage, size, bytes));
            }
        }
        drop(pictures);
        self.full = full;
        for (kind, view, stage, size, bytes) in all {
            self.serial += 1;
            _ = self.pages.send(picture((kind, view), (stage, self.serial, self.followed), size, &bytes));
        }
        Ok(met)
    }

    fn preview_of_light_map(&self) -> Result<Image> {
        Ok(relative(&self.live.light_map()?, self.scene.light.radiance))
    }

    /// How much pictures are brightened at first: as files are.
    fn readable(&mut self) -> Result<f64> {
        if let Some(stops) = self.scene.exposure {
            return Ok(stops.exp2());
        }
        let views = self.records.len();
        let pictures = self.live.pictures()?;
        Ok(readable((0..views).map(|view| pictures.before(view))).exp2())
    }

    fn reach(&mut self, view: usize, [x, y]: [f64; 2]) {
        let Some(ViewRecord { size, preview, .. }) = self.records.get(view).cloned() else { return };
        let at = [0, 1].map(|axis| {
            let along = [x, y][axis] * preview[axis] as f64 / size[axis] as f64;
            (along.max(0.0) as usize).min(preview[axis] - 1)
        });
        match self.live.pictures() {
            Ok(pictures) => {
                let color = hex(pictures.tint(view, at));
                drop(pictures);
                self.tell(&Told::Reached { view, x, y, color });
            }
            Err(error) => self.notice(News::Error, error.to_string()),
        }
    }

    fn save(&mut self) {
        match self.document.save(&extent(&self.live)) {
            Ok(Saved::Whole) => {
                self.notice(News::Done, format!("saved in {}", self.setting.path.display()));
            }
            Ok(Saved::Merged) => {
                let text = "saved; another program has changed the scene meanwhile, and that stays, too. Start the studio again to see it";
                self.notice(News::Warning, text.to_owned());
            }
            Ok(Saved::Beside(path)) => {
                let text = format!(
                    "another program has painted on this scene, too; your strokes are in {} and theirs stay where they are",
                    path.display()
                );
                self.notice(News::Error, text);
            }
            Err(error) => self.notice(News::Error, format!("not saved: {error}")),
        }
        self.is_told_of_change = false;
        self.tell_strokes();
    }

    fn look_at_the_file(&mut self) {
        if !self.is_told_of_change && self.document.is_changed_elsewhere() {
            self.is_told_of_change = true;
            let text = "another program has changed the scene file. Saving keeps both; start the studio again to see what changed";
            self.notice(News::Warning, text.to_owned());
        }
    }

    /// The strokes are solved for as the command does it: from x₀, at the full resolution.
    fn begin_full(&mut self) {
        self.state = State::Still;
        let text = match self.document.text(&extent(&self.live)) {
            Ok(text) => text,
            Err(error) => return self.notice(News::Error, error.to_string()),
        };
        let stop = Stop::default();
        self.solving = Some(stop.clone());
        let (mine, changes) = (self.mine.clone(), self.changes);
        let (setting, patient) = (self.setting.clone(), self.patient.clone());
        self.progress(Phase::Full, 0, 1.0, None);
        std::thread::spawn(move || {
            let find = || setting.job(&text).and_then(|job| full(job, &setting, stop));
            let found = match &patient {
                Some(patient) => patient.install(find),
                None => find(),
            };
            // Nobody waits for it where the studio was closed.
            _ = mine.send(Order::Full(changes, found));
        });
    }

    fn take_full(&mut self, changes: u64, found: Result<Full>) {
        if changes != self.changes {
            return;
        }
        self.solving = None;
        match found {
            Ok(full) => {
                let (iterations, gradient, met) = (full.iterations, full.gradient, full.met);
                self.full = Some(full);
                self.show(Changes::Light);
                self.progress(Phase::Done, iterations, gradient, met);
            }
            Err(Error::Interrupted) => {}
            Err(error) => self.notice(News::Error, error.to_string()),
        }
    }

    /// Puts the light map where painted light comes through now: where the command would put it, were nothing said.
    fn fit(&mut self) {
        match self.fitted() {
            Ok(live) => self.live = live,
            Err(error) => {
                return self.notice(News::Error, format!("the light map stays where it is: {error}"));
            }
        }
        self.changes += 1;
        self.full = None;
        self.solving.take().iter().for_each(|stop| {
            stop.ask();
        });
        self.began = Instant::now();
        self.state = State::Improving(MOST);
        self.is_moved = true;
        self.tell_strokes();
        self.notice(News::Done, "the light map lies where painted light comes through".to_owned());
    }

    fn fitted(&self) -> Result<LiveJob> {
        let text = self.document.text(&extent(&self.live))?;
        let mut setting = self.setting.clone();
        setting.overrides.push("light_map.extent=null".to_owned());
        Ok(warm(&setting.job(&text)?, &setting)?.0)
    }

    fn export(&mut self) {
        if self.exporting.is_some() {
            return;
        }
        let text = match self.document.text(&extent(&self.live)) {
            Ok(text) => text,
            Err(error) => return self.notice(News::Error, error.to_string()),
        };
        let stop = Stop::default();
        self.exporting = Some(stop.clone());
        let (mine, setting) = (self.mine.clone(), self.setting.clone());
        self.tell(&Told::Exporting { text: "begins".to_owned(), part: None, is_running: true });
        std::thread::spawn(move || {
            let written = setting.job(&text).and_then(|job| {
                let folder = Some(setting.folder.clone());
                let options = Options { engine: setting.engine.clone(), stop, folder, ..Options::default() };
                let mut hears = Hears { mine: mine.clone(), step: String::new(), parts: None };
                let found = job.with(options).solve(&mut hears)?;
                Ok(found.write_observed(setting.folder.clone(), &mut hears)?.folder)
            });
            _ = mine.send(Order::Exported(written));
        });
    }

    fn take_export(&mut self, written: Result<PathBuf>) {
        self.exporting = None;
        self.tell(&Told::Exporting { text: String::new(), part: None, is_running: false });
        match written {
            Ok(folder) => self.notice(News::Done, format!("results are in {}", folder.display())),
            Err(Error::Interrupted) => self.notice(News::Warning, "the export was cancelled".to_owned()),
            Err(error) => self.notice(News::Error, format!("not exported: {error}")),
        }
    }
}

/// Tells pages how an export goes.
struct Hears {
    mine: Sender<Order>,
    step: String,
    parts: Option<u64>,
}

impl Observer for Hears {
    fn begins(&mut self, step: &Step<'_>) {
        (self.step, self.parts) = (step.name.to_owned(), step.parts);
        _ = self.mine.send(Order::Exporting(self.step.clone(), None));
    }

    fn advances(&mut self, done: u64, _remark: &str) {
        let part = self.parts.filter(|&parts| parts > 0).map(|parts| done as f64 / parts as f64);
        _ = self.mine.send(Order::Exporting(self.step.clone(), part));
    }
}

impl Setting {
    /// The job of a text of the scene: that of the command, once it is saved.
    fn job(&self, text: &str) -> Result<Job> {
        Job::of_file(&SceneFile::of(&self.path, text), &self.overrides)
    }

    fn scene(&self, text: &str) -> Result<Scene> {
        match self.job(text)?.scenes() {
            Scenes::LightMap(scene) => Ok(Scene::clone(scene)),
            _ => Err(Error::Empty {
                reason: "the studio paints light maps, and this is a scene of a volume".to_owned(),
                remedy: "paint on a scene without `volume`, or use `unscatter volume`",
            }),
        }
    }
}

/// As many threads as there are cores, which give way to all others.
fn patient_threads() -> Option<Arc<rayon::ThreadPool>> {
    let threads = rayon::ThreadPoolBuilder::new().start_handler(|_| {
        #[cfg(target_os = "linux")]
        {
            // Of this thread alone. Where that is not allowed, they are as urgent as others.
            // Not to the last: beside other programs it would take minutes.
            _ = rustix::process::setpriority_process(None, 5);
        }
    });
    threads.build().ok().map(Arc::new)
}

/// The finest preview whose rows fit, and its width.
fn warm(job: &Job, setting: &Setting) -> Result<(LiveJob, usize)> {
    let mut refused = None;
    for width in WIDTHS {
        let options = Options { engine: setting.engine.clone(), ..Options::default() };
        match job.clone().with(options).live(Preview::Width(width)) {
            Ok(live) => return Ok((live, width)),
            Err(error @ Error::TooLarge { .. }) => refused = Some(error),
            Err(error) => return Err(error),
        }
    }
    Err(refused.unwrap_or_else(|| Error::Machine("no preview fits".to_owned())))
}

fn extent(live: &LiveJob) -> Extent {
    let extent = live.extent();
    Extent { min: extent.min.to_array(), max: extent.max.to_array() }
}

/// What the command finds for a scene.
fn full(job: Job, setting: &Setting, stop: Stop) -> Result<Full> {
    let Scenes::LightMap(scene) = job.scenes().clone() else {
        return Err(Error::Machine("the scene has no light map any more".to_owned()));
    };
    let (engine, asked) = (setting.engine.clone(), stop.clone());
    let found = job.with(Options { engine, stop, ..Options::default() }).solve(&mut Quiet)?;
    if asked.is_asked() {
        return Err(Error::Interrupted);
    }
    let report = found.report();
    let last = report.history.last();
    Ok(Full {
        views: scene.views.iter().map(|view| found.picture(&view.name)).collect::<Result<_>>()?,
        light_map: relative(&found.light_map()?, scene.light.radiance),
        iterations: last.map_or(0, |last| last.iteration),
        gradient: last.map_or(0.0, |last| last.normal_residual.into_iter().fold(0.0, f64::max)),
        met: report.weighted_residual.met(),
        remarks: report.warnings.iter().map(ToString::to_string).collect(),
    })
}

/// A light map relative to the brightest channel of its light.
fn relative(map: &Image, light: Rgb) -> Image {
    let most = light.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
    let mut map = map.clone();
    map.pixels.iter_mut().for_each(|texel| *texel = texel.map(|value| value / most));
    map
}

fn preview_of(
    pictures: &LivePictures<'_>,
    kind: Kind,
    view: usize,
    exposure: f64,
) -> (Stage, [usize; 2], Vec<u8>) {
    let before = pictures.before(view);
    let bytes = match kind {
        Kind::Before | Kind::LightMap => rgba_bytes(before, exposure),
        Kind::After => rgba_bytes(&pictures.after(view), exposure),
        Kind::Target => rgba_bytes(&pictures.target(view), exposure),
        Kind::Difference => rgba_bytes(&pictures.difference(view), exposure),
        Kind::Coverage => {
            pictures.reached(view).into_iter().flat_map(|lit| [0, 0, 0, if lit { 0 } else { 255 }]).collect()
        }
    };
    (Stage::Preview, before.size(), bytes)
}

/// The colours of a scene's strokes, in the order in which they first occur, then others.
fn palette(document: &Document) -> Vec<String> {
    let mut palette: Vec<String> = Vec::new();
    let strokes = document.strokes().iter().flatten();
    let used = strokes.filter_map(|stroke| match stroke.color {
        Paint::Hex([r, g, b]) => Some(format!("#{r:02x}{g:02x}{b:02x}")),
        Paint::Linear(_) => None,
    });
    for color in used.chain(PALETTE.map(str::to_owned)) {
        if !palette.contains(&color) && palette.len() < 14 {
            palette.push(color);
        }
    }
    palette
}
