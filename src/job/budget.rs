//! What a light-map solve takes, and what it may take.

use super::machine;
use crate::march::Surroundings;
use crate::operator::Tiling;
use crate::problem::{Constraint, LightMapProblem, constraints};
use crate::scene::{MetricName, Scene, SolveSettings};
use crate::{Error, Result};

const COLOR: usize = size_of::<[f32; 3]>();
/// Bytes a texel of a shadow map: 4 for its depth while it is rendered, 8 for its range, a third of 8 for the pyramid.
pub(crate) const SHADOW_TEXEL: usize = 15;

/// Bytes that may be used.
pub(crate) fn allowed(settings: &SolveSettings) -> u64 {
    settings.memory.unwrap_or_else(machine::default_budget)
}

/// What a person can do when a scene needs more memory than there may be.
fn remedy(scene: &Scene) -> &'static str {
    match scene.surroundings.as_ref().and_then(|it| it.sky.as_ref()) {
        None => "raise --memory, or lower light_map.size, shadow_map.size or the views' sizes",
        Some(_) => {
            "raise --memory, or lower lights or shadow_map of surroundings.environment, light_map.size, shadow_map.size or the views' sizes"
        }
    }
}

pub(crate) fn check_memory(what: &str, needed: u64, allowed: u64, remedy: &'static str) -> Result<()> {
    if needed <= allowed {
        return Ok(());
    }
    Err(Error::TooLarge {
        what: what.to_owned(),
        needed: mebibytes(needed),
        limit: mebibytes(allowed),
        remedy,
    })
}

/// Bytes that the kept rows of the transport may take: what may be used, less what everything else needs.
///
/// Errors: [`Error::TooLarge`] when everything else does not fit.
pub(crate) fn budget(scene: &Scene, settings: &SolveSettings, problem: &LightMapProblem) -> Result<u64> {
    let (allowed, needed) = (allowed(settings), fixed_bytes(scene, settings, problem));
    check_memory("the solve without its matrix", needed, allowed, remedy(scene))?;
    Ok(allowed - needed)
}

/// The settings of a scene; without the metric of tiles where it would take more than its share of the memory, with one that takes next to
/// none.
pub(crate) fn settled(scene: &Scene, problem: &LightMapProblem) -> SolveSettings {
    let mut settings = scene.solve.clone();
    let bytes = metric_bytes(&settings, problem);
    if bytes > allowed(&settings) / 4 {
        let needed = mebibytes(bytes);
        tracing::warn!(
            "solve.metric: the tiles would need {needed}, over a quarter of the memory; using `sqs`"
        );
        settings.metric = MetricName::Sqs;
    }
    settings
}

/// Bytes that the metric takes at most.
fn metric_bytes(settings: &SolveSettings, problem: &LightMapProblem) -> u64 {
    let elements = problem.elements();
    match settings.metric_in_use() {
        MetricName::Tiles if problem.is_grey() => Tiling::bytes::<f32, 1>(elements),
        MetricName::Tiles => Tiling::bytes::<f32, 3>(elements),
        _ => 0,
    }
}

/// Errors: [`Error::TooLarge`] when the scene's pictures and maps alone exceed the memory that may be used: that is known from their
/// sizes, before any of them is made.
pub(crate) fn check_scene(scene: &Scene) -> Result<()> {
    check_memory("the scene's pictures and maps", least_bytes(scene), allowed(&scene.solve), remedy(scene))
}

/// Bytes that every command takes at least: what is painted on the views, the shadow maps and a light map.
fn least_bytes(scene: &Scene) -> u64 {
    let texels = |size: [usize; 2]| size.iter().product::<usize>();
    let painted: usize = scene.views.iter().map(|view| texels(view.camera.size())).sum();
    let bytes = painted * size_of::<[f32; 4]>()
        + texels(scene.shadow_map.size) * SHADOW_TEXEL
        + texels(scene.light_map.size) * COLOR;
    sky_bytes(scene).saturating_add(bytes as u64)
}

/// Bytes that the shadow maps of the sky take.
fn sky_bytes(scene: &Scene) -> u64 {
    scene.surroundings.as_ref().and_then(|it| it.sky.as_ref()).map_or(0, |sky| sky.shadow_bytes())
}

/// Bytes that the surroundings take: shadow maps, and weights of every row.
pub(crate) fn surrounding_bytes(scene: &Scene, problem: &LightMapProblem) -> u64 {
    sky_bytes(scene) + weight_bytes(scene, problem.constraints.len())
}

/// Bytes that the weights of the surroundings take while they are made: row by row, one after the other, and as they are kept.
fn weight_bytes(scene: &Scene, rows: usize) -> u64 {
    scene.surroundings.as_ref().map_or(0, |around| 3 * Surroundings::bytes(rows, around.len()))
}

/// The painted pixels of a scene.
///
/// Errors: [`Error::TooLarge`] when their surroundings exceed the memory, before those are made; [`Error::Empty`] when there are none.
pub(crate) fn painted(scene: &Scene) -> Result<Vec<Constraint>> {
    let painted = constraints(scene)?;
    if scene.surroundings.is_some() {
        let needed = sky_bytes(scene) + weight_bytes(scene, painted.len());
        check_memory("the light around the light map", needed, allowed(&scene.solve), remedy(scene))?;
    }
    Ok(painted)
}

/// Bytes that a solve takes beside the kept rows.
pub(crate) fn fixed_bytes(scene: &Scene, settings: &SolveSettings, problem: &LightMapProblem) -> u64 {
    let rows = problem.constraints.len();
    let texels = problem.elements();
    let shadow = problem.maps.shadow_map.grid().len();
    let pixels: usize = scene.views.iter().map(|view| view.camera.size().iter().product::<usize>()).sum();
    // Beside those of the method: start, scaling, coverage, right-hand side, weights, and what operators keep.
    let kept = crate::problem::vectors(settings.solver);
    // A checkpoint has one vector after the other in f64.
    let vectors = (kept.domain + 8) * COLOR * texels
        + (kept.range + 6) * COLOR * (rows + texels)
        + 2 * COLOR * texels.max(rows);
    let rays = rows * size_of::<crate::march::ViewRay>();
    // Four pictures a view, and what is painted on it.
    let pictures = pixels * (4 * COLOR + size_of::<[f32; 4]>());
    (vectors + rays + pictures + shadow * SHADOW_TEXEL + (64 << 20)) as u64
        + metric_bytes(settings, problem)
        + surrounding_bytes(scene, problem)
}

pub(crate) fn mebibytes(bytes: u64) -> String {
    format!("{:.0} MiB", bytes as f64 / f64::from(1 << 20))
}
