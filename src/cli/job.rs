use std::sync::Arc;

use super::args::SceneArguments;
use super::machine;
use crate::cpu::Tiling;
use crate::io::scene_file::{AnimatedVolume, Subject};
use crate::march::Surroundings;
use crate::problem::{LightMapProblem, constraints};
use crate::scene::{KeyFrame, MetricName, Scene, SolveSettings, VolumeScene};
use crate::visibility::Geometry;
use crate::{Error, Result, io};

const COLOR: usize = size_of::<[f32; 3]>();
/// Bytes a texel of a shadow map: 4 for its depth while it is rendered, 8 for its range, a third of 8 for the pyramid.
pub(super) const SHADOW_TEXEL: usize = 15;

/// Reads the scene of a command, with its overrides and those that its flags stand for.
///
/// Errors: those of [`io::scene_file::load`], and [`Error::TooLarge`] when its pictures and maps alone exceed the
/// memory that may be used: that is known from their sizes, before any of them is made.
pub(super) fn load(arguments: &SceneArguments, flags: &[String]) -> Result<Scene> {
    if io::scene_file::subject(&arguments.scene)? != Subject::LightMap {
        return Err(Error::value(
            arguments.scene.display().to_string(),
            "a scene with a `volume`",
            "a scene without; volumes are found by `unscatter volume`",
        ));
    }
    let scene = io::scene_file::load(&arguments.scene, &overrides(arguments, flags))?;
    tracing::info!(name = scene.name, views = scene.views.len(), "scene");
    check_memory(
        "the scene's pictures and maps",
        least_bytes(&scene),
        allowed(&scene.solve),
        remedy(&scene),
    )?;
    Ok(scene)
}

/// Reads the volume scene of a command, with its overrides and those that its flags stand for.
///
/// Errors: those of [`io::scene_file::load_volume`], and [`Error::TooLarge`] when its volumes and pictures alone exceed the
/// memory that may be used.
pub(super) fn load_volume(arguments: &SceneArguments, flags: &[String]) -> Result<VolumeScene> {
    let refused = match io::scene_file::subject(&arguments.scene)? {
        Subject::Volume => None,
        Subject::LightMap => Some((
            "a scene without `volume`",
            "a volume scene; light maps are found by `unscatter light-map`",
        )),
        Subject::Animation => {
            Some(("a scene with `animation`", "a scene without; animations are made by `unscatter animate`"))
        }
    };
    if let Some((given, expected)) = refused {
        return Err(Error::value(arguments.scene.display().to_string(), given, expected));
    }
    let scene = io::scene_file::load_volume(&arguments.scene, &overrides(arguments, flags))?;
    tracing::info!(name = scene.name, views = scene.views.len(), "scene");
    super::volume::check_scene(&scene)?;
    Ok(scene)
}

/// Reads the volume scene of a command that has an animation, as [`load_volume`] does others.
pub(super) fn load_animation(arguments: &SceneArguments, flags: &[String]) -> Result<AnimatedVolume> {
    if io::scene_file::subject(&arguments.scene)? != Subject::Animation {
        return Err(Error::value(
            arguments.scene.display().to_string(),
            "a scene without `animation`",
            "a volume scene with key frames; other volumes are found by `unscatter volume`",
        ));
    }
    let animated = io::scene_file::load_animation(&arguments.scene, &overrides(arguments, flags))?;
    let keys = &animated.animation.keys;
    tracing::info!(keys = keys.len(), frames = animated.animation.frames, "animation");
    super::volume::check_keys(keys)?;
    Ok(animated)
}

/// The volume scenes of a command: one, or those of the key frames, with what the names of their files begin with.
pub(super) fn load_volumes(arguments: &SceneArguments) -> Result<Vec<(String, VolumeScene)>> {
    if io::scene_file::subject(&arguments.scene)? != Subject::Animation {
        return Ok(vec![(String::new(), load_volume(arguments, &[])?)]);
    }
    let keys = load_animation(arguments, &[])?.animation.keys.into_iter();
    let named = |key: KeyFrame| {
        let name = format!("{}, frame {}", key.scene.name, key.frame);
        (super::volume::of_frame("frame", key.frame), VolumeScene { name, ..key.scene })
    };
    Ok(keys.map(named).collect())
}

