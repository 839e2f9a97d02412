use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};

use super::Rgb;
use super::directions::{fibonacci, longitude_latitude, picture_direction, pixel_angle};
use crate::{Error, Result};

/// Basis functions of light from everywhere, infinitely far away: what an environment light is a combination of
/// (Klehm 2015, sec. 7.3.4).
#[derive(Debug, Clone, PartialEq)]
pub struct LightBasis {
    shape: LightShape,
    lights: Vec<BasisLight>,
}

/// One basis function.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BasisLight {
    /// Towards the middle of it; of unit length.
    pub towards: DVec3,
    /// ∫ B dω in steradians: it gives as much light as constant radiance from a part of the sphere of this size.
    pub solid_angle: f64,
}

/// Where the basis functions lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Over {
    /// Everywhere.
    Sphere,
    /// Around a direction: the middles of lights are in the half that it points to.
    Hemisphere(DVec3),
}

#[derive(Debug, Clone, PartialEq)]
enum LightShape {
    /// 1 up to the first value of 1 − cos θ from the middle, 0 beyond the second, a cubic between.
    Discs { fall: [f64; 2], samples: usize },
    /// Pixels of a latitude-longitude picture, and the light of each (none: `u32::MAX`).
    Map { size: [usize; 2], numbers: Vec<u32> },
}

impl LightBasis {
    /// Lights at most.
    pub const MOST: usize = 4096;

    /// Discs spread evenly, of one solid angle each: the sphere's or the hemisphere's, divided by their number.
    ///
    /// B falls from 1 to 0 as a smooth cubic in 1 − cos θ, over the share `softness` of the disc to both sides of its rim: the
    /// solid angle is the same for every softness. Light of a disc is taken from `samples` directions in it.
    ///
    /// Errors: [`Error::Value`] naming `count`, `softness` or `samples`.
    pub fn discs(count: usize, over: Over, softness: f64, samples: usize) -> Result<Self> {
        if count == 0 || count > Self::MOST {
            return Err(Error::value("count", count, "from 1 to 4096 lights"));
        }
        if !(0.0..=1.0).contains(&softness) {
            return Err(Error::value("softness", softness, "from 0 (hard) to 1"));
        }
        if samples == 0 || samples > 64 {
            return Err(Error::value("samples", samples, "from 1 to 64 directions a light"));
        }
        let (whole, middles) = match over {
            Over::Sphere => (4.0 * PI, fibonacci(count, 2.0)),
            Over::Hemisphere(up) => {
                let turn = DQuat::from_rotation_arc(DVec3::Y, up);
                (TAU, fibonacci(count, 1.0).into_iter().map(|point| turn * point).collect())
            }
        };
        let solid_angle = whole / count as f64;
        let rim = solid_angle / TAU;
        let soft = (softness * rim).min(2.0 - rim);
        let light = |towards| BasisLight { towards, solid_angle };
        Ok(Self {
            shape: LightShape::Discs { fall: [rim - soft, rim + soft], samples },
            lights: middles.into_iter().map(light).collect(),
        })
    }

    /// The pixels of a latitude-longitude picture of so many columns and rows; of a hemisphere those whose middle is in it.
    ///
    /// Errors: [`Error::Value`] naming `map`.
    pub fn map([width, height]: [usize; 2], over: Over) -> Result<Self> {
        let count = width.saturating_mul(height);
        if count == 0 || count > Self::MOST {
            return Err(Error::value("map", format!("{width} x {height}"), "from 1 to 4096 pixels"));
        }
        let (mut numbers, mut lights) = (vec![u32::MAX; count], Vec::new());
        for (pixel, number) in numbers.iter_mut().enumerate() {
            let towards = picture_direction([width, height], pixel);
            let is_inside = match over {
                Over::Sphere => true,
                Over::Hemisphere(up) => towards.dot(up) > 0.0,
            };
            if is_inside {
                *number = lights.len() as u32;
                lights.push(BasisLight { towards, solid_angle: pixel_angle([width, height], pixel) });
            }
        }
        if lights.is_empty() {
            return Err(Error::value("map", format!("{width} x {height}"), "of pixels in the hemisphere"));
        }
        Ok(Self { shape: LightShape::Map { size: [width, height], numbers }, lights })
    }

    /// The basis functions.
    pub fn lights(&self) -> &[BasisLight] {
        &self.lights
    }

    /// The number of basis functions.
    pub fn len(&self) -> usize {
        self.lights.len()
    }

    /// Never: there is at least one light.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Whether they are pixels of a map, which have neighbours; discs have none.
    pub fn is_map(&self) -> bool {
        matches!(self.shape, LightShape::Map { .. })
    }

    /// The most directions that the light of one of them is taken from.
    pub fn samples(&self) -> usize {
        match self.shape {
            LightShape::Discs { samples, .. } => samples,
            LightShape::Map { .. } => 1,
        }
    }

