//! From key frames to all frames.

use std::sync::Arc;

use super::super::engine::Engine;
use super::super::environment::write_environment;
use super::super::film::{self, Film, of_frame};
use super::super::folder::Folder;
use super::super::steps::{Steps, Timings};
use super::super::{Options, Scenes, memory, peak_memory};
use super::pictures::{nothing_asked, view_pictures};
use super::results;
use super::stage::Place;
use super::staging::{self, Attained, StagesOutcome, distance, matched, relative};
use crate::Result;
use crate::io::scene_file::AnimatedVolume;
use crate::io::volume::Format;
use crate::problem::{Occupied, Optics, Spread, VolumeProblem, VolumeState};
use crate::report::{self, AnimationRecord, Change, KeyRecord, Report};
use crate::scene::{Find, Image, KeySpan, VolumeScene};

/// The key frames of an animation that were solved, from which the others are drawn.
pub(crate) struct FoundAnimation {
    animated: Arc<AnimatedVolume>,
    keys: Vec<SolvedKey>,
    frames: Vec<usize>,
    is_interrupted: bool,
    /// What draws the frames between them.
    engine: Engine,
}

/// Solves the key frames and spreads what they found.
pub(in crate::job) fn solve_keys(
    animated: &Arc<AnimatedVolume>,
    options: &Options,
    engine: &mut Engine,
    folder: Option<&Folder>,
    steps: &mut Steps<'_>,
) -> Result<FoundAnimation> {
    let frames = film::asked(options.frames.clone(), animated.animation.frames)?;
    let mut keys = solve(animated, engine, options, folder, steps)?;
    spread(&mut keys, animated, steps)?;
    keys.iter_mut().try_for_each(|key| key.draw(engine, steps))?;
    let is_interrupted = steps.stops();
    Ok(FoundAnimation { animated: animated.clone(), keys, frames, is_interrupted, engine: engine.clone() })
}

impl FoundAnimation {
    pub(in crate::job) fn is_interrupted(&self) -> bool {
        self.is_interrupted
    }

    /// The key of the least frame that was solved.
    pub(in crate::job) fn first(&self) -> Option<&SolvedKey> {
        self.keys.first()
    }

    /// Writes the keys, and draws and writes the frames between them. Gives back the pictures of the page, and how many frames were drawn.
    pub(in crate::job) fn write(
        &self,
        options: &Options,
        folder: &Folder,
        steps: &mut Steps<'_>,
    ) -> Result<(report::Pictures, usize)> {
        let mut in_page = report::Pictures::default();
        for key in &self.keys {
            in_page.views.extend(key.write(folder, &options.formats)?);
            folder.publish()?;
        }
        let engine = self.engine.clone();
        let mut film = VolumeFilm { animated: &self.animated, keys: &self.keys, options, engine };
        let drawn = film::write_frames(&mut film, &self.frames, folder, &mut in_page.frames, steps)?;
        Ok((in_page, drawn))
    }

    pub(in crate::job) fn report(&self, timings: &Timings) -> Result<Report> {
        report(&self.animated, &self.keys, timings)
    }
}

/// A key frame that was solved.
pub(in crate::job) struct SolvedKey {
    animated: Arc<AnimatedVolume>,
    index: usize,
    frame: usize,
    attained: Attained,
    spread: Spread,
    /// Of this key alone, before anything was spread.
    report: Report,
}

/// Solves the keys in turn, each as `volume` would; after Ctrl-C those that were begun.
fn solve(
    animated: &Arc<AnimatedVolume>,
    engine: &mut Engine,
    options: &Options,
    folder: Option<&Folder>,
    steps: &mut Steps<'_>,
) -> Result<Vec<SolvedKey>> {
    let mut keys = Vec::new();
    steps.begin("lighting", None);
    let geometry = Scenes::Animation(animated.clone()).geometry()?;
    for (index, key) in animated.animation.keys.iter().enumerate() {
        steps.within(format!("frame {}", key.frame));
        let prefix = of_frame("key", key.frame);
        let place = Place { options, folder, prefix: &prefix, is_later: index > 0 };
        let outcome = staging::run(&key.scene, &geometry, engine, place, steps)?;
        // Its checkpoint.
        folder.map_or(Ok(()), Folder::publish)?;
        let is_interrupted = outcome.is_interrupted();
        let report = outcome.report(&key.scene, &Vec::new())?;
        // The rows are not needed any more.
        let StagesOutcome { attained, .. } = outcome;
        keys.push(SolvedKey {
            animated: animated.clone(),
            index,
            frame: key.frame,
            attained,
            spread: Spread::default(),
            report,
        });
        if is_interrupted {
            break;
        }
    }
    steps.within(String::new());
    Ok(keys)
}

