//! From the rays of a picture to what the medium scatters along them.

use std::time::Instant;

use rayon::prelude::*;

#[cfg(feature = "gpu")]
use super::super::canvas::where_it_can;
use super::super::painted_rows::transport;
use super::super::upsampling::Coarse;
use super::super::{Canvas, Maps};
#[cfg(feature = "gpu")]
use super::adapter::OnAdapter;
use super::method::{Drawing, DrawingMethod};
use super::rays::{MARCHED_TO, PictureRays, SunLight};
use super::sliced::PictureSlices;
use super::{bilateral, marched};
use crate::march::{LightMapTraversal, Traversal, ViewRay};
use crate::scene::{Camera, Quadrature, Rgb, Scene, rgb};
use crate::{Error, Result};

impl Drawing {
    /// What previews are drawn with, which the next one replaces: slices, unless there are panes.
    pub fn preview(maps: &Maps) -> Self {
        match maps.geometry.has_panes() {
            true => Self::default(),
            false => Self { method: DrawingMethod::Epipolar { samples: PREVIEWED }, reduced: 1 },
        }
    }
}

/// Samples of a slice of previews at most.
const PREVIEWED: usize = 1024;

/// Pixels of each of a coarse picture's, along both axes, between which angles hardly change.
const NEARBY: usize = 16;

/// What the pixels of a picture show of the sun in the medium, and what a light map changes of that.
///
/// `coarse` are the rays through the corners of squares of pixels, where it is drawn at a lower resolution.
///
/// Errors: [`Error::Empty`] for panes, which none of these methods knows, and for a light map that the method cannot show.
pub(in crate::problem) fn scattered(
    (drawing, canvas): (Drawing, &Canvas),
    light: SunLight,
    camera: &Camera,
    rays: &[ViewRay],
    coarse: &dyn Fn() -> Vec<ViewRay>,
) -> Result<Vec<[Rgb; 2]>> {
    let angles = PixelAngles::of(camera);
    let [width, _] = camera.size();
    if drawing.reduced <= 1 {
        let angle = |index: usize| angles.at([index % width, index / width]);
        let of = PictureRays { rays, width, angle: &angle };
        return Prepared::new((drawing.method, canvas), light, &of)?.shown(light);
    }
    let times = drawing.reduced;
    let (coarse, columns) = (coarse(), width.div_ceil(times) + 1);
    let angle =
        |index: usize| times as f64 * angles.at([index % columns, index / columns].map(|at| at * times));
    let of = PictureRays { rays: &coarse, width: columns, angle: &angle };
    let drawn = Prepared::new((drawing.method, canvas), light, &of)?.shown(light)?;
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

/// Rays, and what a method makes of them before it knows the light.
enum Prepared<'a> {
    Exact(LightMapTraversal),
    Marched(&'a PictureRays<'a>, DrawingMethod),
    Sliced(PictureSlices, DrawingMethod),
    #[cfg(feature = "gpu")]
    OnAdapter(OnAdapter),
}

impl<'a> Prepared<'a> {
    /// Errors: [`Error::Empty`] for panes; those of an adapter.
    fn new(
        (method, canvas): (DrawingMethod, &Canvas),
        light: SunLight,
        of: &'a PictureRays<'a>,
    ) -> Result<Self> {
        if light.maps.geometry.has_panes() {
            let reason = format!(
                "`{method}` knows light and shadow alone here, and the scene has panes (glass, or leaves that let light through)"
            );
            return Err(Error::Empty { reason, remedy: "draw with method exact, and every pixel" });
        }
        #[cfg(feature = "gpu")]
        if let Canvas::Adapter(gpu) = canvas
            && let Some(adapter) = where_it_can(OnAdapter::new(gpu, method, light, of))?.flatten()
        {
            return Ok(Self::OnAdapter(adapter));
        }
        #[cfg(not(feature = "gpu"))]
        let Canvas::Processor = canvas;
        Ok(match method {
            DrawingMethod::Exact => Self::Exact(own_rows(light, of.rays)),
            DrawingMethod::March { .. } | DrawingMethod::Bilateral { .. } => Self::Marched(of, method),
            _ => Self::Sliced(PictureSlices::new(light, of, method), method),
        })
    }

