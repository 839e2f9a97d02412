//! Conditions from 1 to 1e12, rank deficiency, inconsistent and noisy targets, repeated views, and nothing to do.

use nalgebra::DMatrix;

use super::case::{Case, Measurements, Setting};
use super::dense::{DenseProblem, Ended, Listed, channel, colors, conditioned, image, random};
use super::rows::{RandomNumbers, WorldPlace, random_light_map, relative, worse};
use super::solved::{Question, certificate};
use crate::march::{LightMapTraversal, Traversal, Weight};
use crate::operator::{Bounds, CpuVector, LinearOperator};
use crate::scene::{Basis, SolverName};
use crate::solve::{Limits, StopReason};
use crate::{Error, Result};

pub(super) const CASES: [Case; 8] = [
    Case {
        name: "solve/condition",
        law: "a solve ends with a reason, and its certificate is true; every method, condition 1 to 1e12",
        why: "rounding of A'(Ax - b) in f64, of as many terms as A has",
        run: condition,
    },
    Case {
        name: "solve/rank-deficient",
        law: "without bounds and pull, what is found is the solution nearest to the start",
        why: "distance: certificate / least singular value^2 that is not zero; in f64",
        run: rank_deficient,
    },
    Case {
        name: "solve/unreached",
        law: "an element that no row reaches keeps its start to the bit, and two equal columns move alike",
        why: "0; equal columns: twice certificate / pull",
        run: unreached,
    },
    Case {
        name: "solve/inconsistent",
        law: "targets that contradict each other are missed as far as dense least squares miss them",
        why: "strong convexity: |r|^2 - |r*|^2 is at most (certificate / least singular value)^2",
        run: inconsistent,
    },
    Case {
        name: "solve/noise",
        law: "with noise of 5 %, a solve that is told so ends where the targets are met to 5 %",
        why: "the discrepancy is confirmed to half of its square",
        run: noise,
    },
    Case {
        name: "solve/repeated-views",
        law: "the same views seven times give the light map of one",
        why: "certificate / pull of both, in f32",
        run: repeated_views,
    },
    Case {
        name: "solve/nothing-to-do",
        law: "where the start solves, or the matrix is zero, a solve ends at once and moves nothing",
        why: "0",
        run: nothing_to_do,
    },
    Case {
        name: "solve/not-a-number",
        law: "targets that are no numbers are an error that says so, never a light map",
        why: "an error",
        run: not_a_number,
    },
];

const CONDITIONS: [f64; 13] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12];
const UNBOUNDED: [SolverName; 3] = [SolverName::Cgls, SolverName::Lsqr, SolverName::Lsmr];

fn place(name: SolverName, ended: &Ended) -> String {
    let stop = ended.outcome.stop;
    format!("{}, {} after {}", name.name(), stop.reason.name(), stop.iteration)
}

/// What a method in f64 claims is true, and what is called converged is.
fn honest(measurements: &mut Measurements, place: &str, ended: &Ended, tolerance: f64) {
    let slack = ended.rounding + 1e-12 * ended.truth;
    measurements.within(place, (ended.truth - ended.claimed).abs(), slack);
    if ended.outcome.stop.reason == StopReason::Tolerance {
        measurements.within(place, ended.truth, 1.5 * tolerance + slack);
    }
}

fn condition(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let iterations = if setting.quick { 200 } else { 2000 };
    for condition in setting.some(&CONDITIONS) {
        let matrix = conditioned(24, 16, condition, 5);
        let b = image(&matrix, &colors(16, 9));
        let problem = DenseProblem { matrix, b, x0: vec![[1.0; 3]; 16], bounds: Bounds::NOT_NEGATIVE };
        for name in SolverName::ALL {
            let ended = match problem.run(setting, name, &Limits::new(iterations, 1e-10)) {
                // The papers' variant may diverge (docs/solvers.md); then it must say so.
                Err(error @ Error::NonFinite { .. }) if name == SolverName::ClampedCgls => {
                    measurements.must(format!("condition {condition:e}, {}, {error}", name.name()), true);
                    continue;
                }
                ended => ended?,
            };
            let place = format!("condition {condition:e}, {}", place(name, &ended));
            honest(measurements, &place, &ended, 1e-10);
            if name != SolverName::ClampedCgls {
                let farther =
                    |c: usize| problem.residual(&ended.x, c) / problem.residual(&problem.x0, c) - 1.0;
                measurements.within(place, (0..3).map(farther).fold(0.0, worse), ended.rounding);
            }
        }
    }
    Ok(())
}

