use std::sync::Arc;

use rayon::prelude::*;

use super::extents::fit_to;
use super::surfaces::lengths;
use super::surroundings::Shown;
use super::{Constraint, Formulation, Lattice, Maps, Start, Surfaces, Traced, constraints, evenly};
use crate::cpu::{HostOperator, kept_bytes};
#[cfg(feature = "gpu")]
use crate::gpu::{DeviceOperator, Gpu, GpuOperator, Kept, Walked};
use crate::march::{LightMapTransport, LightMapTraversal, ViewRay};
use crate::operator::{Bounds, CpuVector, WalkPlan};
#[cfg(feature = "gpu")]
use crate::operator::{HostRows, RowTable, Sum};
use crate::scene::{Quadrature, Rgb, RgbaImage, Scene, SolveSettings, Strategy, Target};
use crate::visibility::Geometry;
use crate::{Error, Result};

/// `T` of a light-map problem on the CPU in f32.
pub type LightMapOperator = HostOperator<LightMapTraversal>;

/// The painted pixels of a scene as rows, and what they should become.
///
/// The model is `scattered light = T x + surroundings`: x are the texels of the light map; outside the map the
/// light keeps its own radiance, which gives each row a constant share. Where the scene looks for its surroundings, too, they
/// are elements behind the texels, and a row is all that is seen: what surfaces show as well as what is scattered.
#[derive(Debug)]
pub struct LightMapProblem {
    /// The rows.
    pub constraints: Vec<Constraint>,
    /// Where the maps lie.
    pub maps: Maps,
    /// The rows of T.
    pub traversal: LightMapTraversal,
    /// The radiance that each row should have, without its surroundings: b. It is negative where the
    /// surroundings alone are too bright.
    pub targets: Vec<Rgb>,
    /// The radiance of each row that is known: what comes from outside the light map and is not looked for.
    pub surroundings: Vec<Rgb>,
    /// What each row shows under a white light as bright as the light is: what a tint is relative to.
    white: Vec<Rgb>,
    rule: Target,
    /// What the light map starts from: the radiance of the light.
    pub start: Rgb,
    /// What the elements behind the texels start from: the sun, where it is looked for, then the lights of the sky.
    pub further_start: Vec<Rgb>,
    /// What walking the rows will take.
    pub plan: WalkPlan,
    grey: bool,
}

impl LightMapProblem {
    /// Builds the hierarchy over the scene's triangles, paints the views, finds the depth behind every painted pixel, places the
    /// maps, and computes the targets.
    ///
    /// Errors: [`Error::Empty`] when nothing is painted or every painted pixel is in shadow; those of [`Geometry::new`].
    pub fn new(scene: &Scene) -> Result<Self> {
        Self::of(scene, &Arc::new(Geometry::new(scene.mesh.clone())?), constraints(scene)?, &Traced)
    }

    /// The same over a hierarchy that is there, which must be of the scene's triangles, from pixels that are painted already, with surfaces
    /// found in a way of the caller's.
    pub fn of(
        scene: &Scene,
        geometry: &Arc<Geometry>,
        constraints: Vec<Constraint>,
        surfaces: &dyn Surfaces,
    ) -> Result<Self> {
        let hits = surfaces.hits(scene, geometry, &constraints)?;
        let lengths = lengths(&hits);
        let maps = fit_to(scene, &scene.light_map, geometry, &constraints, &lengths, surfaces)?;
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
        let Rows { traversal, surroundings, white } =
            match Shown::new(scene, &maps, &constraints, &hits, &traversal)? {
                None => scattered(traversal, start)?,
                Some(Shown { surroundings, known, white }) => {
                    Rows { traversal: traversal.among(Arc::new(surroundings)), surroundings: known, white }
                }
            };
        let rows = constraints.iter().zip(&white).zip(&surroundings);
        let targets =
            rows.map(|((pixel, white), around)| target(scene.target, pixel, white, around)).collect();
        let grey = scene.medium.is_grey() && traversal.surroundings().is_none_or(|shown| shown.is_grey());
        let plan = WalkPlan::of(&traversal, grey);
        let further_start = scene.surroundings.as_ref().map_or(Vec::new(), |it| it.start(start));
        Ok(Self {
            constraints,
            maps,
            traversal,
            targets,
            surroundings,
            white,
            rule: scene.target,
            start,
            further_start,
            plan,
            grey,
        })
    }

