//! What a job takes, and what it may take.

use super::default_budget;
use crate::march::{FurtherWeights, ViewRay};
use crate::operator::Tiling;
use crate::problem::{Constraint, Optics, Problem, SystemOperator, constraints, light_bytes, vectors};
use crate::scene::{
    Find, KeyFrame, MetricName, RegularizationWeight, Scene, SolveSettings, SolverName, Strategy, VolumeScene,
};
use crate::solve::Correction;
use crate::visibility::ShadowMap;
use crate::{Error, Result, Warning};

const COLOR: usize = size_of::<[f32; 3]>();
/// Bytes of a painted pixel, or of a wanted one.
const PAINTED: usize = size_of::<[f32; 4]>();

/// Bytes that may be used, and what of them a scene takes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MemoryBudget {
    pub(crate) allowed: u64,
    scene: u64,
    /// What a person can do where that is not enough.
    remedy: &'static str,
}

impl MemoryBudget {
    /// For a light map: what is painted on the views, and four pictures of each.
    pub(crate) fn of_light_map(scene: &Scene) -> Self {
        let remedy = match scene.surroundings.as_ref().and_then(|it| it.sky.as_ref()) {
            None => "raise solve.memory, or lower light_map.size, shadow_map.size or the views' sizes",
            Some(_) => {
                "raise solve.memory, or lower lights or shadow_map of surroundings.environment, light_map.size, shadow_map.size or the views' sizes"
            }
        };
        let pictures = scene.pixels() * (4 * COLOR + PAINTED);
        Self { allowed: allowed(&scene.solve), scene: pictures as u64, remedy }
    }

    /// For a volume: its properties, what is wanted of each pixel, and its picture before, after and while it is drawn.
    pub(crate) fn of_volume(scene: &VolumeScene) -> Self {
        let medium = &scene.medium;
        let volumes = [&medium.extinction, &medium.albedo, &medium.emission];
        let voxels: usize = volumes.iter().map(|volume| volume.samples().bytes()).sum();
        Self {
            allowed: allowed(&scene.solve),
            scene: (voxels + scene.pixels() * (PAINTED + 3 * COLOR)) as u64,
            remedy: "raise solve.memory, or lower the volume's or the views' sizes",
        }
    }

    fn check(&self, what: &str, needed: u64) -> Result<()> {
        if needed <= self.allowed {
            return Ok(());
        }
        Err(Error::TooLarge {
            what: what.to_owned(),
            needed: mebibytes(needed),
            limit: mebibytes(self.allowed),
            remedy: self.remedy,
        })
    }

    /// Bytes that the kept rows of T may take: what may be used, less what everything else needs.
    ///
    /// Errors: [`Error::TooLarge`] when everything else does not fit.
    pub(crate) fn budget(&self, settings: &SolveSettings, problem: &dyn Problem) -> Result<u64> {
        let needed = self.beside_rows(settings, problem)?;
        self.check("the solve without its matrix", needed)?;
        Ok(self.allowed - needed)
    }

    /// Bytes that a solve takes beside the kept rows.
    pub(crate) fn beside_rows(&self, settings: &SolveSettings, problem: &dyn Problem) -> Result<u64> {
        let formulation = problem.formulation(settings)?;
        let (rows, unknowns) = (problem.rows(), formulation.elements());
        let mut kept = vectors(settings.solver);
        if settings.strategy == Strategy::Epipolar {
            kept = kept.and(Correction::<SystemOperator>::VECTORS);
        }
        let asked = settings.regularization;
        let used = |weight: RegularizationWeight| usize::from(weight != RegularizationWeight::Relative(0.0));
        let among_neighbours = used(asked.gradient) + used(asked.laplacian);
        let axes = formulation.lattices().axes();
        // Of each regularizer what the method keeps, its right-hand side and a prototype; uneven pulls take factors and room.
        let uneven = formulation.parts.iter().any(|part| part.pull != 1.0 || part.scale != 0);
        let lower = used(asked.tikhonov) * (kept.range + 2 + if uneven { 2 } else { 0 })
            // An element has a neighbour before it along each axis, and each is looked up in both directions.
            + among_neighbours * (axes * (kept.range + 3) + 4);
        // Beside those of the method: start, scaling and its inverse, coverage, x₀, x, and what the operator pads.
        // A checkpoint has one vector after the other in f64.
        let vectors = (kept.domain + 8 + lower) * COLOR * unknowns
            + (kept.range + 6) * COLOR * rows
            + 2 * COLOR * unknowns.max(rows);
        let solving = vectors as u64 + problem.ray_bytes();
        // What was found is put among all candidates of its kind: their colours are there twice then.
        let replaced = 2 * COLOR * problem.candidates() / formulation.parts.len().max(1);
        Ok(self.scene
            + solving.max(replaced as u64)
            + (64 << 20)
            + metric_bytes(settings, problem, unknowns)
            + problem.prepared_bytes())
    }

    /// The settings, with the metric that is used: tiles where they are asked for or pay, unless they would take more than their share.
    pub(crate) fn settled(
        &self,
        mut settings: SolveSettings,
        problem: &dyn Problem,
    ) -> Result<SolveSettings> {
        if settings.metric == MetricName::Auto && !self.tiles_pay(&settings, problem) {
            settings.metric = MetricName::Sqs;
        }
        let bytes = metric_bytes(&settings, problem, problem.formulation(&settings)?.elements());
        if bytes > self.allowed / 4 {
            let needed = mebibytes(bytes);
            let text = format!(
                "solve.metric: the tiles would need {needed}, over a quarter of the memory; using `sqs`"
            );
            Warning::new("memory", text, "").tell();
            settings.metric = MetricName::Sqs;
        }
        Ok(settings)
    }

