//! What wanted pixels ask of the unknowns: their radiance without all that is known.

use std::sync::Arc;

use super::extinction::log_row;
use super::renderer::carried;
use super::{Desired, Optics, SeenLights};
use crate::cpu::near_medium;
use crate::march::{Quantity, VolumeTraversal, VoxelElements};
use crate::scene::{Find, Rgb, Volume, VolumeMedium, VolumeScene, VoxelSet, luminance};

/// What one wanted pixel becomes.
#[derive(Debug, Clone, Copy)]
pub(super) enum PixelRow {
    /// `shown` is what the row should show, all told, in the unit of the target.
    Kept {
        target: Rgb,
        weight: Rgb,
        shown: Rgb,
    },
    Beside,
    NoLogarithm,
}

/// Radiance of a row that does not change with what is looked for.
pub(super) struct Fixed<'a> {
    scene: &'a VolumeScene,
    optics: &'a Optics,
    find: Find,
    /// The quantities that are known, with their values; and the voxels outside the elements of the quantities that are looked for.
    known: Vec<(VoxelElements, Arc<Volume>, Option<Arc<VoxelSet>>)>,
    /// The brightest background, in whose unit noise is measured.
    scale: f64,
}

impl<'a> Fixed<'a> {
    pub(super) fn new(
        scene: &'a VolumeScene,
        medium: &'a VolumeMedium,
        optics: &'a Optics,
        (parts, outside_hull): (&[VoxelElements], usize),
        find: Find,
    ) -> Self {
        let mut known = Vec::new();
        let mut add = |quantity: Quantity, volume: &Arc<Volume>| {
            if volume.range() == [0.0; 2] {
                return;
            }
            let elements = parts
                .iter()
                .find(|part| std::mem::discriminant(&part.quantity) == std::mem::discriminant(&quantity));
            let all = near_medium(&optics.density, volume.grid());
            let elements = elements.map(|part| Arc::new(part.voxels().clone()));
            // Where all that has any weight is an element, nothing of it is known.
            if elements.is_some() && outside_hull == 0 {
                return;
            }
            let part =
                VoxelElements::new(quantity, *volume.grid(), Arc::new(all), optics.density.interpolation());
            known.push((part, volume.clone(), elements));
        };
        if is_of_extinction(find) {
            add(Quantity::Extinction, &medium.extinction);
        } else {
            add(Quantity::Emission, &medium.emission);
            let light = if find == Find::Environment { &optics.suns } else { &optics.light };
            if let Some(light) = light {
                add(Quantity::Albedo(light.clone()), &medium.albedo);
            }
        }
        let brightest = |color: Rgb| color.into_iter().fold(0.0, f32::max);
        let behind = scene.background.map_or(optics.environment().brightest(), brightest);
        let scale = f64::from(behind.max(brightest(scene.extinction.medium_radiance)));
        Self { scene, optics, find, known, scale: if scale > 0.0 { scale } else { 1.0 } }
    }

    /// What a row gets from what is known.
    fn known(&self, traversal: &VolumeTraversal, row: usize) -> [f64; 3] {
        let mut fixed = [0.0; 3];
        for (part, volume, elements) in &self.known {
            let (carried, _) = carried(traversal, row, part, &|voxel| match elements {
                Some(elements) if elements.contains(voxel) => [0.0; 3],
                _ => volume.color(part.grid.index(voxel)),
            });
            (0..3).for_each(|c| fixed[c] += carried[c]);
        }
        fixed
    }

    /// What a wanted pixel becomes. `seen` has the lights that the row sees, where lights are looked for.
    pub(super) fn row(
        &self,
        traversal: &VolumeTraversal,
        seen: Option<&SeenLights>,
        row: usize,
        [r, g, b, weight]: [f32; 4],
    ) -> PixelRow {
        let wanted = [r, g, b];
        let sees_lights = || seen.is_some_and(|seen| seen.sees(row));
        if !traversal.has_weights(row) && !sees_lights() {
            return PixelRow::Beside;
        }
        let behind = match self.find {
            Find::Environment => self.optics.known_background(self.scene, traversal.rays(), row),
            _ => self.optics.background(self.scene, traversal.rays(), row),
        };
        if is_of_extinction(self.find) {
            let settings = &self.scene.extinction;
            let medium = settings.medium_radiance;
            let around = (self.find == Find::Refinement).then(|| traversal.transmittance(row));
            let log = log_row(wanted, behind, medium, weight, self.scale, settings.is_grey, around);
            let Some(log) = log else { return PixelRow::NoLogarithm };
            let fixed = self.known(traversal, row);
            let target = std::array::from_fn(|c| (f64::from(log.depth[c]) - fixed[c]) as f32);
            return PixelRow::Kept { target, weight: log.weight, shown: log.shown };
        }
        let mut fixed = self.known(traversal, row);
        if luminance(behind) > 0.0 {
            let transmittance = traversal.transmittance(row);
            (0..3).for_each(|c| fixed[c] += transmittance[c] * f64::from(behind[c]));
        }
        let target = std::array::from_fn(|c| (f64::from(wanted[c]) - fixed[c]) as f32);
        PixelRow::Kept { target, weight: [weight; 3], shown: wanted }
    }
}

fn is_of_extinction(find: Find) -> bool {
    matches!(find, Find::Extinction | Find::Refinement)
}

/// The pixels of which something is wanted, view by view, and the number of the others. Where none is to be skipped, they are all
/// pixels.
///
/// Squares of 8 × 8 neighbours stand together: their rays meet the same voxels.
pub(super) fn wanted_pixels(scene: &VolumeScene, desired: &[Desired]) -> (Vec<[u32; 2]>, usize) {
    const SIDE: usize = 8;
    let mut pixels = Vec::new();
    let mut all = 0;
    for (view, desired) in desired.iter().enumerate() {
        let [width, height] = scene.views[view].view.camera.size();
        all += width * height;
        for (top, left) in
            (0..height).step_by(SIDE).flat_map(|y| (0..width).step_by(SIDE).map(move |x| (y, x)))
        {
            for y in top..(top + SIDE).min(height) {
                for x in left..(left + SIDE).min(width) {
                    let pixel = y * width + x;
                    if desired.pixels[pixel][3] > 0.0 || !scene.solve.skip.pixels {
                        pixels.push([view as u32, pixel as u32]);
                    }
                }
            }
        }
    }
    let unwanted = all - pixels.len();
    (pixels, unwanted)
}
