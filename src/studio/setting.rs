//! What is at hand when the studio opens: the scene, what computes, and where results go.

use std::path::PathBuf;
use std::sync::Arc;

use crate::Result;
use crate::io::scene_file::{Extent, SceneFile, edit};
use crate::job::{EngineChoice, Job};

/// The scene file, what replaces values in it, what computes, and where exports go.
#[derive(Debug, Clone)]
pub(super) struct Setting {
    pub(super) path: PathBuf,
    pub(super) overrides: Vec<String>,
    pub(super) engine: EngineChoice,
    pub(super) folder: PathBuf,
}

impl Setting {
    /// The job of a text of the scene: that of the command, once it is saved.
    pub(super) fn job(&self, text: &str) -> Result<Job> {
        Job::of_file(&SceneFile::of(&self.path, text), &self.overrides)
    }

    /// The same, its light map where painted light comes through whatever the text says.
    pub(super) fn fitted_job(&self, text: &str) -> Result<Job> {
        let mut overrides = self.overrides.clone();
        overrides.push("light_map.extent=null".to_owned());
        Job::of_file(&SceneFile::of(&self.path, text), &overrides)
    }
}

/// A text whose light map lies somewhere, where there is one.
///
/// Errors: those of [`edit`].
pub(super) fn located(text: String, extent: Option<&Extent>) -> Result<String> {
    extent.map_or(Ok(text.clone()), |extent| edit::with_light_map_at(&text, extent))
}

/// As many threads as there are cores, which give way to all others.
pub(super) fn patient_threads() -> Option<Arc<rayon::ThreadPool>> {
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
