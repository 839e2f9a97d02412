//! What every method draws with: rays, and the light of a sun.

use super::super::Maps;
use crate::march::ViewRay;
use crate::scene::{Rgb, Scene};

/// Transmittance beyond which marches do not go: a quarter of what 8 bits show.
pub(super) const MARCHED_TO: f64 = 1.0 / 1024.0;

/// The light of a sun: its radiance, and how far that of another light map is from it.
#[derive(Clone, Copy)]
pub(in crate::problem) struct SunLight<'a> {
    pub(in crate::problem) scene: &'a Scene,
    pub(in crate::problem) maps: &'a Maps,
    /// Texels less the radiance of the sun, and the same of what comes from outside the light map; none where nothing changes.
    pub(in crate::problem) change: Option<(&'a [Rgb], Rgb)>,
}

/// Rays of a picture.
pub(in crate::problem) struct PictureRays<'a> {
    pub(in crate::problem) rays: &'a [ViewRay],
    /// Columns of the picture.
    pub(in crate::problem) width: usize,
    /// The angle between a ray and its neighbours, in radians.
    pub(in crate::problem) angle: &'a (dyn Fn(usize) -> f64 + Sync),
}
