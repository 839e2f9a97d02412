//! From painted strokes to a transfer function.

use std::sync::Arc;

use serde_json::json;

use super::Options;
use super::air::write_air;
use super::checkpoint::Keeper;
use super::compute::{Computed, ProblemSolve};
use super::engine::Engine;
use super::exposure::readable;
use super::findings::Findings;
use super::folder::{Folder, ViewImages};
use super::memory::MemoryBudget;
use super::painted::{draw, hue_angles, matched, trace, with_looks};
use super::steps::{Steps, Timings};
use super::warnings;
use crate::problem::{
    Assessment, Assessor, Canvas, Renderer, Rendering, TransferFunction, TransferProblem, TransferTable,
};
use crate::report::{self, Change, FoundPicture, Report};
use crate::scene::{Image, Rgb, Scene, SolveSettings, TransferAxis, TransferRole};
use crate::visibility::Geometry;
use crate::{Error, Result};

/// The name of what was found, among the results.
const FOUND: &str = "transfer";

/// A transfer function that was found, and all there is to know about it.
#[derive(Debug)]
pub(crate) struct FoundTransfer {
    problem: TransferProblem,
    settings: SolveSettings,
    pub(crate) computed: Computed,
    /// Before and after.
    assessments: [Assessment; 2],
    /// None where no pictures were asked for.
    pictures: Vec<ViewImages>,
}

/// Solves a scene, in the step `tracing` that has begun with `geometry`, the hierarchy over its triangles. Checkpoints and previews go to the
/// folder, if there is one.
pub(super) fn solve(
    scene: &Scene,
    geometry: &Arc<Geometry>,
    options: &Options,
    engine: &mut Engine,
    folder: Option<&Folder>,
    steps: &mut Steps<'_>,
) -> Result<FoundTransfer> {
    let problem = trace(scene, geometry, (engine, options.rasterize), steps, &TransferProblem::of)?;
    steps.go_on()?;
    warnings::tell_of_fog(scene, &problem.pixels.maps.geometry);
    warnings::tell_of_air(scene, &problem.pixels.maps.geometry);
    if problem.table.role == TransferRole::Factor {
        warnings::tell_of_shadow(scene, &problem.pixels)?;
    }
    let memory = MemoryBudget::of_light_map(scene);
    let settings = memory.settled(scene.solve.clone(), &problem)?;
    let keeper = |folder| Keeper::new(folder, "checkpoint", &settings, &problem);
    let checkpoint = folder.map(keeper).transpose()?;
    let resumed = match &checkpoint {
        Some(checkpoint) if options.resume => Some(checkpoint.read()?),
        _ => None,
    };
    let task = ProblemSolve {
        problem: &problem,
        settings: &settings,
        memory: &memory,
        options,
        checkpoint: checkpoint.as_ref(),
        preview: &|texels| folder.map_or(Ok(()), |folder| preview(scene, &problem, folder, texels)),
    };
    let (computed, assessments) = task.run(engine, resumed, steps, &|operator, texels, steps| {
        steps.begin("assessing", None);
        let views = scene.views.len();
        let assessor = Assessor::of_transfer(&problem, operator)?;
        Ok([assessor.assess(&problem.table.texels, views)?, assessor.assess(texels, views)?])
    })?;
    warnings::tell_of_contested_function(&assessments[1].all);
    let pictures = match options.pictures {
        true => {
            steps.begin("rendering", Some(scene.views.len() as u64));
            draw((scene, ""), &problem.pixels, &assessments, steps, |view| {
                engine.draw(|canvas| rendering(scene, &problem, &computed.solved.x, view, canvas))
            })?
        }
        false => Vec::new(),
    };
    Ok(FoundTransfer { problem, settings, computed, assessments, pictures })
}

impl FoundTransfer {
    pub(super) fn report(&self, scene: &Scene, timings: &Timings) -> Result<Report> {
        let Self { problem, settings, computed, assessments, .. } = self;
        let [before, after] = assessments;
        let about = (scene.name.as_str(), scene.target, scene.pixels());
        let report = Report {
            weighted_residual: Change { before: before.all.residual, after: after.all.residual },
            matched: matched(scene, assessments, 0),
            hue: Some(hue_angles(&after.all)),
            ..Findings { problem, settings, computed }.report("light-map", about, timings)?
        };
        Ok(with_looks(report, scene))
    }

