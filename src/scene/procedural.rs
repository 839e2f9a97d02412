use glam::DVec3;
use rayon::prelude::*;

use super::{Samples, Volume, VoxelGrid};
use crate::Result;

/// A shape with a soft rim.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Blob {
    /// All points within a radius of a centre.
    Sphere {
        /// In metres.
        center: DVec3,
        /// In metres.
        radius: f64,
    },
    /// All points within a radius of a segment; the radius changes evenly from one end to the other.
    Capsule {
        /// Where it begins, in metres.
        from: DVec3,
        /// Where it ends, in metres.
        to: DVec3,
        /// At both ends, in metres.
        radii: [f64; 2],
    },
}

impl Blob {
    /// Distance from the surface, negative inside; for a capsule whose radii differ near enough.
    fn distance(&self, p: DVec3) -> f64 {
        match *self {
            Self::Sphere { center, radius } => (p - center).length() - radius,
            Self::Capsule { from, to, radii } => {
                let along = to - from;
                let u =
                    ((p - from).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
                (p - from - along * u).length() - (radii[0] + u * (radii[1] - radii[0]))
            }
        }
    }
}

/// Smoke-like noise: octaves of gradient noise, each of twice the frequency of the one before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Size of the largest waves, in metres.
    pub scale: f64,
    /// How many.
    pub octaves: u32,
    /// Weight of each octave relative to the one before, from 0 to 1.
    pub gain: f64,
    /// How far it moves the rim of the shapes, in metres.
    pub depth: f64,
    /// What it takes from the density inside, from 0 to 1.
    pub mottle: f64,
    /// Other numbers give other noise.
    pub seed: u32,
}

/// A volume made of shapes: `outside` where none is, `inside` where one is, and smooth between.
#[derive(Debug, Clone, PartialEq)]
pub struct Procedural {
    /// The shapes; a point is inside where it is inside any of them.
    pub blobs: Vec<Blob>,
    /// Value inside, in the unit of the volume.
    pub inside: f64,
    /// Value outside, in the unit of the volume.
    pub outside: f64,
    /// Over how many metres the one becomes the other.
    pub edge: f64,
    /// What disturbs it.
    pub noise: Option<Noise>,
}

impl Procedural {
    /// The values at the centres of a grid.
    ///
    /// Errors: [`crate::Error::NonFinite`] where a value is beyond f32.
    pub fn volume(&self, grid: VoxelGrid) -> Result<Volume> {
        let values = (0..grid.len())
            .into_par_iter()
            .map(|index| self.at(grid.centre(grid.voxel(index))) as f32)
            .collect();
        Volume::new(grid, 1, Samples::F32(values))
    }

    /// The value at a point.
    pub fn at(&self, p: DVec3) -> f64 {
        let nearest = self.blobs.iter().map(|blob| blob.distance(p)).fold(f64::INFINITY, f64::min);
        let (mut distance, mut inside) = (nearest, self.inside);
        if let Some(noise) = &self.noise {
            // Far outside nothing of the noise is seen, and it is most of the work.
            if nearest < self.edge + noise.depth {
                let wave = noise.at(p);
                distance += noise.depth * wave;
                inside = self.outside + (inside - self.outside) * (1.0 - noise.mottle * (0.5 + 0.5 * wave));
            }
        }
        let u = (0.5 - distance / self.edge).clamp(0.0, 1.0);
        self.outside + (inside - self.outside) * u * u * (3.0 - 2.0 * u)
    }
}

impl Noise {
    /// From −1 to 1.
    fn at(&self, p: DVec3) -> f64 {
        let (mut sum, mut most, mut weight, mut frequency) = (0.0, 0.0, 1.0, self.scale.recip());
        for octave in 0..self.octaves {
            sum += weight * gradient_noise(p * frequency, self.seed.wrapping_add(octave));
            most += weight;
            weight *= self.gain;
            frequency *= 2.0;
        }
        (sum / f64::max(most, f64::MIN_POSITIVE)).clamp(-1.0, 1.0)
    }
}

