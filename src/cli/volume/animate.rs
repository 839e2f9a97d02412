//! `unscatter animate`: from key frames to all frames.

use std::ops::RangeInclusive;

use super::super::args::AnimateArguments;
use super::super::engine::Engine;
use super::super::environment::write_environment;
use super::super::progress::{Steps, interrupted, watch_interrupt};
use super::super::results::Folder;
use super::super::{Done, Manners, job, machine};
use super::findings::{Findings, matched};
use super::stage::Place;
use super::staging::{self, Distance, Outcome, distance, relative};
use super::{memory, nothing_asked, pictures, results, summary};
use crate::io::scene_file::AnimatedVolume;
use crate::io::volume::Format;
use crate::problem::{Desired, Determined, Occupied, Optics, Spread, VolumeProblem, VolumeState};
use crate::report::{self, AnimationRecord, Change, KeyRecord, Report};
use crate::scene::{Between, Find, Image, VolumeScene};
use crate::{Error, Result};

/// Pictures in the strip of the report at most.
const STRIP: usize = 12;

/// What the files of a frame begin with.
pub(in crate::cli) fn of_frame(kind: &str, frame: usize) -> String {
    format!("{kind}_{frame:04}_")
}

/// `unscatter animate`: solves the key frames, spreads what they found, blends, and draws every frame.
pub(in crate::cli) fn animate(arguments: &AnimateArguments, manners: &Manners) -> Result<Done> {
    let mut steps = Steps::new(manners.quiet);
    steps.begin("reading", None);
    let animated = job::load_animation(&arguments.scene, &arguments.overrides())?;
    let formats = arguments.formats()?;
    let frames = asked(arguments.frames.clone(), animated.animation.frames)?;
    let mut engine = Engine::choose(&arguments.backend)?;
    let folder = Folder::create(arguments.output.output.clone(), &arguments.scene.scene)?;
    watch_interrupt()?;

    let mut keys = solve(&animated, &mut engine, arguments, &folder, &mut steps)?;
    spread(&mut keys, &animated, &mut steps)?;
    let mut in_page = report::Pictures::default();
    for key in &mut keys {
        key.draw(&mut steps)?;
        in_page.views.extend(key.write(&folder, &formats)?);
        folder.publish()?;
    }
    let film = Film { animated: &animated, keys: &keys, folder: &folder, formats: &formats, arguments };
    let drawn = film.draw(frames, &mut in_page.frames, &mut steps)?;
    let report = report(&animated, keys, drawn, steps.finish())?;
    folder.write_bytes("report.json", report.to_json()?.as_bytes())?;
    folder.write_bytes("report.html", report::html(&report, &in_page)?.as_bytes())?;
    folder.publish()?;
    manners.print(&report.to_json()?, &summary(&report, &folder));
    Ok(if interrupted() { Done::Interrupted } else { Done::Completely })
}

/// The frames that are to be drawn.
fn asked(frames: Option<RangeInclusive<usize>>, count: usize) -> Result<Vec<usize>> {
    let frames = frames.unwrap_or(0..=count.saturating_sub(1));
    if *frames.end() >= count {
        let given = format!("{}..{}", frames.start(), frames.end());
        return Err(Error::value(
            "--frames",
            given,
            "within the frames of the animation, which begin with 0",
        ));
    }
    Ok(frames.collect())
}

/// A key frame that was solved.
struct SolvedKey<'a> {
    frame: usize,
    scene: &'a VolumeScene,
    state: VolumeState,
    optics: Optics,
    desired: Vec<Desired>,
    before: Vec<Image>,
    after: Vec<Image>,
    distances: [Distance; 2],
    determined: Vec<Determined>,
    spread: Spread,
    /// Of this key alone, before anything was spread.
    report: Report,
}

