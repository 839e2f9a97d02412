//! The thread that solves: it makes changes of strokes, goes on from where the light map is, and sends pictures as they improve.

use std::collections::{HashMap, VecDeque};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError};
use std::time::{Duration, Instant};

use glam::DVec3;
use tokio::sync::broadcast;

use super::document::{Document, Saved};
use super::drawing::{Change, Difference, Drawing};
use super::full::{Full, export};
use super::live::{Live, Rows, Subject};
use super::messages::{
    Asked, CameraRecord, Kind, News, Phase, Sent, Stage, Told, ViewRecord, Wish, hex, picture,
};
use super::pictures::{Shown, palette, previews, tint};
use super::setting::{Setting, located, patient_threads};
use crate::io::image::rgba_bytes;
use crate::io::scene_file::{Group, View, edit};
use crate::job::{Quiet, Solution, Stop, readable};
use crate::scene::{Camera, FovAxis, Rgb, look_at};
use crate::{Error, Result};

/// All that pages may watch, in the order in which it is sent.
const KINDS: [Kind; 7] = [
    Kind::After,
    Kind::Before,
    Kind::Target,
    Kind::Difference,
    Kind::Coverage,
    Kind::Conflict,
    Kind::LightMap,
];
/// How long the pen rests before the full resolution follows.
const REST: Duration = Duration::from_millis(250);
/// How often to look whether somebody wants to stop, and whether another program has changed the scene.
const LOOK: Duration = Duration::from_millis(500);
/// Pictures of a preview follow each other at least so far apart, once the first is there.
const APART: Duration = Duration::from_millis(120);
/// Iterations between two pictures at most.
const MOST: usize = 8;
/// What the worker is told to do.
pub(super) enum Order {
    /// A page is there; its number.
    Joined(u64),
    Left(u64),
    Asked(u64, Asked),
    /// A solve of a volume's previews has ended, for the strokes of that number.
    Previewed(u64, Result<Box<Solution>>),
    /// A solve of the full pictures has ended, for the strokes of that number.
    Full(u64, Result<Full>),
    Exporting(String, Option<f64>),
    Exported(Result<PathBuf>),
}

