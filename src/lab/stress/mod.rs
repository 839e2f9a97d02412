//! Numerical stability, law by law.
//!
//! A case puts one law under stress: it sweeps a number, measures, and holds each measurement against a bound that has a reason.
//! None may end in a NaN, in a stall without a reason, or in an answer that is wrong in silence: an [`Error`] is an answer
//! only where the case asks for it.

#[cfg(feature = "gpu")]
mod adapter;
mod case;
mod dense;
mod depth;
mod hall;
mod order;
mod orthogonality;
mod precision;
mod rays;
mod rows;
mod scale;
mod shadows;
mod solved;
mod solving;

use serde::Serialize;

use self::case::{Case, Setting};
pub use self::case::{Measurement, Verdict};
use crate::job::{Engine, EngineChoice, Observer, Step, Stop};
use crate::{Error, Result};

/// What is put under stress, and how.
#[derive(Debug, Clone, Default)]
pub struct Stress {
    /// Only cases with this in their name.
    pub only: String,
    /// Fewer values of each sweep, every law.
    pub quick: bool,
    /// One weight of every row of what is tested is wrong, to see every verdict turn.
    pub faulty: bool,
    /// What computes.
    pub engine: EngineChoice,
}

/// All verdicts.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// Whether it was the short form.
    pub quick: bool,
    /// Laws.
    pub cases: usize,
    /// Measurements that were held against them.
    pub measurements: usize,
    /// Laws that do not hold.
    pub broken: usize,
    /// What all of it took.
    pub seconds: f64,
    /// Law by law.
    pub verdicts: Vec<Verdict>,
}

impl Stress {
    /// Puts every case, or those whose name contains what is asked for, under stress.
    ///
    /// Errors: [`Error::Empty`] where there is no such case; those of the engine, and of cases that cannot be made.
    pub fn run(&self, observer: &mut impl Observer) -> Result<Summary> {
        let engine = Engine::open(&self.engine, &Stop::default())?;
        let cases = chosen(&self.only, &engine)?;
        let setting = Setting { quick: self.quick, faulty: self.faulty, engine };
        observer.begins(&Step { name: "stressing", within: "", parts: Some(cases.len() as u64) });
        let mut verdicts = Vec::with_capacity(cases.len());
        for (done, case) in cases.iter().enumerate() {
            observer.advances(done as u64, case.name);
            verdicts.push(case.verdict(&setting)?);
        }
        Ok(Summary {
            quick: self.quick,
            cases: verdicts.len(),
            measurements: verdicts.iter().map(|verdict| verdict.samples.len()).sum(),
            broken: verdicts.iter().filter(|verdict| !verdict.holds).count(),
            seconds: verdicts.iter().map(|verdict| verdict.seconds).sum(),
            verdicts,
        })
    }
}

fn all(engine: &Engine) -> Vec<Case> {
    let cases = depth::CASES.into_iter().chain(scale::CASES).chain(rays::CASES).chain(shadows::CASES);
    let cases = cases.chain(solving::CASES).chain(orthogonality::CASES);
    let cases = cases.chain(precision::CASES).chain(order::CASES);
    #[cfg(feature = "gpu")]
    if engine.gpu().is_some() {
        return cases.chain(adapter::CASES).collect();
    }
    #[cfg(not(feature = "gpu"))]
    let Engine::Cpu = engine;
    cases.collect()
}

fn chosen(only: &str, engine: &Engine) -> Result<Vec<Case>> {
    let (chosen, others): (Vec<Case>, Vec<Case>) =
        all(engine).into_iter().partition(|case| case.name.contains(only));
    if chosen.is_empty() {
        let names: Vec<&str> = others.iter().map(|case| case.name).collect();
        return Err(Error::Empty {
            reason: format!("no case has `{only}` in its name; there are {}", names.join(", ")),
            remedy: "give a part of one of these names, or none for all",
        });
    }
    Ok(chosen)
}
