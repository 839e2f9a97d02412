//! Random sparse problems with rows that contradict each other: more rows than unknowns, fewer, and of low rank.

use unscatter::cpu::{TileMetric, Transport};
use unscatter::march::{Traversal, Weight};
use unscatter::operator::{
    Blocks, Bounds, CpuVector, Identity, LinearOperator, Scaling, Stacked, Tiling, Vector, WalkPlan,
};
use unscatter::problem::{measure, method};
use unscatter::scene::{MetricName, SolverName, Strategy};
use unscatter::solve::LeastSquares;

use crate::race::{self, Race};
use crate::scenes::Numbers;

/// Rows of a few runs of neighbouring elements, as rays give them.
#[derive(Clone)]
struct Runs {
    rows: usize,
    elements: usize,
    runs: usize,
    /// Rows that are different; the others repeat them.
    rank: usize,
}

impl Traversal<f64, 1> for Runs {
    fn rows(&self) -> usize {
        self.rows
    }

    fn elements(&self) -> usize {
        self.elements
    }

    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f64, 1>)) {
        let mut n = Numbers(((row % self.rank) as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let stride = self.elements / self.runs;
        for run in 0..self.runs {
            let length = 1 + (n.uniform(0.0, 1.0) * 24.0) as usize;
            let first = run * stride + (n.uniform(0.0, 1.0) * (stride - length) as f64) as usize;
            let weight = n.uniform(0.0, 1.0).powi(3);
            (first..first + length)
                .for_each(|element| visit(element, [weight * (0.2 + n.uniform(0.0, 1.0))]));
        }
    }
}

pub(crate) fn table(most: f64) {
    for (name, rows, elements, rank) in [
        ("random, 6,000 × 2,000", 6000, 2000, 6000),
        ("random, 2,000 × 6,000", 2000, 6000, 2000),
        ("random, 4,000 × 4,000 of rank 400", 4000, 4000, 400),
    ] {
        println!("### {name}, x ≥ 0\n");
        let traversal = Runs { rows, elements, runs: 6, rank };
        let plan = WalkPlan::new::<1>(&traversal);
        let operator = Transport::<_, f32, 1>::new(traversal, &plan, Strategy::Auto, u64::MAX).unwrap();
        let coverage = operator.squares(&CpuVector(vec![[1.0; 3]; rows])).unwrap();
        let mean = coverage.0.iter().map(|texel| f64::from(texel[0])).sum::<f64>() / elements as f64;
        let root = (mean * f64::powi(2.0, -9)).sqrt();
        let mut start = operator.domain();
        start.fill([1.0; 3]);
        let stacked = Stacked::new(&operator).over(Identity::scaled(&start, [root; 3])).unwrap();
        let mut n = Numbers(7);
        let targets =
            CpuVector((0..rows).map(|_| std::array::from_fn(|_| 6.0 * n.uniform(0.0, 1.0) as f32)).collect());
        let mut pulled = start.clone();
        pulled.scale([root; 3]);
        let rhs = Blocks::new(targets, vec![pulled]);
        let (mut ones, mut sums) = (start.clone(), stacked.range());
        ones.fill([1.0; 3]);
        stacked.apply(&ones, &mut sums).unwrap();
        stacked.apply_adjoint(&sums, &mut ones).unwrap();
        let scaling = Scaling::new(ones, true);
        race::header();
        for solver in SolverName::ALL.into_iter().filter(|solver| solver.keeps_bounds()) {
            let problem = LeastSquares::new(&stacked, &rhs).bounded(Bounds::NOT_NEGATIVE).measured(&scaling);
            let reference = measure(&problem, &start).unwrap();
            let race = Race { solver, metric: MetricName::Sqs, most, channel: None };
            let mut method = method(solver, &stacked);
            race.print(&race.run(&mut *method, &problem, &start, &reference, 0.0));
        }
        // Tiles of 64 elements in a row.
        let columns: Vec<u32> = (0..elements as u32).collect();
        let tiling = Tiling::new([8, elements.div_ceil(8)], &columns);
        let weights = vec![1.0; rows];
        let added = vec![root * root; elements];
        let tiles = TileMetric::new(&operator, &tiling, &weights, &added).unwrap();
        let problem = LeastSquares::new(&stacked, &rhs).bounded(Bounds::NOT_NEGATIVE).measured(&tiles);
        let reference = measure(&problem, &start).unwrap();
        let race = Race { solver: SolverName::Fista, metric: MetricName::Tiles, most, channel: None };
        let mut method = method(SolverName::Fista, &stacked);
        race.print(&race.run(&mut *method, &problem, &start, &reference, 0.0));
        println!();
    }
}
