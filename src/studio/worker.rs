//! The thread that solves: it makes changes of strokes, goes on from where the light map is, and sends pictures as they improve.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError};
use std::time::{Duration, Instant};

use glam::DVec3;
use tokio::sync::broadcast;

use super::document::{Document, Saved};
use super::drawing::{Change, Difference, Drawing};
use super::errands::{Errands, Order};
use super::full::Full;
use super::live::{Live, Rows, Subject};
use super::looks;
use super::messages::{Asked, CameraRecord, Kind, Mail, News, Phase, Told, ViewRecord, Wish, hex};
use super::pictures::{Seen, palette, tint};
use super::screen::{Changes, Screen};
use super::setting::{Setting, located};
use crate::io::scene_file::{Group, View, edit};
use crate::job::{LiveMoment, Solution, Standing, Stop, readable};
use crate::scene::{Camera, FovAxis, Rgb, look_at};
use crate::solve::{Control, StopReason};
use crate::{Error, Result};

/// How long the pen rests before the full resolution follows.
const REST: Duration = Duration::from_millis(250);
/// How often to look whether somebody wants to stop, and whether another program has changed the scene.
const LOOK: Duration = Duration::from_millis(500);

pub(super) struct Worker {
    setting: Setting,
    document: Document,
    rows: Rows,
    /// Of the sun, which keeps it when it is turned.
    radiance: Rgb,
    palette: Vec<String>,
    /// Threads that leave one core to the browser.
    few: Option<rayon::ThreadPool>,
    orders: Receiver<Order>,
    /// Orders that have come already.
    waiting: VecDeque<Order>,
    errands: Errands,
    screen: Screen,
    is_pen_down: bool,
    /// The view whose size the pictures of a free camera have.
    looks_from: usize,
    state: State,
    /// Counts changes of strokes.
    changes: u64,
    /// What pictures are brightened by at first.
    readable: f64,
    full: Option<Full>,
    is_told_of_change: bool,
    /// What the first page is told.
    news: Vec<(News, String)>,
}

