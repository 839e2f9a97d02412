//! What a volume takes.

use super::super::budget::{allowed, check_memory, mebibytes};
use crate::Result;
use crate::operator::Tiling;
use crate::problem::{Optics, VolumeProblem, light_bytes};
use crate::scene::{Find, KeyFrame, MetricName, SolveSettings, VolumeScene, Weight};

const COLOR: usize = size_of::<[f32; 3]>();

/// Bytes that are in use once a scene is read: its volumes and its pictures.
fn scene_bytes(scene: &VolumeScene) -> u64 {
    let medium = &scene.medium;
    let volumes = [&medium.extinction, &medium.albedo, &medium.emission];
    let voxels: usize = volumes.iter().map(|volume| volume.samples().bytes()).sum();
    let pixels: usize =
        scene.views.iter().map(|view| view.view.camera.size().iter().product::<usize>()).sum();
    // What is wanted of each pixel, and its picture before, after and while it is drawn.
    (voxels + pixels * (size_of::<[f32; 4]>() + 3 * COLOR)) as u64
}

/// Errors: [`crate::Error::TooLarge`] when the scene alone exceeds what may be used.
pub(crate) fn check_scene(scene: &VolumeScene) -> Result<()> {
    check_memory("the scene's volumes and pictures", scene_bytes(scene), allowed(&scene.solve), REMEDY)
}

/// Errors: as [`check_scene`], of all key frames together.
pub(crate) fn check_keys(keys: &[KeyFrame]) -> Result<()> {
    let Some(first) = keys.first() else { return Ok(()) };
    let needed = keys.iter().map(|key| scene_bytes(&key.scene)).sum();
    check_memory("the volumes and pictures of all key frames", needed, allowed(&first.scene.solve), REMEDY)
}

/// Bytes that diffusion takes a voxel: vectors in f64 over voxels and three edges each, and who lies beside whom.
const SPREAD: usize = 640;

/// Errors: [`crate::Error::TooLarge`] when diffusion into so many voxels of the extinction would exceed what may be used.
pub(crate) fn check_spread(scene: &VolumeScene, voxels: usize) -> Result<()> {
    let [extinction, albedo, emission] =
        [&scene.medium.extinction, &scene.medium.albedo, &scene.medium.emission].map(|of| of.grid().len());
    let needed = SPREAD * voxels * albedo.max(emission).div_ceil(extinction);
    check_memory("diffusion between the keys", needed as u64, allowed(&scene.solve), REMEDY)
}

/// Bytes that the kept rows of a stage may take.
pub(crate) fn budget(scene: &VolumeScene, settings: &SolveSettings, problem: &VolumeProblem) -> Result<u64> {
    let (allowed, needed) = (allowed(settings), stage_bytes(scene, settings, problem));
    check_memory("the solve without its matrix", needed, allowed, REMEDY)?;
    Ok(allowed - needed)
}

/// Errors: [`crate::Error::TooLarge`] when the light volumes that a stage would make exceed what may be used.
pub(crate) fn check_light(scene: &VolumeScene, optics: &Optics, find: Find) -> Result<()> {
    if find != Find::Environment {
        return Ok(());
    }
    let needed = scene_bytes(scene) + light_bytes(scene, optics)?;
    let remedy = "raise --memory, or lower environment.lights.count or light_size";
    check_memory("one light volume for every light", needed, allowed(&scene.solve), remedy)
}

const REMEDY: &str = "raise --memory, or lower the volume's or the views' sizes";

/// Leaves the metric of tiles where it would take more than its share of the memory, for one that takes next to none.
pub(crate) fn settle_metric(scene: &VolumeScene, settings: &mut SolveSettings, problem: &VolumeProblem) {
    let bytes = metric_bytes(settings, problem);
    if bytes > allowed(&scene.solve) / 4 {
        let needed = mebibytes(bytes);
        tracing::warn!(
            "solve.metric: the tiles would need {needed}, over a quarter of the memory; using `sqs`"
        );
        settings.metric = MetricName::Sqs;
    }
}

fn metric_bytes(settings: &SolveSettings, problem: &VolumeProblem) -> u64 {
    match settings.metric_in_use() {
        MetricName::Tiles if problem.is_grey() => Tiling::bytes::<f32, 1>(problem.start.len()),
        MetricName::Tiles => Tiling::bytes::<f32, 3>(problem.start.len()),
        _ => 0,
    }
}

/// Bytes that a stage takes beside the kept rows.
pub(crate) fn stage_bytes(scene: &VolumeScene, settings: &SolveSettings, problem: &VolumeProblem) -> u64 {
    let (rows, unknowns) = (problem.targets.len(), problem.start.len());
    let kept = crate::problem::vectors(settings.solver);
    let asked = settings.regularization;
    let used = |weight: Weight| usize::from(weight != Weight::Relative(0.0));
    let among_neighbours = used(asked.gradient) + used(asked.laplacian);
    // Of each regularizer what the method keeps, its right-hand side and a prototype; steering takes factors and room.
    let steered = if problem.formulation().steering.is_some() { 2 } else { 0 };
    let lower = used(asked.tikhonov) * (kept.range + 2 + steered)
        // A voxel has three neighbours before it, and each is looked up in both directions.
        + among_neighbours * (3 * (kept.range + 3) + 4);
    // Beside those of the method: start, scaling and its inverse, coverage, x₀ and x.
    // A checkpoint has one vector after the other in f64.
    let vectors = (kept.domain + 6 + lower) * COLOR * unknowns
        + (kept.range + 6) * COLOR * rows
        + 2 * COLOR * unknowns.max(rows);
    let rays = rows * size_of::<[u32; 2]>();
    // The padded vector of the operator, and the colours of all voxels while what was found is put among them.
    let padded = unknowns * size_of::<[f32; 4]>();
    let parts = problem.traversal.through_medium().parts().len().max(1);
    let replaced = 2 * COLOR * problem.candidates() / parts;
    scene_bytes(scene)
        + ((vectors + rays + padded).max(replaced) + (64 << 20)) as u64
        + metric_bytes(settings, problem)
        + problem.prepared_bytes()
}
