//! How many applications of the transport, and how many seconds, each method takes to a given KKT residual.
//!
//! `cargo bench --bench solvers` prints the tables of docs/solvers.md. The residual is the norm of the projected gradient
//! (without bounds: of the gradient) in the worst channel, relative to the start, computed from the true residual outside
//! of what is counted and timed.
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench that cannot go on should stop")]
#![allow(clippy::print_stdout, reason = "figures are what it is for")]
#![allow(unreachable_pub, reason = "nothing here is public")]

mod gradient_descent;
mod race;
mod random;
#[path = "../../tests/scenes/mod.rs"]
mod scenes;

use std::path::Path;
use std::time::Instant;

use race::{Course, Race};
use unscatter::io::scene_file;
use unscatter::operator::{CpuVector, LinearOperator, TransportOperator};
use unscatter::problem::{LightMapProblem, Problem, System, measure, method};
use unscatter::scene::{MetricName, Scene, SolverName};

const SCENES: [&str; 3] = ["citadel", "forest", "nave"];
/// Applications after which a method is given up.
const MOST: f64 = 3000.0;

fn main() {
    // `cargo bench` hands over `--bench`; a number limits the applications, for a quick look.
    let most = std::env::args().skip(1).find_map(|argument| argument.parse().ok()).unwrap_or(MOST);
    println!("Applications (seconds) to a relative KKT residual; – : not within {most} applications.\n");
    for name in SCENES {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("strokes/{name}.json"));
        let scene = scene_file::load(&file, &[]).unwrap();
        let problem = LightMapProblem::new(&scene).unwrap();
        bounded(name, &scene, &problem, most);
    }
    as_exported(most);
    random::table(most);
    for name in ["citadel", "forest"] {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("strokes/{name}.json"));
        let scene = scene_file::load(&file, &[]).unwrap();
        let problem = LightMapProblem::new(&scene).unwrap();
        unbounded(name, &scene, &problem, most);
        metrics(name, &scene, &problem, most);
    }
}

/// One method on one scene.
fn run(scene: &Scene, problem: &LightMapProblem, race: &Race) -> Course {
    let operator = problem.on_cpu(scene.solve.strategy, u64::MAX).unwrap();
    let coverage = operator.squares(&problem.weights()).unwrap();
    let mut settings = scene.solve.clone();
    settings.solver = race.solver;
    settings.metric = race.metric;
    let clock = Instant::now();
    let system =
        System::new(&problem.formulation(&settings).unwrap(), &operator, &coverage, &settings).unwrap();
    let set_up = clock.elapsed().as_secs_f64();
    let least_squares = system.problem();
    let reference = measure(&least_squares, system.start()).unwrap();
    let mut method = method(race.solver, system.operator());
    race.run(&mut *method, &least_squares, system.start(), &reference, set_up)
}

fn bounded(name: &str, scene: &Scene, problem: &LightMapProblem, most: f64) {
    println!("### {name}, x ≥ 0\n");
    race::header();
    let metrics = |solver: SolverName| match solver {
        SolverName::Fista => vec![MetricName::Tiles, MetricName::Sqs],
        _ => vec![MetricName::Sqs],
    };
    for solver in SolverName::ALL.into_iter().filter(|solver| solver.keeps_bounds()) {
        for metric in metrics(solver) {
            let race = Race { solver, metric, most, channel: None };
            race.print(&run(scene, problem, &race));
        }
    }
    println!();
}

fn unbounded(name: &str, scene: &Scene, problem: &LightMapProblem, most: f64) {
    println!("### {name}, no bounds\n");
    race::header();
    for solver in SolverName::ALL.into_iter().filter(|solver| !solver.keeps_bounds()) {
        let race = Race { solver, metric: MetricName::Sqs, most, channel: None };
        race.print(&run(scene, problem, &race));
    }
    let race = Race { solver: SolverName::Cgls, metric: MetricName::None, most, channel: None };
    race.print(&run(scene, problem, &race));
    gradient_descent::print(scene, problem, most);
    println!();
}

/// What the metric is worth.
fn metrics(name: &str, scene: &Scene, problem: &LightMapProblem, most: f64) {
    println!("### {name}, metrics of the default and of CGLS\n");
    race::header();
    for solver in [SolverName::default(), SolverName::Cgls] {
        for metric in [MetricName::Tiles, MetricName::Sqs, MetricName::Jacobi, MetricName::None] {
            let race = Race { solver, metric, most, channel: None };
            race.print(&run(scene, problem, &race));
        }
    }
    println!();
}

/// The citadel as `unscatter matrix` exports it, without its constraint weights and in its first channel, which is what
/// other programs are given.
fn as_exported(most: f64) {
    println!("### citadel as exported: first channel, all weights 1, x ≥ 0\n");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("strokes/citadel.json");
    let scene = scene_file::load(&file, &[]).unwrap();
    let mut problem = LightMapProblem::new(&scene).unwrap();
    problem.constraints.iter_mut().for_each(|pixel| pixel.weight = 1.0);
    race::header();
    for (solver, metric) in [
        (SolverName::Fista, MetricName::Tiles),
        (SolverName::Fista, MetricName::Sqs),
        (SolverName::Spectral, MetricName::Sqs),
        (SolverName::Lbfgs, MetricName::Sqs),
    ] {
        let race = Race { solver, metric, most, channel: Some(0) };
        race.print(&run(&scene, &problem, &race));
    }
    println!();
}

/// What all rows of a table share.
fn residuals<O: LinearOperator<Domain = CpuVector>>(
    problem: &unscatter::solve::LeastSquares<O>,
    x: &O::Domain,
) -> [f64; 3] {
    use unscatter::operator::Vector;
    let (mut r, mut g) = (problem.operator().range(), problem.operator().domain());
    problem.operator().apply(x, &mut r).unwrap();
    r.axpby([1.0; 3], problem.rhs(), [-1.0; 3]);
    problem.operator().apply_adjoint(&r, &mut g).unwrap();
    g.scale([-1.0; 3]);
    g.projected_norm_squared(x, problem.bounds()).unwrap()
}