    /// What the rays show.
    ///
    /// Errors: [`Error::Empty`] for a light map before min-max trees.
    fn shown(&self, light: SunLight) -> Result<Vec<[Rgb; 2]>> {
        match self {
            Self::Exact(rows) => {
                let count = rows.rays().len();
                Ok((0..count).into_par_iter().map(|row| exact(light, rows, row)).collect())
            }
            Self::Marched(of, DrawingMethod::Bilateral { steps }) => {
                Ok(bilateral::smoothed(light, of, *steps))
            }
            Self::Marched(of, DrawingMethod::March { steps }) => {
                Ok(marched::marched(light, of.rays, *steps, &|_| 0.5))
            }
            Self::Marched(..) => Ok(Vec::new()),
            Self::Sliced(slices, method) => slices.shown(*method, light),
            #[cfg(feature = "gpu")]
            Self::OnAdapter(adapter) => adapter.shown(light),
        }
    }
}

/// The rays of a view, to draw what the medium scatters of the sun along them in any way, and to time that.
#[derive(Debug)]
pub struct ScatteredView<'a> {
    scene: &'a Scene,
    maps: &'a Maps,
    camera: &'a Camera,
    rays: Vec<ViewRay>,
}

/// What was drawn of a view, and how long that took, first hits apart.
#[derive(Debug)]
pub struct DrawnView {
    /// Radiance that the medium scatters of the sun, pixel by pixel.
    pub pixels: Vec<Rgb>,
    /// Seconds before the light was known.
    pub set_up_seconds: f64,
    /// Seconds for that light.
    pub seconds: f64,
    /// Bytes of slices.
    pub bytes: u64,
}

impl<'a> ScatteredView<'a> {
    /// Finds the first hits of a camera's rays.
    pub fn new(scene: &'a Scene, maps: &'a Maps, camera: &'a Camera) -> Self {
        let [width, height] = camera.size();
        let ray = |index: usize| {
            let ray = camera.pixel_ray(index % width, index / width);
            let hit = maps.geometry.first_hit(&ray, f64::INFINITY);
            maps.view_ray(&ray, hit.map_or(f64::INFINITY, |hit| hit.distance), &scene.medium).0
        };
        Self { scene, maps, camera, rays: (0..width * height).into_par_iter().map(ray).collect() }
    }

    /// The view under the plain light, or under texels that differ from it by so much.
    ///
    /// Errors: [`Error::Empty`] for panes, and for a light map that the method cannot show.
    pub fn drawn(&self, method: DrawingMethod, change: Option<&[Rgb]>) -> Result<DrawnView> {
        let angles = PixelAngles::of(self.camera);
        let [width, _] = self.camera.size();
        let angle = |index: usize| angles.at([index % width, index / width]);
        let light = SunLight { scene: self.scene, maps: self.maps, change: change.map(|it| (it, [0.0; 3])) };
        let of = PictureRays { rays: &self.rays, width, angle: &angle };
        let clock = Instant::now();
        let prepared = Prepared::new((method, &Canvas::Processor), light, &of)?;
        let set_up_seconds = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let shown = prepared.shown(light)?;
        let seconds = clock.elapsed().as_secs_f64();
        let bytes = if let Prepared::Sliced(slices, _) = &prepared { slices.bytes() } else { 0 };
        let pixels = shown.into_iter().map(|[plain, change]| rgb(|c| plain[c] + change[c])).collect();
        Ok(DrawnView { pixels, set_up_seconds, seconds, bytes })
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
struct PixelAngles {
    columns: usize,
    angles: Vec<f32>,
}

impl PixelAngles {
    fn of(camera: &Camera) -> Self {
        let [columns, rows] = camera.size().map(|side| side.div_ceil(NEARBY) + 1);
        let angle =
            |index: usize| camera.pixel_angle(index % columns * NEARBY, index / columns * NEARBY) as f32;
        Self { columns, angles: (0..columns * rows).into_par_iter().map(angle).collect() }
    }

    /// The least of those around a pixel.
    fn at(&self, [x, y]: [usize; 2]) -> f64 {
        let (columns, rows) = (self.columns, self.angles.len() / self.columns);
        let [x, y] = [(x / NEARBY).min(columns - 2), (y / NEARBY).min(rows - 2)];
        let first = y * columns + x;
        let around = [first, first + 1, first + columns, first + columns + 1];
        around.into_iter().map(|index| f64::from(self.angles[index])).fold(f64::INFINITY, f64::min)
    }
}
