//! The matrix of a problem, for other programs.

use super::asked::AskedProblem;
use super::memory::MemoryBudget;
use super::steps::Steps;
use super::volume::{self, nothing_asked};
use super::{Folder, Job};
use crate::problem::{Problem, near};
use crate::scene::{Rgb, Sought};
use crate::sparse::ExplicitMatrix;
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
        folder.finish()
    }
}

pub(super) fn of(job: &Job, steps: &mut Steps<'_>) -> Result<Exported> {
    // Of several key frames the first.
    let volume = job.scenes.volumes().into_iter().next().map(|(_, scene)| scene);
    let geometry = job.scenes.geometry()?;
    let light = job.scenes.painted_scenes(&geometry)?.into_iter().next();
    match (light, volume) {
        (Some(scene), _) => {
            let medium = [
                "medium",
                "a medium whose channels differ",
                "grey, for one matrix cannot hold three; set medium.sigma_t and medium.albedo to numbers",
            ];
            check_grey(scene.medium.is_grey(), medium)?;
            steps.begin("tracing", None);
            let AskedProblem { problem, memory, .. } = job.scenes.asked(&geometry, steps)?.swap_remove(0);
            let colored = match (scene.find, &scene.surroundings) {
                (Sought::Transfer, _) => [
                    "light.radiance",
                    "light of a colour, which is in the rows of a transfer function",
                    "grey, for one matrix cannot hold three",
                ],
                (_, Some(_)) => [
                    "surroundings",
                    "surfaces of a colour, which the surroundings make part of the rows",
                    "grey, for one matrix cannot hold three; set the occluders' albedo to numbers",
                ],
                (_, None) => [
                    "looks.transfer",
                    "a factor of a colour, which multiplies the rows",
                    "grey, for one matrix cannot hold three; or take it away",
                ],
            };
            check_grey(problem.is_grey(), colored)?;
            steps.begin("walking", None);
            let most = memory.budget(&scene.solve, &*problem)? / BYTES;
            let widths = scene.views.iter().map(|view| view.camera.size()[0]);
            let start = problem.formulation(&scene.solve)?.starts();
            let near = near(&*problem, scene.solve.strategy)?;
            let rows = near.as_deref().unwrap_or(&*problem);
            exported(&*problem, rows.explicit(most)?, start, widths.collect())
        }
        (_, Some(scene)) => {
            // Of several stages the first: the others depend on what it finds.
            let problem = volume::problems(&scene, &geometry, steps)?.swap_remove(0).in_reading_order();
            let volume = [
                "volume",
                "a volume whose channels differ in extinction or light",
                "grey, for one matrix cannot hold three; set extinction, lights and environment to grey ones",
            ];
            check_grey(problem.is_grey(), volume)?;
            steps.begin("walking", None);
            let most = MemoryBudget::of_volume(&scene).budget(&scene.solve, &problem)? / BYTES;
            let matrix = ExplicitMatrix::new::<1>(&problem.over_all_voxels(), most)?;
            let widths = scene.views.iter().map(|view| view.view.camera.size()[0]);
            exported(&problem, matrix, problem.all_starts(&scene.medium), widths.collect())
        }
        (_, None) => Err(nothing_asked()),
    }
}

/// Errors: [`Error::Value`] where one matrix cannot hold three channels.
fn check_grey(is_grey: bool, [path, given, expected]: [&'static str; 3]) -> Result<()> {
    if is_grey { Ok(()) } else { Err(Error::value(path, given, expected)) }
}

/// A problem with these columns and views of these widths.
fn exported(
    problem: &dyn Problem,
    matrix: ExplicitMatrix,
    start: Vec<Rgb>,
    widths: Vec<usize>,
) -> Result<Exported> {
    let rows = (0..problem.rows()).zip(problem.weights().0).map(|(row, weight)| {
        let [view, pixel] = problem.pixel(row);
        [view as f32, (pixel % widths[view]) as f32, (pixel / widths[view]) as f32, weight[0]]
    });
    Ok(Exported { matrix, targets: problem.targets().to_vec(), start, rows: rows.collect() })
}
