use glam::DVec2;

use crate::{Error, Result};

/// A rectangle in the (u, v) plane of a light, in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// The corner of the first texel.
    pub min: DVec2,
    /// The corner of the last texel.
    pub max: DVec2,
}

impl Extent {
    /// The extent that holds nothing; [`Extent::include`] grows it.
    pub const NOTHING: Self = Self { min: DVec2::INFINITY, max: DVec2::NEG_INFINITY };

    /// The smallest extent that holds this one and `point`.
    pub fn include(self, point: DVec2) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// The smallest extent that holds both.
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// What both hold; none when that has no area.
    pub fn intersection(self, other: Self) -> Option<Self> {
        Some(Self { min: self.min.max(other.min), max: self.max.min(other.max) }).filter(Self::has_area)
    }

    /// Whether it is finite and neither side is zero.
    pub fn has_area(&self) -> bool {
        self.min.is_finite() && self.max.is_finite() && self.min.cmplt(self.max).all()
    }

    /// The same, larger by `margin` metres on every side.
    pub fn grown(self, margin: f64) -> Self {
        Self { min: self.min - margin, max: self.max + margin }
    }
}

/// A rectangle of texels: an extent and its resolution. Element (i, j) has index `j · width + i`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Where it lies.
    pub extent: Extent,
    /// Texels along u and along v.
    pub size: [usize; 2],
}

impl Grid {
    /// Errors: [`Error::Value`] for an extent without area or a resolution of zero.
    pub fn new(extent: Extent, size: [usize; 2]) -> Result<Self> {
        if !extent.has_area() {
            let got = format!("from {} to {}", extent.min, extent.max);
            return Err(Error::value("extent", got, "finite, with min below max on both axes"));
        }
        if size.contains(&0) {
            return Err(Error::value("size", format!("{size:?}"), "at least 1"));
        }
        Ok(Self { extent, size })
    }

    /// The number of texels.
    pub fn len(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// Never: a grid has at least one texel.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Texels a metre along u and along v.
    #[inline]
    pub fn density(&self) -> DVec2 {
        DVec2::new(self.size[0] as f64, self.size[1] as f64) / (self.extent.max - self.extent.min)
    }

    /// A point in texels: (0, 0) is the outer corner of the first texel, (0.5, 0.5) its centre.
    #[inline]
    pub fn grid_from_light(&self, point: DVec2) -> DVec2 {
        (point - self.extent.min) * self.density()
    }

    /// The centre of texel (i, j) in metres.
    pub fn centre(&self, i: usize, j: usize) -> DVec2 {
        self.extent.min + DVec2::new(i as f64 + 0.5, j as f64 + 0.5) / self.density()
    }
}
