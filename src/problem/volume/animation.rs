//! From key frames to all frames: what was found spreads into empty space, and neighbouring keys are blended (Klehm 2015,
//! sec. 7.5.1).

use std::sync::Arc;

use super::searched::near_medium_exactly;
use super::{VolumeProblem, VolumeRows, VolumeState};
use crate::cpu::near_medium;
use crate::march::{Density, Quantity};
use crate::problem::{Known, diffuse};
use crate::scene::{Interpolation, Rgb, Samples, Volume, VolumeMedium, VoxelGrid, VoxelSet, mixed};
use crate::solve::Limits;
use crate::{Error, Result};

/// The most steps, and the part of its start that the Laplacian falls to: less than f32 can tell from zero.
const LIMITS: (usize, f64) = (5000, 1e-8);

/// A property that is spread into empty space.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spreading {
    /// Emission.
    Emission,
    /// Albedo.
    Albedo,
}

impl Spreading {
    fn of(self, medium: &VolumeMedium) -> &Arc<Volume> {
        match self {
            Self::Emission => &medium.emission,
            Self::Albedo => &medium.albedo,
        }
    }
}

/// The voxels of a property that a solve has found.
#[derive(Debug, Clone)]
pub struct Determined {
    /// Which property.
    pub property: Spreading,
    /// Those that wanted rays reach.
    pub reached: VoxelSet,
    /// Those with extinction outside the visual hull: nothing was looked for there, and they stay as they are.
    pub outside_hull: VoxelSet,
}

impl Determined {
    /// The voxels that a problem has determined, property by property, given the elements that rows reach. There are none for the
    /// environment, and none for extinction, which is zero wherever it was not found.
    pub fn by(problem: &VolumeProblem, reached: &[u32]) -> Vec<Self> {
        let VolumeRows::Voxels(traversal) = &problem.traversal else { return Vec::new() };
        let places = problem.all_places();
        let (mut element, mut place) = (0, 0);
        let mut determined = Vec::new();
        for part in traversal.parts() {
            let (elements, voxels) = (element..element + part.voxels().len(), part.grid.len());
            let mut is_reached = vec![false; voxels];
            let mine = reached.iter().filter(|&&column| elements.contains(&(column as usize)));
            mine.for_each(|&column| is_reached[places[column as usize] as usize - place] = true);
            (element, place) = (elements.end, place + voxels);
            let property = match part.quantity {
                Quantity::Emission => Spreading::Emission,
                Quantity::Albedo(_) => Spreading::Albedo,
                Quantity::Extinction | Quantity::InScattered(_) => continue,
            };
            let outside = match problem.outside_hull {
                0 => part.grid.set(|_| false),
                _ => {
                    let near = near_medium_exactly(&traversal.transport().density, &part.grid);
                    part.grid.set(|index| {
                        let voxel = part.grid.voxel(index);
                        near.contains(voxel) && !part.voxels().contains(voxel)
                    })
                }
            };
            let reached = part.grid.set(|index| is_reached[index]);
            determined.push(Self { property, reached, outside_hull: outside });
        }
        determined
    }
}

/// Where there is extinction in any of some frames.
#[derive(Debug, Clone)]
pub struct Occupied {
    grid: VoxelGrid,
    is_occupied: Vec<bool>,
}

impl Occupied {
    /// In some voxels of a grid.
    pub fn at(grid: VoxelGrid, voxels: &VoxelSet) -> Self {
        let mut is_occupied = vec![false; grid.len()];
        voxels.indices().iter().for_each(|&index| is_occupied[index as usize] = true);
        Self { grid, is_occupied }
    }

    /// In how many voxels.
    pub fn len(&self) -> usize {
        self.is_occupied.iter().filter(|&&is_occupied| is_occupied).count()
    }

    /// Whether in none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds a frame.
    ///
    /// Errors: [`Error::Shape`] for another number of voxels.
    pub fn add(&mut self, extinction: &Volume) -> Result<()> {
        if extinction.grid().len() != self.grid.len() {
            let (expected, got) = (self.grid.len(), extinction.grid().len());
            return Err(Error::Shape { what: "the extinction of a frame", expected, got });
        }
        for (index, is_occupied) in self.is_occupied.iter_mut().enumerate() {
            *is_occupied |= extinction.color(index).iter().any(|&sigma_t| sigma_t > 0.0);
        }
        Ok(())
    }

