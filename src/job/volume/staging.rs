//! One stage after the other, each with what was found before.

use std::sync::Arc;

use super::super::engine::Engine;
use super::super::steps::{Steps, Timings};
use super::super::warnings;
use super::pictures::{nothing_asked, view_pictures};
use super::stage::{Place, PropertySearch, Stage};
use crate::Result;
use crate::problem::{Desired, Determined, HoldOut, Model, Optics, VolumeProblem, VolumeState};
use crate::report::{Change, Report, StageRecord, ViewMatch};
use crate::scene::{Find, Image, Rgb, VolumeScene};
use crate::solve::{Control, GaussNewton, Looked, NonLinear, Taken, gauss_newton};
use crate::visibility::Geometry;

/// A round that brings the pictures nearer by less than this share of their distance is the last one.
const LEAST_GAIN: f64 = 1e-3;

/// How far the pictures are from what is wanted: view by view, and all together.
#[derive(Debug, Clone, Default)]
pub(super) struct Distance {
    pub(super) views: Vec<f64>,
    pub(super) all: f64,
    /// Σ w ‖L − L*‖² and Σ w ‖L*‖², of all views.
    pub(super) sums: [f64; 2],
}

/// What some stages have come to, and what that shows.
pub(super) struct Attained {
    pub(super) state: VolumeState,
    pub(super) optics: Optics,
    pub(super) desired: Vec<Desired>,
    /// The pictures before the first stage, and as they are.
    pub(super) before: Vec<Image>,
    pub(super) after: Vec<Image>,
    /// How far both are from what is wanted.
    pub(super) distances: [Distance; 2],
    /// The voxels that were found.
    pub(super) determined: Vec<Determined>,
}

impl Attained {
    /// How far the pictures are from what is wanted.
    fn distance(&self) -> f64 {
        self.distances[1].all
    }
}

/// What all stages of a scene have come to.
pub(super) struct StagesOutcome {
    pub(super) attained: Attained,
    /// Each stage in a few numbers, and the last one whole.
    pub(super) records: Vec<StageRecord>,
    pub(super) last: Stage,
}

impl StagesOutcome {
    pub(super) fn is_interrupted(&self) -> bool {
        self.last.computed.is_interrupted()
    }

    /// The numbers of the last stage, and a summary of each.
    pub(super) fn report(&self, scene: &VolumeScene, timings: &Timings) -> Result<Report> {
        let [before, after] = &self.attained.distances;
        let about = (scene.name.as_str(), scene.target, scene.pixels());
        let mut report = self.last.findings().report("volume", about, timings)?;
        let finds: Vec<&str> = self.records.iter().map(|stage| stage.find.as_str()).collect();
        report.settings.insert("looked_for".to_owned(), finds.join(", then "));
        Ok(Report {
            weighted_residual: Change { before: before.all, after: after.all },
            matched: matched(scene, &self.attained.desired, [before, after]),
            stages: self.records.clone(),
            ..report
        })
    }
}

/// How near each view of which something is wanted has come.
pub(super) fn matched(
    scene: &VolumeScene,
    desired: &[Desired],
    [before, after]: [&Distance; 2],
) -> Vec<ViewMatch> {
    let views = scene.views.iter().zip(desired).enumerate();
    views
        .filter(|(_, (_, desired))| desired.is_wanted())
        .map(|(index, (view, desired))| ViewMatch {
            view: view.view.name.clone(),
            painted_pixels: desired.pixels.iter().filter(|pixel| pixel[3] > 0.0).count() as u64,
            weighted_residual: Change { before: before.views[index], after: after.views[index] },
            ..ViewMatch::default()
        })
        .collect()
}

/// A stage in a few numbers.
fn record(stage: &Stage, round: usize, is_taken: bool, [before, after]: [f64; 2]) -> Result<StageRecord> {
    let findings = stage.findings();
    Ok(StageRecord {
        frame: None,
        find: stage.problem.find.name().to_owned(),
        round: round as u64 + 1,
        is_taken,
        problem: findings.size()?,
        weighted_residual: Change { before, after },
        stop: findings.stop(),
        certificate: findings.certificate()?,
    })
}

