//! What a solve would take.

use std::collections::BTreeMap;
use std::time::Instant;

use serde::Serialize;

use super::asked::AskedProblem;
use super::findings::share;
use crate::Result;
use crate::operator::{LinearOperator, Vector};
use crate::problem::{Problem, near};
use crate::report::Share;
use crate::scene::Strategy;

/// Rows that are timed.
const SAMPLE: usize = 16384;
/// How often they are timed.
const TRIALS: usize = 3;

/// What the solve of a light map, or of one stage of a volume, would take, without doing it.
#[derive(Debug, Clone, Serialize)]
pub struct Plan {
    /// What the scene is called.
    pub scene: String,
    /// What is looked for.
    pub find: &'static str,
    /// What the elements are, such as `texels`.
    pub unit: &'static str,
    /// The scene's views.
    pub views: usize,
    /// Their pixels.
    pub pixels: usize,
    /// Pixels of which something is wanted.
    pub rows: usize,
    /// Elements that could be looked for.
    pub candidates: usize,
    /// Elements that are looked for, as far as a row reaches them.
    pub unknowns: usize,
    /// Those of them that have no place beside others, such as lights around a light map.
    pub surrounding_unknowns: usize,
    /// What those are; empty where there are none.
    pub surrounding_unit: &'static str,
    /// What is not computed because nothing depends on it.
    pub skipped: BTreeMap<String, Share>,
    /// Bytes of what rays meet: shadow maps, light volumes, weights beside the matrix.
    pub prepared_bytes: u64,
    /// Foreseen from a sample of the rows.
    pub nonzeros: u64,
    /// Bytes of the matrix, if it is kept.
    pub matrix_bytes: u64,
    /// Bytes of everything else.
    pub other_bytes: u64,
    /// Bytes that may be used.
    pub budget_bytes: u64,
    /// `assembled`, `mixed`, `matrix-free`, `epipolar` or `light volumes`.
    pub strategy: &'static str,
    /// Share of the rows that is kept.
    pub kept: f64,
    /// Seconds before the first iteration, of all stages.
    pub set_up_seconds: f64,
    /// Seconds that keeping the rows takes, once a solve.
    pub keeping_seconds: f64,
    /// Seconds of both products.
    pub seconds_per_iteration: f64,
    /// Iterations at most, of one solve.
    pub iterations: usize,
    /// Solves at most: steps of a refinement, and rounds.
    pub solves: usize,
}

impl Plan {
    pub(super) fn of(asked: AskedProblem) -> Result<Self> {
        let AskedProblem { scene, find, views, pixels, problem, settings, memory, solves, seconds } = asked;
        let settings = memory.settled(settings, &*problem)?;
        let near = near(&*problem, settings.strategy)?;
        let iterated = near.as_deref().unwrap_or(&*problem);
        let (budget, bytes) = (memory.budget(&settings, iterated)?, problem.kept_bytes());
        // Lights that do not fit are not kept in part: light volumes take their place.
        let walked = problem.sampled(1).on_cpu(Strategy::MatrixFree, budget)?.storage();
        let kept = match settings.strategy {
            Strategy::MatrixFree => 0.0,
            Strategy::Auto if walked.of_light_volumes && bytes > budget => 0.0,
            _ => (budget as f64 / bytes.max(1) as f64).min(1.0),
        };
        let formulation = problem.formulation(&settings)?;
        let [keeping_seconds, mut seconds_per_iteration] = foreseen_seconds(&*problem, kept)?;
        if let Some(near) = &near {
            seconds_per_iteration = least_seconds(&near.on_cpu(settings.strategy, budget)?)?;
        }
        let around = formulation.parts.iter().filter(|part| part.lattice.is_none());
        Ok(Self {
            unit: formulation.parts.first().map_or("", |part| part.noun),
            rows: problem.rows(),
            candidates: problem.candidates(),
            unknowns: formulation.elements(),
            surrounding_unit: around.clone().next().map_or("", |part| part.noun),
            surrounding_unknowns: around.map(|part| part.start.len()).sum(),
            skipped: problem.skipped().into_iter().map(share).collect(),
            prepared_bytes: iterated.prepared_bytes(),
            nonzeros: problem.plan().nonzeros,
            matrix_bytes: bytes,
            other_bytes: memory.beside_rows(&settings, iterated)?,
            budget_bytes: memory.allowed,
            strategy: match kept {
                _ if near.is_some() => "epipolar",
                0.0 if walked.of_light_volumes => "light volumes",
                0.0 => "matrix-free",
                1.0 => "assembled",
                _ => "mixed",
            },
            kept,
            set_up_seconds: seconds,
            keeping_seconds,
            seconds_per_iteration,
            iterations: settings.iterations,
            solves,
            scene,
            find,
            views,
            pixels,
        })
    }
}

impl Plan {
    /// Seconds of all iterations of all solves at most, once everything is set up.
    pub fn most_seconds(&self) -> f64 {
        self.solves as f64 * (self.keeping_seconds + self.iterations as f64 * self.seconds_per_iteration)
    }
}

/// Times keeping the rows and both products on samples of the rows, kept and walked.
///
/// Part of the cost does not depend on the rows, so it takes two samples to foresee that of all.
fn foreseen_seconds(problem: &dyn Problem, kept: f64) -> Result<[f64; 2]> {
    let seconds = |strategy: Strategy| -> Result<[f64; 2]> {
        let timed = |rows| -> Result<(f64, [f64; 2])> {
            let sample = problem.sampled(rows);
            let clock = Instant::now();
            let operator = sample.on_cpu(strategy, u64::MAX)?;
            let keeping = clock.elapsed().as_secs_f64();
            Ok((sample.rows() as f64, [keeping, least_seconds(&operator)?]))
        };
        let (few, many) = (timed(SAMPLE / 4)?, timed(SAMPLE)?);
        let of_all = |i: usize| {
            let more = (many.1[i] - few.1[i]).max(0.0);
            let slope = if many.0 > few.0 { more / (many.0 - few.0) } else { 0.0 };
            many.1[i] + slope * (problem.rows() as f64 - many.0)
        };
        Ok([of_all(0), of_all(1)])
    };
    let mut sums = [0.0; 2];
    for (share, strategy) in [(kept, Strategy::Assembled), (1.0 - kept, Strategy::MatrixFree)] {
        if share > 0.0 {
            let seconds = seconds(strategy)?;
            (0..2).for_each(|i| sums[i] += share * seconds[i]);
        }
    }
    Ok(sums)
}

/// The least seconds that both products took in a few trials.
fn least_seconds(operator: &impl LinearOperator) -> Result<f64> {
    let (mut x, mut y) = (operator.domain(), operator.range());
    x.fill([1.0; 3]);
    let mut least = f64::INFINITY;
    for _ in 0..TRIALS {
        let clock = Instant::now();
        operator.apply(&x, &mut y)?;
        operator.apply_adjoint(&y, &mut x)?;
        least = least.min(clock.elapsed().as_secs_f64());
    }
    Ok(least)
}
