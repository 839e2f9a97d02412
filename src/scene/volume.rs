use glam::{DAffine3, DVec3};
use half::f16;

use crate::{Error, Result};

/// A box of voxels in the world. Voxel (i, j, k) has index `(k · height + j) · width + i`: x runs fastest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VoxelGrid {
    size: [usize; 3],
    world_from_grid: DAffine3,
    grid_from_world: DAffine3,
}

impl VoxelGrid {
    /// Voxels a side at most.
    pub const MAX_SIDE: usize = 4096;
    /// Voxels at most, so that 32 bits number them.
    pub const MAX_VOXELS: usize = 1 << 31;

    /// A grid of `size` voxels (x, y, z). `world_from_grid` takes positions in voxels to metres: (0, 0, 0) is the outer
    /// corner of the first voxel, (0.5, 0.5, 0.5) its centre. It may rotate, mirror, shear and scale.
    ///
    /// Errors: [`Error::Value`] for a side of 0 or above 4096, more than 2³¹ voxels, or a transform that is singular or not
    /// finite.
    pub fn new(size: [usize; 3], world_from_grid: DAffine3) -> Result<Self> {
        if size.iter().any(|&side| side == 0 || side > Self::MAX_SIDE) {
            return Err(Error::value("size", format!("{size:?}"), "three whole numbers from 1 to 4096"));
        }
        if size.iter().product::<usize>() > Self::MAX_VOXELS {
            return Err(Error::value("size", format!("{size:?}"), "at most 2147483648 voxels"));
        }
        let m = world_from_grid.matrix3;
        let volume = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
        let grid_from_world = world_from_grid.inverse();
        let regular = m.determinant().abs() > 1e-9 * volume && volume > 0.0;
        if !(world_from_grid.is_finite() && grid_from_world.is_finite() && regular) {
            return Err(Error::value("to_world", "a singular transform", "invertible, with finite numbers"));
        }
        Ok(Self { size, world_from_grid, grid_from_world })
    }

    /// A grid over the unit cube moved into the world by `world_from_cube`.
    ///
    /// Errors: as [`VoxelGrid::new`].
    pub fn over_cube(size: [usize; 3], world_from_cube: DAffine3) -> Result<Self> {
        let sides = DVec3::from_array(size.map(|side| side.max(1) as f64));
        Self::new(size, world_from_cube * DAffine3::from_scale(sides.recip()))
    }

    /// Voxels along x, y and z.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// The number of voxels.
    pub fn len(&self) -> usize {
        self.size.iter().product()
    }

    /// Never: a grid has at least one voxel.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Metres of a position in voxels.
    pub fn world_from_grid(&self) -> &DAffine3 {
        &self.world_from_grid
    }

    /// Position in voxels of a point in metres.
    pub fn grid_from_world(&self) -> &DAffine3 {
        &self.grid_from_world
    }

    /// The world from the unit cube that the grid fills.
    pub fn world_from_cube(&self) -> DAffine3 {
        self.world_from_grid * DAffine3::from_scale(DVec3::from_array(self.size.map(|side| side as f64)))
    }

    /// The index of voxel (i, j, k).
    #[inline(always)]
    pub fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        (k * self.size[1] + j) * self.size[0] + i
    }

    /// The voxel of an index.
    pub fn voxel(&self, index: usize) -> [usize; 3] {
        let [width, height, _] = self.size;
        [index % width, index / width % height, index / width / height]
    }

    /// The centre of a voxel in metres.
    pub fn centre(&self, voxel: [usize; 3]) -> DVec3 {
        self.world_from_grid.transform_point3(DVec3::from_array(voxel.map(|i| i as f64 + 0.5)))
    }

    /// The eight corners of the grid in metres.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|corner| {
            let side = |axis: usize| if corner >> axis & 1 == 1 { self.size[axis] as f64 } else { 0.0 };
            self.world_from_grid.transform_point3(DVec3::new(side(0), side(1), side(2)))
        })
    }
}

/// Interpolation between the values of a volume, and the basis of a volume that is looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Interpolation {
    /// Constant in each voxel.
    #[default]
    Nearest,
    /// Trilinear between voxel centres, constant beyond the outermost ones.
    Trilinear,
}

impl Interpolation {
    /// How far its cells are shifted against the voxels, and how many more there are a side.
    pub fn cells(self) -> (f64, usize) {
        match self {
            Self::Nearest => (0.0, 0),
            Self::Trilinear => (0.5, 1),
        }
    }
}