fn rank_deficient(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    for (rows, columns, rank) in setting.some(&[(20, 12, 6), (6, 15, 6), (9, 9, 1), (12, 12, 11)]) {
        let matrix = random(rows, rank, 3) * random(rank, columns, 4);
        let mut b = image(&matrix, &colors(columns, 8));
        // What lies outside the range must not matter.
        b.iter_mut().zip(colors(rows, 2)).for_each(|(b, other)| (0..3).for_each(|c| b[c] += 0.1 * other[c]));
        let problem = DenseProblem { matrix, b, x0: colors(columns, 6), bounds: Bounds::NONE };
        let factors = problem.matrix.clone().svd(true, true);
        let largest = factors.singular_values.max();
        let cut = 1e-10 * largest;
        let least = factors.singular_values.iter().copied().filter(|&s| s > cut).fold(largest, f64::min);
        for name in UNBOUNDED {
            let ended = problem.run(setting, name, &Limits::new(500, 1e-12))?;
            let (mut error, mut bound) = (0.0, 0.0_f64);
            for c in 0..3 {
                let x0 = channel(&problem.x0, c);
                let missing = channel(&problem.b, c) - &problem.matrix * &x0;
                let step =
                    factors.solve(&missing, cut).map_err(|reason| Error::Machine(reason.to_owned()))?;
                error = worse(error, (channel(&ended.x, c) - (x0 + step)).norm());
                bound = bound.max((ended.claimed + ended.rounding) * ended.at_start[c] / least.powi(2));
            }
            measurements.within(
                format!("{rows} x {columns}, rank {rank}, {}", place(name, &ended)),
                error,
                bound,
            );
        }
    }
    Ok(())
}

fn unreached(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let mut n = RandomNumbers(17);
    let mut matrix = DMatrix::from_fn(40, 24, |_, _| n.uniform(0.0, 1.0));
    [3, 11, 23].into_iter().for_each(|column| matrix.column_mut(column).fill(0.0));
    let same = matrix.column(5).into_owned();
    matrix.column_mut(17).copy_from(&same);
    let rows = Listed(matrix);
    for name in SolverName::ALL {
        let question = Question::answered_by(&rows, 1e-6)?.by(name);
        let answer = question.solved(setting, &rows)?;
        let (x, place) = (&answer.solved.x, format!("{}, {}", name.name(), answer.ending()));
        measurements.must(&place, [3, 11, 23].into_iter().all(|element: usize| x[element] == question.start));
        measurements.must(&place, answer.solved.columns.len() == 21);
        let gap = (0..3).map(|c| f64::from(x[5][c] - x[17][c]).abs()).fold(0.0, worse);
        measurements.within(&place, gap, 2.0 * answer.reach());
        certificate(measurements, name.name(), &answer, 1e-6);
    }
    Ok(())
}

fn inconsistent(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let matrix = random(30, 8, 21);
    let b: Vec<[f64; 3]> = {
        let mut n = RandomNumbers(22);
        (0..30).map(|_| std::array::from_fn(|_| n.uniform(-1.0, 1.0))).collect()
    };
    let problem = DenseProblem { matrix, b, x0: vec![[1.0; 3]; 8], bounds: Bounds::NOT_NEGATIVE };
    let least = problem.matrix.singular_values().min();
    for name in SolverName::ALL {
        let ended = problem.run(setting, name, &Limits::new(1000, 1e-8))?;
        for c in 0..3 {
            let truth = least_residual(&problem, c, name.keeps_bounds()).powi(2);
            let excess = problem.residual(&ended.x, c).powi(2) - truth;
            let allowed = ((ended.claimed + ended.rounding) * ended.at_start[c] / least).powi(2);
            // Below the least there is nothing but rounding.
            measurements.within(place(name, &ended), excess.abs() / truth, allowed / truth + 1e-13);
        }
    }
    Ok(())
}

/// The least ‖b − A x‖ of a channel, by factorization; with x ≥ 0 over all choices of which elements are not zero.
fn least_residual(problem: &DenseProblem, c: usize, not_negative: bool) -> f64 {
    let (columns, b) = (problem.matrix.ncols(), channel(&problem.b, c));
    let everything = (1usize << columns) - 1;
    let choices = if not_negative { 0..=everything } else { everything..=everything };
    let residual = |choice: usize| {
        let chosen: Vec<usize> = (0..columns).filter(|column| choice >> column & 1 == 1).collect();
        if chosen.is_empty() {
            return Some(b.norm());
        }
        let some = problem.matrix.select_columns(&chosen);
        let x = some.clone().qr();
        let x = x.r().solve_upper_triangular(&(x.q().transpose() * &b))?;
        (!not_negative || x.min() >= 0.0).then(|| (some * x - &b).norm())
    };
    choices.filter_map(residual).fold(f64::INFINITY, f64::min)
}

/// Rows that reach everything from many sides.
fn light_map() -> Result<LightMapTraversal> {
    random_light_map(4, 500, Basis::Bilinear, 0.5, &WorldPlace::PLAIN)
}

