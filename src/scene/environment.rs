use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::DVec3;

use super::{BasisLight, Image, LightBasis, Rgb};
use crate::{Error, Result};

/// Light from all directions, infinitely far away.
#[derive(Debug, Clone, PartialEq)]
pub struct Environment {
    sky: Sky,
    /// Directions that the light of a volume is taken from.
    directions: usize,
}

#[derive(Debug, Clone, PartialEq)]
enum Sky {
    Constant(Rgb),
    Map(Image),
    Lights(Arc<LightBasis>, Vec<Rgb>),
}

impl Environment {
    /// Directions at most.
    pub const MAX_DIRECTIONS: usize = 1 << 14;

    /// The same radiance from everywhere.
    ///
    /// Errors: [`Error::Value`] for a radiance that is negative or not finite, or no directions.
    pub fn constant(radiance: Rgb, directions: usize) -> Result<Self> {
        if !is_radiance(&radiance) {
            return Err(Error::value("radiance", format!("{radiance:?}"), "finite and not negative"));
        }
        Self::of(Sky::Constant(radiance), directions)
    }

    /// A picture of all directions: longitude across, latitude down, +Y at the top and −Z in the middle.
    ///
    /// Errors: [`Error::Value`] naming a pixel that is negative or not finite, or no directions.
    pub fn map(picture: Image, directions: usize) -> Result<Self> {
        if let Some(index) = picture.pixels.iter().position(|pixel| !is_radiance(pixel)) {
            let width = picture.size()[0];
            let value =
                format!("{:?} at pixel ({}, {})", picture.pixels[index], index % width, index / width);
            return Err(Error::value("file", value, "finite and not negative radiance"));
        }
        Self::of(Sky::Map(picture), directions)
    }

    /// A combination of basis functions, one colour each.
    ///
    /// Errors: [`Error::Shape`] when there is not one colour a light, [`Error::Value`] naming a light that is negative or not finite.
    pub fn lights(basis: Arc<LightBasis>, colors: Vec<Rgb>) -> Result<Self> {
        if colors.len() != basis.len() {
            return Err(Error::Shape { what: "the lights", expected: basis.len(), got: colors.len() });
        }
        if let Some(number) = colors.iter().position(|color| !is_radiance(color)) {
            let value = format!("{:?} of light {number}", colors[number]);
            return Err(Error::value("lights", value, "finite and not negative radiance"));
        }
        // Their directions are their own.
        Self::of(Sky::Lights(basis, colors), 1)
    }

    /// The light a `share` of the way to another, light by light; this one where either is no combination of lights.
    ///
    /// Errors: [`Error::Shape`] for another number of lights.
    pub fn blended(&self, other: &Self, share: f64) -> Result<Self> {
        let (Sky::Lights(basis, mine), Sky::Lights(_, theirs)) = (&self.sky, &other.sky) else {
            return Ok(self.clone());
        };
        let lights = mine.iter().zip(theirs).map(|(mine, theirs)| super::mixed(mine, theirs, share));
        Self::lights(basis.clone(), lights.collect())
    }

    fn of(sky: Sky, directions: usize) -> Result<Self> {
        if directions == 0 || directions > Self::MAX_DIRECTIONS {
            return Err(Error::value("directions", directions, "from 1 to 16384"));
        }
        Ok(Self { sky, directions })
    }

    /// Whether it is dark.
    pub fn is_dark(&self) -> bool {
        match &self.sky {
            Sky::Constant(radiance) => *radiance == [0.0; 3],
            Sky::Map(picture) => picture.pixels.iter().all(|pixel| *pixel == [0.0; 3]),
            Sky::Lights(_, colors) => colors.iter().all(|color| *color == [0.0; 3]),
        }
    }

    /// The picture of all directions that it is, if it is one.
    pub(super) fn as_map(&self) -> Option<&Image> {
        match &self.sky {
            Sky::Map(picture) => Some(picture),
            _ => None,
        }
    }

    /// The combination of basis functions that it is, if it is one.
    pub(super) fn as_lights(&self) -> Option<(&LightBasis, &[Rgb])> {
        match &self.sky {
            Sky::Lights(basis, colors) => Some((basis, colors)),
            _ => None,
        }
    }

    /// As a latitude-longitude picture of so many columns and rows.
    pub fn picture(&self, size: [usize; 2]) -> Result<Image> {
        let radiance = |pixel: usize| self.radiance(picture_direction(size, pixel));
        Image::new(size, (0..size[0] * size[1]).map(radiance).collect())
    }

    /// Radiance that comes from a direction (of unit length, pointing there).
    pub fn radiance(&self, towards: DVec3) -> Rgb {
        match &self.sky {
            Sky::Constant(radiance) => *radiance,
            Sky::Map(picture) => {
                let [width, height] = picture.size();
                let [u, v] = longitude_latitude(towards);
                let pixel = |part: f64, side: usize| ((part * side as f64) as usize).min(side - 1);
                picture.at(pixel(u, width), pixel(v, height))
            }
            Sky::Lights(basis, colors) => basis.radiance(colors, towards),
        }
    }

