//! Every consumer of every traversal on the processor: walking alone, then what is made of a walk, with rows kept and walked anew.
//!
//!     cargo bench --bench consumers [-- FILTER] [-- --quick]
//!     UNSCATTER_SIZE=paper cargo bench --bench consumers     the sizes of Kol 2017 and Klehm 2015; else half of each axis
//!                                                            (of rows of refinement half and a quarter: they cross empty cells, too)
//!
//! Bytes are those of the kept rows and of both vectors, each read or written once; of walked rows, of the vectors alone; of `assemble`,
//! `tiles` and `triplets`, of what they make. `triplets` takes a thousand rows.
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench that cannot go on should stop")]
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "figures are what it is for")]
#![allow(unreachable_pub, reason = "nothing here is public")]

mod rates;
#[path = "../tests/scenes/mod.rs"]
mod scenes;

use std::cell::LazyCell;
use std::ops::Deref;

use rates::{Rates, Round, Work, by_the_clock, size_of};
use rayon::prelude::*;
use scenes::field::Field;
use scenes::mist;
use scenes::volume::Cloud;
use unscatter::cpu::{TileMetric, Transport};
use unscatter::march::{Traversal, Weight};
use unscatter::operator::{CpuVector, LinearOperator, OnHost, Tiling, Vector, WalkPlan};
use unscatter::problem::{LightMapProblem, Problem, VolumeProblem, VolumeRows};
use unscatter::scene::{Basis, Find, Interpolation, SolveSettings, Strategy};
use unscatter::sparse::ExplicitMatrix;

/// Rows of the explicit matrix.
const FEW: usize = 1000;

fn main() {
    let (_, by) = size_of(&[("small", 2), ("paper", 1)]);
    let mut rates = Rates::new(1.0);
    for (name, basis) in [("nearest", Basis::Nearest), ("bilinear", Basis::Bilinear)] {
        consumers(&mut rates, &format!("light map, {name}"), Tiles::OfWeights, || {
            let field = if by == 1 { Field::PAPER } else { Field::SMALL };
            let traversal = Field { basis, ..field }.traversal();
            let texels: Vec<u32> = (0..Traversal::<f64, 1>::elements(&traversal) as u32).collect();
            (traversal, Tiling::new([field.map; 2], &texels))
        });
    }
    consumers(&mut rates, "surroundings", Tiles::OfWeights, || {
        let mut scene = mist::scaled(&mist::CASES[1], 16 / by);
        scene.light_map.size = [512 / by; 2];
        let problem = LightMapProblem::new(&scene).unwrap();
        let tiling = tiling(&problem);
        (problem.traversal, tiling)
    });
    for (of, basis) in [("nearest", Interpolation::Nearest), ("trilinear", Interpolation::Trilinear)] {
        for (fill, is_full) in [("sparse", false), ("dense", true)] {
            consumers(&mut rates, &format!("volume, {fill} {of}"), Tiles::OfWeights, || {
                rows(Cloud::seen_twice(is_full, basis).shrunk(by).problem(Find::Emission))
            });
        }
        consumers(&mut rates, &format!("linearized, {of}"), Tiles::None, || {
            rows(Cloud::seen_twice(false, basis).shrunk(2 * by).problem(Find::Refinement))
        });
    }
    let lit = LazyCell::new(|| {
        Cloud::seen_from_around(false, Interpolation::Nearest).shrunk(by).problem(Find::Environment)
    });
    consumers(&mut rates, "light around a volume", Tiles::OfWeights, || {
        (lit.traversal.clone(), tiling(&*lit))
    });
    light_volumes(&mut rates, &lit);
    rates.finish();
}

/// Whether rows have tiles; those with weights of either sign do not.
#[derive(PartialEq)]
enum Tiles {
    OfWeights,
    None,
}

fn rows(problem: VolumeProblem) -> (VolumeRows, Tiling) {
    let tiling = tiling(&problem);
    (problem.traversal, tiling)
}

/// Tiles over all elements of a problem.
fn tiling(problem: &dyn Problem) -> Tiling {
    let formulation = problem.formulation(&SolveSettings::default()).unwrap();
    let elements: Vec<u32> = (0..formulation.elements() as u32).collect();
    Tiling::placed(&formulation.lattices(), elements.len(), &elements, &formulation.places(&elements))
}

/// Rows evenly spread over those of a traversal.
struct Few<'a, T>(&'a T);

impl<T: Traversal<f64, 1>> Traversal<f64, 1> for Few<'_, T> {
    fn rows(&self) -> usize {
        FEW.min(self.0.rows())
    }

    fn elements(&self) -> usize {
        self.0.elements()
    }

    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f64, 1>)) {
        self.0.walk(row * (self.0.rows() / self.rows()), visit);
    }
}

/// All rows walked, and nothing kept of them: non-zeros, and their sum.
fn walk(traversal: &impl Traversal<f64, 1>) -> (u64, f64) {
    let row = |row| {
        let (mut count, mut sum) = (0, 0.0);
        traversal.walk(row, &mut |_, [weight]| {
            count += 1;
            sum += weight;
        });
        (count, sum)
    };
    let rows = (0..traversal.rows()).into_par_iter().with_min_len(64).map(row);
    rows.reduce(|| (0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1))
}

