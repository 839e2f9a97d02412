//! The air of the document.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::scene;

use super::channels::Channels;
use super::flaw::Built;

/// A homogeneous medium that fills all space.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Medium {
    /// Extinction coefficient in 1/metre: one number or one a channel; above 0.
    pub sigma_t: Channels,
    /// Single-scattering albedo from 0 to 1: one number or one a channel.
    #[serde(default = "white")]
    pub albedo: Channels,
    /// Mean cosine of the Henyey–Greenstein phase function, inside (−1, 1); positive scatters forwards.
    #[serde(default)]
    pub g: f64,
}

impl Medium {
    /// Per unit of length, of which there are `metres`.
    pub(super) fn build(&self, metres: f64) -> Built<scene::Medium> {
        scene::Medium::new(self.sigma_t.wide(), self.albedo.wide(), self.g)?;
        Ok(scene::Medium::new(self.sigma_t.wide().map(|sigma| sigma * metres), self.albedo.wide(), self.g)?)
    }
}

fn white() -> Channels {
    Channels::Grey(1.0)
}