    /// Paints the pixels of one view anew: their colours, weights and targets. The rows stay what they are.
    ///
    /// Shapes  painting: the view's picture
    pub fn repaint(&mut self, view: usize, painting: &RgbaImage) {
        let width = painting.size()[0];
        for row in 0..self.constraints.len() {
            let pixel = &mut self.constraints[row];
            if pixel.view != view {
                continue;
            }
            let [r, g, b, weight] = painting.pixels[pixel.y * width + pixel.x];
            (pixel.color, pixel.weight) = ([r, g, b], weight);
            self.targets[row] = target(self.rule, pixel, &self.white[row], &self.surroundings[row]);
        }
    }

    /// What all elements start from: the texels, then those behind them.
    pub fn starts(&self) -> Vec<Rgb> {
        self.all_starts().to_vec()
    }

    fn all_starts(&self) -> Start<'_> {
        Start::Then(self.start, self.maps.light_map.len(), &self.further_start)
    }

    /// The number of elements.
    pub fn elements(&self) -> usize {
        self.maps.light_map.len() + self.further_start.len()
    }

    /// The texels among all elements, and those behind them.
    pub fn parted<'a>(&self, elements: &'a [Rgb]) -> [&'a [Rgb]; 2] {
        let (texels, further) = elements.split_at(self.maps.light_map.len().min(elements.len()));
        [texels, further]
    }

    /// The weight of all texels on a row together.
    pub fn weight_of_texels(&self, row: usize) -> [f64; 3] {
        let along = self.traversal.inside_weight(row);
        match self.traversal.surroundings() {
            None => along,
            Some(shown) => {
                let reflected = shown.reflected(row).sum();
                std::array::from_fn(|c| along[c] + f64::from(reflected[c]))
            }
        }
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

    /// T on a graphics adapter: all rows kept there where `strategy` and the `budget` in bytes allow, else walked there, with kept
    /// rows of what they show beside their texels. `deterministic` sums are the same in every run.
    ///
    /// Errors: [`Error::TooLarge`] when all rows must be kept and exceed the budget, [`Error::AdapterMemory`];
    /// [`Error::Unsupported`] for light whose squares f32 does not hold.
    #[cfg(feature = "gpu")]
    pub fn on_gpu(
        &self,
        gpu: &Gpu,
        strategy: Strategy,
        budget: u64,
        deterministic: bool,
    ) -> Result<GpuOperator> {
        check_brightness(gpu, self.start)?;
        let on_host =
            |strategy| -> Result<Box<dyn HostRows>> { Ok(Box::new(self.operator_with(strategy, u64::MAX)?)) };
        let walked = || -> Result<Box<dyn DeviceOperator>> {
            let walked = Walked::light_map(gpu, &self.traversal, !self.grey, deterministic)?;
            let Some(beside) = self.traversal.beside() else { return Ok(Box::new(walked)) };
            let beside = Kept::new(gpu, RowTable::walked(&beside, self.grey), self.elements())?;
            Ok(Box::new(Sum::new(walked, beside)?))
        };
        let channels = if self.grey { 1 } else { 3 };
        GpuOperator::new(gpu, (&self.plan, channels), (strategy, budget), &on_host, &walked)
    }

    /// The radiance that a row should have, all told.
    pub fn wanted(&self, row: usize) -> Rgb {
        rgb(|c| self.targets[row][c] + self.surroundings[row][c])
    }

    /// The share of the painted pixels' light that comes from outside the light map, where it keeps its colour.
    pub fn share_from_outside(&self) -> f64 {
        let sum = |weight: [f64; 3]| weight.iter().sum::<f64>();
        let rows = (0..self.constraints.len()).filter(|&row| self.constraints[row].weight > 0.0);
        let (outside, all) = rows.fold((0.0, 0.0), |(outside, all), row| {
            (outside + sum(self.traversal.surrounding_weight(row)), all + sum(self.traversal.lit_weight(row)))
        });
        outside / all
    }

    /// The problem of `rows` of its rows, evenly spread; of all where there are not as many.
    pub fn sampled(&self, rows: usize) -> Self {
        self.picked(&evenly(rows, self.constraints.len()))
    }

    /// The problem of some of its rows.
    pub fn picked(&self, rows: &[usize]) -> Self {
        fn of<T: Copy>(values: &[T], rows: &[usize]) -> Vec<T> {
            rows.iter().map(|&row| values[row]).collect()
        }
        let traversal = self.traversal.picked(rows);
        Self {
            constraints: of(&self.constraints, rows),
            maps: self.maps.clone(),
            targets: of(&self.targets, rows),
            surroundings: of(&self.surroundings, rows),
            white: of(&self.white, rows),
            rule: self.rule,
            start: self.start,
            further_start: self.further_start.clone(),
            plan: WalkPlan::of(&traversal, self.grey),
            grey: self.grey,
            traversal,
        }
    }

    /// Bytes that keeping all rows takes on the processor, foreseen.
    pub fn kept_bytes(&self) -> u64 {
        kept_bytes::<f32>(&self.plan, if self.grey { 1 } else { 3 })
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
            start: self.all_starts(),
            lattice: Lattice { size: &self.maps.light_map.size, places: None },
            bounds: match Formulation::bounds_of(settings)? {
                of_texels if self.further_start.is_empty() || !settings.solver.keeps_bounds() => of_texels,
                of_texels => of_texels.then(self.maps.light_map.len(), Bounds::NOT_NEGATIVE),
            },
            steering: None,
            remedy: "raise medium.sigma_t or medium.albedo",
        })
    }
}

