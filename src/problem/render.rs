use std::sync::Arc;

use rayon::prelude::*;

use super::drawing::{Drawing, SunLight, scattered};
use super::painted_rows::transport;
use super::scattering::{Light, Scattering};
use super::surroundings::{Corners, Seen};
use super::{Canvas, Maps};
use crate::march::{LightMapTraversal, SeenPanes, ViewRay};
use crate::scene::{Camera, Image, Ray, Rgb, Scene, rgb};
use crate::visibility::ShadowMap;
use crate::{Error, Result};

/// A view under constant light and under a light map.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendering {
    /// Under the light's own radiance.
    pub before: Image,
    /// Under the light map; the same as `before` where none was given.
    pub after: Image,
}

/// Which light a picture shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DrawnLight {
    /// All of it.
    #[default]
    All,
    /// What the medium scatters of the sun alone: what paint on light shafts is about.
    Scattered,
}

/// Renders a view on the processor, with the light's own radiance and with a light map: see [`Renderer`].
///
/// Errors: as [`Renderer::new`] and [`Renderer::picture`].
pub fn render(scene: &Scene, maps: &Maps, light_map: Option<&[Rgb]>, view: usize) -> Result<Rendering> {
    Renderer::new(scene, maps, light_map)?.picture(view, &Canvas::Processor)
}

/// Renders views with the light's own radiance, and with a light map.
///
/// Scattered light is that of the operator that is solved with, over all pixels. To it come surfaces (diffuse, lit by
/// the sun and the lights of the sky where nothing blocks them, and by the ambient light), what the medium scatters of those lights,
/// and the ambient light that it scatters, so that pictures can be read.
///
/// Cost    two walks a pixel: one that finds what is lit, one through texels there that differ from the light's radiance; and one more
///         that finds what is lit for every light of the sky that is not dark
#[derive(Debug)]
pub struct Renderer<'a> {
    scene: &'a Scene,
    maps: &'a Maps,
    changed: Option<Changed>,
    light: DrawnLight,
    drawing: Drawing,
}

impl<'a> Renderer<'a> {
    /// `light_map` has the texels alone, and the surroundings are as they start; or it has all elements of a problem, which are the texels
    /// and behind them those of the surroundings. Pictures show all light.
    ///
    /// Errors: [`Error::Shape`] for a light map of another size.
    pub fn new(scene: &'a Scene, maps: &'a Maps, light_map: Option<&[Rgb]>) -> Result<Self> {
        let changed = light_map.map(|texels| Changed::new(scene, maps, texels)).transpose()?;
        Ok(Self { scene, maps, changed, light: DrawnLight::All, drawing: Drawing::default() })
    }

    /// Shows some of the light alone.
    pub fn showing(self, light: DrawnLight) -> Self {
        Self { light, ..self }
    }

    /// Draws what the medium scatters of the sun in another way.
    pub fn drawing(self, drawing: Drawing) -> Self {
        Self { drawing, ..self }
    }

    /// The pictures of a view.
    ///
    /// Errors: [`Error::NonFinite`] naming the pixel; those of an adapter; [`Error::Empty`] for what another [`Drawing`] cannot show.
    pub fn picture(&self, view: usize, canvas: &Canvas) -> Result<Rendering> {
        let view = &self.scene.views[view];
        self.picture_from(&view.camera, &format!("the picture of view `{}`", view.name), canvas)
    }

