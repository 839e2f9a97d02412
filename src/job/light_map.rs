//! From painted strokes to a light map.

use std::sync::Arc;

use glam::DVec2;
use serde_json::json;

use super::Options;
use super::air::write_air;
use super::checkpoint::Keeper;
use super::compute::{Computed, ProblemSolve};
use super::engine::Engine;
use super::environment::write_environment;
use super::exposure::readable;
use super::findings::{Findings, reached};
use super::folder::{Folder, ViewImages};
use super::memory::MemoryBudget;
use super::painted::{Make, draw, hue_angles, matched, trace, with_looks};
use super::placement::Placement;
use super::steps::{Steps, Timings};
use super::warnings;
use crate::Result;
use crate::io::scene_file::Chosen;
use crate::operator::CpuVector;
use crate::problem::{
    Assessment, Assessor, Canvas, Constraint, Drawing, LightMapProblem, Renderer, Surfaces, held_back, pixels,
};
use crate::report::{
    self, Change, FoundPicture, LightRecord, Report, Share, SunRecord, SurroundingsRecord, ViewMatch,
};
use crate::scene::{Environment, Grid, Image, MapFit, Rgb, Scene, Sky, SolveSettings};
use crate::visibility::Geometry;

/// A light map that was found, and all there is to know about it.
#[derive(Debug)]
pub(crate) struct FoundLightMap {
    /// What the names of its files begin with.
    prefix: String,
    pub(crate) problem: LightMapProblem,
    settings: SolveSettings,
    pub(crate) computed: Computed,
    /// Before and after.
    assessments: [Assessment; 2],
    light: LightRecord,
    /// None where no pictures were asked for.
    pub(crate) pictures: Vec<ViewImages>,
}

/// Where a light map is looked for.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    pub(super) options: &'a Options,
    pub(super) folder: Option<&'a Folder>,
    /// What the names of its files begin with.
    pub(super) prefix: &'a str,
    /// Whether others were solved before, so that there need not be a checkpoint to resume from.
    pub(super) is_later: bool,
    /// Further scenes before whose suns the same light map stands.
    pub(super) others: &'a [Scene],
}

/// The problem of a scene whose pixels are painted already, and of the others before whose suns its light map stands.
///
/// Errors: those of [`LightMapProblem::before_suns`], and of painting the others.
pub(super) fn problem_of(
    (scene, painted): (&Scene, Vec<Constraint>),
    others: &[Scene],
    geometry: &Arc<Geometry>,
    surfaces: &dyn Surfaces,
) -> Result<LightMapProblem> {
    let mut all = vec![(scene, painted)];
    for other in others {
        all.push((other, pixels(other)?));
    }
    LightMapProblem::before_suns(all, geometry, surfaces)
}

/// Solves a scene, in the step `tracing` that has begun with `geometry`, the hierarchy over its triangles. Checkpoints and previews go to the
/// folder, if there is one.
pub(super) fn solve(
    scene: &Scene,
    geometry: &Arc<Geometry>,
    engine: &mut Engine,
    place: Place<'_>,
    steps: &mut Steps<'_>,
) -> Result<FoundLightMap> {
    let Place { options, folder, prefix, is_later, others } = place;
    let make: &Make<'_, LightMapProblem> =
        &|scene, geometry, painted, surfaces| problem_of((scene, painted), others, geometry, surfaces);
    let problem = trace(scene, geometry, (engine, options.rasterize), steps, make)?;
    steps.go_on()?;
    warnings::tell_of_fog(scene, &problem.maps.geometry);
    warnings::tell_of_panes(&problem.maps);
    warnings::tell_of_air(scene, &problem.maps.geometry);
    warnings::tell_of_shadow(scene, &problem)?;
    let memory = MemoryBudget::of_light_map(scene);
    let settings = memory.settled(scene.solve.clone(), &problem)?;
    let keeper = |folder| Keeper::new(folder, &format!("{prefix}checkpoint"), &settings, &problem);
    let checkpoint = folder.map(keeper).transpose()?;
    let resumed = match &checkpoint {
        Some(checkpoint) if options.resume => checkpoint.resumed(is_later)?,
        _ => None,
    };
    let task = ProblemSolve {
        problem: &problem,
        settings: &settings,
        memory: &memory,
        options,
        checkpoint: checkpoint.as_ref(),
        preview: &|elements| {
            folder.map_or(Ok(()), |folder| preview(scene, &problem, (folder, prefix), elements))
        },
    };
    let (computed, (assessments, held_back)) =
        task.run(engine, resumed, steps, &|operator, elements, steps| {
            steps.begin("assessing", None);
            let views = scene.views.len() * (1 + others.len());
            let assessor = Assessor::new(&problem, operator)?;
            let assessments = [assessor.assess(&problem.starts(), views)?, assessor.assess(elements, views)?];
            Ok((assessments, held_back(&problem, operator, &settings, elements)?))
        })?;
    let [texels, _] = problem.parted(&computed.solved.x);
    let light = LightRecord {
        brightest: brightest(&problem, texels),
        outside: problem.share_from_outside(),
        held_back,
    };
    let painted_views = assessments[1].views.iter().filter(|view| view.pixels > 0).count();
    let missed = computed.out_of_reach.missed;
    warnings::tell_of_light(scene, &light, (&assessments[1].all, missed), painted_views);
    let pictures = match options.pictures {
        true => {
            steps.begin("rendering", Some(scene.views.len() as u64));
            let renderer = Renderer::new(scene, &problem.maps, Some(&computed.solved.x))?;
            draw((scene, prefix), &problem, &assessments, steps, |view| {
                engine.draw(|canvas| renderer.picture(view, canvas))
            })?
        }
        false => Vec::new(),
    };
    let prefix = prefix.to_owned();
    Ok(FoundLightMap { prefix, problem, settings, computed, assessments, light, pictures })
}

