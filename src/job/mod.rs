//! One job for all faces: from a scene to what was looked for in it, its pictures, and the files of the result.
//!
//! ```no_run
//! use unscatter::job::{Job, Quiet};
//!
//! let found = Job::open("strokes/citadel.json")?.solve(&mut Quiet)?;
//! let light_map = found.light_map()?;
//! found.write("out/citadel")?;
//! # Ok::<(), unscatter::Error>(())
//! ```

mod air;
mod asked;
mod checkpoint;
mod compute;
mod engine;
mod environment;
mod exposure;
mod film;
mod findings;
mod folder;
mod held;
mod light_animation;
mod light_map;
mod light_views;
mod live;
mod live_pictures;
mod live_volume;
mod lock;
mod matrix;
mod memory;
mod observer;
mod painted;
mod placement;
mod plan;
mod preview;
mod solution;
mod steps;
mod transfer;
mod volume;
mod warnings;

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::io::image::ExrCompression;
use crate::io::scene_file::{
    Animated, AnimatedDocument, AnimatedVolume, Document, Resolved, SceneFile, Subject, VolumeDocument,
};
use crate::io::volume::Format;
use crate::problem::{Drawing, DrawnLight};
use crate::scene::{AnimatedScene, Look, Scene, Sought, VolumeScene};
use crate::{Error, Result, Warning, warning};

pub use crate::io::machine::{default_budget, free_memory, peak_memory, processor};

pub(crate) use asked::AskedProblem;
#[cfg(feature = "gpu")]
pub(crate) use compute::device;
pub(crate) use engine::Engine;
pub use engine::{Backend, EngineChoice};
#[cfg(feature = "studio")]
pub(crate) use exposure::readable;
pub(crate) use folder::Folder;
#[cfg(feature = "cli")]
pub(crate) use folder::abandon;
pub use live::{LiveJob, LiveMoment, Standing};
pub use live_pictures::LivePictures;
pub use live_volume::LiveVolume;
pub use matrix::Exported;
pub(crate) use memory::MemoryBudget;
#[cfg(feature = "cli")]
pub(crate) use memory::mebibytes;
pub use observer::{Iteration, Observer, Quiet, Step, Stop, Wish};
pub use plan::Plan;
pub use preview::Preview;
pub use solution::{Solution, Written};
pub(crate) use steps::Steps;
use steps::Timings;

/// What a job starts from.
#[derive(Debug, Clone)]
pub enum Scenes {
    /// Painted views of a sun in a homogeneous medium.
    LightMap(Arc<Scene>),
    /// A volume.
    Volume(Arc<VolumeScene>),
    /// A volume that changes from frame to frame.
    Animation(Arc<AnimatedVolume>),
    /// Views of a sun in a homogeneous medium, which move with it and with the looks from frame to frame.
    LightAnimation(Arc<AnimatedScene>),
}

impl From<Scene> for Scenes {
    fn from(scene: Scene) -> Self {
        Self::LightMap(Arc::new(scene))
    }
}

impl From<VolumeScene> for Scenes {
    fn from(scene: VolumeScene) -> Self {
        Self::Volume(Arc::new(scene))
    }
}

impl From<AnimatedVolume> for Scenes {
    fn from(animated: AnimatedVolume) -> Self {
        Self::Animation(Arc::new(animated))
    }
}

impl From<AnimatedScene> for Scenes {
    fn from(animated: AnimatedScene) -> Self {
        Self::LightAnimation(Arc::new(animated))
    }
}

impl Scenes {
    /// What the scene is called.
    fn name(&self) -> &str {
        match self {
            Self::LightMap(scene) => &scene.name,
            Self::Volume(scene) => &scene.name,
            Self::Animation(animated) => {
                animated.animation.keys.first().map_or("", |key| key.scene.name.as_str())
            }
            Self::LightAnimation(animated) => {
                animated.animation.keys.first().map_or("", |key| key.scene.name.as_str())
            }
        }
    }