/// Solves the keys in turn, each as `volume` would; after Ctrl-C those that were begun.
fn solve<'a>(
    animated: &'a AnimatedVolume,
    engine: &mut Engine,
    arguments: &AnimateArguments,
    folder: &Folder,
    steps: &mut Steps,
) -> Result<Vec<SolvedKey<'a>>> {
    let mut keys = Vec::new();
    steps.begin("lighting", None);
    let geometry = job::geometry_of(animated.animation.keys.iter().map(|key| &key.scene))?;
    for (index, key) in animated.animation.keys.iter().enumerate() {
        steps.within(format!("frame {}", key.frame));
        let prefix = of_frame("key", key.frame);
        let place = Place { solve: &arguments.solve, folder, prefix: &prefix, is_later: index > 0 };
        let outcome = staging::run(&key.scene, &geometry, engine, place, steps)?;
        // Its checkpoint.
        folder.publish()?;
        let is_interrupted = outcome.is_interrupted();
        let report = Findings { scene: &key.scene, outcome: &outcome }.report(Vec::new());
        // The rows are not needed any more.
        let Outcome { state, optics, desired, before, after, distances, determined, .. } = outcome;
        keys.push(SolvedKey {
            frame: key.frame,
            scene: &key.scene,
            state,
            optics,
            desired,
            before,
            after,
            distances,
            determined,
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
fn spread(keys: &mut [SolvedKey], animated: &AnimatedVolume, steps: &mut Steps) -> Result<()> {
    let Some(first) = keys.first() else { return Ok(()) };
    steps.begin("diffusing", Some(keys.len() as u64));
    let mut occupied = Occupied::at(*first.state.medium.extinction.grid(), &animated.occupied);
    keys.iter().try_for_each(|key| occupied.add(&key.state.medium.extinction))?;
    memory::check_spread(first.scene, occupied.len())?;
    for (index, key) in keys.iter_mut().enumerate() {
        (key.state, key.spread) = key.state.spread(&key.determined, &occupied)?;
        steps.advance(index as u64 + 1, String::new());
    }
    Ok(())
}

impl SolvedKey<'_> {
    /// The pictures of what was found and spread.
    fn draw(&mut self, steps: &mut Steps) -> Result<()> {
        steps.within(format!("frame {}", self.frame));
        self.after = draw(self.scene, &self.state, &self.optics, steps)?;
        self.distances[1] = distance(&self.desired, &self.after);
        steps.within(String::new());
        Ok(())
    }

    /// Writes what was found, and the pictures of the key.
    fn write(&self, folder: &Folder, formats: &[Format]) -> Result<Vec<report::ViewPictures>> {
        let prefix = of_frame("key", self.frame);
        results::write_volumes(folder, &prefix, &self.scene.stages, &self.state.medium, formats)?;
        if self.scene.stages.contains(&Find::Environment) {
            let (name, scene) = (format!("{prefix}environment"), self.scene);
            let (basis, found) = (&scene.light_basis, &self.state.environment);
            write_environment(folder, &name, basis, found, None, scene.exposure)?;
        }
        let mut views =
            results::write_views(folder, &prefix, self.scene, &self.desired, &self.before, &self.after)?;
        views.iter_mut().for_each(|view| view.name = self.named(&view.name));
        Ok(views)
    }

    /// What a view at this key is called in the report.
    fn named(&self, view: &str) -> String {
        format!("{view}, frame {}", self.frame)
    }
}

/// The pictures of all views of a state.
fn draw(scene: &VolumeScene, state: &VolumeState, optics: &Optics, steps: &mut Steps) -> Result<Vec<Image>> {
    let last = *scene.stages.last().ok_or_else(nothing_asked)?;
    pictures(scene, &state.medium, optics, VolumeProblem::model(scene, last), steps)
}

/// What frames are drawn from.
struct Film<'a> {
    animated: &'a AnimatedVolume,
    keys: &'a [SolvedKey<'a>],
    folder: &'a Folder,
    formats: &'a [Format],
    arguments: &'a AnimateArguments,
}

