//! A cube of noise with its levels of detail.

use glam::DVec3;
use rayon::prelude::*;

use super::cells::Planes;
use crate::scene::{AirNoise, Ray, tileable_noise};

/// Standard deviation of the finest level, where none of its values is cut off.
const DEVIATION: f64 = 0.5;

/// Tileable Perlin noise, about 1 on the mean and from 0 to 2, with mip levels down to one voxel, which is that mean.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseVolume {
    /// From the finest on; each has half the voxels a side of the one before.
    levels: Vec<Level>,
    /// The side of a voxel of the finest level, in metres.
    voxel: f64,
    /// Where the corner of the cube is.
    offset: DVec3,
}

#[derive(Debug, Clone, PartialEq)]
struct Level {
    /// A power of two.
    side: usize,
    values: Vec<f32>,
}

impl NoiseVolume {
    /// Of a cube with sides of so many metres. Its octaves are P(2ⁱ q), weighed with powers of the persistence; their sum is shifted and
    /// scaled to mean 1 and deviation ½, and cut off at 0 and 2.
    pub fn new(noise: &AirNoise, size: f64) -> Self {
        let side = noise.voxels;
        let cells_a_voxel = f64::from(noise.cells) / side as f64;
        let sum = |index: usize| {
            let voxel = [index % side, index / side % side, index / side / side];
            let place = DVec3::from_array(voxel.map(|i| (i as f64 + 0.5) * cells_a_voxel));
            let octave = |i: u32| {
                let (frequency, seed) = (1 << i, noise.seed.wrapping_add(i));
                let value = tileable_noise(place * f64::from(frequency), noise.cells * frequency, seed);
                noise.persistence.powi(i as i32) * value
            };
            (0..noise.octaves).map(octave).sum::<f64>()
        };
        let sums: Vec<f64> = (0..side * side * side).into_par_iter().map(sum).collect();
        let count = sums.len() as f64;
        // In order, so that they are the same for any number of threads.
        let mean = sums.iter().sum::<f64>() / count;
        let deviation = (sums.iter().map(|sum| (sum - mean).powi(2)).sum::<f64>() / count).sqrt();
        let gain = DEVIATION / deviation.max(f64::MIN_POSITIVE);
        let cut: Vec<f64> = sums.iter().map(|sum| (1.0 + gain * (sum - mean)).clamp(0.0, 2.0)).collect();
        let left = count / cut.iter().sum::<f64>();
        let values = cut.iter().map(|value| (value * left) as f32).collect();
        let mut levels = vec![Level { side, values }];
        while let Some(coarser) = levels.last().and_then(Level::halved) {
            levels.push(coarser);
        }
        Self { levels, voxel: size / side as f64, offset: noise.offset }
    }

    /// The number of the coarsest level.
    pub fn last_level(&self) -> usize {
        self.levels.len() - 1
    }

    /// The side of a voxel of a level, in metres.
    pub(super) fn voxel(&self, level: usize) -> f64 {
        self.voxel * (1 << level) as f64
    }

    /// N(x, f): trilinear in both levels around f, and linear between them.
    pub fn at(&self, point: DVec3, level: f64) -> f64 {
        let finer = (level as usize).min(self.last_level());
        let between = level - finer as f64;
        let value = self.in_level(finer, point);
        if between <= 0.0 || finer == self.last_level() {
            return f64::from(value);
        }
        f64::from(value) + between * f64::from(self.in_level(finer + 1, point) - value)
    }

    fn in_level(&self, level: usize, point: DVec3) -> f32 {
        let Level { side, values } = &self.levels[level];
        let place = (point - self.offset) / self.voxel(level) - 0.5;
        let corner = place.floor();
        let [x, y, z] = (place - corner).as_vec3().to_array();
        let around = |axis: usize| {
            let first = corner[axis].rem_euclid(*side as f64) as usize & (side - 1);
            [first, (first + 1) & (side - 1)]
        };
        let [i, j, k] = [around(0), around(1), around(2)];
        let mix = |a: f32, b: f32, share: f32| a + share * (b - a);
        let line = |j: usize, k: usize| {
            let row = (k * side + j) * side;
            mix(values[row + i[0]], values[row + i[1]], x)
        };
        let plane = |k: usize| mix(line(j[0], k), line(j[1], k), y);
        mix(plane(k[0]), plane(k[1]), z)
    }

    /// The planes between which a level is smooth, along a ray.
    pub(super) fn planes(&self, level: usize, ray: &Ray) -> Planes {
        let voxel = self.voxel(level);
        Planes::new((ray.origin - self.offset) / voxel - 0.5, ray.direction / voxel, None)
    }

