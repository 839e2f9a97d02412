use std::sync::Arc;

use rayon::prelude::*;

use super::environment::check_light;
use super::fixed::{Fixed, PixelRow, wanted_pixels};
use super::operator::LightVolumes;
#[cfg(feature = "gpu")]
use super::operator::on_gpu;
use super::optics::open_rays;
use super::renderer::is_grey;
use super::searched::{ElementKind, Searched};
use super::{Desired, LightColumns, LitRows, Model, Optics, SeenLights, VolumeRows, VolumeState};
#[cfg(feature = "gpu")]
use crate::gpu::{Gpu, GpuOperator};
use crate::march::{
    Quantity, Refraction, Traversal, VolumeTransport, VolumeTraversal, VoxelElements, Weight,
};
use crate::operator::{CpuVector, OnHost, WalkPlan};
use crate::problem::looked_for::{Nouns, explicit, on_host, row_of};
use crate::problem::{Formulation, HeldOut, Lattice, Part, Problem, Start, Unskipped, evenly};
use crate::scene::{
    Environment, Find, MetricName, Quadrature, Rgb, SolveSettings, Strategy, Volume, VolumeMedium,
    VolumeScene, VoxelSet,
};
use crate::sparse::ExplicitMatrix;
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
#[derive(Debug, Clone)]
pub struct VolumeProblem {
    /// What is looked for.
    pub find: Find,
    /// The rows of T.
    pub traversal: VolumeRows,
    /// b of each row. For extinction it is the optical depth; for all else the radiance that the row should have from what is
    /// looked for alone.
    pub targets: Vec<Rgb>,
    /// Weight of each row's squared residual a channel.
    pub weights: Vec<Rgb>,
    /// x₀ of each element, in the unit of what is looked for.
    pub start: Vec<Rgb>,
    /// Pixels that are no rows.
    pub left_out: LeftOut,
    /// Voxels outside the visual hull.
    pub outside_hull: usize,
    /// What walking the rows will take.
    plan: WalkPlan,
    /// Σ w L², L what the rows should show, all told.
    wanted: [f64; 3],
    /// The place of each element among those of its kind.
    places: Vec<u32>,
    kinds: Vec<ElementKind>,
    /// The numbers of all elements of the largest kind, where what is found spreads to those that no row reaches; else none.
    joined: Vec<u32>,
    grey: bool,
    /// Rows that are kept out of the fit.
    pub(super) held_out: Option<Arc<HeldOut>>,
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
        if find == Find::Refinement && scene.extinction.is_scattering {
            return Self::linearized(scene, medium, optics, desired);
        }
        let mut searched = Searched::new(scene, medium, optics, find)?;
        let (pixels, unwanted) = wanted_pixels(scene, desired);
        let rays = open_rays(scene, &pixels);
        let lengths = optics.lengths(&rays);
        let rays = rays.until(lengths.into());
        let all = VolumeTraversal::new(optics.transport(scene, medium), rays, searched.parts.clone());
        let seen = (find == Find::Environment).then(|| SeenLights::new(scene, optics, &all));
        let fixed = Fixed::new(scene, medium, optics, (&searched.parts, searched.outside_hull), find);
        let rows: Vec<PixelRow> = (0..pixels.len())
            .into_par_iter()
            .map(|row| {
                let [view, pixel] = pixels[row];
                fixed.row(&all, seen.as_ref(), row, desired[view as usize].pixels[pixel as usize])
            })
            .collect();
        let kept: Vec<usize> =
            (0..rows.len()).filter(|&row| matches!(rows[row], PixelRow::Kept { .. })).collect();
        let count = |kind: fn(&PixelRow) -> bool| rows.iter().filter(|row| kind(row)).count();
        let left_out = LeftOut {
            unwanted,
            beside: count(|row| matches!(row, PixelRow::Beside)),
            without_logarithm: count(|row| matches!(row, PixelRow::NoLogarithm)),
        };
        if kept.is_empty() {
            return Err(nothing_to_solve(find, &left_out, searched.outside_hull));
        }
        let (mut targets, mut weights, mut wanted) =
            (Vec::with_capacity(kept.len()), Vec::with_capacity(kept.len()), [0.0; 3]);
        for &row in &kept {
            if let PixelRow::Kept { target, weight, shown } = rows[row] {
                targets.push(target);
                weights.push(weight);
                (0..3).for_each(|c| wanted[c] += f64::from(weight[c]) * f64::from(shown[c]).powi(2));
            }
        }
        if scene.is_painted && matches!(find, Find::Emission | Find::Joint) {
            searched.bound_emission(&all, &kept, &targets);
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

    /// The problem of some rows, with their targets, their weights, and Σ w L² of what they should show.
    pub(super) fn of_rows(
        find: Find,
        traversal: VolumeRows,
        grey: bool,
        (targets, weights, wanted): (Vec<Rgb>, Vec<Rgb>, [f64; 3]),
        left_out: LeftOut,
        searched: Searched,
    ) -> Self {
        let plan = WalkPlan::of(&traversal, grey);
        let Searched { start, places, kinds, outside_hull, spreads, .. } = searched;
        let largest = kinds.iter().map(|kind| kind.len as u32).max().filter(|_| spreads);
        Self {
            joined: (0..largest.unwrap_or_default()).collect(),
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
            kinds,
            grey,
            held_out: None,
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

    /// The settings of the scene with the bounds of what is looked for, and with a metric that suits it.
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
            MetricName::Auto | MetricName::Sqs | MetricName::Tiles
                if find == Find::Refinement && scene.extinction.is_scattering =>
            {
                MetricName::Jacobi
            }
            MetricName::Auto => MetricName::Sqs,
            metric => metric,
        };
        let regularization = match find {
            Find::Environment => scene.regularization_of_sky,
            _ => scene.solve.regularization,
        };
        SolveSettings { bounds, metric, regularization, ..scene.solve.clone() }
    }

    /// The same problem with its rows view by view and row by row of their pictures.
    pub fn in_reading_order(&self) -> Self {
        let mut order: Vec<usize> = (0..self.targets.len()).collect();
        order.sort_by_key(|&row| self.traversal.rays().pixel(row));
        self.of_some(&order)
    }

    /// The problem of some of its rows.
    pub(super) fn of_some(&self, picked: &[usize]) -> Self {
        let every = |values: &[Rgb]| picked.iter().map(|&row| values[row]).collect();
        let traversal = self.traversal.picked(picked);
        Self {
            targets: every(&self.targets),
            weights: every(&self.weights),
            plan: WalkPlan::of(&traversal, self.grey),
            traversal,
            start: self.start.clone(),
            places: self.places.clone(),
            kinds: self.kinds.clone(),
            joined: self.joined.clone(),
            held_out: self.held_out.clone(),
            ..*self
        }
    }

    /// The same problem along other rows of the same rays.
    fn along(&self, rows: VolumeTraversal) -> Self {
        let traversal = VolumeRows::Voxels(rows);
        Self { plan: WalkPlan::of(&traversal, self.grey), traversal, ..self.clone() }
    }

    /// The rows over all voxels of all grids, whether they are looked for or not, in the order (z, y, x).
    pub fn over_all_voxels(&self) -> AllVoxels<'_> {
        AllVoxels { problem: self, places: self.all_places() }
    }

