//! Against SciPy: `tests/fixtures/solvers/make.py` made the reference numbers.

use std::path::Path;

use nalgebra::DMatrix;
use serde_json::Value;
use unscatter::operator::{
    Blocks, Bounds, CpuVector, Identity, LinearOperator, Scaling, Stacked, Vector, Weighted,
};
use unscatter::solve::{Cgls, Fista, Lbfgs, LeastSquares, Limits, Lsmr, Lsqr, Method, Mprgp, Spectral};

use super::{Dense, objective, run};
use crate::tolerances::{SCIPY_OBJECTIVE, SCIPY_X};

struct Fixture {
    name: String,
    matrix: DMatrix<f64>,
    weights: Vec<f64>,
    b: Vec<[f64; 3]>,
    x0: Vec<[f64; 3]>,
    variants: Vec<Variant>,
}

struct Variant {
    label: String,
    lambda: f64,
    lower: f64,
    upper: f64,
    objective: [f64; 3],
    x: Vec<[f64; 3]>,
    determined: Vec<[bool; 3]>,
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

fn colors(value: &Value) -> Vec<[f64; 3]> {
    value.as_array().unwrap().iter().map(|color| numbers(color).try_into().unwrap()).collect()
}

impl Fixture {
    fn read(path: &Path) -> Self {
        let json: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
        let size = |key: &str| json[key].as_u64().unwrap() as usize;
        let (rows, columns) = (size("rows"), size("columns"));
        let (starts, indices, data) =
            (numbers(&json["indptr"]), numbers(&json["indices"]), numbers(&json["data"]));
        let mut matrix = DMatrix::zeros(rows, columns);
        for row in 0..rows {
            for entry in starts[row] as usize..starts[row + 1] as usize {
                matrix[(row, indices[entry] as usize)] = data[entry];
            }
        }
        let variant = |json: &Value| Variant {
            label: json["label"].as_str().unwrap().to_owned(),
            lambda: json["lambda"].as_f64().unwrap(),
            lower: json["lower"].as_f64().unwrap_or(f64::NEG_INFINITY),
            upper: json["upper"].as_f64().unwrap_or(f64::INFINITY),
            objective: numbers(&json["objective"]).try_into().unwrap(),
            x: colors(&json["x"]),
            determined: json["determined"]
                .as_array()
                .unwrap()
                .iter()
                .map(|flags| std::array::from_fn(|c| flags[c].as_bool().unwrap()))
                .collect(),
        };
        Self {
            name: path.file_stem().unwrap().to_string_lossy().into_owned(),
            matrix,
            weights: numbers(&json["weights"]),
            b: colors(&json["b"]),
            x0: colors(&json["x0"]),
            variants: json["variants"].as_array().unwrap().iter().map(variant).collect(),
        }
    }
}

fn fixtures() -> Vec<Fixture> {
    let folder = crate::root().join("tests/fixtures/solvers");
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "json"))
        .collect();
    files.sort();
    assert_eq!(files.len(), 8);
    files.iter().map(|path| Fixture::read(path)).collect()
}

/// Solves every variant with every method that ends at its solution, and hands over what was found.
fn each(mut check: impl FnMut(&str, &Variant, &CpuVector<f64>, [f64; 3])) {
    for fixture in fixtures() {
        for variant in &fixture.variants {
            let dense = Dense::new(fixture.matrix.clone());
            let roots = CpuVector(fixture.weights.iter().map(|w| [w.sqrt(); 3]).collect());
            let weighted = Weighted::new(&dense, roots).unwrap();
            let (mut b, x0) = (CpuVector(fixture.b.clone()), CpuVector(fixture.x0.clone()));
            weighted.weigh(&mut b);
            let root = [variant.lambda.sqrt(); 3];
            let mut pulled = x0.clone();
            pulled.scale(root);
            let stacked = Stacked::new(weighted).over(Identity::scaled(&x0, root)).unwrap();
            let rhs = Blocks(vec![b, pulled]);
            // The transport has no negative weight.
            let (mut ones, mut sums) = (stacked.domain(), stacked.range());
            ones.fill([1.0; 3]);
            stacked.apply(&ones, &mut sums).unwrap();
            stacked.apply_adjoint(&sums, &mut ones).unwrap();
            let scaling = Scaling::new(ones, true);
            let bounds = Bounds::new([variant.lower; 3], [variant.upper; 3]).unwrap();
            let plain = LeastSquares::new(&stacked, &rhs).bounded(bounds.clone());
            let methods: Vec<Box<dyn Method<_> + '_>> = if bounds == Bounds::NONE {
                // Without a metric, because that would change which solution is nearest to the start.
                vec![
                    Box::new(Cgls::new(&stacked)),
                    Box::new(Lsqr::new(&stacked)),
                    Box::new(Lsmr::new(&stacked)),
                ]
            } else {
                vec![
                    Box::new(Fista::new(&stacked)),
                    Box::new(Spectral::new(&stacked)),
                    Box::new(Lbfgs::new(&stacked)),
                    Box::new(Mprgp::new(&stacked)),
                ]
            };
            for mut method in methods {
                let problem = LeastSquares::new(&stacked, &rhs).bounded(bounds.clone());
                let problem = if bounds == Bounds::NONE { problem } else { problem.measured(&scaling) };
                // Plain gradient steps are too slow for a condition of a million.
                if method.name() == "spectral" && fixture.name.starts_with("hilbert") {
                    continue;
                }
                let outcome = run(&mut *method, &problem, &x0, &Limits::new(100_000, 1e-13));
                let stop = outcome.stop;
                let name = format!("{}, {}, {} ({stop:?})", fixture.name, variant.label, method.name());
                check(&name, variant, method.solution(), objective(&plain, method.solution()));
            }
        }
    }
}

#[test]
fn objectives_and_determined_elements_agree_with_scipy() {
    let (mut cases, mut elements) = (0, 0);
    let mut failures = Vec::new();
    each(|name, variant, x, objective| {
        cases += 1;
        for c in 0..3 {
            let difference = (objective[c] - variant.objective[c]).abs() / variant.objective[c].max(1e-12);
            if difference > SCIPY_OBJECTIVE {
                failures.push(format!("{name}, channel {c}: objective off by {difference:.1e}"));
            }
            let scale = variant.x.iter().map(|x| x[c].abs()).fold(0.0, f64::max).max(1e-12);
            let differences = x.0.iter().zip(&variant.x).zip(&variant.determined);
            let determined = differences.filter(|(_, determined)| determined[c]);
            let worst = determined
                .inspect(|_| elements += 1)
                .map(|((x, truth), _)| (x[c] - truth[c]).abs() / scale)
                .fold(0.0, f64::max);
            if worst > SCIPY_X {
                failures.push(format!("{name}, channel {c}: x off by {worst:.1e}"));
            }
        }
    });
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(cases > 60 && elements > 5000, "{cases} {elements}");
}

#[test]
fn a_reference_that_is_wrong_is_noticed() {
    let mut worst = f64::INFINITY;
    each(|_, variant, _, objective| {
        let wrong = variant.objective[0] * 1.0001;
        worst = worst.min((objective[0] - wrong).abs() / wrong.max(1e-12));
    });
    assert!(worst > SCIPY_OBJECTIVE);
}
