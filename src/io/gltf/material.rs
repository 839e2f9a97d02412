//! Base colour and alpha of materials.

use std::io::Cursor;
use std::sync::LazyLock;

use gltf_json::Index;
use gltf_json::material::{AlphaMode, Material as JsonMaterial};
use gltf_json::texture::{Info, WrappingMode};
use gltf_json::validation::Checked;
use image::{DynamicImage, ImageReader};

use super::file::GltfFile;
use crate::Result;
use crate::io::cutout::Cutoff;
use crate::scene::{Material, Rgb, Wrap};

/// What a glTF material means here.
#[derive(Debug, Clone)]
pub(super) struct Surface {
    pub(super) material: Material,
    /// The surface is nowhere: its alpha is below its cut-off everywhere.
    pub(super) is_invisible: bool,
    pub(super) coordinates: Coordinates,
}

/// How texture coordinates of vertices become those of the base colour texture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Coordinates {
    /// Number of the `TEXCOORD` attribute.
    pub(super) set: u32,
    offset: [f64; 2],
    rotation: f64,
    scale: [f64; 2],
}

impl Default for Coordinates {
    fn default() -> Self {
        Self { set: 0, offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2] }
    }
}

impl Coordinates {
    fn of(texture: &Info) -> Self {
        let plain = Self { set: texture.tex_coord, ..Self::default() };
        let transform = texture.extensions.as_ref().and_then(|all| all.texture_transform.as_ref());
        transform.map_or(plain, |transform| Self {
            set: transform.tex_coord.unwrap_or(texture.tex_coord),
            offset: transform.offset.0.map(f64::from),
            rotation: f64::from(transform.rotation.0),
            scale: transform.scale.0.map(f64::from),
        })
    }

    /// Scaled, turned counter-clockwise in a picture whose v goes down, moved (KHR_texture_transform).
    pub(super) fn apply(&self, [u, v]: [f64; 2]) -> [f32; 2] {
        let (sine, cosine) = self.rotation.sin_cos();
        let (u, v) = (u * self.scale[0], v * self.scale[1]);
        [(cosine * u + sine * v + self.offset[0]) as f32, (cosine * v - sine * u + self.offset[1]) as f32]
    }
}

/// Reads a material; the default one for none. `sets` are the texture coordinates that there are; a texture
/// without its set cannot be placed, and is no mask.
pub(super) fn read(file: &GltfFile, index: Option<Index<JsonMaterial>>, sets: &[u32]) -> Result<Surface> {
    let default = JsonMaterial::default();
    let json = match index {
        Some(index) => file.get(index).ok_or_else(|| file.broken(format!("material {index} is missing")))?,
        None => &default,
    };
    let base = &json.pbr_metallic_roughness;
    let factor = base.base_color_factor.0;
    if !factor.iter().all(|c| (0.0..=1.0).contains(c)) {
        let name = json.name.as_deref().unwrap_or("without a name");
        return Err(file.broken(format!("the base colour of material {name} is {factor:?}")));
    }
    let cutoff = cutoff(json).map(|cutoff| Cutoff::new(cutoff, factor[3]));
    let color = [factor[0], factor[1], factor[2]];
    let opaque = |albedo| Surface {
        material: Material { name: json.name.clone(), albedo, mask: None },
        is_invisible: cutoff.is_some_and(Cutoff::leaves_nothing),
        coordinates: Coordinates::default(),
    };
    let Some(info) = base.base_color_texture.as_ref() else { return Ok(opaque(color)) };
    let coordinates = Coordinates::of(info);
    let (picture, wrap) = texture(file, info)?;
    let has_alpha = picture.color().has_alpha() && sets.contains(&coordinates.set);
    let picture = picture.into_rgba8();
    let cutoff_of_mask = cutoff.filter(|_| has_alpha);
    let mean = mean_where_there(&picture, cutoff_of_mask);
    let mut surface = opaque([0, 1, 2].map(|c| color[c] * mean[c]));
    surface.coordinates = coordinates;
    if let Some(cutoff) = cutoff_of_mask.filter(|_| !surface.is_invisible) {
        let size = [picture.width() as usize, picture.height() as usize];
        surface.material.mask = cutoff.mask(size, picture.pixels().map(|pixel| pixel[3]), wrap);
    }
    Ok(surface)
}

/// The alpha below which a material is not there; none where all of it is.
fn cutoff(material: &JsonMaterial) -> Option<f32> {
    match material.alpha_mode {
        Checked::Valid(AlphaMode::Mask) => Some(material.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0)),
        Checked::Valid(AlphaMode::Blend) => Some(Cutoff::BLEND),
        _ => None,
    }
    .filter(|&cutoff| cutoff > 0.0)
}

/// The picture of a texture and how it wraps.
fn texture(file: &GltfFile, info: &Info) -> Result<(DynamicImage, [Wrap; 2])> {
    let texture = file.get(info.index);
    let texture = texture.ok_or_else(|| file.broken(format!("texture {} is missing", info.index)))?;
    let source = file
        .get(texture.source)
        .ok_or_else(|| file.broken(format!("texture {} has no PNG or JPEG picture", info.index)))?;
    let bytes = match (&source.uri, source.buffer_view) {
        (_, Some(view)) => file.view(view)?.to_vec(),
        (Some(uri), None) => file.read_uri(uri)?,
        (None, None) => return Err(file.broken(format!("picture {} has no data", texture.source))),
    };
    let name = source.uri.as_deref().filter(|uri| !uri.starts_with("data:")).unwrap_or("inside of it");
    let failed = |error: String| file.broken(format!("the picture {name}: {error}"));
    // The reader's default limits hold sizes that a header only claims.
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let picture = reader.map_err(|error| failed(error.to_string()))?.decode();
    let picture = picture.map_err(|error| failed(error.to_string()))?;
    let sampler = texture.sampler.and_then(|sampler| file.get(sampler)).cloned().unwrap_or_default();
    Ok((picture, [sampler.wrap_s, sampler.wrap_t].map(wrap)))
}

fn wrap(mode: Checked<WrappingMode>) -> Wrap {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}

static LINEAR: LazyLock<[f64; 256]> = LazyLock::new(|| {
    std::array::from_fn(|byte| {
        let value = byte as f64 / 255.0;
        if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    })
});

/// Linear mean colour of the pixels that are there; transparent ones are often black.
fn mean_where_there(picture: &image::RgbaImage, cutoff: Option<Cutoff>) -> Rgb {
    let mut sum = [0.0; 3];
    let mut count = 0.0;
    for pixel in picture.pixels().filter(|pixel| cutoff.is_none_or(|cutoff| cutoff.keeps(pixel[3]))) {
        for channel in 0..3 {
            sum[channel] += LINEAR[usize::from(pixel[channel])];
        }
        count += 1.0;
    }
    sum.map(|sum| (sum / f64::max(count, 1.0)) as f32)
}
