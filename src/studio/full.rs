//! What the command finds of a scene, and how pages hear of it while it is written.

use std::path::PathBuf;
use std::sync::Arc;

use super::setting::Setting;
use crate::job::{Job, Observer, Options, Quiet, Scenes, Step, Stop};
use crate::report::Report;
use crate::scene::{Image, Rgb};
use crate::{Error, Result};

/// What the command finds: its pictures, and what there is to know about them.
pub(super) struct Full {
    pub(super) views: Vec<Image>,
    /// Relative to the light; none of a volume.
    pub(super) light_map: Option<Image>,
    pub(super) iterations: usize,
    pub(super) gradient: f64,
    pub(super) met: Option<f64>,
    /// What stands in the way of the paint.
    pub(super) remarks: Vec<String>,
    pub(super) details: Vec<[String; 2]>,
}

impl Full {
    /// Solves a job as the command does.
    ///
    /// Errors: [`Error::Interrupted`], and those of a solve.
    pub(super) fn of(job: Job, setting: &Setting, stop: Stop) -> Result<Self> {
        let (names, light): (Vec<String>, Option<Rgb>) = match job.scenes() {
            Scenes::LightMap(scene) => {
                (scene.views.iter().map(|view| view.name.clone()).collect(), Some(scene.light.radiance))
            }
            Scenes::Volume(scene) => (scene.views.iter().map(|view| view.view.name.clone()).collect(), None),
            Scenes::Animation(_) | Scenes::LightAnimation(_) => {
                return Err(Error::Machine("the scene moves now".to_owned()));
            }
        };
        let (engine, asked) = (setting.engine.clone(), stop.clone());
        let found =
            job.with(Options { engine, stop, turntable: 0, ..Options::default() }).solve(&mut Quiet)?;
        if asked.is_asked() {
            return Err(Error::Interrupted);
        }
        let report = found.report();
        let last = report.history.last();
        Ok(Self {
            views: names.iter().map(|name| found.picture(name)).collect::<Result<_>>()?,
            light_map: light.map(|light| Ok::<_, Error>(relative(&found.light_map()?, light))).transpose()?,
            iterations: last.map_or(0, |last| last.iteration),
            gradient: last.map_or(0.0, |last| last.normal_residual.into_iter().fold(0.0, f64::max)),
            met: report.weighted_residual.met(),
            remarks: report.warnings.iter().map(ToString::to_string).collect(),
            details: details(report),
        })
    }
}

/// A light map relative to the brightest channel of its light.
pub(super) fn relative(map: &Image, light: Rgb) -> Image {
    let most = light.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
    let mut map = map.clone();
    map.pixels.iter_mut().for_each(|texel| *texel = texel.map(|value| value / most));
    map
}

/// The numbers of a report that somebody who paints may ask for.
fn details(report: &Report) -> Vec<[String; 2]> {
    let most = |channels: [f64; 3]| channels.into_iter().fold(0.0, f64::max);
    let (change, certificate, problem) = (&report.weighted_residual, &report.certificate, &report.problem);
    let mut details = vec![
        ("Residual".to_owned(), format!("{:.3} → {:.3}", change.before, change.after)),
        (
            "Certificate".to_owned(),
            format!("{} {:.1e} of its start", certificate.kind, most(certificate.value)),
        ),
        (
            "Stopped".to_owned(),
            format!("{} after {} iterations of {}", report.stop.reason, report.stop.iteration, report.solver),
        ),
        ("Painted pixels".to_owned(), problem.rows.to_string()),
        (
            "Unknowns".to_owned(),
            format!("{} of {} {}", problem.active_unknowns, problem.unknowns, problem.elements),
        ),
        ("Adjoint error".to_owned(), format!("{:.1e}", report.adjoint_error)),
    ];
    let skipped = report.skipped.iter().filter(|(_, share)| share.count > 0);
    details.extend(skipped.map(|(what, share)| {
        (format!("Skipped: {}", what.replace('_', " ")), format!("{} of {}", share.count, share.of))
    }));
    details.extend(report.timings.get("total").map(|total| ("Seconds".to_owned(), format!("{total:.2}"))));
    details.into_iter().map(|(label, value)| [label, value]).collect()
}

/// Writes what the command writes; `hears` is told how far it is.
///
/// Errors: those of a solve and of its files.
pub(super) fn export(
    job: Job,
    setting: &Setting,
    stop: Stop,
    hears: impl Fn(&str, Option<f64>) + Send + Sync + 'static,
) -> Result<PathBuf> {
    let options = Options {
        engine: setting.engine.clone(),
        stop,
        folder: Some(setting.folder.clone()),
        ..Options::default()
    };
    let mut hears = Hears { hears: Arc::new(hears), step: String::new(), parts: None };
    let found = job.with(options).solve(&mut hears)?;
    Ok(found.write_observed(setting.folder.clone(), &mut hears)?.folder)
}

/// Tells how an export goes.
struct Hears<F> {
    hears: Arc<F>,
    step: String,
    parts: Option<u64>,
}

impl<F: Fn(&str, Option<f64>) + Send + Sync> Observer for Hears<F> {
    fn begins(&mut self, step: &Step<'_>) {
        (self.step, self.parts) = (step.name.to_owned(), step.parts);
        (self.hears)(&self.step, None);
    }

    fn advances(&mut self, done: u64, _remark: &str) {
        let part = self.parts.filter(|&parts| parts > 0).map(|parts| done as f64 / parts as f64);
        (self.hears)(&self.step, part);
    }
}