/// Spreads what each key found to where any frame has extinction.
fn spread(keys: &mut [SolvedKey], animated: &AnimatedVolume, steps: &mut Steps<'_>) -> Result<()> {
    let Some(first) = keys.first() else { return Ok(()) };
    steps.begin("diffusing", Some(keys.len() as u64));
    let mut occupied = Occupied::at(*first.state().medium.extinction.grid(), &animated.occupied);
    keys.iter().try_for_each(|key| occupied.add(&key.state().medium.extinction))?;
    memory::check_spread(first.scene(), occupied.len())?;
    for (index, key) in keys.iter_mut().enumerate() {
        let now = &mut key.attained;
        (now.state, key.spread) = now.state.spread(&now.determined, &occupied)?;
        steps.advance(index as u64 + 1, "");
    }
    Ok(())
}

impl SolvedKey {
    fn scene(&self) -> &VolumeScene {
        &self.animated.animation.keys[self.index].scene
    }

    /// The volume with what was found, and the light around it.
    pub(in crate::job) fn state(&self) -> &VolumeState {
        &self.attained.state
    }

    /// The picture of a view.
    pub(in crate::job) fn picture(&self, view: &str) -> Option<&Image> {
        let index = self.scene().views.iter().position(|seen| seen.view.name == view)?;
        self.attained.after.get(index)
    }

    /// The pictures of what was found and spread.
    fn draw(&mut self, engine: &mut Engine, steps: &mut Steps<'_>) -> Result<()> {
        steps.within(format!("frame {}", self.frame));
        let scene = &self.animated.animation.keys[self.index].scene;
        let Attained { state, optics, desired, after, distances, .. } = &mut self.attained;
        *after = draw(scene, state, optics, engine, steps)?;
        distances[1] = distance(desired, after);
        steps.within(String::new());
        Ok(())
    }

    /// Writes what was found, and the pictures of the key.
    fn write(&self, folder: &Folder, formats: &[Format]) -> Result<Vec<report::ViewPictures>> {
        let (prefix, scene) = (of_frame("key", self.frame), self.scene());
        let Attained { state, desired, before, after, .. } = &self.attained;
        results::write_volumes(folder, &prefix, &scene.stages, &state.medium, formats)?;
        if scene.stages.contains(&Find::Environment) {
            let name = format!("{prefix}environment");
            let (basis, found) = (&scene.light_basis, &state.environment);
            write_environment(folder, &name, basis, found, None, scene.exposure)?;
        }
        let mut views = results::write_views(folder, &prefix, scene, desired, before, after)?;
        views.iter_mut().for_each(|view| view.name = self.named(&view.name));
        Ok(views)
    }

    /// What a view at this key is called in the report.
    fn named(&self, view: &str) -> String {
        format!("{view}, frame {}", self.frame)
    }
}

/// The pictures of all views of a state.
fn draw(
    scene: &VolumeScene,
    state: &VolumeState,
    optics: &Optics,
    engine: &mut Engine,
    steps: &mut Steps<'_>,
) -> Result<Vec<Image>> {
    let last = *scene.stages.last().ok_or_else(nothing_asked)?;
    view_pictures(scene, &state.medium, optics, VolumeProblem::model(scene, last), engine, steps)
}

/// What frames are drawn from.
struct VolumeFilm<'a> {
    animated: &'a AnimatedVolume,
    keys: &'a [SolvedKey],
    options: &'a Options,
    engine: Engine,
}

