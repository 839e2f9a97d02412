//! What page and studio say to each other. docs/studio.md has the words; pictures travel in binary.

use std::sync::Arc;

use axum::body::Bytes;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::drawing::Change;
use crate::io::scene_file::{Camera, Group, LookAt, Stroke, Transform};
use crate::scene::Image;

/// What a page asks for.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged)]
pub(super) enum Asked {
    /// Something of the strokes.
    Change(Change),
    /// Something else.
    Wish(Wish),
}

/// What a page asks for that changes no stroke.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Wish {
    /// The pen touches, or has left.
    Pen { down: bool },
    /// The strokes are to be in the scene file.
    Save,
    /// What the command writes is to be written.
    Export,
    /// An export is to stop.
    Cancel,
    /// The light map is to lie where painted light comes through.
    Fit,
    /// Pictures are to be brightened by this factor.
    Exposure { value: f64 },
    /// The pictures that the page shows.
    Watch { pictures: Vec<Kind> },
    /// What is seen at a pixel of the full picture, as the paint that asks for it.
    Reach { view: usize, x: f64, y: f64 },
    /// What object is seen at a pixel of the full picture.
    What { view: usize, x: f64, y: f64 },
    /// What a camera sees that is none of the views'; `view` says how large its picture is.
    LookFrom { view: usize, camera: CameraRecord },
    /// That camera is to be a view, as large as the picture that was seen from it.
    AddView { name: String, camera: CameraRecord },
}

/// What a picture shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Kind {
    /// A view under the light map.
    After,
    /// A view under the plain light.
    Before,
    /// What the paint asks for.
    Target,
    /// How far that is missed.
    Difference,
    /// Where no light comes through the light map, as alpha.
    Coverage,
    /// Where paint contradicts other paint, as alpha.
    Conflict,
    /// The light map, relative to the light.
    LightMap,
    /// What a camera sees that is none of the views'.
    Free,
    /// The colours of a transfer function.
    Transfer,
    /// How deep a view is, as 24 bits of a logarithm.
    Depth,
}

/// How far a picture is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Stage {
    /// Small, and still improving.
    Preview,
    /// As the command draws it.
    Full,
}

/// A camera as pages turn it: straight, and upright as `up` says.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraRecord {
    pub(super) origin: [f64; 3],
    pub(super) target: [f64; 3],
    pub(super) up: [f64; 3],
    /// From the top to the bottom of its picture, in degrees.
    pub(super) fov: f64,
}

impl CameraRecord {
    /// As a scene file has it.
    pub(super) fn document(&self, size: [usize; 2]) -> Camera {
        let Self { origin, target, up, fov } = *self;
        let to_world = Transform { look_at: Some(LookAt { origin, target, up }), ..Transform::default() };
        Camera::new(to_world, fov, size)
    }
}

/// A view as pages know it.
#[derive(Debug, Clone, Serialize)]
pub(super) struct ViewRecord {
    pub(super) name: String,
    /// Of the full picture.
    pub(super) size: [usize; 2],
    pub(super) preview: [usize; 2],
    pub(super) camera: CameraRecord,
}

/// What looks may name of a scene, each name once.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Names {
    pub(super) objects: Vec<String>,
    pub(super) materials: Vec<String>,
}

/// What the solve is at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(super) enum Phase {
    #[serde(rename = "nothing painted")]
    NothingPainted,
    #[serde(rename = "preview")]
    Preview,
    #[serde(rename = "full")]
    Full,
    #[serde(rename = "done")]
    Done,
}

/// What kind of news it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum News {
    Error,
    Warning,
    Done,
}

