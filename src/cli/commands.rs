//! The commands that are one job.

use std::path::{Path, PathBuf};
use std::time::Duration;

#[cfg(feature = "studio")]
use super::args::PaintArguments;
use super::args::{
    AnimateArguments, BackendArguments, LightMapArguments, MatrixArguments, OnlyLight, OutputArguments,
    RenderArguments, SceneArguments, SolveArguments, VolumeArguments,
};
use super::bar::Bar;
#[cfg(feature = "studio")]
use super::out::remark;
use super::{Done, FAULT, Manners, watch_interrupt, words};
use crate::io::scene_file::{SceneFile, Subject};
use crate::io::to_json;
#[cfg(feature = "studio")]
use crate::job::Stop;
use crate::job::{EngineChoice, Job, Options, Scenes, Written};
use crate::problem::{Drawing, DrawnLight};
use crate::{Error, Result};

impl SceneArguments {
    /// Reads the scene, with its overrides and those that flags stand for.
    pub(super) fn open(&self, flags: &[String]) -> Result<Job> {
        self.job(&SceneFile::read(&self.scene)?, flags)
    }

    fn job(&self, file: &SceneFile, flags: &[String]) -> Result<Job> {
        Job::of_file(file, &self.overrides(flags))
    }

    /// Its overrides and those that flags stand for.
    fn overrides(&self, flags: &[String]) -> Vec<String> {
        let memory = self.memory.iter().map(|size| format!("solve.memory=\"{size}\""));
        self.overrides.iter().chain(flags).cloned().chain(memory).collect()
    }

    /// As [`Self::open`], for a command that finds the light or the medium of one kind of scene only.
    fn open_as(&self, wanted: Subject, flags: &[String]) -> Result<Job> {
        self.job(&self.read_as(&[wanted])?, flags)
    }

    /// Reads the scene file of a command that takes some kinds of scenes only. The kind comes first: on another kind, its flags would be
    /// complained about as settings that the scene does not have. What is wrong in the file itself is told before either.
    fn read_as(&self, wanted: &[Subject]) -> Result<SceneFile> {
        let file = SceneFile::read(&self.scene)?;
        let is = file.subject();
        if wanted.contains(&is) {
            return Ok(file);
        }
        Job::of_file(&file, &[])?;
        let (given, expected) = match is {
            Subject::LightMap if wanted.contains(&Subject::LightAnimation) => (
                "a file without `animation`",
                "one with it; what stays as it is is drawn by `unscatter render`, and light maps are found by `unscatter light-map`",
            ),
            Subject::LightMap => {
                ("a scene without `volume`", "one with; light maps are found by `unscatter light-map`")
            }
            Subject::Volume => (
                "a scene with `volume`, without `animation`",
                "another; volumes are found by `unscatter volume`",
            ),
            Subject::Animation | Subject::LightAnimation => {
                ("a scene with `animation`", "one without; animations are made by `unscatter animate`")
            }
        };
        Err(Error::value(self.scene.display().to_string(), given, expected))
    }
}

impl OutputArguments {
    /// Where results go: where it says, else `out/` and the scene's file name.
    pub(super) fn folder(&self, scene: &Path) -> PathBuf {
        // A name of dots alone leads to another folder.
        let own = scene.file_stem().filter(|stem| stem.as_encoded_bytes().iter().any(|&byte| byte != b'.'));
        let by_name = || Path::new("out").join(own.unwrap_or("scene".as_ref()));
        self.output.clone().unwrap_or_else(by_name)
    }
}

impl BackendArguments {
    pub(super) fn choice(&self) -> EngineChoice {
        EngineChoice {
            backend: self.backend.into(),
            adapter: self.adapter.clone(),
            fault: std::env::var(FAULT).ok(),
        }
    }
}

fn options(backend: &BackendArguments, solve: &SolveArguments, folder: &Path) -> Options {
    Options {
        engine: backend.choice(),
        deterministic: solve.deterministic,
        folder: Some(folder.to_owned()),
        resume: solve.resume,
        checkpoint_every: Duration::from_secs_f64(solve.checkpoint_every),
        pictures: !solve.no_pictures,
        exr: solve.pictures.exr.into(),
        ..Options::default()
    }
}

