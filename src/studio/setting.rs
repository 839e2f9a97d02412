//! What is at hand when the studio opens: the scene, what computes, and where results go.

use std::path::PathBuf;
use std::sync::Arc;

use super::messages::CameraRecord;
use crate::io::scene_file::{Extent, SceneFile};
use crate::job::{EngineChoice, Job, LiveJob, Options, Preview, Scenes};
use crate::scene::{Camera, Scene};
use crate::{Error, Result};

/// Preview widths in pixels, from the finest that is tried to the coarsest.
pub(super) const WIDTHS: [usize; 4] = [320, 240, 160, 96];

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

    /// The first of some widths of previews at which the rows fit, and that width.
    pub(super) fn warm(&self, job: &Job, widths: &[usize]) -> Result<(LiveJob, usize)> {
        let mut refused = None;
        for &width in widths {
            let options = Options { engine: self.engine.clone(), ..Options::default() };
            match job.clone().with(options).live(Preview::Width(width)) {
                Ok(live) => return Ok((live, width)),
                Err(error @ Error::TooLarge { .. }) => refused = Some(error),
                Err(error) => return Err(error),
            }
        }
        Err(refused.unwrap_or_else(|| Error::Machine("no preview fits".to_owned())))
    }
}

/// The scene of a job that the studio can show.
pub(super) fn scene_of(job: &Job) -> Result<Scene> {
    let Scenes::LightMap(scene) = job.scenes() else {
        return Err(Error::Empty {
            reason: "the studio paints light maps, and this is a scene of a volume".to_owned(),
            remedy: "paint on a scene without `volume`, or use `unscatter volume`",
        });
    };
    if scene.surroundings.is_some() {
        return Err(Error::Empty {
            reason: "the studio shows no lights around a scene that are looked for".to_owned(),
            remedy: "leave `surroundings` away while you paint",
        });
    }
    Ok(Scene::clone(scene))
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

/// Where the light map lies, as a scene file has it.
pub(super) fn extent(live: &LiveJob) -> Extent {
    let extent = live.extent();
    Extent { min: extent.min.to_array(), max: extent.max.to_array() }
}

/// A camera as pages turn it: what is in the middle of its picture, and the angle from the top to the bottom of it.
pub(super) fn record(camera: &Camera, depth: f64) -> CameraRecord {
    let [width, height] = camera.size().map(|side| side as f64);
    let towards = |y: f64| camera.ray(0.5 * width, y).direction;
    let (forward, top, bottom) = (towards(0.5 * height), towards(0.0), towards(height));
    let up = (top - bottom).normalize_or(glam::DVec3::Y);
    CameraRecord {
        origin: camera.position().to_array(),
        target: (camera.position() + depth * forward).to_array(),
        up: up.to_array(),
        fov: top.angle_between(bottom).to_degrees(),
    }
}
