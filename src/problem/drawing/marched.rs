//! The papers' march: equal steps along each ray, each worth its middle.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::rays::{MARCHED_TO, SunLight};
use crate::march::ViewRay;
use crate::scene::{Basis, Grid, Rgb, rgb};

/// What rays show in so many steps, of which `offset` of a row says where each is looked at, from 0 to 1.
///
/// Each step weighs what is extinguished along it, so that constant light is exact.
pub(super) fn marched(
    light: SunLight,
    rays: &[ViewRay],
    steps: usize,
    offset: &(dyn Fn(usize) -> f64 + Sync),
) -> Vec<[Rgb; 2]> {
    rays.par_iter().enumerate().map(|(row, ray)| of_ray(light, ray, steps, offset(row))).collect()
}

fn of_ray(light: SunLight, ray: &ViewRay, steps: usize, offset: f64) -> [Rgb; 2] {
    let SunLight { scene, maps, change } = light;
    let sigma_t = scene.medium.sigma_t;
    let step = ray.length.min(scene.medium.reach(MARCHED_TO)) / steps as f64;
    let ratios = sigma_t.map(|sigma| (-sigma * step).exp());
    let mut weights = ratios.map(|ratio| 1.0 - ratio);
    let (mut plain, mut changed) = ([0.0; 3], [0.0; 3]);
    for j in 0..steps {
        let at = ray.origin + (j as f64 + offset) * step * ray.direction;
        if maps.shadow_map.is_lit(at) {
            (0..3).for_each(|c| plain[c] += weights[c]);
            if let Some((texels, outside)) = change {
                let value = value_at(texels, &maps.light_map, scene.solve.basis, at).unwrap_or(outside);
                (0..3).for_each(|c| changed[c] += weights[c] * f64::from(value[c]));
            }
        }
        (0..3).for_each(|c| weights[c] *= ratios[c]);
    }
    let shown = |sum: [f64; 3]| rgb(|c| (ray.scattering[c] * sum[c]) as f32);
    let plain = shown(plain);
    [rgb(|c| plain[c] * scene.light.radiance[c]), shown(changed)]
}

/// The value of a light map at a place in the light's frame; none beside it.
fn value_at(texels: &[Rgb], grid: &Grid, basis: Basis, place: DVec3) -> Option<Rgb> {
    let at = grid.grid_from_light(DVec2::new(place.x, place.y));
    let [width, height] = grid.size;
    let size = DVec2::new(width as f64, height as f64);
    if at.cmplt(DVec2::ZERO).any() || at.cmpge(size).any() {
        return None;
    }
    if basis == Basis::Nearest {
        return Some(texels[at.y as usize * width + at.x as usize]);
    }
    let at = (at - 0.5).clamp(DVec2::ZERO, size - 1.0);
    let (i, j) = (at.x as usize, at.y as usize);
    let (u, v) = (at.x.fract() as f32, at.y.fract() as f32);
    let texel = |i: usize, j: usize| texels[j.min(height - 1) * width + i.min(width - 1)];
    let [a, b, c, d] = [texel(i, j), texel(i + 1, j), texel(i, j + 1), texel(i + 1, j + 1)];
    Some(rgb(|k| (1.0 - v) * ((1.0 - u) * a[k] + u * b[k]) + v * ((1.0 - u) * c[k] + u * d[k])))
}
