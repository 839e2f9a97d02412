//! A job that is kept warm: strokes change, rows stay, and the solve goes on from where it is.

use std::borrow::Cow;
use std::sync::Arc;

use super::engine::{Engine, On};
use super::live_pictures::{LivePictures, Still, light_map_of};
use super::memory::MemoryBudget;
use super::observer::Stop;
use super::preview::{Preview, scaled, seen_at};
use super::{Job, Options};
#[cfg(feature = "gpu")]
use crate::gpu::GpuOperator;
use crate::march::EpipolarSettings;
use crate::operator::{CpuVector, FromHost, NOWHERE, OnHost, Picked, Storage, TransportOperator};
use crate::problem::{
    Backdrop, Begin, Canvas, Constraint, Drawing, Formulation, HeterogeneousAir, LightMapProblem, Painting,
    Paused, Problem, Renderer, Snapshot, Solved, Traced, TransferFunction, fit, minimize, paint, pixels,
    render,
};
use crate::scene::{Camera, Extent, Image, MapSettings, Rgb, Scene, SolveSettings, Strategy, Stroke, rgb};
use crate::solve::{Control, StopReason};
use crate::visibility::Geometry;
use crate::{Error, Result};

/// Rows that weigh something are put together where they are less than one in so many of all.
const MANY: usize = 3;

/// How far a live job is.
#[derive(Debug, Clone, PartialEq)]
pub struct Standing {
    /// Iterations since the last change.
    pub iterations: usize,
    /// Applications of T and Tᵀ since the last change, those for setting up included.
    pub applications: usize,
    /// ‖projected gradient‖ a channel, relative to that at x₀.
    pub gradient: [f64; 3],
    /// ‖W(Tx − b)‖² and the pulls to x₀ a channel, relative to those at x₀.
    pub objective: [f64; 3],
    /// Why it stopped there.
    pub stop: StopReason,
}

/// A light map that is looked for while somebody paints.
///
/// Rows of all pixels of all views are kept, for pictures; where they do not fit, pictures are drawn over slices. A change of strokes changes weights and targets, and the few rows that weigh
/// something are put together for the solve. Points and radii of strokes are in pixels
/// of the full pictures.
///
/// They are kept where the job computes, the processor or an adapter; where an adapter fails that the processor may take the place of, it
/// does so from the light map as it is.
///
/// Memory  8 bytes a non-zero of all pixels of the previews
/// Law     ends where a solve from x₀ ends: the least of the same objective, since x₀ stays the centre of the pull
pub struct LiveJob {
    /// With pictures of the preview's size, and maps that do not move.
    scene: Scene,
    /// What a pixel of the full picture is in pixels of the preview, view by view.
    scales: Vec<f32>,
    settings: SolveSettings,
    problem: LightMapProblem,
    engine: Engine,
    warm: Warm,
    /// T over slices, for pictures, where exact rows of all pixels would be walked for each.
    drawn: Option<Warm>,
    /// The rows that weigh something since the last change, where they are few.
    few: Option<Few>,
    memory: MemoryBudget,
    deterministic: bool,
    /// All elements as they are.
    x: Vec<Rgb>,
    /// The method where it was left, until something changes.
    paused: Option<(Paused, CpuVector)>,
    /// Applications that setting up took after the last change.
    set_up: usize,
    stop: Stop,
    /// What pictures need beside products with rows, once there were some.
    still: Option<Arc<Still>>,
}

/// A live job between two iterations.
pub struct LiveMoment<'a> {
    live: &'a LiveJob,
    snapshot: &'a dyn Snapshot,
    /// How far it is.
    pub standing: Standing,
}

/// Some rows, those that weigh something among them, and T of them.
struct Few {
    rows: Vec<usize>,
    warm: Warm,
}

/// T of all pixels, or of some, where it is kept.
enum Warm {
    Cpu(OnHost),
    #[cfg(feature = "gpu")]
    Gpu(Box<GpuOperator>),
}