    /// Those of any camera; `what` they are says an error.
    ///
    /// Errors: as [`Self::picture`].
    pub fn picture_from(&self, camera: &Camera, what: &str, canvas: &Canvas) -> Result<Rendering> {
        let Self { scene, maps, changed, .. } = self;
        let light = Light {
            scene,
            is_grey: maps.is_grey(&scene.medium),
            change: changed.as_ref().map(|changed| &changed.difference[..]),
        };
        let is_exact = self.drawing == Drawing::default();
        let scattering = if is_exact { Some(Scattering::new(canvas, light, maps)?) } else { None };
        let mut of_picture: Vec<ViewRay> = Vec::new();
        let air = maps.heterogeneity.as_ref().map(|air| air.over_picture(camera, &maps.geometry));
        let surface_light = maps.surface_light.as_ref().filter(|_| self.light == DrawnLight::All);
        let arriving = surface_light.map(|light| light.arriving(camera, &maps.geometry));
        let [width, height] = camera.size();
        let mut pixels: Vec<[Rgb; 2]> = Vec::with_capacity(width * height);
        for first in (0..width * height).step_by(canvas.pixels_at_once()) {
            let indices = first..(first + canvas.pixels_at_once()).min(width * height);
            let seen: Vec<Seen> = indices
                .into_par_iter()
                .map(|index| Seen::along(maps, camera.pixel_ray(index % width, index / width)))
                .collect();
            let air = |row: usize, ray: &Ray, length: f64| {
                air.as_ref().map_or(1.0, |air| air.factor(first + row, ray, length))
            };
            let arriving = arriving.as_ref().map(|arriving| &arriving[first..]);
            let (rays, added) = self.view_rays(&seen, &air);
            match &scattering {
                Some(scattering) => {
                    pixels.append(&mut self.pixels(&seen, arriving, (rays, &added), scattering)?)
                }
                None => {
                    let beside = |(row, seen): (usize, &Seen)| {
                        self.shown(seen, arriving.map(|it| it[row]), [added[row], [0.0; 3]])
                    };
                    pixels.par_extend(seen.par_iter().enumerate().map(beside));
                    of_picture.extend(rays);
                }
            }
        }
        if !is_exact {
            let scattered = self.scattered(camera, &of_picture, canvas)?;
            pixels.par_iter_mut().zip(scattered).for_each(|([before, after], [plain, change])| {
                (0..3).for_each(|c| before[c] += plain[c]);
                (0..3).for_each(|c| after[c] += plain[c] + change[c]);
            });
        }
        let picture = |which: usize| {
            let pixels = pixels.par_iter().map(|pixel| pixel[which]).collect();
            Image::new([width, height], pixels)?.finite(what)
        };
        Ok(Rendering { before: picture(0)?, after: picture(1)? })
    }

    /// The rays of some pixels through air of these factors, and what looks add to what they scatter.
    fn view_rays(
        &self,
        seen: &[Seen],
        air: &(dyn Fn(usize, &Ray, f64) -> f64 + Sync),
    ) -> (Vec<ViewRay>, Vec<Rgb>) {
        let ray = |(row, Seen { ray, hit, .. }): (usize, &Seen)| {
            let length = hit.map_or(f64::INFINITY, |hit| hit.distance);
            self.maps.view_ray_in(ray, length, &self.scene.medium, air(row, ray, length))
        };
        seen.par_iter().enumerate().map(ray).unzip()
    }

    /// What the medium scatters of the sun into a picture before, and what a light map changes of that, drawn in another way.
    fn scattered(&self, camera: &Camera, rays: &[ViewRay], canvas: &Canvas) -> Result<Vec<[Rgb; 2]>> {
        let Self { scene, maps, changed, drawing, .. } = self;
        let change = changed.as_ref().map(|changed| (&changed.difference[..], changed.sun));
        let times = drawing.reduced;
        let coarse = || -> Vec<ViewRay> {
            let [width, height] = camera.size().map(|side| side.div_ceil(times) + 1);
            let [right, bottom] = camera.size().map(|side| side as f64);
            let ray = |index: usize| {
                let [x, y] = [index % width, index / width].map(|at| (at * times) as f64);
                let ray = camera.ray(x.min(right), y.min(bottom));
                let hit = maps.geometry.first_hit(&ray, f64::INFINITY);
                maps.view_ray(&ray, hit.map_or(f64::INFINITY, |hit| hit.distance), &scene.medium).0
            };
            (0..width * height).into_par_iter().map(ray).collect()
        };
        scattered((*drawing, canvas), SunLight { scene, maps, change }, camera, rays, &coarse)
    }

