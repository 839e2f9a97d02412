//! The traversal of view rays through volumes.

mod batch;
mod blocks;
mod cells;
mod cuts;
mod density;
mod elements;
mod lengths;
mod light;
mod linearized;
mod nodes;
mod path;
mod quadrature;
mod sink;
mod steps;
mod walked;
mod window;

use std::ops::ControlFlow;
use std::sync::Arc;

pub use density::Density;
pub use elements::{Quantity, VoxelElements};
pub use light::{InScattering, LitVolume};
pub use linearized::{LinearizedTraversal, SourceFunction};
pub use path::{PixelRays, Refraction};

use super::{Real, Traversal, Weight, exponential};
use crate::scene::{Interpolation, Quadrature, VoxelGrid};
use batch::InCells;
pub(crate) use cells::{CellRay, Line};
use cuts::Cuts;
use lengths::{lengths, march_lengths};
use quadrature::nodes;
pub use quadrature::{GAUSS_2, GAUSS_4, MOST_PANELS, PANEL};
use sink::{LitSink, ScatteredSink, Sink, merged};
use steps::each_step;
use window::{NearestVoxel, Trilinear, Visit, VoxelWindow};

/// What all rays of a volume problem share.
#[derive(Debug, Clone)]
pub struct VolumeTransport {
    /// The medium that attenuates. [`Quantity::Extinction`] does not use it.
    pub density: Arc<Density>,
    /// What lies between the values of the unknown.
    pub basis: Interpolation,
    /// How the integral is taken. The steps of a march are as many as fit the diagonal of the grid.
    pub quadrature: Quadrature,
    /// Transmittance at which the rest of a ray is skipped; inside (0, 1).
    pub transmittance_bound: f64,
    /// The relative error of T x that is allowed where rows are walked anew.
    pub accuracy: f64,
    /// What bends the rays, if anything does.
    pub refraction: Option<Arc<Refraction>>,
}

/// Rows of a volume problem: one a view ray; elements: voxels, quantity after quantity, brick by brick.
///
/// Shapes  rows: view rays; elements: the voxels of all parts
/// Units   weights: dimensionless for emission, radiance for albedo, metres for extinction
/// Law     each element comes at most once a row; emission's row sums are 1 − T_r, extinction's the length inside
/// Source  Klehm 2015, eq. 7.4, 7.6, 7.8, 7.13; cells after Amanatides and Woo 1987
/// Cost    one cell after the other in bricks that are not empty
#[derive(Debug, Clone)]
pub struct VolumeTraversal {
    transport: VolumeTransport,
    rays: PixelRays,
    parts: Vec<VoxelElements>,
}

impl VolumeTraversal {
    /// The rows of `rays` over the elements of `parts`.
    pub fn new(transport: VolumeTransport, rays: PixelRays, parts: Vec<VoxelElements>) -> Self {
        Self { transport, rays, parts }
    }

    /// The rays, one a row.
    pub fn rays(&self) -> &PixelRays {
        &self.rays
    }

    /// What the rays share.
    pub fn transport(&self) -> &VolumeTransport {
        &self.transport
    }

    /// The quantities that are looked for.
    pub fn parts(&self) -> &[VoxelElements] {
        &self.parts
    }

    /// The same rows over other elements.
    pub fn over(&self, parts: Vec<VoxelElements>) -> Self {
        Self { parts, ..self.clone() }
    }

    /// The same elements seen along other rays.
    pub fn along(&self, rays: PixelRays) -> Self {
        Self { rays, ..self.clone() }
    }

    /// Transmittance a channel from the eye to the end of a row.
    pub fn transmittance(&self, row: usize) -> [f64; 3] {
        let mut tau = [0.0; 3];
        self.each_line(row, |line, a, b| {
            let along = self.transport.density.depth_between(line, a, b);
            (0..3).for_each(|c| tau[c] += along[c]);
            true
        });
        tau.map(|tau| (-tau).exp())
    }

    /// Whether a row has a weight that is not zero. One has none where it meets no element before its end, and where there is no medium
    /// or no light at those that it meets.
    pub fn has_weights(&self, row: usize) -> bool {
        if !self.meets_elements(row) {
            return false;
        }
        let mut has = self.parts.iter().any(|part| matches!(part.quantity, Quantity::Extinction));
        has = has || self.parts.iter().any(|part| self.plainly_has_weights(row, part));
        if !has {
            let mut see = |_, weight: Weight<f64, 3>| has |= weight != [0.0; 3];
            self.walk(row, &mut see);
        }
        has
    }