    /// What all voxels start from, in the order (z, y, x).
    pub fn all_starts(&self, medium: &VolumeMedium) -> Vec<Rgb> {
        if let VolumeRows::Lights(_) = self.traversal {
            return self.start.clone();
        }
        let colors = |part: &VoxelElements| {
            let volume = property(medium, &part.quantity);
            (0..volume.grid().len()).map(|index| volume.color(index)).collect::<Vec<Rgb>>()
        };
        self.traversal.through_medium().parts().iter().flat_map(colors).collect()
    }

    /// The place of each element among the voxels of all grids, one grid behind the other.
    pub(super) fn all_places(&self) -> Vec<u32> {
        let (mut places, mut element, mut first) = (self.places.clone(), 0, 0);
        for kind in &self.kinds {
            places[element..element + kind.len].iter_mut().for_each(|place| *place += first);
            element += kind.len;
            first += kind.size.iter().product::<usize>() as u32;
        }
        places
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

impl Problem for VolumeProblem {
    fn targets(&self) -> &[Rgb] {
        &self.targets
    }

    fn weights(&self) -> CpuVector {
        CpuVector(self.weights.clone())
    }

    fn pixel(&self, row: usize) -> [usize; 2] {
        self.traversal.rays().pixel(row).map(|index| index as usize)
    }

    fn plan(&self) -> &WalkPlan {
        &self.plan
    }

    fn is_grey(&self) -> bool {
        self.grey
    }

    fn formulation(&self, _settings: &SolveSettings) -> Result<Formulation<'_>> {
        let mut first = 0;
        let part = |kind: &'_ ElementKind| {
            let elements = first..first + kind.len;
            first = elements.end;
            elements
        };
        let ranges: Vec<_> = self.kinds.iter().map(part).collect();
        let parts = self.kinds.iter().zip(ranges).map(|(kind, elements)| Part {
            noun: kind.noun,
            start: Start::Each(&self.start[elements.clone()]),
            bounds: kind.bounds,
            pull: kind.pull,
            lattice: Some(Lattice { size: &kind.size, places: Some(&self.places[elements]) }),
            pairs: &kind.pairs,
            joined: self.joined.get(..kind.len).unwrap_or_default(),
            fade: 0.0,
            scale: 0,
        });
        Ok(Formulation {
            targets: (&self.targets).into(),
            weights: (&self.weights).into(),
            wanted: self.wanted,
            parts: parts.collect(),
            held_out: self.held_out.as_deref(),
            remedy: match self.find {
                Find::Albedo => "raise the extinction, or the light",
                Find::Environment => "raise the extinction or the albedo, or let views see the sky",
                _ => "raise the extinction, or use another unit of length",
            },
        })
    }

