use super::args::SceneArguments;
use super::machine;
use crate::problem::LightMapProblem;
use crate::scene::Scene;
use crate::{Error, Result, io};

/// Reads the scene of a command, with its overrides and those that its flags stand for.
pub(super) fn load(arguments: &SceneArguments, flags: &[String]) -> Result<Scene> {
    let mut overrides = arguments.overrides.clone();
    overrides.extend_from_slice(flags);
    overrides.extend(arguments.memory.iter().map(|size| format!("solve.memory=\"{size}\"")));
    let scene = io::scene_file::load(&arguments.scene, &overrides)?;
    tracing::info!(name = scene.name, views = scene.views.len(), "scene");
    Ok(scene)
}

/// Bytes that the kept rows of the transport may take: what may be used, less what everything else needs.
///
/// Errors: [`Error::TooLarge`] when everything else does not fit.
pub(super) fn budget(scene: &Scene, problem: &LightMapProblem) -> Result<u64> {
    let allowed = scene.solve.memory.unwrap_or_else(machine::default_budget);
    let needed = fixed_bytes(scene, problem);
    if needed > allowed {
        return Err(Error::TooLarge {
            what: "the solve without its matrix".to_owned(),
            needed: mebibytes(needed),
            limit: mebibytes(allowed),
            remedy: "raise --memory, or lower light_map.size, shadow_map.size or the views' sizes",
        });
    }
    Ok(allowed - needed)
}

/// Bytes that a solve takes beside the kept rows.
pub(super) fn fixed_bytes(scene: &Scene, problem: &LightMapProblem) -> u64 {
    const COLOR: usize = size_of::<[f32; 3]>();
    let rows = problem.constraints.len();
    let texels = problem.maps.light_map.len();
    let shadow = problem.maps.shadow_map.grid().len();
    let pixels: usize = scene.views.iter().map(|view| view.camera.size().iter().product::<usize>()).sum();
    let vectors = 8 * COLOR * texels + 8 * COLOR * rows;
    let rays = rows * size_of::<crate::march::ViewRay>();
    // Four pictures a view, and what is painted on it.
    let pictures = pixels * (4 * COLOR + size_of::<[f32; 4]>());
    (vectors + rays + pictures + shadow * 12 + (64 << 20)) as u64
}

pub(super) fn mebibytes(bytes: u64) -> String {
    format!("{:.0} MiB", bytes as f64 / f64::from(1 << 20))
}