/// How far the preview is.
#[derive(Clone, Copy, PartialEq)]
enum State {
    /// It goes on, after so many iterations.
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
        pages: broadcast::Sender<Mail>,
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
        let mut worker = Self {
            palette: palette(&document),
            setting,
            document,
            rows,
            radiance,
            few,
            orders,
            waiting: VecDeque::new(),
            errands: Errands::new(mine),
            screen: Screen::new(pages),
            is_pen_down: false,
            looks_from: 0,
            state: State::Improving(0),
            changes: 0,
            readable: 1.0,
            full: None,
            is_told_of_change: false,
            news,
        };
        worker.readable = worker.readable()?;
        worker.screen.exposure = worker.readable;
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
        self.errands.stop_solving();
        self.errands.stop_exporting();
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
                self.screen.watched.insert(page, vec![Kind::After]);
                self.greet();
            }
            Order::Left(page) => {
                self.screen.watched.remove(&page);
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
            Wish::Pen { down } => self.hold(down),
            Wish::Save => self.save(),
            Wish::Export => self.export(),
            Wish::Cancel => self.errands.stop_exporting(),
            Wish::Fit => self.fit(),
            Wish::Exposure { value } if value.is_finite() && value > 0.0 => {
                self.screen.exposure = value;
                self.show(Changes::All);
            }
            Wish::Exposure { .. } => {
                self.notice(News::Error, "the exposure must be a number above 0".to_owned())
            }
            Wish::Watch { pictures } => {
                self.screen.watched.insert(page, pictures);
                self.show(Changes::All);
            }
            Wish::Reach { view, x, y } => self.reach(page, view, [x, y]),
            Wish::What { view, x, y } => looks::tell_what(page, (view, [x, y]), &self.rows, &self.screen),
            Wish::LookFrom { view, camera } => self.look_from(page, view, &camera),
            Wish::AddView { name, camera } => self.add_view(&name, &camera),
        }
    }

    /// While the pen is down a stroke is about to come: the full resolution would be of the strokes before, and leaves its core to the page.
    fn hold(&mut self, is_down: bool) {
        self.is_pen_down = is_down;
        if is_down && matches!(self.rows.live, Live::LightMap(_)) && self.errands.stop_solving() {
            self.state = State::Rests(Instant::now());
        }
    }

    fn tell(&self, told: &Told<'_>) {
        self.screen.tell(told);
    }

    fn notice(&self, kind: News, text: String) {
        self.screen.notice(kind, text);
    }

    fn greet(&mut self) {
        self.introduce();
        self.tell_strokes();
        for (kind, text) in std::mem::take(&mut self.news) {
            self.notice(kind, text);
        }
        self.show(Changes::All);
        self.screen.tell_progress(self.full.as_ref());
    }

    fn introduce(&mut self) {
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
        looks::tell(&self.document.now().looks, &self.rows, &mut self.screen);
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
                Order::Asked(_, Asked::Change(later)) if change.is_overtaken_by(&later) => {
                    change = change.overtaken_by(later);
                }
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
        if difference == Difference::Rows {
            // Pages hear that something is done before it is.
            self.progress(Phase::Preview, 0, 1.0, None);
        }
        let followed = Group::check(&next.groups).and_then(|()| match &difference {
            Difference::Paint(views) => views.iter().try_for_each(|&view| self.repaint(view, &next)),
            Difference::Rows => self
                .rows_of(&next, change.goes_on())
                .map(|rows| self.rows = rows)
                .map_err(|error| looks::sentence(&error)),
        });
        if let Err(problem) = followed {
            let what = match change {
                Change::Paint { .. } | Change::Replace { .. } => "that stroke",
                Change::Looks { .. } => "that look",
                _ => "that",
            };
            self.notice(News::Error, format!("{what} cannot be: {problem}"));
            if difference == Difference::Rows {
                // What was said to begin goes on with what there is.
                self.state = State::Improving(0);
            }
            self.introduce();
            self.tell_strokes();
            return;
        }
        if let Difference::Paint(views) = &difference {
            self.screen.painted = views.first().copied().unwrap_or(self.screen.painted);
        }
        if let Err(error) = self.document.make(change, next) {
            self.notice(News::Error, format!("the journal cannot be written, so save often: {error}"));
        }
        if difference == Difference::Rows {
            self.screen.is_moved = true;
            self.introduce();
        }
        self.begin_again(State::Improving(0));
        self.tell_strokes();
        if !was_wanted && self.rows.live.is_wanted() && matches!(difference, Difference::Paint(_)) {
            self.progress(Phase::Preview, 0, 1.0, None);
            self.place();
        }
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
            Ok(Some(rows)) => (self.rows, self.screen.is_moved) = (rows, true),
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
        self.errands.stop_solving();
        self.screen.begin();
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
        self.screen.is_moved = true;
        self.introduce();
        self.screen.begin();
        self.state = State::Improving(0);
    }

    fn look_from(&mut self, page: u64, view: usize, camera: &CameraRecord) {
        let Some(ViewRecord { preview, .. }) = self.rows.records.get(view) else { return };
        self.looks_from = view;
        let CameraRecord { origin, target, up, fov } = *camera;
        let [origin, target, up] = [origin, target, up].map(DVec3::from_array);
        let camera =
            look_at(origin, target, up).and_then(|to_world| Camera::new(to_world, fov, FovAxis::Y, *preview));
        match camera.and_then(|camera| self.rows.live.picture_from(&camera)) {
            Ok(seen) => self.screen.show_free(page, &seen),
            Err(error) => self.notice(News::Error, error.to_string()),
        }
    }

    fn add_view(&mut self, name: &str, camera: &CameraRecord) {
        let Some(ViewRecord { size, .. }) = self.rows.records.get(self.looks_from) else { return };
        // Names are of files.
        let view = View::new(name.trim().replace(' ', "-"), camera.document(*size));
        self.change(&Change::Add { view: Box::new(view) });
    }

    /// Goes on with the preview after so many iterations, and shows what comes of it, until it is done or an order has come.
    fn improve(&mut self, done: usize) {
        if !self.rows.live.is_wanted() {
            return self.show_plain();
        }
        let Self { rows, screen, orders, waiting, few, errands, .. } = self;
        let (most, light) = (rows.subject.iterations(), rows.subject.radiance());
        let live = match &mut rows.live {
            Live::LightMap(live) => live,
            Live::Volume(live) => {
                // From the start, and by another thread.
                errands.preview(self.changes, |stop| live.job(stop));
                self.state = State::Still;
                return;
            }
        };
        screen.followed = self.changes;
        let mut is_first = done == 0;
        let mut each = |moment: &LiveMoment<'_>| {
            // Of its own alone, so that the closure may go to other threads.
            let orders = &mut *orders;
            if !is_first && let Ok(order) = orders.try_recv() {
                waiting.push_back(order);
                return Ok(Control::Pause);
            }
            if is_first || screen.is_due() {
                let seen = Seen::LightMap(moment.pictures()?);
                let changes = changed(screen, std::mem::take(&mut is_first));
                let met = screen.show(&seen, None, light, changes)?;
                screen.progress(Phase::Preview, reached(&moment.standing), met, None);
            }
            Ok(Control::Continue)
        };
        let mut advance = || live.prepare().and_then(|()| live.watched(most.saturating_sub(done), &mut each));
        let advanced = match few {
            Some(few) if self.is_pen_down => few.install(advance),
            _ => advance(),
        };
        match advanced {
            Ok(standing) if standing.stop == StopReason::Interrupted => {
                self.state = State::Improving(standing.iterations);
            }
            Ok(standing) => {
                self.state = State::Rests(Instant::now());
                let changes = changed(&mut self.screen, is_first);
                let met = self.show(changes);
                self.screen.progress(Phase::Preview, reached(&standing), met, None);
            }
            Err(error) => {
                self.state = State::Still;
                self.notice(News::Error, error.to_string());
            }
        }
    }

    /// Nothing is wanted: all is as it is without paint.
    fn show_plain(&mut self) {
        match &mut self.rows.live {
            Live::LightMap(live) => live.begin_anew(),
            Live::Volume(live) => live.show(None),
        }
        self.screen.followed = self.changes;
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
        self.errands.solved();
        let found = match found {
            Ok(found) => *found,
            Err(Error::Interrupted) => return,
            Err(error) => return self.notice(News::Error, error.to_string()),
        };
        let last = found.report().history.last();
        let iteration = last.map_or(0, |last| last.iteration);
        let gradient = last.map_or(1.0, |last| last.normal_residual.into_iter().fold(0.0, f64::max));
        live.show(Some(found));
        self.screen.followed = self.changes;
        self.state = State::Rests(Instant::now());
        self.screen.is_moved = false;
        let met = self.show(Changes::All);
        self.progress(Phase::Preview, iteration, gradient, met);
    }

    fn progress(&mut self, phase: Phase, iteration: usize, gradient: f64, met: Option<f64>) {
        self.screen.progress(phase, (iteration, gradient), met, self.full.as_ref());
    }

    /// Sends the pictures that have changed, of those that some page shows; the share of the paint that is met.
    fn show(&mut self, changes: Changes) -> Option<f64> {
        let (light, full) = (self.rows.subject.radiance(), self.full.as_ref());
        let seen = self.rows.live.seen();
        match seen.and_then(|seen| self.screen.show(&seen, full, light, changes)) {
            Ok(met) => met,
            Err(error) => {
                self.notice(News::Error, error.to_string());
                None
            }
        }
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

    fn reach(&mut self, page: u64, view: usize, [x, y]: [f64; 2]) {
        let Some(ViewRecord { size, preview, .. }) = self.rows.records.get(view).cloned() else { return };
        let at = [0, 1].map(|axis| {
            let along = [x, y][axis] * preview[axis] as f64 / size[axis] as f64;
            (along.max(0.0) as usize).min(preview[axis] - 1)
        });
        match self.rows.live.seen().map(|seen| tint(&seen, view, at)) {
            Ok(color) => self.screen.answer(page, &Told::Reached { view, x, y, color: hex(color) }),
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
        self.progress(Phase::Full, 0, 1.0, None);
        self.errands.full(self.changes, text, &self.setting);
    }

    fn take_full(&mut self, changes: u64, found: Result<Full>) {
        // It was told to stop, and another may be under way.
        if changes != self.changes || matches!(found, Err(Error::Interrupted)) {
            return;
        }
        self.errands.solved();
        match found {
            Ok(full) => {
                let (iterations, gradient, met) = (full.iterations, full.gradient, full.met);
                self.full = Some(full);
                self.show(Changes::Light);
                self.progress(Phase::Done, iterations, gradient, met);
            }
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
        self.screen.is_moved = true;
        self.begin_again(State::Improving(0));
        self.tell_strokes();
        self.notice(News::Done, "the light map lies where painted light comes through".to_owned());
    }

    fn export(&mut self) {
        if self.errands.is_exporting() {
            return;
        }
        let text = match self.document.text(self.radiance, self.rows.live.extent().as_ref()) {
            Ok(text) => text,
            Err(error) => return self.notice(News::Error, error.to_string()),
        };
        self.tell(&Told::Exporting { text: "begins".to_owned(), part: None, is_running: true });
        self.errands.export(text, &self.setting);
    }

    fn take_export(&mut self, written: Result<PathBuf>) {
        self.errands.exported();
        self.tell(&Told::Exporting { text: String::new(), part: None, is_running: false });
        match written {
            Ok(folder) => self.notice(News::Done, format!("results are in {}", folder.display())),
            Err(Error::Interrupted) => self.notice(News::Warning, "the export was cancelled".to_owned()),
            Err(error) => self.notice(News::Error, format!("not exported: {error}")),
        }
    }
}

/// What pages have not seen yet, with the first picture since a change or a later one.
fn changed(screen: &mut Screen, is_first: bool) -> Changes {
    match (std::mem::take(&mut screen.is_moved), is_first) {
        (true, _) => Changes::All,
        (false, true) => Changes::Paint,
        (false, false) => Changes::Light,
    }
}

/// Iterations, and the largest gradient of a channel.
fn reached(standing: &Standing) -> (usize, f64) {
    (standing.iterations, standing.gradient.iter().copied().fold(0.0, f64::max))
}
