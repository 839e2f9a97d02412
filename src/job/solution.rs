//! What a job has found.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use super::engine::Engine;
use super::folder::Folder;
use super::light_animation::{self, FoundLightAnimation};
use super::light_map::{self, FoundLightMap};
use super::observer::{Observer, Quiet};
use super::peak_memory;
use super::steps::{Steps, Timings};
use super::transfer::{self, FoundTransfer};
use super::volume::{self, FoundAnimation, FoundVolume};
use super::{Job, Options, Scenes};
use crate::io::scene_file::{Chosen, Resolved};
use crate::problem::{LightMapProblem, VolumeState, render};
use crate::report::{self, Certificate, Coverage, Report};
use crate::scene::{Camera, Image, Scene, Sought, VolumeScene};
use crate::{Error, Result, Warning, warning};

/// What was looked for, as it was found.
enum Found {
    LightMap(Arc<Scene>, Box<FoundLightMap>),
    Transfer(Arc<Scene>, Box<FoundTransfer>),
    Volume(Arc<VolumeScene>, Box<FoundVolume>),
    Animation(Box<FoundAnimation>),
    LightAnimation(Box<FoundLightAnimation>),
}

/// What a job has found: a light map or a volume, what it looks like, and how sure that is.
pub struct Solution {
    found: Found,
    /// What the scene file asked for, where there is one.
    resolved: Option<Arc<Resolved>>,
    /// The command that finds such a solution, and the name of its scene.
    owner: (&'static str, String),
    options: Options,
    /// Where checkpoints went while it was looked for.
    folder: Option<Folder>,
    report: Report,
    timings: Timings,
}

impl std::fmt::Debug for Solution {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Solution").field("report", &self.report).finish_non_exhaustive()
    }
}

/// What was written of a solution.
#[derive(Debug, Clone)]
pub struct Written {
    /// Where.
    pub folder: PathBuf,
    /// The numbers in it.
    pub report: Report,
    /// Whether somebody stopped the job before it was done.
    pub is_interrupted: bool,
}

impl Solution {
    pub(super) fn find(job: &Job, observer: &mut dyn Observer) -> Result<Self> {
        let (found, told) = warning::collected(|| Self::found(job, observer));
        let mut found = found?;
        found.report.warnings = job.warnings.iter().cloned().chain(told).collect();
        Ok(found)
    }

    fn found(job: &Job, observer: &mut dyn Observer) -> Result<Self> {
        let options = &job.options;
        let mut engine = Engine::open(&options.engine, &options.stop)?;
        let owner = (job.scenes.command(), job.scenes.name().to_owned());
        let owned = |folder: Folder| folder.of(owner.0, &owner.1).with_exr(options.exr);
        let folder = options.folder.as_ref().map(Folder::create).transpose()?.map(owned);
        let mut steps = Steps::new(observer, &options.stop, job.timings.clone());
        let found = match &job.scenes {
            Scenes::LightMap(scene) if scene.find == Sought::Transfer => {
                steps.begin("tracing", None);
                let geometry = job.scenes.geometry()?;
                let found =
                    transfer::solve(scene, &geometry, options, &mut engine, folder.as_ref(), &mut steps)?;
                Found::Transfer(scene.clone(), Box::new(found))
            }
            Scenes::LightMap(scene) => {
                let place = light_map::Place {
                    options,
                    folder: folder.as_ref(),
                    prefix: "",
                    is_later: false,
                    others: &[],
                };
                steps.begin("tracing", None);
                let geometry = job.scenes.geometry()?;
                let found = light_map::solve(scene, &geometry, &mut engine, place, &mut steps)?;
                Found::LightMap(scene.clone(), Box::new(found))
            }
            Scenes::Volume(scene) => {
                let found = volume::solve(scene, options, &mut engine, folder.as_ref(), &mut steps)?;
                Found::Volume(scene.clone(), Box::new(found))
            }
            Scenes::Animation(animated) => {
                let found = volume::solve_keys(animated, options, &mut engine, folder.as_ref(), &mut steps)?;
                Found::Animation(Box::new(found))
            }
            Scenes::LightAnimation(animated) => {
                let found =
                    light_animation::solve_keys(animated, options, &mut engine, folder.as_ref(), &mut steps)?;
                Found::LightAnimation(Box::new(found))
            }
        };
        let timings = steps.finish();
        let report = found.report(&timings)?;
        let resolved = job.resolved.clone();
        Ok(Self { found, resolved, owner, options: options.clone(), folder, report, timings })
    }

