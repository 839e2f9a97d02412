//! The yardstick: steepest descent with the exact step, no scaling.

use unscatter::Result;
use unscatter::operator::{CpuVector, LinearOperator, TransportOperator, Vector};
use unscatter::problem::{LightMapProblem, Problem, System, measure};
use unscatter::scene::{MetricName, Scene, SolverName};
use unscatter::solve::{LeastSquares, Live, Measure, Method, MethodMemory, Vectors};

use crate::race::{Race, row};

struct GradientDescent<O: LinearOperator> {
    x: O::Domain,
    g: O::Domain,
    r: O::Range,
    q: O::Range,
}

impl<O: LinearOperator> Method<O> for GradientDescent<O> {
    fn name(&self) -> &'static str {
        "gradient descent"
    }

    fn keeps_bounds(&self) -> bool {
        false
    }

    fn vectors(&self) -> Vectors {
        Vectors { domain: 2, range: 2 }
    }

    fn begin(&mut self, problem: &LeastSquares<O>, x: &O::Domain) -> Result<()> {
        self.x.copy_from(x);
        problem.residual(&self.x, &mut self.r)?;
        problem.gradient(&self.r, &mut self.g)
    }

    fn step(&mut self, problem: &LeastSquares<O>, _: Live) -> Result<()> {
        problem.apply(&self.g, &mut self.q)?;
        let (slope, curvature) = (self.g.norm_squared()?, self.q.norm_squared()?);
        let step = std::array::from_fn(|c| if curvature[c] > 0.0 { slope[c] / curvature[c] } else { 0.0 });
        self.x.axpby(step.map(|step: f64| -step), &self.g, [1.0; 3]);
        self.r.axpby(step, &self.q, [1.0; 3]);
        problem.gradient(&self.r, &mut self.g)
    }

    fn solution(&self) -> &O::Domain {
        &self.x
    }

    fn measure(&self) -> Measure {
        Measure { residual: [0.0; 3], normal_residual: [0.0; 3] }
    }

    fn residual(&self) -> Option<&O::Range> {
        Some(&self.r)
    }

    fn memory(&mut self) -> MethodMemory<'_, O> {
        MethodMemory { domain: vec![&mut self.x], range: vec![&mut self.r], scalars: Vec::new() }
    }
}

pub(crate) fn print(scene: &Scene, problem: &LightMapProblem, most: f64) {
    let operator = problem.on_cpu(scene.solve.strategy, u64::MAX).unwrap();
    let coverage = operator.squares(&problem.weights()).unwrap();
    let mut settings = scene.solve.clone();
    settings.solver = SolverName::Cgls;
    let system =
        System::new(&problem.formulation(&settings).unwrap(), &operator, &coverage, &settings).unwrap();
    let least_squares = system.problem();
    let reference = measure(&least_squares, system.start()).unwrap();
    let o = system.operator();
    let mut method = GradientDescent { x: o.domain(), g: o.domain(), r: o.range(), q: o.range() };
    let race = Race { solver: SolverName::Cgls, metric: MetricName::None, most, channel: None };
    let start: &CpuVector = system.start();
    row("gradient descent | none", &race.run(&mut method, &least_squares, start, &reference, 0.0));
}