    /// Columns and rows of the lattice that the lights lie in: the pixels of a map, or rows of eight discs.
    pub fn lattice(&self) -> [usize; 2] {
        match self.shape {
            LightShape::Discs { .. } => [8, self.lights.len().div_ceil(8)],
            LightShape::Map { size, .. } => size,
        }
    }

    /// Where each light lies in the lattice.
    pub fn places(&self) -> Vec<u32> {
        match &self.shape {
            LightShape::Discs { .. } => (0..self.lights.len() as u32).collect(),
            LightShape::Map { numbers, .. } => {
                (0..numbers.len() as u32).filter(|&pixel| numbers[pixel as usize] != u32::MAX).collect()
            }
        }
    }

    /// The lights that lie side by side: pixels of a map that share a side, all around it, and discs whose middles are no farther apart than one
    /// and a half times the side of a square of their solid angle, which are the six around each as a rule.
    pub fn pairs(&self) -> Vec<[u32; 2]> {
        let mut pairs = Vec::new();
        match &self.shape {
            LightShape::Discs { .. } => {
                let near = (1.5 * self.lights[0].solid_angle.sqrt()).cos();
                for (b, light) in self.lights.iter().enumerate() {
                    let is_near = |&a: &usize| self.lights[a].towards.dot(light.towards) >= near;
                    pairs.extend((0..b).filter(is_near).map(|a| [a as u32, b as u32]));
                }
            }
            LightShape::Map { size: [width, height], numbers } => {
                for (x, y) in (0..*height).flat_map(|y| (0..*width).map(move |x| (x, y))) {
                    let here = numbers[y * width + x];
                    let right = (*width > 2 || x + 1 < *width).then(|| numbers[y * width + (x + 1) % width]);
                    let below = (y + 1 < *height).then(|| numbers[(y + 1) * width + x]);
                    let others = right.into_iter().chain(below);
                    let both = others.filter(|&there| here != u32::MAX && there != u32::MAX && there != here);
                    pairs.extend(both.map(|there| [here, there]));
                }
            }
        }
        pairs
    }

    /// Visits the lights that are seen in a direction, and B of each there.
    pub fn each_seen(&self, towards: DVec3, mut visit: impl FnMut(usize, f64)) {
        match &self.shape {
            LightShape::Discs { fall, .. } => {
                for (number, light) in self.lights.iter().enumerate() {
                    let value = falloff(*fall, 1.0 - light.towards.dot(towards));
                    if value > 0.0 {
                        visit(number, value);
                    }
                }
            }
            LightShape::Map { size: [width, height], numbers } => {
                let [u, v] = longitude_latitude(towards);
                let pixel = |part: f64, side: usize| ((part * side as f64) as usize).min(side - 1);
                let number = numbers[pixel(v, *height) * width + pixel(u, *width)];
                if number != u32::MAX {
                    visit(number as usize, 1.0);
                }
            }
        }
    }

    /// The directions that the light of one of them is taken from, and the solid angle of each.
    pub fn directions(&self, number: usize) -> Vec<(DVec3, f64)> {
        let BasisLight { towards, solid_angle } = self.lights[number];
        let (fall, samples) = match self.shape {
            LightShape::Discs { fall, samples } if samples > 1 => (fall, samples),
            _ => return vec![(towards, solid_angle)],
        };
        // Points of a disc as seeds of a sunflower, even in area.
        let turn = DQuat::from_rotation_arc(DVec3::Y, towards);
        let point = |k: usize| {
            let u = (k as f64 + 0.5) / samples as f64 * fall[1];
            let (radius, angle) = ((u * (2.0 - u)).sqrt(), PI * (3.0 - 5f64.sqrt()) * k as f64);
            let point = DVec3::new(radius * angle.cos(), 1.0 - u, radius * angle.sin());
            (turn * point, falloff(fall, u))
        };
        let points: Vec<(DVec3, f64)> = (0..samples).map(point).collect();
        let whole: f64 = points.iter().map(|(_, value)| value).sum();
        points.into_iter().map(|(point, value)| (point, solid_angle * value / whole)).collect()
    }

    /// Radiance of a combination in a direction.
    pub fn radiance(&self, coefficients: &[Rgb], towards: DVec3) -> Rgb {
        let mut sum = [0.0f64; 3];
        self.each_seen(towards, |number, value| {
            (0..3).for_each(|c| sum[c] += value * f64::from(coefficients[number][c]));
        });
        sum.map(|value| value as f32)
    }
}