/// Solves a scene's stages in turn, and again for as many rounds as it asks for, while the pictures come nearer.
///
/// In rounds every stage is pulled to where it starts, so it cannot end farther from the targets than it began; what rounding
/// makes of that is not taken.
pub(super) fn run(
    scene: &VolumeScene,
    geometry: &Arc<Geometry>,
    engine: &mut Engine,
    place: Place,
    steps: &mut Steps<'_>,
) -> Result<StagesOutcome> {
    let mut course = Course::begin(scene, geometry, engine, place, steps)?;
    'rounds: for round in 0..scene.rounds {
        let at_start = course.attained.distance();
        for &find in &scene.stages {
            course.look_under(VolumeProblem::model(scene, find))?;
            match find {
                Find::Refinement => course.refine()?,
                _ => course.take(find, round)?,
            }
            if course.last.as_ref().is_some_and(|stage| stage.computed.is_interrupted()) {
                break 'rounds;
            }
        }
        if at_start - course.attained.distance() <= LEAST_GAIN * at_start {
            break;
        }
    }
    course.end()
}

/// Stages on their way.
struct Course<'a, 's> {
    scene: &'a VolumeScene,
    engine: &'a mut Engine,
    place: Place<'a>,
    steps: &'a mut Steps<'s>,
    attained: Attained,
    /// The pixels that are kept out of fits, of pictures that were measured.
    held_out: Option<HoldOut>,
    /// The model of light that its pictures are drawn under.
    drawn: Model,
    records: Vec<StageRecord>,
    last: Option<Stage>,
}

impl<'a, 's> Course<'a, 's> {
    fn begin(
        scene: &'a VolumeScene,
        geometry: &Arc<Geometry>,
        engine: &'a mut Engine,
        place: Place<'a>,
        steps: &'a mut Steps<'s>,
    ) -> Result<Self> {
        steps.begin("lighting", None);
        let state = VolumeState::of(scene)?;
        warnings::tell_of_hidden(geometry);
        let optics = Optics::new(scene, geometry, &state)?;
        let drawn = VolumeProblem::model(scene, *scene.stages.first().ok_or_else(nothing_asked)?);
        // What is wanted is the same whatever computes, and so is drawn by the processor.
        let before = view_pictures(scene, &state.medium, &optics, drawn, &mut Engine::Cpu, steps)?;
        let desired = Desired::of(scene, &|view| Ok(before[view].clone()))?;
        let held_out = HoldOut::of(scene, &desired);
        let first = distance(&desired, &before);
        let (after, distances) = (before.clone(), [first.clone(), first]);
        let determined = Vec::new();
        let attained = Attained { state, optics, desired, before, after, distances, determined };
        Ok(Self { scene, engine, place, steps, attained, held_out, drawn, records: Vec::new(), last: None })
    }

    fn end(self) -> Result<StagesOutcome> {
        let last = self.last.ok_or_else(nothing_asked)?;
        Ok(StagesOutcome { attained: self.attained, records: self.records, last })
    }

    /// Draws the pictures under another model of light.
    fn look_under(&mut self, model: Model) -> Result<()> {
        if model != self.drawn {
            let Attained { state, optics, desired, after, distances, .. } = &mut self.attained;
            *after = view_pictures(self.scene, &state.medium, optics, model, self.engine, self.steps)?;
            (self.drawn, distances[1]) = (model, distance(desired, after));
        }
        Ok(())
    }

    /// Looks for one property, and takes what is found.
    fn take(&mut self, find: Find, round: usize) -> Result<()> {
        let stage = self.solve(find)?;
        let view = self.view(find, &stage.state)?;
        let before = self.attained.distance();
        // In rounds nothing is taken that is farther away.
        let is_taken = self.scene.rounds == 1 || view.distance.all <= before;
        let after = if is_taken { view.distance.all } else { before };
        self.records.push(record(&stage, round, is_taken, [before, after])?);
        if is_taken {
            self.put(&stage, stage.state.clone(), view);
        }
        self.last = Some(stage);
        Ok(())
    }

    /// Takes steps of Gauss–Newton as long as the pictures come nearer.
    fn refine(&mut self) -> Result<()> {
        let settings =
            GaussNewton { least_gain: LEAST_GAIN, ..GaussNewton::new(self.scene.extinction.steps) };
        gauss_newton(&mut Refinement { course: self, looked: None }, &settings)
    }