    /// The voxels of a grid that matter to a picture of any of the frames.
    ///
    /// Errors: [`Error::Shape`] and [`Error::NonFinite`], as [`Volume::new`].
    pub fn near(&self, grid: &VoxelGrid, interpolation: Interpolation) -> Result<VoxelSet> {
        let ones = self.is_occupied.iter().map(|&is_occupied| f32::from(u8::from(is_occupied))).collect();
        let volume = Volume::new(self.grid, 1, Samples::F32(ones))?;
        Ok(near_medium(&Density::new(Arc::new(volume), interpolation), grid))
    }
}

/// How much was spread.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Spread {
    /// Voxels that were filled from others, of all properties together.
    pub voxels: usize,
    /// Steps of conjugate gradients.
    pub iterations: usize,
}

impl VolumeState {
    /// The state with what was found spread to where any frame has extinction, by diffusion; voxels that were found keep their
    /// values.
    ///
    /// Errors: those of [`diffuse`].
    pub fn spread(&self, determined: &[Determined], occupied: &Occupied) -> Result<(Self, Spread)> {
        let (mut spread, mut much) = (self.clone(), Spread::default());
        for determined in determined {
            let volume = determined.property.of(&self.medium);
            let near = occupied.near(volume.grid(), self.medium.interpolation)?;
            let (volume, more) = spread_into(volume, determined, &near)?;
            much =
                Spread { voxels: much.voxels + more.voxels, iterations: much.iterations + more.iterations };
            match determined.property {
                Spreading::Emission => spread.medium.emission = Arc::new(volume),
                Spreading::Albedo => spread.medium.albedo = Arc::new(volume),
            }
        }
        Ok((spread, much))
    }

    /// The state a `share` of the way to another: every voxel of every property, and every light, on the straight line between
    /// the two.
    ///
    /// Errors: [`Error::Shape`] for volumes of different size.
    pub fn blended(&self, other: &Self, share: f64) -> Result<Self> {
        let (mine, theirs) = (&self.medium, &other.medium);
        Ok(Self {
            medium: VolumeMedium {
                extinction: between(&mine.extinction, &theirs.extinction, share)?,
                albedo: between(&mine.albedo, &theirs.albedo, share)?,
                emission: between(&mine.emission, &theirs.emission, share)?,
                ..mine.clone()
            },
            environment: self.environment.blended(&other.environment, share)?,
        })
    }
}

/// A volume in which the voxels of `near` that were not found are filled from those that were.
fn spread_into(volume: &Volume, determined: &Determined, near: &VoxelSet) -> Result<(Volume, Spread)> {
    let grid = volume.grid();
    let mut colors: Vec<Rgb> = (0..grid.len()).map(|index| volume.color(index)).collect();
    let (mut known, mut empty) = (Vec::new(), Vec::new());
    for index in 0..grid.len() {
        let voxel = grid.voxel(index);
        if determined.reached.contains(voxel) {
            known.push(index as u32);
        } else if near.contains(voxel) && !determined.outside_hull.contains(voxel) {
            empty.push(index as u32);
        }
    }
    let found: Vec<Rgb> = known.iter().map(|&index| colors[index as usize]).collect();
    let known = Known { places: &known, colors: &found };
    let diffused = diffuse::<f64>(&grid.size(), &known, &empty, &Limits::new(LIMITS.0, LIMITS.1))?;
    empty.iter().zip(diffused.colors).for_each(|(&index, color)| colors[index as usize] = color);
    let much = Spread { voxels: empty.len(), iterations: diffused.iterations };
    Ok((Volume::of_colors(*grid, &colors)?, much))
}

/// A volume between two; one of them where they are the same.
fn between(from: &Arc<Volume>, to: &Arc<Volume>, share: f64) -> Result<Arc<Volume>> {
    if share == 0.0 || Arc::ptr_eq(from, to) {
        return Ok(from.clone());
    }
    let (voxels, others) = (from.grid().len(), to.grid().len());
    if voxels != others {
        return Err(Error::Shape { what: "what is blended", expected: voxels, got: others });
    }
    let colors: Vec<Rgb> =
        (0..voxels).map(|index| mixed(&from.color(index), &to.color(index), share)).collect();
    Volume::of_colors(*from.grid(), &colors).map(Arc::new)
}
