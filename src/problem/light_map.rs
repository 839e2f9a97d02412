use std::collections::BTreeSet;
use std::sync::Arc;

use rayon::prelude::*;

use super::colors::Colors;
use super::constraints::{RowRadiance, wished};
use super::fill::fill;
use super::lit_texels::lit_texels;
use super::looked_for::{Nouns, explicit, row_of};
use super::painted_rows::PaintedRows;
use super::solved::not_finite;
use super::surroundings::AllLight;
use super::{
    Constraint, Formulation, Lattice, Maps, Painting, Part, Problem, SlicedProblem, Solved, Start, Surfaces,
    Traced, Unskipped, constraints,
};
use crate::cpu::{HostOperator, Mixed};
#[cfg(feature = "gpu")]
use crate::gpu::{DeviceOperator, Gpu, GpuOperator, Kept, Walked};
use crate::march::{
    EpipolarSettings, EpipolarTraversal, FurtherWeights, LightMapTransport, LightMapTraversal, Real, ViewRay,
};
use crate::operator::{CpuVector, OnHost, WalkPlan, parallel};
#[cfg(feature = "gpu")]
use crate::operator::{HostRows, RowTable, Sum};
use crate::scene::{
    Camera, Fade, Opacity, Quadrature, RegularizationWeight, Rgb, Scene, SolveSettings, Strategy, Target,
    luminance, rgb,
};
use crate::sparse::ExplicitMatrix;
use crate::visibility::{Geometry, ShadowMap};
use crate::{Error, Result};

/// Bytes a texel that finding lit texels and making cells of them takes.
const JOINED: usize = 32;

/// The painted pixels of a scene as rows, and what they should become.
///
/// The model is `scattered light = T x + known radiance`, with x the texels of the light map. Outside the map the light keeps its
/// own radiance, which gives each row a constant share. Where the scene looks for its surroundings, too, they are elements
/// behind the texels. A row is then all that is seen: what surfaces show as well as what is scattered.
#[derive(Debug, Clone)]
pub struct LightMapProblem {
    /// The rows.
    pub constraints: Vec<Constraint>,
    /// Where the maps lie.
    pub maps: Maps,
    /// The rows of T.
    pub traversal: LightMapTraversal,
    /// b of each row: the radiance that it should have, less its known radiance. It is negative where that alone is too bright.
    pub targets: Vec<Rgb>,
    /// The radiance of each row that no unknown changes: what comes from outside the light map and is not looked for.
    pub known_radiance: Vec<Rgb>,
    /// The radiance of each row under the lights as they are.
    pub plain: Vec<Rgb>,
    /// The radiance of each row under lights as bright as they are, but white.
    white: Vec<Rgb>,
    /// What a painted colour asks for.
    rule: Target,
    /// What the opacity of paint asks for.
    opacity: Opacity,
    /// The weight of pixels of each view that should stay as they are.
    keep: Vec<f32>,
    /// What the light map starts from: the radiance of the light.
    pub start: Rgb,
    /// What the elements behind the texels start from: the sun, where it is looked for, then the lights of the sky.
    pub further_start: Vec<Rgb>,
    /// The texels that some view sees lit; none where nothing spreads to them.
    lit: Arc<[u32]>,
    /// What walking the rows will take.
    plan: WalkPlan,
    colors: Colors,
    /// The camera of each view.
    cameras: Arc<[Camera]>,
    /// Whether what rows show is their weight, all of it and that from outside the map, times the light's radiance.
    knows_weights: bool,
}

impl LightMapProblem {
    /// Builds the hierarchy over the scene's triangles, paints the views, finds the depth behind every painted pixel, places the
    /// maps, and computes the targets.
    ///
    /// Errors: [`Error::Empty`] when nothing is painted or every painted pixel is in shadow; those of [`Geometry::new`].
    pub fn new(scene: &Scene) -> Result<Self> {
        Self::of(scene, &Arc::new(Geometry::new(scene.mesh.clone())?), constraints(scene)?, &Traced)
    }

