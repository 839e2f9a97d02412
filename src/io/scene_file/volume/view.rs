//! Cameras of a volume scene, and what their pictures should show.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::io::image::Association;
use crate::io::scene_file::assets::Assets;
use crate::io::scene_file::file_name::FileName;
use crate::io::scene_file::flaw::{At, Built, Flaw};
use crate::io::scene_file::stroke::Stroke;
use crate::io::scene_file::view::{Camera, checked_camera, painted};
use crate::scene::{self, RgbaImage, luminance};

/// A camera and what its picture should show.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VolumeView {
    /// Names the result files of the view: letters, digits, `_` and `-`; unique also when case is ignored.
    pub name: String,
    /// Where it looks from, and the size of its picture.
    pub camera: Camera,
    /// What the picture should show: radiance from an EXR, HDR or PNG picture of the view's size, relative to the scene
    /// file; alpha, where there is any, is the weight of a pixel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture: Option<FileName>,
    /// Weights of the picture's pixels, times its alpha: the luminance of a picture of the view's size, from 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<FileName>,
    /// Where the volume is seen: a picture of the view's size, black outside. Voxels that are seen outside are left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask: Option<FileName>,
    /// What is seen behind the volume, instead of the scene's background: a picture of the view's size.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub background: Option<FileName>,
    /// Painted strokes, in painting order, over the layers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub strokes: Vec<Stroke>,
    /// Painted pictures of the view's size (PNG or EXR, alpha is the opacity), from the bottom up, relative to the
    /// scene file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub layers: Vec<FileName>,
    /// Whether the colours of `picture` and `layers` are multiplied by their alpha: `associated` or `straight`. As their format has it
    /// when not given: those of an EXR are, those of a PNG are not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub association: Option<Association>,
    /// Weight with which pixels that nothing is painted on stay as they are, from 0 to 1, where something is painted on the
    /// view and it has no `picture`; 1 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub keep: Option<f64>,
}

/// Weight of unpainted pixels when not given.
pub(super) const KEEP: f64 = 1.0;

impl VolumeView {
    /// A view with nothing to show.
    pub fn new(name: impl Into<String>, camera: Camera) -> Self {
        Self {
            name: name.into(),
            camera,
            picture: None,
            weight: None,
            mask: None,
            background: None,
            strokes: Vec::new(),
            layers: Vec::new(),
            association: None,
            keep: None,
        }
    }

    /// Whether something is painted on it.
    pub(super) fn is_painted(&self) -> bool {
        !self.strokes.is_empty() || !self.layers.is_empty()
    }

    /// Puts in the settings that are not given.
    pub(super) fn settle(&mut self) {
        self.camera.settle();
        self.keep.get_or_insert(KEEP);
    }

    pub(super) fn build(&self, assets: &mut Assets) -> Built<scene::VolumeView> {
        let camera = checked_camera(&self.name, &self.camera, assets)?;
        let size = camera.size();
        let wanted = Wanted {
            picture: self.picture.as_ref(),
            weight: self.weight.as_ref(),
            mask: self.mask.as_ref(),
            strokes: &self.strokes,
            layers: &self.layers,
            association: self.association,
            keep: self.keep,
        };
        let view = wanted.build(&self.name, camera, assets)?;
        let background = self.background.as_ref().map(|file| assets.image(file, size)).transpose();
        Ok(scene::VolumeView { background: background.at("background")?, ..view })
    }
}

/// What a picture should show, as it is written.
pub(super) struct Wanted<'a> {
    pub(super) picture: Option<&'a FileName>,
    pub(super) weight: Option<&'a FileName>,
    pub(super) mask: Option<&'a FileName>,
    pub(super) strokes: &'a [Stroke],
    pub(super) layers: &'a [FileName],
    pub(super) association: Option<Association>,
    pub(super) keep: Option<f64>,
}

impl Wanted<'_> {
    /// The view of a camera that should show it.
    pub(super) fn build(
        &self,
        name: &str,
        camera: scene::Camera,
        assets: &mut Assets,
    ) -> Built<scene::VolumeView> {
        let size = camera.size();
        let paint = (self.strokes, self.layers, self.association);
        let view = painted(name, camera, paint, self.keep.unwrap_or(KEEP), assets)?;
        let picture = self.picture.map(|file| assets.target(file, size, self.association));
        let picture = picture.transpose().at("picture")?;
        let picture = match (picture, self.weight) {
            (Some(picture), Some(file)) => Some(weighted(picture, file, assets).at("weight")?),
            (None, Some(_)) => {
                return Err(Flaw::new("weight", "there is no `picture` whose pixels it could weigh"));
            }
            (picture, None) => picture,
        };
        let mask = self.mask.map(|file| assets.image(file, size)).transpose().at("mask")?;
        Ok(scene::VolumeView {
            view,
            picture,
            mask: mask.map(|mask| mask.pixels.iter().map(|pixel| pixel.iter().any(|&c| c > 0.5)).collect()),
            background: None,
        })
    }
}

fn weighted(mut picture: RgbaImage, file: &FileName, assets: &Assets) -> Built<RgbaImage> {
    let weights = assets.image(file, picture.size())?;
    for (pixel, weight) in picture.pixels.iter_mut().zip(&weights.pixels) {
        let luminance = luminance(*weight);
        if !(-1e-6..=1.0 + 1e-6).contains(&luminance) {
            return Err(Flaw::value("", luminance, "weights from 0 to 1"));
        }
        pixel[3] *= luminance.clamp(0.0, 1.0);
    }
    Ok(picture)
}
