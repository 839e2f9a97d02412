use glam::DVec3;
use rayon::prelude::*;

use super::dense::Dense;
use crate::march::{Density, Weight};
use crate::scene::{Ray, Rgb, Samples, Volume, VoxelGrid, VoxelSet};
use crate::visibility::Geometry;
use crate::{Error, Result};

/// Light from one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beam {
    /// Towards the light, in world space; of unit length.
    pub towards: DVec3,
    /// Radiance times the solid angle that it comes from, in steradians, and times any further factor such as a phase function.
    pub radiance: Rgb,
}

/// Light of some beams at the centres of voxels, attenuated by a medium and shadowed or coloured by surfaces: Σ L e^{−τ} V.
///
/// The transmittance is integrated exactly from each centre to where the medium ends. It is computed where the medium is,
/// and is 0 elsewhere, where nothing scatters.
///
/// Shapes  the grid's, one number a voxel for grey light in a grey medium behind grey panes, else three
/// Units   those of the beams' radiance
/// Errors: [`Error::NonFinite`] where a sum is beyond f32
/// Cost    one ray through the medium for every voxel and beam
pub fn light_volume(
    density: &Density,
    geometry: &Geometry,
    grid: VoxelGrid,
    beams: &[Beam],
) -> Result<Volume> {
    let near = near_medium(density, &grid);
    let voxels = near.indices();
    let light_at = |&index: &u32| {
        let centre = grid.centre(grid.voxel(index as usize));
        arriving(density, geometry, centre, beams).map(|value| value as f32)
    };
    let lit: Vec<Rgb> = voxels.par_iter().map(light_at).collect();
    let is_grey = density.is_grey()
        && geometry.is_grey()
        && beams.iter().all(|beam| beam.radiance == [beam.radiance[0]; 3]);
    let channels = if is_grey { 1 } else { 3 };
    let mut samples = vec![0.0; grid.len() * channels];
    for (index, color) in voxels.iter().zip(lit) {
        let place = *index as usize * channels;
        samples[place..place + channels].copy_from_slice(&color[..channels]);
    }
    Volume::new(grid, channels, Samples::F32(samples)).map_err(|error| match error {
        Error::NonFinite { place, .. } => Error::NonFinite { what: "the light".to_owned(), place },
        other => other,
    })
}

/// The same light by light: one column for the beams of each, one row for each of some voxels.
///
/// Errors: [`Error::NonFinite`] where a sum is beyond f32.
pub fn light_columns<const C: usize>(
    density: &Density,
    geometry: &Geometry,
    grid: &VoxelGrid,
    voxels: &VoxelSet,
    lights: &[Vec<Beam>],
) -> Result<Dense<C>> {
    let row = |&index: &u32| {
        let centre = grid.centre(grid.voxel(index as usize));
        lights.iter().map(move |beams| -> Weight<f32, C> {
            let light = arriving(density, geometry, centre, beams);
            std::array::from_fn(|c| light[c] as f32)
        })
    };
    let indices = voxels.indices();
    let weights: Vec<Weight<f32, C>> = indices.par_iter().flat_map_iter(row).collect();
    if let Some(place) = weights.iter().position(|weight| !weight.iter().all(|value| value.is_finite())) {
        let [i, j, k] = grid.voxel(indices[place / lights.len().max(1)] as usize);
        return Err(Error::NonFinite {
            what: "the light".to_owned(),
            place: format!("voxel ({i}, {j}, {k})"),
        });
    }
    Dense::new(indices.len(), lights.len(), weights)
}

/// Light of some beams at a point: Σ L e^{−τ} V.
fn arriving(density: &Density, geometry: &Geometry, point: DVec3, beams: &[Beam]) -> [f64; 3] {
    let mut sum = [0.0f64; 3];
    for beam in beams {
        let ray = Ray { origin: point, direction: beam.towards };
        let passes = geometry.transmittance(&ray, f64::INFINITY);
        if passes == [0.0; 3] {
            continue;
        }
        let tau = density.optical_depth(point, beam.towards, f64::INFINITY);
        (0..3).for_each(|c| sum[c] += f64::from(passes[c] * beam.radiance[c]) * (-tau[c]).exp());
    }
    sum
}

/// The voxels of a grid whose value counts somewhere in a medium: those that the medium overlaps, and half a voxel around it.
pub fn near_medium(density: &Density, grid: &VoxelGrid) -> VoxelSet {
    let (shift, _) = density.interpolation().cells();
    let from_medium = *grid.grid_from_world() * *density.grid().world_from_grid();
    let size = grid.size();
    let mut near = vec![false; grid.len()];
    for cell in density.cells().voxels() {
        // The corners of the cell, and half a voxel around, for values are interpolated.
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for corner in 0..8 {
            let at = |axis: usize| (cell[axis] + (corner >> axis & 1)) as f64 - shift;
            let p = from_medium.transform_point3(DVec3::new(at(0), at(1), at(2)));
            (low, high) = (low.min(p), high.max(p));
        }
        let range = |axis: usize| {
            let last = size[axis] - 1;
            let first = (low[axis] - 0.5).max(0.0) as usize;
            first.min(last)..=((high[axis] + 0.5).max(0.0) as usize).min(last)
        };
        for k in range(2) {
            for j in range(1) {
                for i in range(0) {
                    near[grid.index([i, j, k])] = true;
                }
            }
        }
    }
    grid.set(|index| near[index])
}