/// What some iterations have come to.
struct Went {
    solved: Solved,
    /// Where the method was left, and the coverage it goes on with.
    left: Option<(Paused, CpuVector)>,
    is_new: bool,
}

impl LiveJob {
    /// Errors: [`Error::Empty`] for a scene without a light map, or where light reaches no pixel; [`Error::TooLarge`] where the rows of all
    /// pixels do not fit.
    pub(super) fn new(job: Job, preview: Preview) -> Result<Self> {
        let Options { stop, engine, deterministic, .. } = job.options.clone();
        let mut engine = Engine::open(&engine, &stop)?;
        let mut scene = job.into_light_map()?;
        // Where the maps lie is found once, at the full size, from what is painted at first.
        let geometry = Arc::new(Geometry::new(scene.mesh.clone())?);
        let maps = fit(&scene, &scene.light_map, &geometry)?;
        scene.light_map = MapSettings { extent: Some(maps.light_map.extent), ..scene.light_map };
        scene.shadow_map.extent = Some(maps.shadow_map.grid().extent);
        scene.solve.skip.pixels = false;
        let widths: Vec<usize> = scene.views.iter().map(|view| view.camera.size()[0]).collect();
        let views: Result<_> = scene.views.iter().map(|view| seen_at(view, preview)).collect();
        scene.views = views?;
        let pairs = scene.views.iter().zip(&widths);
        let scales = pairs.map(|(view, &full)| view.camera.size()[0] as f32 / full as f32).collect();
        let problem = LightMapProblem::of(&scene, &geometry, pixels(&scene)?, &Traced)?;
        let memory = MemoryBudget::of_light_map(&scene);
        let settings = memory.settled(scene.solve.clone(), &problem)?;
        let how = (&settings, &memory);
        let (warm, drawn) =
            engine.run(None, false, None, |on, _| Warm::of_all(&problem, on, how, deterministic))?;
        let x = problem.starts();
        Ok(Self {
            scene,
            scales,
            settings,
            problem,
            engine,
            warm,
            drawn,
            few: None,
            memory,
            deterministic,
            x,
            paused: None,
            set_up: 0,
            stop,
            still: None,
        })
    }

    /// The names of the views.
    pub fn views(&self) -> impl Iterator<Item = &str> {
        self.scene.views.iter().map(|view| view.name.as_str())
    }

    /// Width and height of a view's preview.
    ///
    /// Errors: [`Error::Value`] for a view that there is not.
    pub fn size(&self, view: &str) -> Result<[usize; 2]> {
        Ok(self.scene.views[self.view(view)?].camera.size())
    }

    /// Where the light map lies, which no stroke moves.
    pub fn extent(&self) -> Extent {
        self.problem.maps.light_map.extent
    }

    /// The heterogeneous air of the scene's looks.
    pub fn air(&self) -> Option<&HeterogeneousAir> {
        self.problem.maps.heterogeneity.as_deref()
    }

    /// The transfer function of the scene's looks.
    pub fn transfer(&self) -> Option<&TransferFunction> {
        self.problem.maps.transfer.as_deref()
    }

    /// The triangle that is seen at a place of a view's picture, from (0, 0), its upper left corner, to (1, 1).
    ///
    /// Errors: [`Error::Value`] for a view that there is not.
    pub fn triangle_at(&self, view: &str, [x, y]: [f64; 2]) -> Result<Option<usize>> {
        let camera = &self.scene.views[self.view(view)?].camera;
        let [width, height] = camera.size().map(|side| side as f64);
        let hit = self.problem.maps.geometry.first_hit(&camera.ray(x * width, y * height), f64::INFINITY);
        Ok(hit.map(|hit| hit.triangle))
    }

    /// The strokes of a view, in pixels of the preview.
    ///
    /// Errors: [`Error::Value`] for a view that there is not.
    pub fn strokes(&self, view: &str) -> Result<&[Stroke]> {
        Ok(&self.scene.views[self.view(view)?].strokes)
    }

