use glam::DVec3;

use super::{Rgb, RgbaImage};

/// A transfer function: a colour by which scattered light is multiplied, for each average visibility and depth of a view ray
/// (Kol et al. 2017, sec. 4.2).
#[derive(Debug, Clone, PartialEq)]
pub struct Transfer {
    /// Texels along visibility, from 0 to 1, and along depth.
    pub size: [usize; 2],
    /// The depth at the end of its axis, in metres.
    pub far: f64,
    /// What it is made of, from the bottom up, over white.
    pub layers: Vec<TransferLayer>,
    /// How far it goes from white to what the layers say, from 0 to 1.
    pub strength: f64,
}

/// A layer of a transfer function.
#[derive(Debug, Clone, PartialEq)]
pub struct TransferLayer {
    /// What it shows.
    pub shows: LayerKind,
    /// How it is laid over those below.
    pub blend: Blend,
    /// A factor of its alpha, from 0 to 1.
    pub opacity: f64,
}

/// What a layer of a transfer function shows.
#[derive(Debug, Clone, PartialEq)]
pub enum LayerKind {
    /// One colour.
    Solid(Rgb),
    /// One colour at the beginning of an axis, another at its end; 0 is visibility, 1 depth.
    Gradient {
        /// Which axis.
        axis: usize,
        /// The colours.
        ends: [Rgb; 2],
    },
    /// A picture, visibility to the right and depth downwards; straight alpha.
    Picture(RgbaImage),
    /// What spreads from some points (Orzan et al. 2008).
    Diffusion(Vec<TransferPoint>),
}

/// How a layer is laid over those below.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Blend {
    /// In their place, by its alpha.
    Alpha,
    /// They are multiplied, as far as its alpha says.
    Multiply,
    /// It is added, times its alpha.
    Add,
}

/// A point from which colour spreads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TransferPoint {
    /// Where.
    pub place: TransferPlace,
    /// Linear.
    pub color: Rgb,
    /// From 0 to 1.
    pub alpha: f64,
}

/// Where a point of a transfer function is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TransferPlace {
    /// At a visibility and a depth, both from 0 to 1.
    Axes([f64; 2]),
    /// At those of what a view sees at a place of its picture.
    Pixel {
        /// The number of the view.
        view: usize,
        /// From (0, 0), the outer corner of the first pixel, to (1, 1), that of the last, whatever the picture's size.
        at: [f64; 2],
    },
    /// At those of the ray from the eye of a view to a point of the world, whether something is before it or not.
    Point {
        /// The number of the view.
        view: usize,
        /// In world space, metres.
        point: DVec3,
    },
}

impl Transfer {
    /// Whether it leaves grey what is grey.
    pub fn is_grey(&self) -> bool {
        let is_grey = |color: &Rgb| color[0] == color[1] && color[1] == color[2];
        self.layers.iter().all(|layer| match &layer.shows {
            LayerKind::Solid(color) => is_grey(color),
            LayerKind::Gradient { ends, .. } => ends.iter().all(is_grey),
            LayerKind::Picture(picture) => picture.pixels.iter().all(|&[r, g, b, _]| r == g && g == b),
            LayerKind::Diffusion(points) => points.iter().all(|point| is_grey(&point.color)),
        })
    }
}
