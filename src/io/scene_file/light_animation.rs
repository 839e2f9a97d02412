//! Scenes of light maps that change from frame to frame, as they are written: key frames of the sun, the cameras and the looks.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::file_name::FileName;
use super::flaw::{Built, Flaw};
use super::key_frames::check_frames;
use super::light::Light;
use super::looks::Looks;
use super::stroke::Stroke;
use super::view::{Camera, View};
use crate::io::image::Association;
use crate::scene;

/// Frames of a scene whose sun, cameras and looks move, given at some of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightAnimation {
    /// How many frames there are, from 2 to 10000; they are numbered from 0.
    #[schemars(range(min = 2, max = 10_000))]
    pub frames: usize,
    /// Which light maps the frames have; when not given, one for each key where something is painted, and else none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light_map: Option<LightMaps>,
    /// The key frames, in the order of their numbers; at least two. What a key does not say is as the scene says it.
    #[schemars(length(min = 2))]
    pub keys: Vec<LightKey>,
}

/// Which light maps the frames of an animation have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LightMaps {
    /// None: light is as it is, and what is painted is not looked at.
    None,
    /// One for all frames, found from what is painted at all keys, the first among them. It turns with the sun, and passes as much of it when it changes its colour.
    One,
    /// One for each key, blended between them.
    Each,
}

/// A frame, and what the scene is like then.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightKey {
    /// The number of the frame.
    pub frame: usize,
    /// The sun; between keys it turns along the great circle, and its radiance is blended.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light: Option<Light>,
    /// Views that are others than the scene's; a view that is not named here is that of the scene.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub views: Vec<LightKeyView>,
    /// How shafts are bent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub looks: Option<Looks>,
}

/// A view at a key frame. What it does not say is as the scene says it of the view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightKeyView {
    /// The name of the scene's view.
    pub name: String,
    /// Where it looks from; its picture has the size that it has at all frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<Camera>,
    /// Painted strokes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strokes: Option<Vec<Stroke>>,
    /// Painted pictures.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layers: Option<Vec<FileName>>,
    /// Whether the colours of `layers` are multiplied by their alpha.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub association: Option<Association>,
    /// Weight with which pixels that nothing is painted on stay as they are, from 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub keep: Option<f64>,
}

impl LightAnimation {
    /// What can be said before anything is read.
    pub(super) fn check(&self) -> Built<()> {
        let keys: Vec<usize> = self.keys.iter().map(|key| key.frame).collect();
        check_frames(self.frames, &keys)
    }

    /// Which light maps there are, beside these views of the scene.
    pub(super) fn light_maps(&self, views: &[View]) -> LightMaps {
        let of_keys = self.keys.iter().flat_map(|key| &key.views);
        let is_painted = views.iter().any(|view| !view.strokes.is_empty() || !view.layers.is_empty())
            || of_keys.clone().any(|view| view.strokes.as_ref().is_some_and(|strokes| !strokes.is_empty()))
            || of_keys.clone().any(|view| view.layers.as_ref().is_some_and(|layers| !layers.is_empty()));
        self.light_map.unwrap_or(if is_painted { LightMaps::Each } else { LightMaps::None })
    }

    /// Puts in the settings that are not given.
    pub(super) fn settle(&mut self, views: &[View]) {
        self.light_map = Some(self.light_maps(views));
        for key in &mut self.keys {
            key.light.iter_mut().for_each(Light::settle);
            key.looks.iter_mut().for_each(Looks::settle);
            key.views.iter_mut().filter_map(|view| view.camera.as_mut()).for_each(Camera::settle);
        }
    }
}

impl LightKeyView {
    /// The scene's view as it is at this key.
    pub(super) fn of(&self, view: &View) -> Built<View> {
        if let Some(camera) = &self.camera
            && camera.size != view.camera.size
        {
            let [width, height] = view.camera.size;
            let expected = format!("[{width}, {height}], the size of the view at all frames");
            return Err(Flaw::value("camera.size", format!("{:?}", camera.size), &expected));
        }
        Ok(View {
            name: view.name.clone(),
            camera: self.camera.as_ref().unwrap_or(&view.camera).clone(),
            strokes: self.strokes.as_ref().unwrap_or(&view.strokes).clone(),
            layers: self.layers.as_ref().unwrap_or(&view.layers).clone(),
            association: self.association.or(view.association),
            keep: self.keep.unwrap_or(view.keep),
        })
    }
}

impl From<LightMaps> for scene::LightMaps {
    fn from(light_maps: LightMaps) -> Self {
        match light_maps {
            LightMaps::None => Self::None,
            LightMaps::One => Self::One,
            LightMaps::Each => Self::Each,
        }
    }
}
