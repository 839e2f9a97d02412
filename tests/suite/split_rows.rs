//! Rows and elements may be vectors of different types, as they will be where rows are distributed.

use unscatter::Result;
use unscatter::operator::{
    Blocks, CpuVector, LinearOperator, Metric, OnHost, Stacked, Storage, Tiling, TransportOperator, Vector,
};
use unscatter::problem::{LightMapProblem, Problem, Solved, solve};
use unscatter::scene::{MetricName, SolveSettings, Strategy};
use unscatter::solve::Control;

/// Rows in two vectors, one above the other; the elements are one vector.
struct Halves {
    rows: Stacked<'static, CpuVector>,
    parts: [OnHost; 2],
}

impl Halves {
    fn of(problem: &LightMapProblem) -> Self {
        let (rows, middle) = (problem.rows(), problem.rows() / 3);
        let part = |rows: Vec<usize>| problem.picked(&rows).on_cpu(Strategy::Auto, u64::MAX).unwrap();
        let parts = || [part((0..middle).collect()), part((middle..rows).collect())];
        let [upper, lower] = parts();
        Self { rows: Stacked::new(upper).over(lower).unwrap(), parts: parts() }
    }
}

impl LinearOperator for Halves {
    type Domain = CpuVector;
    type Range = Blocks<CpuVector>;

    fn domain(&self) -> CpuVector {
        self.rows.domain()
    }

    fn range(&self) -> Blocks<CpuVector> {
        self.rows.range()
    }

    fn apply(&self, x: &CpuVector, y: &mut Blocks<CpuVector>) -> Result<()> {
        self.rows.apply(x, y)
    }

    fn apply_adjoint(&self, y: &Blocks<CpuVector>, x: &mut CpuVector) -> Result<()> {
        self.rows.apply_adjoint(y, x)
    }
}

impl TransportOperator for Halves {
    fn squares(&self, weights: &CpuVector) -> Result<CpuVector> {
        let [upper, lower] = &self.parts;
        let (of_upper, of_lower) = weights.0.split_at(upper.range().len());
        let mut squares = upper.squares(&CpuVector(of_upper.to_vec()))?;
        squares.axpby([1.0; 3], &lower.squares(&CpuVector(of_lower.to_vec()))?, [1.0; 3]);
        Ok(squares)
    }

    fn tile_metric(&self, _: &Tiling, _: &[f64], _: &[f64]) -> Result<Box<dyn Metric<CpuVector>>> {
        unreachable!("the test asks for another metric")
    }

    fn storage(&self) -> Storage {
        Storage::default()
    }
}

#[test]
fn rows_in_two_vectors_have_the_solution_of_rows_in_one() {
    let scene = unscatter::io::scene_file::load(
        &crate::root().join("strokes/citadel.json"),
        &["light_map.size=64".to_owned(), "solve.noise=0.2".to_owned()],
    )
    .unwrap();
    let problem = LightMapProblem::new(&scene).unwrap();
    let settings = SolveSettings { metric: MetricName::Sqs, iterations: 12, ..scene.solve.clone() };
    fn solved(
        problem: &LightMapProblem,
        operator: &impl TransportOperator,
        settings: &SolveSettings,
    ) -> Solved {
        let coverage = operator.squares(&problem.weights()).unwrap();
        solve(problem, operator, &coverage, settings, None, |_, _| Ok(Control::Continue)).unwrap()
    }
    let whole = solved(&problem, &problem.on_cpu(Strategy::Auto, u64::MAX).unwrap(), &settings);
    let split = solved(&problem, &Halves::of(&problem), &settings);
    assert_eq!(whole.columns, split.columns);
    assert_eq!(whole.outcome.stop.reason, split.outcome.stop.reason);
    let square = |a: &[[f32; 3]], b: &[[f32; 3]]| -> f64 {
        a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| f64::from(a - b).powi(2)).sum()
    };
    let zero = vec![[0.0; 3]; whole.x.len()];
    let apart = (square(&whole.x, &split.x) / square(&whole.x, &zero)).sqrt();
    assert!(apart < 1e-5, "{apart}");
}