    /// The problem of pixels that are painted already. `geometry` must be the hierarchy over the scene's triangles, and `surfaces`
    /// finds what the rays meet.
    ///
    /// Errors: [`Error::Empty`] when every painted pixel is in shadow or in light from beside the light map alone; [`Error::Value`] for maps
    /// without area; those of `surfaces`.
    pub fn of(
        scene: &Scene,
        geometry: &Arc<Geometry>,
        constraints: Vec<Constraint>,
        surfaces: &dyn Surfaces,
    ) -> Result<Self> {
        Self::before_suns(vec![(scene, constraints)], geometry, surfaces)
    }

    /// One light map before the suns of several scenes, one at a time: all pixels are rows, those of later scenes in views that are counted
    /// behind. A texel is radiance of the first sun, and passes the same part of the others'. The scenes are alike but for sun, cameras, paint and looks, and say
    /// where the light map lies; of the first one are settings and maps.
    ///
    /// Errors: as [`Self::of`]; [`Error::Value`] for a sun that has light in a channel in which the first one has none.
    pub fn before_suns(
        scenes: Vec<(&Scene, Vec<Constraint>)>,
        geometry: &Arc<Geometry>,
        surfaces: &dyn Surfaces,
    ) -> Result<Self> {
        let all: Vec<&Scene> = scenes.iter().map(|(scene, _)| *scene).collect();
        let scene = all[0];
        let PaintedRows { constraints, hits, maps: of_each, added, traversal, is_grey } =
            PaintedRows::new(scenes, geometry, surfaces)?;
        let maps = of_each[0].clone();
        check_replaced(&maps, traversal.rays())?;
        if all.len() > 1 && all.iter().any(|scene| scene.surroundings.is_some()) {
            return Err(Error::Empty {
                reason: "several suns shine through one light map, and `surroundings` are those of one"
                    .to_owned(),
                remedy: "take `surroundings` away",
            });
        }
        let start = scene.light.radiance;
        let (traversal, mut radiance) = match AllLight::new(scene, &maps, &constraints, &hits, &traversal)? {
            None => {
                let radiance = of_scattered_light(&traversal, start)?;
                (traversal, radiance)
            }
            Some(AllLight { further, radiance }) => (traversal.with_further(Arc::new(further)), radiance),
        };
        if let Some(suns) = traversal.suns() {
            let lights: Vec<Rgb> = all.iter().map(|scene| scene.light.radiance).collect();
            radiance.white_of(&lights, &suns.of_rows);
        }
        radiance.add(&added);
        let RowRadiance { known: known_radiance, plain, white } = radiance;
        let colors = Colors::of(&traversal, geometry, is_grey);
        let plan = WalkPlan::of(&traversal, colors.are_grey());
        let spreads = scene.solve.fade != Fade::Nowhere
            && scene.solve.regularization.gradient != RegularizationWeight::Relative(0.0);
        let lit = if spreads { seen_lit(&all, &of_each) } else { Arc::default() };
        let further_start = scene.surroundings.as_ref().map_or(Vec::new(), |it| it.start(start));
        let adds = maps.transfer.as_ref().is_some_and(|it| it.adds());
        let knows_weights = further_start.is_empty() && start.iter().all(|&light| light > 0.0) && !adds;
        let mut problem = Self {
            knows_weights,
            constraints,
            maps,
            traversal,
            targets: Vec::new(),
            known_radiance,
            plain,
            white,
            rule: scene.target,
            opacity: scene.opacity,
            keep: all.iter().flat_map(|scene| &scene.views).map(|view| view.keep).collect(),
            start,
            further_start,
            lit,
            plan,
            colors,
            cameras: all.iter().flat_map(|scene| &scene.views).map(|view| view.camera.clone()).collect(),
        };
        problem.targets = (0..problem.constraints.len()).map(|row| problem.target(row)).collect();
        Ok(problem)
    }

    /// The same pixels, which show something else: what is looked for behind them is no light map.
    pub(super) fn showing(mut self, RowRadiance { known, plain, white }: RowRadiance) -> Self {
        (self.known_radiance, self.plain, self.white) = (known, plain, white);
        self.knows_weights = false;
        self.targets = (0..self.constraints.len()).map(|row| self.target(row)).collect();
        self
    }

    /// The radiance of each row under lights as bright as they are, but white.
    pub(super) fn white(&self) -> &[Rgb] {
        &self.white
    }