    /// The light map of a sun, row 0 its top edge as seen upright from the sun; of an animation that of its first key.
    ///
    /// Shapes  as `light_map.size` of the scene
    /// Units   radiance over one steradian
    /// Errors  [`Error::Empty`] where none was looked for
    pub fn light_map(&self) -> Result<Image> {
        match &self.found {
            Found::LightMap(_, found) => found.light_map(),
            Found::LightAnimation(found) => found.light_map(),
            _ => Err(Error::Empty {
                reason: "no light map was looked for".to_owned(),
                remedy: "solve a scene without a volume, with find=light-map",
            }),
        }
    }

    /// The transfer function that was looked for, its first axis to the right and the second downwards.
    ///
    /// Shapes  as `looks.transfer.size` of the scene
    /// Errors  [`Error::Empty`] where none was looked for
    pub fn transfer(&self) -> Result<Image> {
        match &self.found {
            Found::Transfer(_, found) => found.table(),
            _ => Err(Error::Empty {
                reason: "no transfer function was looked for".to_owned(),
                remedy: "set find=transfer in a scene without a volume",
            }),
        }
    }

    /// The volume with what was found, and the light around it; of an animation that of its first key.
    ///
    /// Errors: [`Error::Empty`] where none was looked for.
    pub fn volume(&self) -> Result<&VolumeState> {
        let state = match &self.found {
            Found::LightMap(..) | Found::Transfer(..) | Found::LightAnimation(_) => None,
            Found::Volume(_, found) => Some(found.state()),
            Found::Animation(found) => found.first().map(|key| key.state()),
        };
        state.ok_or_else(|| Error::Empty {
            reason: "no volume was looked for".to_owned(),
            remedy: "solve a scene with a volume",
        })
    }

    /// The picture of a view under what was found, surfaces and all.
    ///
    /// Units   radiance
    /// Errors  [`Error::Value`] for a view that the scene has not
    pub fn picture(&self, view: &str) -> Result<Image> {
        let unknown = || Error::value("view", view, "the name of one of the scene's views");
        match &self.found {
            Found::LightMap(scene, found) => {
                let view = scene.views.iter().position(|seen| seen.name == view).ok_or_else(unknown)?;
                match found.pictures.get(view) {
                    Some(pictures) => Ok(pictures.after.clone()),
                    None => {
                        let LightMapProblem { maps, .. } = &found.problem;
                        Ok(render(scene, maps, Some(&found.computed.solved.x), view)?.after)
                    }
                }
            }
            Found::Transfer(scene, found) => {
                let view = scene.views.iter().position(|seen| seen.name == view).ok_or_else(unknown)?;
                found.picture(scene, view)
            }
            Found::Volume(scene, found) => {
                let view = scene.views.iter().position(|seen| seen.view.name == view).ok_or_else(unknown)?;
                found.picture(view).cloned().ok_or_else(unknown)
            }
            Found::Animation(found) => {
                found.first().and_then(|key| key.picture(view)).cloned().ok_or_else(unknown)
            }
            Found::LightAnimation(found) => found.picture(view).cloned().ok_or_else(unknown),
        }
    }

    /// The picture of a view of a volume that was found, by its number.
    pub(crate) fn volume_picture(&self, view: usize) -> Option<&Image> {
        match &self.found {
            Found::Volume(_, found) => found.picture(view),
            _ => None,
        }
    }

    /// What was wanted of a view of a volume, pixel by pixel, and its weights.
    pub(crate) fn wanted_of_volume(&self, view: usize) -> Option<&[[f32; 4]]> {
        match &self.found {
            Found::Volume(_, found) => found.wanted(view),
            _ => None,
        }
    }

    /// What a camera sees of a volume that was found, that is none of a view's.
    ///
    /// Errors: [`Error::Empty`] where no volume was looked for; those of drawing it.
    pub(crate) fn volume_from(&self, camera: &Camera) -> Result<Image> {
        match &self.found {
            Found::Volume(scene, found) => found.picture_from(scene, camera),
            _ => Err(Error::Empty {
                reason: "no volume was looked for".to_owned(),
                remedy: "solve a scene with a volume",
            }),
        }
    }

    /// What is left of the gradient, computed anew: how far this is from the least of all.
    pub fn certificate(&self) -> &Certificate {
        &self.report.certificate
    }

    /// How many of the elements that were looked for any pixel reaches.
    pub fn coverage(&self) -> &Coverage {
        &self.report.coverage
    }

    /// All numbers.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// Whether somebody stopped the job before it was done.
    pub fn is_interrupted(&self) -> bool {
        match &self.found {
            Found::LightMap(_, found) => found.computed.is_interrupted(),
            Found::Transfer(_, found) => found.computed.is_interrupted(),
            Found::Volume(_, found) => found.is_interrupted(),
            Found::Animation(found) => found.is_interrupted(),
            Found::LightAnimation(found) => found.is_interrupted(),
        }
    }

