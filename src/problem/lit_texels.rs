//! Texels through which light comes that some view sees.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::Maps;
use super::sight::Sight;
use crate::scene::Scene;

/// How many texels beyond those that rays meet are looked at, one after the other: rays are some pixels apart.
const AROUND: usize = 6;

/// The numbers of the texels of a light map that let light through which some view sees, in increasing order.
///
/// A texel is met by a sampled ray, or it lies near one that is, and at that depth no shadow is in between.
///
/// Cost: half a texel after the other along one ray in 64.
pub(super) fn lit_texels(scene: &Scene, maps: &Maps) -> Arc<[u32]> {
    let grid = &maps.light_map;
    let [width, height] = grid.size;
    let sight = Sight::of_views(scene, &maps.geometry);
    let keys: Vec<AtomicU32> = (0..grid.len()).map(|_| AtomicU32::new(key(f32::INFINITY))).collect();
    sight.stretches().par_iter().for_each(|stretch| mark(maps, *stretch, &keys));
    let mut depths: Vec<f32> = keys.into_iter().map(|key| depth_of(key.into_inner())).collect();
    for _ in 0..AROUND {
        let before = depths.clone();
        depths.par_chunks_mut(width).enumerate().for_each(|(j, row)| {
            for (i, depth) in row.iter_mut().enumerate().filter(|(_, depth)| depth.is_infinite()) {
                let beside = [(i.wrapping_sub(1), j), (i + 1, j), (i, j.wrapping_sub(1)), (i, j + 1)];
                let beside = beside.into_iter().filter(|&(i, j)| i < width && j < height);
                let least = beside.map(|(i, j)| before[j * width + i]).fold(f32::INFINITY, f32::min);
                let point = grid.centre(i, j).extend(f64::from(least));
                if least.is_finite() && maps.shadow_map.is_lit(point) {
                    *depth = least;
                }
            }
        });
    }
    (0..).zip(&depths).filter(|(_, depth)| depth.is_finite()).map(|(texel, _)| texel).collect()
}

/// Marks the texels over lit points of a stretch with the least depth of such a point along the light.
fn mark(maps: &Maps, stretch: [DVec3; 2], keys: &[AtomicU32]) {
    let grid = &maps.light_map;
    let [from, to] = stretch.map(|point| maps.frame.light_from_world(point));
    let size = DVec2::new(grid.size[0] as f64, grid.size[1] as f64);
    let texels = (to - from).truncate().abs() * grid.density();
    let steps = (2.0 * texels.max_element()).ceil().clamp(1.0, 4.0 * size.max_element()) as usize;
    for step in 0..steps {
        let point = from.lerp(to, (step as f64 + 0.5) / steps as f64);
        let at = grid.grid_from_light(point.truncate());
        if at.cmpge(DVec2::ZERO).all() && at.cmplt(size).all() && maps.shadow_map.is_lit(point) {
            keys[at.y as usize * grid.size[0] + at.x as usize]
                .fetch_min(key(point.z as f32), Ordering::Relaxed);
        }
    }
}

/// A number that orders as a depth does, so that threads can find the least together.
fn key(depth: f32) -> u32 {
    let bits = depth.to_bits();
    if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
}

fn depth_of(key: u32) -> f32 {
    f32::from_bits(if key >> 31 == 1 { key & !(1 << 31) } else { !key })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_order_as_depths_do_and_come_back() {
        let depths = [f32::NEG_INFINITY, -1e30, -2.0, -1e-30, 0.0, 1e-30, 3.0, 1e30, f32::INFINITY];
        assert!(depths.windows(2).all(|pair| key(pair[0]) < key(pair[1])));
        assert!(depths.iter().all(|&depth| depth_of(key(depth)) == depth));
    }
}
