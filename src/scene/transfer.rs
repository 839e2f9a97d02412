use glam::DVec3;

use super::{Rgb, RgbaImage};

/// A transfer function: a colour of scattered light for two properties of a view ray (Kol et al. 2017, sec. 4.2).
#[derive(Debug, Clone, PartialEq)]
pub struct Transfer {
    /// What its colours are.
    pub role: TransferRole,
    /// Which properties, each of which is from 0 to 1.
    pub axes: [TransferAxis; 2],
    /// Texels along both axes.
    pub size: [usize; 2],
    /// The depth at the end of its axis, in metres; where it is not given, 95 % of the surfaces that the views see are nearer.
    pub far: Option<f64>,
    /// What it is made of, from the bottom up, over white.
    pub layers: Vec<TransferLayer>,
    /// How far it goes from light as it is to what the layers say, from 0 to 1.
    pub strength: f64,
}

impl Default for Transfer {
    /// A white factor over visibility and depth.
    fn default() -> Self {
        Self {
            role: TransferRole::Factor,
            axes: [TransferAxis::Visibility, TransferAxis::Depth],
            size: [128, 128],
            far: None,
            layers: Vec::new(),
            strength: 1.0,
        }
    }
}

impl Transfer {
    /// The one that leaves light as it is. It is over properties that no shadow map is asked for.
    pub fn none() -> Self {
        Self {
            role: TransferRole::Factor,
            axes: [TransferAxis::Depth, TransferAxis::Angle],
            size: [1, 1],
            far: Some(1.0),
            layers: Vec::new(),
            strength: 0.0,
        }
    }
}

/// What the colours of a transfer function are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TransferRole {
    /// Scattered light is multiplied by them.
    Factor,
    /// They are scattered light, in its place. White is as bright as what air that scatters evenly to all sides, lit all along an endless
    /// ray, shows of the light: ρ L / 4π, by luminance.
    Color,
}

/// A property of a view ray up to the first surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TransferAxis {
    /// The share of it that is lit.
    Visibility,
    /// Its length, as a share of the far end.
    Depth,
    /// The mean distance of its lit points from the eye, as a share of its length; 0 where nothing is lit.
    Position,
    /// The angle between its direction and that towards the light, as a share of 180 degrees.
    Angle,
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
    /// One colour at the beginning of an axis, another at its end.
    Gradient {
        /// The first axis or the second, 0 or 1.
        axis: usize,
        /// The colours.
        ends: [Rgb; 2],
    },
    /// A picture, the first axis to the right and the second downwards; straight alpha.
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
    /// At properties of a ray, both from 0 to 1.
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
