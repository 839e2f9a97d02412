use super::args::MatrixArguments;
use super::progress::Steps;
use super::results::Folder;
use super::{Done, Manners, job, to_json};
use crate::problem::LightMapProblem;
use crate::sparse::ExplicitMatrix;
use crate::{Error, Result, io};

/// `unscatter matrix`: T.npz, b.npy, x0.npy and rows.npy, as SciPy and NumPy load them.
pub(super) fn run(arguments: &MatrixArguments, manners: &Manners) -> Result<Done> {
    let mut steps = Steps::new(manners.quiet);
    steps.begin("reading", None);
    let scene = job::load(&arguments.scene, &[])?;
    let folder = Folder::create(arguments.output.output.clone(), &arguments.scene.scene)?;
    if !scene.medium.is_grey() {
        return Err(Error::value(
            "medium",
            "a medium whose channels differ",
            "grey, for one matrix cannot hold three; set medium.sigma_t and medium.albedo to numbers",
        ));
    }
    steps.begin("tracing", None);
    let problem = LightMapProblem::new(&scene)?;
    steps.begin("walking", None);
    let budget = job::budget(&scene, &problem)?;
    // Triplets and compressed rows in f64, and the arrays that are written.
    let explicit = ExplicitMatrix::new::<1>(&problem.traversal, budget / 56)?;
    steps.begin("writing", None);
    let matrix = explicit.channel(0);
    let indptr: Vec<i64> = matrix.indptr().raw_storage().iter().map(|&offset| offset as i64).collect();
    let indices: Vec<i32> = matrix.indices().iter().map(|&index| index as i32).collect();
    let data: Vec<f32> = matrix.data().iter().map(|&value| value as f32).collect();
    let (rows, columns) = matrix.shape();
    io::npy::write_csr(&folder.file("T.npz"), (rows, columns), &indptr, &indices, &data)?;
    let write = |name: &str, colors: &[[f32; 3]]| {
        io::npy::write_f32(&folder.file(name), &[colors.len(), 3], colors.as_flattened())
    };
    write("b.npy", &problem.targets)?;
    write("x0.npy", &vec![problem.start; columns])?;
    let described: Vec<f32> = problem
        .constraints
        .iter()
        .flat_map(|pixel| [pixel.view as f32, pixel.x as f32, pixel.y as f32, pixel.weight])
        .collect();
    io::npy::write_f32(&folder.file("rows.npy"), &[rows, 4], &described)?;
    folder.publish()?;
    steps.finish();
    let json = serde_json::json!({ "rows": rows, "columns": columns, "nonzeros": matrix.nnz() });
    let words = format!("T: {rows} × {columns}, {} non-zeros, in {}", matrix.nnz(), folder.path().display());
    manners.print(&to_json(&json)?, &words);
    Ok(Done::Completely)
}
