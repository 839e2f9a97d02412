//! What lets light through.

use std::sync::Arc;

use super::wrap::{Wrap, neighbours};
use super::{Rgb, rgb};
use crate::{Error, Result};

/// A thin surface that lets light through: straight on, and coloured.
///
/// It neither bends light nor scatters or mirrors it. Light that passes two surfaces is coloured twice.
///
/// Units   a share of the light a channel, linear, in [0, 1]
#[derive(Debug, Clone, PartialEq)]
pub struct Glass {
    /// What passes; with a picture, what it is multiplied by.
    pub transmittance: Rgb,
    /// What passes from place to place.
    pub picture: Option<Arc<Tint>>,
}

/// A picture of transmittance.
#[derive(Debug, Clone, PartialEq)]
pub struct Tint {
    /// Width and height.
    pub size: [usize; 2],
    /// The square roots of linear shares, from 0 to 255, row by row from the top left.
    pub values: Vec<[u8; 3]>,
    /// How coordinates wrap along u and v.
    pub wrap: [Wrap; 2],
}

impl Glass {
    /// Where less than this share passes in every channel, a surface is as solid as any other.
    pub const SOLID: f32 = 0.02;
    /// Where more than this passes in every channel, there is nothing.
    pub const CLEAR: f32 = 0.998;

    /// What passes at the texture coordinates (u, v). Zeros where it is solid, ones where there is nothing.
    pub fn at(&self, coordinates: [f64; 2]) -> Rgb {
        let picture = self.picture.as_ref().map_or([1.0; 3], |picture| picture.at(coordinates));
        let passes = rgb(|c| self.transmittance[c] * picture[c]);
        match passes {
            passes if passes.iter().all(|&share| share < Self::SOLID) => [0.0; 3],
            passes if passes.iter().all(|&share| share > Self::CLEAR) => [1.0; 3],
            passes => passes,
        }
    }

    /// Whether it is solid somewhere.
    pub fn has_solid_places(&self) -> bool {
        let is_solid = |passes: Rgb| passes.iter().all(|&share| share < Self::SOLID);
        match &self.picture {
            None => is_solid(self.transmittance),
            Some(picture) => {
                let passes = |value: &[u8; 3]| rgb(|c| self.transmittance[c] * Tint::share(value[c]));
                picture.values.iter().any(|value| is_solid(passes(value)))
            }
        }
    }

    /// Whether it lets anything through, and stands in the way of something.
    pub fn colors(&self) -> bool {
        let colors = |passes: Rgb| {
            passes.iter().any(|&share| share >= Self::SOLID)
                && passes.iter().any(|&share| share <= Self::CLEAR)
        };
        match &self.picture {
            None => colors(self.transmittance),
            Some(_) => self.transmittance.iter().any(|&share| share >= Self::SOLID),
        }
    }

    /// Whether all channels pass alike.
    pub fn is_grey(&self) -> bool {
        let [r, g, b] = self.transmittance;
        let is_grey = |&[r, g, b]: &[u8; 3]| r == g && g == b;
        r == g && g == b && self.picture.as_ref().is_none_or(|picture| picture.values.iter().all(is_grey))
    }

    pub(super) fn validate(&self) -> Result<()> {
        if !self.transmittance.iter().all(|share| (0.0..=1.0).contains(share)) {
            let transmittance = format!("{:?}", self.transmittance);
            return Err(Error::value("glass.transmittance", transmittance, "between 0 and 1"));
        }
        let Some(picture) = &self.picture else { return Ok(()) };
        let pixels = picture.size[0].checked_mul(picture.size[1]).filter(|&pixels| pixels > 0);
        match pixels {
            None => {
                let size = format!("{:?}", picture.size);
                Err(Error::value("glass.picture.size", size, "two positive numbers whose product fits"))
            }
            Some(expected) if expected != picture.values.len() => {
                Err(Error::Shape { what: "a picture of glass", expected, got: picture.values.len() })
            }
            Some(_) => Ok(()),
        }
    }
}

impl Tint {
    /// From shares in [0, 1].
    pub fn value(share: f32) -> u8 {
        (share.clamp(0.0, 1.0).sqrt() * f32::from(u8::MAX)).round() as u8
    }

    /// The share that a value stands for.
    pub fn share(value: u8) -> f32 {
        (f32::from(value) / f32::from(u8::MAX)).powi(2)
    }

    /// Bilinear. Pixel centres lie at half-integer multiples of 1/size. Coordinates that are not finite read an edge pixel.
    pub fn at(&self, [u, v]: [f64; 2]) -> Rgb {
        let ([x0, x1], fx) = neighbours(u, self.size[0], self.wrap[0]);
        let ([y0, y1], fy) = neighbours(v, self.size[1], self.wrap[1]);
        let value =
            |x: usize, y: usize, c: usize| f64::from(Self::share(self.values[y * self.size[0] + x][c]));
        rgb(|c| {
            let upper = value(x0, y0, c) * (1.0 - fx) + value(x1, y0, c) * fx;
            let lower = value(x0, y1, c) * (1.0 - fx) + value(x1, y1, c) * fx;
            (upper * (1.0 - fy) + lower * fy) as f32
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_says_what_passes_where_and_its_ends_are_solid_and_nothing() {
        let picture =
            Tint { size: [3, 1], values: vec![[0, 0, 0], [255, 0, 0], [255; 3]], wrap: [Wrap::Clamp; 2] };
        let glass = Glass { transmittance: [1.0; 3], picture: Some(Arc::new(picture)) };
        assert!(glass.has_solid_places() && glass.colors() && !glass.is_grey());
        assert_eq!(glass.at([0.0, 0.5]), [0.0; 3]);
        assert_eq!(glass.at([0.5, 0.5]), [1.0, 0.0, 0.0]);
        assert_eq!(glass.at([1.0, 0.5]), [1.0; 3]);
        // Half-way between the centres of two pixels.
        assert_eq!(glass.at([1.0 / 3.0, 0.5]), [0.5, 0.0, 0.0]);
        // Less than a fiftieth is nothing.
        assert_eq!(glass.at([0.168, 0.5]), [0.0; 3]);
        let half = Glass { transmittance: [0.5; 3], ..glass };
        assert_eq!(half.at([1.0, 0.5]), [0.5; 3]);
    }

    #[test]
    fn glass_that_is_all_solid_or_nothing_at_all_colors_nothing() {
        let of = |share: f32| Glass { transmittance: [share; 3], picture: None };
        assert!(!of(0.01).colors() && of(0.01).has_solid_places());
        assert!(!of(1.0).colors() && !of(1.0).has_solid_places());
        assert!(of(0.5).colors() && !of(0.5).has_solid_places() && of(0.5).is_grey());
        assert!(
            of(1.5).validate().is_err() && of(f32::NAN).validate().is_err() && of(0.5).validate().is_ok()
        );
    }
}