    fn picked(&self, rows: &[usize]) -> Box<dyn Problem> {
        Box::new(self.of_some(rows))
    }

    fn integrated(
        &self,
        quadrature: Quadrature,
        transmittance_bound: Option<f64>,
    ) -> Option<Box<dyn Problem>> {
        match &self.traversal {
            VolumeRows::Voxels(rows) => {
                let transport = rows.transport().clone();
                let transport = VolumeTransport {
                    quadrature,
                    transmittance_bound: transmittance_bound.unwrap_or(transport.transmittance_bound),
                    ..transport
                };
                let rows = VolumeTraversal::new(transport, rows.rays().clone(), rows.parts().to_vec());
                Some(Box::new(self.along(rows)))
            }
            _ if quadrature == Quadrature::Exact && transmittance_bound.is_none() => {
                Some(Box::new(self.clone()))
            }
            _ => None,
        }
    }

    fn unskipped(&self) -> Option<Unskipped> {
        let VolumeRows::Voxels(rows) = &self.traversal else { return None };
        let density = Arc::new((*rows.transport().density).clone().entered_everywhere());
        let parts = rows.parts().iter().map(|part| part.entered_everywhere()).collect();
        let transport = VolumeTransport { density, ..rows.transport().clone() };
        let entered = VolumeTraversal::new(transport, rows.rays().clone(), parts);
        let cells = |rows: &VolumeTraversal| {
            (0..rows.rays().len()).map(|row| rows.cells_entered(row)).sum::<usize>() as f64
        };
        Some(Unskipped {
            what: "empty bricks",
            switch: "solve.skip.bricks=false",
            unit: "cells",
            work: [cells(rows), cells(&entered)],
            problem: Box::new(self.along(entered)),
        })
    }

    fn most_lost(&self) -> Option<f64> {
        let VolumeRows::Voxels(rows) = &self.traversal else { return None };
        let is_of_emission = rows.parts().iter().all(|part| matches!(part.quantity, Quantity::Emission));
        is_of_emission.then(|| (3.0 * self.rows() as f64).sqrt() * rows.transport().transmittance_bound)
    }

    fn replan(&mut self) {
        self.plan = WalkPlan::of(&self.traversal, self.grey);
    }

    fn row(&self, row: usize, visit: &mut dyn FnMut(usize, [f64; 3])) {
        row_of(&self.traversal, self.grey, row, visit);
    }

    /// Rows of lights that do not fit are not walked: light volumes take their place.
    fn on_cpu(&self, strategy: Strategy, budget: u64) -> Result<OnHost> {
        match &self.traversal {
            VolumeRows::Lights(rows)
                if strategy == Strategy::MatrixFree
                    || strategy == Strategy::Auto && self.kept_bytes() > budget =>
            {
                Ok(Box::new(LightVolumes::new(rows, self.grey, &self.plan, strategy, budget)?))
            }
            rows => on_host(rows, (self.grey, &self.plan), (strategy, budget)),
        }
    }

    fn wide(&self, strategy: Strategy) -> Result<OnHost<f64>> {
        on_host(&self.traversal, (self.grey, &self.plan), (strategy, u64::MAX))
    }

    #[cfg(feature = "gpu")]
    fn on_gpu(&self, gpu: &Gpu, strategy: Strategy, budget: u64, deterministic: bool) -> Result<GpuOperator> {
        on_gpu(&self.traversal, (self.grey, &self.plan), gpu, (strategy, budget), deterministic)
    }

    fn explicit(&self, most: u64) -> Result<ExplicitMatrix> {
        explicit(&self.traversal, self.grey, most)
    }

    fn candidates(&self) -> usize {
        match &self.traversal {
            VolumeRows::Lights(_) => self.start.len(),
            rows => rows.through_medium().parts().iter().map(|part| part.grid.len()).sum(),
        }
    }

    fn prepared_bytes(&self) -> u64 {
        match &self.traversal {
            VolumeRows::Lights(rows) => rows.bytes(),
            _ => 0,
        }
    }

    fn ray_bytes(&self) -> u64 {
        (self.rows() * size_of::<[u32; 2]>()) as u64
    }