    /// Whether the first medium that a row meets at an element is lit in its middle. Where it is not, the whole row decides.
    fn plainly_has_weights(&self, row: usize, part: &VoxelElements) -> bool {
        let density = &*self.transport.density;
        let is_shared = part.basis.cells() == density.interpolation().cells() && part.grid == *density.grid();
        if !is_shared || self.transport.quadrature != Quadrature::Exact {
            return false;
        }
        let (mut has, mut tau) = (false, [0.0; 3]);
        self.each_line(row, |line, a, b| {
            let light = match &part.quantity {
                Quantity::Emission => None,
                Quantity::Albedo(light) => Some(light.along(line)),
                Quantity::Extinction | Quantity::InScattered(_) => return false,
            };
            let mut met = false;
            density.each_piece::<3>(line, a, b, |cell, a, b, depth| {
                let depth = depth.at(1.0);
                (0..3).for_each(|c| tau[c] += depth[c]);
                // Where little is left the walk decides whether it ends.
                met = tau.iter().any(|&tau| tau > 5.0) || part.cells.contains(cell);
                if !met {
                    return ControlFlow::Continue(());
                }
                let middle = 0.5 * (a + b);
                let lit = |c: usize| {
                    light.as_ref().is_none_or(|light| light.iter().any(|source| source.at(middle)[c] > 0.0))
                };
                has = part.cells.contains(cell)
                    && (0..3).any(|c| tau[c] - depth[c] < 5.0 && depth[c] > 0.0 && lit(c));
                ControlFlow::Break(())
            });
            !met
        });
        has
    }

    /// Whether it meets the cell of an element before its end.
    fn meets_elements(&self, row: usize) -> bool {
        let mut meets = false;
        self.each_line(row, |line, a, b| {
            meets = self.parts.iter().any(|part| {
                let shift = part.basis.cells().0;
                let cells = CellRay::new(line, &part.grid, shift);
                let high = part.grid.size().map(|side| side as f64 + shift);
                cells.clip(shift, high, a, b).is_some_and(|[a, b]| {
                    cells
                        .pieces(&part.cells, a, b, |cell, _, _| match part.cells.contains(cell) {
                            true => ControlFlow::Break(()),
                            false => ControlFlow::Continue(()),
                        })
                        .is_break()
                })
            });
            !meets
        });
        meets
    }

    /// Cells that a row is walked through, whether or not they hold anything.
    pub fn cells_entered(&self, row: usize) -> usize {
        let density = &self.transport.density;
        let mut count = 0;
        for part in &self.parts {
            let (grid, set, shift) = match part.quantity {
                Quantity::Extinction => (&part.grid, &*part.cells, part.basis.cells().0),
                _ => (density.grid(), density.cells(), density.interpolation().cells().0),
            };
            self.each_line(row, |line, a, b| {
                let cells = CellRay::new(line, grid, shift);
                let high = grid.size().map(|side| side as f64 + shift);
                if let Some([a, b]) = cells.clip(shift, high, a, b) {
                    let _all_counted = cells.pieces(set, a, b, |_, _, _| {
                        count += 1;
                        ControlFlow::Continue(())
                    });
                }
                true
            });
        }
        count
    }

    /// Visits the voxels of a part's grid that a row sees, whether they are elements or not. Returns the transmittance at the row's
    /// end, to the transmittance bound; for extinction, which is not attenuated, it is 1.
    #[inline]
    pub fn trace<const C: usize>(
        &self,
        row: usize,
        part: &VoxelElements,
        visit: &mut Visit<C>,
    ) -> Weight<f64, C> {
        // A bent ray may come back to a voxel; and so do channels that are sampled at places of their own.
        let comes_back = self.transport.refraction.is_some()
            || matches!(part.quantity, Quantity::InScattered(_)) && !self.transport.density.is_grey();
        if comes_back {
            let mut seen = Vec::new();
            let left = self.trace_in(row, part, &mut |voxel, weight| seen.push((voxel, weight)));
            merged(seen, visit);
            return left;
        }
        self.trace_in(row, part, visit)
    }

    #[inline]
    fn trace_in<const C: usize>(
        &self,
        row: usize,
        part: &VoxelElements,
        visit: &mut Visit<C>,
    ) -> Weight<f64, C> {
        match self.transport.basis {
            Interpolation::Nearest => self.trace_with::<C, NearestVoxel<C>>(row, part, visit),
            Interpolation::Trilinear => self.trace_with::<C, Trilinear<C>>(row, part, visit),
        }
    }

