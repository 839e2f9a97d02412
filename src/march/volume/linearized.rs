//! How the radiance of a row changes with extinction: the rows of Gauss–Newton.

use std::ops::ControlFlow;
use std::sync::Arc;

use super::cells::{CellRay, Line};
use super::cuts::Cuts;
use super::light::Towards;
use super::sink::merged;
use super::window::{NearestVoxel, Trilinear, Visit, VoxelWindow};
use super::{GAUSS_2, GAUSS_4, InScattering, MOST_PANELS, PANEL, PixelRays, VolumeTraversal};
use crate::march::{Traversal, Weight};
use crate::scene::{Interpolation, Rgb, Volume, VoxelGrid, VoxelSet};

/// The source function S: radiance that a medium gives towards the eye per optical depth.
#[derive(Debug, Clone)]
pub enum SourceFunction {
    /// The same radiance everywhere.
    Constant(Rgb),
    /// S = L_e + ρ L_scat: emission, albedo, and the light that is scattered once; none where it is dark.
    Medium {
        /// L_e.
        emission: Arc<Volume>,
        /// ρ.
        albedo: Arc<Volume>,
        /// L_scat.
        light: Option<Arc<InScattering>>,
    },
}

/// Rows of ∂L/∂σ_t at a medium: how the radiance L of view rays changes with the extinction of voxels. The light that arrives to be
/// scattered is taken as it is.
///
/// The weight of voxel j is `∫ v_j (T_r S − R) dt`, where R(t) is what is seen from beyond t through all that is before it. More of the
/// medium adds its own light and hides what is behind. Weights have either sign, and voxels without extinction have some, too.
///
/// Shapes  rows: view rays, or one a channel of each; elements: the voxels of the part
/// Units   weights: radiance times metres
/// Law     central differences of the radiance, held by tests/suite/volume/refinement.rs
/// Error   four Gauss nodes for every half of optical depth; what lies between the nodes of the light is taken as smooth
/// Cost    two walks a row, through cells that are empty, too
#[derive(Debug, Clone)]
pub struct LinearizedTraversal {
    /// The rays through the medium; one part, extinction.
    medium: VolumeTraversal,
    source: SourceFunction,
    /// Radiance behind the medium, a row each.
    behind: Arc<[Rgb]>,
    /// The channel that each row is of. It is empty where rows are of all channels, each with an extinction of its own.
    channels: Arc<[u8]>,
    /// Cells in which there is extinction or an element.
    cells: Arc<VoxelSet>,
}

/// Nodes of a quadrature over a short piece of a ray inside one cell.
struct Panel<const C: usize> {
    cell: [usize; 3],
    start: f64,
    end: f64,
    /// t of each node, and its weight times T_r S and times T_r σ_t S.
    nodes: [(f64, Weight<f64, C>, Weight<f64, C>); 4],
}

impl LinearizedTraversal {
    /// The rows of a traversal with one part, which is extinction. `behind` is what each row sees behind the medium; `channels`
    /// are empty, or say which channel each row is of.
    pub fn new(
        medium: VolumeTraversal,
        source: SourceFunction,
        behind: impl Into<Arc<[Rgb]>>,
        channels: impl Into<Arc<[u8]>>,
    ) -> Self {
        let (behind, channels) = (behind.into(), channels.into());
        debug_assert_eq!(behind.len(), medium.rays().len());
        debug_assert!(channels.is_empty() || channels.len() == behind.len());
        let cells = Arc::new(medium.parts()[0].cells().union(medium.transport().density.cells()));
        Self { medium, source, behind, channels, cells }
    }

    /// The rays through the medium.
    pub fn medium(&self) -> &VolumeTraversal {
        &self.medium
    }

    /// Some of the rows.
    pub fn picked(&self, rows: &[usize]) -> Self {
        Self {
            medium: self.medium.along(self.medium.rays().picked(rows)),
            behind: rows.iter().map(|&row| self.behind[row]).collect(),
            channels: rows.iter().filter_map(|&row| self.channels.get(row).copied()).collect(),
            ..self.clone()
        }
    }

    /// The rays, one a row.
    pub fn rays(&self) -> &PixelRays {
        self.medium.rays()
    }

    /// Radiance of a row as its weights see it.
    pub fn radiance<const C: usize>(&self, row: usize) -> Weight<f64, C> {
        match self.medium.transport().basis {
            Interpolation::Nearest => self.radiance_with::<C, NearestVoxel<C>>(row),
            Interpolation::Trilinear => self.radiance_with::<C, Trilinear<C>>(row),
        }
    }

