//! Which voxels can be seen where something should be seen.

use rayon::prelude::*;

use crate::scene::{Camera, VolumeScene, VoxelGrid, VoxelSet};
use crate::{Error, Result};

/// The voxels of a grid that no mask excludes: those whose picture touches the mask in every view that has one, or lies
/// outside that view (Ihrke and Magnor 2004; Klehm 2015, sec. 7.4.2). It is never too small: a voxel stands for the ball
/// around it.
///
/// None where no view has a mask, or the scene does not want it.
///
/// Errors: [`Error::Empty`] when nothing is left.
pub(super) fn visual_hull(scene: &VolumeScene, grid: &VoxelGrid) -> Result<Option<VoxelSet>> {
    let masks: Vec<Silhouette> = scene
        .views
        .iter()
        .filter_map(|view| Some(Silhouette::new(&view.view.camera, view.mask.as_deref()?)))
        .collect();
    if masks.is_empty() || !scene.hull {
        return Ok(None);
    }
    let voxel_radius = 0.5 * voxel_diagonal(grid);
    let kept: Vec<bool> = (0..grid.len())
        .into_par_iter()
        .map(|index| {
            let centre = grid.centre(grid.voxel(index));
            masks.iter().all(|mask| mask.touches(centre, voxel_radius))
        })
        .collect();
    let hull = grid.set(|index| kept[index]);
    if hull.is_empty() {
        return Err(Error::Empty {
            reason: "the visual hull of the masks is empty: no voxel is seen inside all of them".to_owned(),
            remedy: "check that masks are white where the volume is and belong to their views, or set hull to false",
        });
    }
    Ok(Some(hull))
}

/// The longest diagonal of a voxel in metres.
fn voxel_diagonal(grid: &VoxelGrid) -> f64 {
    let m = grid.world_from_grid().matrix3;
    [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]]
        .into_iter()
        .map(|[y, z]| (m.x_axis + m.y_axis * y + m.z_axis * z).length())
        .fold(0.0, f64::max)
}

/// A mask that knows how many of its pixels are set in any rectangle.
struct Silhouette<'a> {
    camera: &'a Camera,
    /// Set pixels above and to the left, one more a side.
    sums: Vec<u32>,
}

impl<'a> Silhouette<'a> {
    fn new(camera: &'a Camera, mask: &[bool]) -> Self {
        let [width, height] = camera.size();
        let mut sums = vec![0; (width + 1) * (height + 1)];
        for y in 0..height {
            let mut row = 0;
            for x in 0..width {
                row += u32::from(mask[y * width + x]);
                sums[(y + 1) * (width + 1) + x + 1] = sums[y * (width + 1) + x + 1] + row;
            }
        }
        Self { camera, sums }
    }

    /// Whether the picture of a ball touches the mask, or may lie outside the picture.
    fn touches(&self, centre: glam::DVec3, radius: f64) -> bool {
        let distance = (centre - self.camera.position()).length();
        // A ball around the eye is seen everywhere.
        let Some(p) = self.camera.project(centre).filter(|_| distance > 2.0 * radius) else { return true };
        let [width, height] = self.camera.size();
        let pixels = self.camera.pixels_across(radius / (distance - radius));
        let (low, high) = (p - pixels, p + pixels);
        if low.x < 0.0 || low.y < 0.0 || high.x > width as f64 || high.y > height as f64 {
            // Some of it is beyond the rim, where nothing is known of it.
            return true;
        }
        let (x0, y0) = (low.x as usize, low.y as usize);
        let (x1, y1) = ((high.x.ceil() as usize).min(width), (high.y.ceil() as usize).min(height));
        let at = |x: usize, y: usize| self.sums[y * (width + 1) + x];
        at(x1, y1) + at(x0, y0) > at(x0, y1) + at(x1, y0)
    }
}
