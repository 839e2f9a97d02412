//! From key frames of the sun, the cameras and the looks to all frames.

use std::sync::Arc;

use serde_json::json;

use super::engine::Engine;
use super::exposure::readable;
use super::film::{self, Film, of_frame};
use super::folder::Folder;
use super::light_map::{self, FoundLightMap};
use super::light_views::draw_views;
use super::steps::{Steps, Timings};
use super::{Options, Scenes, peak_memory, warnings};
use crate::io::scene_file::Chosen;
use crate::problem::{Drawing, DrawnLight, fit, settle_key_frames};
use crate::report::{self, AnimationRecord, Change, KeyRecord, Report, StageRecord};
use crate::scene::{AnimatedScene, Image, KeySpan, LightMaps, Rgb, Scene, mixed, rgb};
use crate::visibility::Geometry;
use crate::{Error, Result};

/// The key frames of an animation that were solved and drawn, from which the others are drawn.
pub(super) struct FoundLightAnimation {
    /// With what its keys have in common put into each of them.
    animated: AnimatedScene,
    geometry: Arc<Geometry>,
    keys: Vec<DrawnKey>,
    frames: Vec<usize>,
    /// Stops by which pictures are brightened, the same for all frames.
    exposure: f64,
    is_interrupted: bool,
    /// What draws the frames between them.
    engine: Engine,
}

/// A key frame that was drawn.
struct DrawnKey {
    frame: usize,
    /// None where no light map was looked for.
    found: Option<FoundLightMap>,
    /// One a view.
    pictures: Vec<Image>,
}

/// Solves the keys that ask for a light map, each as `light-map` would, and draws all of them.
pub(super) fn solve_keys(
    animated: &Arc<AnimatedScene>,
    options: &Options,
    engine: &mut Engine,
    folder: Option<&Folder>,
    steps: &mut Steps<'_>,
) -> Result<FoundLightAnimation> {
    let frames = film::asked(options.frames.clone(), animated.animation.frames)?;
    steps.begin("tracing", None);
    let geometry = Scenes::LightAnimation(animated.clone()).geometry()?;
    let animated = settle_key_frames(animated, &geometry)?;
    // Frames are pictures.
    let options = &Options { pictures: true, ..options.clone() };
    let mut found = FoundLightAnimation {
        animated,
        geometry,
        keys: Vec::new(),
        frames,
        exposure: 0.0,
        is_interrupted: false,
        engine: engine.clone(),
    };
    for index in 0..found.animated.animation.keys.len() {
        match found.key(index, options, engine, folder, steps) {
            Ok(Some(key)) => found.keys.push(key),
            Ok(None) => break,
            Err(Error::Interrupted) if index > 0 => break,
            Err(error) => return Err(error),
        }
        if steps.stops() {
            break;
        }
    }
    if found.keys.is_empty() {
        return Err(Error::Interrupted);
    }
    steps.within(String::new());
    let pictures = || found.keys.iter().flat_map(|key| &key.pictures);
    found.exposure = found.first_scene().exposure.unwrap_or_else(|| readable(pictures()));
    found.is_interrupted = steps.stops();
    Ok(found)
}

impl FoundLightAnimation {
    pub(super) fn is_interrupted(&self) -> bool {
        self.is_interrupted
    }

    /// The light map of the first key, where one was looked for.
    pub(super) fn light_map(&self) -> Result<Image> {
        let found = self.keys.first().and_then(|key| key.found.as_ref());
        found.map_or_else(|| Err(nothing_looked_for()), FoundLightMap::light_map)
    }

    /// The picture of a view at the first key.
    pub(super) fn picture(&self, view: &str) -> Option<&Image> {
        let index = self.first_scene().views.iter().position(|seen| seen.name == view)?;
        self.keys.first()?.pictures.get(index)
    }

    fn first_scene(&self) -> &Scene {
        &self.animated.animation.keys[0].scene
    }

