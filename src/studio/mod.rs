//! The studio: an artist paints on the views in a browser, and sees the light shafts follow.
//!
//! A face like the command: pages, words, and no algorithm. One thread solves (`worker.rs`) with the live job of `job/`; another one serves
//! the page and its socket to this machine alone (`server.rs`). Strokes, undo and the journal are in `document.rs`, and what both sides say
//! in `messages.rs`.

mod document;
mod drawing;
mod errands;
mod full;
mod live;
mod looks;
mod messages;
mod model;
mod page;
mod pictures;
mod screen;
mod server;
mod setting;
mod worker;

use std::path::{Path, PathBuf};
use std::sync::{Arc, mpsc};

use tokio::sync::broadcast;

use crate::io::scene_file::SceneFile;
use crate::job::{EngineChoice, Stop};
use crate::{Error, Result};
use server::Door;
use setting::Setting;
use worker::Worker;

/// Messages that wait for a page that is slow, before it is told everything anew.
const WAITING: usize = 64;

/// A studio that is to be opened.
#[derive(Debug, Clone)]
pub struct Studio {
    /// The scene file that is painted on; or a model, whose first scene is made, and becomes a file when it is saved.
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
        let is_new = model::is_model(&self.scene);
        let (path, text) = match is_new {
            true => (free_name(&self.scene)?, model::scene_of(&self.scene)?),
            false => {
                let file = SceneFile::read(&self.scene)?;
                (self.scene, String::from_utf8_lossy(file.bytes()).into_owned())
            }
        };
        let listener = server::listen(self.port)?;
        let port = listener.local_addr().map_or(self.port, |address| address.port());
        let (mine, orders) = mpsc::channel();
        let (pages, _) = broadcast::channel(WAITING);
        let setting = Setting { path, overrides: self.overrides, engine: self.engine, folder: self.folder };
        let worker = Worker::open(setting, (text, is_new), (orders, mine.clone()), pages.clone())?;
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

/// What the scene of a model is called.
///
/// Errors: [`Error::Machine`] where that is there already.
fn free_name(model: &Path) -> Result<PathBuf> {
    let path = model.with_extension("json");
    match path.exists() {
        true => Err(Error::Machine(format!(
            "{} is there already; paint on that, or move it away to begin anew",
            path.display()
        ))),
        false => Ok(path),
    }
}
