//! Pictures as pages show them.

use super::document::Document;
use super::messages::{Kind, Stage};
use crate::io::image::rgba_bytes;
use crate::io::scene_file::Paint;
use crate::job::LivePictures;
use crate::scene::{Image, Rgb};

/// Brush colours beside those of a scene; pages have white and black.
const PALETTE: [&str; 7] = ["#ffb347", "#ff7a2f", "#e0352b", "#c030f0", "#2f6bff", "#20b8d8", "#40c060"];

/// A light map relative to the brightest channel of its light.
pub(super) fn relative(map: &Image, light: Rgb) -> Image {
    let most = light.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
    let mut map = map.clone();
    map.pixels.iter_mut().for_each(|texel| *texel = texel.map(|value| value / most));
    map
}

/// What a preview shows.
pub(super) fn preview_of(
    pictures: &LivePictures<'_>,
    kind: Kind,
    view: usize,
    exposure: f64,
) -> (Stage, [usize; 2], Vec<u8>) {
    let before = pictures.before(view);
    let bytes = match kind {
        Kind::After => rgba_bytes(&pictures.after(view), exposure),
        Kind::Target => rgba_bytes(&pictures.target(view), exposure),
        Kind::Difference => rgba_bytes(&pictures.difference(view), exposure),
        Kind::Coverage => mask(pictures.reached(view).into_iter().map(|is_lit| !is_lit)),
        Kind::Conflict => mask(pictures.contested(view).into_iter()),
        Kind::Before | Kind::LightMap | Kind::Free => rgba_bytes(before, exposure),
    };
    (Stage::Preview, before.size(), bytes)
}

/// Black pixels, as alpha.
fn mask(is_set: impl Iterator<Item = bool>) -> Vec<u8> {
    is_set.flat_map(|is_set| [0, 0, 0, if is_set { 255 } else { 0 }]).collect()
}

/// The colours of a scene's strokes, in the order in which they first occur, then others.
pub(super) fn palette(document: &Document) -> Vec<String> {
    let mut palette: Vec<String> = Vec::new();
    let strokes = document.now().views.iter().flat_map(|strokes| strokes.iter());
    let used = strokes.filter_map(|stroke| match stroke.color {
        Paint::Hex([r, g, b]) => Some(format!("#{r:02x}{g:02x}{b:02x}")),
        Paint::Linear(_) => None,
    });
    for color in used.chain(PALETTE.map(str::to_owned)) {
        if !palette.contains(&color) && palette.len() < 14 {
            palette.push(color);
        }
    }
    palette
}