    /// Directions spread evenly over the sphere, each with the radiance times solid angle that comes from its part of it:
    /// of a map the mean over the pixels that are nearest to it, of basis functions their own directions.
    pub fn beams(&self) -> Vec<(DVec3, Rgb)> {
        let points = fibonacci(self.directions, 2.0);
        let share = 4.0 * PI / self.directions as f64;
        match &self.sky {
            Sky::Constant(radiance) => {
                let light = radiance.map(|value| (f64::from(value) * share) as f32);
                points.into_iter().map(|point| (point, light)).collect()
            }
            Sky::Map(picture) => {
                let mut sums = vec![[0.0f64; 3]; points.len()];
                for (index, pixel) in picture.pixels.iter().enumerate() {
                    let angle = pixel_angle(picture.size(), index);
                    let towards = picture_direction(picture.size(), index);
                    let sum = &mut sums[nearest(&points, towards)];
                    (0..3).for_each(|c| sum[c] += angle * f64::from(pixel[c]));
                }
                points.into_iter().zip(sums.into_iter().map(|sum| sum.map(|value| value as f32))).collect()
            }
            Sky::Lights(basis, colors) => {
                let beams = |number: usize| {
                    let color = colors[number].map(f64::from);
                    basis
                        .directions(number)
                        .into_iter()
                        .map(move |(towards, angle)| (towards, color.map(|value| (value * angle) as f32)))
                };
                (0..basis.len()).flat_map(beams).collect()
            }
        }
    }

    /// The largest radiance of any channel.
    pub fn brightest(&self) -> f32 {
        let largest = |color: &Rgb| color.iter().copied().fold(0.0, f32::max);
        match &self.sky {
            Sky::Constant(radiance) => largest(radiance),
            Sky::Map(picture) => picture.pixels.iter().map(largest).fold(0.0, f32::max),
            Sky::Lights(basis, colors) => {
                let middle = |light: &BasisLight| largest(&basis.radiance(colors, light.towards));
                basis.lights().iter().map(middle).fold(0.0, f32::max)
            }
        }
    }

    /// Mean radiance over all directions.
    pub fn mean(&self) -> Rgb {
        let mut sum = [0.0f64; 3];
        for (_, light) in self.beams() {
            (0..3).for_each(|c| sum[c] += f64::from(light[c]) / (4.0 * PI));
        }
        sum.map(|value| value as f32)
    }
}

fn is_radiance(color: &Rgb) -> bool {
    color.iter().all(|&c| c.is_finite() && c >= 0.0)
}

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
fn nearest(points: &[DVec3], towards: DVec3) -> usize {
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
    fn beams_carry_all_of_the_light() -> Result<()> {
        let pixels: Vec<Rgb> =
            (0..64 * 32).map(|i| [(i % 7) as f32, 1.0, if i < 64 { 50.0 } else { 0.0 }]).collect();
        for directions in [1, 2, 16, 100] {
            let map = Environment::map(Image::new([64, 32], pixels.clone())?, directions)?;
            let constant = Environment::constant([1.0, 2.0, 0.5], directions)?;
            let total = |environment: &Environment| {
                environment.beams().iter().fold([0.0; 3], |sum: [f64; 3], (_, light)| {
                    std::array::from_fn(|c| sum[c] + f64::from(light[c]))
                })
            };
            assert!((total(&map)[1] / (4.0 * PI) - 1.0).abs() < 1e-5);
            assert!((total(&constant)[2] / (2.0 * PI) - 1.0).abs() < 1e-5);
            assert!((f64::from(constant.mean()[1]) - 2.0).abs() < 1e-5);
        }
        Ok(())
    }

    #[test]
    fn the_map_is_looked_up_where_its_pixels_are() -> Result<()> {
        let mut picture = Image::constant([8, 4], [0.0; 3]);
        picture.pixels[8 + 4] = [3.0; 3];
        let environment = Environment::map(picture, 64)?;
        // Just right of the middle, above the horizon: towards −Z, and up.
        let seen = DVec3::new(0.2, 0.4, -1.0).normalize();
        assert_eq!(environment.radiance(seen), [3.0; 3]);
        assert_eq!(environment.radiance(-seen), [0.0; 3]);
        let brightest = environment.beams().into_iter().max_by(|a, b| a.1[0].total_cmp(&b.1[0]));
        assert!(brightest.is_some_and(|(towards, _)| towards.dot(seen) > 0.8));
        Ok(())
    }

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

    #[test]
    fn impossible_environments_are_refused() {
        assert!(Environment::constant([1.0, -1.0, 0.0], 8).is_err());
        assert!(Environment::constant([1.0; 3], 0).is_err());
        assert!(Environment::map(Image::constant([2, 1], [f32::INFINITY; 3]), 8).is_err());
    }
}
