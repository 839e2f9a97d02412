//! The matrix of a problem, for other programs.

use std::sync::Arc;

use super::steps::Steps;
use super::volume::{self, stage_budget};
use super::{Folder, Job, Scenes, budget};
use crate::problem::{LightMapProblem, Traced};
use crate::scene::{Rgb, Scene, VolumeScene};
use crate::sparse::ExplicitMatrix;
use crate::visibility::Geometry;
use crate::{Error, Result, io};

/// Triplets and compressed rows in f64, and the arrays that are written, in bytes a non-zero.
const BYTES: u64 = 60;

/// A problem as arrays: rows are pixels, columns what is looked for, in reading order.
#[derive(Debug)]
pub struct Exported {
    /// T, the same for all channels.
    pub matrix: ExplicitMatrix,
    /// Of each row what is wanted.
    pub targets: Vec<Rgb>,
    /// Of each column what it starts from.
    pub start: Vec<Rgb>,
    /// View, x, y and weight of each row.
    pub rows: Vec<[f32; 4]>,
}

impl Exported {
    /// Writes T.npz, b.npy, x0.npy and rows.npy, as SciPy and NumPy load them.
    ///
    /// Errors: [`Error::File`].
    pub fn write(&self, folder: impl Into<std::path::PathBuf>) -> Result<()> {
        let folder = Folder::create(folder)?;
        let matrix = self.matrix.channel(0);
        let indptr: Vec<i64> = matrix.indptr().raw_storage().iter().map(|&offset| offset as i64).collect();
        let data: Vec<f32> = matrix.data().iter().map(|&value| value as f32).collect();
        io::npy::write_csr(&folder.file("T.npz"), matrix.shape(), &indptr, matrix.indices(), &data)?;
        let write = |name: &str, colors: &[Rgb]| {
            io::npy::write_f32(&folder.file(name), &[colors.len(), 3], colors.as_flattened())
        };
        write("b.npy", &self.targets)?;
        write("x0.npy", &self.start)?;
        io::npy::write_f32(&folder.file("rows.npy"), &[self.rows.len(), 4], self.rows.as_flattened())?;
        folder.publish()
    }
}

pub(super) fn of(job: &Job, steps: &mut Steps<'_>) -> Result<Exported> {
    match &job.scenes {
        Scenes::LightMap(scene) => of_light_map(scene, steps),
        // Of several key frames the first.
        Scenes::Volume(_) | Scenes::Animation(_) => of_volume(&job.volume_scenes().swap_remove(0).1, steps),
    }
}

fn of_light_map(scene: &Scene, steps: &mut Steps<'_>) -> Result<Exported> {
    if !scene.medium.is_grey() {
        return Err(Error::value(
            "medium",
            "a medium whose channels differ",
            "grey, for one matrix cannot hold three; set medium.sigma_t and medium.albedo to numbers",
        ));
    }
    steps.begin("tracing", None);
    let geometry = Arc::new(Geometry::new(scene.mesh.clone())?);
    let problem = LightMapProblem::of(scene, &geometry, budget::painted(scene)?, &Traced)?;
    if !problem.is_grey() {
        return Err(Error::value(
            "surroundings",
            "surfaces of a colour, which the surroundings make part of the rows",
            "grey, for one matrix cannot hold three; set the occluders' albedo to numbers",
        ));
    }
    steps.begin("walking", None);
    let budget = budget::budget(scene, &scene.solve, &problem)?;
    let matrix = ExplicitMatrix::new::<1>(&problem.traversal, budget / BYTES)?;
    let rows = problem.constraints.iter();
    let rows = rows.map(|pixel| [pixel.view as f32, pixel.x as f32, pixel.y as f32, pixel.weight]);
    Ok(Exported { matrix, start: problem.starts(), rows: rows.collect(), targets: problem.targets })
}

fn of_volume(scene: &VolumeScene, steps: &mut Steps<'_>) -> Result<Exported> {
    // Of several stages the first: the others depend on what it finds.
    let (_, problem) = volume::problems(scene, &volume::geometry_of([scene])?, steps)?.swap_remove(0);
    let problem = problem.in_reading_order();
    if !problem.is_grey() {
        return Err(Error::value(
            "volume",
            "a volume whose channels differ in extinction or light",
            "grey, for one matrix cannot hold three; set extinction, lights and environment to grey ones",
        ));
    }
    steps.begin("walking", None);
    let budget = stage_budget(scene, &scene.solve, &problem)?;
    let matrix = ExplicitMatrix::new::<1>(&problem.over_all_voxels(), budget / BYTES)?;
    let row = |row: usize| {
        let [view, pixel] = problem.traversal.rays().pixel(row);
        let width = scene.views[view as usize].view.camera.size()[0] as u32;
        [view as f32, (pixel % width) as f32, (pixel / width) as f32, problem.weights[row][0]]
    };
    Ok(Exported {
        matrix,
        start: problem.all_starts(&scene.medium),
        rows: (0..problem.targets.len()).map(row).collect(),
        targets: problem.targets,
    })
}