pub(super) struct Worker {
    setting: Setting,
    document: Document,
    rows: Rows,
    /// Of the sun, which keeps it when it is turned.
    radiance: Rgb,
    palette: Vec<String>,
    /// Threads that leave one core to the browser.
    few: Option<rayon::ThreadPool>,
    /// Threads that work when no other do, for the full resolution: the next stroke does not wait until they have heard of it.
    patient: Option<Arc<rayon::ThreadPool>>,
    orders: Receiver<Order>,
    /// Orders that have come already.
    waiting: VecDeque<Order>,
    mine: Sender<Order>,
    pages: broadcast::Sender<Sent>,
    watched: HashMap<u64, Vec<Kind>>,
    /// What all pictures are brightened by.
    exposure: f64,
    is_pen_down: bool,
    /// The view that was painted on last, which is shown first.
    painted: usize,
    /// The view whose size the pictures of a free camera have.
    looks_from: usize,
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
            Kind::After | Kind::Difference | Kind::Conflict | Kind::LightMap => true,
            Kind::Target => self != Self::Light,
            Kind::Before | Kind::Coverage => self == Self::All,
            // Drawn when it is asked for.
            Kind::Free => false,
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
        (text, is_new): (String, bool),
        (orders, mine): (Receiver<Order>, Sender<Order>),
        pages: broadcast::Sender<Sent>,
    ) -> Result<Self> {
        let mut news = Vec::new();
        // What is wrong in a scene is told with its place, and before anything is written beside it.
        let radiance = Subject::of(&setting.job(&text)?)?.radiance();
        let (document, brought_back, set_aside) = Document::open(&setting.path, text, is_new)?;
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
        let rows = Rows::of(&setting, &setting.job(&document.text_of(document.now(), radiance)?)?, false)?;
        if let Some(width) = rows.coarser {
            let text = format!("previews are {width} pixels wide, finer ones would exceed solve.memory");
            news.push((News::Warning, text));
        }
        let cores = std::thread::available_parallelism().map_or(1, Into::into);
        let few = rayon::ThreadPoolBuilder::new().num_threads(cores.saturating_sub(1).max(1)).build().ok();
        let now = Instant::now();
        let mut worker = Self {
            palette: palette(&document),
            setting,
            document,
            rows,
            radiance,
            few,
            patient: patient_threads(),
            orders,
            waiting: VecDeque::new(),
            mine,
            pages,
            watched: HashMap::new(),
            exposure: 1.0,
            is_pen_down: false,
            painted: 0,
            looks_from: 0,
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
                State::Rests(since) if since.elapsed() >= REST && !self.is_pen_down => {
                    if self.rows.is_hasty {
                        self.refine()
                    } else {
                        self.begin_full()
                    }
                }
                _ => {}
            }
        }
        self.solving.iter().chain(&self.exporting).for_each(|stop| {
            stop.ask();
        });
    }

    /// The next order: at once where there is something to do meanwhile.
    fn next(&mut self) -> std::result::Result<Option<Order>, ()> {
        if let Some(order) = self.waiting.pop_front() {
            return Ok(Some(order));
        }
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
            Order::Asked(_, Asked::Change(change)) => {
                let change = self.latest(change);
                self.change(&change);
            }
            Order::Asked(page, Asked::Wish(wish)) => self.grant(page, wish),
            Order::Previewed(changes, found) => self.take_preview(changes, found),
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
            Wish::LookFrom { view, camera } => self.look_from(view, &camera),
            Wish::AddView { name, camera } => self.add_view(&name, &camera),
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
        self.introduce();
        self.tell_strokes();
        for (kind, text) in std::mem::take(&mut self.news) {
            self.notice(kind, text);
        }
        self.show(Changes::All);
        self.tell_progress();
    }

    fn introduce(&self) {
        let Rows { subject, records, span, .. } = &self.rows;
        self.tell(&Told::Hello {
            scene: subject.name(),
            path: self.setting.path.display().to_string(),
            version: env!("CARGO_PKG_VERSION"),
            views: records,
            exposure: self.readable,
            palette: &self.palette,
            is_new: self.document.is_new(),
            is_volume: matches!(subject, Subject::Volume(_)),
        });
        let (sun, sigma_t) = subject.look().unzip();
        self.tell(&Told::Look { sun, sigma_t, span: *span });
    }

    fn tell_strokes(&self) {
        let Drawing { views, groups, .. } = self.document.now();
        self.tell(&Told::Strokes {
            views: views.iter().map(|strokes| strokes.iter().map(|stroke| &**stroke).collect()).collect(),
            groups,
            revision: self.changes,
            can_undo: self.document.can_undo(),
            can_redo: self.document.can_redo(),
            is_saved: self.document.is_saved(),
        });
    }

    /// Of a drag the change that has come last.
    fn latest(&mut self, mut change: Change) -> Change {
        while let Ok(order) = self.orders.try_recv() {
            match order {
                Order::Asked(_, Asked::Change(later)) if change.is_overtaken_by(&later) => change = later,
                other => {
                    self.waiting.push_back(other);
                    break;
                }
            }
        }
        change
    }

    fn change(&mut self, change: &Change) {
        let Some(next) = self.document.after(change) else {
            self.introduce();
            self.tell_strokes();
            return;
        };
        let difference = next.difference(self.document.now());
        let was_wanted = self.rows.live.is_wanted();
        let followed = Group::check(&next.groups).and_then(|()| match &difference {
            Difference::Paint(views) => views.iter().try_for_each(|&view| self.repaint(view, &next)),
            Difference::Rows => self
                .rows_of(&next, change.goes_on())
                .map(|rows| self.rows = rows)
                .map_err(|error| error.to_string()),
        });
        if let Err(problem) = followed {
            let what = match change {
                Change::Paint { .. } | Change::Replace { .. } => "that stroke",
                _ => "that",
            };
            self.notice(News::Error, format!("{what} cannot be: {problem}"));
            self.introduce();
            self.tell_strokes();
            return;
        }
        if let Difference::Paint(views) = &difference {
            self.painted = views.first().copied().unwrap_or(self.painted);
        }
        if let Err(error) = self.document.make(change, next) {
            self.notice(News::Error, format!("the journal cannot be written, so save often: {error}"));
        }
        if !was_wanted && self.rows.live.is_wanted() && matches!(difference, Difference::Paint(_)) {
            self.place();
        }
        if difference == Difference::Rows {
            self.is_moved = true;
            self.introduce();
        }
        self.begin_again(State::Improving(1));
        self.tell_strokes();
    }

    /// Puts the light map where the first paint on a bare scene has its light, unless the scene says where it lies.
    fn place(&mut self) {
        let text = self.document.text_of(self.document.now(), self.radiance);
        let fitted = text.and_then(|text| match edit::light_map_extent(&text)? {
            None if self.rows.live.extent().is_some() => {
                Rows::of(&self.setting, &self.setting.fitted_job(&text)?, false).map(Some)
            }
            _ => Ok(None),
        });
        match fitted {
            Ok(Some(rows)) => (self.rows, self.is_moved) = (rows, true),
            Ok(None) => {}
            Err(error) => self.notice(News::Warning, format!("the light map stays where it is: {error}")),
        }
    }

    /// Paints a preview anew.
    fn repaint(&mut self, view: usize, next: &Drawing) -> std::result::Result<(), String> {
        let ViewRecord { name, size, .. } = &self.rows.records[view];
        let built = next.views[view].iter().map(|stroke| stroke.on(&next.groups, *size));
        let built =
            built.filter_map(std::result::Result::transpose).collect::<std::result::Result<_, _>>()?;
        self.rows.live.repaint(view, name, built).map_err(|error| error.to_string())
    }

    /// The rows of a scene with other views, or in another light: the light map lies where that light comes through then.
    fn rows_of(&self, next: &Drawing, is_hasty: bool) -> Result<Rows> {
        let text = self.document.text_of(next, self.radiance)?;
        let job = match next.look == self.document.now().look {
            true => self.setting.job(&located(text, self.rows.live.extent().as_ref())?)?,
            false => self.setting.fitted_job(&text)?,
        };
        Rows::of(&self.setting, &job, is_hasty)
    }

    /// Whatever was solved is of the strokes before.
    fn begin_again(&mut self, state: State) {
        self.changes += 1;
        self.full = None;
        self.solving.take().iter().for_each(|stop| {
            stop.ask();
        });
        self.began = Instant::now();
        self.state = state;
    }

    /// Keeps the rows of fine previews, once a drag has ended.
    fn refine(&mut self) {
        let text = self.document.text(self.radiance, self.rows.live.extent().as_ref());
        match text.and_then(|text| Rows::of(&self.setting, &self.setting.job(&text)?, false)) {
            Ok(rows) => self.rows = rows,
            // The coarse ones are good as well.
            Err(error) => {
                self.rows.is_hasty = false;
                self.notice(News::Error, error.to_string());
            }
        }
        self.is_moved = true;
        self.introduce();
        self.began = Instant::now();
        self.state = State::Improving(1);
    }

    fn look_from(&mut self, view: usize, camera: &CameraRecord) {
        let Some(ViewRecord { preview, .. }) = self.rows.records.get(view) else { return };
        self.looks_from = view;
        let CameraRecord { origin, target, up, fov } = *camera;
        let [origin, target, up] = [origin, target, up].map(DVec3::from_array);
        let camera =
            look_at(origin, target, up).and_then(|to_world| Camera::new(to_world, fov, FovAxis::Y, *preview));
        match camera.and_then(|camera| self.rows.live.picture_from(&camera)) {
            Ok(seen) => {
                self.serial += 1;
                let bytes = rgba_bytes(&seen, self.exposure);
                let stage = (Stage::Preview, self.serial, self.followed);
                _ = self.pages.send(picture((Kind::Free, None), stage, seen.size(), &bytes));
            }
            Err(error) => self.notice(News::Error, error.to_string()),
        }
    }

    fn add_view(&mut self, name: &str, camera: &CameraRecord) {
        let Some(ViewRecord { size, .. }) = self.rows.records.get(self.looks_from) else { return };
        // Names are of files.
        let view = View::new(name.trim().replace(' ', "-"), camera.document(*size));
        self.change(&Change::Add { view: Box::new(view) });
    }

    /// Goes on with the preview, and shows what has come of it.
    fn improve(&mut self, iterations: usize) {
        if !self.rows.live.is_wanted() {
            return self.show_plain();
        }
        let live = match &mut self.rows.live {
            Live::LightMap(live) => live,
            Live::Volume(live) => {
                // From the start, and by another thread.
                let stop = Stop::default();
                self.solving = Some(stop.clone());
                let (job, mine, changes) = (live.job(stop), self.mine.clone(), self.changes);
                self.state = State::Still;
                std::thread::spawn(move || {
                    // Nobody waits for it where the studio was closed.
                    _ = mine.send(Order::Previewed(changes, job.solve(&mut Quiet).map(Box::new)));
                });
                return;
            }
        };
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
            || standing.iterations >= self.rows.subject.iterations();
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

    /// Nothing is wanted: all is as it is without paint.
    fn show_plain(&mut self) {
        match &mut self.rows.live {
            Live::LightMap(live) => live.begin_anew(),
            Live::Volume(live) => live.show(None),
        }
        self.followed = self.changes;
        self.state = State::Still;
        self.show(Changes::Paint);
        self.progress(Phase::NothingPainted, 0, f64::NAN, None);
    }

    /// Shows what the solve of a volume's previews has found, unless it is of other strokes.
    fn take_preview(&mut self, changes: u64, found: Result<Box<Solution>>) {
        let Live::Volume(live) = &mut self.rows.live else { return };
        if changes != self.changes {
            return;
        }
        self.solving = None;
        let found = match found {
            Ok(found) => *found,
            Err(Error::Interrupted) => return,
            Err(error) => return self.notice(News::Error, error.to_string()),
        };
        let last = found.report().history.last();
        let iteration = last.map_or(0, |last| last.iteration);
        let gradient = last.map_or(1.0, |last| last.normal_residual.into_iter().fold(0.0, f64::max));
        live.show(Some(found));
        self.followed = self.changes;
        self.state = State::Rests(Instant::now());
        self.is_moved = false;
        let met = self.show(Changes::All);
        self.progress(Phase::Preview, iteration, gradient, met);
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
        let details = self.full.as_ref().map_or(&[][..], |full| &full.details);
        let seconds = at.as_secs_f64();
        self.tell(&Told::Progress { phase, iteration, gradient, met, seconds, remarks, details });
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
            KINDS.into_iter().filter(|&kind| self.watches(kind) && changes.reach(kind)).collect();
        let light = self.rows.subject.radiance();
        let (serial, pages, followed) = (&mut self.serial, &self.pages, self.followed);
        let mut send = |Shown { kind, view, stage, size, bytes }: Shown| {
            *serial += 1;
            _ = pages.send(picture((kind, view), (stage, *serial, followed), size, &bytes));
        };
        let live = &mut self.rows.live;
        previews(live, self.full.as_ref(), (&kinds, self.painted), (light, self.exposure), &mut send)
    }

    /// How much pictures are brightened at first: as files are.
    fn readable(&mut self) -> Result<f64> {
        if let Some(stops) = self.rows.subject.exposure() {
            return Ok(stops.exp2());
        }
        let views = self.rows.records.len();
        let Live::LightMap(live) = &mut self.rows.live else { return Ok(1.0) };
        let pictures = live.pictures()?;
        Ok(readable((0..views).map(|view| pictures.before(view))).exp2())
    }

    fn reach(&mut self, view: usize, [x, y]: [f64; 2]) {
        let Some(ViewRecord { size, preview, .. }) = self.rows.records.get(view).cloned() else { return };
        let at = [0, 1].map(|axis| {
            let along = [x, y][axis] * preview[axis] as f64 / size[axis] as f64;
            (along.max(0.0) as usize).min(preview[axis] - 1)
        });
        match tint(&mut self.rows.live, view, at) {
            Ok(color) => self.tell(&Told::Reached { view, x, y, color: hex(color) }),
            Err(error) => self.notice(News::Error, error.to_string()),
        }
    }

    fn save(&mut self) {
        let was_new = self.document.is_new();
        match self.document.save(self.radiance, self.rows.live.extent().as_ref()) {
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
        if was_new {
            self.introduce();
        }
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
        let text = match self.document.text(self.radiance, self.rows.live.extent().as_ref()) {
            Ok(text) => text,
            Err(error) => return self.notice(News::Error, error.to_string()),
        };
        let stop = Stop::default();
        self.solving = Some(stop.clone());
        let (mine, changes) = (self.mine.clone(), self.changes);
        let (setting, patient) = (self.setting.clone(), self.patient.clone());
        self.progress(Phase::Full, 0, 1.0, None);
        std::thread::spawn(move || {
            let find = || setting.job(&text).and_then(|job| Full::of(job, &setting, stop));
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
        if matches!(self.rows.live, Live::Volume(_)) {
            return;
        }
        let fitted = self.document.text_of(self.document.now(), self.radiance);
        let fitted = fitted.and_then(|text| Rows::of(&self.setting, &self.setting.fitted_job(&text)?, false));
        match fitted {
            Ok(rows) => self.rows = rows,
            Err(error) => {
                return self.notice(News::Error, format!("the light map stays where it is: {error}"));
            }
        }
        self.is_moved = true;
        self.begin_again(State::Improving(MOST));
        self.tell_strokes();
        self.notice(News::Done, "the light map lies where painted light comes through".to_owned());
    }

    fn export(&mut self) {
        if self.exporting.is_some() {
            return;
        }
        let text = match self.document.text(self.radiance, self.rows.live.extent().as_ref()) {
            Ok(text) => text,
            Err(error) => return self.notice(News::Error, error.to_string()),
        };
        let stop = Stop::default();
        self.exporting = Some(stop.clone());
        let (mine, setting) = (self.mine.clone(), self.setting.clone());
        self.tell(&Told::Exporting { text: "begins".to_owned(), part: None, is_running: true });
        std::thread::spawn(move || {
            let tells = mine.clone();
            let hears = move |step: &str, part: Option<f64>| {
                // Nobody hears where the studio was closed.
                _ = tells.send(Order::Exporting(step.to_owned(), part));
            };
            let written = setting.job(&text).and_then(|job| export(job, &setting, stop, hears));
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
