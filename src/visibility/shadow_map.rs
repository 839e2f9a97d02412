use glam::DVec2;
use rayon::prelude::*;

use super::Geometry;
use crate::scene::{Grid, LightFrame, Ray};
use crate::{Error, Result};

/// Depth of the first surface along a directional light, with a min-max pyramid over it.
///
/// A point is lit when its depth along the light is at most the depth stored for its texel; outside the
/// map everything is lit. The pyramid is that of Chen et al. 2011, here in two dimensions.
#[derive(Debug, Clone)]
pub struct ShadowMap {
    grid: Grid,
    /// Depths are stored relative to this depth in the light's frame, so that f32 keeps them exact to the texel.
    depth_origin: f64,
    /// From the texels (level 0) up to a single node.
    levels: Vec<Level>,
}

/// One level of the pyramid: node (i, j) covers 2^level texels a side.
#[derive(Debug, Clone)]
struct Level {
    size: [usize; 2],
    /// Least and largest depth in each node, row by row.
    ranges: Vec<[f32; 2]>,
}

impl ShadowMap {
    /// Bytes a texel: 4 for its depth while it is rendered, 8 for its range, a third of 8 for the pyramid.
    pub const TEXEL: usize = 15;

    /// From depths in metres relative to `depth_origin`, row by row; infinite where nothing blocks the light.
    ///
    /// Errors: [`Error::Shape`] for a wrong number of depths, [`Error::NonFinite`] for a NaN.
    pub fn new(grid: Grid, depth_origin: f64, depths: &[f32]) -> Result<Self> {
        if depths.len() != grid.len() {
            return Err(Error::Shape { what: "a shadow map", expected: grid.len(), got: depths.len() });
        }
        if let Some(index) = depths.iter().position(|z| z.is_nan()) {
            let place = format!("texel ({}, {})", index % grid.size[0], index / grid.size[0]);
            return Err(Error::NonFinite { what: "the shadow map".to_owned(), place });
        }
        let mut levels = vec![Level { size: grid.size, ranges: depths.iter().map(|&z| [z, z]).collect() }];
        while let Some(coarser) = levels.last().and_then(Level::halved) {
            levels.push(coarser);
        }
        Ok(Self { grid, depth_origin, levels })
    }

    /// The first surface behind each texel centre, seen along `frame`.
    ///
    /// Cost: one ray a texel.
    /// Errors: as [`ShadowMap::new`].
    pub fn render(geometry: &Geometry, frame: &LightFrame, grid: Grid) -> Result<Self> {
        Self::render_by(geometry, frame, grid, |_, ray| {
            geometry.first_hit(ray, f64::INFINITY).map(|hit| hit.distance)
        })
    }

    /// The same, where `distance` finds how far the first surface is along the ray of a texel, given the texel's index.
    ///
    /// Units   distance: metres; none where there is no surface
    /// Errors: as [`ShadowMap::new`].
    pub fn render_by(
        geometry: &Geometry,
        frame: &LightFrame,
        grid: Grid,
        distance: impl Fn(usize, &Ray) -> Option<f64> + Sync,
    ) -> Result<Self> {
        // A ray does not see what it starts on, so it starts before everything.
        let start = geometry.depths(frame).map_or(0.0, |[nearest, farthest]| {
            let before = 1e-3 * (farthest - nearest) + 1e-6 * nearest.abs();
            // All of it lies in the plane through the origin: any length will do.
            nearest - if before > 0.0 { before } else { 1.0 }
        });
        let direction = frame.world_from_light(glam::DVec3::Z);
        let depths: Vec<f32> = (0..grid.len())
            .into_par_iter()
            .map(|index| {
                let on_plane = grid.centre(index % grid.size[0], index / grid.size[0]);
                let ray = Ray { origin: frame.world_from_light(on_plane.extend(start)), direction };
                distance(index, &ray).map_or(f32::INFINITY, |distance| distance as f32)
            })
            .collect();
        Self::new(grid, start, &depths)
    }

    /// A map through which light passes where `passes` is true, whatever the depth, and nowhere else.
    ///
    /// Errors: [`Error::Shape`] for a wrong number of texels.
    pub fn mask(grid: Grid, passes: &[bool]) -> Result<Self> {
        let depth = |&passes: &bool| if passes { f32::INFINITY } else { f32::NEG_INFINITY };
        Self::new(grid, 0.0, &passes.iter().map(depth).collect::<Vec<f32>>())
    }

    /// A map that blocks nothing.
    pub fn open(grid: Grid) -> Self {
        let top = Level { size: [1, 1], ranges: vec![[f32::INFINITY; 2]] };
        Self { grid: Grid { size: [1, 1], ..grid }, depth_origin: 0.0, levels: vec![top] }
    }

    /// The same without its pyramid: nothing is known of a node, so that walks descend to every texel.
    pub fn without_pyramid(mut self) -> Self {
        let unknown = [f32::NEG_INFINITY, f32::INFINITY];
        self.levels.iter_mut().skip(1).for_each(|level| level.ranges.fill(unknown));
        self
    }

    /// Where its texels lie.
    #[inline]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The depth in the light's frame that stored depths are relative to, in metres.
    #[inline]
    pub fn depth_origin(&self) -> f64 {
        self.depth_origin
    }

    /// The stored depth of texel (i, j); panics outside the map, like a slice.
    pub fn depth(&self, i: usize, j: usize) -> f32 {
        self.range(0, i, j)[0]
    }

    /// The number of levels above the texels.
    #[inline]
    pub fn top(&self) -> usize {
        self.levels.len() - 1
    }

    /// Least and largest depth in node (i, j) of a level; indices beyond the level are those of its last node.
    #[inline]
    pub fn range(&self, level: usize, i: usize, j: usize) -> [f32; 2] {
        let level = &self.levels[level];
        level.ranges[j.min(level.size[1] - 1) * level.size[0] + i.min(level.size[0] - 1)]
    }

    /// Whether a point of the light's frame is lit: the law that traversals are tested against.
    pub fn is_lit(&self, point: glam::DVec3) -> bool {
        let p = self.grid.grid_from_light(DVec2::new(point.x, point.y)).floor();
        let size = DVec2::new(self.grid.size[0] as f64, self.grid.size[1] as f64);
        if p.cmplt(DVec2::ZERO).any() || p.cmpge(size).any() {
            return true;
        }
        point.z - self.depth_origin <= f64::from(self.depth(p.x as usize, p.y as usize))
    }
}

impl Level {
    /// The next coarser level; none above a single node.
    fn halved(&self) -> Option<Self> {
        if self.size == [1, 1] {
            return None;
        }
        let [width, height] = self.size.map(|side| side.div_ceil(2));
        let mut ranges = vec![[f32::INFINITY, f32::NEG_INFINITY]; width * height];
        for (j, row) in self.ranges.chunks_exact(self.size[0]).enumerate() {
            for (i, &[least, largest]) in row.iter().enumerate() {
                let node = &mut ranges[j / 2 * width + i / 2];
                *node = [node[0].min(least), node[1].max(largest)];
            }
        }
        Some(Self { size: [width, height], ranges })
    }
}
