//! Sums in any order: threads, permuted rows, atomics.

use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

use super::case::{Case, Measurements, Setting};
use super::rows::{RandomNumbers, Tested, WorldPlace, random_light_map};
use crate::cpu::Transport;
use crate::march::{LightMapTraversal, Traversal, Weight};
use crate::operator::{LinearOperator, Vector, WalkPlan};
use crate::scene::{Basis, Strategy};
use crate::{Error, Result};

pub(super) const CASES: [Case; 3] = [
    Case {
        name: "order/threads",
        law: "T x, T'y and dot products are the same bits with 1, 2, 3 and 7 threads",
        why: "0",
        run: threads,
    },
    Case {
        name: "order/rows",
        law: "T x of permuted rows is permuted bit by bit, and T'y rounds otherwise and no more",
        why: "0; T'y: (n + 1) * epsilon / 2 * sum of |terms|, an element, here set to 1",
        run: rows,
    },
    Case {
        name: "order/atomics",
        law: "T'y added up in f32 by atomics, in the order of chance, rounds and no more",
        why: "(n + 1) * epsilon / 2 * sum of |terms| (Higham 2002, sec. 4.2), an element, here set to 1",
        run: atomics,
    },
];

/// Half the distance of 1 to the next f32.
const UNIT: f64 = f32::EPSILON as f64 / 2.0;

fn field() -> Result<LightMapTraversal> {
    random_light_map(6, 2000, Basis::Bilinear, 0.5, &WorldPlace::PLAIN)
}

fn ones_and_more(len: usize) -> Vec<[f64; 3]> {
    let mut n = RandomNumbers(3);
    (0..len).map(|_| std::array::from_fn(|_| n.uniform(-1.0, 1.0))).collect()
}

/// T x, Tᵀ y and ⟨T x, y⟩ of rows kept and walked, as bits.
fn bits(rows: &LightMapTraversal, faulty: bool) -> Result<Vec<u64>> {
    let plan = WalkPlan::new::<1>(&Tested { rows, faulty });
    let mut bits = Vec::new();
    for strategy in [Strategy::Assembled, Strategy::MatrixFree] {
        let operator = Transport::<_, f32, 1>::new(Tested { rows, faulty }, &plan, strategy, u64::MAX)?;
        let (mut x, mut y) = (operator.domain(), operator.range());
        let (mut shown, mut arriving) = (operator.range(), operator.domain());
        x.set_from_host(&ones_and_more(x.len()))?;
        y.set_from_host(&ones_and_more(y.len()))?;
        operator.apply(&x, &mut shown)?;
        operator.apply_adjoint(&y, &mut arriving)?;
        bits.extend(shown.dot(&y)?.map(f64::to_bits));
        bits.extend(
            [shown, arriving].iter().flat_map(|v| v.0.as_flattened()).map(|v| u64::from(v.to_bits())),
        );
    }
    Ok(bits)
}

fn threads(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let rows = field()?;
    let with = |threads: usize, faulty: bool| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|error| Error::Machine(format!("cannot make {threads} threads: {error}")))?;
        pool.install(|| bits(&rows, faulty))
    };
    let one = with(1, false)?;
    for threads in setting.some(&[2, 3, 7]) {
        let differ = one.iter().zip(with(threads, setting.faulty)?).filter(|(a, b)| **a != *b).count();
        measurements.within(format!("{threads} threads, numbers that differ"), differ as f64, 0.0);
    }
    Ok(())
}

/// Rows in another order.
struct Permuted<'a> {
    rows: &'a LightMapTraversal,
    order: Vec<usize>,
}

impl<const C: usize> Traversal<f64, C> for Permuted<'_> {
    fn rows(&self) -> usize {
        self.order.len()
    }

    fn elements(&self) -> usize {
        Traversal::<f64, C>::elements(self.rows)
    }

    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f64, C>)) {
        self.rows.walk(self.order[row], visit);
    }
}

/// An order by lot (Fisher and Yates).
fn shuffled(len: usize, seed: u64) -> Vec<usize> {
    let (mut order, mut n) = ((0..len).collect::<Vec<usize>>(), RandomNumbers(seed));
    for last in (1..len).rev() {
        order.swap(last, (n.next() % (last as u64 + 1)) as usize);
    }
    order
}

