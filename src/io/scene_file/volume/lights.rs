//! What an environment is a combination of.

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::io::scene_file::flaw::{Built, Flaw, checked};
use crate::scene::{self, LightBasis};

/// Lights that an environment is a combination of: discs of one solid angle spread evenly, or the pixels of a `map`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lights {
    /// Discs, from 1 to 4096; 128 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<usize>,
    /// Columns and rows of a latitude-longitude picture whose pixels are the lights, instead of discs; at most 4096 in all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<[usize; 2]>,
    /// Where they are.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub over: Over,
    /// Where the upper hemisphere is; +Y when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub up: Option<[f64; 3]>,
    /// Share of a disc to both sides of its rim over which it fades, from 0 (hard) to 1; 0.5 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub softness: Option<f64>,
    /// Directions that the light of one disc is taken from, from 1 to 64; 1 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub samples: Option<usize>,
    /// λ of the pull of neighbouring lights to each other, not negative; when not given 1 where something is painted, else 0.01. Of lights around a
    /// volume.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gradient: Option<f64>,
}

/// The part of all directions that lights are spread over.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Over {
    /// All of them.
    #[default]
    Sphere,
    /// Those above the horizon.
    UpperHemisphere,
}

/// What holds when it is not given.
const COUNT: usize = 128;
const UP: [f64; 3] = [0.0, 1.0, 0.0];
const SOFTNESS: f64 = 0.5;
const SAMPLES: usize = 1;
/// Of skies behind pictures that were measured, and behind paint: measured in docs/environment.md.
const GRADIENT: [f64; 2] = [0.01, 1.0];

impl Lights {
    /// Puts in the settings that are not given, where they mean something.
    pub(in crate::io::scene_file) fn settle(&mut self) {
        if self.over == Over::UpperHemisphere {
            self.up.get_or_insert(UP);
        }
        if self.map.is_none() {
            self.count.get_or_insert(COUNT);
            self.softness.get_or_insert(SOFTNESS);
            self.samples.get_or_insert(SAMPLES);
        }
    }

    /// Puts in the pull to neighbours, where it is not given.
    pub(super) fn settle_smoothness(&mut self, is_painted: bool) {
        self.gradient.get_or_insert(GRADIENT[usize::from(is_painted)]);
    }

    /// λ of the pull of neighbouring lights to each other.
    pub(super) fn smoothness(&self, is_painted: bool) -> Built<f64> {
        let gradient = self.gradient.unwrap_or(GRADIENT[usize::from(is_painted)]);
        checked("gradient", gradient, "not negative", |gradient| gradient >= 0.0)
    }

    pub(in crate::io::scene_file) fn build(&self) -> Built<LightBasis> {
        let up = DVec3::from_array(self.up.unwrap_or(UP));
        if !(up.is_finite() && up.length() > 0.0) {
            return Err(Flaw::value("up", format!("{:?}", up.to_array()), "a direction"));
        }
        let over = match self.over {
            Over::Sphere if self.up.is_some() => {
                return Err(Flaw::new(
                    "up",
                    "only a hemisphere has an up; add \"over\": \"upper-hemisphere\"",
                ));
            }
            Over::Sphere => scene::Over::Sphere,
            Over::UpperHemisphere => scene::Over::Hemisphere(up.normalize()),
        };
        let Some(size) = self.map else {
            let (softness, samples) = (self.softness.unwrap_or(SOFTNESS), self.samples.unwrap_or(SAMPLES));
            return Ok(LightBasis::discs(self.count.unwrap_or(COUNT), over, softness, samples)?);
        };
        for (name, is_given) in [
            ("count", self.count.is_some()),
            ("softness", self.softness.is_some()),
            ("samples", self.samples.is_some()),
        ] {
            if is_given {
                return Err(Flaw::new(name, "only discs have this; leave it away, or leave `map` away"));
            }
        }
        Ok(LightBasis::map(size, over)?)
    }
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}
