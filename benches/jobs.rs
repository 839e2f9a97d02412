//! Whole jobs and their parts at the sizes of the papers.
//!
//!     cargo bench --bench jobs [-- FILTER] [-- --quick]
//!
//! `citadel` is the demo scene, built and solved as the command does it; `field` an open field of pillars whose rays are lit for longer,
//! of the size of Kol 2017, sec. 5.2. `volume` is emission at the size of Klehm 2015, fig. 7.3, and `light around a volume` that of
//! fig. 7.4, six iterations. Set-up begins with a scene in memory.
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench that cannot go on should stop")]
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "figures are what it is for")]
#![allow(unreachable_pub, reason = "nothing here is public")]

mod rates;
#[path = "../tests/scenes/mod.rs"]
mod scenes;

use std::cell::LazyCell;

use rates::{Rates, Work, by_the_clock};
use scenes::field::Field;
use scenes::volume::{Cloud, problem};
use unscatter::cpu::Transport;
use unscatter::march::LightMapTraversal;
use unscatter::operator::{
    Blocks, CpuVector, Identity, LinearOperator, OnHost, Stacked, Storage, TransportOperator, Vector,
    WalkPlan, adjoint_test,
};
use unscatter::problem::{LightMapProblem, Problem, VolumeProblem, solve};
use unscatter::scene::{Basis, Find, Interpolation, Quadrature, SolveSettings, Strategy};
use unscatter::solve::{Beginning, Cgls, Control, LeastSquares, Limits, drive};

const ITERATIONS: usize = 6;

fn main() {
    let mut rates = Rates::new(1.0);
    citadel(&mut rates);
    for (name, basis) in [("nearest", Basis::Nearest), ("bilinear", Basis::Bilinear)] {
        field(&mut rates, &format!("field, {name}"), basis);
    }
    for (of, basis) in [("nearest", Interpolation::Nearest), ("trilinear", Interpolation::Trilinear)] {
        for (fill, is_full) in [("sparse", false), ("dense", true)] {
            volume(&mut rates, &format!("volume, {fill} {of}"), &Cloud::seen_twice(is_full, basis));
        }
    }
    for (fill, is_full) in [("sparse", false), ("dense", true)] {
        let cloud = Cloud::seen_from_around(is_full, Interpolation::Nearest);
        light(&mut rates, &format!("light around a volume, {fill}"), &cloud);
    }
    rates.finish();
}

/// What all of a job goes through once.
fn all_of(storage: Storage) -> Work {
    Work {
        rays: storage.kept_rows as u64,
        nonzeros: storage.kept_nonzeros,
        bytes: storage.bytes,
        ..Work::default()
    }
}

/// The same with both vectors.
fn product_of<O: TransportOperator>(operator: &O) -> Work {
    let vectors = (operator.domain().len() + operator.range().len()) * size_of::<[f32; 3]>();
    let work = all_of(operator.storage());
    Work { bytes: work.bytes + vectors as u64, ..work }
}

fn citadel(rates: &mut Rates) {
    rates.bench("citadel", "build and solve", || {
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("strokes/citadel.json");
        let scene = unscatter::io::scene_file::load(&file, &[]).unwrap();
        let problem = LightMapProblem::new(&scene).unwrap();
        let work = all_of(problem.on_cpu(scene.solve.strategy, u64::MAX).unwrap().storage());
        let job = move || {
            let operator = problem.on_cpu(scene.solve.strategy, u64::MAX).unwrap();
            let coverage = operator.squares(&problem.weights()).unwrap();
            solve(&problem, &operator, &coverage, &scene.solve, None, |_, _| Ok(Control::Continue)).unwrap()
        };
        (work, by_the_clock(job))
    });
}

fn field(rates: &mut Rates, name: &str, basis: Basis) {
    let field = Field { basis, ..Field::PAPER };
    let marched = Field { quadrature: Quadrature::March { steps: 768 }, ..field };
    for (way, field) in [("assemble", field), ("assemble, march of 768 steps", marched)] {
        rates.bench(name, way, || {
            let traversal = field.traversal();
            (all_of(kept(&traversal).storage()), by_the_clock(move || kept(&traversal)))
        });
    }
    rates.bench(name, "assemble and 32 iterations", || {
        let traversal = field.traversal();
        (all_of(kept(&traversal).storage()), by_the_clock(move || iterate(&kept(&traversal))))
    });
}