/// Solves, writes, and prints.
fn solved(
    job: Job,
    options: Options,
    solve: &SolveArguments,
    manners: &Manners,
    mut bar: Bar,
) -> Result<Done> {
    watch_interrupt(&options.stop, options.folder.clone())?;
    let folder = options.folder.clone().unwrap_or_default();
    bar = bar.with_previews(solve.preview_every);
    let found = job.with(options).solve(&mut bar)?;
    let Written { report, is_interrupted, folder } = found.write_observed(folder, &mut bar)?;
    bar.finish();
    manners.print(&report.to_json()?, &words::of_report(&report, &folder, manners.numbers))?;
    Ok(if is_interrupted { Done::Interrupted } else { Done::Completely })
}

/// `unscatter paint`: the studio, until Ctrl-C.
#[cfg(feature = "studio")]
pub(super) fn paint(arguments: &PaintArguments, manners: &Manners) -> Result<Done> {
    use crate::studio::Studio;
    let scene = &arguments.scene;
    let stop = Stop::default();
    watch_interrupt(&stop, None)?;
    let studio = Studio {
        scene: scene.scene.clone(),
        overrides: scene.overrides(&[]),
        engine: arguments.backend.choice(),
        folder: arguments.output.folder(&scene.scene),
        port: arguments.port,
    };
    if !manners.quiet {
        remark("reading the scene and keeping the rows of its previews…\n");
    }
    studio.serve(&stop, |address| {
        let words = format!("the studio is open at {address}\nCtrl-C closes it");
        // Whoever cannot read it does not need it.
        _ = manners.print(&serde_json::json!({ "address": address }).to_string(), &words);
        if !arguments.no_open && open::that_detached(address).is_err() {
            remark("no browser could be opened; open the address in one\n");
        }
    })?;
    Ok(Done::Completely)
}

/// `unscatter light-map`: from painted strokes to a light map, pictures and a report.
pub(super) fn light_map(arguments: &LightMapArguments, manners: &Manners) -> Result<Done> {
    let bar = Bar::new(manners.quiet);
    let mut flags = arguments.solve.overrides();
    flags.extend(arguments.fill.then(|| "solve.fill=true".to_owned()));
    flags.extend(arguments.find.iter().map(|find| format!("find={find}")));
    let job = arguments.scene.open_as(Subject::LightMap, &flags)?;
    let folder = arguments.output.folder(&arguments.scene.scene);
    let options =
        Options { rasterize: arguments.rasterize, ..options(&arguments.backend, &arguments.solve, &folder) };
    solved(job, options, &arguments.solve, manners, bar)
}

/// `unscatter volume`: finds what the scene asks for, stage by stage, and writes volumes, pictures and a report.
pub(super) fn volume(arguments: &VolumeArguments, manners: &Manners) -> Result<Done> {
    let bar = Bar::new(manners.quiet);
    let job = arguments.scene.open_as(Subject::Volume, &arguments.overrides())?;
    let folder = arguments.output.folder(&arguments.scene.scene);
    let options = Options {
        formats: arguments.formats()?,
        turntable: arguments.turntable as usize,
        ..options(&arguments.backend, &arguments.solve, &folder)
    };
    solved(job, options, &arguments.solve, manners, bar)
}

/// `unscatter animate`: solves the key frames, spreads what they found, blends, and draws every frame.
pub(super) fn animate(arguments: &AnimateArguments, manners: &Manners) -> Result<Done> {
    let bar = Bar::new(manners.quiet);
    let file = arguments.scene.read_as(&[Subject::Animation, Subject::LightAnimation])?;
    if let (Subject::LightAnimation, Some(flag)) = (file.subject(), arguments.flag_of_volumes()) {
        return Err(Error::value(flag, "a scene without `volume`", "left away: it is about volumes"));
    }
    let job = arguments.scene.job(&file, &arguments.overrides())?;
    let folder = arguments.output.folder(&arguments.scene.scene);
    let options = Options {
        formats: arguments.formats()?,
        frames: arguments.frames.clone(),
        frame_volumes: arguments.volumes,
        ..options(&arguments.backend, &arguments.solve, &folder)
    };
    solved(job, options, &arguments.solve, manners, bar)
}