/// The same noise, which is repeated after so many cells along each axis.
pub(crate) fn tileable_noise(p: DVec3, period: u32, seed: u32) -> f64 {
    let period = f64::from(period);
    noise_of(p, seed, |cell| cell - period * (cell / period).floor())
}

/// Perlin's gradient noise (2002, *Improving Noise*), from about −1 to 1, with hashed gradients.
fn gradient_noise(p: DVec3, seed: u32) -> f64 {
    noise_of(p, seed, |cell| cell)
}

/// The noise whose gradients are those of the lattice points that `wrapped` takes others to.
fn noise_of(p: DVec3, seed: u32, wrapped: impl Fn(DVec3) -> DVec3) -> f64 {
    let cell = p.floor();
    let f = p - cell;
    let fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let mut sum = 0.0;
    for corner in 0..8 {
        let offset = DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2));
        let g = gradient(wrapped(cell + offset), seed);
        let side = |axis: usize| if offset[axis] == 1.0 { fade[axis] } else { 1.0 - fade[axis] };
        sum += side(0) * side(1) * side(2) * g.dot(f - offset);
    }
    sum
}

/// A number of a lattice point that looks like chance.
pub(super) fn lattice_hash(point: &[f64], seed: u32) -> u32 {
    let mut hash = seed.wrapping_mul(0x9e37_79b9) ^ 0x85eb_ca6b;
    for &coordinate in point {
        // Lattice points are whole; of huge ones the low bits are enough.
        hash ^= coordinate as i64 as u32;
        hash = hash.wrapping_mul(0xcc9e_2d51);
        hash ^= hash >> 15;
    }
    hash = hash.wrapping_mul(0x1b87_3593);
    hash ^ hash >> 13
}

/// One of twelve directions towards the edges of a cube, by a hash of the lattice point.
fn gradient(point: DVec3, seed: u32) -> DVec3 {
    let hash = lattice_hash(&point.to_array(), seed);
    let sign = |bit: u32| if hash >> bit & 1 == 0 { 1.0 } else { -1.0 };
    match (hash >> 8) % 3 {
        0 => DVec3::new(sign(0), sign(1), 0.0),
        1 => DVec3::new(sign(0), 0.0, sign(1)),
        _ => DVec3::new(0.0, sign(0), sign(1)),
    }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;

    fn ball(noise: Option<Noise>) -> Procedural {
        let blobs = vec![
            Blob::Sphere { center: DVec3::ZERO, radius: 1.0 },
            Blob::Capsule { from: DVec3::ZERO, to: DVec3::new(3.0, 0.0, 0.0), radii: [0.5, 0.25] },
        ];
        Procedural { blobs, inside: 4.0, outside: 1.0, edge: 0.2, noise }
    }

    #[test]
    fn shapes_are_where_they_are_said_to_be() {
        let shape = ball(None);
        for (point, value) in [
            (DVec3::ZERO, 4.0),
            (DVec3::new(0.0, 1.0, 0.0), 2.5),
            (DVec3::new(0.0, 1.2, 0.0), 1.0),
            (DVec3::new(3.0, 0.1, 0.0), 4.0),
            (DVec3::new(3.0, 0.25, 0.0), 2.5),
        ] {
            assert!((shape.at(point) - value).abs() < 1e-12, "{point}: {}", shape.at(point));
        }
    }

    #[test]
    fn noise_is_smooth_reproducible_and_depends_on_its_seed() -> Result<()> {
        let noise = Noise { scale: 0.3, octaves: 4, gain: 0.5, depth: 0.2, mottle: 0.5, seed: 3 };
        let p = DVec3::new(0.31, -0.77, 0.52);
        assert_eq!(noise.at(p), noise.at(p));
        assert!((noise.at(p) - noise.at(p + 1e-6)).abs() < 1e-3);
        assert!(noise.at(p) != Noise { seed: 4, ..noise }.at(p));
        let grid = VoxelGrid::over_cube([16; 3], DAffine3::from_scale(DVec3::splat(2.0)))?;
        let [low, high] = ball(Some(noise)).volume(grid)?.range();
        assert!(low >= 1.0 && high <= 4.0 && high > 2.0);
        Ok(())
    }
}
