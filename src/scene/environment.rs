use std::f64::consts::PI;
use std::sync::Arc;

use glam::DVec3;

use super::directions::{fibonacci, longitude_latitude, nearest, picture_direction, pixel_angle};
use super::{BasisLight, Image, LightBasis, Rgb, mixed};
use crate::{Error, Result};

/// Light from all directions, infinitely far away.
#[derive(Debug, Clone, PartialEq)]
pub struct Environment {
    distribution: Distribution,
    /// Directions that the light of a volume is taken from.
    directions: usize,
}

#[derive(Debug, Clone, PartialEq)]
enum Distribution {
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
        Self::of(Distribution::Constant(radiance), directions)
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
        Self::of(Distribution::Map(picture), directions)
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
        Self::of(Distribution::Lights(basis, colors), 1)
    }

    /// The light a `share` of the way to another, from 0 to 1, light by light. It is this light itself where either is no
    /// combination of lights.
    ///
    /// Errors: [`Error::Shape`] for another number of lights.
    pub fn blended(&self, other: &Self, share: f64) -> Result<Self> {
        let (Distribution::Lights(basis, mine), Distribution::Lights(_, theirs)) =
            (&self.distribution, &other.distribution)
        else {
            return Ok(self.clone());
        };
        let lights = mine.iter().zip(theirs).map(|(mine, theirs)| mixed(mine, theirs, share));
        Self::lights(basis.clone(), lights.collect())
    }

    fn of(distribution: Distribution, directions: usize) -> Result<Self> {
        if directions == 0 || directions > Self::MAX_DIRECTIONS {
            return Err(Error::value("directions", directions, "from 1 to 16384"));
        }
        Ok(Self { distribution, directions })
    }

    /// Columns of the picture that it is; none where it is no picture.
    pub fn columns(&self) -> Option<usize> {
        match &self.distribution {
            Distribution::Map(picture) => Some(picture.size()[0]),
            Distribution::Constant(_) | Distribution::Lights(..) => None,
        }
    }

    /// Whether it is dark.
    pub fn is_dark(&self) -> bool {
        match &self.distribution {
            Distribution::Constant(radiance) => *radiance == [0.0; 3],
            Distribution::Map(picture) => picture.pixels.iter().all(|pixel| *pixel == [0.0; 3]),
            Distribution::Lights(_, colors) => colors.iter().all(|color| *color == [0.0; 3]),
        }
    }

    /// The coefficients of basis functions that come nearest to it: its own where it is a combination of these, else of each basis
    /// function the mean radiance under it.
    ///
    /// Shapes  returns one colour a light of the basis
    pub fn coefficients(&self, of: &LightBasis) -> Vec<Rgb> {
        if let Distribution::Lights(basis, colors) = &self.distribution
            && **basis == *of
        {
            return colors.clone();
        }
        let (mut sums, mut weights) = (vec![[0.0f64; 3]; of.len()], vec![0.0f64; of.len()]);
        if let Distribution::Map(picture) = &self.distribution {
            for (pixel, color) in picture.pixels.iter().enumerate() {
                let angle = pixel_angle(picture.size(), pixel);
                of.each_seen(picture_direction(picture.size(), pixel), |number, value| {
                    weights[number] += angle * value;
                    (0..3).for_each(|c| sums[number][c] += angle * value * f64::from(color[c]));
                });
            }
        }
        let coefficient = |(number, light): (usize, &BasisLight)| match weights[number] {
            // A light smaller than a pixel.
            0.0 => self.radiance(light.towards),
            weight => sums[number].map(|sum| (sum / weight) as f32),
        };
        of.lights().iter().enumerate().map(coefficient).collect()
    }

    /// As a latitude-longitude picture of so many columns and rows.
    ///
    /// Errors: [`Error::Shape`], as [`Image::new`].
    pub fn picture(&self, size: [usize; 2]) -> Result<Image> {
        let radiance = |pixel: usize| self.radiance(picture_direction(size, pixel));
        Image::new(size, (0..size[0] * size[1]).map(radiance).collect())
    }

    /// Radiance that comes from a direction (of unit length, pointing there). A map is bilinear between the centres of its pixels, around
    /// the seam, too, and constant beyond the first and the last row.
    pub fn radiance(&self, towards: DVec3) -> Rgb {
        match &self.distribution {
            Distribution::Constant(radiance) => *radiance,
            Distribution::Map(picture) => {
                let [u, v] = longitude_latitude(towards);
                between(picture, u, v)
            }
            Distribution::Lights(basis, colors) => basis.radiance(colors, towards),
        }
    }

    /// Directions spread over the sphere, each with the radiance times steradians that comes from its part of the sphere. Of a map
    /// that is the sum over the pixels nearest to the direction. Of basis functions the directions are their own.
    pub fn beams(&self) -> Vec<(DVec3, Rgb)> {
        let points = fibonacci(self.directions, 2.0);
        let share = 4.0 * PI / self.directions as f64;
        match &self.distribution {
            Distribution::Constant(radiance) => {
                let light = radiance.map(|value| (f64::from(value) * share) as f32);
                points.into_iter().map(|point| (point, light)).collect()
            }
            Distribution::Map(picture) => {
                let mut sums = vec![[0.0f64; 3]; points.len()];
                for (index, pixel) in picture.pixels.iter().enumerate() {
                    let angle = pixel_angle(picture.size(), index);
                    let towards = picture_direction(picture.size(), index);
                    let sum = &mut sums[nearest(&points, towards)];
                    (0..3).for_each(|c| sum[c] += angle * f64::from(pixel[c]));
                }
                points.into_iter().zip(sums.into_iter().map(|sum| sum.map(|value| value as f32))).collect()
            }
            Distribution::Lights(basis, colors) => {
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
        match &self.distribution {
            Distribution::Constant(radiance) => largest(radiance),
            Distribution::Map(picture) => picture.pixels.iter().map(largest).fold(0.0, f32::max),
            Distribution::Lights(basis, colors) => {
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

/// A picture that goes around from left to right, at a place from 0 to 1 across and down.
fn between(picture: &Image, u: f64, v: f64) -> Rgb {
    let [width, height] = picture.size();
    let (x, y) = (u * width as f64 - 0.5, v * height as f64 - 0.5);
    let columns = [0, 1].map(|next| (x.floor() as i64 + next).rem_euclid(width as i64) as usize);
    let rows = [0, 1].map(|next| (y.floor() as i64 + next).clamp(0, height as i64 - 1) as usize);
    let [above, below] = rows.map(|row| {
        let [left, right] = columns.map(|column| picture.at(column, row));
        mixed(&left, &right, x - x.floor())
    });
    mixed(&above, &below, y - y.floor())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Over;

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
    fn the_map_is_looked_up_where_its_pixels_are_and_bilinear_between_them() -> Result<()> {
        let mut picture = Image::constant([8, 4], [0.0; 3]);
        picture.pixels[8 + 4] = [3.0; 3];
        let environment = Environment::map(picture, 64)?;
        // Just right of the middle, above the horizon: towards −Z, and up.
        let seen = DVec3::new(0.2, 0.4, -1.0).normalize();
        assert!(environment.radiance(seen)[1] > 1.5);
        let brightest = environment.beams().into_iter().max_by(|a, b| a.1[0].total_cmp(&b.1[0]));
        assert!(brightest.is_some_and(|(towards, _)| towards.dot(seen) > 0.8));
        assert_eq!(environment.radiance(-seen), [0.0; 3]);
        let near = |got: Rgb, expected: f32| assert!((got[2] - expected).abs() < 1e-6, "{got:?} {expected}");
        near(environment.radiance(picture_direction([8, 4], 12)), 3.0);
        // In a picture of twice as many pixels each lies a quarter of a pixel beside the one that it is a part of.
        for (pixel, share) in
            [(2 * 16 + 8, 0.75 * 0.75), (2 * 16 + 10, 0.25 * 0.75), (4 * 16 + 9, 0.25 * 0.75)]
        {
            near(environment.radiance(picture_direction([16, 8], pixel)), 3.0 * share);
        }
        // Around the seam, and beyond the last row.
        let mut picture = Image::constant([8, 4], [0.0; 3]);
        picture.pixels[3 * 8 + 7] = [2.0; 3];
        let environment = Environment::map(picture, 64)?;
        near(environment.radiance(picture_direction([16, 8], 7 * 16)), 0.25 * 2.0);
        near(environment.radiance(picture_direction([16, 8], 7 * 16 + 15)), 0.75 * 2.0);
        near(Environment::map(Image::constant([1, 1], [4.0; 3]), 64)?.radiance(seen), 4.0);
        Ok(())
    }

    #[test]
    fn coefficients_of_a_constant_light_are_its_radiance_and_of_a_map_its_own() -> Result<()> {
        let basis = LightBasis::discs(30, Over::Sphere, 0.7, 1)?;
        let constant = Environment::constant([1.0, 2.0, 3.0], 8)?;
        assert_eq!(constant.coefficients(&basis), vec![[1.0, 2.0, 3.0]; 30]);
        let pixels: Vec<Rgb> = (0..16 * 8).map(|i| [i as f32, 1.0, 0.5]).collect();
        let map = Environment::map(Image::new([16, 8], pixels.clone())?, 8)?;
        assert_eq!(map.coefficients(&LightBasis::map([16, 8], Over::Sphere)?), pixels);
        let means = map.coefficients(&basis);
        assert!(means.iter().all(|color| (color[1] - 1.0).abs() < 1e-5 && color[0] > 0.0));
        Ok(())
    }

    #[test]
    fn impossible_environments_are_refused() {
        assert!(Environment::constant([1.0, -1.0, 0.0], 8).is_err());
        assert!(Environment::constant([1.0; 3], 0).is_err());
        assert!(Environment::map(Image::constant([2, 1], [f32::INFINITY; 3]), 8).is_err());
    }
}