    /// b of a row, as its pixel asks for it.
    fn target(&self, row: usize) -> Rgb {
        let wanted = wanted(self.rule, &self.constraints[row], [&self.plain[row], &self.white[row]]);
        rgb(|c| wanted[c] - self.known_radiance[row][c])
    }

    /// The distance over which what was found fades, in metres; none where it does not go beyond what rows reach.
    pub fn fade_length(&self, fade: Fade) -> Option<f64> {
        let extent = self.maps.light_map.extent;
        match fade {
            Fade::Nowhere => None,
            Fade::OfMap(part) => Some(part * (extent.max - extent.min).element_product().sqrt()),
            Fade::Metres(length) => Some(length),
        }
    }

    /// 1 / ℓ², with ℓ that distance in texels; 0 where there is none.
    fn fade(&self, fade: Fade) -> f64 {
        let texels = self.maps.light_map.density().element_product().sqrt();
        self.fade_length(fade).map_or(0.0, |length| (length * texels).powi(-2))
    }

    /// Paints the pixels of one view anew: their colours, weights and targets. The rows stay what they are.
    ///
    /// Shapes  painting: the view's picture
    pub fn repaint(&mut self, view: usize, painting: &Painting) {
        for row in 0..self.constraints.len() {
            let pixel = &mut self.constraints[row];
            if pixel.view != view {
                continue;
            }
            *pixel = wished(*pixel, painting, (self.opacity, self.keep[view]));
            self.targets[row] = self.target(row);
        }
    }

    /// What all elements start from: the texels, then those behind them.
    pub fn starts(&self) -> Vec<Rgb> {
        let mut starts = vec![self.start; self.maps.light_map.len()];
        starts.extend(&self.further_start);
        starts
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

    /// Whether no light of the sun is scattered towards the eye along a row.
    pub fn is_dark(&self, row: usize) -> bool {
        let shows_nothing = self.plain[row] == [0.0; 3];
        if self.knows_weights { shows_nothing } else { self.traversal.lit_weight(row) == [0.0; 3] }
    }

    /// The weight of all texels on a row together.
    pub fn weight_of_texels(&self, row: usize) -> [f64; 3] {
        if self.knows_weights {
            return rgb(|c| (self.plain[row][c] - self.known_radiance[row][c]) / self.start[c])
                .map(f64::from);
        }
        let along = self.traversal.inside_weight(row);
        match self.traversal.further_weights() {
            None => along,
            Some(shown) => {
                let reflected = shown.reflected(row).sum();
                std::array::from_fn(|c| along[c] + f64::from(reflected[c]))
            }
        }
    }

    /// The radiance that a row should have, all told.
    pub fn wanted(&self, row: usize) -> Rgb {
        rgb(|c| self.targets[row][c] + self.known_radiance[row][c])
    }

    /// The share of the painted pixels' light that comes from outside the light map, where it keeps its colour.
    pub fn share_from_outside(&self) -> f64 {
        let sum = |weight: [f64; 3]| weight.iter().sum::<f64>();
        let is_known = self.knows_weights;
        let known = |radiance: Rgb| rgb(|c| radiance[c] / self.start[c]).map(f64::from);
        let of = |row: usize| match is_known {
            true => [known(self.known_radiance[row]), known(self.plain[row])].map(sum),
            false => [self.traversal.outside_weight(row), self.traversal.lit_weight(row)].map(sum),
        };
        let rows = parallel::map(self.rows(), &|row| match self.constraints[row].is_painted() {
            true => of(row),
            false => [0.0; 2],
        });
        let [outside, all] = rows.iter().fold([0.0; 2], |sums, row| [sums[0] + row[0], sums[1] + row[1]]);
        outside / all
    }

    /// The problem of some of its rows.
    pub fn of_some(&self, rows: &[usize]) -> Self {
        fn of<T: Copy>(values: &[T], rows: &[usize]) -> Vec<T> {
            rows.iter().map(|&row| values[row]).collect()
        }
        let traversal = self.traversal.picked(rows);
        let colors = self.colors.picked(rows);
        Self {
            constraints: of(&self.constraints, rows),
            maps: self.maps.clone(),
            targets: of(&self.targets, rows),
            known_radiance: of(&self.known_radiance, rows),
            plain: of(&self.plain, rows),
            white: of(&self.white, rows),
            keep: self.keep.clone(),
            further_start: self.further_start.clone(),
            lit: self.lit.clone(),
            cameras: self.cameras.clone(),
            plan: WalkPlan::of(&traversal, colors.are_grey()),
            colors,
            traversal,
            ..*self
        }
    }

    /// The same problem along other rows of the same rays.
    fn along(&self, traversal: LightMapTraversal) -> Self {
        Self { plan: WalkPlan::of(&traversal, self.is_grey()), traversal, ..self.clone() }
    }

    /// The angle between the ray of a row and those of the pixels beside it, in radians.
    pub(super) fn pixel_angle(&self, row: usize) -> f64 {
        let Constraint { view, x, y, .. } = self.constraints[row];
        self.cameras[view].pixel_angle(x, y)
    }

    /// T on the processor.
    fn on_host<F: Real>(
        &self,
        strategy: Strategy,
        budget: u64,
    ) -> Result<HostOperator<LightMapTraversal, F>> {
        match &self.colors {
            Colors::Some(colored) => {
                let is_grey = |row: &usize| colored.binary_search(row).is_err();
                let grey: Vec<usize> = (0..self.rows()).filter(is_grey).collect();
                let parts = [&grey[..], colored].map(|rows| self.traversal.picked(rows));
                Ok(HostOperator::Mixed(Mixed::new(parts, colored, strategy, budget)?))
            }
            colors => {
                HostOperator::new(self.traversal.clone(), colors.are_grey(), &self.plan, strategy, budget)
            }
        }
    }
}

impl Problem for LightMapProblem {
    fn targets(&self) -> &[Rgb] {
        &self.targets
    }

