use std::sync::Arc;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::Maps;
use super::light_map::{rgb, transport};
use crate::cpu;
use crate::march::{LightMapTraversal, ViewRay};
use crate::scene::{Basis, Grid, Hit, Image, Ray, Rgb, Scene, ShadowMap};
use crate::{Error, Result};

/// Rows of pixels whose rays are held at once.
const PIXELS_AT_ONCE: usize = 1 << 15;

/// A view under constant light and under a light map.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendering {
    /// Under the light's own radiance.
    pub before: Image,
    /// Under the light map; the same as `before` where none was given.
    pub after: Image,
}

/// Renders view `view` with the light's own radiance and with the texels of a light map.
///
/// Scattered light is that of the operator that is solved with, over all pixels. To it come surfaces (diffuse, lit by
/// the sun where nothing blocks it and by the ambient light) and the ambient light that the medium
/// scatters, so that pictures can be read.
///
/// Errors: [`Error::Shape`] for a light map of another size, [`Error::NonFinite`] naming the pixel.
/// Cost    two walks a pixel: one through lit stretches, one through texels that differ from the light's radiance
pub fn render(scene: &Scene, maps: &Maps, light_map: Option<&[Rgb]>, view: usize) -> Result<Rendering> {
    let changed = light_map.map(|texels| Changed::new(scene, maps, texels)).transpose()?;
    let camera = &scene.views[view].camera;
    let [width, height] = camera.size();
    let mut pixels: Vec<[Rgb; 2]> = Vec::with_capacity(width * height);
    for first in (0..width * height).step_by(PIXELS_AT_ONCE) {
        let indices = first..(first + PIXELS_AT_ONCE).min(width * height);
        let seen: Vec<(Ray, Option<Hit>)> = indices
            .into_par_iter()
            .map(|index| {
                let ray = camera.pixel_ray(index % width, index / width);
                (ray, scene.geometry.first_hit(&ray, f64::INFINITY))
            })
            .collect();
        pixels.extend(render_pixels(scene, maps, changed.as_ref(), &seen));
    }
    let name = &scene.views[view].name;
    let picture = |which: usize| {
        let pixels = pixels.iter().map(|pixel| pixel[which]).collect();
        Image::new([width, height], pixels)?.finite(&format!("the picture of view `{name}`"))
    };
    Ok(Rendering { before: picture(0)?, after: picture(1)? })
}

/// A light map as its difference to the light's own radiance.
struct Changed {
    difference: Vec<Rgb>,
    /// Where the difference is not zero, one texel of the basis' support around it included.
    mask: Arc<ShadowMap>,
}

impl Changed {
    fn new(scene: &Scene, maps: &Maps, texels: &[Rgb]) -> Result<Self> {
        let grid = maps.light_map;
        if texels.len() != grid.len() {
            return Err(Error::Shape { what: "the light map", expected: grid.len(), got: texels.len() });
        }
        let start = scene.light.radiance;
        let difference: Vec<Rgb> = texels.iter().map(|texel| rgb(|c| texel[c] - start[c])).collect();
        let [width, height] = grid.size;
        let mut near = vec![false; grid.len()];
        for (index, _) in difference.iter().enumerate().filter(|(_, change)| **change != [0.0; 3]) {
            let (i, j) = (index % width, index / width);
            for j in j.saturating_sub(1)..(j + 2).min(height) {
                near[j * width + i.saturating_sub(1)..j * width + (i + 2).min(width)].fill(true);
            }
        }
        Ok(Self { difference, mask: Arc::new(ShadowMap::mask(grid, &near)?) })
    }
}

