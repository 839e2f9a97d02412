//! Light from everywhere as what is looked for: T = G V + D (Klehm 2015, sec. 7.3.4 and 7.4.3).
//!
//! V lights the voxels of the cached light, one column a light; G gathers what they scatter along the view rays; D is what is
//! seen of the lights beside and through the medium.

use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;

use super::Optics;
use super::optics::{Behind, check_phase, scattered, sky_grid};
use crate::cpu::{Beam, Dense, light_columns, near_medium};
use crate::march::{Quantity, Traversal, VolumeTraversal, VoxelElements, Weight, channel};
use crate::operator::{CpuVector, LinearOperator};
use crate::scene::{LightBasis, Rgb, VolumeMedium, VolumeScene};
use crate::{Error, Result};

/// V: what arrives at voxels of the light of each basis function, times the phase function.
#[derive(Debug)]
pub enum LightColumns {
    /// One number for all channels.
    Grey(Dense<1>),
    /// One a channel.
    Colored(Dense<3>),
}

impl LightColumns {
    /// Walks one ray through the medium for every voxel of a part and direction of a light.
    pub(super) fn new(scene: &VolumeScene, optics: &Optics, part: &VoxelElements) -> Result<Self> {
        let basis = &scene.light_basis;
        let beams = |light: usize| -> Vec<Beam> {
            let directions = basis.directions(light).into_iter();
            directions.map(|(towards, angle)| scattered(towards, [angle as f32; 3])).collect()
        };
        let lights: Vec<Vec<Beam>> = (0..basis.len()).map(beams).collect();
        let (density, geometry, voxels) = (&optics.density, optics.geometry(), part.voxels());
        Ok(if optics.is_lit_grey() {
            Self::Grey(light_columns(density, geometry, &part.grid, voxels, &lights)?)
        } else {
            Self::Colored(light_columns(density, geometry, &part.grid, voxels, &lights)?)
        })
    }

    /// Bytes of so many voxels and lights.
    fn bytes(voxels: usize, lights: usize, is_grey: bool) -> u64 {
        if is_grey { Dense::<1>::bytes(voxels, lights) } else { Dense::<3>::bytes(voxels, lights) }
    }

    fn is_dark(&self) -> bool {
        match self {
            Self::Grey(columns) => columns.is_zero(),
            Self::Colored(columns) => columns.is_zero(),
        }
    }
}

impl LinearOperator for LightColumns {
    type Domain = CpuVector;
    type Range = CpuVector;

    fn domain(&self) -> CpuVector {
        match self {
            Self::Grey(columns) => columns.domain(),
            Self::Colored(columns) => columns.domain(),
        }
    }

    fn range(&self) -> CpuVector {
        match self {
            Self::Grey(columns) => columns.range(),
            Self::Colored(columns) => columns.range(),
        }
    }

    fn apply(&self, x: &CpuVector, y: &mut CpuVector) -> Result<()> {
        match self {
            Self::Grey(columns) => columns.apply(x, y),
            Self::Colored(columns) => columns.apply(x, y),
        }
    }

    fn apply_adjoint(&self, y: &CpuVector, x: &mut CpuVector) -> Result<()> {
        match self {
            Self::Grey(columns) => columns.apply_adjoint(y, x),
            Self::Colored(columns) => columns.apply_adjoint(y, x),
        }
    }
}

/// How a ray ends among the lights.
#[derive(Debug, Clone, Copy)]
enum End {
    /// Where none of them is seen.
    Nowhere,
    /// In a direction, with so much of the light left.
    Sky(Vec3, Rgb),
    /// At a surface, which shows so much of their mean radiance.
    Surface(Rgb),
}

/// D: rows of what is seen of the lights behind the medium.
#[derive(Debug, Clone)]
pub struct SeenLights {
    basis: Arc<LightBasis>,
    ends: Arc<[End]>,
}

impl SeenLights {
    pub(super) fn new(scene: &VolumeScene, optics: &Optics, traversal: &VolumeTraversal) -> Self {
        let end = |row: usize| {
            let left = || traversal.transmittance(row).map(|left| left as f32);
            match optics.behind(scene, traversal.rays(), row) {
                Behind::Known(_) => End::Nowhere,
                Behind::Sky(towards) => End::Sky(towards.as_vec3(), left()),
                Behind::Surface(albedo, _) => {
                    let left = left();
                    End::Surface(std::array::from_fn(|c| left[c] * albedo[c]))
                }
            }
        };
        let ends: Vec<End> = (0..traversal.rays().len()).into_par_iter().map(end).collect();
        Self { basis: scene.light_basis.clone(), ends: ends.into() }
    }

    /// Whether a row sees any of the lights.
    pub(super) fn sees(&self, row: usize) -> bool {
        let mut sees = false;
        self.each(row, |_, weight| sees |= weight.iter().any(|&weight| weight > 0.0));
        sees
    }

    fn picked(&self, rows: &[usize]) -> Self {
        let ends: Vec<End> = rows.iter().map(|&row| self.ends[row]).collect();
        Self { basis: self.basis.clone(), ends: ends.into() }
    }

