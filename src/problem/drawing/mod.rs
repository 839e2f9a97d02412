//! Other ways than the exact rows to draw what the medium scatters of the sun: those of the literature, and slices.

mod bilateral;
mod marched;
mod method;
mod sliced;

use rayon::prelude::*;

pub use method::{Drawing, DrawingMethod};

use super::Maps;
use super::painted_rows::transport;
use super::upsampling::Coarse;
use crate::march::{LightMapTraversal, Traversal, ViewRay};
use crate::scene::{Camera, Quadrature, Rgb, Scene, rgb};
use crate::{Error, Result};

/// The light of a sun: its radiance, and how far that of another light map is from it.
#[derive(Clone, Copy)]
pub(super) struct SunLight<'a> {
    pub(super) scene: &'a Scene,
    pub(super) maps: &'a Maps,
    /// Texels less the radiance of the sun, and the same of what comes from outside the light map; none where nothing changes.
    pub(super) change: Option<(&'a [Rgb], Rgb)>,
}

/// Rays of a picture.
pub(super) struct PictureRays<'a> {
    pub(super) rays: &'a [ViewRay],
    /// Columns of the picture.
    pub(super) width: usize,
    /// The angle between a ray and its neighbours, in radians.
    pub(super) angle: &'a (dyn Fn(usize) -> f64 + Sync),
}

/// Pixels of each of a coarse picture's, along both axes, between which angles hardly change.
const NEARBY: usize = 16;

/// What the pixels of a picture show of the sun in the medium, and what a light map changes of that.
///
/// `coarse` are the rays through the corners of squares of pixels, where it is drawn at a lower resolution.
///
/// Errors: [`Error::Empty`] for panes, which none of these methods knows, and for a light map that the method cannot show.
pub(super) fn scattered(
    drawing: Drawing,
    light: SunLight,
    camera: &Camera,
    rays: &[ViewRay],
    coarse: &dyn Fn() -> Vec<ViewRay>,
) -> Result<Vec<[Rgb; 2]>> {
    if light.maps.geometry.has_panes() {
        let reason = format!("`{}` knows light and shadow alone, and the scene has panes", drawing.method);
        return Err(Error::Empty { reason, remedy: "draw with method exact" });
    }
    let angles = PixelAngles::of(camera);
    let [width, _] = camera.size();
    if drawing.reduced <= 1 {
        let angle = |index: usize| angles.at([index % width, index / width]);
        return of_rays(drawing.method, light, &PictureRays { rays, width, angle: &angle });
    }
    let times = drawing.reduced;
    let (coarse, columns) = (coarse(), width.div_ceil(times) + 1);
    let angle =
        |index: usize| times as f64 * angles.at([index % columns, index / columns].map(|at| at * times));
    let drawn =
        of_rays(drawing.method, light, &PictureRays { rays: &coarse, width: columns, angle: &angle })?;
    let end = |ray: &ViewRay| ray.length.min(light.scene.medium.reach(MARCHED_TO));
    let samples = coarse.iter().zip(&drawn).map(|(ray, [plain, change])| {
        let value = [plain[0], plain[1], plain[2], change[0], change[1], change[2]];
        (end(ray), value.map(f64::from))
    });
    let coarse = Coarse::new(columns, samples.collect());
    let own = own_rows(light, rays);
    let pixel = |(index, ray): (usize, &ViewRay)| {
        let at = [index % width, index / width].map(|at| (at as f64 + 0.5) / times as f64);
        match coarse.between(at, end(ray)) {
            Some([a, b, c, d, e, f]) => [[a, b, c], [d, e, f]].map(|color| color.map(|it| it as f32)),
            None => exact(light, &own, index),
        }
    };
    Ok(rays.par_iter().enumerate().map(pixel).collect())
}

/// Transmittance beyond which marches do not go: a quarter of what 8 bits show.
const MARCHED_TO: f64 = 1.0 / 1024.0;

fn of_rays(method: DrawingMethod, light: SunLight, of: &PictureRays) -> Result<Vec<[Rgb; 2]>> {
    match method {
        DrawingMethod::Exact => {
            let rows = own_rows(light, of.rays);
            Ok((0..of.rays.len()).into_par_iter().map(|row| exact(light, &rows, row)).collect())
        }
        DrawingMethod::March { steps } => Ok(marched::marched(light, of.rays, steps, &|_| 0.5)),
        DrawingMethod::Bilateral { steps } => Ok(bilateral::smoothed(light, of, steps)),
        DrawingMethod::MinMax { .. } | DrawingMethod::Prefiltered { .. } | DrawingMethod::Epipolar { .. } => {
            sliced::sliced(method, light, of)
        }
    }
}

fn own_rows(light: SunLight, rays: &[ViewRay]) -> LightMapTraversal {
    let transport = transport(light.scene, light.maps, Quadrature::Exact);
    LightMapTraversal::new(transport, rays.into())
}

/// What the exact row of a ray shows.
fn exact(light: SunLight, rows: &LightMapTraversal, row: usize) -> [Rgb; 2] {
    let lit_ray = rows.lit_ray(row);
    let (lit, start) = (lit_ray.weight(), light.scene.light.radiance);
    let change = light.change.map_or([0.0; 3], |(texels, outside)| {
        let inside = Traversal::<f64, 3>::gather(&lit_ray, 0, texels);
        let weight = if outside == [0.0; 3] { [0.0; 3] } else { rows.outside_weight(row) };
        rgb(|c| (inside[c] + weight[c] * f64::from(outside[c])) as f32)
    });
    [rgb(|c| lit[c] as f32 * start[c]), change]
}

/// The angles between pixels and their neighbours, known at some of them: a lens changes them slowly.
pub(super) struct PixelAngles {
    columns: usize,
    angles: Vec<f32>,
}

impl PixelAngles {
    pub(super) fn of(camera: &Camera) -> Self {
        let [columns, rows] = camera.size().map(|side| side.div_ceil(NEARBY) + 1);
        let angle =
            |index: usize| camera.pixel_angle(index % columns * NEARBY, index / columns * NEARBY) as f32;
        Self { columns, angles: (0..columns * rows).into_par_iter().map(angle).collect() }
    }

    /// The least of those around a pixel.
    pub(super) fn at(&self, [x, y]: [usize; 2]) -> f64 {
        let (columns, rows) = (self.columns, self.angles.len() / self.columns);
        let [x, y] = [(x / NEARBY).min(columns - 2), (y / NEARBY).min(rows - 2)];
        let first = y * columns + x;
        let around = [first, first + 1, first + columns, first + columns + 1];
        around.into_iter().map(|index| f64::from(self.angles[index])).fold(f64::INFINITY, f64::min)
    }
}