/// 1 before the fall, 0 after it, a smooth cubic between.
fn falloff([begin, end]: [f64; 2], u: f64) -> f64 {
    if u <= begin {
        return 1.0;
    }
    if u >= end {
        return 0.0;
    }
    let s = (u - begin) / (end - begin);
    1.0 - s * s * (3.0 - 2.0 * s)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ B dω of every light, over a fine latitude-longitude picture.
    fn integrals(basis: &LightBasis) -> Vec<f64> {
        let size = [720, 360];
        let mut sums = vec![0.0; basis.len()];
        for pixel in 0..size[0] * size[1] {
            basis.each_seen(picture_direction(size, pixel), |number, value| {
                sums[number] += value * pixel_angle(size, pixel);
            });
        }
        sums
    }

    #[test]
    fn every_disc_has_its_solid_angle_whatever_its_softness() -> Result<()> {
        for (over, whole) in [(Over::Sphere, 4.0 * PI), (Over::Hemisphere(DVec3::Y), TAU)] {
            for softness in [0.2, 0.5, 1.0] {
                let basis = LightBasis::discs(40, over, softness, 1)?;
                for (number, integral) in integrals(&basis).into_iter().enumerate() {
                    let expected = whole / 40.0;
                    assert!((integral / expected - 1.0).abs() < 5e-3, "{number}: {integral} {expected}");
                    assert_eq!(basis.lights()[number].solid_angle, expected);
                }
            }
        }
        Ok(())
    }

    #[test]
    fn pixels_of_a_map_share_the_sphere() -> Result<()> {
        let basis = LightBasis::map([12, 6], Over::Sphere)?;
        for (integral, light) in integrals(&basis).into_iter().zip(basis.lights()) {
            assert!((integral / light.solid_angle - 1.0).abs() < 1e-2);
        }
        let whole: f64 = basis.lights().iter().map(|light| light.solid_angle).sum();
        assert!((whole / (4.0 * PI) - 1.0).abs() < 1e-12);
        assert_eq!(LightBasis::map([12, 6], Over::Hemisphere(DVec3::Y))?.len(), 36);
        Ok(())
    }

    #[test]
    fn lights_lie_where_they_are_asked_for_and_sample_themselves() -> Result<()> {
        let up = DVec3::new(0.3, -1.0, 0.2).normalize();
        let basis = LightBasis::discs(50, Over::Hemisphere(up), 1.0, 9)?;
        for (number, light) in basis.lights().iter().enumerate() {
            assert!(light.towards.dot(up) > 0.0);
            let directions = basis.directions(number);
            let whole: f64 = directions.iter().map(|(_, angle)| angle).sum();
            assert!((whole / light.solid_angle - 1.0).abs() < 1e-12);
            for (towards, _) in directions {
                let mut seen = 0.0;
                basis.each_seen(towards, |other, value| seen += if other == number { value } else { 0.0 });
                assert!(seen > 0.0 && (towards.length() - 1.0).abs() < 1e-12);
            }
        }
        Ok(())
    }

    #[test]
    fn lights_have_neighbours_all_around() -> Result<()> {
        let degrees = |basis: &LightBasis| {
            let mut degrees = vec![0; basis.len()];
            basis.pairs().iter().flatten().for_each(|&light| degrees[light as usize] += 1);
            degrees
        };
        for count in [16, 128, 1000] {
            let degrees = degrees(&LightBasis::discs(count, Over::Sphere, 0.5, 1)?);
            assert!(degrees.iter().all(|degree| (3..=9).contains(degree)), "{count}: {degrees:?}");
            let mean = degrees.iter().sum::<usize>() as f64 / count as f64;
            assert!((5.0..7.5).contains(&mean), "{count}: {mean}");
        }
        let map = LightBasis::map([12, 6], Over::Sphere)?;
        let of_row = |y: usize| if y == 0 || y == 5 { 3 } else { 4 };
        assert!(degrees(&map).iter().enumerate().all(|(pixel, degree)| *degree == of_row(pixel / 12)));
        assert!(map.pairs().contains(&[11, 0]), "the last column lies beside the first");
        assert!(LightBasis::discs(1, Over::Sphere, 0.5, 1)?.pairs().is_empty());
        assert_eq!(LightBasis::map([2, 1], Over::Sphere)?.pairs(), [[0, 1]]);
        Ok(())
    }

    #[test]
    fn bases_without_lights_are_refused() {
        assert!(LightBasis::discs(0, Over::Sphere, 0.5, 1).is_err());
        assert!(LightBasis::discs(8, Over::Sphere, 1.5, 1).is_err());
        assert!(LightBasis::discs(8, Over::Sphere, f64::NAN, 1).is_err());
        assert!(LightBasis::discs(8, Over::Sphere, 0.5, 0).is_err());
        assert!(LightBasis::map([0, 4], Over::Sphere).is_err());
        assert!(LightBasis::map([usize::MAX, 4], Over::Sphere).is_err());
    }
}
