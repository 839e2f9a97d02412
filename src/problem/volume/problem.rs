use std::sync::Arc;

use rayon::prelude::*;

use super::environment::check_light;
use super::fixed::{Fixed, Row, wanted_pixels};
use super::optics::open_rays;
use super::renderer::is_grey;
use super::searched::Searched;
use super::{
    Desired, LightColumns, LitRows, Model, Optics, SeenLights, VolumeOperator, VolumeRows, VolumeState,
};
use crate::cpu::kept_bytes;
use crate::march::{Part, Quantity, Traversal, VolumeTraversal, Weight};
use crate::operator::{Bounds, CpuVector, WalkPlan};
use crate::problem::{Formulation, Lattice, Start, Steering, evenly};
use crate::scene::{
    Environment, Find, MetricName, Rgb, SolveSettings, Strategy, Volume, VolumeMedium, VolumeScene, VoxelSet,
};
use crate::{Error, Result};

/// Pixels that are no rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LeftOut {
    /// Nothing is wanted of them.
    pub unwanted: usize,
    /// Their rays meet nothing that is looked for.
    pub beside: usize,
    /// No channel of theirs has a logarithm.
    pub without_logarithm: usize,
}

/// The wanted pixels of a scene as rows, and voxels as unknowns.
#[derive(Debug)]
pub struct VolumeProblem {
    /// What is looked for.
    pub find: Find,
    /// The rows of T.
    pub traversal: VolumeRows,
    /// b: of emission and albedo the radiance that rows should have from what is looked for alone, of extinction the optical
    /// depth.
    pub targets: Vec<Rgb>,
    /// Weight of each row's squared residual a channel.
    pub weights: Vec<Rgb>,
    /// What each element starts from.
    pub start: Vec<Rgb>,
    /// Pixels that are no rows.
    pub left_out: LeftOut,
    /// Voxels outside the visual hull.
    pub outside_hull: usize,
    /// What walking the rows will take.
    pub plan: WalkPlan,
    /// Σ w L², L what the rows should show, all told.
    wanted: [f64; 3],
    /// The place of each element among the voxels of its grid, one grid behind the other.
    places: Vec<u32>,
    size: Vec<usize>,
    bounds: Bounds,
    steering: Option<Steering>,
    grey: bool,
}

impl VolumeProblem {
    /// The problem of finding one property of a medium, all others as they are.
    ///
    /// Errors: [`Error::Empty`] when no wanted ray meets anything that is looked for; [`Error::Value`] for a joint problem
    /// whose grids differ; those of the visual hull.
    pub fn new(
        scene: &VolumeScene,
        medium: &VolumeMedium,
        optics: &Optics,
        desired: &[Desired],
        find: Find,
    ) -> Result<Self> {
        if find == Find::Refinement {
            return Self::linearized(scene, medium, optics, desired);
        }
        let searched = Searched::new(scene, medium, optics, find)?;
        let (pixels, unwanted) = wanted_pixels(scene, desired);
        let rays = open_rays(scene, &pixels);
        let lengths = optics.lengths(&rays);
        let rays = rays.until(lengths.into());
        let all = VolumeTraversal::new(optics.transport(scene, medium), rays, searched.parts.clone());
        let seen = (find == Find::Environment).then(|| SeenLights::new(scene, optics, &all));
        let fixed = Fixed::new(scene, medium, optics, (&searched.parts, searched.outside_hull), find);
        let rows: Vec<Row> = (0..pixels.len())
            .into_par_iter()
            .map(|row| {
                let [view, pixel] = pixels[row];
                fixed.row(&all, seen.as_ref(), row, desired[view as usize].pixels[pixel as usize])
            })
            .collect();
        let kept: Vec<usize> = (0..rows.len()).filter(|&row| matches!(rows[row], Row::Kept { .. })).collect();
        let count = |kind: fn(&Row) -> bool| rows.iter().filter(|row| kind(row)).count();
        let left_out = LeftOut {
            unwanted,
            beside: count(|row| matches!(row, Row::Beside)),
            without_logarithm: count(|row| matches!(row, Row::NoLogarithm)),
        };
        if kept.is_empty() {
            return Err(nothing_to_solve(find, &left_out));
        }
        let (mut targets, mut weights, mut wanted) =
            (Vec::with_capacity(kept.len()), Vec::with_capacity(kept.len()), [0.0; 3]);
        for &row in &kept {
            if let Row::Kept { target, weight, shown } = rows[row] {
                targets.push(target);
                weights.push(weight);
                (0..3).for_each(|c| wanted[c] += f64::from(weight[c]) * f64::from(shown[c]).powi(2));
            }
        }
        let mut grey = searched.parts.iter().all(|part| is_grey(&all, part));
        let traversal = match seen {
            None => VolumeRows::Voxels(all.along(all.rays().picked(&kept))),
            Some(seen) => {
                // Surfaces may be of any colour.
                grey &= optics.geometry().is_open();
                let columns = Arc::new(LightColumns::new(scene, optics, &searched.parts[0])?);
                let rows = LitRows { scattered: all, columns, seen }.picked(&kept);
                check_light(&rows)?;
                VolumeRows::Lights(rows)
            }
        };
        Ok(Self::of_rows(find, traversal, grey, (targets, weights, wanted), left_out, searched))
    }