/// What arrives at an element: Σ terms, Σ |terms|, and how many there are.
fn arriving(rows: &LightMapTraversal, y: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let mut sums = vec![[0.0; 3]; Traversal::<f64, 1>::elements(rows)];
    for (row, y) in y.iter().enumerate() {
        rows.walk(row, &mut |element, [weight]: [f64; 1]| {
            let term = f64::from(weight as f32) * f64::from(y[0] as f32);
            let [sum, size, count] = &mut sums[element];
            (*sum, *size, *count) = (*sum + term, *size + term.abs(), *count + 1.0);
        });
    }
    sums
}

fn rows(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let rows = field()?;
    let products = |rows: &Permuted, setting: &Setting| {
        let plan = WalkPlan::new::<1>(&setting.tested(rows));
        let operator =
            Transport::<_, f32, 1>::new(setting.tested(rows), &plan, Strategy::Assembled, u64::MAX)?;
        let (mut x, mut y) = (operator.domain(), operator.range());
        let (mut shown, mut arriving) = (operator.range(), operator.domain());
        x.set_from_host(&ones_and_more(x.len()))?;
        let on_y = ones_and_more(y.len());
        y.set_from_host(&rows.order.iter().map(|&row| on_y[row]).collect::<Vec<_>>())?;
        operator.apply(&x, &mut shown)?;
        operator.apply_adjoint(&y, &mut arriving)?;
        Ok::<_, Error>((shown, arriving))
    };
    let count = rows.rays().len();
    let truth = arriving(&rows, &ones_and_more(count));
    let in_order = Permuted { rows: &rows, order: (0..count).collect() };
    let (shown, _) = products(&in_order, &Setting::RIGHT)?;
    for seed in setting.some(&[1, 2, 3, 4, 5]) {
        let permuted = Permuted { rows: &rows, order: shuffled(count, seed) };
        let (other_shown, other_arriving) = products(&permuted, setting)?;
        let pairs = permuted.order.iter().map(|&row| shown.0[row]).zip(&other_shown.0);
        let differ = pairs.filter(|(a, b)| a.map(f32::to_bits) != b.map(f32::to_bits)).count();
        measurements.within(format!("order {seed}, rows that differ"), differ as f64, 0.0);
        let sums: Vec<f32> = other_arriving.0.iter().map(|sums| sums[0]).collect();
        measurements.within(format!("order {seed}, T'y"), rounding(&sums, &truth), 1.0);
    }
    Ok(())
}

/// The worst error of f32 sums, in parts of what rounding may make of so many terms.
fn rounding(sums: &[f32], truth: &[[f64; 3]]) -> f64 {
    let part = |(sum, [truth, size, count]): (&f32, &[f64; 3])| match (f64::from(*sum) - truth).abs() {
        0.0 => 0.0,
        error => error / ((count + 1.0) * UNIT * size),
    };
    sums.iter().zip(truth).map(part).fold(0.0, super::rows::worse)
}

fn atomics(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let rows = field()?;
    let y = ones_and_more(rows.rays().len());
    let truth = arriving(&rows, &y);
    let tested = setting.tested(&rows);
    let runs: Vec<u64> = (0..16).collect();
    for run in setting.some(&runs) {
        let sums: Vec<AtomicU32> = truth.iter().map(|_| AtomicU32::new(0)).collect();
        shuffled(y.len(), run).par_iter().for_each(|&row| {
            tested.walk(row, &mut |element, [weight]: [f64; 1]| {
                let add = |sum| Some((f32::from_bits(sum) + weight as f32 * y[row][0] as f32).to_bits());
                // Never refused: the sum is always some number.
                let _sum = sums[element].fetch_update(Ordering::Relaxed, Ordering::Relaxed, add);
            });
        });
        let sums: Vec<f32> = sums.into_iter().map(|sum| f32::from_bits(sum.into_inner())).collect();
        measurements.within(format!("run {run}, parts of that bound"), rounding(&sums, &truth), 1.0);
    }
    Ok(())
}
