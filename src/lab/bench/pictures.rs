//! Pictures of scattered light: error against time of every method, over sizes of pictures and maps.

use std::sync::Arc;

use glam::DAffine3;

use super::log::Log;
use super::subject::SceneSource;
use crate::Result;
use crate::job::{Scenes, Stop};
use crate::problem::{DrawingMethod, DrawnView, ScatteredView, fit};
use crate::report::bench::PictureRecord;
use crate::scene::{Rgb, rgb};
use crate::visibility::Geometry;

/// Sizes of pictures, and texels along a side of both maps.
const SIZES: [[usize; 2]; 3] = [[640, 360], [1280, 720], [1920, 1080]];
const MAPS: [usize; 4] = [512, 1024, 2048, 4096];
const SMALL: [usize; 2] = [320, 180];
const SMALL_MAP: usize = 256;
/// How often a picture is drawn; the quickest one counts.
const TRIALS: usize = 3;
/// Seconds from which on one trial is enough.
const LONG: f64 = 2.0;

/// What is drawn, the exact rows first: the others are measured against them.
fn methods() -> Vec<DrawingMethod> {
    let mut methods = vec![DrawingMethod::Exact];
    methods.extend([16, 64, 256, 1024].map(|steps| DrawingMethod::March { steps }));
    methods.extend([512, 2048].map(|samples| DrawingMethod::MinMax { samples }));
    methods.extend([16, 32, 64, 128].map(|coefficients| DrawingMethod::Prefiltered { coefficients }));
    methods.extend([256, 512, 1024, 2048, 4096, 8192].map(|samples| DrawingMethod::Epipolar { samples }));
    methods.extend([8, 32].map(|steps| DrawingMethod::Bilateral { steps }));
    methods
}

/// Draws the first view of a scene in all ways; a volume has none.
///
/// Errors: those of the scene and of the log.
pub(super) fn pictures(
    source: &SceneSource,
    is_quick: bool,
    (log, stop): (&mut Log, &Stop),
    begin: &mut dyn FnMut(&str),
) -> Result<Vec<PictureRecord>> {
    let (sizes, maps): (&[_], &[_]) = if is_quick { (&[SMALL], &[SMALL_MAP]) } else { (&SIZES, &MAPS) };
    let mut records = Vec::new();
    for (&size, &map) in sizes.iter().flat_map(|size| maps.iter().map(move |map| (size, map))) {
        if stop.is_asked() {
            break;
        }
        let [width, height] = size;
        begin(&format!("{width} × {height}, maps of {map}²"));
        let case = format!("{}/pictures/{width}x{height}/{map}", source.name());
        let found = log.once(&case, || of_size(source, size, map, stop))?;
        records.extend(found.unwrap_or_default());
    }
    Ok(records)
}

/// All pictures of one size, under the plain light and under a light map.
fn of_size(source: &SceneSource, size: [usize; 2], map: usize, stop: &Stop) -> Result<Vec<PictureRecord>> {
    let [width, height] = size;
    let sets = [format!("shadow_map.size={map}"), format!("light_map.size={map}")];
    let Scenes::LightMap(scene) = source.load(&sets)? else { return Ok(Vec::new()) };
    let maps = fit(&scene, &scene.light_map, &Arc::new(Geometry::new(scene.mesh.clone())?))?;
    // Paint is in pixels, and stays where it is.
    let camera = scene.views[0].camera.moved(DAffine3::IDENTITY, size)?;
    let view = ScatteredView::new(&scene, &maps, &camera);
    let change = waves(maps.light_map.size, scene.light.radiance);
    let mut records = Vec::new();
    for light_map in [false, true] {
        let change = light_map.then_some(&change[..]);
        let mut truth: Vec<Rgb> = Vec::new();
        for method in methods() {
            // A tree of least and largest depths knows no colours.
            let cannot = light_map && matches!(method, DrawingMethod::MinMax { .. });
            if cannot || stop.is_asked() {
                continue;
            }
            let drawn = quickest(|| view.drawn(method, change))?;
            if method == DrawingMethod::Exact {
                truth.clone_from(&drawn.pixels);
            }
            let (name, number) = method.name();
            let [error, largest, within] = apart(&drawn.pixels, &truth);
            records.push(PictureRecord {
                scene: source.name(),
                width,
                height,
                map,
                light_map,
                method: name.to_owned(),
                number,
                set_up_seconds: drawn.set_up_seconds,
                seconds: drawn.seconds,
                error,
                largest,
                within,
                bytes: drawn.bytes,
            });
        }
    }
    Ok(records)
}

fn quickest(mut draw: impl FnMut() -> Result<DrawnView>) -> Result<DrawnView> {
    let mut best = draw()?;
    for _ in 1..TRIALS {
        if best.set_up_seconds + best.seconds > LONG {
            break;
        }
        let drawn = draw()?;
        best.set_up_seconds = best.set_up_seconds.min(drawn.set_up_seconds);
        best.seconds = best.seconds.min(drawn.seconds);
    }
    Ok(best)
}

/// How far a light map of coloured waves is from the plain light.
fn waves([width, height]: [usize; 2], light: Rgb) -> Vec<Rgb> {
    let texel = |k: usize| {
        let (x, y) = ((k % width) as f32 / width as f32, (k / width) as f32 / height as f32);
        let value = [(12.0 * x).sin(), (9.0 * y).cos(), (20.0 * (x + y)).sin()];
        rgb(|c| light[c] * (0.5 * value[c] - 0.5))
    };
    (0..width * height).map(texel).collect()
}

/// Root mean square of the difference and the largest one, relative to the brightest pixel; and the share of pixels that differ by less than a
/// step of 8 bits in each channel.
fn apart(pixels: &[Rgb], truth: &[Rgb]) -> [f64; 3] {
    let brightest = truth.iter().flatten().copied().fold(f32::MIN_POSITIVE, f32::max);
    let (mut squares, mut largest, mut within) = (0.0, 0.0_f64, 0_usize);
    for (pixel, truth) in pixels.iter().zip(truth) {
        let differences = rgb(|c| (pixel[c] - truth[c]).abs() / brightest).map(f64::from);
        squares += differences.iter().map(|it| it * it).sum::<f64>();
        let most = differences.iter().copied().fold(0.0, f64::max);
        largest = largest.max(most);
        within += usize::from(most < 1.0 / 255.0);
    }
    let count = truth.len().max(1) as f64;
    [(squares / (3.0 * count)).sqrt(), largest, within as f64 / count]
}
