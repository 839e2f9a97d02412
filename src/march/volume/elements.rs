//! What the unknowns of a volume are: some voxels of a grid, and the quantity that they are of.

use std::sync::Arc;

use super::cells::Line;
use super::light::{InScattering, Towards};
use crate::scene::{Interpolation, Volume, VoxelGrid, VoxelSet};

/// The quantity whose values a row's weights multiply.
#[derive(Debug, Clone)]
pub enum Quantity {
    /// Emitted radiance L_e: ∫ T_r σ_t v dt (Klehm 2015, eq. 7.4).
    Emission,
    /// Albedo ρ: ∫ T_r σ_t L_scat v dt (Klehm 2015, eq. 7.6).
    Albedo(Arc<InScattering>),
    /// Extinction σ_t: ∫ v dt (Klehm 2015, eq. 7.13).
    Extinction,
    /// What arrives and is scattered, L_scat, for an albedo that is known: ∫ T_r σ_t ρ v dt, v trilinear between the centres of
    /// the cached light whatever the basis is (Klehm 2015, sec. 7.4.3).
    InScattered(Arc<Volume>),
}

impl Quantity {
    /// What is scattered towards the eye along a line, per albedo, where it is albedo.
    pub(super) fn light(&self, line: &Line) -> Option<Vec<Towards<'_>>> {
        match self {
            Self::Albedo(light) => Some(light.along(line)),
            _ => None,
        }
    }
}

/// The elements of one quantity: some voxels of a grid. It is one part of the elements of a traversal.
#[derive(Debug, Clone)]
pub struct VoxelElements {
    /// What they are.
    pub quantity: Quantity,
    /// Where the voxels lie.
    pub grid: VoxelGrid,
    /// What lies between them.
    pub(super) basis: Interpolation,
    /// Which of them are elements.
    pub(super) voxels: Arc<VoxelSet>,
    /// The cells of the basis that any of them reaches into.
    pub(super) cells: Arc<VoxelSet>,
    /// The known albedo of [`Quantity::InScattered`], where it is the same everywhere.
    pub(super) uniform: Option<[f64; 3]>,
}

impl VoxelElements {
    /// Elements are the voxels of a set.
    pub fn new(quantity: Quantity, grid: VoxelGrid, voxels: Arc<VoxelSet>, basis: Interpolation) -> Self {
        debug_assert_eq!(grid.size(), voxels.size());
        let basis = match quantity {
            Quantity::InScattered(_) => Interpolation::Trilinear,
            _ => basis,
        };
        let cells = match basis {
            Interpolation::Nearest => voxels.clone(),
            Interpolation::Trilinear => Arc::new(voxels.cells_between()),
        };
        let uniform = match &quantity {
            Quantity::InScattered(albedo) => albedo.uniform().map(|color| color.map(f64::from)),
            _ => None,
        };
        Self { quantity, grid, basis, voxels, cells, uniform }
    }

    /// The same, with walks that enter bricks without elements, too.
    pub fn entered_everywhere(&self) -> Self {
        let everywhere = |set: &VoxelSet| Arc::new(set.clone().entered_everywhere());
        Self { voxels: everywhere(&self.voxels), cells: everywhere(&self.cells), ..self.clone() }
    }

    /// Which voxels are elements, in the order of their numbers.
    pub fn voxels(&self) -> &VoxelSet {
        &self.voxels
    }

    /// The cells of the basis that any of them reaches into.
    pub fn cells(&self) -> &VoxelSet {
        &self.cells
    }
}
