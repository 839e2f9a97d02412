use std::path::Path;

use super::{read_target, srgb_from_linear};
use crate::Result;
use crate::scene::luminance;

/// Reads how much of a surface is there, from 0 to 255, row by row from the top left, with width and height:
/// the alpha of a picture or, where all of that is 1, its brightness as sRGB.
///
/// Errors: as [`super::read_image`], and [`crate::Error::Format`] when an alpha is outside [0, 1].
pub(in crate::io) fn read_cover(path: &Path) -> Result<([usize; 2], Vec<u8>)> {
    let picture = read_target(path, None)?;
    let is_opaque = picture.pixels.iter().all(|pixel| pixel[3] >= 1.0);
    let cover = |&[r, g, b, alpha]: &[f32; 4]| {
        let cover = if is_opaque { srgb_from_linear(luminance([r, g, b])) } else { alpha };
        (cover.clamp(0.0, 1.0) * 255.0).round() as u8
    };
    Ok((picture.size(), picture.pixels.iter().map(cover).collect()))
}
