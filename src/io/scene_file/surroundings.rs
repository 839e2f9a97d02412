//! Light beside that of the light map, in the document.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::scene;

use super::assets::Assets;
use super::channels::Channels;
use super::file_name::FileName;
use super::flaw::{At, Built, Flaw, within};
use super::volume::{Environment, Lights};

/// Light beside that of the light map which is looked for together with it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Surroundings {
    /// Whether the sun's radiance outside its light map is looked for, one number a channel; it starts from `light.radiance`.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    #[schemars(!skip_serializing_if)]
    pub sun: bool,
    /// Light from everywhere that is looked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub environment: Option<Sky>,
}

/// Lights from everywhere, infinitely far away. They start as the combination nearest to `radiance` or `file`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sky {
    /// Radiance to start from, one number or [r, g, b], 0 when not given; with a `file` a factor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radiance: Option<Channels>,
    /// A latitude-longitude picture (HDR, EXR or PNG) to start from, relative to the scene file: +Y at the top, −Z in the middle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<FileName>,
    /// What it is a combination of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lights: Option<Lights>,
    /// Texels a side of the shadow map of each direction that light comes from, from 16 to 2048; 256 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shadow_map: Option<usize>,
}

/// Texels a side of a shadow map when not given.
const SHADOW_MAP: usize = 256;

impl Surroundings {
    pub(super) fn build(&self, assets: &Assets) -> Built<scene::Surroundings> {
        if !self.sun && self.environment.is_none() {
            let problem =
                "nothing is looked for; set `sun` to true, add an `environment`, or leave this away";
            return Err(Flaw::new("", problem));
        }
        let sky = self.environment.as_ref().map(|sky| sky.build(assets).at("environment"));
        Ok(scene::Surroundings { sun: self.sun, sky: sky.transpose()? })
    }

    /// Puts in the settings that are not given.
    pub(super) fn settle(&mut self) {
        if let Some(sky) = &mut self.environment {
            sky.radiance.get_or_insert(Environment::default_radiance(sky.file.as_ref()));
            sky.lights.get_or_insert_default().settle();
            sky.shadow_map.get_or_insert(SHADOW_MAP);
        }
    }
}

impl Sky {
    fn build(&self, assets: &Assets) -> Built<scene::Sky> {
        let shadow_map = within("shadow_map", self.shadow_map.unwrap_or(SHADOW_MAP), [16, 2048])?;
        if self.lights.as_ref().is_some_and(|lights| lights.gradient.is_some()) {
            return Err(Flaw::new(
                "lights.gradient",
                "only lights around a volume pull at their neighbours; leave it away",
            ));
        }
        let basis = self.lights.clone().unwrap_or_default().build().at("lights")?;
        let start =
            Environment { radiance: self.radiance, file: self.file.clone(), ..Environment::default() };
        let start = start.build(assets)?.coefficients(&basis);
        Ok(scene::Sky { basis: Arc::new(basis), start, shadow_map })
    }
}