    /// Whether tiles save more iterations than they cost. In FISTA neighbours that are held together by smoothness cannot stand in for each other as
    /// they can without it, so tiles save little; what they then cost, beside an iteration of kept rows, is more (docs/solvers.md).
    fn tiles_pay(&self, settings: &SolveSettings, problem: &dyn Problem) -> bool {
        let asked = settings.regularization;
        let is_smooth = [asked.gradient, asked.laplacian] != [RegularizationWeight::Relative(0.0); 2];
        let is_kept = settings.strategy != Strategy::MatrixFree && problem.kept_bytes() <= self.allowed;
        let is_sliced = settings.strategy == Strategy::Epipolar;
        !(is_sliced || settings.solver == SolverName::Fista && is_smooth && is_kept)
    }
}

/// Bytes that may be used.
fn allowed(settings: &SolveSettings) -> u64 {
    settings.memory.unwrap_or_else(default_budget)
}

/// Bytes that the metric takes at most.
fn metric_bytes(settings: &SolveSettings, problem: &dyn Problem, unknowns: usize) -> u64 {
    match settings.metric_in_use() {
        MetricName::Tiles if problem.is_grey() => Tiling::bytes::<f32, 1>(unknowns),
        MetricName::Tiles => Tiling::bytes::<f32, 3>(unknowns),
        _ => 0,
    }
}

/// Errors: [`Error::TooLarge`] when what is painted on the views, the shadow maps and a light map alone exceed the memory that may be used:
/// that is known from their sizes, before any of them is made.
pub(crate) fn check_scene(scene: &Scene) -> Result<()> {
    let bytes = scene.pixels() * PAINTED
        + len(scene.shadow_map.size) * ShadowMap::bytes_a_texel(&scene.mesh)
        + len(scene.light_map.size) * COLOR;
    let needed = sky_bytes(scene).saturating_add(bytes as u64);
    MemoryBudget::of_light_map(scene).check("the scene's pictures and maps", needed)
}

/// Errors: as [`check_scene`], of all key frames together.
pub(crate) fn check_light_keys(keys: &[KeyFrame<Scene>]) -> Result<()> {
    let Some(first) = keys.first() else { return Ok(()) };
    check_scene(&first.scene)?;
    let needed = keys.iter().map(|key| MemoryBudget::of_light_map(&key.scene).scene).sum();
    MemoryBudget::of_light_map(&first.scene).check("the pictures of all key frames", needed)
}

/// The painted pixels of a scene.
///
/// Errors: [`Error::TooLarge`] when their rows or their surroundings exceed the memory, before those are made; [`Error::Empty`] when there are
/// none.
pub(crate) fn painted(scene: &Scene) -> Result<Vec<Constraint>> {
    let painted = constraints(scene)?;
    let memory = MemoryBudget::of_light_map(scene);
    // Known now, before a ray of them is traced.
    let row =
        (vectors(scene.solve.solver).range + 6) * COLOR + size_of::<ViewRay>() + size_of::<Constraint>();
    memory.check("the solve for the painted pixels", memory.scene + (painted.len() * row) as u64)?;
    if let Some(around) = &scene.surroundings {
        // Weights are made row by row, and kept.
        let needed = sky_bytes(scene) + 3 * FurtherWeights::bytes(painted.len(), around.len());
        memory.check("the light around the light map", needed)?;
    }
    Ok(painted)
}

/// Bytes that the shadow maps of the sky take.
fn sky_bytes(scene: &Scene) -> u64 {
    scene.surroundings.as_ref().and_then(|it| it.sky.as_ref()).map_or(0, |sky| sky.shadow_bytes())
}

/// Errors: [`Error::TooLarge`] when a volume scene alone exceeds what may be used.
pub(crate) fn check_volume(scene: &VolumeScene) -> Result<()> {
    let memory = MemoryBudget::of_volume(scene);
    memory.check("the scene's volumes and pictures", memory.scene)
}

/// Errors: as [`check_volume`], of all key frames together.
pub(crate) fn check_keys(keys: &[KeyFrame]) -> Result<()> {
    let Some(first) = keys.first() else { return Ok(()) };
    let needed = keys.iter().map(|key| MemoryBudget::of_volume(&key.scene).scene).sum();
    MemoryBudget::of_volume(&first.scene).check("the volumes and pictures of all key frames", needed)
}

/// Bytes that diffusion takes a voxel: vectors in f64 over voxels and three edges each, and who lies beside whom.
const SPREAD: usize = 640;

/// Errors: [`Error::TooLarge`] when diffusion into so many voxels of the extinction would exceed what may be used.
pub(crate) fn check_spread(scene: &VolumeScene, voxels: usize) -> Result<()> {
    let [extinction, albedo, emission] =
        [&scene.medium.extinction, &scene.medium.albedo, &scene.medium.emission].map(|of| of.grid().len());
    let needed = SPREAD * voxels * albedo.max(emission).div_ceil(extinction);
    MemoryBudget::of_volume(scene).check("diffusion between the keys", needed as u64)
}

/// Errors: [`Error::TooLarge`] when the light volumes that a stage would make exceed what may be used.
pub(crate) fn check_light(scene: &VolumeScene, optics: &Optics, find: Find) -> Result<()> {
    if find != Find::Environment {
        return Ok(());
    }
    let memory = MemoryBudget::of_volume(scene);
    let remedy = "raise solve.memory, or lower environment.lights.count or light_size";
    let needed = memory.scene + light_bytes(scene, optics)?;
    MemoryBudget { remedy, ..memory }.check("one light volume for every light", needed)
}

fn len(size: [usize; 2]) -> usize {
    size.iter().product()
}

pub(crate) fn mebibytes(bytes: u64) -> String {
    format!("{:.0} MiB", bytes as f64 / f64::from(1 << 20))
}
