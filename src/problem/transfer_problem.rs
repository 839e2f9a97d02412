//! Transfer functions behind painted strokes.

use std::sync::Arc;

use super::constraints::RowRadiance;
#[cfg(feature = "gpu")]
use super::looked_for::on_gpu;
use super::looked_for::{explicit, on_host, row_of};
use super::solved::not_finite;
use super::transfer::not_a_number;
use super::{
    Constraint, Formulation, Lattice, LightMapProblem, Nouns, Part, Problem, Solved, Start, Surfaces,
    TransferFunction, TransferTable, Unskipped,
};
#[cfg(feature = "gpu")]
use crate::gpu::{DeviceOperator, Gpu, GpuOperator, Kept};
use crate::march::{Lookup, TableTraversal, ViewRay};
#[cfg(feature = "gpu")]
use crate::operator::RowTable;
use crate::operator::{CpuVector, OnHost, WalkPlan};
use crate::scene::{Looks, Quadrature, Rgb, Scene, SolveSettings, Strategy, Transfer, TransferRole, rgb};
use crate::sparse::ExplicitMatrix;
use crate::visibility::Geometry;
use crate::{Error, Result};

/// A transfer function that is looked for behind painted strokes.
///
/// The model is `scattered light = T x + known radiance`, with x the texels of the function. It is linear in them, since what a ray's
/// properties are and what light it scatters do not depend on them.
#[derive(Debug, Clone)]
pub struct TransferProblem {
    /// The painted pixels, with what they show under the function as it is.
    pub pixels: LightMapProblem,
    /// The function as it is, from which the solve starts.
    pub table: TransferTable,
    /// The rows of T.
    pub traversal: TableTraversal,
    /// Texels side by side.
    pairs: Vec<[u32; 2]>,
    /// All texels: what no pixel looks up is spread to.
    joined: Vec<u32>,
    plan: WalkPlan,
}

impl TransferProblem {
    /// The problem of pixels that are painted already. Where the scene has no transfer function the solve starts from one that is white.
    ///
    /// Errors: [`Error::Empty`] for surroundings that are looked for, for more than one function, and for one without strength; as
    /// [`LightMapProblem::of`].
    pub fn of(
        scene: &Scene,
        geometry: &Arc<Geometry>,
        constraints: Vec<Constraint>,
        surfaces: &dyn Surfaces,
    ) -> Result<Self> {
        let empty = |reason: &str, remedy| Error::Empty { reason: reason.to_owned(), remedy };
        if scene.surroundings.is_some() {
            let reason =
                "a transfer function colours scattered light alone, and `surroundings` are about all light";
            return Err(empty(reason, "take `surroundings` away, or set find=light-map"));
        }
        let looks = Looks { transfer: Vec::new(), ..scene.looks.clone() };
        let as_it_is =
            LightMapProblem::of(&Scene { looks, ..scene.clone() }, geometry, constraints, surfaces)?;
        let maps = &as_it_is.maps;
        let light = (&maps.frame, &*maps.shadow_map);
        let table = match TransferFunction::of(scene, geometry, light)? {
            None => TransferTable::new(&Transfer::default(), scene, geometry, light)?,
            Some(function) => match function.tables() {
                [table] => table.clone(),
                _ => return Err(empty("there are several transfer functions", "give the scene one")),
            },
        };
        if table.strength == 0.0 {
            return Err(empty("looks.transfer.strength is 0", "raise looks.transfer.strength"));
        }
        let lookup = |(pixel, (ray, scattered)): (&Constraint, (&ViewRay, &Rgb))| Lookup {
            corners: table.corners_of(ray, &maps.shadow_map),
            white: match table.role {
                TransferRole::Factor => scattered.map(|value| table.strength * f64::from(value)),
                TransferRole::Color => {
                    let seen = scene.views[pixel.view].camera.pixel_ray(pixel.x, pixel.y);
                    [table.strength * table.white * maps.air_factor(&seen, ray.length); 3]
                }
            },
        };
        let rows = as_it_is.traversal.rays().iter().zip(&as_it_is.plain);
        let rows = as_it_is.constraints.iter().zip(rows);
        let traversal = TableTraversal::new(table.texels.len(), rows.map(lookup).collect::<Vec<_>>());
        let radiance = radiance(&table, &traversal, &as_it_is);
        let pixels = as_it_is.showing(radiance);
        Ok(Self {
            plan: WalkPlan::of(&traversal, traversal.is_grey()),
            pairs: pairs(table.size),
            joined: (0..table.texels.len() as u32).collect(),
            pixels,
            table,
            traversal,
        })
    }

    /// The function with other texels.
    pub fn function(&self, texels: Vec<Rgb>) -> TransferFunction {
        TransferFunction::one(TransferTable { texels, ..self.table.clone() })
    }
}

/// What rows show: the part that no texel changes, all of it under the function as it is, and that under a white light.
fn radiance(table: &TransferTable, rows: &TableTraversal, as_it_is: &LightMapProblem) -> RowRadiance {
    let of = |scattered: &[Rgb], share: f64| -> Vec<Rgb> {
        let of_row = |(row, scattered): (usize, &Rgb)| {
            let Lookup { corners, white } = rows.lookups()[row];
            let color = corners.iter().fold([0.0; 3], |sum, &(texel, weight)| {
                [0, 1, 2].map(|c| sum[c] + weight * f64::from(table.texels[texel][c]))
            });
            rgb(|c| {
                // Rows are of the light as it is, and white light scatters another share.
                let white = match table.role {
                    TransferRole::Factor => table.strength * f64::from(scattered[c]),
                    TransferRole::Color => white[c],
                };
                ((1.0 - table.strength) * f64::from(scattered[c]) + share * white * color[c]) as f32
            })
        };
        scattered.iter().enumerate().map(of_row).collect()
    };
    RowRadiance {
        known: of(&as_it_is.plain, 0.0),
        plain: of(&as_it_is.plain, 1.0),
        white: of(as_it_is.white(), 1.0),
    }
}