impl FoundLightMap {
    pub(super) fn report(&self, scene: &Scene, timings: &Timings) -> Result<Report> {
        let Self { problem, settings, computed, assessments, light, .. } = self;
        let [before, after] = assessments;
        let about = (scene.name.as_str(), scene.target, scene.pixels());
        let report = Report {
            weighted_residual: Change { before: before.all.residual, after: after.all.residual },
            matched: self.matched_at(scene, 0),
            hue: Some(hue_angles(&after.all)),
            light: Some(*light),
            surroundings: self.surroundings(scene),
            ..Findings { problem, settings, computed }.report("light-map", about, timings)?
        };
        Ok(with_looks(report, scene))
    }

    /// How near the pictures of painted views of the scene with that number have come.
    pub(super) fn matched_at(&self, scene: &Scene, number: usize) -> Vec<ViewMatch> {
        matched(scene, &self.assessments, number * scene.views.len())
    }

    fn surroundings(&self, scene: &Scene) -> Option<SurroundingsRecord> {
        let around = scene.surroundings.as_ref()?;
        let [_, further] = self.problem.parted(&self.computed.solved.x);
        let [_, covered] = self.problem.parted(&self.computed.coverage.0);
        let sun = around.sun_of(&self.problem.further_start).zip(around.sun_of(further));
        Some(SurroundingsRecord {
            sun: sun.map(|(before, after)| SunRecord { before, after }),
            lights: around.sky.as_ref().map(|_| {
                let lights = around.sky_of(covered);
                Share { count: reached(lights), of: lights.len() as u64 }
            }),
        })
    }

    /// Σ w ‖L − L*‖² and Σ w ‖L*‖² over painted pixels, before and after.
    pub(super) fn distances(&self) -> [[f64; 2]; 2] {
        self.assessments.each_ref().map(|assessment| {
            let rows = self.problem.constraints.iter().enumerate().filter(|(_, pixel)| pixel.is_painted());
            rows.fold([0.0; 2], |[miss, all], (row, pixel)| {
                let (shown, wanted, weight) =
                    (assessment.shown[row], self.problem.wanted(row), f64::from(pixel.weight));
                let sum = |of: &dyn Fn(usize) -> f64| weight * (0..3).map(|c| of(c).powi(2)).sum::<f64>();
                [miss + sum(&|c| f64::from(shown[c] - wanted[c])), all + sum(&|c| f64::from(wanted[c]))]
            })
        })
    }

    /// Stops by which its pictures are brightened.
    fn exposure(&self, scene: &Scene) -> f64 {
        scene.exposure.unwrap_or_else(|| readable(self.pictures.iter().map(|it| &it.before)))
    }

    /// Values that were fitted to the scene, and how.
    pub(super) fn chosen(&self, scene: &Scene) -> Vec<Chosen> {
        let maps = &self.problem.maps;
        let extent = |grid: &Grid| {
            let corner = |corner: DVec2| corner.to_array();
            json!({ "min": corner(grid.extent.min), "max": corner(grid.extent.max) })
        };
        let fitted = match scene.light_map.fit {
            MapFit::Scattered => {
                "the smallest rectangle with round corners that holds 95 % of the light that painted pixels scatter, and usually 98 %"
            }
            MapFit::Seen => "what rays through painted pixels pass, but not beyond the occluders",
        };
        let mut chosen = vec![
            ("light_map.extent", extent(&maps.light_map), fitted.to_owned()),
            (
                "light_map.size",
                json!(maps.light_map.size),
                format!("square texels, at most {} of them", scene.light_map.size.iter().product::<usize>()),
            ),
            (
                "shadow_map.extent",
                extent(maps.shadow_map.grid()),
                "what the views see, but not beyond the occluders".to_owned(),
            ),
        ];
        if let Some(length) = self.problem.fade_length(scene.solve.fade) {
            let why = "1/32 of the side of a square as large as the light map".to_owned();
            chosen.push(("solve.fade", json!(length), why));
        }
        if !self.pictures.is_empty() {
            let why = "all but the brightest tenth of the pictures is no brighter than 0.7 on the screen";
            chosen.push(("exposure", json!(self.exposure(scene)), why.to_owned()));
        }
        chosen.into_iter().map(|(path, value, why)| Chosen { path, value, why }).collect()
    }

