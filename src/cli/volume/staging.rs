//! One stage after the other, each with what was found before.

use super::super::engine::Engine;
use super::super::progress::Steps;
use super::findings::record;
use super::stage::{Place, Stage, Task};
use super::{nothing_asked, pictures};
use crate::Result;
use crate::problem::{Desired, Determined, Model, Optics, VolumeProblem, VolumeState};
use crate::report::StageRecord;
use crate::scene::{Find, Image, VolumeScene};
use crate::solve::StopReason;

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

/// What the stages of a scene have come to.
pub(super) struct Outcome {
    pub(super) state: VolumeState,
    pub(super) optics: Optics,
    pub(super) desired: Vec<Desired>,
    /// The pictures before the first stage, and after the last.
    pub(super) before: Vec<Image>,
    pub(super) after: Vec<Image>,
    pub(super) distances: [Distance; 2],
    /// The voxels that were found.
    pub(super) determined: Vec<Determined>,
    /// Each stage in a few numbers, and the last one whole.
    pub(super) records: Vec<StageRecord>,
    pub(super) last: Stage,
}

impl Outcome {
    pub(super) fn is_interrupted(&self) -> bool {
        self.last.is_interrupted()
    }
}

/// Solves a scene's stages in turn, and again for as many rounds as it asks for, while the pictures come nearer.
///
/// In rounds every stage is pulled to where it starts, so it cannot end farther from the targets than it began; what rounding
/// makes of that is not taken.
pub(super) fn run(
    scene: &VolumeScene,
    engine: &mut Engine,
    place: Place,
    steps: &mut Steps,
) -> Result<Outcome> {
    steps.begin("lighting", None);
    let mut state = VolumeState::of(scene)?;
    let mut optics = Optics::new(scene, &state)?;
    let first = *scene.stages.first().ok_or_else(nothing_asked)?;
    let mut drawn = VolumeProblem::model(scene, first);
    let before = pictures(scene, &state.medium, &optics, drawn, steps)?;
    let desired = Desired::of(scene, &|view| Ok(before[view].clone()))?;
    let mut after = before.clone();
    let first_distance = distance(&desired, &before);
    let mut now = first_distance.clone();
    let (mut records, mut last): (Vec<StageRecord>, Option<Stage>) = (Vec::new(), None);
    let mut determined = Vec::new();
    'rounds: for round in 0..scene.rounds {
        let at_start = now.all;
        for &find in &scene.stages {
            let model = VolumeProblem::model(scene, find);
            if model != drawn {
                after = pictures(scene, &state.medium, &optics, model, steps)?;
                (drawn, now) = (model, distance(&desired, &after));
            }
            let task = Task { scene, state: &state, optics: &optics, desired: &desired, find };
            let stage = task.solve(engine, place, steps)?;
            let (new_optics, pictures_after) = shown(scene, &stage, &optics, model, steps)?;
            let then = distance(&desired, &pictures_after);
            let is_taken = scene.rounds == 1 || then.all <= now.all;
            let reached = if is_taken { then } else { now.clone() };
            records.push(record(&stage, round, is_taken, [now.all, reached.all]));
            if is_taken {
                let found = Determined::by(&stage.problem, &stage.trial.solved.columns);
                determined.retain(|old: &Determined| found.iter().all(|new| new.property != old.property));
                determined.extend(found);
                (state, optics, after) = (stage.state.clone(), new_optics, pictures_after);
            }
            now = reached;
            let is_interrupted = stage.is_interrupted();
            last = Some(stage);
            if is_interrupted {
                break 'rounds;
            }
        }
        if at_start - now.all <= LEAST_GAIN * at_start {
            break;
        }
    }
    let last = last.ok_or_else(nothing_asked)?;
    let distances = [first_distance, now];
    Ok(Outcome { state, optics, desired, before, after, distances, determined, records, last })
}

/// The light after a stage, and the pictures.
fn shown(
    scene: &VolumeScene,
    stage: &Stage,
    optics: &Optics,
    model: Model,
    steps: &mut Steps,
) -> Result<(Optics, Vec<Image>)> {
    // Emission and albedo change nothing about how light comes through.
    let optics = match stage.find {
        Find::Extinction | Find::Environment => {
            steps.begin("lighting", None);
            Optics::new(scene, &stage.state)?
        }
        Find::Emission | Find::Albedo | Find::Joint => optics.clone(),
    };
    let pictures = pictures(scene, &stage.state.medium, &optics, model, steps)?;
    Ok((optics, pictures))
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

impl Stage {
    /// Whether it was stopped by a person.
    pub(super) fn is_interrupted(&self) -> bool {
        self.trial.solved.outcome.stop.reason == StopReason::Interrupted
    }
}
