//! What must hold of every case, on any machine; how long it takes is none of it.

use super::cases::OVER_SLICES;
use crate::lab::check::{ADJOINT, ADJOINT_EXPLICIT, AGAINST_EXPLICIT};
use crate::report::bench::{Law, Measured, Record, Skipped};

/// Products in f64 against the explicit matrix: the same weights, summed up in another order.
const AGAINST_EXPLICIT_F64: f64 = 1e-12;
/// The laws of all records: products against the explicit matrix where they are exact, adjoints always, objectives where the
/// traversal is exact and the method says that it converged.
pub(super) fn laws(records: &[Record], skipped: &[Skipped]) -> Vec<Law> {
    let of_records = records.iter().flat_map(|record| match record.measured {
        Measured::Product => of_product(record),
        Measured::Solve => of_solve(record),
    });
    let of_skipping = skipped.iter().map(|skip| {
        law(&format!("{}/{}", skip.scene, skip.what), "skipping changes nothing", skip.difference, skip.bound)
    });
    of_records.chain(of_skipping).collect()
}

fn of_product(record: &Record) -> Vec<Law> {
    let wide = record.precision == "f64";
    let (against, adjoint) =
        if wide { (AGAINST_EXPLICIT_F64, ADJOINT_EXPLICIT) } else { (AGAINST_EXPLICIT, ADJOINT) };
    let mut laws = Vec::new();
    if let Some(error) = record.adjoint_error {
        laws.push(law(&record.case, "adjoint", error, adjoint));
    }
    if record.steps.is_none() && record.strategy != OVER_SLICES {
        laws.push(law(&record.case, "T x against the explicit matrix", record.error, against));
        if let Some(error) = record.adjoint_against_explicit {
            laws.push(law(&record.case, "Tᵀ y against the explicit matrix", error, against));
        }
    }
    laws
}

fn of_solve(record: &Record) -> Vec<Law> {
    let converged = record.stop.as_deref() == Some("tolerance") && record.steps.is_none();
    match (record.excess, record.excess_bound) {
        (Some(excess), Some(bound)) if converged => {
            // Below the solution's own it may not be either.
            vec![law(&record.case, "objective against the solution's", excess.abs(), bound)]
        }
        _ => Vec::new(),
    }
}

fn law(case: &str, law: &'static str, error: f64, bound: f64) -> Law {
    Law { case: case.to_owned(), law, error, bound, before: None, holds: error <= bound }
}