    fn weights(&self) -> CpuVector {
        CpuVector(self.constraints.iter().map(|pixel| [pixel.weight; 3]).collect())
    }

    fn pixel(&self, row: usize) -> [usize; 2] {
        let Constraint { view, x, y, .. } = self.constraints[row];
        [view, y * self.cameras[view].size()[0] + x]
    }

    fn plan(&self) -> &WalkPlan {
        &self.plan
    }

    fn is_grey(&self) -> bool {
        self.colors.are_grey()
    }

    fn formulation(&self, settings: &SolveSettings) -> Result<Formulation<'_>> {
        let mut wanted = [0.0; 3];
        for (row, pixel) in self.constraints.iter().enumerate() {
            let color = self.wanted(row);
            for c in 0..3 {
                wanted[c] += f64::from(pixel.weight) * f64::from(color[c]).powi(2);
            }
        }
        let fade = self.fade(settings.fade);
        let texels = Part {
            noun: "texels",
            start: Start::Everywhere(self.start, self.maps.light_map.len()),
            bounds: settings.solver.kept(settings.bounds),
            pull: 1.0,
            pairs: &[],
            joined: if fade > 0.0 { &self.lit } else { &[] },
            fade,
            lattice: Some(Lattice { size: &self.maps.light_map.size, places: None }),
            scale: 0,
        };
        // In every row, and so far longer than the column of a texel.
        let start = Start::Each(&self.further_start);
        let bounds = settings.solver.kept([[0.0; 3], [f64::INFINITY; 3]]);
        let others = Part { noun: "lights", start, bounds, lattice: None, scale: 1, joined: &[], ..texels };
        Ok(Formulation {
            held_out: None,
            targets: (&self.targets).into(),
            weights: self.weights().0.into(),
            wanted,
            parts: if start.is_empty() { vec![texels] } else { vec![texels, others] },
            remedy: "raise medium.sigma_t or medium.albedo",
        })
    }