    /// Whether they are of a sun in a homogeneous medium, and not of a volume.
    pub(crate) fn have_light_maps(&self) -> bool {
        matches!(self, Self::LightMap(_) | Self::LightAnimation(_))
    }

    /// The command that solves such scenes.
    fn command(&self) -> &'static str {
        match self {
            Self::LightMap(_) => "light-map",
            Self::Volume(_) => "volume",
            Self::Animation(_) | Self::LightAnimation(_) => "animate",
        }
    }
}

/// How a job is done, beside what its scene says.
#[derive(Debug, Clone)]
pub struct Options {
    /// What computes.
    pub engine: EngineChoice,
    /// Bit-identical results in every run on graphics adapters, too, at a price; the processor always gives them.
    pub deterministic: bool,
    /// Find shadows and the depth behind painted pixels by a depth pass on the adapter instead of by rays.
    pub rasterize: bool,
    /// Where checkpoints and previews go while it runs; none: there are none.
    pub folder: Option<PathBuf>,
    /// Go on from the checkpoint in that folder.
    pub resume: bool,
    /// How long a solve runs at most without a checkpoint.
    pub checkpoint_every: Duration,
    /// Whether the pictures of the views are drawn and written.
    pub pictures: bool,
    /// How EXR files are packed.
    pub exr: ExrCompression,
    /// Pictures of a volume from all around.
    pub turntable: usize,
    /// What pictures of views under a light map show; those beside a light map that was found show all light.
    pub light: DrawnLight,
    /// How what the medium scatters of the sun is drawn, where views are drawn and nothing is solved.
    pub drawing: Drawing,
    /// The formats that volumes are written in.
    pub formats: Vec<Format>,
    /// Looks that pictures of views are drawn without, to compare; those of a solve have them all.
    pub without: Vec<Look>,
    /// Frames of an animation that are drawn; all by default.
    pub frames: Option<RangeInclusive<usize>>,
    /// Whether the volumes of every frame are written, and not of the keys alone.
    pub frame_volumes: bool,
    /// A request to stop, which is heard within an iteration.
    pub stop: Stop,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            engine: EngineChoice::default(),
            deterministic: false,
            rasterize: false,
            folder: None,
            resume: false,
            checkpoint_every: Duration::from_secs(10),
            pictures: true,
            exr: ExrCompression::default(),
            turntable: 8,
            light: DrawnLight::All,
            drawing: Drawing::default(),
            without: Vec::new(),
            formats: vec![Format::Npy, Format::Vdb],
            frames: None,
            frame_volumes: false,
            stop: Stop::default(),
        }
    }
}

/// A scene, and how to find what is looked for in it.
///
/// A job owns all that it needs; nothing of it is shared with other jobs, and nothing is printed.
#[derive(Debug, Clone)]
pub struct Job {
    scenes: Scenes,
    /// What the scene file asked for, where there is one.
    resolved: Option<Arc<Resolved>>,
    options: Options,
    /// Seconds that reading took.
    timings: Timings,
    /// What was to be known of the files.
    warnings: Vec<Warning>,
}