/// Sums of squares are made in f32 on an adapter: those of fainter light would be zero, and of brighter light infinite.
///
/// Errors: [`Error::Unsupported`].
#[cfg(feature = "gpu")]
fn check_brightness(gpu: &Gpu, light: Rgb) -> Result<()> {
    const HELD: std::ops::RangeInclusive<f32> = 1e-15..=1e15;
    let brightest = light.into_iter().fold(0.0, f32::max);
    if brightest == 0.0 || HELD.contains(&brightest) {
        return Ok(());
    }
    Err(Error::Unsupported {
        adapter: gpu.record().name.clone(),
        problem: format!(
            "computes sums in f32, and a light of radiance {brightest:e} is beyond what they hold"
        ),
        remedy: "use another unit, in which light.radiance is from 1e-15 to 1e15, or use --backend cpu",
    })
}

/// What is wanted of a row beyond what is known of it.
fn target(rule: Target, pixel: &Constraint, white: &Rgb, known: &Rgb) -> Rgb {
    rgb(|c| match rule {
        Target::Tint => pixel.color[c] * white[c] - known[c],
        Target::Radiance => pixel.color[c] - known[c],
    })
}

/// What the rows are, and what of them is known.
struct Rows {
    traversal: LightMapTraversal,
    surroundings: Vec<Rgb>,
    /// What is seen under a white light as bright as the light is.
    white: Vec<Rgb>,
}

/// Rows of scattered light alone.
fn scattered(traversal: LightMapTraversal, start: Rgb) -> Result<Rows> {
    let count = traversal.rays().len();
    let shares: Vec<[[f64; 3]; 2]> = (0..count)
        .into_par_iter()
        .map(|row| [traversal.lit_weight(row), traversal.surrounding_weight(row)])
        .collect();
    if shares.iter().all(|share| !passes_the_map(share)) {
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
    let brightness = luminance(start);
    Ok(Rows {
        traversal,
        surroundings: shares.iter().map(|[_, outside]| rgb(|c| outside[c] as f32 * start[c])).collect(),
        white: shares.iter().map(|[lit, _]| rgb(|c| lit[c] as f32 * brightness)).collect(),
    })
}

/// Whether more than rounding is left of a row's lit weight without what comes from beside the map.
fn passes_the_map([lit, outside]: &[[f64; 3]; 2]) -> bool {
    (0..3).any(|c| lit[c] - outside[c] > 1e-12 * lit[c])
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