    /// Pixels of the preview a pixel of the full picture.
    ///
    /// Errors: [`Error::Value`] for a view that there is not.
    pub fn scale(&self, view: &str) -> Result<f32> {
        Ok(self.scales[self.view(view)?])
    }

    /// Paints a stroke over what is painted on a view.
    ///
    /// Errors: [`Error::Value`] for a view that there is not, and for a stroke that paints no pixel; then nothing has changed.
    pub fn paint(&mut self, view: &str, stroke: Stroke) -> Result<()> {
        let index = self.view(view)?;
        let stroke = scaled(stroke, self.scales[index]);
        self.change(index, |strokes| {
            strokes.push(stroke);
            Ok(())
        })
    }

    /// Paints a view anew: these strokes and no others.
    ///
    /// Errors: as [`Self::paint`].
    pub fn repaint(&mut self, view: &str, strokes: Vec<Stroke>) -> Result<()> {
        let index = self.view(view)?;
        let scale = self.scales[index];
        self.change(index, |mine| {
            *mine = strokes.into_iter().map(|stroke| scaled(stroke, scale)).collect();
            Ok(())
        })
    }

    /// Puts another stroke in the place of one, or none.
    ///
    /// Errors: as [`Self::paint`], and [`Error::Value`] for a stroke that there is not.
    pub fn replace(&mut self, view: &str, number: usize, stroke: Option<Stroke>) -> Result<()> {
        let index = self.view(view)?;
        let stroke = stroke.map(|stroke| scaled(stroke, self.scales[index]));
        self.change(index, |strokes| {
            if number >= strokes.len() {
                let expected = "the number of one of the view's strokes";
                return Err(Error::value(format!("{view}.strokes"), number, expected));
            }
            match stroke {
                Some(stroke) => strokes[number] = stroke,
                None => drop(strokes.remove(number)),
            }
            Ok(())
        })
    }

    fn change(&mut self, index: usize, change: impl FnOnce(&mut Vec<Stroke>) -> Result<()>) -> Result<()> {
        let mut view = self.scene.views[index].clone();
        change(&mut view.strokes)?;
        let painting = paint(&view)?;
        self.scene.views[index] = view;
        self.problem.repaint(index, &painting);
        self.few = None;
        self.paused = None;
        Ok(())
    }

    /// Whether any pixel of any view is painted.
    pub fn is_painted(&self) -> bool {
        self.problem.constraints.iter().any(Constraint::is_painted)
    }

    /// Goes back to x₀, as if nothing had been solved yet.
    pub fn begin_anew(&mut self) {
        self.x = self.problem.starts();
        self.paused = None;
    }

    /// Goes on for so many iterations, or until the gradient has fallen to `solve.tolerance` of that at x₀, or somebody asks to stop, who
    /// is heard within an iteration. That request is then done with: the next call goes on.
    ///
    /// Errors: [`Error::Empty`] where nothing is painted; those of the method.
    pub fn advance(&mut self, iterations: usize) -> Result<Standing> {
        self.watched(iterations, &mut |_| Ok(Control::Continue))
    }