/// Bytes of vectors of so many elements.
fn bytes(lens: &[usize]) -> u64 {
    (lens.iter().sum::<usize>() * size_of_val(&[0.0f32; 3])) as u64
}

/// Both products and the squares of rows that are kept, or walked.
type Product<T> = fn(&Transport<T, f32, 1>, &mut CpuVector, &mut CpuVector);

fn consumers<T: Traversal<f64, 1> + Clone>(
    rates: &mut Rates,
    name: &str,
    tiles: Tiles,
    make: impl FnOnce() -> (T, Tiling),
) {
    let made = LazyCell::new(make);
    let plan = LazyCell::new(|| WalkPlan::new::<1>(&made.0));
    let operator = |strategy| Transport::new(made.0.clone(), &plan, strategy, u64::MAX).unwrap();
    let kept = LazyCell::new(|| operator(Strategy::Assembled));
    let walked = LazyCell::new(|| operator(Strategy::MatrixFree));
    let nonzeros = LazyCell::new(|| kept.storage().kept_nonzeros);
    let rays = || made.0.rows() as u64;

    rates.bench(name, "walk", || {
        (Work { rays: rays(), nonzeros: *nonzeros, ..Work::default() }, by_the_clock(|| walk(&made.0)))
    });
    rates.bench(name, "assemble", || {
        let bytes = kept.storage().bytes;
        let work = Work { rays: rays(), nonzeros: *nonzeros, bytes, ..Work::default() };
        (work, by_the_clock(|| operator(Strategy::Assembled)))
    });
    let products: [(&str, Product<T>); 3] = [
        ("gather", |operator, x, y| operator.apply(x, y).unwrap()),
        ("scatter", |operator, x, y| operator.apply_adjoint(y, x).unwrap()),
        ("squares", |operator, x, y| *x = operator.squares(y).unwrap()),
    ];
    for (way, operator) in [("kept", &kept as &dyn Deref<Target = _>), ("walked", &walked)] {
        for (product, apply) in products {
            rates.bench(name, &format!("{product}, {way}"), || {
                let operator: &Transport<T, f32, 1> = operator;
                let (mut x, mut y) = (operator.domain(), operator.range());
                x.fill([1.0, 0.5, 0.25]);
                y.fill([1.0, 0.5, 0.25]);
                let bytes = operator.storage().bytes + bytes(&[x.len(), y.len()]);
                let work = Work { rays: rays(), nonzeros: *nonzeros, bytes, ..Work::default() };
                let round: Round = by_the_clock(move || apply(operator, &mut x, &mut y));
                (work, round)
            });
        }
    }
    if tiles == Tiles::OfWeights {
        rates.bench(name, "tiles", || {
            let (ones, added) = (vec![1.0; made.0.rows()], vec![1e-6; made.0.elements()]);
            let (kept, tiling) = (&*kept, &made.1);
            let tiles = move || TileMetric::new(kept, tiling, &ones, &added).unwrap();
            let work = Work { rays: rays(), nonzeros: *nonzeros, bytes: tiles().bytes(), ..Work::default() };
            (work, by_the_clock(tiles))
        });
    }
    rates.bench(name, "triplets", || {
        let few = Few(&made.0);
        let (nonzeros, _) = walk(&few);
        let bytes = nonzeros * 16 + 8 * (few.rows() as u64 + 1);
        let work = Work { rays: few.rows() as u64, nonzeros, bytes, ..Work::default() };
        (work, by_the_clock(move || ExplicitMatrix::new(&few, u64::MAX).unwrap()))
    });
}

type OfVolume = fn(&OnHost, &mut CpuVector, &mut CpuVector);

/// What takes the place of rows that do not fit: bytes are those of the factor that is kept, and of the vectors.
fn light_volumes(rates: &mut Rates, problem: &impl Deref<Target = VolumeProblem>) {
    let products: [(&str, OfVolume); 2] = [
        ("gather", |operator, x, y| operator.apply(x, y).unwrap()),
        ("scatter", |operator, x, y| operator.apply_adjoint(y, x).unwrap()),
    ];
    for (product, apply) in products {
        rates.bench("light volumes", product, || {
            let operator = problem.on_cpu(Strategy::MatrixFree, u64::MAX).unwrap();
            let (mut x, mut y) = (operator.domain(), operator.range());
            x.fill([1.0, 0.5, 0.25]);
            y.fill([1.0, 0.5, 0.25]);
            let VolumeRows::Lights(lit) = &problem.traversal else { unreachable!("rows of lights") };
            let bytes = lit.bytes() + bytes(&[x.len(), y.len()]);
            let work =
                Work { rays: y.len() as u64, nonzeros: problem.plan().nonzeros, bytes, ..Work::default() };
            (work, by_the_clock(move || apply(&operator, &mut x, &mut y)))
        });
    }
}
