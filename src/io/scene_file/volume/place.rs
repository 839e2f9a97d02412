//! Where the properties of a volume lie, and how a file that lies elsewhere comes into the box of the volume.

use glam::{DAffine3, DMat3, DVec3, I64Vec3};
use rayon::prelude::*;

use crate::io::scene_file::assets::Assets;
use crate::io::scene_file::flaw::{Built, Flaw};
use crate::io::volume::Stored;
use crate::scene::{Interpolation, Samples, Volume, VoxelGrid};
use crate::{Error, Result};

/// How far voxels that are taken for the same ones may lie apart, in voxels.
const SAME_VOXEL: f64 = 1e-3;

/// The box of a volume, and how files are brought into it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    /// Where the unit cube that the voxels fill stands.
    pub(super) world_from_cube: DAffine3,
    /// The scene from the world that files speak of.
    scene_from_files: DAffine3,
    /// Between voxels of a file that are not those of the volume.
    interpolation: Interpolation,
}

impl Place {
    /// The box is where `to_world` puts it, else where the files of `extinction` say, else where another file says, else
    /// the unit cube. What `to_world` does to the files of extinction it does to all.
    pub(super) fn new(
        to_world: Option<DAffine3>,
        extinction: Option<&VoxelGrid>,
        other: Option<&VoxelGrid>,
        interpolation: Interpolation,
    ) -> Self {
        let of_files = extinction.map(VoxelGrid::world_from_cube);
        let (world_from_cube, scene_from_files) = match (to_world, of_files) {
            (Some(place), Some(of_files)) => (place, place * of_files.inverse()),
            (Some(place), None) => (place, DAffine3::IDENTITY),
            (None, Some(of_files)) => (of_files, DAffine3::IDENTITY),
            (None, None) => {
                (other.map_or(DAffine3::IDENTITY, VoxelGrid::world_from_cube), DAffine3::IDENTITY)
            }
        };
        Self { world_from_cube, scene_from_files, interpolation }
    }

    /// The voxels of a file that fills the box, or of all `frames` together.
    pub(super) fn voxels(&self, stored: &Stored, frames: Option<&VoxelGrid>) -> Result<VoxelGrid> {
        let own = stored.volume.grid();
        match frames.unwrap_or(own) {
            // Nothing is rounded where nothing is moved.
            all if stored.placed && self.scene_from_files == DAffine3::IDENTITY => Ok(*all),
            all if stored.placed => VoxelGrid::over_cube(all.size(), self.world_from_cube),
            _ => VoxelGrid::over_cube(own.size(), self.world_from_cube),
        }
    }

    /// What a file holds, in the box that `voxels` fill: on its own voxels where these fill the box, too, or would if
    /// there were more or fewer of them; else on `voxels`, interpolated. What does not say where it lies fills the box.
    ///
    /// Errors: a flaw where the file lies outside of the box; [`Error::TooLarge`].
    pub(super) fn put(&self, stored: Stored, voxels: &VoxelGrid, assets: &Assets) -> Built<Volume> {
        let Stored { volume, placed, outside, .. } = stored;
        let filling = |size| match size == voxels.size() {
            true => Ok(*voxels),
            false => VoxelGrid::over_cube(size, self.world_from_cube),
        };
        let own = *volume.grid();
        if !placed {
            return Ok(volume.placed(filling(own.size())?)?);
        }
        let own_from_scene = *own.grid_from_world() * self.scene_from_files.inverse();
        let (grid, own_from_grid, interpolation) =
            match on_own_voxels(&(own_from_scene * self.world_from_cube)) {
                Some((size, first)) if size == own.size() && first == DVec3::ZERO => {
                    return Ok(volume.placed(filling(size)?)?);
                }
                Some((size, first)) => {
                    (filling(size)?, DAffine3::from_translation(first), Interpolation::Nearest)
                }
                None => (*voxels, own_from_scene * *voxels.world_from_grid(), self.interpolation),
            };
        check_overlap(&grid, &own, &own_from_grid)?;
        let bytes = size_of::<f32>() * volume.channels() * grid.len();
        assets.allow("what a file holds in the box of the volume", bytes as u64)?;
        Ok(resampled(&volume, grid, &own_from_grid, interpolation, outside)?)
    }
}

/// How many voxels of a file the box has a side, and the first of them, where they fill it without a rest.
fn on_own_voxels(own_from_cube: &DAffine3) -> Option<([usize; 3], DVec3)> {
    let m = own_from_cube.matrix3;
    let sides = DVec3::new(m.x_axis.x, m.y_axis.y, m.z_axis.z).round();
    let first = own_from_cube.translation.round();
    let whole = DAffine3 { matrix3: DMat3::from_diagonal(sides), translation: first };
    let is_whole = corners(DVec3::ONE).iter().all(|&corner| {
        let apart = own_from_cube.transform_point3(corner) - whole.transform_point3(corner);
        apart.abs().max_element() < SAME_VOXEL
    });
    let in_range = sides.min_element() >= 1.0 && sides.max_element() <= VoxelGrid::MAX_SIDE as f64;
    (is_whole && in_range).then(|| (sides.to_array().map(|side| side as usize), first))
}