    fn complete(&self, settings: &SolveSettings, mut solved: Solved) -> Result<Solved> {
        let texels = self.maps.light_map.len();
        if let Some(index) = not_finite(&solved.x) {
            let width = self.maps.light_map.size[0];
            let (what, place) = match index.checked_sub(texels) {
                None => ("the light map", format!("texel ({}, {})", index % width, index / width)),
                Some(further) => ("the light around it", format!("unknown {further}")),
            };
            return Err(Error::NonFinite { what: what.to_owned(), place });
        }
        if settings.fill {
            let further = solved.x.split_off(texels);
            // What smoothness has spread to is known as what rows reach is.
            let mut known: Vec<u32> = solved
                .columns
                .iter()
                .chain(&*self.lit)
                .copied()
                .filter(|&it| (it as usize) < texels)
                .collect();
            known.sort_unstable();
            known.dedup();
            solved.x = fill(self.maps.light_map.size, &known, solved.x)?;
            solved.x.extend(further);
        }
        Ok(solved)
    }

    fn picked(&self, rows: &[usize]) -> Box<dyn Problem> {
        Box::new(self.of_some(rows))
    }

    fn integrated(
        &self,
        quadrature: Quadrature,
        transmittance_bound: Option<f64>,
    ) -> Option<Box<dyn Problem>> {
        let mut transport = self.traversal.transport().clone();
        transport.quadrature = quadrature;
        transport.transmittance_bound = transmittance_bound.unwrap_or(transport.transmittance_bound);
        Some(Box::new(self.along(self.traversal.through(transport))))
    }

    fn unskipped(&self) -> Option<Unskipped> {
        let transport = self.traversal.transport();
        let shadow_map = Arc::new((*transport.shadow_map).clone().without_pyramid());
        let texels =
            self.along(self.traversal.through(LightMapTransport { shadow_map, ..transport.clone() }));
        let nodes = |problem: &Self| {
            (0..problem.rows()).map(|row| problem.traversal.extent(row).shadow_nodes).sum::<usize>() as f64
        };
        Some(Unskipped {
            what: "texels of even shadow or light",
            switch: "solve.skip.shadows=false",
            unit: "nodes of the shadow map",
            work: [nodes(self), nodes(&texels)],
            problem: Box::new(texels),
        })
    }

    fn sliced(&self, settings: EpipolarSettings) -> Option<Result<Box<dyn Problem>>> {
        let sliced = || -> Result<Box<dyn Problem>> {
            let rows = EpipolarTraversal::new(&self.traversal, &|row| self.pixel_angle(row), settings)?;
            Ok(Box::new(SlicedProblem::new(Box::new(self.clone()), rows, settings)))
        };
        Some(sliced())
    }

    fn most_lost(&self) -> Option<f64> {
        let most = |row: &ViewRay| row.scattering.iter().copied().fold(0.0, f64::max);
        let squares = self.traversal.rays().iter().map(|row| most(row).powi(2)).sum::<f64>();
        Some((3.0 * squares).sqrt() * self.traversal.transport().transmittance_bound)
    }

    fn replan(&mut self) {
        self.plan = WalkPlan::of(&self.traversal, self.is_grey());
    }

    fn row(&self, row: usize, visit: &mut dyn FnMut(usize, [f64; 3])) {
        row_of(&self.traversal, self.is_grey(), row, visit);
    }

    fn on_cpu(&self, strategy: Strategy, budget: u64) -> Result<OnHost> {
        Ok(Box::new(self.on_host::<f32>(strategy, budget)?))
    }

    fn wide(&self, strategy: Strategy) -> Result<OnHost<f64>> {
        Ok(Box::new(self.on_host::<f64>(strategy, u64::MAX)?))
    }

    /// All rows are kept where that is possible. Else the texels along the rays are walked, and the further weights are kept.
    ///
    /// Errors: [`Error::Unsupported`] for light whose squares f32 does not hold.
    #[cfg(feature = "gpu")]
    fn on_gpu(&self, gpu: &Gpu, strategy: Strategy, budget: u64, deterministic: bool) -> Result<GpuOperator> {
        check_brightness(gpu, self.start)?;
        let walked = || -> Result<Box<dyn DeviceOperator>> {
            if self.traversal.suns().is_some() {
                return Err(Error::Unsupported {
                    adapter: gpu.record().name.clone(),
                    problem: "walks rows under one sun alone, and these are under several".to_owned(),
                    remedy: "set solve.strategy=assembled, raise solve.memory, or compute on the processor",
                });
            }
            let Some(beside) = self.traversal.beside() else {
                return Ok(Box::new(Walked::light_map(
                    gpu,
                    &self.traversal,
                    !self.is_grey(),
                    deterministic,
                )?));
            };
            let is_colored = matches!(self.colors, Colors::All);
            let walked = self.traversal.before_panes();
            let walked = Walked::light_map(gpu, &walked, is_colored, deterministic)?;
            let beside = Kept::new(gpu, RowTable::walked(&beside, self.is_grey()), self.elements())?;
            Ok(Box::new(Sum::new(walked, beside)?))
        };
        let on_host = |strategy| -> Result<Box<dyn HostRows>> {
            Ok(Box::new(self.on_host::<f32>(strategy, u64::MAX)?))
        };
        let channels = if self.is_grey() { 1 } else { 3 };
        GpuOperator::new(gpu, (&self.plan, channels), (strategy, budget), &on_host, &walked)
    }

