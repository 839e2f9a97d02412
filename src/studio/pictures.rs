//! Pictures as pages show them.

use super::document::Document;
use super::full::{Full, relative};
use super::messages::{Kind, Stage};
use crate::Result;
use crate::io::image::rgba_bytes;
use crate::io::scene_file::Paint;
use crate::job::{LivePictures, LiveVolume};
use crate::scene::Rgb;

/// Brush colours beside those of a scene; pages have white and black.
const PALETTE: [&str; 7] = ["#ffb347", "#ff7a2f", "#e0352b", "#c030f0", "#2f6bff", "#20b8d8", "#40c060"];

/// What previews show.
pub(super) enum Seen<'a> {
    LightMap(LivePictures<'a>),
    Volume(&'a LiveVolume),
}

impl Seen<'_> {
    /// Whether views have pictures of a kind. Light reaches all of a volume, and paint is one wish beside others there.
    fn has(&self, kind: Kind) -> bool {
        match kind {
            Kind::LightMap | Kind::Free | Kind::Transfer => false,
            Kind::Coverage | Kind::Conflict | Kind::Depth => matches!(self, Self::LightMap(_)),
            Kind::After | Kind::Before | Kind::Target | Kind::Difference => true,
        }
    }
}

/// A picture on its way to pages.
pub(super) struct Shown {
    pub(super) kind: Kind,
    /// None of the light map.
    pub(super) view: Option<usize>,
    pub(super) stage: Stage,
    pub(super) size: [usize; 2],
    pub(super) bytes: Vec<u8>,
}

/// Hands out pictures of some kinds, those of the `first` view first, then the light map; gives back the share of the paint that is met. What the full resolution
/// has takes the place of previews. `light` is the radiance of the sun, and pictures of views are brightened by `exposure`.
///
/// Errors: those of making previews.
pub(super) fn previews(
    seen: &Seen<'_>,
    full: Option<&Full>,
    (kinds, first): (&[Kind], usize),
    (light, exposure): (Rgb, f64),
    hand_out: &mut dyn FnMut(Shown),
) -> Result<Option<f64>> {
    let views = match seen {
        Seen::LightMap(pictures) => pictures.views(),
        Seen::Volume(volume) => volume.views(),
    };
    let first = first.min(views.saturating_sub(1));
    for (turn, view) in (first..views).chain(0..first).enumerate() {
        for &kind in kinds.iter().filter(|&&kind| seen.has(kind)) {
            let (stage, size, bytes) = match (full, kind) {
                (Some(full), Kind::After) => {
                    let after = &full.views[view];
                    (Stage::Full, after.size(), rgba_bytes(after, exposure))
                }
                _ => match seen {
                    Seen::LightMap(pictures) => preview_of(pictures, kind, view, exposure),
                    Seen::Volume(volume) => preview_of_volume(volume, kind, view, exposure),
                },
            };
            hand_out(Shown { kind, view: Some(view), stage, size, bytes });
        }
        if turn == 0
            && kinds.contains(&Kind::LightMap)
            && let Seen::LightMap(pictures) = seen
        {
            let (stage, map) = match full.and_then(|full| full.light_map.as_ref()) {
                Some(map) => (Stage::Full, map.clone()),
                None => (Stage::Preview, relative(&pictures.light_map()?, light)),
            };
            let bytes = rgba_bytes(&map, 1.0);
            hand_out(Shown { kind: Kind::LightMap, view: None, stage, size: map.size(), bytes });
        }
    }
    Ok(match seen {
        Seen::LightMap(pictures) => pictures.met(),
        Seen::Volume(volume) => volume.met(),
    })
}

/// The paint that asks for what is seen at a pixel of a preview.
pub(super) fn tint(seen: &Seen<'_>, view: usize, at: [usize; 2]) -> Rgb {
    match seen {
        Seen::LightMap(pictures) => pictures.tint(view, at),
        // Of a light as bright as what is seen there.
        Seen::Volume(volume) => {
            let seen = volume.after(view).at(at[0], at[1]);
            let most = seen.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
            seen.map(|value| value / most)
        }
    }
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
        Kind::Depth => depths(&pictures.depths(view)),
        Kind::Before | Kind::LightMap | Kind::Free | Kind::Transfer => rgba_bytes(before, exposure),
    };
    (Stage::Preview, before.size(), bytes)
}

/// What a preview of a volume shows.
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
        _ => rgba_bytes(before, exposure),
    };
    (Stage::Preview, before.size(), bytes)
}

/// Depths in red, green and blue: log₂ from −64 to 64 as 24 bits, the largest where there is no surface.
fn depths(depths: &[f64]) -> Vec<u8> {
    const NOTHING: u32 = (1 << 24) - 1;
    let code = |depth: &f64| match depth.is_finite() {
        true => ((depth.log2().clamp(-64.0, 64.0) + 64.0) / 128.0 * f64::from(NOTHING - 1)) as u32,
        false => NOTHING,
    };
    depths
        .iter()
        .map(code)
        .flat_map(|code| [(code >> 16) as u8, (code >> 8) as u8, code as u8, 255])
        .collect()
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