    /// The problem of some rows, with their targets, weights, and what they should show, squared, weighted and summed up.
    pub(super) fn of_rows(
        find: Find,
        traversal: VolumeRows,
        grey: bool,
        (targets, weights, wanted): (Vec<Rgb>, Vec<Rgb>, [f64; 3]),
        left_out: LeftOut,
        searched: Searched,
    ) -> Self {
        let plan = WalkPlan::of(&traversal, grey);
        let Searched { start, places, size, bounds, steering, outside_hull, .. } = searched;
        Self {
            find,
            traversal,
            targets,
            weights,
            start,
            left_out,
            outside_hull,
            plan,
            wanted,
            places,
            size,
            bounds,
            steering,
            grey,
        }
    }

    /// The model of light under which the property is looked for.
    pub fn model(scene: &VolumeScene, find: Find) -> Model {
        match find {
            Find::Refinement if scene.extinction.is_scattering => Model::SingleScattering,
            Find::Extinction | Find::Refinement => Model::Constant(scene.extinction.medium_radiance),
            _ => Model::SingleScattering,
        }
    }

    /// What the solver is told: the scene's settings, with the bounds of what is looked for.
    pub fn settings(scene: &VolumeScene, find: Find) -> SolveSettings {
        let bounds = match find {
            Find::Emission | Find::Joint => scene.bounds.emission,
            Find::Albedo => scene.bounds.albedo,
            Find::Extinction | Find::Refinement => scene.bounds.extinction,
            Find::Environment => scene.bounds.environment,
        };
        // Tiles of 64 voxels cost several times what a row's few voxels do, and save few iterations (docs/volumes.md).
        let metric = match scene.solve.metric {
            // Weights of either sign cancel in the sums that the others are made of.
            MetricName::Auto | MetricName::Sqs | MetricName::Tiles if find == Find::Refinement => {
                MetricName::Jacobi
            }
            MetricName::Auto => MetricName::Sqs,
            metric => metric,
        };
        SolveSettings { bounds, metric, ..scene.solve.clone() }
    }

    /// T, with as much of it kept as a strategy and `budget` bytes allow.
    ///
    /// Errors: [`Error::TooLarge`] when all of it must be kept and does not fit.
    pub fn operator(&self, strategy: Strategy, budget: u64) -> Result<VolumeOperator> {
        VolumeOperator::new(&self.traversal, self.grey, &self.plan, strategy, budget)
    }

