use std::sync::Arc;

use rayon::prelude::*;

use super::extents::fit_to;
use super::transport::LightMapOperator;
use super::{Constraint, Formulation, Lattice, Maps, Start, Surfaces, Traced, constraints};
use crate::cpu::WalkPlan;
use crate::march::{LightMapTransport, LightMapTraversal, ViewRay};
use crate::operator::CpuVector;
use crate::scene::{Quadrature, Rgb, RgbaImage, Scene, SolveSettings, Strategy, Target};
use crate::{Error, Result};

/// The painted pixels of a scene as rows, and what they should become.
///
/// The model is `scattered light = T x + surroundings`: x are the texels of the light map; outside the map the
/// light keeps its own radiance, which gives each row a constant share.
#[derive(Debug)]
pub struct LightMapProblem {
    /// The rows.
    pub constraints: Vec<Constraint>,
    /// What is painted on each view.
    pub paintings: Vec<RgbaImage>,
    /// Where the maps lie.
    pub maps: Maps,
    /// The rows of T.
    pub traversal: LightMapTraversal,
    /// The scattered radiance that each row should have, without its surroundings: b. It is negative where the
    /// surroundings alone are too bright.
    pub targets: Vec<Rgb>,
    /// The scattered radiance of each row that comes from outside the light map.
    pub surroundings: Vec<Rgb>,
    /// What the light map starts from: the radiance of the light.
    pub start: Rgb,
    /// What walking the rows will take.
    pub plan: WalkPlan,
    grey: bool,
}

impl LightMapProblem {
    /// Paints the views, finds the depth behind every painted pixel, places the maps, and computes the targets.
    ///
    /// Errors: [`Error::Empty`] when nothing is painted or every painted pixel is in shadow.
    pub fn new(scene: &Scene) -> Result<Self> {
        Self::with(scene, &Traced)
    }

    /// The same, with surfaces found in a way of the caller's.
    pub fn with(scene: &Scene, surfaces: &dyn Surfaces) -> Result<Self> {
        let (constraints, paintings) = constraints(scene)?;
        let lengths = surfaces.lengths(scene, &constraints)?;
        let maps = fit_to(scene, &constraints, &lengths, surfaces)?;
        let rays: Arc<[ViewRay]> = constraints
            .par_iter()
            .zip(&lengths)
            .map(|(pixel, &length)| {
                let ray = scene.views[pixel.view].camera.pixel_ray(pixel.x, pixel.y);
                ViewRay::new(&ray, length, &maps.frame, &scene.medium)
            })
            .collect();
        let traversal = LightMapTraversal::new(transport(scene, &maps, scene.solve.quadrature), rays);
        let start = scene.light.radiance;
        let white = luminance(start);
        let shares: Vec<[[f64; 3]; 2]> = (0..constraints.len())
            .into_par_iter()
            .map(|row| [traversal.lit_weight(row), traversal.surrounding_weight(row)])
            .collect();
        if shares.iter().all(|share| !passes_the_map(share)) {
            let count = constraints.len();
            let dark = shares.iter().all(|[lit, _]| *lit == [0.0; 3]);
            return Err(Error::Empty {
                reason: if dark {
                    format!("every one of the {count} painted pixels is in shadow")
                } else {
                    format!(
                        "the {count} painted pixels get light only from beside the light map, the rest is in shadow"
                    )
                },
                remedy: "paint where light shafts are seen, turn the light, or set light_map.extent",
            });
        }
        let surroundings: Vec<Rgb> =
            shares.iter().map(|[_, outside]| rgb(|c| outside[c] as f32 * start[c])).collect();
        let targets = constraints
            .iter()
            .zip(&shares)
            .zip(&surroundings)
            .map(|((pixel, [lit, _]), around)| {
                rgb(|c| match scene.target {
                    Target::Tint => pixel.color[c] * (lit[c] as f32 * white) - around[c],
                    Target::Radiance => pixel.color[c] - around[c],
                })
            })
            .collect();
        let grey = scene.medium.is_grey();
        let plan = plan(&traversal, grey);
        Ok(Self { constraints, paintings, maps, traversal, targets, surroundings, start, plan, grey })
    }

    /// T, with as much of it kept as `scene.solve` and `budget` bytes allow.
    ///
    /// Errors: [`Error::TooLarge`] when all of it must be kept and does not fit.
    pub fn operator(&self, scene: &Scene, budget: u64) -> Result<LightMapOperator> {
        self.operator_with(scene.solve.strategy, budget)
    }

