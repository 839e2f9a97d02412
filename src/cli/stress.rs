use std::fmt::Write;

use super::args::StressArguments;
use super::bar::Bar;
use super::{Done, FAULT, Manners};
use crate::Result;
use crate::io::to_json;
use crate::job::Folder;
use crate::lab::stress::{Stress, Summary, Verdict};

/// What [`FAULT`] says where one weight of every row is to be wrong.
const WRONG_WEIGHT: &str = "weight";

/// `unscatter stress`: every case, or those whose name contains what is asked for.
pub(super) fn run(arguments: &StressArguments, manners: &Manners) -> Result<Done> {
    let folder = arguments.output.clone().map(Folder::create).transpose()?;
    let stress = Stress {
        only: arguments.only.clone().unwrap_or_default(),
        quick: arguments.quick,
        faulty: std::env::var(FAULT).is_ok_and(|fault| fault == WRONG_WEIGHT),
        engine: arguments.backend.choice(),
    };
    let mut bar = Bar::new(manners.quiet);
    let summary = stress.run(&mut bar)?;
    bar.finish();
    let (json, words) = (to_json(&summary)?, words(&summary));
    if let Some(folder) = folder {
        folder.write_bytes("stress.json", json.as_bytes())?;
        folder.write_bytes("stress.txt", format!("{words}\n").as_bytes())?;
        folder.publish()?;
    }
    manners.print(&json, &words)?;
    Ok(if summary.broken == 0 { Done::Completely } else { Done::Broken })
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
