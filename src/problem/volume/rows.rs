use super::environment::LitRows;
use crate::march::{
    LinearizedTraversal, PixelRays, Real, Traversal, VolumeTransport, VolumeTraversal, Weight,
};

/// The rows of a volume problem.
#[derive(Debug, Clone)]
pub enum VolumeRows {
    /// Over voxels.
    Voxels(VolumeTraversal),
    /// Over the extinction of voxels, of how radiance changes with it.
    Linearized(LinearizedTraversal),
    /// Over lights around the volume.
    Lights(LitRows),
}

impl VolumeRows {
    /// The walk through the medium.
    pub fn through_medium(&self) -> &VolumeTraversal {
        match self {
            Self::Voxels(rows) => rows,
            Self::Linearized(rows) => rows.medium(),
            Self::Lights(rows) => &rows.scattered,
        }
    }

    /// The rays, one a row.
    pub fn rays(&self) -> &PixelRays {
        self.through_medium().rays()
    }

    /// What the rays share.
    pub fn transport(&self) -> &VolumeTransport {
        self.through_medium().transport()
    }

    /// Some of the rows.
    pub(super) fn picked(&self, rows: &[usize]) -> Self {
        match self {
            Self::Voxels(all) => Self::Voxels(all.along(all.rays().picked(rows))),
            Self::Linearized(all) => Self::Linearized(all.picked(rows)),
            Self::Lights(all) => Self::Lights(all.picked(rows)),
        }
    }
}

impl<const C: usize> Traversal<f64, C> for VolumeRows {
    fn rows(&self) -> usize {
        self.rays().len()
    }

    fn elements(&self) -> usize {
        match self {
            Self::Voxels(rows) => Traversal::<f64, C>::elements(rows),
            Self::Linearized(rows) => Traversal::<f64, C>::elements(rows),
            Self::Lights(rows) => Traversal::<f64, C>::elements(rows),
        }
    }

    fn row_order(&self) -> Option<Vec<u32>> {
        Traversal::<f64, C>::row_order(self.through_medium())
    }

    fn room(&self) -> u64 {
        match self {
            Self::Voxels(rows) => Traversal::<f64, C>::room(rows),
            Self::Linearized(rows) => Traversal::<f64, C>::room(rows),
            Self::Lights(rows) => Traversal::<f64, C>::room(rows),
        }
    }

    fn gather_rows<X: Real>(
        &self,
        x: &[[X; 3]],
        row: &(dyn Fn(usize) -> usize + Sync),
        y: &mut [[X; 4]],
        room: u64,
    ) {
        match self {
            Self::Voxels(rows) => Traversal::<f64, C>::gather_rows(rows, x, row, y, room),
            Self::Linearized(rows) => Traversal::<f64, C>::gather_rows(rows, x, row, y, room),
            Self::Lights(rows) => Traversal::<f64, C>::gather_rows(rows, x, row, y, room),
        }
    }

    fn scatter_rows<X: Real>(
        &self,
        rows: usize,
        y: &(dyn Fn(usize) -> (usize, [X; 3]) + Sync),
        room: u64,
    ) -> Option<Vec<[X; 3]>> {
        match self {
            Self::Voxels(of) => Traversal::<f64, C>::scatter_rows(of, rows, y, room),
            Self::Linearized(of) => Traversal::<f64, C>::scatter_rows(of, rows, y, room),
            Self::Lights(of) => Traversal::<f64, C>::scatter_rows(of, rows, y, room),
        }
    }

    #[inline]
    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f64, C>)) {
        match self {
            Self::Voxels(rows) => rows.walk(row, visit),
            Self::Linearized(rows) => rows.walk(row, visit),
            Self::Lights(rows) => rows.walk(row, visit),
        }
    }
}
