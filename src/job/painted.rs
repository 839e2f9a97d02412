//! What is the same whatever is looked for behind painted strokes.

use std::sync::Arc;

use super::engine::Engine;
use super::folder::{Painted, ViewImages};
use super::memory::painted;
use super::steps::Steps;
#[cfg(feature = "gpu")]
use crate::Warning;
use crate::problem::{Assessment, Constraint, LightMapProblem, Match, Rendering, Surfaces, Traced};
use crate::report::{Change, HueAngles, Report, ViewMatch};
use crate::scene::Scene;
use crate::visibility::Geometry;
use crate::{Error, Result};

/// Makes a problem of painted pixels.
pub(super) type Make<'a, P> =
    dyn Fn(&Scene, &Arc<Geometry>, Vec<Constraint>, &dyn Surfaces) -> Result<P> + 'a;

/// The problem, with surfaces found by rays or by a depth pass.
///
/// Errors: [`Error::Adapter`] for a depth pass without an adapter; [`Error::Interrupted`].
pub(super) fn trace<P>(
    scene: &Scene,
    geometry: &Arc<Geometry>,
    (engine, rasterize): (&Engine, bool),
    steps: &Steps<'_>,
    make: &Make<'_, P>,
) -> Result<P> {
    let painted = painted(scene)?;
    steps.go_on()?;
    if !rasterize {
        return make(scene, geometry, painted, &Traced);
    }
    match engine {
        #[cfg(feature = "gpu")]
        Engine::Gpu { gpu, or_cpu } => {
            let rasterized = crate::problem::Rasterized(gpu.clone());
            match make(scene, geometry, painted.clone(), &rasterized) {
                Err(error) if *or_cpu && error.is_of_adapter() => {
                    Warning::new("adapter", format!("{error}; tracing rays instead"), "").tell();
                    make(scene, geometry, painted, &Traced)
                }
                problem => problem,
            }
        }
        Engine::Cpu => Err(Error::Adapter {
            adapter: "none".to_owned(),
            problem: "cannot rasterize".to_owned(),
            remedy: "choose an adapter, or leave rasterize away",
        }),
    }
}

/// How near the pictures of painted views have come; the number of the scene's first view among those that were assessed is `first`.
pub(super) fn matched(scene: &Scene, [before, after]: &[Assessment; 2], first: usize) -> Vec<ViewMatch> {
    let views = scene.views.iter().zip(&before.views[first..]).zip(&after.views[first..]);
    let matched = views.filter(|((_, before), _)| before.pixels > 0).map(|((view, before), after)| {
        let change = |of: fn(&Match) -> f64| Change { before: of(before), after: of(after) };
        ViewMatch {
            view: view.name.clone(),
            painted_pixels: before.pixels as u64,
            hue: Some(hue_angles(after)),
            weighted_residual: change(|it| it.residual),
            hue_error: Some(change(|it| it.hue_error)),
            uncontested_hue_error: Some(change(|it| it.uncontested_hue_error)),
            uncontested_pixels: Some((before.pixels - before.contested) as u64),
        }
    });
    matched.collect()
}

/// What the scene says of looks, among the settings of a report.
pub(super) fn with_looks(mut report: Report, scene: &Scene) -> Report {
    report.settings.extend(scene.looks.in_words().map(|words| ("looks".to_owned(), words)));
    report
}

pub(super) fn hue_angles(matched: &Match) -> HueAngles {
    let [median, nine_tenths] = matched.hue_quantiles;
    HueAngles { median, nine_tenths }
}

/// The pictures of all views, given what the painted pixels show before and after. `prefix` is what the names of their files begin with.
pub(super) fn draw(
    (scene, prefix): (&Scene, &str),
    pixels: &LightMapProblem,
    [before, after]: &[Assessment; 2],
    steps: &mut Steps<'_>,
    mut picture: impl FnMut(usize) -> Result<Rendering>,
) -> Result<Vec<ViewImages>> {
    let draw_view = |view: usize| {
        let rendering = picture(view)?;
        let width = scene.views[view].camera.size()[0];
        let rows = pixels.constraints.iter().enumerate();
        let rows = rows.filter(|(_, pixel)| pixel.view == view && pixel.weight > 0.0);
        let painted = rows.map(|(row, pixel)| Painted {
            pixel: pixel.y * width + pixel.x,
            weight: pixel.weight,
            before: before.shown[row],
            wanted: pixels.wanted(row),
            after: after.shown[row],
        });
        let pictures = ViewImages::new(&format!("{prefix}{}", scene.views[view].name), painted, rendering);
        steps.advance(view as u64 + 1, "");
        Ok(pictures)
    };
    (0..scene.views.len()).map(draw_view).collect()
}
