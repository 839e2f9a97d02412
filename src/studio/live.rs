//! What is painted on: light shafts and the light map behind them, or a volume.

use std::sync::Arc;

use super::messages::{CameraRecord, Names, ViewRecord};
use super::pictures::Seen;
use super::setting::Setting;
use crate::io::scene_file::Extent;
use crate::job::{Job, LiveJob, LiveVolume, Options, Preview, Scenes};
use crate::problem::{HeterogeneousAir, TransferFunction};
use crate::scene::{Camera, Image, Rgb, Scene, Stroke, VolumeScene};
use crate::{Error, Result};

/// Preview widths in pixels, from the finest that is tried to the coarsest.
pub(super) const WIDTHS: [usize; 4] = [320, 240, 160, 96];
/// Where the widths of a drag begin, and of volumes, whose previews are solved from the start each time.
const HASTY: usize = 2;

/// What previews are made of.
pub(super) enum Live {
    LightMap(Box<LiveJob>),
    Volume(Box<LiveVolume>),
}

/// A scene that the studio can show.
pub(super) enum Subject {
    LightMap(Arc<Scene>),
    Volume(Arc<VolumeScene>),
}

/// What is kept of a scene for previews.
pub(super) struct Rows {
    pub(super) subject: Subject,
    pub(super) live: Live,
    /// Whether previews are coarser than they should be, because finer ones do not fit: their width.
    pub(super) coarser: Option<usize>,
    pub(super) records: Vec<ViewRecord>,
    pub(super) names: Names,
    /// How many metres the first view is deep.
    pub(super) span: f64,
    /// Whether previews are coarse while light or air are dragged.
    pub(super) is_hasty: bool,
}

impl Subject {
    /// Errors: [`Error::Empty`] for what the studio cannot show.
    pub(super) fn of(job: &Job) -> Result<Self> {
        match job.scenes() {
            Scenes::LightMap(scene) if scene.surroundings.is_some() => Err(Error::Empty {
                reason: "the studio shows no lights around a scene that are looked for".to_owned(),
                remedy: "leave `surroundings` away while you paint",
            }),
            Scenes::LightMap(scene) => Ok(Self::LightMap(scene.clone())),
            Scenes::Volume(scene) => Ok(Self::Volume(scene.clone())),
            Scenes::LightAnimation(_) => Err(Error::Empty {
                reason: "the studio paints on a scene that stays as it is, and this one moves".to_owned(),
                remedy: "leave `animation` away while you paint",
            }),
            Scenes::Animation(_) => Err(Error::Empty {
                reason: "the studio paints on a volume that stays as it is, and this one moves".to_owned(),
                remedy: "leave `animation` away while you paint",
            }),
        }
    }

    pub(super) fn name(&self) -> &str {
        match self {
            Self::LightMap(scene) => &scene.name,
            Self::Volume(scene) => &scene.name,
        }
    }

    /// The radiance of the sun; black where there is no one sun.
    pub(super) fn radiance(&self) -> Rgb {
        match self {
            Self::LightMap(scene) => scene.light.radiance,
            Self::Volume(_) => [0.0; 3],
        }
    }

    /// Stops by which pictures are brightened, where the scene says so.
    pub(super) fn exposure(&self) -> Option<f64> {
        match self {
            Self::LightMap(scene) => scene.exposure,
            Self::Volume(scene) => Some(scene.exposure),
        }
    }

    /// Iterations of a solve at most.
    pub(super) fn iterations(&self) -> usize {
        match self {
            Self::LightMap(scene) => scene.solve.iterations,
            Self::Volume(scene) => scene.solve.iterations,
        }
    }

    /// Where the sun's light goes, and the mean extinction in 1/metre; none where they are not one number.
    pub(super) fn look(&self) -> Option<([f64; 3], f64)> {
        let Self::LightMap(scene) = self else { return None };
        let [r, g, b] = scene.medium.sigma_t.map(|sigma| sigma / scene.metres_per_unit);
        // A mean of three that are the same may be another number.
        let sigma_t = if r == g && g == b { r } else { (r + g + b) / 3.0 };
        Some((scene.light.direction.to_array(), sigma_t))
    }

    /// What looks may name.
    fn names(&self) -> Names {
        let Self::LightMap(scene) = self else { return Names::default() };
        fn each<'a>(names: impl Iterator<Item = Option<&'a String>>) -> Vec<String> {
            let mut all: Vec<String> = names.flatten().cloned().collect();
            all.sort();
            all.dedup();
            all
        }
        Names {
            objects: each(scene.mesh.objects.iter().map(|object| object.name.as_ref())),
            materials: each(scene.mesh.materials.iter().map(|material| material.name.as_ref())),
        }
    }

    fn cameras(&self) -> Vec<(String, Camera)> {
        match self {
            Self::LightMap(scene) => {
                scene.views.iter().map(|view| (view.name.clone(), view.camera.clone())).collect()
            }
            Self::Volume(scene) => {
                let views = scene.views.iter().map(|view| &view.view);
                views.map(|view| (view.name.clone(), view.camera.clone())).collect()
            }
        }
    }

    pub(super) fn metres_per_unit(&self) -> f64 {
        match self {
            Self::LightMap(scene) => scene.metres_per_unit,
            Self::Volume(_) => 1.0,
        }
    }
}