    /// Bytes of its values.
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(|level| size_of_val(&level.values[..])).sum()
    }
}

impl Level {
    /// The means of 2 × 2 × 2 voxels; none of one voxel.
    fn halved(&self) -> Option<Self> {
        let side = self.side / 2;
        if side == 0 {
            return None;
        }
        let mean = |index: usize| {
            let [i, j, k] = [index % side, index / side % side, index / side / side].map(|at| 2 * at);
            let of = |corner: usize| {
                let [i, j, k] = [i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2)];
                f64::from(self.values[(k * self.side + j) * self.side + i])
            };
            ((0..8).map(of).sum::<f64>() / 8.0) as f32
        };
        Some(Self { side, values: (0..side * side * side).map(mean).collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise() -> AirNoise {
        AirNoise {
            size: None,
            cells: 4,
            octaves: 3,
            persistence: 0.5,
            seed: 5,
            voxels: 32,
            offset: DVec3::new(0.1, 0.2, -0.3),
        }
    }

    #[test]
    fn noise_is_one_on_the_mean_at_every_level_and_repeats() {
        let volume = NoiseVolume::new(&noise(), 8.0);
        assert_eq!(volume.last_level(), 5);
        for level in &volume.levels {
            let values = level.values.iter().map(|value| f64::from(*value));
            let mean = values.clone().sum::<f64>() / level.values.len() as f64;
            assert!((mean - 1.0).abs() < 1e-6, "{mean} in {}", level.side);
            assert!(values.clone().fold(2.2, f64::min) >= 0.0 && values.fold(0.0, f64::max) < 2.2);
        }
        let point = DVec3::new(1.3, -4.7, 2.9);
        for level in [0.0, 0.7, 3.0, 5.0] {
            let moved = point + DVec3::new(8.0, -16.0, 24.0);
            assert!((volume.at(point, level) - volume.at(moved, level)).abs() < 1e-5);
        }
        assert!((volume.at(point, 5.0) - 1.0).abs() < 1e-6);
    }

    /// Nothing of the lookup is used, but values at the middles of voxels.
    #[test]
    fn values_are_those_of_the_noise_at_the_middles_of_voxels_and_linear_between() {
        let (noise, size) = (noise(), 8.0);
        let volume = NoiseVolume::new(&noise, size);
        let voxel = size / 32.0;
        let middle = |i: f64, j: f64, k: f64| noise.offset + voxel * (DVec3::new(i, j, k) + 0.5);
        // The sum of octaves, by hand, is the same up to one shift and one scale.
        let sum = |i: f64, j: f64, k: f64| {
            let q = (DVec3::new(i, j, k) + 0.5) / 8.0;
            tileable_noise(q, 4, 5)
                + 0.5 * tileable_noise(2.0 * q, 8, 6)
                + 0.25 * tileable_noise(4.0 * q, 16, 7)
        };
        let places = [(3.0, 4.0, 5.0), (10.0, 20.0, 30.0), (31.0, 0.0, 17.0)];
        let found = places.map(|(i, j, k)| volume.at(middle(i, j, k), 0.0));
        let by_hand = places.map(|(i, j, k)| sum(i, j, k));
        let ratio = (found[1] - found[0]) / (by_hand[1] - by_hand[0]);
        assert!((found[2] - found[0] - ratio * (by_hand[2] - by_hand[0])).abs() < 1e-5);
        // From the last voxel on to the first one, and half-way to the next level.
        let ends = [volume.at(middle(31.0, 2.0, 2.0), 0.0), volume.at(middle(0.0, 2.0, 2.0), 0.0)];
        assert!((volume.at(middle(31.25, 2.0, 2.0), 0.0) - (0.75 * ends[0] + 0.25 * ends[1])).abs() < 1e-5);
        let corners: f64 = (0..8)
            .map(|c| {
                volume.at(
                    middle(6.0 + f64::from(c & 1), 8.0 + f64::from(c >> 1 & 1), 2.0 + f64::from(c >> 2)),
                    0.0,
                )
            })
            .sum();
        let coarse = volume.at(middle(6.5, 8.5, 2.5), 1.0);
        assert!((coarse - corners / 8.0).abs() < 1e-5);
        let half = 0.5 * (volume.at(middle(6.5, 8.5, 2.5), 0.0) + coarse);
        assert!((volume.at(middle(6.5, 8.5, 2.5), 0.5) - half).abs() < 1e-6);
    }
}