    #[inline]
    fn trace_with<const C: usize, W: VoxelWindow<C>>(
        &self,
        row: usize,
        part: &VoxelElements,
        visit: &mut Visit<C>,
    ) -> Weight<f64, C> {
        let mut strength = [1.0; C];
        if let Quantity::InScattered(albedo) = &part.quantity {
            let mut window = Trilinear::new(part.grid.size());
            // An albedo that is the same everywhere cuts no pieces.
            let grid = if part.uniform.is_some() { self.transport.density.grid() } else { albedo.grid() };
            self.each_line(row, |line, a, b| {
                let sink = ScatteredSink {
                    albedo,
                    uniform: part.uniform,
                    basis: self.transport.basis,
                    in_light: CellRay::new(line, &part.grid, Trilinear::<C>::SHIFT),
                    in_albedo: CellRay::new(line, albedo.grid(), 0.0),
                    size: part.grid.size(),
                    window: &mut window,
                    visit,
                };
                let cuts = self.cuts((line, [a, b]), grid, std::iter::once(&part.grid));
                self.attenuated::<C, W>((line, [a, b]), (grid, &cuts), &mut strength, sink)
            });
            window.finish(visit);
            return strength;
        }
        let mut window = W::new(part.grid.size());
        self.each_line(row, |line, a, b| {
            if let Quantity::Extinction = part.quantity {
                match self.transport.quadrature {
                    Quadrature::Exact => lengths((line, [a, b]), part, &mut window, visit),
                    Quadrature::March { steps } => {
                        march_lengths((line, [a, b]), steps, part, &mut window, visit);
                    }
                }
                return true;
            }
            let light = part.quantity.light(line);
            let lit = light.iter().flatten().map(|source| source.grid());
            let cuts = self.cuts((line, [a, b]), &part.grid, lit);
            let sink = LitSink { light: light.as_deref(), window: &mut window, visit };
            self.attenuated::<C, W>((line, [a, b]), (&part.grid, &cuts), &mut strength, sink)
        });
        window.finish(visit);
        strength
    }