    /// Writes all results into a folder, each whole or not at all; of an animation the frames are drawn now.
    ///
    /// What was asked lies with them as `scene.resolved.json`, a scene file with every setting, defaults included, which gives the same
    /// results. A job from a scene in memory has none.
    ///
    /// Errors: [`Error::File`]; [`Error::NonFinite`].
    pub fn write(&self, folder: impl AsRef<Path>) -> Result<Written> {
        self.write_observed(folder, &mut Quiet)
    }

    /// The same, heard by an observer, who may stop it between frames.
    pub fn write_observed(&self, path: impl AsRef<Path>, observer: &mut impl Observer) -> Result<Written> {
        let (path, clock) = (path.as_ref(), Instant::now());
        let made;
        let folder = match &self.folder {
            // Its last checkpoint is published with the results.
            Some(folder) if folder.path() == path => folder,
            _ => {
                made = Folder::create(path)?.of(self.owner.0, &self.owner.1).with_exr(self.options.exr);
                &made
            }
        };
        let mut steps = Steps::new(observer, &self.options.stop, self.timings.clone());
        steps.begin("writing", None);
        let (written, told) = warning::collected(|| self.found.write(&self.options, folder, &mut steps));
        let (in_page, drawn) = written?;
        // Of the others everything is written, whoever asks to stop now.
        let leaves_frames_out =
            matches!(self.found, Found::Animation(_) | Found::LightAnimation(_)) && steps.stops();
        let is_interrupted = self.is_interrupted() || leaves_frames_out;
        let total = self.total() + clock.elapsed().as_secs_f64();
        let timings = steps.finish().into_iter().chain([("total".to_owned(), total)]);
        let mut report = Report { timings: timings.collect(), ..self.report.clone() };
        report.warnings.extend(told);
        report.memory.extend(peak_memory().map(|peak| ("peak".to_owned(), peak)));
        if let Some(animation) = &mut report.animation {
            animation.drawn = drawn as u64;
        }
        folder.write_bytes("report.json", report.to_json()?.as_bytes())?;
        folder.write_bytes("report.html", report::html(&report, &in_page)?.as_bytes())?;
        if let Some(resolved) = &self.resolved {
            write_resolved(resolved, &self.found.chosen(), folder)?;
        }
        match self.options.frames.is_some() || leaves_frames_out {
            true => folder.finish_some()?,
            false => folder.finish()?,
        }
        Ok(Written { folder: path.to_owned(), report, is_interrupted })
    }

    /// Seconds until it was found.
    fn total(&self) -> f64 {
        self.timings.iter().map(|(_, seconds)| seconds).sum()
    }
}

/// Writes what was asked. Where a file has a name that JSON cannot hold it is left out: the results are worth more.
fn write_resolved(resolved: &Resolved, chosen: &[Chosen], folder: &Folder) -> Result<()> {
    match resolved.text_in(folder.path(), chosen) {
        Ok(text) => folder.write_bytes("scene.resolved.json", text.as_bytes()),
        Err(error) => {
            Warning::new("left-out", format!("scene.resolved.json is left out: {error}"), "").tell();
            Ok(())
        }
    }
}

impl Found {
    fn report(&self, timings: &Timings) -> Result<Report> {
        match self {
            Self::LightMap(scene, found) => found.report(scene, timings),
            Self::Transfer(scene, found) => found.report(scene, timings),
            Self::Volume(scene, found) => found.report(scene, timings),
            Self::Animation(found) => found.report(timings),
            Self::LightAnimation(found) => found.report(timings),
        }
    }

    /// Values that the scene file has not, and that were fitted to it.
    fn chosen(&self) -> Vec<Chosen> {
        match self {
            Self::LightMap(scene, found) => found.chosen(scene),
            Self::LightAnimation(found) => found.chosen(),
            Self::Transfer(..) | Self::Volume(..) | Self::Animation(_) => Vec::new(),
        }
    }

    /// Writes everything but the report; gives back the pictures of the page, and how many frames were drawn.
    fn write(
        &self,
        options: &Options,
        folder: &Folder,
        steps: &mut Steps<'_>,
    ) -> Result<(report::Pictures, usize)> {
        match self {
            Self::LightMap(scene, found) => Ok((found.write(scene, folder)?, 0)),
            Self::Transfer(scene, found) => Ok((found.write(scene, folder)?, 0)),
            Self::Volume(scene, found) => Ok((found.write(scene, options, folder)?, 0)),
            Self::Animation(found) => found.write(options, folder, steps),
            Self::LightAnimation(found) => found.write(folder, steps),
        }
    }
}
