use rayon::prelude::*;

use super::optics::{Optics, open_rays};
use crate::Result;
use crate::cpu::near_medium;
#[cfg(feature = "gpu")]
use crate::gpu::{Gpu, Walked};
use crate::march::{PixelRays, Quantity, VolumeTraversal, VoxelElements, channel};
#[cfg(feature = "gpu")]
use crate::operator::{LinearOperator, brought, fetched};
use crate::problem::Canvas;
#[cfg(feature = "gpu")]
use crate::problem::canvas::where_it_can;
use crate::scene::{Camera, Image, Rgb, Volume, VolumeMedium, VolumeScene};
use std::sync::Arc;

/// How the radiance of a medium is computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Model {
    /// Emission, and light scattered once (Klehm 2015, eq. 7.2).
    SingleScattering,
    /// A radiance that is the same everywhere and in all directions, for which extinction can be found (eq. 7.11).
    Constant(Rgb),
}

/// Draws pictures of a medium with the traversal that problems are made of.
#[derive(Debug)]
pub struct VolumeRenderer<'a> {
    scene: &'a VolumeScene,
    medium: &'a VolumeMedium,
    optics: &'a Optics,
    model: Model,
    /// The elements of emission and albedo, with their values, as far as there is any.
    carried: Vec<(VoxelElements, Arc<Volume>)>,
}

impl<'a> VolumeRenderer<'a> {
    /// Pictures of a medium under the light of a scene.
    pub fn new(scene: &'a VolumeScene, medium: &'a VolumeMedium, optics: &'a Optics, model: Model) -> Self {
        let mut carried = Vec::new();
        if model == Model::SingleScattering {
            let part = |quantity, volume: &Arc<Volume>| {
                let voxels = near_medium(&optics.density, volume.grid());
                (
                    VoxelElements::new(quantity, *volume.grid(), Arc::new(voxels), medium.interpolation),
                    volume.clone(),
                )
            };
            if medium.emission.range() != [0.0; 2] {
                carried.push(part(Quantity::Emission, &medium.emission));
            }
            if let Some(light) = &optics.light
                && medium.albedo.range() != [0.0; 2]
            {
                carried.push(part(Quantity::Albedo(light.clone()), &medium.albedo));
            }
        }
        Self { scene, medium, optics, model, carried }
    }

    /// The whole picture of a view.
    ///
    /// Errors: [`crate::Error::NonFinite`] naming a pixel; those of an adapter.
    pub fn picture(&self, view: usize, canvas: &Canvas) -> Result<Image> {
        let size = self.scene.views[view].view.camera.size();
        let pixels: Vec<[u32; 2]> =
            (0..(size[0] * size[1]) as u32).map(|pixel| [view as u32, pixel]).collect();
        self.draw(&self.scene.views[view].view.name, open_rays(self.scene, &pixels), size, canvas)
    }

    /// The whole picture of a camera that is none of the scene's views.
    ///
    /// Errors: as [`Self::picture`].
    pub fn picture_from(&self, camera: &Camera, canvas: &Canvas) -> Result<Image> {
        let size = camera.size();
        // Views of the scene have pictures behind them; this one has not.
        let nobody = u32::MAX;
        let pixels: Vec<[u32; 2]> = (0..(size[0] * size[1]) as u32).map(|pixel| [nobody, pixel]).collect();
        self.draw("the turned picture", PixelRays::seen_by_one(camera.clone(), pixels), size, canvas)
    }

    fn draw(&self, what: &str, rays: PixelRays, size: [usize; 2], canvas: &Canvas) -> Result<Image> {
        let lengths = self.optics.lengths(&rays);
        let traversal = self.traversal(rays.until(lengths.into()));
        let drawn = match canvas {
            Canvas::Processor => None,
            #[cfg(feature = "gpu")]
            Canvas::Adapter(gpu) => where_it_can(self.drawn_on(gpu, &traversal))?,
        };
        let here =
            || (0..size[0] * size[1]).into_par_iter().map(|row| self.radiance(&traversal, row)).collect();
        Image::new(size, drawn.unwrap_or_else(here))?.finite(what)
    }