impl Rows {
    /// Those of a drag are few.
    ///
    /// Errors: those of [`Subject::of`], and of keeping rows.
    pub(super) fn of(setting: &Setting, job: &Job, is_hasty: bool) -> Result<Self> {
        let subject = Subject::of(job)?;
        let is_volume = matches!(subject, Subject::Volume(_));
        let widths = if is_hasty || is_volume { &WIDTHS[HASTY..] } else { &WIDTHS };
        let (live, width) = Live::warm(setting, job, widths)?;
        let cameras = subject.cameras();
        let records = cameras.iter().enumerate().map(|(view, (name, camera))| {
            Ok(ViewRecord {
                name: name.clone(),
                size: camera.size(),
                preview: live.size(view, name)?,
                camera: record(camera, live.depth(camera)),
            })
        });
        let records = records.collect::<Result<Vec<_>>>()?;
        let depth = cameras.first().map_or(1.0, |(_, camera)| live.depth(camera));
        let span = depth * subject.metres_per_unit();
        let coarser = Some(width).filter(|&width| width < widths[0]);
        let names = subject.names();
        Ok(Self { subject, live, coarser, records, names, span, is_hasty })
    }
}

impl Live {
    /// The first of some widths of previews at which the rows fit, and that width.
    fn warm(setting: &Setting, job: &Job, widths: &[usize]) -> Result<(Self, usize)> {
        let mut refused = None;
        for &width in widths {
            let job = job.clone().with(Options { engine: setting.engine.clone(), ..Options::default() });
            let preview = Preview::Width(width);
            let live = match job.scenes() {
                Scenes::LightMap(_) => job.live(preview).map(|live| Self::LightMap(Box::new(live))),
                _ => job.live_volume(preview).map(|live| Self::Volume(Box::new(live))),
            };
            match live {
                Ok(live) => return Ok((live, width)),
                Err(error @ Error::TooLarge { .. }) => refused = Some(error),
                Err(error) => return Err(error),
            }
        }
        Err(refused.unwrap_or_else(|| Error::Machine("no preview fits".to_owned())))
    }

    /// What previews show as it is.
    ///
    /// Errors: those of making previews.
    pub(super) fn seen(&mut self) -> Result<Seen<'_>> {
        Ok(match self {
            Self::LightMap(live) => Seen::LightMap(live.pictures()?),
            Self::Volume(live) => Seen::Volume(live),
        })
    }

    fn size(&self, view: usize, name: &str) -> Result<[usize; 2]> {
        match self {
            Self::LightMap(live) => live.size(name),
            Self::Volume(live) => Ok(live.size(view)),
        }
    }

    fn depth(&self, camera: &Camera) -> f64 {
        match self {
            Self::LightMap(live) => live.depth(camera),
            Self::Volume(live) => live.depth(camera),
        }
    }

    /// Paints a preview anew.
    ///
    /// Errors: [`Error::Value`] for a stroke that paints no pixel.
    pub(super) fn repaint(&mut self, view: usize, name: &str, strokes: Vec<Stroke>) -> Result<()> {
        match self {
            Self::LightMap(live) => live.repaint(name, strokes),
            Self::Volume(live) => live.repaint(view, strokes),
        }
    }

    /// What a camera sees that is none of the views'.
    ///
    /// Errors: those of drawing it.
    pub(super) fn picture_from(&self, camera: &Camera) -> Result<Image> {
        match self {
            Self::LightMap(live) => live.picture_from(camera),
            Self::Volume(live) => live.picture_from(camera),
        }
    }

    /// Whether anything is wanted: visible paint that is not erased, or a picture.
    pub(super) fn is_wanted(&self) -> bool {
        match self {
            Self::LightMap(live) => live.is_painted(),
            Self::Volume(live) => live.is_wanted(),
        }
    }

    /// The colours of scattered light, where the scene has a transfer function.
    pub(super) fn transfer(&self) -> Option<&TransferFunction> {
        match self {
            Self::LightMap(live) => live.transfer(),
            Self::Volume(_) => None,
        }
    }

    /// The heterogeneous air of a scene of a light map.
    pub(super) fn air(&self) -> Option<&HeterogeneousAir> {
        match self {
            Self::LightMap(live) => live.air(),
            Self::Volume(_) => None,
        }
    }

    /// Where the light map lies, as a scene file has it.
    pub(super) fn extent(&self) -> Option<Extent> {
        let Self::LightMap(live) = self else { return None };
        let extent = live.extent();
        Some(Extent { min: extent.min.to_array(), max: extent.max.to_array() })
    }
}

/// A camera as pages turn it: what is in the middle of its picture, and the angle from the top to the bottom of it.
fn record(camera: &Camera, depth: f64) -> CameraRecord {
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