impl Film<'_> {
    /// Draws and writes frames, and puts some of them into the strip; after Ctrl-C only keys. Says how many there are.
    fn draw(&self, frames: Vec<usize>, strip: &mut Vec<(u64, Vec<u8>)>, steps: &mut Steps) -> Result<usize> {
        let every = frames.len().div_ceil(STRIP).max(1);
        let mut drawn = 0;
        for (index, &frame) in frames.iter().enumerate() {
            steps.within(format!("frame {frame} of {}", self.animated.animation.frames));
            let Some((state, pictures)) = self.frame(frame, steps)? else { continue };
            self.write(frame, &state, &pictures)?;
            drawn += 1;
            if index % every == 0
                && let Some(picture) = pictures.first()
            {
                let small = results::small_png(picture, self.keys[0].scene.exposure)?;
                strip.push((frame as u64, small));
            }
        }
        steps.within(String::new());
        Ok(drawn)
    }

    /// A frame between keys, and its pictures; none where it is not to be had any more.
    fn frame(&self, frame: usize, steps: &mut Steps) -> Result<Option<(VolumeState, Vec<Image>)>> {
        if let Some(key) = self.keys.iter().find(|key| key.frame == frame) {
            return Ok(Some((key.state.clone(), key.after.clone())));
        }
        if interrupted() {
            return Ok(None);
        }
        let frames: Vec<usize> = self.keys.iter().map(|key| key.frame).collect();
        let Between { keys, share } = Between::of(&frames, frame);
        let [from, to] = keys.map(|key| &self.keys[key]);
        let mut state = from.state.blended(&to.state, share)?;
        if let Some(extinction) = self.animated.extinction(frame)? {
            state.medium.extinction = extinction.into();
        }
        steps.begin("lighting", None);
        let optics = Optics::new(from.scene, from.optics.geometry(), &state)?;
        let pictures = draw(from.scene, &state, &optics, steps)?;
        Ok(Some((state, pictures)))
    }

    fn write(&self, frame: usize, state: &VolumeState, pictures: &[Image]) -> Result<()> {
        let (prefix, scene) = (of_frame("frame", frame), self.keys[0].scene);
        for (view, picture) in scene.views.iter().zip(pictures) {
            let name = format!("{prefix}{}", view.view.name);
            self.folder.write_picture(&name, picture, scene.exposure)?;
        }
        if self.arguments.volumes {
            let finds = [&scene.stages[..], &[Find::Extinction]].concat();
            results::write_volumes(self.folder, &prefix, &finds, &state.medium, self.formats)?;
        }
        self.folder.publish()
    }
}

/// The report of all keys: the numbers of the last one, with what can be said of all together.
fn report(
    animated: &AnimatedVolume,
    mut keys: Vec<SolvedKey>,
    drawn: usize,
    timings: Vec<(String, f64)>,
) -> Result<Report> {
    let (mut stages, mut views, mut records) = (Vec::new(), Vec::new(), Vec::new());
    let (mut sums, mut adjoint_error) = ([[0.0; 2]; 2], 0.0f64);
    for key in &mut keys {
        let [before, after] = &key.distances;
        for mut stage in std::mem::take(&mut key.report.stages) {
            stage.frame = Some(key.frame as u64);
            stages.push(stage);
        }
        for mut view in matched(key.scene, &key.desired, [before, after]) {
            view.view = key.named(&view.view);
            views.push(view);
        }
        for (sum, distance) in sums.iter_mut().zip(&key.distances) {
            (0..2).for_each(|k| sum[k] += distance.sums[k]);
        }
        adjoint_error = adjoint_error.max(key.report.adjoint_error);
        records.push(KeyRecord {
            frame: key.frame as u64,
            weighted_residual: Change { before: before.all, after: after.all },
            spread_voxels: key.spread.voxels as u64,
            spread_iterations: key.spread.iterations as u64,
        });
    }
    let mut report = keys.pop().ok_or_else(nothing_asked)?.report;
    report.memory.extend(machine::peak_memory().map(|peak| ("peak".to_owned(), peak)));
    let [before, after] = sums.map(relative);
    Ok(Report {
        command: "animate".to_owned(),
        weighted_residual: Change { before, after },
        matched: views,
        stages,
        adjoint_error,
        timings: timings.into_iter().collect(),
        animation: Some(AnimationRecord {
            frames: animated.animation.frames as u64,
            drawn: drawn as u64,
            between: animated.between.to_owned(),
            keys: records,
        }),
        ..report
    })
}