    fn solve(&mut self, find: Find) -> Result<Stage> {
        let Self { scene, engine, place, steps, attained, held_out, .. } = self;
        let Attained { state, optics, desired, .. } = attained;
        let held_out = held_out.as_ref().filter(|pixels| pixels.applies_to(find));
        PropertySearch { scene, state, optics, desired, held_out, find }.solve(engine, *place, steps)
    }

    /// Draws what a state shows; it differs from the attained one in what was looked for.
    fn view(&mut self, find: Find, state: &VolumeState) -> Result<ViewedState> {
        // Emission and albedo change nothing about how light comes through.
        let optics = match find {
            Find::Extinction | Find::Refinement | Find::Environment => {
                self.steps.begin("lighting", None);
                Optics::new(self.scene, self.attained.optics.geometry(), state)?
            }
            Find::Emission | Find::Albedo | Find::Joint => self.attained.optics.clone(),
        };
        let pictures =
            view_pictures(self.scene, &state.medium, &optics, self.drawn, self.engine, self.steps)?;
        Ok(ViewedState { distance: distance(&self.attained.desired, &pictures), optics, pictures })
    }

    /// Takes a state that a stage has found.
    fn put(&mut self, stage: &Stage, state: VolumeState, view: ViewedState) {
        let found = Determined::by(&stage.problem, &stage.computed.solved.columns);
        let now = &mut self.attained;
        now.determined.retain(|old| found.iter().all(|new| new.property != old.property));
        now.determined.extend(found);
        (now.state, now.optics, now.after) = (state, view.optics, view.pictures);
        now.distances[1] = view.distance;
    }
}

/// A state's light, its pictures, and how far they are from what is wanted.
struct ViewedState {
    optics: Optics,
    pictures: Vec<Image>,
    distance: Distance,
}

/// The extinction behind pictures that do not depend on it linearly.
struct Refinement<'c, 'a, 's> {
    course: &'c mut Course<'a, 's>,
    looked: Option<(VolumeState, ViewedState)>,
}

impl NonLinear for Refinement<'_, '_, '_> {
    type Step = Stage;

    fn distance(&self) -> f64 {
        self.course.attained.distance()
    }

    fn step(&mut self) -> Result<Stage> {
        self.course.solve(Find::Refinement)
    }

    fn look(&mut self, stage: &Stage, share: f32) -> Result<Looked> {
        let (from, to) = (&stage.problem.start, &stage.computed.solved.x);
        let part = |(from, to): (&Rgb, &Rgb)| std::array::from_fn(|c| from[c] + share * (to[c] - from[c]));
        let x: Vec<Rgb> = from.iter().zip(to).map(part).collect();
        let state = stage.problem.apply(&self.course.attained.state, &x)?;
        let view = self.course.view(stage.problem.find, &state)?;
        let looked = match &self.course.held_out {
            _ if view.distance.all >= self.course.attained.distance() => Looked::Farther,
            Some(pixels)
                if !pixels.come_nearer(
                    &self.course.attained.desired,
                    [&self.course.attained.after, &view.pictures],
                ) =>
            {
                Looked::NearerToNoise
            }
            _ => Looked::Nearer,
        };
        self.looked = Some((state, view));
        Ok(looked)
    }

    fn take(&mut self, stage: &Stage) {
        if let Some((state, view)) = self.looked.take() {
            self.course.put(stage, state, view);
        }
    }

    fn told(&mut self, stage: Stage, taken: Taken) -> Result<Control> {
        let Taken { number, share, distance } = taken;
        self.course.records.push(record(&stage, number, share.is_some(), distance)?);
        let control = if stage.computed.is_interrupted() { Control::Stop } else { Control::Continue };
        self.course.last = Some(stage);
        Ok(control)
    }
}

pub(super) fn distance(desired: &[Desired], pictures: &[Image]) -> Distance {
    let (views, sums): (Vec<f64>, Vec<[f64; 2]>) =
        desired.iter().zip(pictures).map(|(desired, picture)| desired.residual(picture)).unzip();
    let sums = sums.iter().fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
    Distance { views, all: relative(sums), sums }
}

/// √(Σ w ‖L − L*‖² / Σ w ‖L*‖²).
pub(super) fn relative([miss, all]: [f64; 2]) -> f64 {
    if all > 0.0 { (miss / all).sqrt() } else { 0.0 }
}