    /// The same; `each` sees every iteration, and may stop there, which a later call goes on from.
    ///
    /// Errors: as [`Self::advance`], and what `each` reports.
    pub fn watched(
        &mut self,
        iterations: usize,
        each: &mut dyn FnMut(&LiveMoment<'_>) -> Result<Control>,
    ) -> Result<Standing> {
        if !self.is_painted() {
            return Err(Error::Empty {
                reason: "nothing is painted".to_owned(),
                remedy: "paint a stroke on a view",
            });
        }
        let mut engine = std::mem::replace(&mut self.engine, Engine::Cpu);
        let went = engine.run(None, false, None, |on, _| {
            let (how, deterministic) = ((&self.settings, &self.memory), self.deterministic);
            if matches!(on, On::Cpu) && !matches!(self.warm, Warm::Cpu(_)) {
                (self.warm, self.drawn) = Warm::of_all(&self.problem, On::Cpu, how, deterministic)?;
                self.few = None;
            }
            if self.few.is_none() {
                self.few = self.few(on)?;
            }
            let resumed = self.paused.take();
            let formulation = self.problem.formulation(&self.settings)?;
            let (formulation, warm) = match &self.few {
                Some(few) => (formulation.picked(&few.rows), &few.warm),
                None => (formulation, &self.warm),
            };
            match warm {
                Warm::Cpu(operator) => self.go_on(&formulation, operator, resumed, iterations, each),
                #[cfg(feature = "gpu")]
                Warm::Gpu(operator) => self.go_on(&formulation, &**operator, resumed, iterations, each),
            }
        });
        self.engine = engine;
        let Went { solved, left, is_new } = went?;
        let outcome = &solved.outcome;
        if is_new {
            // The squares of the weights are a pass over the rows, as an application is.
            self.set_up = 1 + solved.set_up_applications;
        }
        let last = outcome.history.progress.last();
        let applications = self.set_up + last.map_or(0, |last| last.operator_applications);
        let standing = Standing {
            iterations: outcome.stop.iteration,
            applications,
            gradient: outcome.true_normal_residual,
            objective: outcome.true_residual.map(|residual| residual.powi(2)),
            stop: outcome.stop.reason,
        };
        if standing.stop == StopReason::Interrupted {
            self.stop.withdraw();
        }
        self.x = solved.x;
        self.paused = left;
        Ok(standing)
    }

    /// The rows that weigh something, and T of them, where they are few. A product with them costs less than one with all, even where
    /// they are walked for it.
    fn few(&self, on: On) -> Result<Option<Few>> {
        let weights = self.problem.constraints.iter().enumerate().filter(|(_, pixel)| pixel.weight > 0.0);
        let rows: Vec<usize> = weights.map(|(row, _)| row).collect();
        if MANY * rows.len() >= self.problem.constraints.len() {
            return Ok(None);
        }
        if let Warm::Cpu(operator) = &self.warm
            && let Some(Picked { rows, operator }) = operator.picked(&rows)
        {
            return Ok(Some(Few { rows, warm: Warm::Cpu(operator) }));
        }
        let problem = self.problem.of_some(&rows);
        let warm = Warm::new(&problem, on, (&self.settings, &self.memory), self.deterministic)?;
        Ok(Some(Few { rows, warm }))
    }

    fn go_on(
        &self,
        formulation: &Formulation<'_>,
        operator: &impl TransportOperator,
        resumed: Option<(Paused, CpuVector)>,
        iterations: usize,
        each: &mut dyn FnMut(&LiveMoment<'_>) -> Result<Control>,
    ) -> Result<Went> {
        let is_new = resumed.is_none();
        let (begin, before, coverage) = match resumed {
            Some((paused, coverage)) => {
                let before = paused.history.progress.len() - 1;
                (Begin::Resumed(paused), before, coverage)
            }
            None => {
                let weights = CpuVector(formulation.weights.to_vec());
                (Begin::At(&self.x), 0, operator.squares(&weights)?)
            }
        };
        let settings = SolveSettings { iterations: before + iterations, ..self.settings.clone() };
        let mut left = None;
        let solved = minimize(formulation, operator, &coverage, &settings, begin, |history, snapshot| {
            if snapshot.is_final() {
                left = Some(Paused { history: history.clone(), state: snapshot.state()? });
                return Ok(Control::Continue);
            }
            let last = history.progress.last().copied().unwrap_or_default();
            let standing = Standing {
                iterations: last.iteration,
                applications: last.operator_applications,
                gradient: last.normal_residual,
                objective: last.residual.map(|residual| residual.powi(2)),
                stop: StopReason::Iterations,
            };
            match each(&LiveMoment { live: self, snapshot, standing })? {
                Control::Continue => Ok(self.stop.control()),
                stopped => Ok(stopped),
            }
        })?;
        Ok(Went { solved, left: left.map(|left| (left, coverage)), is_new })
    }

    /// The picture of a view under the light map as it is.
    ///
    /// Units   radiance
    /// Errors  [`Error::Value`] for a view that there is not
    pub fn picture(&self, view: &str) -> Result<Image> {
        let index = self.view(view)?;
        Ok(render(&self.scene, &self.problem.maps, Some(&self.x), index)?.after)
    }

    /// What a camera sees under the light map as it is, that is none of a view's, as previews are [drawn](Drawing::preview).
    ///
    /// Units   radiance
    pub fn picture_from(&self, camera: &Camera) -> Result<Image> {
        let renderer = Renderer::new(&self.scene, &self.problem.maps, Some(&self.x))?;
        let renderer = renderer.drawing(Drawing::preview(&self.problem.maps));
        Ok(renderer.picture_from(camera, "what the camera sees", &Canvas::Processor)?.after)
    }

    /// How far what a camera sees is away, in units of the scene: the median over its picture. Where it sees no surface, how far it is to the
    /// middle of all surfaces, or 1 where there is none.
    pub fn depth(&self, camera: &Camera) -> f64 {
        const ACROSS: usize = 16;
        let (geometry, [width, height]) = (&self.problem.maps.geometry, camera.size());
        let at = |index: usize, side: usize| (index as f64 + 0.5) / ACROSS as f64 * side as f64;
        let rays = (0..ACROSS * ACROSS)
            .map(|index| camera.ray(at(index % ACROSS, width), at(index / ACROSS, height)));
        let hits = rays.filter_map(|ray| geometry.first_hit(&ray, f64::INFINITY));
        let mut distances: Vec<f64> = hits.map(|hit| hit.distance).collect();
        distances.sort_by(f64::total_cmp);
        let middle = || geometry.bounds().map(|[low, high]| (0.5 * (low + high)).distance(camera.position()));
        let seen = distances.get(distances.len() / 2).copied().or_else(middle);
        seen.filter(|distance| *distance > 0.0).unwrap_or(1.0)
    }

    /// The pictures of all views under the light map as it is, by one product with the rows that are kept. The first takes as long as drawing
    /// them.
    ///
    /// Errors: [`Error::Empty`] where lights around the scene are looked for, too: [`Self::picture`] has those; those of the rows.
    pub fn pictures(&mut self) -> Result<LivePictures<'_>> {
        self.prepare()?;
        self.pictures_of(Cow::Borrowed(&self.x))
    }

    /// Draws what of all pictures does not change, so that [`LiveMoment::pictures`] need not.
    ///
    /// Errors: as [`Self::pictures`].
    pub fn prepare(&mut self) -> Result<()> {
        if self.still.is_none() {
            self.still = Some(Arc::new(self.still()?));
        }
        Ok(())
    }

    fn pictures_of<'a>(&'a self, x: Cow<'a, [Rgb]>) -> Result<LivePictures<'a>> {
        let still = match &self.still {
            Some(still) => still.clone(),
            None => Arc::new(self.still()?),
        };
        let shown = self.shown(&x)?;
        let difference = |all: &[Rgb], from: &dyn Fn(usize) -> Rgb| -> Vec<Rgb> {
            let of = |(index, value): (usize, &Rgb)| rgb(|c| value[c] - from(index)[c]);
            all.iter().enumerate().map(of).collect()
        };
        let scattered = difference(&shown, &|row| still.start[row]);
        let texels = difference(self.problem.parted(&x)[0], &|_| self.problem.start);
        Ok(LivePictures { scene: &self.scene, problem: &self.problem, still, x, scattered, texels })
    }

    fn still(&self) -> Result<Still> {
        if self.scene.surroundings.is_some() {
            return Err(Error::Empty {
                reason: "previews show no lights around a scene that are looked for, too".to_owned(),
                remedy: "draw the views one by one, or leave `surroundings` away",
            });
        }
        let views = 0..self.scene.views.len();
        let backdrop = |view| Backdrop::new(&self.scene, &self.problem.maps, view);
        let backdrops = views.map(backdrop).collect::<Result<Vec<_>>>()?;
        let pixels = |backdrop: &Backdrop| backdrop.before().pixels.len();
        let mut rows: Vec<Vec<u32>> = backdrops.iter().map(|it| vec![NOWHERE; pixels(it)]).collect();
        for (row, pixel) in (0..).zip(&self.problem.constraints) {
            let width = self.scene.views[pixel.view].camera.size()[0];
            rows[pixel.view][pixel.y * width + pixel.x] = row;
        }
        Ok(Still { backdrops, start: self.shown(&self.problem.starts())?, rows })
    }

    /// T x.
    fn shown(&self, x: &[Rgb]) -> Result<Vec<Rgb>> {
        match self.drawn.as_ref().unwrap_or(&self.warm) {
            Warm::Cpu(operator) => operator.shown(x),
            #[cfg(feature = "gpu")]
            Warm::Gpu(operator) => operator.shown(x),
        }
    }

    /// What is painted on a view.
    ///
    /// Errors: [`Error::Value`] for a view that there is not.
    pub fn painting(&self, view: &str) -> Result<Painting> {
        paint(&self.scene.views[self.view(view)?])
    }

    /// The light map as it is.
    pub fn light_map(&self) -> Result<Image> {
        light_map_of(&self.problem, &self.x)
    }

    /// What ends an [`Self::advance`] from another thread.
    pub fn stop(&self) -> Stop {
        self.stop.clone()
    }

    fn view(&self, name: &str) -> Result<usize> {
        let index = self.scene.views.iter().position(|view| view.name == name);
        index.ok_or_else(|| Error::value("view", name, "the name of one of the scene's views"))
    }
}

impl LiveMoment<'_> {
    /// All previews under the light map as it is between the iterations.
    ///
    /// Errors: as [`LiveJob::pictures`].
    pub fn pictures(&self) -> Result<LivePictures<'_>> {
        self.live.pictures_of(Cow::Owned(self.snapshot.elements()?))
    }
}