    /// Before and after of some pixels with such rays and what looks add to these, at whose surfaces such light arrives in the place of the
    /// ambient light.
    fn pixels(
        &self,
        seen: &[Seen],
        arriving: Option<&[Rgb]>,
        (rays, added): (Vec<ViewRay>, &[Rgb]),
        scattering: &Scattering,
    ) -> Result<Vec<[Rgb; 2]>> {
        let Self { scene, maps, changed, .. } = self;
        let mut transport = transport(scene, maps, scene.solve.quadrature);
        transport.mask = changed.as_ref().map(|changed| changed.mask.clone());
        let has_panes = maps.geometry.has_panes();
        let panes = has_panes.then(|| SeenPanes::new(seen.iter().map(|seen| &seen.panes[..]))).flatten();
        let rows = LightMapTraversal::new(transport, rays.into()).through_panes(panes);
        let scattered = scattering.of(&rows)?;
        let pixel = |(row, [plain, change]): (usize, [Rgb; 2])| {
            let plain = rgb(|c| plain[c] + added[row][c]);
            let changed_sun = changed.as_ref().map_or([0.0; 3], |changed| changed.sun);
            let outside = match changed_sun {
                [0.0, 0.0, 0.0] => [0.0; 3],
                _ => rows.outside_weight(row),
            };
            let change = rgb(|c| change[c] + outside[c] as f32 * changed_sun[c]);
            self.shown(&seen[row], arriving.map(|it| it[row]), [plain, change])
        };
        Ok(scattered.into_par_iter().enumerate().map(pixel).collect())
    }

    /// Before and after of a pixel, given what the medium scatters of the sun before, and what a light map changes of that.
    fn shown(&self, seen: &Seen, arriving: Option<Rgb>, [plain, change]: [Rgb; 2]) -> [Rgb; 2] {
        match self.light {
            DrawnLight::Scattered => [plain, rgb(|c| plain[c] + change[c])],
            DrawnLight::All => {
                let [before, surface, around] = self.beside(seen, arriving, plain);
                [before, rgb(|c| before[c] + change[c] + surface[c] + around[c])]
            }
        }
    }

    /// All that a pixel shows before, what of it the medium scatters of the sun being known; and what a light map changes of the sun on
    /// its surface, and of the sky.
    fn beside(&self, seen: &Seen, arriving: Option<Rgb>, scattered: Rgb) -> [Rgb; 3] {
        let Self { scene, maps, changed, .. } = self;
        let start = scene.light.radiance;
        let sky =
            scene.surroundings.as_ref().and_then(|it| it.sky.as_ref()).map_or(&[][..], |sky| &sky.start);
        let changed_sky = changed.as_ref().map_or(&[][..], |it| &it.sky);
        let ambient = seen.under_ambient(scene, scene.ambient, arriving);
        let sun = seen.reflected(scene, maps, -scene.light.direction);
        let of_sky = OfSky::new(scene, maps, seen, [sky, changed_sky]);
        let around = of_sky.shown(sky);
        let before = rgb(|c| {
            let known = ambient[c] + scattered[c];
            known + sun.map_or(0.0, |(_, share)| share[c] * start[c]) + around[c]
        });
        let Some(changed) = changed else { return [before, [0.0; 3], [0.0; 3]] };
        let surface = sun.map_or([0.0; 3], |(point, share)| {
            let corners = Corners::around(maps, scene.solve.basis, point);
            let light = corners.map_or(changed.sun, |corners| corners.value(&changed.difference));
            rgb(|c| share[c] * light[c])
        });
        [before, surface, of_sky.shown(changed_sky)]
    }
}

/// What the pixels of a view show under the plain light, and which texels light the surfaces there: all of a picture but what the medium
/// scatters under another light map, which is a product with rows of its pixels.
#[derive(Debug, Clone)]
pub struct Backdrop {
    before: Image,
    /// Of each pixel the texels that light its surface, and what it shows of them.
    surfaces: Vec<Option<(Corners, Rgb)>>,
}