impl Film for VolumeFilm<'_> {
    fn count(&self) -> usize {
        self.animated.animation.frames
    }

    fn views(&self) -> Vec<String> {
        let views = self.keys.first().map_or(&[][..], |key| &key.scene().views);
        views.iter().map(|view| view.view.name.clone()).collect()
    }

    fn exposure(&self) -> f64 {
        self.keys.first().map_or(0.0, |key| key.scene().exposure)
    }

    fn frame(&mut self, frame: usize, folder: &Folder, steps: &mut Steps<'_>) -> Result<Option<Vec<Image>>> {
        let Some((state, pictures)) = self.drawn(frame, steps)? else { return Ok(None) };
        if let (true, Some(key)) = (self.options.frame_volumes, self.keys.first()) {
            let finds = [&key.scene().stages[..], &[Find::Extinction]].concat();
            let prefix = of_frame("frame", frame);
            results::write_volumes(folder, &prefix, &finds, &state.medium, &self.options.formats)?;
        }
        Ok(Some(pictures))
    }
}

impl VolumeFilm<'_> {
    /// The state at a frame, and its pictures; none of a frame between keys after somebody stopped the job.
    fn drawn(&mut self, frame: usize, steps: &mut Steps<'_>) -> Result<Option<(VolumeState, Vec<Image>)>> {
        if let Some(key) = self.keys.iter().find(|key| key.frame == frame) {
            return Ok(Some((key.state().clone(), key.attained.after.clone())));
        }
        if steps.stops() {
            return Ok(None);
        }
        let frames: Vec<usize> = self.keys.iter().map(|key| key.frame).collect();
        let KeySpan { keys, share } = KeySpan::of(&frames, frame);
        let [from, to] = keys.map(|key| &self.keys[key]);
        let mut state = from.state().blended(to.state(), share)?;
        if let Some(extinction) = self.animated.extinction(frame)? {
            state.medium.extinction = extinction.into();
        }
        steps.begin("lighting", None);
        let optics = Optics::new(from.scene(), from.attained.optics.geometry(), &state)?;
        let pictures = draw(from.scene(), &state, &optics, &mut self.engine, steps)?;
        Ok(Some((state, pictures)))
    }
}

/// The report of all keys: the numbers of the last one, with what can be said of all together.
fn report(animated: &AnimatedVolume, keys: &[SolvedKey], timings: &Timings) -> Result<Report> {
    let (mut stages, mut views, mut records) = (Vec::new(), Vec::new(), Vec::new());
    let (mut sums, mut adjoint_error) = ([[0.0; 2]; 2], 0.0f64);
    for key in keys {
        let Attained { distances, desired, .. } = &key.attained;
        let [before, after] = distances;
        for mut stage in key.report.stages.clone() {
            stage.frame = Some(key.frame as u64);
            stages.push(stage);
        }
        for mut view in matched(key.scene(), desired, [before, after]) {
            view.view = key.named(&view.view);
            views.push(view);
        }
        for (sum, distance) in sums.iter_mut().zip(distances) {
            (0..2).for_each(|k| sum[k] += distance.sums[k]);
        }
        adjoint_error = adjoint_error.max(key.report.adjoint_error);
        records.push(KeyRecord {
            frame: key.frame as u64,
            weighted_residual: Some(Change { before: before.all, after: after.all }),
            spread_voxels: key.spread.voxels as u64,
            spread_iterations: key.spread.iterations as u64,
        });
    }
    let mut report = keys.last().ok_or_else(nothing_asked)?.report.clone();
    report.memory.extend(peak_memory().map(|peak| ("peak".to_owned(), peak)));
    let [before, after] = sums.map(relative);
    Ok(Report {
        command: "animate".to_owned(),
        weighted_residual: Change { before, after },
        matched: views,
        stages,
        adjoint_error,
        timings: timings.iter().cloned().collect(),
        animation: Some(AnimationRecord {
            frames: animated.animation.frames as u64,
            // None yet: frames are drawn when they are written.
            drawn: 0,
            between: animated.between.to_owned(),
            light_map: None,
            keys: records,
        }),
        ..report
    })
}