/// Numbers of a volume, in 32 or 16 bits.
#[derive(Debug, Clone, PartialEq)]
pub enum Samples {
    /// Single precision.
    F32(Vec<f32>),
    /// Half precision: half the memory, three decimal digits, at most 65504.
    F16(Vec<f16>),
}

impl Samples {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(values) => values.len(),
            Self::F16(values) => values.len(),
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes that they take.
    pub fn bytes(&self) -> usize {
        match self {
            Self::F32(values) => size_of_val(&values[..]),
            Self::F16(values) => size_of_val(&values[..]),
        }
    }

    /// One of them; panics outside, like a slice.
    #[inline(always)]
    pub fn get(&self, index: usize) -> f32 {
        match self {
            Self::F32(values) => values[index],
            Self::F16(values) => values[index].to_f32(),
        }
    }

    /// All of them in order.
    pub fn iter(&self) -> impl Iterator<Item = f32> + '_ {
        (0..self.len()).map(|index| self.get(index))
    }
}

/// Values at the centres of voxels: one number each (grey), or three (RGB).
///
/// In NumPy's order the shape is (z, y, x, channel).
#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    grid: VoxelGrid,
    channels: usize,
    samples: Samples,
}

impl Volume {
    /// Errors: [`Error::Shape`] when there are not `channels` samples a voxel, [`Error::Value`] for another number of
    /// channels than 1 or 3, [`Error::NonFinite`] naming a voxel.
    pub fn new(grid: VoxelGrid, channels: usize, samples: Samples) -> Result<Self> {
        if channels != 1 && channels != 3 {
            return Err(Error::value("channels", channels, "1 (grey) or 3 (RGB)"));
        }
        let expected = grid.len() * channels;
        if samples.len() != expected {
            return Err(Error::Shape { what: "a volume", expected, got: samples.len() });
        }
        if let Some(index) = samples.iter().position(|value| !value.is_finite()) {
            let [i, j, k] = grid.voxel(index / channels);
            let place = format!("voxel ({i}, {j}, {k})");
            return Err(Error::NonFinite { what: "a volume".to_owned(), place });
        }
        Ok(Self { grid, channels, samples })
    }

    /// A volume with the same colour everywhere: grey where its channels are equal.
    ///
    /// Errors: as [`Volume::new`].
    pub fn constant(grid: VoxelGrid, [r, g, b]: [f32; 3]) -> Result<Self> {
        if r == g && g == b {
            return Self::new(grid, 1, Samples::F32(vec![r; grid.len()]));
        }
        Self::new(grid, 3, Samples::F32([r, g, b].repeat(grid.len())))
    }

    /// A volume of colours, one a voxel; grey where every colour is.
    ///
    /// Errors: as [`Volume::new`].
    pub fn of_colors(grid: VoxelGrid, colors: &[[f32; 3]]) -> Result<Self> {
        if colors.iter().all(|[r, g, b]| r == g && g == b) {
            return Self::new(grid, 1, Samples::F32(colors.iter().map(|color| color[0]).collect()));
        }
        Self::new(grid, 3, Samples::F32(colors.as_flattened().to_vec()))
    }

    /// Where the voxels are.
    pub fn grid(&self) -> &VoxelGrid {
        &self.grid
    }

    /// 1 for grey, 3 for RGB.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// The numbers, voxel by voxel.
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// The colour at a position in voxels, trilinear between centres and constant beyond the outermost ones.
    #[inline]
    pub fn interpolated(&self, at: [f64; 3]) -> [f32; 3] {
        let size = self.grid.size;
        let mut corner = [0; 3];
        let mut fraction = [0.0f32; 3];
        for axis in 0..3 {
            let x = (at[axis] - 0.5).clamp(0.0, (size[axis] - 1) as f64);
            corner[axis] = (x as usize).min(size[axis].saturating_sub(2));
            fraction[axis] = (x - corner[axis] as f64) as f32;
        }
        let mut sum = [0.0; 3];
        for tap in 0..8 {
            let mut part = 1.0;
            let voxel = std::array::from_fn(|axis| {
                let high = tap >> axis & 1;
                part *= if high == 1 { fraction[axis] } else { 1.0 - fraction[axis] };
                (corner[axis] + high).min(size[axis] - 1)
            });
            if part > 0.0 {
                let color = self.color(self.grid.index(voxel));
                (0..3).for_each(|c| sum[c] += part * color[c]);
            }
        }
        sum
    }

