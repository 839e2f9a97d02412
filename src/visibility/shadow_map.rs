use std::sync::Arc;

use glam::DVec2;
use rayon::prelude::*;

use super::{Geometry, Pane};
use crate::scene::{Grid, LightFrame, Mesh, Ray, Rgb, rgb};
use crate::{Error, Result};

/// Depth of the first surface along a directional light, with a min-max pyramid over it.
///
/// A point is lit when its depth along the light is at most the depth stored for its texel; outside the
/// map everything is lit. The pyramid is that of Chen et al. 2011, here in two dimensions.
///
/// Where the first surface is a pane, light reaches what is behind it, too, coloured by it: that is kept beside ([`Behind`]).
#[derive(Debug, Clone)]
pub struct ShadowMap {
    grid: Grid,
    /// Depths are stored relative to this depth in the light's frame, so that f32 keeps them exact to the texel.
    depth_origin: f64,
    /// From the texels (level 0) up to a single node.
    levels: Vec<Level>,
    /// What is behind panes; none where there are none.
    behind: Option<Arc<Behind>>,
}

/// What light that has passed panes reaches.
#[derive(Debug, Clone)]
pub struct Behind {
    /// Depths of the first solid surfaces.
    solid: ShadowMap,
    /// Where the panes of each texel begin in `panes`; one more at the end.
    offsets: Vec<u32>,
    /// Of each texel in the order of their depth, with what has passed them and those before.
    panes: Vec<PaneDepth>,
    /// Texels with more panes than are told apart.
    crowded: usize,
}

/// A pane in a texel of a shadow map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PaneDepth {
    /// In metres relative to the map's depth origin.
    pub depth: f32,
    /// What passes of light, a share a channel.
    pub passes: Rgb,
}

impl Behind {
    /// Panes one behind the other that are told apart in a texel. Those beyond colour light at the depth of the last one.
    pub const MOST_PANES: usize = 16;

    /// The depths of the first solid surfaces, as if there were no panes.
    #[inline]
    pub fn solid(&self) -> &ShadowMap {
        &self.solid
    }

    /// The panes of texel (i, j) in the order of their depth, each with what passes it and those before.
    #[inline]
    pub fn panes(&self, i: usize, j: usize) -> &[PaneDepth] {
        let texel = j * self.solid.grid.size[0] + i;
        &self.panes[self.offsets[texel] as usize..self.offsets[texel + 1] as usize]
    }

    /// Texels with more panes than are told apart.
    pub fn crowded(&self) -> usize {
        self.crowded
    }
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
    const TEXEL: usize = 15;