impl Backdrop {
    /// Of a view of a scene whose lights around are not looked for.
    ///
    /// Errors: as [`Renderer::picture`].
    pub fn new(scene: &Scene, maps: &Maps, view: usize) -> Result<Self> {
        let camera = &scene.views[view].camera;
        let [width, height] = camera.size();
        let surface = |index: usize| {
            let seen = Seen::along(maps, camera.pixel_ray(index % width, index / width));
            let (point, share) = seen.reflected(scene, maps, -scene.light.direction)?;
            Corners::around(maps, scene.solve.basis, point).map(|corners| (corners, share))
        };
        let surfaces = (0..width * height).into_par_iter().map(surface).collect();
        Ok(Self { before: render(scene, maps, None, view)?.before, surfaces })
    }

    /// The picture under the plain light.
    pub fn before(&self) -> &Image {
        &self.before
    }

    /// The picture under a light map, from how far its texels differ from the plain light, and what more the medium scatters in each
    /// pixel.
    pub fn after(&self, texels: &[Rgb], scattered: impl Fn(usize) -> Rgb + Sync) -> Image {
        let mut picture = self.before.clone();
        picture.pixels.par_iter_mut().enumerate().for_each(|(index, pixel)| {
            let more = scattered(index);
            let surface = self.surfaces[index].as_ref().map(|(at, share)| (at.value(texels), share));
            *pixel = rgb(|c| pixel[c] + more[c] + surface.map_or(0.0, |(light, share)| light[c] * share[c]));
        });
        picture
    }
}

/// A light map and the further elements behind its texels, as differences from their start.
#[derive(Debug)]
struct Changed {
    difference: Vec<Rgb>,
    /// Where a texel differs from its start, or one beside it does: the support of the basis.
    mask: Arc<ShadowMap>,
    /// Of the sun outside the light map.
    sun: Rgb,
    /// Of the lights of the sky.
    sky: Vec<Rgb>,
}

impl Changed {
    fn new(scene: &Scene, maps: &Maps, elements: &[Rgb]) -> Result<Self> {
        let grid = maps.light_map;
        let further_start =
            scene.surroundings.as_ref().map_or(Vec::new(), |it| it.start(scene.light.radiance));
        let expected = grid.len() + if elements.len() == grid.len() { 0 } else { further_start.len() };
        if elements.len() != expected {
            return Err(Error::Shape { what: "the light map", expected, got: elements.len() });
        }
        let (texels, further) = elements.split_at(grid.len());
        let start = scene.light.radiance;
        let difference: Vec<Rgb> = texels.iter().map(|texel| rgb(|c| texel[c] - start[c])).collect();
        let further = further.iter().zip(&further_start);
        let further: Vec<Rgb> = further.map(|(found, start)| rgb(|c| found[c] - start[c])).collect();
        let [width, height] = grid.size;
        let mut near = vec![false; grid.len()];
        for (index, _) in difference.iter().enumerate().filter(|(_, change)| **change != [0.0; 3]) {
            let (i, j) = (index % width, index / width);
            for j in j.saturating_sub(1)..(j + 2).min(height) {
                near[j * width + i.saturating_sub(1)..j * width + (i + 2).min(width)].fill(true);
            }
        }
        let around = scene.surroundings.as_ref();
        Ok(Self {
            difference,
            mask: Arc::new(ShadowMap::mask(grid, &near)?),
            sun: around.and_then(|it| it.sun_of(&further)).unwrap_or_default(),
            sky: around.map_or(Vec::new(), |it| it.sky_of(&further).to_vec()),
        })
    }
}

/// What a pixel shows of the lights of the sky that are not dark.
struct OfSky(Vec<[f64; 3]>);

impl OfSky {
    fn new(scene: &Scene, maps: &Maps, seen: &Seen, colors: [&[Rgb]; 2]) -> Self {
        let is_dark =
            |light: usize| colors.iter().all(|of| of.get(light).is_none_or(|color| *color == [0.0; 3]));
        Self(seen.of_sky(scene, maps, |light| !is_dark(light)))
    }

    fn shown(&self, colors: &[Rgb]) -> Rgb {
        let sum = |c: usize| {
            self.0.iter().zip(colors).map(|(weight, color)| weight[c] * f64::from(color[c])).sum::<f64>()
        };
        rgb(|c| sum(c) as f32)
    }
}