    fn explicit(&self, most: u64) -> Result<ExplicitMatrix> {
        explicit(&self.traversal, self.is_grey(), most)
    }

    fn candidates(&self) -> usize {
        self.elements()
    }

    fn prepared_bytes(&self) -> u64 {
        let sky: usize = self.maps.sky.iter().map(|beam| beam.shadow_map.grid().len()).sum();
        let suns = self.traversal.suns().map_or(1, |suns| suns.shadow_maps.len());
        let texels = suns * self.maps.shadow_map.grid().len() + sky;
        let weights = FurtherWeights::bytes(self.rows(), self.further_start.len());
        // Numbers of lit texels, and cells over them.
        let joined = if self.lit.is_empty() { 0 } else { JOINED * self.maps.light_map.len() };
        let air = self.maps.heterogeneity.as_ref().map_or(0, |air| air.bytes());
        (texels * ShadowMap::bytes_a_texel(self.maps.geometry.mesh()) + joined + air) as u64
            + if self.further_start.is_empty() { 0 } else { 3 * weights }
    }

    fn ray_bytes(&self) -> u64 {
        (self.rows() * size_of::<ViewRay>()) as u64
    }

    fn digest(&self, add: &mut dyn FnMut(u64)) {
        for ray in self.traversal.rays() {
            let numbers = [ray.origin.to_array(), ray.direction.to_array(), ray.scattering];
            numbers.iter().flatten().chain([&ray.length]).for_each(|number| add(number.to_bits()));
        }
        format!("{:?}", self.maps.light_map).bytes().for_each(|byte| add(byte.into()));
        match self.traversal.suns() {
            None => digest_of_map(&self.maps.shadow_map, add),
            Some(suns) => suns.shadow_maps.iter().for_each(|map| digest_of_map(map, add)),
        }
        for row in 0..self.rows() {
            for pane in self.traversal.seen_by(row) {
                pane.passes.iter().chain([&pane.distance]).for_each(|number| add(number.to_bits()));
            }
        }
        self.traversal.transport().sigma_t.iter().for_each(|number| add(number.to_bits()));
        self.lit.iter().for_each(|&texel| add(texel.into()));
        let Some(shown) = self.traversal.further_weights() else { return };
        for row in 0..self.rows() {
            let further = (0..shown.further()).flat_map(|further| shown.weight(row, further));
            further.chain(shown.reflected(row).sum()).for_each(|number| add(number.to_bits().into()));
        }
    }

    fn skipped(&self) -> Vec<(&'static str, [usize; 2])> {
        let (mut texels, mut lit, mut cut) = (0.0, 0.0, 0);
        for extent in parallel::map(self.rows(), &|row| self.traversal.extent(row)) {
            texels += extent.texels;
            lit += extent.lit_texels;
            cut += usize::from(extent.cut_off);
        }
        vec![
            ("shadowed_cells", [(texels - lit) as usize, texels as usize]),
            ("dark_rays", [cut, self.rows()]),
        ]
    }

    fn nouns(&self) -> Nouns {
        let found = if self.further_start.is_empty() { "light map" } else { "light" };
        Nouns::new(found, "painted pixel", "paint")
    }

