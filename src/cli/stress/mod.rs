//! `unscatter stress`: numerical stability, law by law.
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

use std::fmt::Write;

use serde::Serialize;

use self::case::{Case, Setting, Verdict};
use super::args::StressArguments;
use super::engine::{Engine, FAULT};
use super::progress::Steps;
use super::results::Folder;
use super::{Done, Manners, to_json};
use crate::{Error, Result};

/// The fault of [`FAULT`] that is simulated here: one weight of every row of what is tested is wrong.
const WRONG_WEIGHT: &str = "weight";

/// `unscatter stress`: every case, or those whose name contains what is asked for.
pub(super) fn run(arguments: &StressArguments, manners: &Manners) -> Result<Done> {
    let engine = Engine::choose(&arguments.backend)?;
    let cases = chosen(arguments.only.as_deref().unwrap_or_default(), &engine)?;
    let folder = arguments.output.clone().map(|path| Folder::create(Some(path), "stress".as_ref()));
    let folder = folder.transpose()?;
    let faulty = std::env::var(FAULT).is_ok_and(|fault| fault == WRONG_WEIGHT);
    let setting = Setting { quick: arguments.quick, faulty, engine };
    let mut steps = Steps::new(manners.quiet);
    steps.begin("stressing", Some(cases.len() as u64));
    let mut verdicts = Vec::with_capacity(cases.len());
    for (done, case) in cases.iter().enumerate() {
        steps.advance(done as u64, case.name.to_owned());
        verdicts.push(case.verdict(&setting)?);
    }
    steps.finish();
    let summary = Summary {
        quick: setting.quick,
        cases: verdicts.len(),
        measurements: verdicts.iter().map(|verdict| verdict.samples.len()).sum(),
        broken: verdicts.iter().filter(|verdict| !verdict.holds).count(),
        seconds: verdicts.iter().map(|verdict| verdict.seconds).sum(),
        verdicts,
    };
    let (json, words) = (to_json(&summary)?, words(&summary));
    if let Some(folder) = folder {
        folder.write_bytes("stress.json", json.as_bytes())?;
        folder.write_bytes("stress.txt", format!("{words}\n").as_bytes())?;
        folder.publish()?;
    }
    manners.print(&json, &words);
    Ok(if summary.broken == 0 { Done::Completely } else { Done::Broken })
}

/// What is printed and written.
#[derive(Serialize)]
struct Summary {
    quick: bool,
    cases: usize,
    measurements: usize,
    broken: usize,
    seconds: f64,
    verdicts: Vec<Verdict>,
}

fn all(engine: &Engine) -> Vec<Case> {
    let cases = depth::CASES.into_iter().chain(scale::CASES).chain(rays::CASES).chain(shadows::CASES);
    let cases = cases.chain(solving::CASES).chain(orthogonality::CASES);
    let cases = cases.chain(precision::CASES).chain(order::CASES);
    #[cfg(feature = "gpu")]
    if let Engine::Gpu { .. } = engine {
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

/// The table and its last line.
fn words(summary: &Summary) -> String {
    let mut words = String::new();
    for verdict in &summary.verdicts {
        // Writing to a string does not fail.
        let _written = write_verdict(&mut words, verdict);
    }
    let Summary { cases, measurements, broken, seconds, .. } = summary;
    let verdict = match broken {
        0 => "all laws hold".to_owned(),
        1 => "1 law is BROKEN".to_owned(),
        broken => format!("{broken} laws are BROKEN"),
    };
    words + &format!("{cases} cases, {measurements} measurements, {seconds:.1} s: {verdict}")
}

fn write_verdict(words: &mut String, verdict: &Verdict) -> std::fmt::Result {
    let mark = if verdict.holds { "holds" } else { "BROKEN" };
    write!(words, "{mark:6}  {:22}", verdict.case)?;
    match (&verdict.error, &verdict.worst) {
        (Some(error), _) => writeln!(words, "  {error}")?,
        (None, Some(worst)) => {
            writeln!(words, "  {:7.1e} of {:7.1e}  {}", worst.measured, worst.bound, worst.place)?;
        }
        (None, None) => writeln!(words, "  nothing was measured")?,
    }
    writeln!(words, "        {}\n        bound: {}", verdict.law, verdict.why)
}
