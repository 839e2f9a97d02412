//! Directions spread over the sphere, and those of the pixels of a latitude-longitude picture.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// Points in equal steps of height from 1 down by `height`, turned by the golden angle from one to the next: even over the sphere
/// (2) or its upper half (1).
pub(super) fn fibonacci(count: usize, height: f64) -> Vec<DVec3> {
    let golden = PI * (3.0 - 5f64.sqrt());
    (0..count)
        .map(|k| {
            let y = 1.0 - height * (k as f64 + 0.5) / count as f64;
            let (radius, angle) = ((1.0 - y * y).sqrt(), golden * k as f64);
            DVec3::new(radius * angle.cos(), y, radius * angle.sin())
        })
        .collect()
}

/// Where a direction lies in a latitude-longitude picture: from 0 to 1 across and down.
pub(super) fn longitude_latitude(towards: DVec3) -> [f64; 2] {
    let u = (towards.x.atan2(-towards.z) / TAU + 0.5).rem_euclid(1.0);
    [u, towards.y.clamp(-1.0, 1.0).acos() / PI]
}

/// The direction of the middle of a pixel.
pub(super) fn picture_direction([width, height]: [usize; 2], pixel: usize) -> DVec3 {
    let (i, j) = (pixel % width, pixel / width);
    let theta = PI * (j as f64 + 0.5) / height as f64;
    let phi = TAU * ((i as f64 + 0.5) / width as f64 - 0.5);
    DVec3::new(theta.sin() * phi.sin(), theta.cos(), -theta.sin() * phi.cos())
}

/// The solid angle of a pixel.
pub(super) fn pixel_angle([width, height]: [usize; 2], pixel: usize) -> f64 {
    let polar = |j: usize| PI * j as f64 / height as f64;
    TAU / width as f64 * (polar(pixel / width).cos() - polar(pixel / width + 1).cos())
}

/// The nearest of points that stand by height.
pub(super) fn nearest(points: &[DVec3], towards: DVec3) -> usize {
    // Within this difference of height lies the nearest one: a cap of two shares of the sphere.
    let reach = (16.0 / points.len() as f64).sqrt().min(2.0);
    let index = |y: f64| ((1.0 - y) * points.len() as f64 / 2.0).clamp(0.0, points.len() as f64) as usize;
    let range = index(towards.y + reach)..(index(towards.y - reach) + 1).min(points.len());
    let first = range.start.min(points.len() - 1);
    range.max_by(|&a, &b| points[a].dot(towards).total_cmp(&points[b].dot(towards))).unwrap_or(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_direction_is_the_nearest() {
        for count in [1, 2, 5, 64, 500] {
            let points = fibonacci(count, 2.0);
            for towards in fibonacci(333, 2.0) {
                let all = |k: &usize| -points[*k].dot(towards);
                let best = (0..count).map(|k| -all(&k)).fold(f64::NEG_INFINITY, f64::max);
                assert!((points[nearest(&points, towards)].dot(towards) - best).abs() < 1e-12);
            }
        }
    }
}