    /// Solves a key where it asks for a light map, and draws it; none where somebody stopped that.
    fn key(
        &self,
        index: usize,
        options: &Options,
        engine: &mut Engine,
        folder: Option<&Folder>,
        steps: &mut Steps<'_>,
    ) -> Result<Option<DrawnKey>> {
        let key = &self.animated.animation.keys[index];
        steps.within(format!("frame {}", key.frame));
        if index >= self.animated.light_maps.count(self.animated.animation.keys.len()) {
            if index == 0 {
                warnings::tell_of_fog(&key.scene, &self.geometry);
            }
            let pictures = self.draw(key.frame, engine, steps)?;
            return Ok(pictures.map(|pictures| DrawnKey { frame: key.frame, found: None, pictures }));
        }
        steps.begin("tracing", None);
        let prefix = of_frame("key", key.frame);
        let others = self.animated.others();
        let place =
            light_map::Place { options, folder, prefix: &prefix, is_later: index > 0, others: &others };
        let found = light_map::solve(&key.scene, &self.geometry, engine, place, steps)?;
        // Its checkpoint.
        folder.map_or(Ok(()), Folder::publish)?;
        let pictures = found.pictures.iter().map(|view| view.after.clone()).collect();
        Ok(Some(DrawnKey { frame: key.frame, found: Some(found), pictures }))
    }

    /// Draws the views at a frame; none where somebody stopped it.
    fn draw(&self, frame: usize, engine: &mut Engine, steps: &mut Steps<'_>) -> Result<Option<Vec<Image>>> {
        steps.begin("tracing", None);
        let scene = self.animated.at(frame)?;
        let maps = fit(&scene, &scene.light_map, &self.geometry)?;
        let light_map = self.light_map_at(frame, &scene);
        let drawn = draw_views(
            &scene,
            &maps,
            (light_map.as_deref(), DrawnLight::All, Drawing::default()),
            engine,
            steps,
        )?;
        Ok(drawn.map(|drawn| drawn.into_iter().map(|rendering| rendering.after).collect()))
    }

    /// The texels at a frame, whose scene is known; none where light is as it is.
    fn light_map_at(&self, frame: usize, scene: &Scene) -> Option<Vec<Rgb>> {
        let found: Vec<(usize, &FoundLightMap)> =
            self.keys.iter().filter_map(|key| Some((key.frame, key.found.as_ref()?))).collect();
        let texels = |key: usize| found.get(key).map(|(_, found)| &found.computed.solved.x);
        match self.animated.light_maps {
            LightMaps::None => None,
            LightMaps::One => {
                let (was, is) = (self.first_scene().light.radiance, scene.light.radiance);
                let passed = |texel: &Rgb| rgb(|c| passed(texel[c], was[c], is[c]));
                texels(0).map(|texels| texels.iter().map(passed).collect())
            }
            LightMaps::Each => {
                let frames: Vec<usize> = found.iter().map(|(frame, _)| *frame).collect();
                let KeySpan { keys: [from, to], share } = KeySpan::of(&frames, frame);
                let (from, to) = (texels(from)?, texels(to)?);
                Some(from.iter().zip(to).map(|(from, to)| mixed(from, to, share)).collect())
            }
        }
    }

    /// Values that the scene file has not, and that were fitted to it.
    pub(super) fn chosen(&self) -> Vec<Chosen> {
        let why =
            "all but the brightest tenth of the pictures of all keys is no brighter than 0.7 on the screen";
        vec![Chosen { path: "exposure", value: json!(self.exposure), why: why.to_owned() }]
    }

    /// Writes what was found at the keys, and draws and writes the frames. Gives back the pictures of the page, and how many frames were
    /// drawn.
    pub(super) fn write(&self, folder: &Folder, steps: &mut Steps<'_>) -> Result<(report::Pictures, usize)> {
        let mut in_page = report::Pictures::default();
        for (key, at) in self.keys.iter().zip(&self.animated.animation.keys) {
            let Some(found) = &key.found else { continue };
            let scene = Scene { exposure: Some(self.exposure), ..at.scene.clone() };
            let written = found.write(&scene, folder)?;
            let views = scene.views.iter().zip(written.views);
            in_page.views.extend(views.map(|(view, pictures)| report::ViewPictures {
                name: named(&view.name, key.frame),
                ..pictures
            }));
            if in_page.found.is_none() {
                (in_page.found, in_page.coverage) = (written.found, written.coverage);
            }
            folder.publish()?;
        }
        let mut film = LightFilm { found: self, engine: self.engine.clone() };
        let drawn = film::write_frames(&mut film, &self.frames, folder, &mut in_page.frames, steps)?;
        Ok((in_page, drawn))
    }

