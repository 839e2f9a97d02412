use std::sync::Arc;

use super::args::LightMapArguments;
use super::compute::{Computed, Task, Watch};
use super::engine::{Engine, On};
use super::environment::write_environment;
use super::findings::Findings;
use super::placement::Placement;
use super::progress::{Steps, watch_interrupt};
use super::results::{Folder, Painted, ViewPictures};
use super::{Done, Manners, job, resume};
use crate::operator::CpuVector;
#[cfg(feature = "gpu")]
use crate::problem::Rasterized;
use crate::problem::{Assessment, LightMapProblem, Traced, render};
use crate::report::{self, Report};
use crate::scene::{Environment, Image, Rgb, Scene, Sky};
use crate::solve::StopReason;
use crate::visibility::Geometry;
use crate::{Error, Result};

/// `unscatter light-map`: from painted strokes to a light map, pictures and a report.
pub(crate) fn run(arguments: &LightMapArguments, manners: &Manners) -> Result<Done> {
    let mut steps = Steps::new(manners.quiet);
    steps.begin("reading", None);
    let mut scene = job::load(&arguments.scene, &arguments.overrides())?;
    let mut engine = Engine::choose(&arguments.backend)?;
    let folder = Folder::create(arguments.output.output.clone(), &arguments.scene.scene)?;
    watch_interrupt()?;

    job::check_surroundings(&scene)?;
    steps.begin("tracing", None);
    let problem = trace(&scene, &engine, arguments.rasterize)?;
    job::settle_metric(&mut scene, &problem);
    let checkpoint = resume::Keeper::new(&folder, "checkpoint", resume::of_light_map(&scene, &problem));
    let resumed = if arguments.solve.resume { Some(checkpoint.read()?) } else { None };
    let task = Task {
        scene: &scene,
        problem: &problem,
        watch: Watch {
            checkpoint: &checkpoint,
            preview_every: arguments.solve.preview_every.map(|every| every as usize),
            iterations: scene.solve.iterations,
            adapter: None,
        },
    };
    let preview = |elements: &[Rgb]| preview(&scene, &problem, &folder, elements);
    let computed = engine.run(&checkpoint, arguments.solve.resume, resumed, |on, resumed| match on {
        On::Cpu => task.on_cpu(resumed, &mut steps, &preview),
        #[cfg(feature = "gpu")]
        On::Gpu(gpu) => task.on_gpu(&gpu, arguments.solve.deterministic, resumed, &mut steps, &preview),
    })?;
    let Computed { solved, before, after, coverage, .. } = &computed;

    let views = scene.views.len() as u64;
    steps.begin("rendering", Some(views));
    let pictures = draw(&scene, &problem, &solved.x, [before, after], &steps)?;
    steps.begin("writing", None);
    let [texels, further] = problem.parted(&solved.x);
    let light_map = light_map_picture(&problem, texels)?;
    let coverage_picture = coverage_picture(&problem, coverage)?;
    let in_page = report::Pictures {
        views: pictures.iter().map(|view| view.write(&folder, scene.exposure)).collect::<Result<_>>()?,
        light_map: folder.write_picture("light_map", &light_map, exposure_of(&problem))?,
        coverage: Some(folder.write_png("coverage", &coverage_picture, 0.0)?),
        environment: write_sky(&scene, &folder, further)?,
        ..report::Pictures::default()
    };
    let findings = Findings { scene: &scene, problem: &problem, computed: &computed };
    folder.write_bytes("light_map.placement.json", Placement::of(&problem.maps).to_json()?.as_bytes())?;
    let report = findings.report(steps.finish());
    folder.write_bytes("report.json", report.to_json()?.as_bytes())?;
    folder.write_bytes("report.html", report::html(&report, &in_page)?.as_bytes())?;
    folder.publish()?;
    manners.print(&report.to_json()?, &summary(&report, &folder));
    let was_interrupted = solved.outcome.stop.reason == StopReason::Interrupted;
    Ok(if was_interrupted { Done::Interrupted } else { Done::Completely })
}

/// The problem, with surfaces found by rays or by a depth pass.
///
/// Errors: [`Error::Adapter`] for a depth pass without an adapter.
fn trace(scene: &Scene, engine: &Engine, rasterize: bool) -> Result<LightMapProblem> {
    let geometry = Arc::new(Geometry::new(scene.mesh.clone())?);
    if !rasterize {
        return LightMapProblem::with(scene, &geometry, &Traced);
    }
    match engine {
        #[cfg(feature = "gpu")]
        Engine::Gpu { gpu, or_cpu } => {
            match LightMapProblem::with(scene, &geometry, &Rasterized(gpu.clone())) {
                Err(error) if *or_cpu && error.is_of_adapter() => {
                    tracing::warn!("{error}; tracing rays instead");
                    LightMapProblem::with(scene, &geometry, &Traced)
                }
                problem => problem,
            }
        }
        Engine::Cpu => Err(Error::Adapter {
            adapter: "none".to_owned(),
            problem: "cannot rasterize".to_owned(),
            remedy: "choose one by --backend gpu or --adapter, or leave --rasterize away",
        }),
    }
}