/// Before and after of some pixels.
fn render_pixels(
    scene: &Scene,
    maps: &Maps,
    changed: Option<&Changed>,
    seen: &[(Ray, Option<Hit>)],
) -> Vec<[Rgb; 2]> {
    let rays: Arc<[ViewRay]> = seen
        .iter()
        .map(|(ray, hit)| {
            let length = hit.map_or(f64::INFINITY, |hit| hit.distance);
            ViewRay::new(ray, length, &maps.frame, &scene.medium)
        })
        .collect();
    let mut transport = transport(scene, maps, scene.solve.quadrature);
    transport.mask = changed.map(|changed| changed.mask.clone());
    let traversal = LightMapTraversal::new(transport, rays);
    let start = scene.light.radiance;
    (0..seen.len())
        .into_par_iter()
        .map(|row| {
            let (ray, hit) = &seen[row];
            let ambient = ambient(scene, hit.as_ref());
            let sun = hit.as_ref().and_then(|hit| sunlight(scene, ray, hit));
            let lit = traversal.lit_weight(row);
            let before = rgb(|c| {
                ambient[c] + lit[c] as f32 * start[c] + sun.map_or(0.0, |(_, share)| share[c] * start[c])
            });
            let Some(Changed { difference, .. }) = changed else { return [before; 2] };
            let scattered = gather(scene, &traversal, row, difference);
            let incident =
                sun.map(|(point, share)| (share, lookup(maps, scene.solve.basis, difference, point)));
            let after = rgb(|c| {
                before[c] + scattered[c] + incident.map_or(0.0, |(share, light)| share[c] * light[c])
            });
            [before, after]
        })
        .collect()
}

fn gather(scene: &Scene, traversal: &LightMapTraversal, row: usize, texels: &[Rgb]) -> Rgb {
    if scene.medium.is_grey() {
        cpu::gather::<f32, 1>(traversal, row, texels)
    } else {
        cpu::gather::<f32, 3>(traversal, row, texels)
    }
}

/// Ambient light that the medium scatters towards the eye, and that the surface behind it reflects.
fn ambient(scene: &Scene, hit: Option<&Hit>) -> Rgb {
    let transmittance = hit.map_or([0.0; 3], |hit| scene.medium.transmittance(hit.distance));
    rgb(|c| {
        let surface = hit.map_or(0.0, |hit| hit.albedo[c]);
        let medium = scene.medium.albedo[c] as f32;
        scene.ambient[c] * (medium + transmittance[c] as f32 * (surface - medium))
    })
}

/// Where the sun meets a surface, and the radiance towards the eye per radiance of the sun; none in shadow.
///
/// The sun's radiance is taken over one steradian, as the scattering integral takes it.
fn sunlight(scene: &Scene, ray: &Ray, hit: &Hit) -> Option<(DVec3, Rgb)> {
    let cosine = -hit.normal.dot(scene.light.direction);
    if cosine <= 0.0 {
        return None;
    }
    let point = ray.at(hit.distance);
    let lifted = point + hit.normal * (1e-4 * (1.0 + hit.distance));
    let towards_sun = Ray { origin: lifted, direction: -scene.light.direction };
    if scene.geometry.blocks(&towards_sun, f64::INFINITY) {
        return None;
    }
    let transmittance = scene.medium.transmittance(hit.distance);
    Some((
        point,
        rgb(|c| (f64::from(hit.albedo[c]) * cosine / std::f64::consts::PI * transmittance[c]) as f32),
    ))
}

/// The texels' value at a world-space point; zero outside them.
fn lookup(maps: &Maps, basis: Basis, texels: &[Rgb], point: DVec3) -> Rgb {
    let grid: &Grid = &maps.light_map;
    let p = maps.frame.light_from_world(point);
    let p = grid.grid_from_light(DVec2::new(p.x, p.y));
    let size = DVec2::new(grid.size[0] as f64, grid.size[1] as f64);
    if p.cmplt(DVec2::ZERO).any() || p.cmpge(size).any() {
        return [0.0; 3];
    }
    let texel = |x: f64, y: f64| texels[y as usize * grid.size[0] + x as usize];
    match basis {
        Basis::Nearest => texel(p.x, p.y),
        Basis::Bilinear => {
            let q = (p - 0.5).clamp(DVec2::ZERO, size - 1.0);
            let (low, high) = (q.floor(), (q.floor() + 1.0).min(size - 1.0));
            let f = (q - low).as_vec2();
            let row = |y: f64| {
                let (a, b) = (texel(low.x, y), texel(high.x, y));
                rgb(|c| a[c] + f.x * (b[c] - a[c]))
            };
            let (a, b) = (row(low.y), row(high.y));
            rgb(|c| a[c] + f.y * (b[c] - a[c]))
        }
    }
}
