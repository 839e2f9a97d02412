use std::sync::Arc;

use glam::DVec3;

use super::cells::{CellRay, Line};
use crate::scene::{Volume, VoxelGrid, henyey_greenstein};

/// Light that arrives at the points of a volume and is scattered once towards the eye: per-light radiance, cached at the
/// centres of voxels with its transmittance through the medium, trilinear between them.
#[derive(Debug, Clone, Default)]
pub struct InScattering {
    /// The cached light of each source. It is already times the phase function where that does not depend on the view.
    fields: Vec<LitVolume>,
}

/// Light from somewhere, at the points of a volume.
#[derive(Debug, Clone)]
pub struct LitVolume {
    /// For light from one direction: where it goes, of unit length, and the mean cosine g of its phase function.
    pub along: Option<(DVec3, f64)>,
    /// Radiance times solid angle at each point, attenuated on its way; for light from all directions times the phase
    /// function.
    pub radiance: Arc<Volume>,
}

impl InScattering {
    /// Light of several sources.
    pub fn new(fields: Vec<LitVolume>) -> Self {
        Self { fields }
    }

    /// Whether all channels are lit alike.
    pub fn is_grey(&self) -> bool {
        self.fields.iter().all(|field| field.radiance.channels() == 1)
    }

    /// The sources.
    pub fn fields(&self) -> &[LitVolume] {
        &self.fields
    }

    /// What is scattered towards the eye along a line, per albedo.
    pub(super) fn along(&self, line: &Line) -> Vec<Towards<'_>> {
        self.fields
            .iter()
            .map(|field| Towards {
                volume: &field.radiance,
                // Light that goes along w leaves towards the eye, against the view ray.
                factor: field.along.map_or(1.0, |(w, g)| henyey_greenstein(g, -w.dot(line.direction))),
                ray: CellRay::new(line, field.radiance.grid(), 0.0),
            })
            .collect()
    }
}

/// One source as a view ray sees it.
pub(super) struct Towards<'a> {
    volume: &'a Volume,
    factor: f64,
    ray: CellRay,
}

impl Towards<'_> {
    /// Where its values are.
    pub(super) fn grid(&self) -> &VoxelGrid {
        self.volume.grid()
    }

    /// L_scat at t.
    #[inline]
    pub(super) fn at(&self, t: f64) -> [f64; 3] {
        self.volume.interpolated(self.ray.at(t)).map(|value| self.factor * f64::from(value))
    }
}