    /// The report of all keys: the numbers of the last one that was solved, with what can be said of all together.
    pub(super) fn report(&self, timings: &Timings) -> Result<Report> {
        let (mut stages, mut views, mut records) = (Vec::new(), Vec::new(), Vec::new());
        let (mut sums, mut adjoint_error, mut last) = ([[0.0; 2]; 2], 0.0f64, None);
        for (key, at) in self.keys.iter().zip(&self.animated.animation.keys) {
            let mut record = KeyRecord { frame: key.frame as u64, ..KeyRecord::default() };
            if let Some(found) = &key.found {
                let report = found.report(&at.scene, &Vec::new())?;
                record.weighted_residual = Some(report.weighted_residual);
                stages.push(StageRecord {
                    frame: Some(key.frame as u64),
                    find: "light map".to_owned(),
                    problem: report.problem.clone(),
                    weighted_residual: report.weighted_residual,
                    stop: report.stop.clone(),
                    certificate: report.certificate.clone(),
                    ..StageRecord::default()
                });
                let own = report.matched.iter().cloned();
                views
                    .extend(own.map(|view| report::ViewMatch { view: named(&view.view, key.frame), ..view }));
                let others = self.animated.others();
                for (number, (other, at)) in (1..).zip(others.iter().zip(&self.animated.animation.keys[1..]))
                {
                    let matched = found.matched_at(other, number);
                    views.extend(
                        matched
                            .into_iter()
                            .map(|view| report::ViewMatch { view: named(&view.view, at.frame), ..view }),
                    );
                }
                for (sum, own) in sums.iter_mut().zip(found.distances()) {
                    (0..2).for_each(|k| sum[k] += own[k]);
                }
                adjoint_error = adjoint_error.max(report.adjoint_error);
                last = Some(report);
            }
            records.push(record);
        }
        let nothing = || Report {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: self.first_scene().name.clone(),
            ..Report::default()
        };
        let mut report = last.unwrap_or_else(nothing);
        report.memory.extend(peak_memory().map(|peak| ("peak".to_owned(), peak)));
        let [before, after] = sums.map(|[miss, all]| if all > 0.0 { (miss / all).sqrt() } else { 0.0 });
        let light_map = match self.animated.light_maps {
            LightMaps::None => "none",
            LightMaps::One => "one",
            LightMaps::Each => "each",
        };
        Ok(Report {
            command: "animate".to_owned(),
            weighted_residual: Change { before, after },
            matched: views,
            stages,
            adjoint_error,
            timings: timings.iter().cloned().collect(),
            animation: Some(AnimationRecord {
                frames: self.animated.animation.frames as u64,
                light_map: Some(light_map.to_owned()),
                keys: records,
                ..AnimationRecord::default()
            }),
            ..report
        })
    }
}

/// What a texel that was found under the light `was` passes of the light `is`: the same part; all, where there was none.
fn passed(texel: f32, was: f32, is: f32) -> f32 {
    if was > 0.0 { texel / was * is } else { texel + is }
}

/// What a view at a key is called in the report.
fn named(view: &str, frame: usize) -> String {
    format!("{view}, frame {frame}")
}

fn nothing_looked_for() -> Error {
    Error::Empty {
        reason: "no light map was looked for".to_owned(),
        remedy: "paint something, and set animation.light_map to each or one",
    }
}

/// What frames are drawn from.
struct LightFilm<'a> {
    found: &'a FoundLightAnimation,
    engine: Engine,
}

impl Film for LightFilm<'_> {
    fn count(&self) -> usize {
        self.found.animated.animation.frames
    }

    fn views(&self) -> Vec<String> {
        self.found.first_scene().views.iter().map(|view| view.name.clone()).collect()
    }

    fn exposure(&self) -> f64 {
        self.found.exposure
    }

    fn frame(&mut self, frame: usize, _: &Folder, steps: &mut Steps<'_>) -> Result<Option<Vec<Image>>> {
        if let Some(key) = self.found.keys.iter().find(|key| key.frame == frame) {
            return Ok(Some(key.pictures.clone()));
        }
        if steps.stops() {
            return Ok(None);
        }
        self.found.draw(frame, &mut self.engine, steps)
    }
}
