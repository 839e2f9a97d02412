//! The sun of the document.

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::scene::{DirectionalLight, Rgb};

use super::assets::Assets;
use super::channels::Channels;
use super::flaw::{At, Built, Flaw};
use super::gltf_node::GltfNode;

/// A directional light: a `direction`, or a sun from a glTF file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Light {
    /// Where the light goes (not where it comes from); of any length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 3]>,
    /// Takes direction and colour from a directional light of a glTF file, instead of `direction`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gltf: Option<GltfNode>,
    /// Radiance before any gobo: one number or [r, g, b]. When not given it is 1, or the colour of the glTF
    /// light scaled so that its largest channel is 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radiance: Option<Channels>,
}

impl Light {
    pub(super) fn build(&self, assets: &mut Assets) -> Built<DirectionalLight> {
        let (direction, color) = match (self.direction, &self.gltf) {
            (Some(direction), None) => (DVec3::from_array(direction), [1.0; 3]),
            (None, Some(gltf)) => {
                let (direction, lux) = assets.sun(gltf).at("gltf")?;
                (direction, if self.radiance.is_some() { [1.0; 3] } else { normalized(lux)? })
            }
            _ => return Err(Flaw::new("", "give either `direction` or `gltf`")),
        };
        let radiance = self.radiance.map(|radiance| radiance.rgb("radiance", f32::MAX)).transpose()?;
        Ok(DirectionalLight::new(direction, radiance.unwrap_or(color))?)
    }

    /// Puts in the settings that are not given; the colour of a glTF sun stays in its file.
    pub(super) fn settle(&mut self) {
        if self.direction.is_some() {
            self.radiance.get_or_insert(Channels::Grey(1.0));
        }
    }
}

/// The colour with its largest channel at 1: lux are no radiance, and only their proportions are of use.
fn normalized(lux: Rgb) -> Built<Rgb> {
    let largest = lux.into_iter().fold(0.0, f32::max);
    if largest.is_normal() && lux.iter().all(|&c| c.is_finite() && c >= 0.0) {
        return Ok(lux.map(|c| c / largest));
    }
    Err(Flaw::value("", format!("{lux:?} lux"), "the light of a sun that shines; or give `radiance`"))
        .at("gltf")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_proportions_of_a_gltf_sun_are_kept() {
        assert_eq!(normalized([100_000.0, 50_000.0, 0.0]).unwrap(), [1.0, 0.5, 0.0]);
        for dark in
            [[0.0; 3], [f32::NAN; 3], [f32::INFINITY, 1.0, 1.0], [1.0, -1.0, 0.0], [1.0, f32::NAN, 0.0]]
        {
            assert!(normalized(dark).is_err(), "{dark:?}");
        }
    }

    #[test]
    fn a_light_has_one_source() {
        let mut assets = Assets::beside("scene.json".as_ref());
        let node = GltfNode { file: "a.glb".into(), node: None };
        let both = Light { direction: Some([0.0, -1.0, 0.0]), gltf: Some(node), radiance: None };
        assert!(both.build(&mut assets).is_err());
        assert!(Light::default().build(&mut assets).is_err());
        let down =
            Light { direction: Some([0.0, -2.0, 0.0]), ..Light::default() }.build(&mut assets).unwrap();
        assert_eq!((down.direction, down.radiance), (DVec3::NEG_Y, [1.0; 3]));
    }
}
