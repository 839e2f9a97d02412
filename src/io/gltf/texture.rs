//! Where textures lie on a surface, and which pictures they have.

use gltf_json::Index;
use gltf_json::image::Image;
use gltf_json::texture::{Info, Texture, WrappingMode};
use gltf_json::validation::Checked;

use super::file::GltfFile;
use crate::Result;
use crate::scene::Wrap;

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
    pub(super) fn of(texture: &Info) -> Self {
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

/// The picture of a texture; none where it is only there in a format that is not read.
pub(super) fn image(file: &GltfFile, texture: &Texture) -> Result<Option<Index<Image>>> {
    if texture.source.value() != u32::MAX as usize {
        return Ok(Some(texture.source));
    }
    let webp = texture.extensions.as_ref().and_then(|all| all.others.get("EXT_texture_webp"));
    let Some(source) = webp.and_then(|webp| webp.get("source")) else { return Ok(None) };
    let index = source.as_u64().and_then(|index| u32::try_from(index).ok());
    let broken = || file.broken(format!("a texture has the picture {source}"));
    Ok(Some(Index::new(index.ok_or_else(broken)?)))
}

pub(super) fn wraps(file: &GltfFile, texture: &Texture) -> [Wrap; 2] {
    let sampler = texture.sampler.and_then(|sampler| file.get(sampler)).cloned().unwrap_or_default();
    [sampler.wrap_s, sampler.wrap_t].map(wrap)
}

fn wrap(mode: Checked<WrappingMode>) -> Wrap {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}