    fn radiance_with<const C: usize, W: VoxelWindow<C>>(&self, row: usize) -> Weight<f64, C> {
        let mut sum = [0.0; C];
        let left = self.each_panel::<C, W>(row, |_, panel| {
            for (_, _, gives) in &panel.nodes {
                (0..C).for_each(|c| sum[c] += gives[c]);
            }
        });
        let behind = self.of_row::<C>(row, self.behind[row].map(f64::from));
        std::array::from_fn(|c| sum[c] + left[c] * behind[c])
    }

    fn weights<const C: usize, W: VoxelWindow<C>>(&self, row: usize, visit: &mut Visit<C>) {
        let part = &self.medium.parts()[0];
        let mut beyond = self.radiance_with::<C, W>(row);
        let mut window = W::new(part.grid.size());
        self.each_panel::<C, W>(row, |cells, panel| {
            let Panel { cell, start, end, nodes } = panel;
            for (_, _, gives) in nodes {
                (0..C).for_each(|c| beyond[c] -= gives[c]);
            }
            // ∫ v R dt over the panel is V R at its end and ∫ V T_r σ_t S dt, with V(t) = ∫ v dt from its start.
            if W::CONSTANT {
                let weight = std::array::from_fn(|c| {
                    let own = nodes.iter().map(|(t, own, gives)| own[c] - (t - start) * gives[c]);
                    own.sum::<f64>() - (end - start) * beyond[c]
                });
                return window.sample(*cell, [0.0; 3], weight, visit);
            }
            let mut take = |to: f64, weight: Weight<f64, C>| {
                for [u, share] in GAUSS_2 {
                    let length = to - start;
                    let weight = weight.map(|weight| -share * length * weight);
                    window.sample(*cell, cells.at(start + u * length), weight, visit);
                }
            };
            nodes.iter().for_each(|(t, _, gives)| take(*t, *gives));
            take(*end, beyond);
            for (t, own, _) in nodes {
                window.sample(*cell, cells.at(*t), *own, visit);
            }
        });
        window.finish(visit);
    }

    /// Visits the panels of a row in order, with the ray in cells; returns what is left of light at its end.
    fn each_panel<const C: usize, W: VoxelWindow<C>>(
        &self,
        row: usize,
        mut visit: impl FnMut(&CellRay, &Panel<C>),
    ) -> Weight<f64, C> {
        let transport = self.medium.transport();
        let density = &*transport.density;
        let (grid, bound) = (density.grid(), transport.transmittance_bound);
        let mut strength = [1.0; C];
        self.medium.each_line(row, |line, a, b| {
            let cells = CellRay::new(line, grid, W::SHIFT);
            let high = grid.size().map(|side| side as f64 + W::SHIFT);
            let Some([a, b]) = cells.clip(W::SHIFT, high, a, b) else { return true };
            let along = Along::new(&self.source, transport.basis, grid, line, [a, b]);
            let goes_on = cells.pieces(&self.cells, a, b, |cell, a, b| {
                let depth = density.depth::<C>(cell, &cells, a, b);
                let length = b - a;
                along.cuts.parts(a, b, |start, end| {
                    let from = (start - a) / length;
                    let to = if end == b { 1.0 } else { (end - a) / length };
                    let (before, after) = (depth.at(from), depth.at(to));
                    let slopes = [from, 0.5 * (from + to), to].map(|u| depth.slope(u));
                    let steepest = slopes.as_flattened().iter().copied().fold(0.0, f64::max) * (to - from);
                    let deepest = (0..C).fold(steepest, |most: f64, c| most.max(after[c] - before[c]));
                    let panels = (deepest / PANEL).ceil().clamp(1.0, MOST_PANELS);
                    let width = (to - from) / panels;
                    for panel in 0..panels as u32 {
                        let start = from + f64::from(panel) * width;
                        let left = depth.at(start);
                        if (0..C).all(|c| strength[c] * (-left[c]).exp() <= bound) {
                            break;
                        }
                        let node = |[node, weight]: [f64; 2]| {
                            let u = start + node * width;
                            let (tau, slope, t) = (depth.at(u), depth.slope(u), a + u * length);
                            let source = self.of_row::<C>(row, along.at(t));
                            let own: Weight<f64, C> = std::array::from_fn(|c| {
                                weight * width * strength[c] * (-tau[c]).exp() * source[c]
                            });
                            let gives = std::array::from_fn(|c| own[c] * slope[c].max(0.0));
                            (t, own.map(|own| own * length), gives)
                        };
                        let [start, end] = [start, start + width].map(|u| a + u * length);
                        visit(&cells, &Panel { cell, start, end, nodes: GAUSS_4.map(node) });
                    }
                });
                let tau = depth.at(1.0);
                (0..C).for_each(|c| strength[c] *= (-tau[c]).exp());
                match strength.iter().any(|&left| left > bound) {
                    true => ControlFlow::Continue(()),
                    false => ControlFlow::Break(()),
                }
            });
            goes_on.is_continue()
        });
        strength
    }

