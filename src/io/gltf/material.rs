//! Base colour and alpha of materials, and what they let through.

use gltf_json::Index;
use gltf_json::material::{AlphaMode, Material as JsonMaterial};
use gltf_json::texture::Info;
use gltf_json::validation::Checked;

use super::file::GltfFile;
use super::glass::Transmission;
use super::picture::Pictures;
use super::texture::{Coordinates, image, wraps};
use crate::Result;
use crate::io::cutout::Cutoff;
use crate::scene::Material;

/// What a glTF material means here.
#[derive(Debug, Clone)]
pub(super) struct Surface {
    pub(super) material: Material,
    /// The surface is nowhere: its alpha is below its cut-off everywhere, or lets all through.
    pub(super) is_invisible: bool,
    pub(super) coordinates: Coordinates,
}

/// Reads a material; the default one for none. `sets` are the texture coordinates that there are; a texture
/// without its set cannot be placed, and is neither a mask nor glass.
pub(super) fn read(
    file: &GltfFile,
    pictures: &Pictures,
    index: Option<Index<JsonMaterial>>,
    sets: &[u32],
) -> Result<Surface> {
    let default = JsonMaterial::default();
    let json = match index {
        Some(index) => file.get(index).ok_or_else(|| file.broken(format!("material {index} is missing")))?,
        None => &default,
    };
    let (factor, texture) = base(json);
    if !factor.iter().all(|c| (0.0..=1.0).contains(c)) {
        let name = json.name.as_deref().unwrap_or("without a name");
        return Err(file.broken(format!("the base colour of material {name} is {factor:?}")));
    }
    let mut surface = opaque(file, pictures, (json, factor), texture, sets)?;
    let transmission = Transmission::of(file, json)?;
    if surface.is_invisible || !transmission.is_something() {
        return Ok(surface);
    }
    let color = [0, 1, 2].map(|c| surface.material.albedo[c]);
    let mut even = transmission.even([color[0], color[1], color[2], factor[3]]);
    // A mask says where the glass is. It is placed already.
    if surface.material.mask.is_none()
        && let Some((glass, coordinates)) = transmission.pictured((file, pictures), factor, texture, sets)?
    {
        (even, surface.coordinates) = (glass, coordinates);
    }
    surface.is_invisible = even.picture.is_none() && even.at([0.0; 2]) == [1.0; 3];
    surface.material.glass = even.colors().then_some(even);
    Ok(surface)
}

/// A material through which nothing passes but through holes.
fn opaque(
    file: &GltfFile,
    pictures: &Pictures,
    (json, factor): (&JsonMaterial, [f32; 4]),
    texture: Option<&Info>,
    sets: &[u32],
) -> Result<Surface> {
    let cutoff = cutoff(json).map(|cutoff| Cutoff::new(cutoff, factor[3]));
    let color = [factor[0], factor[1], factor[2]];
    let opaque = |albedo| Surface {
        material: Material { name: json.name.clone(), albedo, mask: None, glass: None },
        is_invisible: cutoff.is_some_and(Cutoff::leaves_nothing),
        coordinates: Coordinates::default(),
    };
    let Some(info) = texture else { return Ok(opaque(color)) };
    let coordinates = Coordinates::of(info);
    let texture = file.get(info.index);
    let texture = texture.ok_or_else(|| file.broken(format!("texture {} is missing", info.index)))?;
    // A cut-off above 1 leaves nothing, whatever the texture says.
    let could_have_holes =
        cutoff.filter(|&cutoff| !cutoff.leaves_nothing() && sets.contains(&coordinates.set));
    let Some(image) = image(file, texture)? else {
        let kinds = "only PNG, JPEG and WebP are read; export the textures as PNG";
        let blends = json.alpha_mode == Checked::Valid(AlphaMode::Blend);
        if could_have_holes.is_some() || blends && sets.contains(&coordinates.set) {
            return Err(file.broken(format!("the picture with the holes of a surface is missing; {kinds}")));
        }
        file.warn(format!(
            "a texture has no picture that is read, and its colour is taken for white; {kinds}"
        ));
        return Ok(opaque(color));
    };
    let picture = pictures.picture(file, image, could_have_holes.is_some())?;
    let cutoff_of_mask = could_have_holes.filter(|_| picture.has_alpha);
    let mean = picture.mean_where_there(cutoff_of_mask);
    let mut surface = opaque([0, 1, 2].map(|c| color[c] * mean[c]));
    surface.coordinates = coordinates;
    // Most textures of a mask have no hole.
    if let Some(cutoff) = cutoff_of_mask.filter(|&cutoff| picture.has_holes(cutoff)) {
        surface.material.mask = Some(pictures.mask(file, image, cutoff, wraps(file, texture))?);
    }
    Ok(surface)
}

/// Base colour with alpha, and its texture. The older model of specular and glossiness comes first where a
/// material has both.
fn base(material: &JsonMaterial) -> ([f32; 4], Option<&Info>) {
    match material.extensions.as_ref().and_then(|all| all.pbr_specular_glossiness.as_ref()) {
        Some(older) => (older.diffuse_factor.0, older.diffuse_texture.as_ref()),
        None => {
            let base = &material.pbr_metallic_roughness;
            (base.base_color_factor.0, base.base_color_texture.as_ref())
        }
    }
}

/// The alpha below which a material is not there; none where all of it is.
fn cutoff(material: &JsonMaterial) -> Option<f32> {
    match material.alpha_mode {
        Checked::Valid(AlphaMode::Mask) => Some(material.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0)),
        _ => None,
    }
    .filter(|&cutoff| cutoff > 0.0)
}