/// `unscatter render`: the views as they are, or under a light map from a file.
pub(super) fn render(arguments: &RenderArguments, manners: &Manners) -> Result<Done> {
    let mut bar = Bar::new(manners.quiet);
    let job = arguments.scene.open(&[])?;
    if !job.scenes().have_light_maps() && arguments.light_map.is_some() {
        let expected =
            "left away: volumes have none; put one in by --set volume.emission.file=FILE or the like";
        return Err(Error::value("--light-map", "a light map", expected));
    }
    let folder = arguments.output.folder(&arguments.scene.scene);
    if !job.scenes().have_light_maps() && arguments.only.is_some() {
        return Err(Error::value("--only", "scattering", "left away: pictures of volumes show all light"));
    }
    if !matches!(job.scenes(), Scenes::LightMap(_)) && !arguments.without.is_empty() {
        return Err(Error::value("--without", "looks", "left away: volumes have none"));
    }
    let drawing = Drawing { method: arguments.method, reduced: arguments.reduced as usize };
    if !job.scenes().have_light_maps() && drawing != Drawing::default() {
        return Err(Error::value("--method", drawing.method, "left away: volumes are drawn exactly"));
    }
    let without = arguments.without.iter().flat_map(|look| look.kinds()).copied().collect();
    let light = match arguments.only {
        Some(OnlyLight::Scattering) => DrawnLight::Scattered,
        None => DrawnLight::All,
    };
    let exr = arguments.pictures.exr.into();
    let engine = arguments.backend.choice();
    let options = Options {
        engine,
        turntable: arguments.turntable as usize,
        light,
        drawing,
        exr,
        without,
        ..Options::default()
    };
    watch_interrupt(&options.stop, Some(folder.clone()))?;
    let drawn = job.with(options).draw(arguments.light_map.as_deref(), folder, &mut bar)?;
    let Some(drawn) = drawn else { return Ok(Done::Interrupted) };
    bar.finish();
    let names: Vec<String> = drawn.iter().map(|path| path.display().to_string()).collect();
    manners.print(&to_json(&names)?, &names.join("\n"))?;
    Ok(Done::Completely)
}

/// `unscatter plan`: what a solve would take.
pub(super) fn plan(arguments: &SceneArguments, manners: &Manners) -> Result<Done> {
    let mut bar = Bar::new(manners.quiet);
    let job = arguments.open(&[])?;
    let plans = job.plan(&mut bar)?;
    bar.finish();
    let json = match (&plans[..], job.scenes()) {
        ([plan], Scenes::LightMap(_)) => to_json(plan)?,
        _ => to_json(&plans)?,
    };
    let lines: Vec<String> = plans.iter().map(words::of_plan).collect();
    manners.print(&json, &lines.join("\n"))?;
    Ok(Done::Completely)
}

/// `unscatter matrix`: T.npz, b.npy, x0.npy and rows.npy, as SciPy and NumPy load them.
pub(super) fn matrix(arguments: &MatrixArguments, manners: &Manners) -> Result<Done> {
    let mut bar = Bar::new(manners.quiet);
    let exported = arguments.scene.open(&[])?.matrix(&mut bar)?;
    let folder = arguments.output.folder(&arguments.scene.scene);
    exported.write(&folder)?;
    bar.finish();
    let matrix = exported.matrix.channel(0);
    let ((rows, columns), nonzeros) = (matrix.shape(), matrix.nnz());
    let json = serde_json::json!({ "rows": rows, "columns": columns, "nonzeros": nonzeros });
    let told = format!("T: {rows} × {columns}, {nonzeros} non-zeros, in {}", folder.display());
    manners.print(&to_json(&json)?, &told)?;
    Ok(Done::Completely)
}
