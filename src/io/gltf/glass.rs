//! What of a material lets light through: KHR_materials_transmission, the alpha of what blends, and the thickness of
//! KHR_materials_volume.

use gltf_json::Index;
use gltf_json::image::Image;
use gltf_json::material::{AlphaMode, Material as JsonMaterial};
use gltf_json::texture::Info;
use gltf_json::validation::Checked;
use serde_json::Value;

use super::file::GltfFile;
use super::picture::{PicturedGlass, Pictures};
use super::texture::{Coordinates, image, wraps};
use crate::Result;
use crate::io::film::passing;
use crate::scene::{Glass, Rgb};

/// How a material lets light through.
#[derive(Debug, Clone)]
pub(super) struct Transmission {
    /// Whether alpha says how much of what is behind it the surface covers.
    pub(super) blends: bool,
    /// Of what falls on the surface, from 0 to 1.
    factor: f32,
    texture: Option<Info>,
    /// What passes of light on its way inside.
    inside: Rgb,
}

impl Transmission {
    pub(super) fn of(file: &GltfFile, json: &JsonMaterial) -> Result<Self> {
        let name = || json.name.as_deref().unwrap_or("without a name").to_owned();
        let extension = |name| json.extensions.as_ref().and_then(|all| all.others.get(name));
        let transmission = extension("KHR_materials_transmission");
        let factor = transmission.and_then(|it| it.get("transmissionFactor")).and_then(Value::as_f64);
        let factor = factor.unwrap_or_default();
        if !(0.0..=1.0).contains(&factor) {
            return Err(file.broken(format!("the transmission of material {} is {factor}", name())));
        }
        let texture = transmission.and_then(|it| it.get("transmissionTexture"));
        let texture = texture.map(|texture| serde_json::from_value::<Info>(texture.clone())).transpose();
        let broken = |error| file.broken(format!("the transmission of material {}: {error}", name()));
        let inside = extension("KHR_materials_volume").map_or([1.0; 3], attenuation);
        Ok(Self {
            blends: json.alpha_mode == Checked::Valid(AlphaMode::Blend),
            factor: factor as f32,
            texture: texture.map_err(broken)?,
            inside,
        })
    }

    /// Whether anything may pass.
    pub(super) fn is_something(&self) -> bool {
        self.blends || self.factor > 0.0
    }

    /// The same of a surface that is the same everywhere.
    pub(super) fn even(&self, [r, g, b, alpha]: [f32; 4]) -> Glass {
        let passes = passing([r, g, b], if self.blends { alpha } else { 1.0 }, self.factor);
        Glass { transmittance: [0, 1, 2].map(|c| passes[c] * self.inside[c]), picture: None }
    }

    /// As pictures say, and how these lie. None where there are none, or there are no texture coordinates for them among `sets`.
    ///
    /// Errors: those of a picture.
    pub(super) fn pictured(
        &self,
        (file, pictures): (&GltfFile, &Pictures),
        color: [f32; 4],
        base: Option<&Info>,
        sets: &[u32],
    ) -> Result<Option<(Glass, Coordinates)>> {
        let placed = |info: &&Info| sets.contains(&Coordinates::of(info).set);
        let base = base.filter(placed);
        let transmission = self.texture.as_ref().filter(|_| self.factor > 0.0).filter(placed);
        let Some(carrier) = base.or(transmission) else { return Ok(None) };
        let coordinates = Coordinates::of(carrier);
        let lies_with_it = |info: &&Info| Coordinates::of(info) == coordinates;
        let beside = transmission.filter(|info| !lies_with_it(info));
        let mut glass = PicturedGlass {
            base: self.picture_of(file, base)?,
            transmission: self.picture_of(file, transmission.filter(lies_with_it))?,
            color,
            factor: self.factor,
            blends: self.blends,
            wrap: match file.get(carrier.index) {
                Some(texture) => wraps(file, texture),
                None => return Err(file.broken(format!("texture {} is missing", carrier.index))),
            },
        };
        if let Some(beside) = self.picture_of(file, beside)? {
            file.warn(
                "a transmission texture lies otherwise than the base colour, and its mean is taken".into(),
            );
            glass.factor *= pictures.picture(file, beside, false)?.mean_where_there(None)[0];
        }
        if glass.base.is_none() && glass.transmission.is_none() {
            return Ok(None);
        }
        let picture = Some(pictures.tint(file, &glass)?);
        Ok(Some((Glass { transmittance: self.inside, picture }, coordinates)))
    }

    fn picture_of(&self, file: &GltfFile, info: Option<&Info>) -> Result<Option<Index<Image>>> {
        let Some(info) = info else { return Ok(None) };
        let texture = file.get(info.index);
        image(file, texture.ok_or_else(|| file.broken(format!("texture {} is missing", info.index)))?)
    }
}

/// What passes a thickness of glass (KHR_materials_volume), as its factors say: `c^(thickness / distance)`.
fn attenuation(volume: &Value) -> Rgb {
    let number = |name: &str| volume.get(name).and_then(Value::as_f64);
    let thickness = number("thicknessFactor").unwrap_or_default().max(0.0);
    let distance = number("attenuationDistance").unwrap_or(f64::INFINITY);
    let color = volume.get("attenuationColor").and_then(Value::as_array);
    std::array::from_fn(|c| {
        let share = color.and_then(|color| color.get(c)).and_then(Value::as_f64).unwrap_or(1.0);
        let passes = share.clamp(0.0, 1.0).powf(thickness / distance);
        if passes.is_finite() { passes as f32 } else { 1.0 }
    })
}
