//! Light that a medium scatters, as the kernels look it up.

use glam::{DAffine3, DVec3};

use super::bricks::Pool;
use crate::gpu::kernels::layout::{LIGHTS, LightUniform};
use crate::march::{Density, InScattering, LitVolume};
use crate::scene::{BRICK, Interpolation, Ray, henyey_greenstein};

/// Parts of a cell that the coarse half of a transform is in: so few that what it makes of whole cells is exact in f32.
const PARTS: f64 = 1024.0;

/// What each light is times as it goes towards the eye of a ray.
pub(super) fn factors(light: &InScattering, ray: &Ray) -> [f32; LIGHTS] {
    let mut factors = [0.0; LIGHTS];
    for (factor, field) in factors.iter_mut().zip(light.fields()) {
        // Light that goes along w leaves towards the eye, against the view ray.
        *factor = field.along.map_or(1.0, |(w, g)| henyey_greenstein(g, -w.dot(ray.direction))) as f32;
    }
    factors
}

/// The largest radiance of each light.
pub(super) fn largest(light: &InScattering) -> Vec<f64> {
    let most = |[low, high]: [f32; 2]| f64::from(high.abs().max(low.abs()));
    light.fields().iter().map(|field| most(field.radiance.range())).collect()
}

/// A light's values near the medium, and how to find one there; `slots` and `first` are where those begin.
pub(super) fn light(
    field: &LitVolume,
    density: &Density,
    slots: usize,
    first: usize,
) -> (LightUniform, Pool) {
    let cells = Interpolation::Trilinear.cells().0;
    let shift = DAffine3::from_translation(DVec3::splat(cells));
    let back = DAffine3::from_translation(-DVec3::splat(density.interpolation().cells().0));
    let grid = field.radiance.grid();
    let transform = shift * *grid.grid_from_world() * *density.grid().world_from_grid() * back;
    let near = near_medium(density, &transform, grid.size());
    let pool = Pool::new(&field.radiance, Interpolation::Trilinear, |brick| near[brick]);
    let split = |v: DVec3| {
        let coarse = (v * PARTS).round() / PARTS;
        [coarse, v - coarse].map(|v| v.as_vec3())
    };
    let m = transform.matrix3;
    let columns = [m.x_axis, m.y_axis, m.z_axis].map(split);
    let [at_high, at_low] = split(transform.translation);
    let light = LightUniform {
        high: columns.map(|[high, _]| high.extend(0.0).to_array()),
        low: columns.map(|[_, low]| low.extend(0.0).to_array()),
        at_high: at_high.to_array(),
        at_low: at_low.to_array(),
        slots: slots as u32,
        first: first as u32,
        size: grid.size().map(|side| side as u32),
        channels: field.radiance.channels() as u32,
    };
    (light, pool)
}

/// Which bricks of a light's cells some brick of the medium that is not empty may look into.
fn near_medium(density: &Density, transform: &DAffine3, size: [usize; 3]) -> Vec<bool> {
    let bricks = size.map(|side| (side + 1).div_ceil(BRICK));
    let mut near = vec![false; bricks.iter().product()];
    let [across, down, _] = density.cells().bricks();
    for (index, (_, _, slices)) in density.cells().records().enumerate() {
        if slices == [0; BRICK] {
            continue;
        }
        let brick = [index % across, index / across % down, index / across / down];
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for corner in 0..8 {
            let at = |axis: usize| ((brick[axis] + (corner >> axis & 1)) * BRICK) as f64;
            let p = transform.transform_point3(DVec3::new(at(0), at(1), at(2)));
            (low, high) = (low.min(p), high.max(p));
        }
        // A cell more for what is rounded, and constant beyond the outermost centres.
        let range = |axis: usize| {
            let brick_of = |x: f64| x.clamp(1.0, size[axis] as f64) as usize / BRICK;
            brick_of(low[axis] - 1.0)..=brick_of(high[axis] + 1.0)
        };
        for k in range(2) {
            for j in range(1) {
                for i in range(0) {
                    near[(k * bricks[1] + j) * bricks[0] + i] = true;
                }
            }
        }
    }
    near
}
