//! The files of light from everywhere that was found.

use serde::Serialize;

use super::folder::Folder;
use crate::scene::{Environment, LightBasis, Rgb};
use crate::{Result, io};

/// Columns and rows of the picture of an environment.
const SKY_SIZE: [usize; 2] = [512, 256];

/// A combination of lights, as a file.
#[derive(Serialize)]
struct LightList {
    /// `discs`, or `map`: the pixels of a latitude-longitude picture.
    kind: &'static str,
    /// Columns and rows of the map.
    #[serde(skip_serializing_if = "Option::is_none")]
    size: Option<[usize; 2]>,
    /// Radiance of the sun outside its light map, where that was found, too.
    #[serde(skip_serializing_if = "Option::is_none")]
    sun: Option<Rgb>,
    lights: Vec<LightRecord>,
}

#[derive(Serialize)]
struct LightRecord {
    /// Unit vector to the middle of the light.
    towards: [f64; 3],
    /// In steradians.
    solid_angle: f64,
    radiance: Rgb,
}

/// Writes light from everywhere to files called `name`: as pictures (EXR, HDR, PNG) and as a list of lights. The list has the sun, too,
/// where that was found with them. `exposure` is that of the scene's pictures. Gives back the PNG file.
pub(super) fn write_environment(
    folder: &Folder,
    name: &str,
    basis: &LightBasis,
    environment: &Environment,
    sun: Option<Rgb>,
    exposure: f64,
) -> Result<Vec<u8>> {
    let lights = basis.lights().iter().zip(environment.coefficients(basis));
    let list = LightList {
        kind: if basis.is_map() { "map" } else { "discs" },
        size: basis.is_map().then(|| basis.lattice()),
        sun,
        lights: lights
            .map(|(light, radiance)| LightRecord {
                towards: light.towards.to_array(),
                solid_angle: light.solid_angle,
                radiance,
            })
            .collect(),
    };
    folder.write_bytes(&format!("{name}.json"), io::to_json(&list)?.as_bytes())?;
    // A map as it is, so that it can be the start of another solve without a loss.
    let picture = environment.picture(if basis.is_map() { basis.lattice() } else { SKY_SIZE })?;
    io::image::write_hdr(&folder.file(&format!("{name}.hdr")), &picture)?;
    folder.write_exr(name, &picture)?;
    // The brightest light is white, unless the scene's pictures are darker than that.
    let white = f64::from(environment.brightest());
    let exposure = if white > 0.0 { exposure.min(-white.log2()) } else { 0.0 };
    folder.write_png(name, &environment.picture(SKY_SIZE)?, exposure)
}