impl Warm {
    /// T of all pixels, and T over slices where the first has rows that are walked and slices know them.
    fn of_all(
        problem: &LightMapProblem,
        on: On,
        (settings, memory): (&SolveSettings, &MemoryBudget),
        deterministic: bool,
    ) -> Result<(Self, Option<Self>)> {
        let exact = Self::new(problem, on.clone(), (settings, memory), deterministic)?;
        let is_kept = exact.storage().walked_rows == 0;
        let Some(Ok(sliced)) = (!is_kept).then(|| problem.sliced(EpipolarSettings::default())).flatten()
        else {
            return Ok((exact, None));
        };
        let swept = SolveSettings { strategy: Strategy::MatrixFree, ..settings.clone() };
        match Self::new(&*sliced, on, (&swept, memory), deterministic) {
            Err(error) if error.is_not_possible_here() => Ok((exact, None)),
            swept => Ok((exact, Some(swept?))),
        }
    }

    fn storage(&self) -> Storage {
        match self {
            Self::Cpu(operator) => operator.storage(),
            #[cfg(feature = "gpu")]
            Self::Gpu(operator) => operator.storage(),
        }
    }

    fn new(
        problem: &dyn Problem,
        on: On,
        (settings, memory): (&SolveSettings, &MemoryBudget),
        deterministic: bool,
    ) -> Result<Self> {
        let budget = memory.budget(settings, problem)?;
        #[cfg(not(feature = "gpu"))]
        let _only_of_adapters = deterministic;
        Ok(match on {
            On::Cpu => Self::Cpu(problem.on_cpu(settings.strategy, budget)?),
            #[cfg(feature = "gpu")]
            On::Gpu(gpu) => {
                Self::Gpu(Box::new(problem.on_gpu(&gpu, settings.strategy, budget, deterministic)?))
            }
        })
    }
}
