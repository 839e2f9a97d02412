//! What is looked for: the elements of a volume problem, where they start and what bounds them.

use std::sync::Arc;

use rayon::prelude::*;

use super::Optics;
use super::environment::lit_voxels;
use super::hull::visual_hull;
use crate::cpu::near_medium;
use crate::march::{Density, Quantity, Traversal, VolumeTraversal, VoxelElements};
use crate::operator::Scalars;
use crate::problem::evenly;
use crate::scene::{Find, Rgb, Volume, VolumeMedium, VolumeScene, VoxelGrid, VoxelSet};
use crate::{Error, Result};

/// What is looked for, before any ray is walked.
pub(super) struct Searched {
    pub(super) parts: Vec<VoxelElements>,
    pub(super) start: Vec<Rgb>,
    /// The place of each element in its lattice.
    pub(super) places: Vec<u32>,
    pub(super) kinds: Vec<ElementKind>,
    pub(super) outside_hull: usize,
    /// Whether what is found spreads to elements that no row reaches.
    pub(super) spreads: bool,
}

/// How much brighter than what is painted the medium may glow: where it is seen through others of its kind, paint asks for more than it
/// shows.
const BRIGHTER: f64 = 2.0;
/// Rows that are looked at for what is painted.
const ROWS: usize = 4096;

/// So many elements that share a lattice, bounds and pull.
#[derive(Debug, Clone)]
pub(super) struct ElementKind {
    pub(super) noun: &'static str,
    pub(super) len: usize,
    pub(super) size: Vec<usize>,
    pub(super) bounds: [Scalars; 2],
    pub(super) pull: f64,
    /// Who lies beside whom, where that is not what the lattice says.
    pub(super) pairs: Vec<[u32; 2]>,
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
        let bounds = &scene.bounds;
        let [of_emission, of_albedo] = scene.pull;
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
            kinds: Vec::new(),
            outside_hull: 0,
            // A measured voxel that nobody sees is unknown; a painted one is like those beside it, and so is a part of the sky.
            spreads: scene.is_painted || find == Find::Environment,
        };
        let mut add =
            |quantity, volume, bounds, pull| searched.add((scene, optics), quantity, volume, bounds, pull);
        match find {
            Find::Emission => add(Quantity::Emission, &medium.emission, bounds.emission, of_emission)?,
            Find::Albedo => add(Quantity::Albedo(light()?), &medium.albedo, bounds.albedo, of_albedo)?,
            Find::Joint => {
                if medium.emission.grid().size() != medium.albedo.grid().size() {
                    let sizes =
                        format!("{:?} and {:?}", medium.emission.grid().size(), medium.albedo.grid().size());
                    let expected =
                        "the same number of voxels for emission and albedo, which are found together";
                    return Err(Error::value("volume.albedo", sizes, expected));
                }
                add(Quantity::Emission, &medium.emission, bounds.emission, of_emission)?;
                add(Quantity::Albedo(light()?), &medium.albedo, bounds.albedo, of_albedo)?;
            }
            Find::Extinction | Find::Refinement => {
                add(Quantity::Extinction, &medium.extinction, bounds.extinction, 1.0)?;
            }
            Find::Environment => {
                searched.parts.push(lit_voxels(scene, medium, optics)?);
                searched.start = optics.environment().coefficients(&scene.light_basis);
                searched.places = scene.light_basis.places();
                searched.kinds.push(ElementKind {
                    noun: "lights",
                    len: searched.start.len(),
                    size: scene.light_basis.lattice().to_vec(),
                    bounds: scene.solve.solver.kept(bounds.environment),
                    pull: 1.0,
                    pairs: scene.light_basis.pairs(),
                });
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

    /// Bounds the emission of a painted volume where its scene does not: twice the brightest emission that would show what is wanted on a row
    /// by itself, of rows that meet at least half as much medium as any. Without it, voxels at the rim glow far brighter than anything that was
    /// painted.
    ///
    /// Shapes  targets: those of the rows `kept`, whose first part is emission
    pub(super) fn bound_emission(&mut self, rows: &VolumeTraversal, kept: &[usize], targets: &[Rgb]) {
        let emission = &mut self.kinds[0];
        if emission.bounds[1].iter().any(|bound| bound.is_finite()) {
            return;
        }
        let picked = evenly(ROWS, kept.len());
        let weight = |&row: &usize| {
            let mut sum = [0.0; 3];
            rows.walk_shared(kept[row], &mut |element, weight: [f64; 3]| {
                if element < emission.len {
                    (0..3).for_each(|c| sum[c] += weight[c]);
                }
            });
            sum
        };
        let weights: Vec<[f64; 3]> = picked.par_iter().map(weight).collect();
        let start = &self.start[..emission.len];
        emission.bounds[1] = std::array::from_fn(|c| {
            let most = weights.iter().fold(0.0, |most: f64, weight| most.max(weight[c]));
            let wanted =
                picked.iter().zip(&weights).filter(|(_, weight)| weight[c] > 0.0 && weight[c] >= 0.5 * most);
            let wanted = wanted.map(|(&row, weight)| f64::from(targets[row][c]) / weight[c]);
            let start = start.iter().fold(0.0f32, |most, color| most.max(color[c]));
            (BRIGHTER * wanted.fold(0.0, f64::max)).max(f64::from(start))
        });
    }

    fn add(
        &mut self,
        (scene, optics): (&VolumeScene, &Optics),
        quantity: Quantity,
        volume: &Volume,
        bounds: [Scalars; 2],
        pull: f64,
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
        self.places.extend(voxels.indices());
        self.start.extend(voxels.indices().iter().map(|&index| volume.color(index as usize)));
        self.kinds.push(ElementKind {
            noun: "voxels",
            len: voxels.len(),
            size: grid.size().to_vec(),
            bounds: scene.solve.solver.kept(bounds),
            pull,
            pairs: Vec::new(),
        });
        self.parts.push(VoxelElements::new(quantity, grid, Arc::new(voxels), optics.density.interpolation()));
        Ok(())
    }
}

/// The voxels of a grid that a medium reaches into. Where that is the grid of the medium, they are exactly those with extinction.
pub(super) fn near_medium_exactly(density: &Density, grid: &VoxelGrid) -> VoxelSet {
    if grid == density.grid() && density.cells().size() == grid.size() {
        return density.cells().clone();
    }
    near_medium(density, grid)
}