impl LightMapArguments {
    /// The flags that stand for values of the scene.
    fn overrides(&self) -> Vec<String> {
        let mut overrides = self.solve.overrides();
        overrides.extend(self.fill.then(|| "solve.fill=true".to_owned()));
        overrides
    }
}

/// The pictures of all views under what was found, given what the painted pixels show before and after.
fn draw(
    scene: &Scene,
    problem: &LightMapProblem,
    elements: &[Rgb],
    [before, after]: [&Assessment; 2],
    steps: &Steps,
) -> Result<Vec<ViewPictures>> {
    let draw_view = |view: usize| {
        let rendering = render(scene, &problem.maps, Some(elements), view)?;
        let width = scene.views[view].camera.size()[0];
        let rows = problem.constraints.iter().enumerate();
        let rows = rows.filter(|(_, pixel)| pixel.view == view && pixel.weight > 0.0);
        let painted = rows.map(|(row, pixel)| Painted {
            pixel: pixel.y * width + pixel.x,
            weight: pixel.weight,
            before: before.shown[row],
            wanted: problem.wanted(row),
            after: after.shown[row],
        });
        let pictures = ViewPictures::new(&scene.views[view].name, painted, rendering);
        steps.advance(view as u64 + 1, String::new());
        Ok(pictures)
    };
    (0..scene.views.len()).map(draw_view).collect()
}

/// Writes the lights of the sky, where they were looked for; gives back the PNG file.
fn write_sky(scene: &Scene, folder: &Folder, further: &[Rgb]) -> Result<Option<Vec<u8>>> {
    let Some(around) = &scene.surroundings else { return Ok(None) };
    let write = |sky: &Sky| {
        // A solver without bounds may leave less than darkness, which nothing emits.
        let lights = around.sky_of(further).iter().map(|color| color.map(|value| value.max(0.0)));
        let found = Environment::lights(sky.basis.clone(), lights.collect())?;
        write_environment(folder, "environment", &sky.basis, &found, around.sun_of(further), scene.exposure)
    };
    around.sky.as_ref().map(write).transpose()
}

fn preview(scene: &Scene, problem: &LightMapProblem, folder: &Folder, elements: &[Rgb]) -> Result<()> {
    let [texels, _] = problem.parted(elements);
    folder.write_picture("light_map", &light_map_picture(problem, texels)?, exposure_of(problem))?;
    for (view, seen) in scene.views.iter().enumerate() {
        let after = render(scene, &problem.maps, Some(elements), view)?.after;
        folder.write_picture(&format!("{}_after", seen.name), &after, scene.exposure)?;
    }
    folder.publish()
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

fn summary(report: &Report, folder: &Folder) -> String {
    let hue = |change: Option<&report::Change>| {
        change.map_or(String::new(), |hue| format!(", hue off by {:.1}° → {:.1}°", hue.before, hue.after))
    };
    let mut lines = vec![format!(
        "{} painted pixels in {} views, {} of {} {} reached, {} non-zeros",
        report.problem.rows,
        report.problem.views,
        report.problem.active_unknowns,
        report.problem.unknowns,
        if report.surroundings.is_some() { "unknowns" } else { "texels" },
        report.problem.nonzeros
    )];
    if let Some(around) = &report.surroundings {
        lines.push(format!("  around the light map: {}", around.in_words()));
    }
    for view in &report.matched {
        lines.push(format!(
            "  {:<16} residual {:.3} → {:.3}{}",
            view.view,
            view.weighted_residual.before,
            view.weighted_residual.after,
            hue(view.uncontested_hue_error.as_ref())
        ));
    }
    lines.push(format!(
        "residual {:.3} → {:.3}, gradient at {:.1e} of its start after {} iterations ({}), {:.2} s in all",
        report.weighted_residual.before,
        report.weighted_residual.after,
        report.certificate.value.iter().copied().fold(0.0, f64::max),
        report.stop.iteration,
        report.stop.reason,
        report.timings.get("total").copied().unwrap_or_default()
    ));
    lines.push(format!("results in {}", folder.path().join("report.html").display()));
    lines.join("\n")
}