    /// The light map, row 0 its top edge as seen upright from the sun.
    pub(super) fn light_map(&self) -> Result<Image> {
        let [texels, _] = self.problem.parted(&self.computed.solved.x);
        light_map_picture(&self.problem, texels)
    }

    /// Writes everything but the report; gives back the pictures of the page.
    pub(super) fn write(&self, scene: &Scene, folder: &Folder) -> Result<report::Pictures> {
        let Self { prefix, problem, computed, .. } = self;
        let [_, further] = problem.parted(&computed.solved.x);
        let exposure = self.exposure(scene);
        let views = self.pictures.iter().map(|view| view.write(folder, exposure));
        let in_page = report::Pictures {
            views: views.collect::<Result<_>>()?,
            found: Some(FoundPicture {
                title: "The light map",
                about: "what the light passes through".to_owned(),
                png: folder.write_picture(
                    &format!("{prefix}light_map"),
                    &self.light_map()?,
                    exposure_of(problem),
                )?,
            }),
            coverage: Some(folder.write_png(
                &format!("{prefix}coverage"),
                &coverage_picture(problem, &computed.coverage)?,
                0.0,
            )?),
            environment: write_sky((scene, exposure), folder, further)?,
            ..report::Pictures::default()
        };
        write_air(&problem.maps, folder, prefix)?;
        let placement = Placement::of(&problem.maps).to_json()?;
        folder.write_bytes(&format!("{prefix}light_map.placement.json"), placement.as_bytes())?;
        Ok(in_page)
    }
}

/// Writes the lights of the sky, where they were looked for; gives back the PNG file.
fn write_sky((scene, exposure): (&Scene, f64), folder: &Folder, further: &[Rgb]) -> Result<Option<Vec<u8>>> {
    let Some(around) = &scene.surroundings else { return Ok(None) };
    let write = |sky: &Sky| {
        // A solver without bounds may leave less than darkness, which nothing emits.
        let lights = around.sky_of(further).iter().map(|color| color.map(|value| value.max(0.0)));
        let found = Environment::lights(sky.basis.clone(), lights.collect())?;
        write_environment(folder, "environment", &sky.basis, &found, around.sun_of(further), exposure)
    };
    around.sky.as_ref().map(write).transpose()
}

fn preview(
    scene: &Scene,
    problem: &LightMapProblem,
    (folder, prefix): (&Folder, &str),
    elements: &[Rgb],
) -> Result<()> {
    let [texels, _] = problem.parted(elements);
    let name = format!("{prefix}light_map");
    folder.write_picture(&name, &light_map_picture(problem, texels)?, exposure_of(problem))?;
    let renderer =
        Renderer::new(scene, &problem.maps, Some(elements))?.drawing(Drawing::preview(&problem.maps));
    let drawn = (0..scene.views.len()).map(|view| renderer.picture(view, &Canvas::Processor));
    let drawn = drawn.collect::<Result<Vec<_>>>()?;
    let exposure = scene.exposure.unwrap_or_else(|| readable(drawn.iter().map(|it| &it.before)));
    for (seen, drawn) in scene.views.iter().zip(&drawn) {
        folder.write_picture(&format!("{prefix}{}_after", seen.name), &drawn.after, exposure)?;
    }
    folder.publish_preview()
}

/// The brightest channel of any texel, as a multiple of the light's.
fn brightest(problem: &LightMapProblem, texels: &[Rgb]) -> f64 {
    let channels = texels.iter().flat_map(|texel| texel.iter().zip(&problem.start));
    channels.filter(|(_, light)| **light > 0.0).map(|(x, light)| f64::from(x / light)).fold(0.0, f64::max)
}

fn light_map_picture(problem: &LightMapProblem, texels: &[Rgb]) -> Result<Image> {
    Image::new(problem.maps.light_map.size, texels.to_vec())?.finite("the light map")
}

/// The coverage as a picture: the logarithm of diag(Tᵀ W T) over six decades, black where no ray arrives.
fn coverage_picture(problem: &LightMapProblem, coverage: &CpuVector) -> Result<Image> {
    let [texels, _] = problem.parted(&coverage.0);
    let most = texels.iter().flatten().copied().fold(f32::MIN_POSITIVE, f32::max);
    let shade =
        |value: f32| if value > 0.0 { ((value / most).log10() / 6.0 + 1.0).clamp(0.05, 1.0) } else { 0.0 };
    Image::new(problem.maps.light_map.size, texels.iter().map(|texel| texel.map(shade)).collect())
}

/// Stops that show the light's own radiance as a light grey, with room for what is brighter.
fn exposure_of(problem: &LightMapProblem) -> f64 {
    let brightest = problem.start.iter().copied().fold(0.0, f32::max);
    if brightest > 0.0 { -(2.0 * f64::from(brightest)).log2() } else { 0.0 }
}