    /// The same of a scene of triangles, which may have panes: two of them in every texel, if there are any.
    pub fn bytes_a_texel(mesh: &Mesh) -> usize {
        let has_panes = mesh.materials.iter().any(|material| material.glass.is_some());
        let behind = Self::TEXEL + size_of::<u32>() + 2 * size_of::<PaneDepth>();
        Self::TEXEL + if has_panes { behind } else { 0 }
    }

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
        Ok(Self { grid, depth_origin, levels, behind: None })
    }

    /// The same map with panes before its surfaces: texels, in increasing order, with the panes of each in any order.
    ///
    /// Errors: [`Error::Value`] for a texel that is not there or out of order, or a depth that is a NaN.
    pub fn with_panes(self, panes: Vec<(usize, Vec<PaneDepth>)>) -> Result<Self> {
        let texels = self.grid.len();
        let mut behind =
            Behind { offsets: Vec::with_capacity(texels + 1), panes: Vec::new(), crowded: 0, solid: self };
        let mut depths: Vec<f32> = behind.solid.levels[0].ranges.iter().map(|range| range[0]).collect();
        for (texel, mut column) in panes {
            if texel < behind.offsets.len() || texel >= texels || column.iter().any(|it| it.depth.is_nan()) {
                return Err(Error::value(
                    "panes",
                    texel,
                    "texels of the map in increasing order, with depths",
                ));
            }
            behind.offsets.resize(texel + 1, behind.panes.len() as u32);
            column.sort_by(|a, b| a.depth.total_cmp(&b.depth));
            column.retain(|pane| pane.depth < depths[texel]);
            behind.crowded += usize::from(column.len() > Behind::MOST_PANES);
            let first = behind.panes.len();
            for (number, pane) in column.iter().enumerate() {
                let before = behind.panes[first..].last().map_or([1.0; 3], |pane: &PaneDepth| pane.passes);
                let passes = rgb(|c| before[c] * pane.passes[c]);
                match number < Behind::MOST_PANES {
                    true => behind.panes.push(PaneDepth { depth: pane.depth, passes }),
                    false => behind.panes[first + Behind::MOST_PANES - 1].passes = passes,
                }
            }
            depths[texel] = behind.panes.get(first).map_or(depths[texel], |pane| pane.depth);
        }
        behind.offsets.resize(texels + 1, behind.panes.len() as u32);
        if behind.panes.is_empty() {
            return Ok(behind.solid);
        }
        let first = Self::new(behind.solid.grid, behind.solid.depth_origin, &depths)?;
        Ok(Self { behind: Some(Arc::new(behind)), ..first })
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

    /// The same, where `distance` finds how far the first solid surface is along the ray of a texel, given the texel's index.
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
        let ray =
            |index: usize| Self::ray(frame, grid.centre(index % grid.size[0], index / grid.size[0]), start);
        let depth = |index| distance(index, &ray(index)).map_or(f32::INFINITY, |distance| distance as f32);
        let depths: Vec<f32> = (0..grid.len()).into_par_iter().map(depth).collect();
        Self::new(grid, start, &depths)?.with_panes_of(geometry, frame)
    }

    /// The ray of the light through a place of its plane, from a depth on.
    pub(super) fn ray(frame: &LightFrame, on_plane: DVec2, depth: f64) -> Ray {
        let direction = frame.world_from_light(glam::DVec3::Z);
        Ray { origin: frame.world_from_light(on_plane.extend(depth)), direction }
    }

    /// The same map, with the panes of a scene before its solid surfaces.
    ///
    /// Errors: as [`ShadowMap::new`].
    pub(super) fn with_panes_of(self, geometry: &Geometry, frame: &LightFrame) -> Result<Self> {
        if !geometry.has_panes() {
            return Ok(self);
        }
        let width = self.grid.size[0];
        let panes = |index: usize| {
            let (i, j) = (index % width, index / width);
            let ray = Self::ray(frame, self.grid.centre(i, j), self.depth_origin);
            let panes = geometry.panes(&ray, f64::from(self.depth(i, j)));
            let depth = |pane: &Pane| PaneDepth { depth: pane.distance as f32, passes: pane.transmittance };
            (!panes.is_empty()).then(|| (index, panes.iter().map(depth).collect()))
        };
        let panes = (0..self.grid.len()).into_par_iter().filter_map(panes).collect();
        self.with_panes(panes)
    }

    /// Depths of the first solid surfaces, row by row.
    pub(super) fn solid_depths(&self) -> Vec<f32> {
        let solid = self.behind().map_or(self, Behind::solid);
        solid.levels[0].ranges.iter().map(|range| range[0]).collect()
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
        Self { grid: Grid { size: [1, 1], ..grid }, depth_origin: 0.0, levels: vec![top], behind: None }
    }

    /// The same without its pyramid: nothing is known of a node, so that walks descend to every texel.
    pub fn without_pyramid(mut self) -> Self {
        let unknown = [f32::NEG_INFINITY, f32::INFINITY];
        self.levels.iter_mut().skip(1).for_each(|level| level.ranges.fill(unknown));
        self.behind = self.behind.map(|behind| {
            let solid = behind.solid.clone().without_pyramid();
            Arc::new(Behind { solid, ..(*behind).clone() })
        });
        self
    }

    /// The same with panes that let nothing through.
    pub fn with_solid_panes(mut self) -> Self {
        self.behind = None;
        self
    }

    /// What is behind panes; none where there are none.
    #[inline]
    pub fn behind(&self) -> Option<&Behind> {
        self.behind.as_deref()
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

    /// The stored depth of texel (i, j), that of a pane or of a solid surface; panics outside the map, like a slice.
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

    /// Whether a point of the light's frame is lit, through panes or not.
    pub fn is_lit(&self, point: glam::DVec3) -> bool {
        self.light_at(point) != [0.0; 3]
    }

    /// What of the light reaches a point of the light's frame, a share a channel: the law that traversals are tested against.
    pub fn light_at(&self, point: glam::DVec3) -> Rgb {
        let p = self.grid.grid_from_light(DVec2::new(point.x, point.y)).floor();
        let size = DVec2::new(self.grid.size[0] as f64, self.grid.size[1] as f64);
        if p.cmplt(DVec2::ZERO).any() || p.cmpge(size).any() {
            return [1.0; 3];
        }
        let ([i, j], depth) = ([p.x as usize, p.y as usize], point.z - self.depth_origin);
        if depth <= f64::from(self.depth(i, j)) {
            return [1.0; 3];
        }
        match self.behind() {
            Some(behind) if depth <= f64::from(behind.solid.depth(i, j)) => {
                let passed = behind.panes(i, j).iter().take_while(|pane| f64::from(pane.depth) < depth);
                passed.last().map_or([1.0; 3], |pane| pane.passes)
            }
            _ => [0.0; 3],
        }
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
