//! What is looked for: the elements of a volume problem, where they start and what bounds them.

use std::sync::Arc;

use super::Optics;
use super::environment::lit_voxels;
use super::hull::visual_hull;
use crate::cpu::near_medium;
use crate::march::{Density, Part, Quantity};
use crate::operator::Bounds;
use crate::problem::Steering;
use crate::scene::{Find, Rgb, Volume, VolumeMedium, VolumeScene, VoxelGrid, VoxelSet};
use crate::{Error, Result};

/// What is looked for, before any ray is walked.
pub(super) struct Searched {
    pub(super) parts: Vec<Part>,
    pub(super) start: Vec<Rgb>,
    pub(super) places: Vec<u32>,
    pub(super) size: Vec<usize>,
    pub(super) bounds: Bounds,
    pub(super) steering: Option<Steering>,
    pub(super) outside_hull: usize,
}

impl Searched {
    pub(super) fn new(
        scene: &VolumeScene,
        medium: &VolumeMedium,
        optics: &Optics,
        find: Find,
    ) -> Result<Self> {
        if !matches!(find, Find::Extinction | Find::Refinement) && optics.density.cells().is_empty() {
            return Err(Error::Empty {
                reason: "the volume has no extinction anywhere, so nothing in it emits or scatters"
                    .to_owned(),
                remedy: "give it some, and check that volume.to_world puts the box where the shapes are",
            });
        }
        let settings = &scene.bounds;
        let bounds = |of: [[f64; 3]; 2]| -> Result<Bounds> {
            if scene.solve.solver.keeps_bounds() { Bounds::new(of[0], of[1]) } else { Ok(Bounds::NONE) }
        };
        let light = || {
            optics.light.clone().ok_or_else(|| Error::Empty {
                reason: "albedo cannot be found in the dark: no light reaches the volume".to_owned(),
                remedy: "add a light or an environment, or look for emission",
            })
        };
        let mut searched = Self {
            parts: Vec::new(),
            start: Vec::new(),
            places: Vec::new(),
            size: Vec::new(),
            bounds: Bounds::NONE,
            steering: None,
            outside_hull: 0,
        };
        match find {
            Find::Emission => {
                searched.add(scene, optics, Quantity::Emission, &medium.emission)?;
                searched.bounds = bounds(settings.emission)?;
                searched.steering = steering([scene.pull[0]; 2], 0);
            }
            Find::Albedo => {
                searched.add(scene, optics, Quantity::Albedo(light()?), &medium.albedo)?;
                searched.bounds = bounds(settings.albedo)?;
                searched.steering = steering([scene.pull[1]; 2], 0);
            }
            Find::Joint => {
                if medium.emission.grid().size() != medium.albedo.grid().size() {
                    let sizes =
                        format!("{:?} and {:?}", medium.emission.grid().size(), medium.albedo.grid().size());
                    let expected =
                        "the same number of voxels for emission and albedo, which are found together";
                    return Err(Error::value("volume.albedo", sizes, expected));
                }
                searched.add(scene, optics, Quantity::Emission, &medium.emission)?;
                let first = searched.start.len();
                searched.add(scene, optics, Quantity::Albedo(light()?), &medium.albedo)?;
                searched.bounds = bounds(settings.emission)?.then(first, bounds(settings.albedo)?);
                searched.steering = steering(scene.pull, first);
            }
            Find::Extinction | Find::Refinement => {
                searched.add(scene, optics, Quantity::Extinction, &medium.extinction)?;
                searched.bounds = bounds(settings.extinction)?;
            }
            Find::Environment => {
                searched.parts.push(lit_voxels(scene, medium, optics)?);
                searched.start = scene.light_basis.coefficients_of(optics.environment());
                searched.places = scene.light_basis.places();
                searched.size = scene.light_basis.lattice().to_vec();
                searched.bounds = bounds(settings.environment)?;
            }
        }
        if searched.start.is_empty() {
            return Err(Error::Empty {
                reason: format!("there is no voxel whose {} could be found", find.name()),
                remedy: "give the volume extinction somewhere inside the visual hull",
            });
        }
        Ok(searched)
    }

    fn add(
        &mut self,
        scene: &VolumeScene,
        optics: &Optics,
        quantity: Quantity,
        volume: &Volume,
    ) -> Result<()> {
        let grid = *volume.grid();
        let candidates = match quantity {
            Quantity::Extinction => VoxelSet::all(grid.size()),
            _ => near_medium_exactly(&optics.density, &grid),
        };
        let voxels = match visual_hull(scene, &grid)? {
            Some(hull) => candidates.intersection(&hull),
            None => candidates.clone(),
        };
        let voxels = if scene.solve.skip.bricks { voxels } else { voxels.entered_everywhere() };
        self.outside_hull += candidates.len() - voxels.len();
        let first = if self.parts.is_empty() { 0 } else { grid.len() as u32 };
        for index in voxels.indices() {
            self.places.push(first + index);
            self.start.push(volume.color(index as usize));
        }
        self.size = grid.size().to_vec();
        self.parts.push(Part::new(quantity, grid, Arc::new(voxels), optics.density.interpolation()));
        Ok(())
    }
}

/// What the two parts are pulled with; none where it is what everything is.
fn steering([first, then]: [f64; 2], then_from: usize) -> Option<Steering> {
    ([first, then] != [1.0; 2]).then_some(Steering { first, then_from, then })
}

/// The voxels of a grid that a medium reaches into; exactly those with extinction where the grids are one.
pub(super) fn near_medium_exactly(density: &Density, grid: &VoxelGrid) -> VoxelSet {
    if grid == density.grid() && density.cells().size() == grid.size() {
        return density.cells().clone();
    }
    near_medium(density, grid)
}
