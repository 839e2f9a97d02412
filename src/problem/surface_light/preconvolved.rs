//! Light from everywhere, averaged over cones.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;
use rayon::prelude::*;

use crate::Result;
use crate::scene::{Environment, Image, Rgb, rgb};

/// Cone angles, in equal steps up to 90°.
const ANGLES: usize = 8;
/// Columns and rows of the pictures of directions.
const SIZE: [usize; 2] = [64, 32];
/// The same of the light that they are averages of, and places a side at least at which each of its pixels is looked up: no fewer than the environment has pixels.
const LIGHT: [usize; 2] = [128, 64];
const SUPERSAMPLED: usize = 4;

/// The mean radiance from each cone of directions, which count their cosine with its axis: L_c.
///
/// Law     the same light from everywhere is itself, for every angle
/// Source  Klehm 2015, eqs. 3.7 (90°) and 3.9. Departs from the paper in the normalization: 1 / sin² α instead of t = 1 / (1 − cos α), with which that light
///         would be (1 + cos α) times itself.
/// Cost    16.8 million pairs of directions, once a light
#[derive(Debug, Clone)]
pub(super) enum PreconvolvedLight {
    Constant(Rgb),
    /// A picture of directions for each angle.
    Cones(Vec<Image>),
}

impl PreconvolvedLight {
    pub(super) fn new(environment: &Environment) -> Result<Self> {
        let light = beams(environment);
        let first = light[0].radiance;
        if light.iter().all(|beam| beam.radiance == first) {
            return Ok(Self::Constant(first.map(|value| value as f32)));
        }
        let texels: Vec<[Rgb; ANGLES]> =
            (0..SIZE[0] * SIZE[1]).into_par_iter().map(|texel| cones(direction(texel), &light)).collect();
        let picture = |angle: usize| Image::new(SIZE, texels.iter().map(|texel| texel[angle]).collect());
        Ok(Self::Cones((0..ANGLES).map(picture).collect::<Result<_>>()?))
    }

    /// From a cone around a direction, of half so many radians. Cones that are narrower than the narrowest are that one.
    pub(super) fn of_cone(&self, towards: DVec3, angle: f64) -> Rgb {
        let pictures = match self {
            Self::Constant(radiance) => return *radiance,
            Self::Cones(pictures) => pictures,
        };
        let place = Place::of(towards);
        let level = (angle / FRAC_PI_2 * ANGLES as f64 - 1.0).clamp(0.0, (ANGLES - 1) as f64);
        let below = (level as usize).min(ANGLES - 2);
        let between = (level - below as f64) as f32;
        let [narrow, wide] = [below, below + 1].map(|level| place.look_up(&pictures[level]));
        rgb(|c| narrow[c] + between * (wide[c] - narrow[c]))
    }

    /// From all of the hemisphere around a direction.
    pub(super) fn of_hemisphere(&self, towards: DVec3) -> Rgb {
        self.of_cone(towards, FRAC_PI_2)
    }
}

/// Where a direction lies between four texels.
struct Place {
    /// Columns and rows of the upper two, then of the lower two.
    texels: [[[usize; 2]; 2]; 2],
    between: [f32; 2],
}

impl Place {
    /// Around the seam and over the poles.
    fn of(towards: DVec3) -> Self {
        let [width, height] = SIZE.map(|side| side as isize);
        let across = (towards.x.atan2(-towards.z) / TAU + 0.5) * width as f64 - 0.5;
        let down = towards.y.clamp(-1.0, 1.0).acos() / PI * height as f64 - 0.5;
        let (left, top) = (across.floor(), down.floor());
        // Beyond a pole lies the other side.
        let texel = |column: isize, row: isize| {
            let inside = row.clamp(0, height - 1);
            let turned = if inside == row { column } else { column + width / 2 };
            [turned.rem_euclid(width) as usize, inside as usize]
        };
        let (column, row) = (left as isize, top as isize);
        Self {
            texels: [row, row + 1].map(|row| [column, column + 1].map(|column| texel(column, row))),
            between: [(across - left) as f32, (down - top) as f32],
        }
    }

    fn look_up(&self, picture: &Image) -> Rgb {
        let [x, y] = self.between;
        let [[a, b], [c, d]] = self.texels.map(|row| row.map(|[column, row]| picture.at(column, row)));
        rgb(|i| (1.0 - y) * (a[i] + x * (b[i] - a[i])) + y * (c[i] + x * (d[i] - c[i])))
    }
}

/// The middle of a texel.
fn direction(texel: usize) -> DVec3 {
    towards(SIZE, texel % SIZE[0], texel / SIZE[0])
}

fn towards([width, height]: [usize; 2], column: usize, row: usize) -> DVec3 {
    let (sin, cos) = (PI * (row as f64 + 0.5) / height as f64).sin_cos();
    let (across, ahead) = (TAU * ((column as f64 + 0.5) / width as f64 - 0.5)).sin_cos();
    DVec3::new(sin * across, cos, -sin * ahead)
}

/// Light from one direction.
struct Beam {
    towards: DVec3,
    solid_angle: f64,
    radiance: [f64; 3],
}

/// The means of an environment over the pixels of a smaller picture.
fn beams(environment: &Environment) -> Vec<Beam> {
    let [width, height] = LIGHT;
    let places =
        environment.columns().map_or(SUPERSAMPLED, |columns| columns.div_ceil(width).max(SUPERSAMPLED));
    let fine = LIGHT.map(|side| side * places);
    let beam = |index: usize| {
        let (column, row) = (index % width, index / width);
        let mut sum = [0.0; 3];
        for place in 0..places * places {
            let (x, y) = (place % places, place / places);
            let radiance = environment.radiance(towards(fine, column * places + x, row * places + y));
            (0..3).for_each(|c| sum[c] += f64::from(radiance[c]));
        }
        let polar = |row: usize| (PI * row as f64 / height as f64).cos();
        Beam {
            towards: towards(LIGHT, column, row),
            solid_angle: TAU / width as f64 * (polar(row) - polar(row + 1)),
            radiance: sum.map(|sum| sum / (places * places) as f64),
        }
    };
    (0..width * height).into_par_iter().map(beam).collect()
}

/// The means over the cones of all angles around a direction.
fn cones(axis: DVec3, light: &[Beam]) -> [Rgb; ANGLES] {
    // Light between two cones first; what is in a cone is in all that are wider.
    let rims: [f64; ANGLES] =
        std::array::from_fn(|angle| (FRAC_PI_2 * (angle + 1) as f64 / ANGLES as f64).cos());
    let mut between = [([0.0; 3], 0.0); ANGLES];
    for beam in light {
        let cosine = beam.towards.dot(axis);
        if cosine <= 0.0 {
            continue;
        }
        let narrowest = rims.iter().position(|&rim| cosine >= rim).unwrap_or(ANGLES - 1);
        let weight = cosine * beam.solid_angle;
        let (sum, weights) = &mut between[narrowest];
        (0..3).for_each(|c| sum[c] += weight * beam.radiance[c]);
        *weights += weight;
    }
    let (mut sum, mut weights) = ([0.0; 3], 0.0);
    between.map(|(more, weight)| {
        (0..3).for_each(|c| sum[c] += more[c]);
        weights += weight;
        sum.map(|sum: f64| (sum / weights) as f32)
    })
}

#[cfg(test)]
mod tests;
