//! The studio: an artist paints on the views in a browser, and sees the light shafts follow.
//!
//! A face like the command: pages, words, and no algorithm. One thread solves (`worker.rs`) with the live job of `job/`; another one serves
//! the page and its socket to this machine alone (`server.rs`). Strokes, undo and the journal are in `document.rs`, and what both sides say
//! in `messages.rs`.

mod document;
mod messages;
mod page;
mod server;
mod worker;

use std::path::PathBuf;
use std::sync::{Arc, mpsc};

use tokio::sync::broadcast;

use crate::Result;
use crate::io::scene_file::SceneFile;
use crate::job::{EngineChoice, Stop};
use server::Door;
use worker::{Setting, Worker};

/// Messages that wait for a page that is slow, before it is told everything anew.
const WAITING: usize = 64;

/// A studio that is to be opened.
#[derive(Debug, Clone)]
pub struct Studio {
    /// The scene file that is painted on.
    pub scene: PathBuf,
    /// Values to replace in it, `PATH=VALUE`.
    pub overrides: Vec<String>,
    /// What computes.
    pub engine: EngineChoice,
    /// Where exports go.
    pub folder: PathBuf,
    /// Where the page is served on this machine; 0 for any port that is free.
    pub port: u16,
}

impl Studio {
    /// Keeps the rows of the previews, and serves the page until somebody asks to stop. `opened` is told its address.
    ///
    /// Errors: those of reading the scene; [`crate::Error::Empty`] for one without a light map; [`crate::Error::Machine`] where another
    /// studio has the scene, or the port is taken.
    pub fn serve(self, stop: &Stop, opened: impl FnOnce(&str)) -> Result<()> {
        let file = SceneFile::read(&self.scene)?;
        let text = String::from_utf8_lossy(file.bytes()).into_owned();
        let listener = server::listen(self.port)?;
        let port = listener.local_addr().map_or(self.port, |address| address.port());
        let (mine, orders) = mpsc::channel();
        let (pages, _) = broadcast::channel(WAITING);
        let setting =
            Setting { path: self.scene, overrides: self.overrides, engine: self.engine, folder: self.folder };
        let worker = Worker::open(setting, text, (orders, mine.clone()), pages.clone())?;
        let door = Arc::new(Door::new(port, mine, pages)?);
        std::thread::scope(|scope| {
            scope.spawn(|| worker.work(stop));
            opened(&door.address());
            let served = server::serve(listener, door, stop);
            stop.ask();
            served
        })
    }
}