    /// The channels of a colour that a row is of.
    #[inline(always)]
    fn of_row<const C: usize>(&self, row: usize, color: [f64; 3]) -> Weight<f64, C> {
        match self.channels.get(row) {
            Some(&channel) => [color[usize::from(channel)]; C],
            None => std::array::from_fn(|c| color[c]),
        }
    }
}

impl<const C: usize> Traversal<f64, C> for LinearizedTraversal {
    fn rows(&self) -> usize {
        self.behind.len()
    }

    fn row_order(&self) -> Option<Vec<u32>> {
        Some(self.rays().row_order())
    }

    fn elements(&self) -> usize {
        Traversal::<f64, C>::elements(&self.medium)
    }

    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f64, C>)) {
        let transport = self.medium.transport();
        let voxels = self.medium.parts()[0].voxels();
        let mut visit = |voxel, weight| {
            if let Some(number) = voxels.number(voxel) {
                visit(number as usize, weight);
            }
        };
        // A bent ray may come back to a voxel.
        let mut seen = Vec::new();
        let comes_back = transport.refraction.is_some();
        let mut keep_or_visit = |voxel, weight| match comes_back {
            true => seen.push((voxel, weight)),
            false => visit(voxel, weight),
        };
        match transport.basis {
            Interpolation::Nearest => self.weights::<C, NearestVoxel<C>>(row, &mut keep_or_visit),
            Interpolation::Trilinear => self.weights::<C, Trilinear<C>>(row, &mut keep_or_visit),
        }
        merged(seen, &mut visit);
    }
}

/// S along a line.
struct Along<'a> {
    constant: [f64; 3],
    emission: Option<Property<'a>>,
    /// Albedo, and the light that it scatters.
    scattered: Option<(Property<'a>, Vec<Towards<'a>>)>,
    /// Where a property on a grid of its own, or light, goes from one cell to the next.
    cuts: Cuts,
}

/// A volume along a line.
struct Property<'a> {
    volume: &'a Volume,
    basis: Interpolation,
    ray: CellRay,
}

impl<'a> Along<'a> {
    fn new(
        source: &'a SourceFunction,
        basis: Interpolation,
        medium: &VoxelGrid,
        line: &Line,
        ends: [f64; 2],
    ) -> Self {
        let mut along = Self { constant: [0.0; 3], emission: None, scattered: None, cuts: Cuts::default() };
        let property =
            |volume: &'a Arc<Volume>| Property { volume, basis, ray: CellRay::new(line, volume.grid(), 0.0) };
        match source {
            SourceFunction::Constant(radiance) => along.constant = radiance.map(f64::from),
            SourceFunction::Medium { emission, albedo, light } => {
                if emission.range() != [0.0; 2] {
                    along.emission = Some(property(emission));
                }
                if let Some(light) = light.as_ref().filter(|_| albedo.range() != [0.0; 2]) {
                    along.scattered = Some((property(albedo), light.along(line)));
                }
                let mine = along.emission.iter().chain(along.scattered.iter().map(|(albedo, _)| albedo));
                let properties = mine.map(|property| (property.volume.grid(), basis));
                let light = along.scattered.iter().flat_map(|(_, light)| light);
                let light = light.map(|source| (source.grid(), Interpolation::Trilinear));
                let others = properties.chain(light).filter(|&other| other != (medium, basis));
                along.cuts = Cuts::of(line, ends, others);
            }
        }
        along
    }

    fn at(&self, t: f64) -> [f64; 3] {
        let mut sum = self.constant;
        if let Some(emission) = &self.emission {
            let emitted = emission.at(t);
            (0..3).for_each(|c| sum[c] += emitted[c]);
        }
        if let Some((albedo, light)) = &self.scattered {
            let albedo = albedo.at(t);
            for source in light {
                let radiance = source.at(t);
                (0..3).for_each(|c| sum[c] += albedo[c] * radiance[c]);
            }
        }
        sum
    }
}

impl Property<'_> {
    fn at(&self, t: f64) -> [f64; 3] {
        let at = self.ray.at(t);
        let color = match self.basis {
            Interpolation::Trilinear => self.volume.interpolated(at),
            Interpolation::Nearest => {
                let size = self.volume.grid().size();
                let voxel = std::array::from_fn(|axis| (at[axis] as usize).min(size[axis] - 1));
                self.volume.color(self.volume.grid().index(voxel))
            }
        };
        color.map(f64::from)
    }
}