    /// The problem as methods solve it.
    pub fn formulation(&self) -> Formulation<'_> {
        Formulation {
            targets: &self.targets,
            weights: (&self.weights).into(),
            wanted: self.wanted,
            start: Start::Each(&self.start),
            lattice: Lattice { size: &self.size, places: Some(&self.places) },
            bounds: self.bounds.clone(),
            steering: self.steering,
            remedy: match self.find {
                Find::Albedo => "raise the extinction, or the light",
                Find::Environment => "raise the extinction or the albedo, or let views see the sky",
                _ => "raise the extinction, or use another unit of length",
            },
        }
    }

    /// The problem of `rows` of its rows, evenly spread; of all where there are not as many.
    pub fn sampled(&self, rows: usize) -> Self {
        self.picked(&evenly(rows, self.targets.len()))
    }

    /// The same problem with its rows view by view and row by row of their pictures.
    pub fn in_reading_order(&self) -> Self {
        let mut order: Vec<usize> = (0..self.targets.len()).collect();
        order.sort_by_key(|&row| self.traversal.rays().pixel(row));
        self.picked(&order)
    }

    /// The problem of some of its rows.
    pub fn picked(&self, picked: &[usize]) -> Self {
        let every = |values: &[Rgb]| picked.iter().map(|&row| values[row]).collect();
        let traversal = self.traversal.picked(picked);
        Self {
            targets: every(&self.targets),
            weights: every(&self.weights),
            plan: WalkPlan::of(&traversal, self.grey),
            traversal,
            start: self.start.clone(),
            places: self.places.clone(),
            size: self.size.clone(),
            bounds: self.bounds.clone(),
            ..*self
        }
    }

    /// The rows with all voxels of all grids for elements, in the order (z, y, x), looked for or not.
    pub fn over_all_voxels(&self) -> AllVoxels<'_> {
        AllVoxels(self)
    }

    /// What all voxels start from, in the order (z, y, x).
    pub fn all_starts(&self, medium: &VolumeMedium) -> Vec<Rgb> {
        if let VolumeRows::Lights(_) = self.traversal {
            return self.start.clone();
        }
        let colors = |part: &Part| {
            let volume = property(medium, &part.quantity);
            (0..volume.grid().len()).map(|index| volume.color(index)).collect::<Vec<Rgb>>()
        };
        self.traversal.through_medium().parts().iter().flat_map(colors).collect()
    }

    /// The row weights, one colour a row.
    pub fn row_weights(&self) -> CpuVector {
        CpuVector(self.weights.clone())
    }

    /// All that could be looked for: voxels of the grids, or lights.
    pub fn candidates(&self) -> usize {
        match &self.traversal {
            VolumeRows::Lights(_) => self.start.len(),
            rows => rows.through_medium().parts().iter().map(|part| part.grid.len()).sum(),
        }
    }

    /// Views that a row sees.
    pub fn views(&self) -> usize {
        let mut views: Vec<u32> =
            (0..self.targets.len()).map(|row| self.traversal.rays().pixel(row)[0]).collect();
        views.sort_unstable();
        views.dedup();
        views.len()
    }

    /// The place of each element among the voxels of its grid, one grid behind the other.
    pub(super) fn places(&self) -> &[u32] {
        &self.places
    }

    /// Places of the unknowns along each axis.
    pub fn size(&self) -> &[usize] {
        &self.size
    }

    /// Bytes of what is prepared for the unknowns: light volumes.
    pub fn prepared_bytes(&self) -> u64 {
        match &self.traversal {
            VolumeRows::Lights(rows) => rows.bytes(),
            _ => 0,
        }
    }

    /// Bricks of voxels in which nothing is looked for, and all bricks.
    pub fn empty_bricks(&self) -> [usize; 2] {
        self.traversal.through_medium().parts().iter().fold([0, 0], |[empty, all], part| {
            let [more, others] = part.voxels().empty_bricks();
            [empty + more, all + others]
        })
    }

    /// Bytes that keeping all rows takes on the processor, foreseen.
    pub fn kept_bytes(&self) -> u64 {
        kept_bytes::<f32>(&self.plan, if self.grey { 1 } else { 3 })
    }

    /// Whether one weight serves all channels.
    pub fn is_grey(&self) -> bool {
        self.grey
    }

    /// A state with the elements in place of what they started from.
    ///
    /// Errors: [`Error::NonFinite`] naming a voxel, [`Error::Value`] naming a light.
    pub fn apply(&self, state: &VolumeState, x: &[Rgb]) -> Result<VolumeState> {
        let mut changed = state.clone();
        if let VolumeRows::Lights(rows) = &self.traversal {
            // A method that keeps no bounds may leave a light below zero, which shines as little as one that is out.
            let lights = x.iter().map(|color| color.map(|value| value.max(0.0))).collect();
            changed.environment = Environment::lights(rows.basis().clone(), lights)?;
            return Ok(changed);
        }
        let medium = &mut changed.medium;
        let mut rest = x;
        for part in self.traversal.through_medium().parts() {
            let (mine, others) = rest.split_at(part.voxels().len());
            rest = others;
            let found = Arc::new(replaced(property(medium, &part.quantity), part.voxels(), mine)?);
            match part.quantity {
                Quantity::Emission => medium.emission = found,
                Quantity::Albedo(_) | Quantity::InScattered(_) => medium.albedo = found,
                Quantity::Extinction => medium.extinction = found,
            }
        }
        Ok(changed)
    }
}

/// The property of a medium that a quantity is.
fn property<'a>(medium: &'a VolumeMedium, quantity: &Quantity) -> &'a Volume {
    match quantity {
        Quantity::Emission => &medium.emission,
        Quantity::Albedo(_) | Quantity::InScattered(_) => &medium.albedo,
        Quantity::Extinction => &medium.extinction,
    }
}

/// The rows of a problem over all voxels of its grids.
#[derive(Debug)]
pub struct AllVoxels<'a>(&'a VolumeProblem);

impl<const C: usize> Traversal<f64, C> for AllVoxels<'_> {
    fn rows(&self) -> usize {
        self.0.targets.len()
    }

    fn elements(&self) -> usize {
        self.0.candidates()
    }

    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f64, C>)) {
        self.0.traversal.walk(row, &mut |element, weight| visit(self.0.places[element] as usize, weight));
    }
}

/// A volume with the colours of some voxels replaced.
fn replaced(volume: &Volume, voxels: &VoxelSet, colors: &[Rgb]) -> Result<Volume> {
    let mut all: Vec<Rgb> = (0..volume.grid().len()).map(|index| volume.color(index)).collect();
    voxels.indices().iter().zip(colors).for_each(|(&index, &color)| all[index as usize] = color);
    Volume::of_colors(*volume.grid(), &all)
}

pub(super) fn nothing_to_solve(find: Find, left_out: &LeftOut) -> Error {
    if left_out.without_logarithm > 0 {
        return Error::Empty {
            reason: format!(
                "none of the {} wanted pixels is between the background and the medium's own radiance, so no \
                 extinction explains them",
                left_out.without_logarithm
            ),
            remedy: "check extinction.medium_radiance and the background",
        };
    }
    Error::Empty {
        reason: format!(
            "none of the {} wanted rays meets {} is looked for",
            left_out.beside,
            match find {
                Find::Environment => "a voxel that scatters, or the sky that".to_owned(),
                _ => format!("a voxel whose {}", find.name()),
            }
        ),
        remedy: "check the cameras and volume.to_world",
    }
}