fn corners(extent: DVec3) -> [DVec3; 8] {
    std::array::from_fn(|corner| {
        let side = |axis: usize| if corner >> axis & 1 == 1 { extent[axis] } else { 0.0 };
        DVec3::new(side(0), side(1), side(2))
    })
}

fn extent(grid: &VoxelGrid) -> DVec3 {
    DVec3::from_array(grid.size().map(|side| side as f64))
}

/// The least box around the corners of a grid, seen from another.
fn bounds(grid: &VoxelGrid, other_from_grid: &DAffine3) -> [DVec3; 2] {
    let corners = corners(extent(grid)).map(|corner| other_from_grid.transform_point3(corner));
    corners.into_iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[least, greatest], corner| {
        [least.min(corner), greatest.max(corner)]
    })
}

fn check_overlap(grid: &VoxelGrid, own: &VoxelGrid, own_from_grid: &DAffine3) -> Built<()> {
    let [least, greatest] = bounds(grid, own_from_grid);
    if greatest.cmpgt(DVec3::ZERO).all() && least.cmplt(extent(own)).all() {
        return Ok(());
    }
    let shown = |[least, greatest]: [DVec3; 2]| format!("from {least:.3} to {greatest:.3}");
    let volume = shown(bounds(grid, grid.world_from_grid()));
    let file = shown(bounds(own, &(*grid.world_from_grid() * own_from_grid.inverse())));
    let remedy = "move the file, or save it as .npy, which fills the box";
    Err(Flaw::new("", format!("it lies {file}, outside of the box of the volume {volume}; {remedy}")))
}

/// The values at the centres of other voxels.
fn resampled(
    volume: &Volume,
    grid: VoxelGrid,
    own_from_grid: &DAffine3,
    interpolation: Interpolation,
    outside: [f32; 3],
) -> Result<Volume> {
    let (size, channels) =
        (I64Vec3::from_array(volume.grid().size().map(|side| side as i64)), volume.channels());
    let value = |voxel: I64Vec3| match voxel.cmpge(I64Vec3::ZERO).all() && voxel.cmplt(size).all() {
        true => volume.color(volume.grid().index(voxel.to_array().map(|side| side as usize))),
        false => outside,
    };
    let between = |p: DVec3| {
        let corner = (p - 0.5).floor();
        let share = p - 0.5 - corner;
        let mut sum = [0.0; 3];
        for tap in 0..8 {
            let high = I64Vec3::new(tap & 1, tap >> 1 & 1, tap >> 2);
            let part: f64 =
                (0..3).map(|axis| if high[axis] == 1 { share[axis] } else { 1.0 - share[axis] }).product();
            if part > 0.0 {
                let color = value(corner.as_i64vec3() + high);
                (0..3).for_each(|c| sum[c] += part * f64::from(color[c]));
            }
        }
        sum.map(|sum| sum as f32)
    };
    let [width, height, _] = grid.size();
    let mut samples = vec![0.0; grid.len() * channels];
    samples.par_chunks_mut(width * channels).enumerate().for_each(|(row, numbers)| {
        for (i, numbers) in numbers.chunks_mut(channels).enumerate() {
            let centre = DVec3::new(i as f64, (row % height) as f64, (row / height) as f64) + 0.5;
            let p = own_from_grid.transform_point3(centre);
            let color = match interpolation {
                Interpolation::Nearest => value(p.floor().as_i64vec3()),
                Interpolation::Trilinear => between(p),
            };
            numbers.iter_mut().zip(color).for_each(|(number, color)| *number = color);
        }
    });
    Volume::new(grid, channels, Samples::F32(samples))
}

/// The least grid on the lattice of the first that holds both.
///
/// Errors: [`Error::TooLarge`].
pub(super) fn around(first: &VoxelGrid, other: &VoxelGrid) -> Result<VoxelGrid> {
    let [least, greatest] = bounds(other, &(*first.grid_from_world() * *other.world_from_grid()));
    let least = (least + SAME_VOXEL).floor().min(DVec3::ZERO);
    let size = (greatest - SAME_VOXEL).ceil().max(extent(first)) - least;
    if size.max_element() > VoxelGrid::MAX_SIDE as f64 {
        let [x, y, z] = size.to_array();
        return Err(Error::TooLarge {
            what: "the box around the extinction of all frames".to_owned(),
            needed: format!("{x} × {y} × {z} voxels"),
            limit: format!("{} a side", VoxelGrid::MAX_SIDE),
            remedy: "crop or resample the files",
        });
    }
    let world_from_grid = *first.world_from_grid() * DAffine3::from_translation(least);
    VoxelGrid::new(size.to_array().map(|side| side as usize), world_from_grid)
}