    /// T with a strategy of the caller's.
    pub fn operator_with(&self, strategy: Strategy, budget: u64) -> Result<LightMapOperator> {
        LightMapOperator::new(self.traversal.clone(), self.grey, &self.plan, strategy, budget)
    }

    /// The scattered radiance that a row should have, that from outside the light map included.
    pub fn wanted(&self, row: usize) -> Rgb {
        rgb(|c| self.targets[row][c] + self.surroundings[row][c])
    }

    /// The share of the painted pixels' light that comes from outside the light map, where it keeps its colour.
    pub fn share_from_outside(&self) -> f64 {
        let sum = |weight: [f64; 3]| weight.iter().sum::<f64>();
        let rows = 0..self.constraints.len();
        let (outside, all) = rows.fold((0.0, 0.0), |(outside, all), row| {
            (outside + sum(self.traversal.surrounding_weight(row)), all + sum(self.traversal.lit_weight(row)))
        });
        outside / all
    }

    /// The problem of at most `rows` of its rows, evenly spread.
    pub fn sampled(&self, rows: usize) -> Self {
        let stride = self.constraints.len().div_ceil(rows.max(1)).max(1);
        fn every<T: Clone>(values: &[T], stride: usize) -> Vec<T> {
            values.iter().step_by(stride).cloned().collect()
        }
        let rays = every(self.traversal.rays(), stride).into();
        let traversal = LightMapTraversal::new(self.traversal.transport().clone(), rays);
        Self {
            constraints: every(&self.constraints, stride),
            paintings: self.paintings.clone(),
            maps: self.maps.clone(),
            targets: every(&self.targets, stride),
            surroundings: every(&self.surroundings, stride),
            start: self.start,
            plan: plan(&traversal, self.grey),
            grey: self.grey,
            traversal,
        }
    }

    /// Whether one weight serves all channels.
    pub fn is_grey(&self) -> bool {
        self.grey
    }

    /// The constraint weights, one colour a row.
    pub fn weights(&self) -> CpuVector {
        CpuVector(self.constraints.iter().map(|pixel| [pixel.weight; 3]).collect())
    }

    /// The problem as methods solve it.
    ///
    /// Errors: [`Error::Value`] naming a bound.
    pub fn formulation(&self, settings: &SolveSettings) -> Result<Formulation<'_>> {
        let mut wanted = [0.0; 3];
        for (row, pixel) in self.constraints.iter().enumerate() {
            let color = self.wanted(row);
            for c in 0..3 {
                wanted[c] += f64::from(pixel.weight) * f64::from(color[c]).powi(2);
            }
        }
        Ok(Formulation {
            targets: &self.targets,
            weights: self.weights().0.into(),
            wanted,
            start: Start::Everywhere(self.start, self.maps.light_map.len()),
            lattice: Lattice { size: &self.maps.light_map.size, places: None },
            bounds: Formulation::bounds_of(settings)?,
            steering: None,
            remedy: "raise medium.sigma_t or medium.albedo",
        })
    }
}

/// Whether more than rounding is left of a row's lit weight without what comes from beside the map.
fn passes_the_map([lit, outside]: &[[f64; 3]; 2]) -> bool {
    (0..3).any(|c| lit[c] - outside[c] > 1e-12 * lit[c])
}

fn plan(traversal: &LightMapTraversal, grey: bool) -> WalkPlan {
    if grey { WalkPlan::new::<f32, 1>(traversal) } else { WalkPlan::new::<f32, 3>(traversal) }
}

/// What all rays of a scene share.
pub(super) fn transport(scene: &Scene, maps: &Maps, quadrature: Quadrature) -> LightMapTransport {
    LightMapTransport {
        sigma_t: scene.medium.sigma_t,
        shadow_map: maps.shadow_map.clone(),
        light_map: maps.light_map,
        basis: scene.solve.basis,
        quadrature,
        transmittance_bound: scene.solve.transmittance_bound,
        mask: None,
    }
}

/// Relative luminance of a linear Rec. 709 colour: what a white light map of the same brightness emits.
pub(super) fn luminance(color: Rgb) -> f32 {
    0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2]
}

pub(super) fn rgb(channel: impl Fn(usize) -> f32) -> Rgb {
    std::array::from_fn(channel)
}