/// The hierarchy over the triangles of a command's volume scenes, which those of key frames share.
pub(super) fn geometry_of<'a>(scenes: impl IntoIterator<Item = &'a VolumeScene>) -> Result<Arc<Geometry>> {
    let mesh = scenes.into_iter().next().map(|scene| scene.mesh.clone());
    Ok(Arc::new(Geometry::new(mesh.unwrap_or_default())?))
}

/// The overrides of a command, and those that its flags stand for.
fn overrides(arguments: &SceneArguments, flags: &[String]) -> Vec<String> {
    let mut overrides = arguments.overrides.clone();
    overrides.extend_from_slice(flags);
    overrides.extend(arguments.memory.iter().map(|size| format!("solve.memory=\"{size}\"")));
    overrides
}

/// Bytes that may be used.
pub(super) fn allowed(settings: &SolveSettings) -> u64 {
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

pub(super) fn check_memory(what: &str, needed: u64, allowed: u64, remedy: &'static str) -> Result<()> {
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
pub(super) fn budget(scene: &Scene, problem: &LightMapProblem) -> Result<u64> {
    let (allowed, needed) = (allowed(&scene.solve), fixed_bytes(scene, problem));
    check_memory("the solve without its matrix", needed, allowed, remedy(scene))?;
    Ok(allowed - needed)
}

/// Leaves the metric of tiles where it would take more than its share of the memory, for one that takes next to none.
pub(super) fn settle_metric(scene: &mut Scene, problem: &LightMapProblem) {
    let bytes = metric_bytes(scene, problem);
    if bytes > allowed(&scene.solve) / 4 {
        let needed = mebibytes(bytes);
        tracing::warn!(
            "solve.metric: the tiles would need {needed}, over a quarter of the memory; using `sqs`"
        );
        scene.solve.metric = MetricName::Sqs;
    }
}

/// Bytes that the metric takes at most.
fn metric_bytes(scene: &Scene, problem: &LightMapProblem) -> u64 {
    let elements = problem.elements();
    match scene.solve.metric_in_use() {
        MetricName::Tiles if problem.is_grey() => Tiling::bytes::<f32, 1>(elements),
        MetricName::Tiles => Tiling::bytes::<f32, 3>(elements),
        _ => 0,
    }
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
pub(super) fn surrounding_bytes(scene: &Scene, problem: &LightMapProblem) -> u64 {
    sky_bytes(scene) + weight_bytes(scene, problem.constraints.len())
}

/// Bytes that the weights of the surroundings take while they are made: row by row, one after the other, and as they are kept.
fn weight_bytes(scene: &Scene, rows: usize) -> u64 {
    scene.surroundings.as_ref().map_or(0, |around| 3 * Surroundings::bytes(rows, around.len()))
}

/// Errors: [`Error::TooLarge`] when the surroundings of the painted pixels exceed the memory; they are not made for it.
pub(super) fn check_surroundings(scene: &Scene) -> Result<()> {
    if scene.surroundings.is_none() {
        return Ok(());
    }
    let needed = sky_bytes(scene) + weight_bytes(scene, constraints(scene)?.0.len());
    check_memory("the light around the light map", needed, allowed(&scene.solve), remedy(scene))
}

/// Bytes that a solve takes beside the kept rows.
pub(super) fn fixed_bytes(scene: &Scene, problem: &LightMapProblem) -> u64 {
    let rows = problem.constraints.len();
    let texels = problem.elements();
    let shadow = problem.maps.shadow_map.grid().len();
    let pixels: usize = scene.views.iter().map(|view| view.camera.size().iter().product::<usize>()).sum();
    // Beside those of the method: start, scaling, coverage, right-hand side, weights, and what operators keep.
    let kept = crate::problem::vectors(scene.solve.solver);
    // A checkpoint has one vector after the other in f64.
    let vectors = (kept.domain + 8) * COLOR * texels
        + (kept.range + 6) * COLOR * (rows + texels)
        + 2 * COLOR * texels.max(rows);
    let rays = rows * size_of::<crate::march::ViewRay>();
    // Four pictures a view, and what is painted on it.
    let pictures = pixels * (4 * COLOR + size_of::<[f32; 4]>());
    (vectors + rays + pictures + shadow * SHADOW_TEXEL + (64 << 20)) as u64
        + metric_bytes(scene, problem)
        + surrounding_bytes(scene, problem)
}

pub(super) fn mebibytes(bytes: u64) -> String {
    format!("{:.0} MiB", bytes as f64 / f64::from(1 << 20))
}