/// Numbers of texels side by side, along both axes.
fn pairs([width, height]: [usize; 2]) -> Vec<[u32; 2]> {
    let texels = (0..width * height).map(|texel| (texel, texel % width, texel / width));
    let beside = |(texel, i, j): (usize, usize, usize)| {
        let right = (i + 1 < width).then_some([texel, texel + 1]);
        let below = (j + 1 < height).then_some([texel, texel + width]);
        right.into_iter().chain(below).map(|pair| pair.map(|texel| texel as u32))
    };
    texels.flat_map(beside).collect()
}

impl Problem for TransferProblem {
    fn targets(&self) -> &[Rgb] {
        &self.pixels.targets
    }

    fn weights(&self) -> CpuVector {
        self.pixels.weights()
    }

    fn pixel(&self, row: usize) -> [usize; 2] {
        self.pixels.pixel(row)
    }

    fn plan(&self) -> &WalkPlan {
        &self.plan
    }

    fn is_grey(&self) -> bool {
        self.traversal.is_grey()
    }

    fn formulation(&self, settings: &SolveSettings) -> Result<Formulation<'_>> {
        let texels = Part {
            noun: "texels",
            start: Start::Each(&self.table.texels),
            bounds: settings.solver.kept(settings.bounds),
            pull: 1.0,
            pairs: &self.pairs,
            joined: &self.joined,
            fade: 0.0,
            lattice: Some(Lattice { size: &self.table.size, places: None }),
            scale: 0,
        };
        Ok(Formulation { parts: vec![texels], ..self.pixels.formulation(settings)? })
    }

    fn complete(&self, _settings: &SolveSettings, solved: Solved) -> Result<Solved> {
        match not_finite(&solved.x) {
            None => Ok(solved),
            Some(texel) => Err(not_a_number(texel, self.table.size)),
        }
    }

    fn picked(&self, rows: &[usize]) -> Box<dyn Problem> {
        let traversal = self.traversal.picked(rows);
        Box::new(Self {
            pixels: self.pixels.of_some(rows),
            plan: WalkPlan::of(&traversal, traversal.is_grey()),
            traversal,
            ..self.clone()
        })
    }

    fn integrated(&self, quadrature: Quadrature, bound: Option<f64>) -> Option<Box<dyn Problem>> {
        let is_same = quadrature == Quadrature::Exact && bound.is_none();
        is_same.then(|| Box::new(self.clone()) as Box<dyn Problem>)
    }

    fn unskipped(&self) -> Option<Unskipped> {
        None
    }

    fn most_lost(&self) -> Option<f64> {
        None
    }

    fn replan(&mut self) {
        self.plan = WalkPlan::of(&self.traversal, self.is_grey());
    }

    fn row(&self, row: usize, visit: &mut dyn FnMut(usize, [f64; 3])) {
        row_of(&self.traversal, self.is_grey(), row, visit);
    }

    fn on_cpu(&self, strategy: Strategy, budget: u64) -> Result<OnHost> {
        on_host(&self.traversal, (self.is_grey(), &self.plan), (strategy, budget))
    }

    fn wide(&self, strategy: Strategy) -> Result<OnHost<f64>> {
        on_host(&self.traversal, (self.is_grey(), &self.plan), (strategy, u64::MAX))
    }

    /// Rows of four weights are always kept: walking them would read as much.
    #[cfg(feature = "gpu")]
    fn on_gpu(
        &self,
        gpu: &Gpu,
        strategy: Strategy,
        budget: u64,
        _deterministic: bool,
    ) -> Result<GpuOperator> {
        let kept = || -> Result<Box<dyn DeviceOperator>> {
            let table = RowTable::walked(&self.traversal, self.is_grey());
            Ok(Box::new(Kept::new(gpu, table, self.candidates())?))
        };
        on_gpu(&self.traversal, (self.is_grey(), &self.plan), gpu, (strategy, budget), &kept)
    }

    fn explicit(&self, most: u64) -> Result<ExplicitMatrix> {
        explicit(&self.traversal, self.is_grey(), most)
    }

    fn candidates(&self) -> usize {
        self.table.texels.len()
    }

    fn prepared_bytes(&self) -> u64 {
        self.pixels.prepared_bytes()
    }

    fn ray_bytes(&self) -> u64 {
        self.pixels.ray_bytes() + (self.rows() * size_of::<Lookup>()) as u64
    }

    fn digest(&self, add: &mut dyn FnMut(u64)) {
        self.pixels.digest(add);
        for Lookup { corners, white } in self.traversal.lookups() {
            corners.iter().map(|(_, share)| share).chain(white).for_each(|number| add(number.to_bits()));
        }
    }

    fn skipped(&self) -> Vec<(&'static str, [usize; 2])> {
        Vec::new()
    }

    fn nouns(&self) -> Nouns {
        Nouns::new("transfer function", "painted pixel", "paint")
    }

    fn settings_in_words(&self) -> Vec<(&'static str, String)> {
        let TransferTable { role, axes: [first, second], size: [width, height], far, strength, .. } =
            &self.table;
        let lower = |axis: &dyn std::fmt::Debug| format!("{axis:?}").to_lowercase();
        vec![
            ("function", format!("{width} × {height} texels over {} and {}", lower(first), lower(second))),
            ("colours", format!("a {} of strength {strength}, to a depth of {far:.3}", lower(role))),
        ]
    }
}