    fn digest(&self, add: &mut dyn FnMut(u64)) {
        let rays = self.traversal.rays();
        for row in 0..self.rows() {
            let (ray, length) = (rays.ray(row), rays.length(row));
            let numbers = [ray.origin.to_array(), ray.direction.to_array(), [length; 3]];
            numbers.iter().flatten().for_each(|number| add(number.to_bits()));
        }
        let density = self.traversal.transport().density.volume();
        density.samples().iter().for_each(|number| add(number.to_bits().into()));
    }

    fn skipped(&self) -> Vec<(&'static str, [usize; 2])> {
        let bricks = self.traversal.through_medium().parts().iter().fold([0, 0], |[empty, all], part| {
            let [more, others] = part.voxels().empty_bricks();
            [empty + more, all + others]
        });
        let LeftOut { beside, without_logarithm, unwanted: _ } = self.left_out;
        let rows = self.rows();
        let held_out = self.held_out.as_ref().map_or(0, |held_out| held_out.rows());
        let some = [
            ("beside", [beside, rows + beside]),
            ("outside_hull", [self.outside_hull, self.candidates()]),
            ("without_logarithm", [without_logarithm, rows + without_logarithm]),
            ("held_out", [held_out, rows + held_out]),
        ];
        let counted = some.into_iter().filter(|(_, [count, _])| *count > 0);
        std::iter::once(("empty_bricks", bricks)).chain(counted).collect()
    }

    fn nouns(&self) -> Nouns {
        let found = match self.find {
            Find::Joint => "emission and albedo",
            Find::Refinement => Find::Extinction.name(),
            Find::Environment => "light",
            find => find.name(),
        };
        Nouns::new(found, "wanted pixel", "target")
    }

    fn settings_in_words(&self) -> Vec<(&'static str, String)> {
        let transport = self.traversal.transport();
        let mut words = vec![
            ("interpolation", format!("{:?}", transport.basis).to_lowercase()),
            (
                "quadrature",
                match transport.quadrature {
                    Quadrature::Exact => "exact, cell by cell".to_owned(),
                    Quadrature::March { steps } => format!("march of {steps} steps along the diagonal"),
                },
            ),
        ];
        words.extend(transport.refraction.as_ref().map(|bent| ("refraction", self.in_words(bent))));
        if let [emission, albedo] = &self.kinds[..] {
            words.push(("pull", format!("emission {}, albedo {}", emission.pull, albedo.pull)));
        }
        words
    }
}

impl VolumeProblem {
    /// The step along bent rays, and what it costs: measured on some of the rows.
    fn in_words(&self, refraction: &Refraction) -> String {
        const SAMPLES: usize = 256;
        let rays = self.traversal.rays();
        let errors: Vec<f64> = evenly(SAMPLES, rays.len())
            .into_iter()
            .map(|row| refraction.step_error(&rays.ray(row)))
            .collect();
        let worst = errors.iter().copied().fold(0.0, f64::max);
        let mean = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
        format!(
            "Euler steps of {:.2e} m; half as long they would move the rays by {mean:.1e} m on average, {worst:.1e} m at most",
            refraction.step()
        )
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
pub struct AllVoxels<'a> {
    problem: &'a VolumeProblem,
    places: Vec<u32>,
}

impl<const C: usize> Traversal<f64, C> for AllVoxels<'_> {
    fn rows(&self) -> usize {
        self.problem.targets.len()
    }

    fn elements(&self) -> usize {
        self.problem.candidates()
    }

    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f64, C>)) {
        self.problem.traversal.walk(row, &mut |element, weight| visit(self.places[element] as usize, weight));
    }
}

/// A volume with the colours of some voxels replaced.
fn replaced(volume: &Volume, voxels: &VoxelSet, colors: &[Rgb]) -> Result<Volume> {
    let mut all: Vec<Rgb> = (0..volume.grid().len()).map(|index| volume.color(index)).collect();
    voxels.indices().iter().zip(colors).for_each(|(&index, &color)| all[index as usize] = color);
    Volume::of_colors(*volume.grid(), &all)
}

pub(super) fn nothing_to_solve(find: Find, left_out: &LeftOut, outside_hull: usize) -> Error {
    if left_out.without_logarithm > 0 {
        return Error::Empty {
            reason: format!(
                "none of the {} wanted pixels is between the background and the medium's own radiance, so no \
                 extinction explains them",
                left_out.without_logarithm
            ),
            remedy: "set `background` to what is seen past the medium (black unless said), or \
                     extinction.medium_radiance to what a thick part of it shows",
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
        remedy: match outside_hull {
            0 => "check the cameras and volume.to_world",
            _ => {
                "check that masks are white where the volume is: what they leave of it, its visual hull, is met by no ray"
            }
        },
    }
}
