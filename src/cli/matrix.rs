use super::args::MatrixArguments;
use super::progress::Steps;
use super::results::Folder;
use super::{Done, Manners, job, to_json};
use crate::io::scene_file::Subject;
use crate::problem::LightMapProblem;
use crate::scene::Rgb;
use crate::sparse::ExplicitMatrix;
use crate::{Error, Result, io};

/// `unscatter matrix`: T.npz, b.npy, x0.npy and rows.npy, as SciPy and NumPy load them.
pub(super) fn run(arguments: &MatrixArguments, manners: &Manners) -> Result<Done> {
    let mut steps = Steps::new(manners.quiet);
    steps.begin("reading", None);
    let system = match io::scene_file::subject(&arguments.scene.scene)? {
        Subject::LightMap => of_light_map(arguments, &mut steps)?,
        Subject::Volume | Subject::Animation => of_volume(arguments, &mut steps)?,
    };
    let folder = Folder::create(arguments.output.output.clone(), &arguments.scene.scene)?;
    steps.begin("writing", None);
    let matrix = system.matrix.channel(0);
    let indptr: Vec<i64> = matrix.indptr().raw_storage().iter().map(|&offset| offset as i64).collect();
    let data: Vec<f32> = matrix.data().iter().map(|&value| value as f32).collect();
    let (rows, columns) = matrix.shape();
    io::npy::write_csr(&folder.file("T.npz"), (rows, columns), &indptr, matrix.indices(), &data)?;
    let write = |name: &str, colors: &[Rgb]| {
        io::npy::write_f32(&folder.file(name), &[colors.len(), 3], colors.as_flattened())
    };
    write("b.npy", &system.targets)?;
    write("x0.npy", &system.start)?;
    io::npy::write_f32(&folder.file("rows.npy"), &[rows, 4], system.described.as_flattened())?;
    folder.publish()?;
    steps.finish();
    let json = serde_json::json!({ "rows": rows, "columns": columns, "nonzeros": matrix.nnz() });
    let words = format!("T: {rows} × {columns}, {} non-zeros, in {}", matrix.nnz(), folder.path().display());
    manners.print(&to_json(&json)?, &words);
    Ok(Done::Completely)
}

/// What is written.
struct System {
    matrix: ExplicitMatrix,
    targets: Vec<Rgb>,
    start: Vec<Rgb>,
    /// View, x, y and weight of each row.
    described: Vec<[f32; 4]>,
}

/// Triplets and compressed rows in f64, and the arrays that are written, in bytes a non-zero.
const BYTES: u64 = 60;

fn of_light_map(arguments: &MatrixArguments, steps: &mut Steps) -> Result<System> {
    let scene = job::load(&arguments.scene, &[])?;
    if !scene.medium.is_grey() {
        return Err(Error::value(
            "medium",
            "a medium whose channels differ",
            "grey, for one matrix cannot hold three; set medium.sigma_t and medium.albedo to numbers",
        ));
    }
    job::check_surroundings(&scene)?;
    steps.begin("tracing", None);
    let problem = LightMapProblem::new(&scene)?;
    if !problem.is_grey() {
        return Err(Error::value(
            "surroundings",
            "surfaces of a colour, which the surroundings make part of the rows",
            "grey, for one matrix cannot hold three; set the occluders' albedo to numbers",
        ));
    }
    steps.begin("walking", None);
    let budget = job::budget(&scene, &problem)?;
    let matrix = ExplicitMatrix::new::<1>(&problem.traversal, budget / BYTES)?;
    let described = problem.constraints.iter();
    let described = described.map(|pixel| [pixel.view as f32, pixel.x as f32, pixel.y as f32, pixel.weight]);
    Ok(System { matrix, start: problem.starts(), described: described.collect(), targets: problem.targets })
}

fn of_volume(arguments: &MatrixArguments, steps: &mut Steps) -> Result<System> {
    // Of several key frames the first.
    let (_, scene) = job::load_volumes(&arguments.scene)?.swap_remove(0);
    // Of several stages the first: the others depend on what it finds.
    let (_, problem) = super::volume::problems(&scene, &job::geometry_of([&scene])?, steps)?.swap_remove(0);
    let problem = problem.in_reading_order();
    if !problem.is_grey() {
        return Err(Error::value(
            "volume",
            "a volume whose channels differ in extinction or light",
            "grey, for one matrix cannot hold three; set extinction, lights and environment to grey ones",
        ));
    }
    steps.begin("walking", None);
    let budget = super::volume::budget(&scene, &scene.solve, &problem)?;
    let matrix = ExplicitMatrix::new::<1>(&problem.over_all_voxels(), budget / BYTES)?;
    let described = |row: usize| {
        let [view, pixel] = problem.traversal.rays().pixel(row);
        let width = scene.views[view as usize].view.camera.size()[0] as u32;
        [view as f32, (pixel % width) as f32, (pixel / width) as f32, problem.weights[row][0]]
    };
    Ok(System {
        matrix,
        start: problem.all_starts(&scene.medium),
        described: (0..problem.targets.len()).map(described).collect(),
        targets: problem.targets,
    })
}
