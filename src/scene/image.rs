use rayon::prelude::*;

use super::Rgb;
use crate::{Error, Result};

/// A picture of linear RGB radiance, row by row from the top left.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    size: [usize; 2],
    /// The pixels; as many as `size` says.
    pub pixels: Vec<Rgb>,
}

impl Image {
    /// A picture of one colour.
    pub fn constant(size: [usize; 2], color: Rgb) -> Self {
        Self { size, pixels: vec![color; size[0] * size[1]] }
    }

    /// Errors: [`Error::Shape`] when there are not as many pixels as `size` says.
    pub fn new(size: [usize; 2], pixels: Vec<Rgb>) -> Result<Self> {
        let expected = size[0] * size[1];
        if pixels.len() != expected {
            return Err(Error::Shape { what: "a picture", expected, got: pixels.len() });
        }
        Ok(Self { size, pixels })
    }

    /// Width and height.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// One pixel; panics outside the picture, like a slice.
    pub fn at(&self, x: usize, y: usize) -> Rgb {
        self.pixels[y * self.size[0] + x]
    }

    /// The picture itself, when all of it is finite. `what` names it in the error.
    ///
    /// Errors: [`Error::NonFinite`] naming the first pixel that is not.
    pub fn finite(self, what: &str) -> Result<Self> {
        match self.pixels.par_iter().position_first(|p| !p.iter().all(|c| c.is_finite())) {
            None => Ok(self),
            Some(index) => Err(Error::NonFinite {
                what: what.to_owned(),
                place: format!("pixel ({}, {})", index % self.size[0], index / self.size[0]),
            }),
        }
    }
}

/// A painted layer: straight (not premultiplied) linear colour, and in alpha the weight of the constraint.
#[derive(Debug, Clone, PartialEq)]
pub struct RgbaImage {
    size: [usize; 2],
    /// The pixels; as many as `size` says.
    pub pixels: Vec<[f32; 4]>,
}

impl RgbaImage {
    /// A layer with nothing painted on it.
    pub fn transparent(size: [usize; 2]) -> Self {
        Self { size, pixels: vec![[0.0; 4]; size[0] * size[1]] }
    }

    /// Errors: [`Error::Shape`] when there are not as many pixels as `size` says.
    pub fn new(size: [usize; 2], pixels: Vec<[f32; 4]>) -> Result<Self> {
        let expected = size[0] * size[1];
        if pixels.len() != expected {
            return Err(Error::Shape { what: "a painted layer", expected, got: pixels.len() });
        }
        Ok(Self { size, pixels })
    }

    /// Width and height.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }
}