fn noise(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    const NOISE: f64 = 0.05;
    let (rows, mut n) = (light_map()?, RandomNumbers(31));
    for name in SolverName::ALL.into_iter().filter(|name| *name != SolverName::ClampedCgls) {
        let mut question = Question::answered_by(&rows, 1e-9)?.by(name).pulled(1e-6);
        question.settings.noise = Some(NOISE);
        let wanted: f64 = question.targets.iter().map(|target| f64::from(target[0]).powi(2)).sum();
        // Uniform numbers from −1 to 1 have a variance of a third. They stay below the noise that is told.
        let size = 0.8 * NOISE * (3.0 * wanted / rows.rays().len() as f64).sqrt();
        for target in &mut question.targets {
            *target = target.map(|value| value + (size * n.uniform(-1.0, 1.0)) as f32);
        }
        let answer = question.solved(setting, &rows)?;
        let place = format!("{}, {}", name.name(), answer.ending());
        let mut shown = question.matrix.range();
        let x = answer.solved.x.iter().map(|x| x.map(f64::from)).collect();
        question.matrix.apply(&CpuVector(x), &mut shown)?;
        let pairs = || shown.0.iter().flatten().zip(question.targets.iter().flatten());
        let square = pairs().map(|(shown, &b)| (shown - f64::from(b)).powi(2)).sum::<f64>();
        let missed = (square / pairs().map(|(_, &b)| f64::from(b).powi(2)).sum::<f64>()).sqrt();
        measurements.must(&place, answer.solved.outcome.stop.reason == StopReason::Discrepancy);
        measurements.within(place, missed, NOISE * 1.5f64.sqrt());
        certificate(measurements, name.name(), &answer, 1e-9);
    }
    Ok(())
}

/// Every row so many times.
#[derive(Debug)]
struct Repeated<'a> {
    rows: &'a LightMapTraversal,
    times: usize,
}

impl<const C: usize> Traversal<f64, C> for Repeated<'_> {
    fn rows(&self) -> usize {
        self.times * self.rows.rays().len()
    }

    fn elements(&self) -> usize {
        Traversal::<f64, C>::elements(self.rows)
    }

    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f64, C>)) {
        self.rows.walk(row % self.rows.rays().len(), visit);
    }
}

fn repeated_views(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let rows = light_map()?;
    let again = Repeated { rows: &rows, times: 7 };
    for name in SolverName::ALL.into_iter().filter(|name| *name != SolverName::ClampedCgls) {
        // Strongly pulled, so that little in the certificate is little in the light map.
        let question =
            |tolerance| Ok::<_, Error>(Question::answered_by(&rows, tolerance)?.by(name).pulled(0.5));
        let once = question(1e-6)?.solved(&Setting::RIGHT, &rows)?;
        let mut asked = Question::answered_by(&again, 1e-6)?.by(name).pulled(0.5);
        asked.targets = question(1e-6)?.targets.repeat(again.times);
        let often = asked.solved(setting, &again)?;
        let pairs = once.solved.x.iter().flatten().zip(often.solved.x.iter().flatten());
        let gap = pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt();
        let place = format!("{}, {}", name.name(), often.ending());
        measurements.within(place, gap, once.reach() + often.reach());
        certificate(measurements, name.name(), &often, 1e-6);
    }
    Ok(())
}

fn nothing_to_do(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let zero = DMatrix::zeros(7, 5);
    let matrix = random(12, 5, 1);
    let x0 = colors(5, 2);
    // Summed up as the operator sums, so that not even rounding is left to do.
    let shown = image(&matrix, &x0);
    let problems = [
        ("a start that solves", &matrix, shown, x0.clone()),
        ("zero targets, zero start", &matrix, vec![[0.0; 3]; 12], vec![[0.0; 3]; 5]),
        ("a zero matrix", &zero, colors(7, 3), x0),
    ];
    for (what, matrix, b, x0) in problems {
        let problem = DenseProblem { matrix: matrix.clone(), b, x0, bounds: Bounds::NOT_NEGATIVE };
        for name in SolverName::ALL {
            let ended = problem.run(setting, name, &Limits::new(100, 1e-6))?;
            let place = format!("{what}, {}", place(name, &ended));
            measurements.must(&place, ended.outcome.stop.reason == StopReason::Tolerance);
            let pairs = ended.x.iter().flatten().zip(problem.x0.iter().flatten());
            let moved = pairs.map(|(x, x0)| relative(*x, *x0)).fold(0.0, worse);
            measurements.within(place, moved, 0.0);
        }
    }
    Ok(())
}

fn not_a_number(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let rows = light_map()?;
    for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        // What is right must not be refused: so the sabotage of a refusal is to give it what is right.
        let value = if setting.faulty { 1.0 } else { wrong };
        for name in SolverName::ALL {
            let mut question = Question::answered_by(&rows, 1e-3)?.by(name);
            question.targets[7][1] = value;
            let answer = question.solved(setting, &rows);
            let place = format!("{wrong}, {}", name.name());
            measurements.refused(place, answer, |error| matches!(error, Error::NonFinite { .. }));
        }
    }
    Ok(())
}