    fn each(&self, row: usize, mut visit: impl FnMut(usize, [f64; 3])) {
        match self.ends[row] {
            End::Nowhere => {}
            End::Sky(towards, left) => {
                let towards = towards.as_dvec3().normalize();
                self.basis.each_seen(towards, |light, value| {
                    visit(light, left.map(|left| f64::from(left) * value));
                });
            }
            End::Surface(shown) => {
                for (light, basis) in self.basis.lights().iter().enumerate() {
                    let share = basis.solid_angle / (4.0 * std::f64::consts::PI);
                    visit(light, shown.map(|shown| f64::from(shown) * share));
                }
            }
        }
    }
}

impl<const C: usize> Traversal<f64, C> for SeenLights {
    fn rows(&self) -> usize {
        self.ends.len()
    }

    fn elements(&self) -> usize {
        self.basis.len()
    }

    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f64, C>)) {
        self.each(row, |light, weight| visit(light, std::array::from_fn(|c| weight[c])));
    }
}

/// Rows of a problem whose unknowns are the lights of a basis: T = G V + D, walked.
///
/// Shapes  rows: view rays; elements: lights
/// Units   weights: dimensionless, radiance for radiance
/// Source  Klehm 2015, sec. 7.3.4
/// Cost    one walk of G and a multiplication for each of its non-zeros and lights
#[derive(Debug, Clone)]
pub struct LitRows {
    /// G.
    pub scattered: VolumeTraversal,
    /// V.
    pub columns: Arc<LightColumns>,
    /// D.
    pub seen: SeenLights,
}

impl LitRows {
    /// The same problem of some of its rows.
    pub(super) fn picked(&self, rows: &[usize]) -> Self {
        Self {
            scattered: self.scattered.along(self.scattered.rays().picked(rows)),
            columns: self.columns.clone(),
            seen: self.seen.picked(rows),
        }
    }

    /// The lights.
    pub fn basis(&self) -> &Arc<LightBasis> {
        &self.seen.basis
    }

    /// Bytes that V and D take.
    pub fn bytes(&self) -> u64 {
        let is_grey = matches!(*self.columns, LightColumns::Grey(_));
        let voxels = self.scattered.parts()[0].voxels().len();
        let ends = self.seen.ends.len() * size_of::<End>();
        LightColumns::bytes(voxels, self.seen.basis.len(), is_grey) + ends as u64
    }

    /// Whether no light reaches any voxel, or is seen by any row.
    pub(super) fn is_dark(&self) -> bool {
        self.columns.is_dark() && !(0..self.seen.ends.len()).any(|row| self.seen.sees(row))
    }
}

impl<const C: usize> Traversal<f64, C> for LitRows {
    fn rows(&self) -> usize {
        self.seen.ends.len()
    }

    fn elements(&self) -> usize {
        self.seen.basis.len()
    }

    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f64, C>)) {
        let mut sums: Vec<Weight<f64, C>> = vec![[0.0; C]; self.seen.basis.len()];
        self.seen.each(row, |light, weight| (0..C).for_each(|c| sums[light][c] += weight[c]));
        match &*self.columns {
            LightColumns::Grey(columns) => {
                self.scattered.walk(row, &mut |voxel, weight| add(&mut sums, &weight, columns.row(voxel)));
            }
            LightColumns::Colored(columns) => {
                self.scattered.walk(row, &mut |voxel, weight| add(&mut sums, &weight, columns.row(voxel)));
            }
        }
        for (light, weight) in sums.into_iter().enumerate() {
            if weight.iter().any(|&weight| weight != 0.0) {
                visit(light, weight);
            }
        }
    }
}

#[inline(always)]
fn add<const C: usize, const D: usize>(
    sums: &mut [Weight<f64, C>],
    weight: &Weight<f64, C>,
    light: &[Weight<f32, D>],
) {
    for (sum, light) in sums.iter_mut().zip(light) {
        (0..C).for_each(|c| sum[c] += weight[c] * f64::from(channel(light, c)));
    }
}

/// The voxels of the cached light, where the medium is, as G's elements.
///
/// Errors: [`Error::Value`] for scattering that depends on the direction.
pub(super) fn lit_voxels(
    scene: &VolumeScene,
    medium: &VolumeMedium,
    optics: &Optics,
) -> Result<VoxelElements> {
    check_phase(medium)?;
    let grid = sky_grid(scene, &optics.density)?;
    let voxels = near_medium(&optics.density, &grid);
    let quantity = Quantity::InScattered(medium.albedo.clone());
    Ok(VoxelElements::new(quantity, grid, Arc::new(voxels), medium.interpolation))
}

/// Bytes that lighting the voxels of a medium by each light takes; nothing is lit for it.
///
/// Errors: [`Error::Value`] for a number of voxels that no grid has.
pub fn light_bytes(scene: &VolumeScene, optics: &Optics) -> Result<u64> {
    let grid = sky_grid(scene, &optics.density)?;
    let voxels = near_medium(&optics.density, &grid).len();
    Ok(LightColumns::bytes(voxels, scene.light_basis.len(), optics.is_lit_grey()))
}

/// Errors: [`Error::Empty`] when no light reaches anything that is wanted.
pub(super) fn check_light(rows: &LitRows) -> Result<()> {
    if !rows.is_dark() {
        return Ok(());
    }
    Err(Error::Empty {
        reason: format!("none of the {} lights reaches what the wanted pixels show", rows.seen.basis.len()),
        remedy: "spread them over the sphere, or turn environment.lights.up towards where light can come from",
    })
}
