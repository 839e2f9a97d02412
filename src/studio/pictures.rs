//! Pictures as pages show them.

use super::document::Document;
use super::full::{Full, relative};
use super::live::Live;
use super::messages::{Kind, Stage};
use crate::Result;
use crate::io::image::rgba_bytes;
use crate::io::scene_file::Paint;
use crate::job::{LivePictures, LiveVolume};
use crate::scene::Rgb;

/// Brush colours beside those of a scene; pages have white and black.
const PALETTE: [&str; 7] = ["#ffb347", "#ff7a2f", "#e0352b", "#c030f0", "#2f6bff", "#20b8d8", "#40c060"];

/// A picture on its way to pages.
pub(super) struct Shown {
    pub(super) kind: Kind,
    /// None of the light map.
    pub(super) view: Option<usize>,
    pub(super) stage: Stage,
    pub(super) size: [usize; 2],
    pub(super) bytes: Vec<u8>,
}

/// Hands out pictures of some kinds, those of the `first` view first; gives back the share of the paint that is met. What the full resolution
/// has takes the place of previews. `light` is the radiance of the sun, and pictures of views are brightened by `exposure`.
///
/// Errors: those of making previews.
pub(super) fn previews(
    live: &mut Live,
    full: Option<&Full>,
    (kinds, first): (&[Kind], usize),
    (light, exposure): (Rgb, f64),
    hand_out: &mut dyn FnMut(Shown),
) -> Result<Option<f64>> {
    if kinds.contains(&Kind::LightMap)
        && let Live::LightMap(live) = &*live
    {
        let (stage, map) = match full.and_then(|full| full.light_map.as_ref()) {
            Some(map) => (Stage::Full, map.clone()),
            None => (Stage::Preview, relative(&live.light_map()?, light)),
        };
        let bytes = rgba_bytes(&map, 1.0);
        hand_out(Shown { kind: Kind::LightMap, view: None, stage, size: map.size(), bytes });
    }
    let (pictures, volume) = match live {
        Live::LightMap(live) => (Some(live.pictures()?), None),
        Live::Volume(live) => (None, Some(&**live)),
    };
    let views = pictures.as_ref().map_or_else(|| volume.map_or(0, LiveVolume::views), LivePictures::views);
    let first = first.min(views.saturating_sub(1));
    for view in (first..views).chain(0..first) {
        for &kind in kinds.iter().filter(|&&kind| kind != Kind::LightMap) {
            let (stage, size, bytes) = match (full, kind) {
                (Some(full), Kind::After) => {
                    let after = &full.views[view];
                    (Stage::Full, after.size(), rgba_bytes(after, exposure))
                }
                _ => match (&pictures, volume) {
                    (Some(pictures), _) => preview_of(pictures, kind, view, exposure),
                    (None, Some(volume)) => preview_of_volume(volume, kind, view, exposure),
                    (None, None) => continue,
                },
            };
            hand_out(Shown { kind, view: Some(view), stage, size, bytes });
        }
    }
    Ok(pictures.map_or_else(|| volume.and_then(LiveVolume::met), |pictures| pictures.met()))
}

/// The paint that asks for what is seen at a pixel of a preview.
///
/// Errors: those of making previews.
pub(super) fn tint(live: &mut Live, view: usize, at: [usize; 2]) -> Result<Rgb> {
    Ok(match live {
        Live::LightMap(live) => live.pictures()?.tint(view, at),
        // Of a light as bright as what is seen there.
        Live::Volume(live) => {
            let seen = live.after(view).at(at[0], at[1]);
            let most = seen.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
            seen.map(|value| value / most)
        }
    })
}

/// What a preview shows.
fn preview_of(
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

/// What a preview of a volume shows. Light reaches all of it, and paint is one wish beside others.
fn preview_of_volume(
    volume: &LiveVolume,
    kind: Kind,
    view: usize,
    exposure: f64,
) -> (Stage, [usize; 2], Vec<u8>) {
    let before = volume.before(view);
    let bytes = match kind {
        Kind::After => rgba_bytes(volume.after(view), exposure),
        Kind::Target => rgba_bytes(&volume.target(view), exposure),
        Kind::Difference => rgba_bytes(&volume.difference(view), exposure),
        Kind::Coverage | Kind::Conflict => mask(before.pixels.iter().map(|_| false)),
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