/// What the studio tells its pages.
#[derive(Debug, Clone, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum Told<'a> {
    Hello {
        scene: &'a str,
        path: String,
        version: &'static str,
        views: &'a [ViewRecord],
        exposure: f64,
        palette: &'a [String],
        /// Whether there is no scene file yet.
        is_new: bool,
        /// Whether a volume is painted on, and not light shafts.
        is_volume: bool,
    },
    Strokes {
        views: Vec<Vec<&'a Stroke>>,
        groups: &'a [Group],
        /// Counts changes. A picture of this revision shows them.
        revision: u64,
        can_undo: bool,
        can_redo: bool,
        is_saved: bool,
    },
    Progress {
        phase: Phase,
        iteration: usize,
        /// Relative to that at x₀.
        gradient: f64,
        met: Option<f64>,
        seconds: f64,
        /// What stands in the way of the paint, in words; of the full resolution alone.
        remarks: &'a [String],
        /// Numbers with their names, of the full resolution alone.
        details: &'a [[String; 2]],
    },
    /// The light and the air; nothing where they cannot be changed.
    Look {
        sun: Option<[f64; 3]>,
        /// The mean extinction in 1/metre, and how many metres the first view is deep.
        sigma_t: Option<f64>,
        span: f64,
    },
    Looks {
        /// As the scene's text will have them.
        looks: &'a Value,
        names: &'a Names,
        /// Texels of the shadow map along its longer side.
        texels: usize,
        metres_per_unit: f64,
        /// The depth at the end of the transfer function's axis, in metres.
        far: Option<f64>,
        /// Where the points of each of its layers are on its axes.
        places: &'a [Vec<[f64; 2]>],
        /// The side of a cube of the air's noise and of a voxel that is painted, in metres.
        air_size: Option<f64>,
        air_voxel: Option<f64>,
    },
    /// What is seen at a pixel; no number where nothing is.
    Seen {
        view: usize,
        x: f64,
        y: f64,
        object: Option<&'a str>,
        material: Option<&'a str>,
        occluder: Option<usize>,
    },
    Reached {
        view: usize,
        x: f64,
        y: f64,
        color: String,
    },
    Notice {
        kind: News,
        text: String,
    },
    Exporting {
        text: String,
        part: Option<f64>,
        is_running: bool,
    },
}

/// A message and who gets it.
#[derive(Debug, Clone)]
pub(super) struct Mail {
    /// The number of a page; none for all.
    pub(super) to: Option<u64>,
    pub(super) sent: Sent,
}

/// A message on its way to pages.
#[derive(Debug, Clone)]
pub(super) enum Sent {
    Text(Arc<str>),
    Picture(Bytes),
}

impl Told<'_> {
    pub(super) fn sent(&self) -> Sent {
        // Nothing here cannot be JSON.
        Sent::Text(serde_json::to_string(self).unwrap_or_default().into())
    }
}

/// What stands before the pixels of a picture.
#[derive(Serialize)]
struct Header {
    kind: Kind,
    view: Option<usize>,
    size: [usize; 2],
    stage: Stage,
    serial: u64,
    revision: u64,
}

/// A picture of a view, or of the light map, as RGBA in sRGB.
pub(super) fn picture(
    (kind, view): (Kind, Option<usize>),
    (stage, serial, revision): (Stage, u64, u64),
    size: [usize; 2],
    pixels: &[u8],
) -> Sent {
    let header =
        serde_json::to_vec(&Header { kind, view, size, stage, serial, revision }).unwrap_or_default();
    let mut bytes = Vec::with_capacity(4 + header.len() + pixels.len());
    bytes.extend_from_slice(&(header.len() as u32).to_le_bytes());
    bytes.extend_from_slice(&header);
    bytes.extend_from_slice(pixels);
    Sent::Picture(bytes.into())
}

/// A colour as pages write it, from linear; what is brighter than white is white.
pub(super) fn hex(color: [f32; 3]) -> String {
    let pixel = crate::io::image::rgba_bytes(&Image::constant([1, 1], color), 1.0);
    format!("#{:02x}{:02x}{:02x}", pixel[0], pixel[1], pixel[2])
}