impl Job {
    /// Reads a scene file.
    ///
    /// Errors: those of [`crate::io::scene_file::load`] and its siblings; [`crate::Error::TooLarge`] when what it describes alone exceeds the memory
    /// that may be used, before any of it is made.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        Self::open_with(path, &[])
    }

    /// Reads a scene file, with values replaced: `PATH=VALUE`, such as `views[0].camera.fov=50`.
    ///
    /// Errors: as [`Self::open`]; [`crate::Error::Value`] for a path that names nothing.
    pub fn open_with(path: impl AsRef<Path>, overrides: &[String]) -> Result<Self> {
        Self::of_file(&SceneFile::read(path)?, overrides)
    }

    /// From a scene file that was read, with values replaced.
    ///
    /// Errors: as [`Self::open_with`].
    pub fn of_file(file: &SceneFile, overrides: &[String]) -> Result<Self> {
        let clock = Instant::now();
        let (read, warnings) = warning::collected(|| Self::read(file, overrides));
        let (scenes, resolved) = read?;
        let reading = ("reading".to_owned(), clock.elapsed().as_secs_f64());
        Ok(Self { resolved: Some(Arc::new(resolved)), timings: vec![reading], warnings, ..Self::new(scenes) })
    }

    fn read(file: &SceneFile, overrides: &[String]) -> Result<(Scenes, Resolved)> {
        Ok(match file.subject() {
            Subject::LightMap => {
                let (scene, resolved) = file.open::<Document>(overrides)?;
                tracing::info!(name = scene.name, views = scene.views.len(), "scene");
                memory::check_scene(&scene)?;
                (scene.into(), resolved)
            }
            Subject::Volume => {
                let (scene, resolved) = file.open::<VolumeDocument>(overrides)?;
                tracing::info!(name = scene.name, views = scene.views.len(), "scene");
                memory::check_volume(&scene)?;
                (scene.into(), resolved)
            }
            Subject::Animation => {
                let (animated, resolved) = file.open::<Animated>(overrides)?;
                let keys = &animated.animation.keys;
                tracing::info!(keys = keys.len(), frames = animated.animation.frames, "animation");
                memory::check_keys(keys)?;
                (animated.into(), resolved)
            }
            Subject::LightAnimation => {
                let (animated, resolved) = file.open::<AnimatedDocument>(overrides)?;
                let keys = &animated.animation.keys;
                tracing::info!(keys = keys.len(), frames = animated.animation.frames, "animation");
                memory::check_light_keys(keys)?;
                (animated.into(), resolved)
            }
        })
    }

    /// From a scene in memory, of which there is no [`Self::resolved`] document.
    pub fn new(scenes: impl Into<Scenes>) -> Self {
        let (options, timings) = (Options::default(), Timings::new());
        Self { scenes: scenes.into(), resolved: None, options, timings, warnings: Vec::new() }
    }

    /// The same with other options.
    pub fn with(self, options: Options) -> Self {
        Self { options, ..self }
    }

    /// What it starts from.
    pub fn scenes(&self) -> &Scenes {
        &self.scenes
    }

    /// What it starts from, without the rest of the job.
    pub(crate) fn into_scenes(self) -> Scenes {
        self.scenes
    }

    /// What the scene file asked for, with every setting; none of a scene that came without a file.
    pub fn resolved(&self) -> Option<&Resolved> {
        self.resolved.as_deref()
    }

    /// The scene of a light map.
    ///
    /// Errors: [`Error::Empty`] where it is of a volume, or moves, or a transfer function is looked for.
    pub(crate) fn into_light_map(self) -> Result<Scene> {
        let (reason, remedy) = match self.scenes {
            Scenes::LightMap(scene) if scene.find == Sought::LightMap => {
                return Ok(Arc::unwrap_or_clone(scene));
            }
            Scenes::LightMap(_) => ("a transfer function is looked for", "set find=light-map"),
            _ => (
                "there is no scene of a light map",
                "give a scene without a volume, and without an animation",
            ),
        };
        Err(Error::Empty { reason: reason.to_owned(), remedy })
    }

    /// Takes the looks away that pictures are to be drawn without.
    fn leave_out(&self, scene: &mut Scene) {
        let looks = scene.looks.without(&self.options.without);
        if !self.options.without.is_empty() && looks == scene.looks {
            let text = "the scene has none of the looks that pictures should be without";
            Warning::new("no-such-look", text, "see `looks` of its file").tell();
        }
        scene.looks = looks;
    }

    fn steps<'a>(&'a self, observer: &'a mut dyn Observer) -> Steps<'a> {
        Steps::new(observer, &self.options.stop, self.timings.clone())
    }

    /// What it would take, stage by stage and key by key, without doing it.
    ///
    /// Errors: [`crate::Error::TooLarge`] when it would not fit; those of making the problem.
    pub fn plan(&self, observer: &mut impl Observer) -> Result<Vec<Plan>> {
        let (geometry, mut steps) = (self.scenes.geometry()?, self.steps(observer));
        self.scenes.asked(&geometry, &mut steps)?.into_iter().map(Plan::of).collect()
    }

    /// Finds what is looked for. Who asks to stop is heard within an iteration, and what was computed is kept.
    ///
    /// Errors: [`crate::Error::Adapter`] where what should compute does not; [`crate::Error::TooLarge`]; [`crate::Error::Checkpoint`] where
    /// there is none to go on from; [`crate::Error::File`] where the folder cannot be written.
    pub fn solve(&self, observer: &mut impl Observer) -> Result<Solution> {
        Solution::find(self, observer)
    }

    /// Keeps the job warm, for somebody who paints: see [`LiveJob`].
    ///
    /// Errors: [`Error::Empty`] for a scene without a light map, or where light reaches no pixel; [`Error::TooLarge`] where the rows of all
    /// pixels do not fit.
    pub fn live(self, preview: Preview) -> Result<LiveJob> {
        LiveJob::new(self, preview)
    }

    /// The same of a volume: see [`LiveVolume`].
    ///
    /// Errors: [`Error::Empty`] for a scene without a volume, or of one that changes from frame to frame; those of drawing it.
    pub fn live_volume(self, preview: Preview) -> Result<LiveVolume> {
        LiveVolume::new(self, preview)
    }

    /// Draws the views as they are, under the light of the scene or under a light map from a file, and writes them to a folder.
    /// Gives back the names of the files; none where somebody stopped it.
    ///
    /// Errors: [`crate::Error::File`]; [`crate::Error::Format`] for a light map that cannot be read.
    pub fn draw(
        &self,
        light_map: Option<&Path>,
        folder: impl Into<PathBuf>,
        observer: &mut impl Observer,
    ) -> Result<Option<Vec<PathBuf>>> {
        let folder = Folder::create(folder)?.of("render", self.scenes.name()).with_exr(self.options.exr);
        let mut engine = Engine::open(&self.options.engine, &self.options.stop)?;
        let mut steps = self.steps(observer);
        let mut names = Vec::new();
        let is_whole = match self.scenes.have_light_maps() {
            true => {
                steps.begin("tracing", None);
                let geometry = self.scenes.geometry()?;
                let mut scenes = self.scenes.light_scenes(&geometry)?;
                scenes.iter_mut().for_each(|(_, scene)| self.leave_out(scene));
                let shown = (light_map, self.options.light, self.options.drawing);
                light_views::draw(&scenes, &geometry, shown, (&mut engine, &folder), &mut steps, &mut names)?
            }
            false => {
                let (geometry, turns) = (self.scenes.geometry()?, self.options.turntable);
                let mut is_whole = true;
                for (prefix, scene) in &self.scenes.volumes() {
                    is_whole = is_whole
                        && volume::draw(
                            scene,
                            &geometry,
                            prefix,
                            turns,
                            (&mut engine, &folder),
                            &mut steps,
                            &mut names,
                        )?;
                }
                is_whole
            }
        };
        if !is_whole {
            return Ok(None);
        }
        folder.finish()?;
        Ok(Some(names.into_iter().map(|name| folder.path().join(name)).collect()))
    }

    /// The matrix of its first problem with its right-hand side and start.
    ///
    /// Errors: [`crate::Error::Value`] where one matrix cannot hold three channels; [`crate::Error::TooLarge`].
    pub fn matrix(&self, observer: &mut impl Observer) -> Result<Exported> {
        matrix::of(self, &mut self.steps(observer))
    }
}