    /// What was found, first axis to the right and second downwards.
    pub(super) fn table(&self) -> Result<Image> {
        picture_of(&self.problem.table, &self.computed.solved.x)
    }

    /// The picture of a view under what was found.
    pub(super) fn picture(&self, scene: &Scene, view: usize) -> Result<Image> {
        match self.pictures.get(view) {
            Some(pictures) => Ok(pictures.after.clone()),
            None => {
                let found = &self.computed.solved.x;
                Ok(rendering(scene, &self.problem, found, view, &Canvas::Processor)?.after)
            }
        }
    }

    /// Writes everything but the report; gives back the pictures of the page.
    pub(super) fn write(&self, scene: &Scene, folder: &Folder) -> Result<report::Pictures> {
        let exposure = scene.exposure.unwrap_or_else(|| readable(self.pictures.iter().map(|it| &it.before)));
        let views = self.pictures.iter().map(|view| view.write(folder, exposure));
        let views = views.collect::<Result<_>>()?;
        let png = folder.write_picture(FOUND, &self.table()?, 0.0)?;
        write_air(&self.problem.pixels.maps, folder, "")?;
        folder.write_bytes("mood.json", mood(&self.problem.table)?.as_bytes())?;
        let [first, second] = self.problem.table.axes.map(axis_name);
        let found = FoundPicture {
            title: "The transfer function",
            about: format!("the colour of scattered light: {first} to the right, {second} downwards"),
            png,
        };
        Ok(report::Pictures { views, found: Some(found), ..report::Pictures::default() })
    }
}

/// A view before and after.
fn rendering(
    scene: &Scene,
    problem: &TransferProblem,
    texels: &[Rgb],
    view: usize,
    canvas: &Canvas,
) -> Result<Rendering> {
    let under = |function: TransferFunction| -> Result<Image> {
        let maps = problem.pixels.maps.tinted(function);
        Ok(Renderer::new(scene, &maps, None)?.picture(view, canvas)?.after)
    };
    Ok(Rendering {
        before: under(TransferFunction::one(problem.table.clone()))?,
        after: under(problem.function(texels.to_vec()))?,
    })
}

fn preview(scene: &Scene, problem: &TransferProblem, folder: &Folder, texels: &[Rgb]) -> Result<()> {
    folder.write_picture(FOUND, &picture_of(&problem.table, texels)?, 0.0)?;
    let drawn =
        (0..scene.views.len()).map(|view| rendering(scene, problem, texels, view, &Canvas::Processor));
    let drawn = drawn.collect::<Result<Vec<_>>>()?;
    let exposure = scene.exposure.unwrap_or_else(|| readable(drawn.iter().map(|it| &it.before)));
    for (seen, drawn) in scene.views.iter().zip(&drawn) {
        folder.write_picture(&format!("{}_after", seen.name), &drawn.after, exposure)?;
    }
    folder.publish_preview()
}

fn picture_of(table: &TransferTable, texels: &[Rgb]) -> Result<Image> {
    Image::new(table.size, texels.to_vec())?.finite("the transfer function")
}

/// A file of looks that names what was found.
fn mood(table: &TransferTable) -> Result<String> {
    let mood = json!({ "transfer": {
        "as": match table.role {
            TransferRole::Factor => "factor",
            TransferRole::Color => "color",
        },
        "axes": table.axes.map(axis_name),
        "far": table.far,
        "size": table.size,
        "strength": table.strength,
        "layers": [{ "image": { "file": format!("{FOUND}.exr") } }],
    } });
    serde_json::to_string_pretty(&mood)
        .map(|text| text + "\n")
        .map_err(|error| Error::Machine(format!("the mood cannot be written as JSON: {error}")))
}

fn axis_name(axis: TransferAxis) -> &'static str {
    match axis {
        TransferAxis::Visibility => "visibility",
        TransferAxis::Depth => "depth",
        TransferAxis::Position => "position",
        TransferAxis::Angle => "angle",
    }
}