    /// What an adapter makes of the rows: what the medium emits and scatters, and what it lets through, which is what a medium of radiance
    /// 1 lacks.
    ///
    /// Errors: as [`Walked::pixels_of_volume`].
    #[cfg(feature = "gpu")]
    fn drawn_on(&self, gpu: &Gpu, traversal: &VolumeTraversal) -> Result<Vec<Rgb>> {
        let grid = *self.optics.density.grid();
        let near = Arc::new(near_medium(&self.optics.density, &grid));
        let glowing = VoxelElements::new(Quantity::Emission, grid, near, self.medium.interpolation);
        let ones = vec![[1.0; 3]; glowing.voxels().len()];
        let product = |parts: Vec<VoxelElements>, x: &[Rgb]| -> Result<Vec<Rgb>> {
            let colored = parts.iter().any(|part| !is_grey(traversal, part));
            let walked = Walked::pixels_of_volume(gpu, &traversal.over(parts), colored)?;
            let mut y = walked.range();
            walked.apply(&brought(walked.domain(), x)?, &mut y)?;
            fetched(&y)
        };
        let blocked = product(vec![glowing], &ones)?;
        let shines = match self.carried.is_empty() {
            true => vec![[0.0; 3]; blocked.len()],
            false => {
                let values = |(part, volume): &(VoxelElements, Arc<Volume>)| {
                    let voxels = part.voxels().voxels();
                    voxels.map(|voxel| volume.color(part.grid.index(voxel))).collect::<Vec<_>>()
                };
                let x: Vec<Rgb> = self.carried.iter().flat_map(values).collect();
                product(self.carried.iter().map(|(part, _)| part.clone()).collect(), &x)?
            }
        };
        let constant = self.constant();
        let row = |row: usize| {
            let behind = self.optics.background(self.scene, traversal.rays(), row);
            std::array::from_fn(|c| shines[row][c] + behind[c] + blocked[row][c] * (constant[c] - behind[c]))
        };
        Ok((0..blocked.len()).into_par_iter().map(row).collect())
    }

    /// A radiance that is the same everywhere in the medium.
    fn constant(&self) -> Rgb {
        match self.model {
            Model::Constant(radiance) => radiance,
            Model::SingleScattering => [0.0; 3],
        }
    }

    /// The rows of some rays through the medium.
    pub fn traversal(&self, rays: PixelRays) -> VolumeTraversal {
        VolumeTraversal::new(self.optics.transport(self.scene, self.medium), rays, Vec::new())
    }

    /// Radiance of a row of such a traversal.
    pub fn radiance(&self, traversal: &VolumeTraversal, row: usize) -> Rgb {
        let behind = self.optics.background(self.scene, traversal.rays(), row);
        let (mut sum, mut transmittance) = ([0.0; 3], None);
        for (part, volume) in &self.carried {
            let (carried, left) =
                carried(traversal, row, part, &|voxel| volume.color(part.grid.index(voxel)));
            transmittance = Some(left);
            (0..3).for_each(|c| sum[c] += carried[c]);
        }
        // Whoever has walked the medium knows what is left of light behind it.
        let transmittance = transmittance.unwrap_or_else(|| traversal.transmittance(row));
        let constant = self.constant();
        std::array::from_fn(|c| {
            let medium = (1.0 - transmittance[c]) * f64::from(constant[c]);
            (sum[c] + transmittance[c] * f64::from(behind[c]) + medium) as f32
        })
    }
}

/// Σ w x of one row over the voxels of a part, for values x that the caller gives; and the transmittance at the end of the row.
pub(super) fn carried(
    traversal: &VolumeTraversal,
    row: usize,
    part: &VoxelElements,
    value: &dyn Fn([usize; 3]) -> Rgb,
) -> ([f64; 3], [f64; 3]) {
    fn sum<const C: usize>(
        traversal: &VolumeTraversal,
        row: usize,
        part: &VoxelElements,
        value: &dyn Fn([usize; 3]) -> Rgb,
    ) -> ([f64; 3], [f64; 3]) {
        let mut sum = [0.0; 3];
        let left = traversal.trace::<C>(row, part, &mut |voxel, weight| {
            let value = value(voxel);
            (0..3).for_each(|c| sum[c] += channel(&weight, c) * f64::from(value[c]));
        });
        (sum, std::array::from_fn(|c| channel(&left, c)))
    }
    if is_grey(traversal, part) {
        sum::<1>(traversal, row, part, value)
    } else {
        sum::<3>(traversal, row, part, value)
    }
}

/// Whether one weight serves all channels of a part.
pub(super) fn is_grey(traversal: &VolumeTraversal, part: &VoxelElements) -> bool {
    match &part.quantity {
        Quantity::Extinction => true,
        Quantity::Emission => traversal.transport().density.is_grey(),
        Quantity::Albedo(light) => traversal.transport().density.is_grey() && light.is_grey(),
        Quantity::InScattered(albedo) => traversal.transport().density.is_grey() && albedo.channels() == 1,
    }
}