    /// Where a line that is walked in the cells of `grid` is to be cut for light whose values are at the centres of others.
    fn cuts<'a>(
        &self,
        (line, ends): (&Line, [f64; 2]),
        grid: &VoxelGrid,
        lit: impl Iterator<Item = &'a VoxelGrid>,
    ) -> Cuts {
        let is_walked = |other: &VoxelGrid| self.transport.basis == Interpolation::Trilinear && other == grid;
        let others = lit.filter(|other| !is_walked(other));
        Cuts::of(line, ends, others.map(|grid| (grid, Interpolation::Trilinear)))
    }

    /// Takes the samples of what is emitted or scattered along a line, in the cells of `grid`. Returns whether the ray goes on.
    #[inline(always)]
    fn attenuated<const C: usize, W: VoxelWindow<C>>(
        &self,
        stretch: (&Line, [f64; 2]),
        (grid, cuts): (&VoxelGrid, &Cuts),
        strength: &mut Weight<f64, C>,
        sink: impl Sink<C>,
    ) -> bool {
        match self.transport.quadrature {
            Quadrature::Exact => self.integrate::<C, W, _>(stretch, (grid, cuts), strength, sink),
            Quadrature::March { steps } => self.march::<C, W>(stretch, steps, grid, strength, sink),
        }
        strength.iter().any(|&left| left > self.transport.transmittance_bound)
    }

    /// Exact for emission, and for what is scattered of light that is cubic between its cuts.
    #[inline(always)]
    fn integrate<const C: usize, W: VoxelWindow<C>, S: Sink<C>>(
        &self,
        (line, [a, b]): (&Line, [f64; 2]),
        (grid, cuts): (&VoxelGrid, &Cuts),
        strength: &mut Weight<f64, C>,
        mut sink: S,
    ) {
        let density = &*self.transport.density;
        let cells = CellRay::new(line, grid, W::SHIFT);
        let size = grid.size();
        let (high, last) = (size.map(|side| side as f64 + W::SHIFT), size.map(|side| side + W::EXTRA - 1));
        // Cells of the medium are those of the basis, and its density is constant in cells where the basis is.
        let alike = density.interpolation().cells() == (W::SHIFT, W::EXTRA);
        let shared = alike && grid == density.grid();
        let is_constant = W::CONSTANT && alike;
        if S::IS_LOCAL && shared && !W::CONSTANT && cuts.is_empty() {
            return self.integrate_cells(cells, [a, b], strength, sink);
        }
        density.each_piece::<C>(line, a, b, |cell, a, b, depth| {
            let entering = *strength;
            let tau = depth.at(1.0);
            let gone = super::basis::times(entering, tau.map(exponential::extinguished));
            let mut part = |cell: [usize; 3], start: f64, end: f64| {
                let (from, to) = ((start - a) / (b - a), (end - a) / (b - a));
                let before = depth.at(from);
                let strength: Weight<f64, C> = match from {
                    0.0 => entering,
                    _ => std::array::from_fn(|c| entering[c] * (-before[c]).exp()),
                };
                if is_constant {
                    let tau = depth.slope(0.0).map(|slope| slope * (to - from));
                    let weight = super::basis::times(strength, tau.map(exponential::extinguished));
                    sink.piece(cell, [start, end], tau, weight);
                } else {
                    nodes(depth, from, to, |u, weight| {
                        let t = a + u * (b - a);
                        sink.node(cell, cells.at(t), t, super::basis::times(strength, weight));
                    });
                }
            };
            let mut piece = |cell: [usize; 3], start: f64, end: f64| {
                cuts.parts(start, end, |start, end| part(cell, start, end));
            };
            if shared && is_constant && cuts.is_empty() {
                sink.piece(cell, [a, b], tau, gone);
            } else if shared {
                piece(cell, a, b);
            } else if let Some([start, end]) = cells.clip(W::SHIFT, high, a, b) {
                // What lies beside the unknown's grid attenuates and shows nothing.
                let _all_visited = cells.walk([0; 3], last, start, end, |cell, start, end| {
                    piece(cell, start, end);
                    ControlFlow::Continue(())
                });
            }
            (0..C).for_each(|c| strength[c] -= gone[c]);
            let bound = self.transport.transmittance_bound;
            if strength.iter().any(|&left| left > bound) {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        });
    }

    /// The same where the elements are the voxels of the medium, trilinear between them: eight pieces at once.
    fn integrate_cells<const C: usize>(
        &self,
        ray: CellRay,
        [a, b]: [f64; 2],
        strength: &mut Weight<f64, C>,
        sink: impl Sink<C>,
    ) {
        let density = &*self.transport.density;
        let Some([a, b]) = density.clipped(&ray, a, b) else { return };
        let bound = self.transport.transmittance_bound;
        let mut pieces = InCells::new(density, ray, bound, strength, sink);
        if ray.slab_pieces(density.cells(), a, b, &mut pieces).is_continue() {
            let _ends_here = pieces.take();
        }
    }

    /// The papers' march: equal steps from where the ray meets the medium, each worth its midpoint (Klehm 2015, listing 7.1,
    /// with the sign and the step length that it leaves out).
    fn march<const C: usize, W: VoxelWindow<C>>(
        &self,
        (line, [a, b]): (&Line, [f64; 2]),
        steps: u32,
        grid: &VoxelGrid,
        strength: &mut Weight<f64, C>,
        mut sink: impl Sink<C>,
    ) {
        let density = &*self.transport.density;
        let cells = CellRay::new(line, grid, W::SHIFT);
        let high = grid.size().map(|side| side as f64 + W::SHIFT);
        each_step(line, [a, b], steps, density.grid(), |t, length| {
            let sigma_t = density.at(line.origin + line.direction * t);
            let gone = std::array::from_fn(|c| exponential::extinguished(sigma_t[c] * length));
            let weight = super::basis::times(*strength, gone);
            (0..C).for_each(|c| strength[c] -= weight[c]);
            let at = cells.at(t);
            if (0..3).all(|axis| at[axis] >= W::SHIFT && at[axis] < high[axis]) {
                sink.node(at.map(|x| x as usize), at, t, weight);
            }
            strength.iter().any(|&left| left > self.transport.transmittance_bound)
        });
    }

    /// Visits the straight pieces of a row while `visit` says to go on.
    #[inline(always)]
    fn each_line(&self, row: usize, mut visit: impl FnMut(&Line, f64, f64) -> bool) {
        let (line, length) = (self.rays.line(row), self.rays.length(row));
        match &self.transport.refraction {
            None => {
                visit(&line, 0.0, length);
            }
            Some(refraction) => refraction.each_line(&line, length, &mut visit),
        }
    }
}

impl<const C: usize> Traversal<f64, C> for VolumeTraversal {
    fn rows(&self) -> usize {
        self.rays.len()
    }

    fn row_order(&self) -> Option<Vec<u32>> {
        Some(self.rays.row_order())
    }

    fn elements(&self) -> usize {
        self.parts.iter().map(|part| part.voxels.len()).sum()
    }

    fn room(&self) -> u64 {
        self.room::<C>()
    }

    fn gather_rows<X: Real>(
        &self,
        x: &[[X; 3]],
        row: &(dyn Fn(usize) -> usize + Sync),
        y: &mut [[X; 4]],
        room: u64,
    ) {
        self.gathered_rows::<X, C>(x, row, y, room);
    }

    fn scatter_rows<X: Real>(
        &self,
        rows: usize,
        y: &(dyn Fn(usize) -> (usize, [X; 3]) + Sync),
        room: u64,
    ) -> Option<Vec<[X; 3]>> {
        self.scattered_rows::<X, C>(rows, y, room)
    }

    #[inline]
    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f64, C>)) {
        let mut first = 0;
        for part in &self.parts {
            self.trace(row, part, &mut |voxel, weight| {
                if let Some(number) = part.voxels.number(voxel) {
                    visit(first + number as usize, weight);
                }
            });
            first += part.voxels.len();
        }
    }
}
