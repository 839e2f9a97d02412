//! Rows of T x that are evaluated where rays pass, without the weights of single elements.

use super::super::{Real, Traversal, gathered_rows};
use super::blocks::{AROUND, Blocks, WITHIN};
use super::cells::{CellRay, Slabs};
use super::elements::{Quantity, VoxelElements};
use super::sink::GatherSink;
use super::window::Trilinear;
use super::{VolumeTransport, VolumeTraversal};
use crate::scene::{Interpolation, Quadrature};

/// Elements whose copying pays for a row.
const ELEMENTS_A_ROW: usize = 64;

/// The elements of a part, copied for the rays that pass there.
enum Copied<X> {
    /// Trilinear between voxel centres.
    Around(Blocks<X, AROUND>),
    /// Constant in each voxel.
    Within(Blocks<X, WITHIN>),
}

/// A row of T x over extinction that is constant in each voxel: the sum of lengths times elements.
struct Lengths<'a, X> {
    elements: &'a Blocks<X, WITHIN>,
    sum: [f64; 4],
}

impl<X: Real> Slabs for Lengths<'_, X> {
    #[inline(always)]
    fn piece(&mut self, voxel: [usize; 3], a: f64, b: f64) {
        let element = self.elements.at(voxel);
        (0..4).for_each(|lane| self.sum[lane] += (b - a) * element[lane].wide());
    }
}

impl VolumeTraversal {
    /// Some rows of T x, as [`Traversal::gather_rows`] has them.
    pub(super) fn gathered_rows<X: Real, const C: usize>(
        &self,
        x: &[[X; 3]],
        row: &(dyn Fn(usize) -> usize + Sync),
        y: &mut [[X; 4]],
    ) {
        let mut rest = x;
        let copied = |part: &VoxelElements| {
            let (mine, others) = rest.split_at(part.voxels.len());
            rest = others;
            self.copied(part, mine)
        };
        let pays = y.len() * ELEMENTS_A_ROW >= x.len();
        let parts: Option<Vec<Copied<X>>> = if pays { self.parts.iter().map(copied).collect() } else { None };
        gathered_rows(y, &|k| match &parts {
            None => Traversal::<f64, C>::gather(self, row(k), x).map(Real::wide),
            Some(parts) => {
                let mut sum = [0.0; 3];
                for (part, x) in self.parts.iter().zip(parts) {
                    self.gather_part::<X, C>(row(k), part, x, &mut sum);
                }
                sum
            }
        });
    }

    /// The elements of a part, copied for rows of T x that are evaluated where rays pass; none where they have to be walked.
    fn copied<X: Real>(&self, part: &VoxelElements, x: &[[X; 3]]) -> Option<Copied<X>> {
        let VolumeTransport { basis, quadrature, .. } = self.transport;
        match (&part.quantity, basis) {
            (Quantity::Emission | Quantity::Albedo(_), Interpolation::Trilinear) => {
                Some(Copied::Around(Blocks::of(part, x)))
            }
            (Quantity::Extinction, Interpolation::Nearest) if quadrature == Quadrature::Exact => {
                Some(Copied::Within(Blocks::of(part, x)))
            }
            _ => None,
        }
    }

    /// Adds a row of T x over the elements of a part: what [`Self::trace`] visits times `x`.
    fn gather_part<X: Real, const C: usize>(
        &self,
        row: usize,
        part: &VoxelElements,
        x: &Copied<X>,
        sum: &mut [f64; 3],
    ) {
        let mut strength = [1.0; C];
        self.each_line(row, |line, a, b| match x {
            Copied::Around(elements) => {
                let light = part.quantity.light(line);
                let lit = light.iter().flatten().map(|source| source.grid());
                let cuts = self.cuts((line, [a, b]), &part.grid, lit);
                let sink = GatherSink { light: light.as_deref(), elements, size: part.grid.size(), sum };
                self.attenuated::<C, Trilinear<C>>((line, [a, b]), (&part.grid, &cuts), &mut strength, sink)
            }
            Copied::Within(elements) => {
                let cells = CellRay::new(line, &part.grid, 0.0);
                if let Some([a, b]) = cells.clip(0.0, part.grid.size().map(|side| side as f64), a, b) {
                    let mut lengths = Lengths { elements, sum: [0.0; 4] };
                    let _all_visited = cells.slab_pieces(&part.cells, a, b, &mut lengths);
                    (0..3).for_each(|c| sum[c] += lengths.sum[c]);
                }
                true
            }
        });
    }
}
