//! Light from everywhere on surfaces, in the document.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::scene;

use super::assets::Assets;
use super::channels::Channels;
use super::file_name::FileName;
use super::flaw::{At, Built, Flaw, checked, within};
use super::volume::Environment;

/// Directions that a pixel asks when not given, in the picture and by rays, and how many there may be.
const SAMPLES: [usize; 2] = [8, 256];
const MOST_SAMPLES: usize = 4096;
/// Places along a direction.
const MOST_STEPS: usize = 64;
/// Pixels a side of the pattern.
const MOST_PATTERN: usize = 16;

/// Light from everywhere on surfaces, and what hides it from them (Klehm 2015, chapter 3); in the place of `ambient` on them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SurfaceLight {
    /// The light; the scene's `ambient` when not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub environment: Option<SurfaceEnvironment>,
    /// How what hides it is found.
    pub method: SurfaceMethod,
    /// What the directions of a hemisphere count.
    pub weighting: Weighting,
    /// Directions that each pixel asks, from 1 to 4096; 8 when not given, and 256 of `rays`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub samples: Option<usize>,
    /// Places along each direction that are looked up in the picture, from 1 to 64.
    pub steps: usize,
    /// How far away something may be to hide light, in units of the scene. When not given it is fitted to what the views see, and `rays` go on for ever.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
    /// Pixels a side of the square whose pixels ask different directions, and of the blur that unites them; from 1 (no blur) to 16.
    pub pattern: usize,
}

/// Light from everywhere: the same, or a picture of all directions.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SurfaceEnvironment {
    /// Radiance, one number or [r, g, b]; with a `file` a factor, 1 when not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radiance: Option<Channels>,
    /// A latitude-longitude picture (HDR, EXR or PNG), relative to the scene file: +Y at the top, −Z in the middle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<FileName>,
}

/// How what hides light from surfaces is found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SurfaceMethod {
    /// Nothing hides it.
    Open,
    /// The picture says which share of the directions is open.
    AmbientOcclusion,
    /// And where their mean is, around which light is taken.
    BentNormals,
    /// And how wide they are spread: a cone, in which light is taken.
    #[default]
    BentCones,
    /// Rays through the scene: the reference.
    Rays,
}

/// What the directions of a hemisphere count.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Weighting {
    /// As much as they light a surface: their cosine with its normal.
    #[default]
    Cosine,
    /// All alike, as in the paper.
    Uniform,
}

impl Default for SurfaceLight {
    fn default() -> Self {
        Self {
            environment: None,
            method: SurfaceMethod::default(),
            weighting: Weighting::default(),
            samples: None,
            steps: 3,
            radius: None,
            pattern: 4,
        }
    }
}

impl SurfaceLight {
    pub(super) fn build(&self, assets: &Assets) -> Built<scene::SurfaceLight> {
        let environment = self.environment.as_ref().map(|it| it.build(assets).at("environment"));
        let radius =
            |radius| checked("radius", radius, "above 0, and at most 1e9", |it| it > 0.0 && it <= 1e9);
        Ok(scene::SurfaceLight {
            environment: environment.transpose()?,
            method: match self.method {
                SurfaceMethod::Open => scene::SurfaceMethod::Open,
                SurfaceMethod::AmbientOcclusion => scene::SurfaceMethod::AmbientOcclusion,
                SurfaceMethod::BentNormals => scene::SurfaceMethod::BentNormals,
                SurfaceMethod::BentCones => scene::SurfaceMethod::BentCones,
                SurfaceMethod::Rays => scene::SurfaceMethod::Rays,
            },
            weighting: match self.weighting {
                Weighting::Cosine => scene::Weighting::Cosine,
                Weighting::Uniform => scene::Weighting::Uniform,
            },
            samples: within("samples", self.samples.unwrap_or(self.default_samples()), [1, MOST_SAMPLES])?,
            steps: within("steps", self.steps, [1, MOST_STEPS])?,
            radius: self.radius.map(radius).transpose()?,
            pattern: within("pattern", self.pattern, [1, MOST_PATTERN])?,
        })
    }

    /// Puts in the settings that are not given, but for what is fitted to the scene.
    pub(super) fn settle(&mut self) {
        self.samples.get_or_insert(self.default_samples());
        if let Some(environment) = &mut self.environment
            && environment.file.is_some()
        {
            environment.radiance.get_or_insert(Channels::Grey(1.0));
        }
    }

    fn default_samples(&self) -> usize {
        SAMPLES[usize::from(self.method == SurfaceMethod::Rays)]
    }
}

impl SurfaceEnvironment {
    fn build(&self, assets: &Assets) -> Built<scene::Environment> {
        if self.radiance.is_none() && self.file.is_none() {
            return Err(Flaw::new("", "say what light it is: a `radiance`, or a `file`"));
        }
        let light =
            Environment { radiance: self.radiance, file: self.file.clone(), ..Environment::default() };
        light.build(assets)
    }
}