    /// The same values elsewhere.
    ///
    /// Errors: [`Error::Shape`] when the grid has another number of voxels.
    pub fn placed(self, grid: VoxelGrid) -> Result<Self> {
        if grid.len() != self.grid.len() {
            return Err(Error::Shape { what: "a volume", expected: self.grid.len(), got: grid.len() });
        }
        Ok(Self { grid, ..self })
    }

    /// The colour of the voxel with an index.
    #[inline(always)]
    pub fn color(&self, index: usize) -> [f32; 3] {
        match self.channels {
            1 => [self.samples.get(index); 3],
            _ => std::array::from_fn(|c| self.samples.get(3 * index + c)),
        }
    }

    /// The colour that every voxel has, if there is one.
    pub fn uniform(&self) -> Option<[f32; 3]> {
        let first = self.color(0);
        (0..self.grid.len()).all(|index| self.color(index) == first).then_some(first)
    }

    /// The same with every number mapped, in 32 bits.
    ///
    /// Errors: [`Error::NonFinite`] where a number no longer is finite.
    pub fn map(&self, of: impl Fn(f32) -> f32) -> Result<Self> {
        Self::new(self.grid, self.channels, Samples::F32(self.samples.iter().map(of).collect()))
    }

    /// The same in half precision.
    ///
    /// Errors: [`Error::NonFinite`] where a number is beyond its range.
    pub fn halved(&self) -> Result<Self> {
        let samples = Samples::F16(self.samples.iter().map(f16::from_f32).collect());
        Self::new(self.grid, self.channels, samples)
    }

    /// Least and largest number.
    pub fn range(&self) -> [f32; 2] {
        self.samples
            .iter()
            .fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_and_voxels_are_inverse_and_x_runs_fastest() -> Result<()> {
        let grid = VoxelGrid::new([3, 4, 5], DAffine3::IDENTITY)?;
        assert_eq!((grid.index([1, 0, 0]), grid.index([0, 1, 0]), grid.index([0, 0, 1])), (1, 3, 12));
        assert!((0..grid.len()).all(|index| grid.index(grid.voxel(index)) == index));
        Ok(())
    }

    #[test]
    fn a_grid_over_a_cube_fills_it() -> Result<()> {
        let cube = DAffine3::from_scale_rotation_translation(
            DVec3::new(2.0, 3.0, 4.0),
            glam::DQuat::from_rotation_y(0.7),
            DVec3::new(1.0, -2.0, 0.5),
        );
        let grid = VoxelGrid::over_cube([2, 3, 8], cube)?;
        assert!((grid.corners()[7] - cube.transform_point3(DVec3::ONE)).length() < 1e-12);
        assert!(grid.world_from_cube().abs_diff_eq(cube, 1e-12));
        let centre = grid.centre([1, 1, 4]);
        let expected = cube.transform_point3(DVec3::new(0.75, 0.5, 4.5 / 8.0));
        assert!((centre - expected).length() < 1e-12);
        Ok(())
    }

    #[test]
    fn a_uniform_volume_has_one_colour() -> Result<()> {
        let grid = VoxelGrid::new([3, 2, 2], DAffine3::IDENTITY)?;
        let mut colors = vec![[0.5, 0.25, 1.0]; grid.len()];
        assert_eq!(Volume::of_colors(grid, &colors)?.uniform(), Some(colors[0]));
        colors[7][1] = 0.3;
        assert_eq!(Volume::of_colors(grid, &colors)?.uniform(), None);
        Ok(())
    }

    #[test]
    fn volumes_that_make_no_sense_are_refused() -> Result<()> {
        assert!(VoxelGrid::new([0, 1, 1], DAffine3::IDENTITY).is_err());
        assert!(VoxelGrid::new([4096, 4096, 4096], DAffine3::IDENTITY).is_err());
        assert!(VoxelGrid::new([1, 1, 1], DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0))).is_err());
        let grid = VoxelGrid::new([2, 1, 1], DAffine3::IDENTITY)?;
        assert!(Volume::new(grid, 1, Samples::F32(vec![0.0; 3])).is_err());
        assert!(Volume::new(grid, 2, Samples::F32(vec![0.0; 4])).is_err());
        let broken = Volume::new(grid, 1, Samples::F32(vec![0.0, f32::NAN]));
        assert!(matches!(broken, Err(Error::NonFinite { place, .. }) if place == "voxel (1, 0, 0)"));
        assert!(Volume::new(grid, 1, Samples::F32(vec![0.0, 1e5]))?.halved().is_err());
        Ok(())
    }
}
