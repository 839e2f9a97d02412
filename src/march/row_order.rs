//! Orders of rows in which neighbours meet the same elements: what is kept of them, or walked, then lies together.

use rayon::prelude::*;

use super::view_ray::ViewRay;

/// Rays by their direction over the plane of the light, eye by eye: those that lie in one plane with the light meet the same texels.
pub(super) fn by_direction(rays: &[ViewRay]) -> Vec<u32> {
    let key = |&row: &u32| {
        let ray = &rays[row as usize];
        (ray.origin, ray.direction.y.atan2(ray.direction.x))
    };
    let mut rows: Vec<u32> = (0..rays.len() as u32).collect();
    rows.par_sort_by_cached_key(|row| {
        let (eye, angle) = key(row);
        (eye.to_array().map(ordered), ordered(angle))
    });
    rows
}

/// Pixels `[view, pixel]` in nests of 2 × 2, in nests of 4 × 4 and so on: rays through neighbours meet the same voxels. `width` is that
/// of a view in pixels.
pub(super) fn by_nests(pixels: &[[u32; 2]], width: impl Fn(u32) -> u32 + Sync) -> Vec<u32> {
    let mut rows: Vec<u32> = (0..pixels.len() as u32).collect();
    rows.par_sort_by_cached_key(|&row| {
        let [view, pixel] = pixels[row as usize];
        let width = width(view);
        (view, spread(pixel % width) | spread(pixel / width) << 1)
    });
    rows
}

/// Integers in the order of the numbers.
fn ordered(x: f64) -> i64 {
    let bits = x.to_bits() as i64;
    if bits < 0 { bits ^ i64::MAX } else { bits }
}

/// The bits of a number with room for another's between them.
fn spread(x: u32) -> u64 {
    (0..32).fold(0, |bits, bit| bits | u64::from(x >> bit & 1) << (2 * bit))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn ray(eye: f64, angle: f64) -> ViewRay {
        let direction = DVec3::new(angle.cos(), angle.sin(), 0.3).normalize();
        ViewRay { origin: DVec3::new(eye, 0.0, -eye), direction, length: 1.0, scattering: [1.0; 3] }
    }

    #[test]
    fn rays_of_one_eye_stand_together_by_their_direction() {
        let rays = [ray(1.0, 0.2), ray(-2.0, 3.0), ray(1.0, -0.4), ray(-2.0, -3.0), ray(1.0, 0.1)];
        assert_eq!(by_direction(&rays), [3, 1, 2, 4, 0]);
    }

    #[test]
    fn pixels_stand_in_nests_within_their_view() {
        let pixels: Vec<[u32; 2]> = (0..2).flat_map(|view| (0..16).map(move |pixel| [view, pixel])).collect();
        let order = by_nests(&pixels, |_| 4);
        assert_eq!(order[..8], [0, 1, 4, 5, 2, 3, 6, 7]);
        assert_eq!(order[8..12], [8, 9, 12, 13]);
        assert!(order[..16].iter().all(|&row| row < 16) && order[16] == 16);
    }

    #[test]
    fn integers_are_in_the_order_of_their_numbers() {
        let numbers = [f64::NEG_INFINITY, -3.0, -1e-300, -0.0, 0.0, 1e-300, 2.0, f64::INFINITY];
        assert!(numbers.windows(2).all(|pair| ordered(pair[0]) < ordered(pair[1])));
    }
}
