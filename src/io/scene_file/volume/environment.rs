//! Light from everywhere, in the document.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::lights::Lights;
use crate::io::scene_file::assets::Assets;
use crate::io::scene_file::channels::Channels;
use crate::io::scene_file::file_name::FileName;
use crate::io::scene_file::flaw::{At, Built};
use crate::scene;

/// Light from everywhere: `radiance`, or a picture of all directions.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Environment {
    /// Radiance, one number or [r, g, b]; with a `file` a factor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radiance: Option<Channels>,
    /// A latitude-longitude picture (HDR, EXR or PNG), relative to the scene file: +Y at the top, −Z in the middle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<FileName>,
    /// Directions that the light of the volume is taken from, from 1 to 16384; 64 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub directions: Option<usize>,
    /// What it is a combination of where it is looked for; it starts as the combination nearest to `radiance` or `file`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lights: Option<Lights>,
}

/// Directions when not given.
const DIRECTIONS: usize = 64;

impl Environment {
    /// Puts in the settings that are not given.
    pub(super) fn settle(&mut self, is_painted: bool) {
        self.radiance.get_or_insert(Self::default_radiance(self.file.as_ref()));
        self.directions.get_or_insert(DIRECTIONS);
        let lights = self.lights.get_or_insert_default();
        lights.settle();
        lights.settle_smoothness(is_painted);
    }

    /// The radiance when it is not given: with a file a factor.
    pub(in crate::io::scene_file) fn default_radiance(file: Option<&FileName>) -> Channels {
        Channels::Grey(if file.is_some() { 1.0 } else { 0.0 })
    }

    pub(in crate::io::scene_file) fn build(&self, assets: &Assets) -> Built<scene::Environment> {
        let directions = self.directions.unwrap_or(DIRECTIONS);
        let radiance = self.radiance.unwrap_or(Self::default_radiance(self.file.as_ref()));
        let factor = radiance.rgb("radiance", f32::MAX)?;
        let Some(file) = &self.file else { return Ok(scene::Environment::constant(factor, directions)?) };
        let mut picture = assets.directions(file).at("file")?;
        picture.pixels.iter_mut().for_each(|pixel| (0..3).for_each(|c| pixel[c] *= factor[c]));
        Ok(scene::Environment::map(picture, directions)?)
    }
}
