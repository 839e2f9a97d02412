//! What other threads do for the worker: the rough solve of a volume, the full resolution, an export. What comes of it is an order.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::Sender;

use super::full::{Full, export};
use super::messages::Asked;
use super::setting::{Setting, patient_threads};
use crate::Result;
use crate::job::{Job, Quiet, Solution, Stop};

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

pub(super) struct Errands {
    orders: Sender<Order>,
    /// Threads that work when no other do, for the full resolution: the next stroke does not wait until they have heard of it.
    patient: Option<Arc<rayon::ThreadPool>>,
    solving: Option<Stop>,
    exporting: Option<Stop>,
}

impl Errands {
    pub(super) fn new(orders: Sender<Order>) -> Self {
        Self { orders, patient: patient_threads(), solving: None, exporting: None }
    }

    /// Solves the previews of a volume.
    pub(super) fn preview(&mut self, changes: u64, job: impl FnOnce(Stop) -> Job) {
        let (orders, job) = (self.orders.clone(), job(self.begin_solve()));
        std::thread::spawn(move || {
            // Nobody waits for it where the studio was closed.
            _ = orders.send(Order::Previewed(changes, job.solve(&mut Quiet).map(Box::new)));
        });
    }

    /// Solves the text of a scene as the command does.
    pub(super) fn full(&mut self, changes: u64, text: String, setting: &Setting) {
        let (orders, stop) = (self.orders.clone(), self.begin_solve());
        let (setting, patient) = (setting.clone(), self.patient.clone());
        std::thread::spawn(move || {
            let find = || setting.job(&text).and_then(|job| Full::of(job, &setting, stop));
            let found = match &patient {
                Some(patient) => patient.install(find),
                None => find(),
            };
            _ = orders.send(Order::Full(changes, found));
        });
    }

    fn begin_solve(&mut self) -> Stop {
        let stop = Stop::default();
        self.solving = Some(stop.clone());
        stop
    }

    /// The solve that is under way has ended.
    pub(super) fn solved(&mut self) {
        self.solving = None;
    }

    /// Tells the solve that is under way to stop; whether there was one. What comes of it is [`crate::Error::Interrupted`].
    pub(super) fn stop_solving(&mut self) -> bool {
        self.solving.take().is_some_and(|stop| {
            stop.ask();
            true
        })
    }

    pub(super) fn is_exporting(&self) -> bool {
        self.exporting.is_some()
    }

    /// Writes what the command writes for the text of a scene.
    pub(super) fn export(&mut self, text: String, setting: &Setting) {
        let stop = Stop::default();
        self.exporting = Some(stop.clone());
        let (orders, setting) = (self.orders.clone(), setting.clone());
        std::thread::spawn(move || {
            let tells = orders.clone();
            let hears = move |step: &str, part: Option<f64>| {
                _ = tells.send(Order::Exporting(step.to_owned(), part));
            };
            let written = setting.job(&text).and_then(|job| export(job, &setting, stop, hears));
            _ = orders.send(Order::Exported(written));
        });
    }

    /// The export has ended.
    pub(super) fn exported(&mut self) {
        self.exporting = None;
    }

    pub(super) fn stop_exporting(&self) {
        self.exporting.iter().for_each(|stop| {
            stop.ask();
        });
    }
}