fn kept(traversal: &LightMapTraversal) -> Transport<LightMapTraversal, f32, 1> {
    let plan = WalkPlan::new::<1>(traversal);
    Transport::new(traversal.clone(), &plan, Strategy::Assembled, u64::MAX).unwrap()
}

/// Conjugate gradients as in the paper, without its clamping.
fn iterate(operator: &Transport<LightMapTraversal, f32, 1>) {
    let pull = Identity::scaled(&operator.domain(), [0.05; 3]);
    let stacked = Stacked::new(operator).over(pull).unwrap();
    let target = |row: usize| std::array::from_fn(|c| ((row / 700 + c) % 3) as f32 * 0.02);
    let targets = CpuVector((0..operator.range().len()).map(target).collect());
    let rhs = Blocks::new(targets, vec![operator.domain()]);
    let problem = LeastSquares::new(&stacked, &rhs);
    let start = stacked.domain();
    let limits = Limits::new(32, 0.0);
    drive(&mut Cgls::new(&stacked), &problem, Beginning::At(&start), &limits, |_, _| Ok(Control::Continue))
        .unwrap();
}

type Product = fn(&OnHost, &mut CpuVector, &mut CpuVector);

fn volume(rates: &mut Rates, name: &str, cloud: &Cloud) {
    let made = LazyCell::new(|| (cloud.scene(), cloud.even()));
    let set_up = || assembled(&problem(&made.0, &made.1, Find::Emission));
    let operator = LazyCell::new(set_up);
    rates.bench(name, "set-up", || (all_of(operator.storage()), by_the_clock(set_up)));
    let products: [(&str, Product); 2] = [
        ("gather", |operator, x, y| operator.apply(x, y).unwrap()),
        ("scatter", |operator, x, y| operator.apply_adjoint(y, x).unwrap()),
    ];
    for (product, apply) in products {
        rates.bench(name, product, || {
            let (operator, mut x, mut y) = (&*operator, operator.domain(), operator.range());
            x.0.iter_mut().enumerate().for_each(|(i, x)| *x = [(i % 97) as f32, 1.0, 0.5]);
            y.fill([1.0, 0.5, 0.25]);
            (product_of(operator), by_the_clock(move || apply(operator, &mut x, &mut y)))
        });
    }
}

fn assembled(problem: &VolumeProblem) -> OnHost {
    problem.on_cpu(Strategy::Assembled, u64::MAX).unwrap()
}

fn light(rates: &mut Rates, name: &str, cloud: &Cloud) {
    let made = LazyCell::new(|| {
        let mut scene = cloud.scene();
        scene.solve = SolveSettings { iterations: ITERATIONS, tolerance: 0.0, ..SolveSettings::default() };
        (scene, cloud.lit())
    });
    let set_up = || problem(&made.0, &made.1, Find::Environment);
    let lit = LazyCell::new(set_up);
    let walking = || {
        let operator = assembled(&lit);
        let coverage = operator.squares(&lit.weights()).unwrap();
        adjoint_test(&operator, 1, 1).unwrap();
        (operator, coverage)
    };
    let walked = LazyCell::new(walking);
    rates.bench(name, "set-up", || (all_of(walked.0.storage()), by_the_clock(set_up)));
    rates.bench(name, "matrix, coverage and test of the adjoint", || {
        (all_of(walked.0.storage()), by_the_clock(walking))
    });
    rates.bench(name, "six iterations", || {
        let settings = VolumeProblem::settings(&made.0, Find::Environment);
        let (lit, (operator, coverage)) = (&*lit, &*walked);
        let job = move || {
            let each = |_: &_, _: &mut dyn unscatter::problem::Snapshot| Ok(Control::Continue);
            solve(lit, operator, coverage, &settings, None, each).unwrap()
        };
        (all_of(operator.storage()), by_the_clock(job))
    });
}
