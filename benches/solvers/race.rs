use std::time::Instant;

use unscatter::operator::{CpuVector, LinearOperator};
use unscatter::scene::{MetricName, SolverName};
use unscatter::solve::{LeastSquares, Measure, Method};

/// Residuals that are waited for.
pub(crate) const LEVELS: [f64; 4] = [1e-2, 1e-3, 1e-4, 1e-6];

/// Iterations without any progress after which a method is given up.
const STALLED: usize = 400;

/// Who runs, and how far.
pub(crate) struct Race {
    pub(crate) solver: SolverName,
    pub(crate) metric: MetricName,
    pub(crate) most: f64,
    /// The one channel that counts; the worst of all where there is none.
    pub(crate) channel: Option<usize>,
}

/// How a race went.
pub(crate) struct Course {
    /// Applications and seconds until the iterate was there that reached a level. What only looks at its residual counts with
    /// the next one.
    pub(crate) reached: [Option<(usize, f64)>; LEVELS.len()],
    /// The residual where it ended.
    pub(crate) last: f64,
}

impl Race {
    /// Runs a method by hand, so that nothing but its own work is counted and timed. `seconds` have been spent before.
    pub(crate) fn run<O: LinearOperator<Domain = CpuVector>>(
        &self,
        method: &mut dyn Method<O>,
        problem: &LeastSquares<O>,
        start: &CpuVector,
        reference: &Measure,
        mut seconds: f64,
    ) -> Course {
        let mut reached = [None; LEVELS.len()];
        let before = problem.applications();
        let clock = Instant::now();
        method.begin(problem, start).unwrap();
        seconds += clock.elapsed().as_secs_f64();
        let (mut at_hand, mut least, mut stalled) = (0, f64::INFINITY, 0);
        loop {
            let worst = |norms: [f64; 3]| {
                let ratio = |c: usize| (norms[c] / reference.normal_residual[c]).sqrt();
                match self.channel {
                    Some(c) => ratio(c),
                    None => (0..3).map(ratio).fold(0.0, f64::max),
                }
            };
            // The truth takes two applications, so it is asked for only where the method believes to have got somewhere.
            let mut last = worst(method.measure().normal_residual);
            let next = LEVELS.iter().zip(&reached).find(|(_, reached)| reached.is_none());
            let spent = problem.applications() - before;
            if next.is_none_or(|(level, _)| last <= 1.2 * level) || spent as f64 >= self.most {
                last = worst(crate::residuals(problem, method.solution()));
            }
            for (level, reached) in LEVELS.iter().zip(&mut reached) {
                if last <= *level && reached.is_none() {
                    *reached = Some((at_hand, seconds));
                }
            }
            stalled = if last < 0.99 * least { 0 } else { stalled + 1 };
            least = least.min(last);
            if last <= LEVELS[LEVELS.len() - 1]
                || spent as f64 >= self.most
                || stalled > STALLED
                || !last.is_finite()
            {
                return Course { reached, last };
            }
            let clock = Instant::now();
            method.step(problem, [true; 3]).unwrap();
            seconds += clock.elapsed().as_secs_f64();
            at_hand = problem.applications() - before - self.looking();
        }
    }

    /// Applications at the end of an iteration that give the residual of the iterate and not the iterate: FISTA computes both
    /// r and g anew, the others recur r.
    fn looking(&self) -> usize {
        if self.solver == SolverName::Fista { 2 } else { 1 }
    }

    pub(crate) fn print(&self, course: &Course) {
        let metric = match (self.solver, self.metric) {
            (SolverName::FlexibleCgls | SolverName::Lsqr | SolverName::Lsmr, _) | (_, MetricName::None) => {
                "none"
            }
            (_, MetricName::Auto | MetricName::Tiles) => "tiles",
            (_, MetricName::Sqs) => "SQS",
            (_, MetricName::Jacobi) => "Jacobi",
        };
        row(&format!("`{}` | {metric}", self.solver.name()), course);
    }
}

pub(crate) fn header() {
    println!("| method | metric | 1e-2 | 1e-3 | 1e-4 | 1e-6 | at the end |");
    println!("|---|---|---|---|---|---|---|");
}

pub(crate) fn row(name: &str, course: &Course) {
    let cells = course.reached.map(|reached| match reached {
        Some((applications, seconds)) => format!("{applications} ({seconds:.2})"),
        None => "–".to_owned(),
    });
    println!("| {name} | {} | {:.1e} |", cells.join(" | "), course.last);
}