    fn settings_in_words(&self) -> Vec<(&'static str, String)> {
        let transport = self.traversal.transport();
        let [width, height] = self.maps.shadow_map.grid().size;
        let outside = 100.0 * self.share_from_outside();
        vec![
            ("basis", format!("{:?}", transport.basis).to_lowercase()),
            (
                "quadrature",
                match transport.quadrature {
                    Quadrature::Exact => "exact, cell by cell".to_owned(),
                    Quadrature::March { steps } => format!("march of {steps} steps"),
                },
            ),
            ("shadow_map", format!("{width} × {height} texels")),
            ("light_from_outside_the_map", format!("{outside:.1} % of the painted pixels' light")),
        ]
    }
}

fn digest_of_map(map: &ShadowMap, add: &mut dyn FnMut(u64)) {
    format!("{:?}", map.grid()).bytes().for_each(|byte| add(byte.into()));
    let [width, height] = map.grid().size;
    for k in 0..width * height {
        add(map.depth(k % width, k / width).to_bits().into());
        for pane in map.behind().into_iter().flat_map(|behind| behind.panes(k % width, k / width)) {
            pane.passes.iter().chain([&pane.depth]).for_each(|number| add(number.to_bits().into()));
        }
    }
}

/// Whether an adapter can sum up squares of this light in f32. The sums would be zero for fainter light, and infinite for brighter
/// light.
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
        remedy: "use another unit, in which light.radiance is from 1e-15 to 1e15, or compute on the processor",
    })
}

/// The radiance that a pixel should have: as far from what it shows under the lights as they are to what is painted as the paint is strong.
fn wanted(rule: Target, pixel: &Constraint, [plain, white]: [&Rgb; 2]) -> Rgb {
    rgb(|c| {
        let painted = match rule {
            Target::Tint => pixel.color[c] * plain[c],
            Target::WhiteTint => pixel.color[c] * white[c],
            Target::Radiance => pixel.color[c],
        };
        // One exactly where the paint covers, so that the colour comes through as it was painted.
        if pixel.opacity < 1.0 { plain[c] + pixel.opacity * (painted - plain[c]) } else { painted }
    })
}

/// The texels that some view of some scene sees lit.
fn seen_lit(scenes: &[&Scene], maps: &[Maps]) -> Arc<[u32]> {
    let of_each: Vec<Arc<[u32]>> =
        scenes.iter().zip(maps).map(|(scene, maps)| lit_texels(scene, maps)).collect();
    match &of_each[..] {
        [one] => one.clone(),
        several => {
            let all: BTreeSet<u32> = several.iter().flat_map(|texels| texels.iter().copied()).collect();
            all.into_iter().collect()
        }
    }
}

/// What is known of rows that show scattered light alone: the light from outside the light map, which keeps its own radiance.
///
/// Errors: [`Error::Empty`] when no row gets light through the light map.
fn of_scattered_light(traversal: &LightMapTraversal, start: Rgb) -> Result<RowRadiance> {
    let count = traversal.rays().len();
    let shares: Vec<[[f64; 3]; 2]> = (0..count)
        .into_par_iter()
        .map(|row| [traversal.lit_weight(row), traversal.outside_weight(row)])
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
    let lit_by = |light: Rgb| shares.iter().map(|[lit, _]| rgb(|c| lit[c] as f32 * light[c])).collect();
    Ok(RowRadiance {
        known: shares.iter().map(|[_, outside]| rgb(|c| outside[c] as f32 * start[c])).collect(),
        plain: lit_by(start),
        white: lit_by([luminance(start); 3]),
    })
}

/// Errors: [`Error::Empty`] where looks put colours in the place of all scattered light.
fn check_replaced(maps: &Maps, rays: &[ViewRay]) -> Result<()> {
    let replaces = maps.transfer.as_ref().is_some_and(|it| it.adds());
    if !replaces || rays.iter().any(|ray| ray.scattering != [0.0; 3]) {
        return Ok(());
    }
    Err(Error::Empty {
        reason:
            "looks.transfer takes the place of all scattered light, so no light map changes what is painted"
                .to_owned(),
        remedy: "lower looks.transfer.strength, or set looks.transfer.as=factor",
    })
}

/// Whether a row gets light through the map: more than rounding is left of its lit weight less its outside weight.
fn passes_the_map([lit, outside]: &[[f64; 3]; 2]) -> bool {
    (0..3).any(|c| lit[c] - outside[c] > 1e-12 * lit[c])
}
