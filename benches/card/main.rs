//! The whole truth about a graphics card, in five minutes.
//!
//!     card run [--adapter NAME] OUT     measures and tests a card; OUT gets card.md, card.json and logs
//!     card run --dry OUT                shows in seconds that everything runs, on a software adapter
//!
//! It lies in a bundle that `benches/card.sh prepare` makes: the command, the bench of kernels and the tests beside it, each of which it
//! runs as a program of its own, for so long and no longer. A step that fails or hangs does not end the run, and is said.
//!
//! Exit codes: 0 every step went well; 1 one did not, or OUT cannot be written; 2 wrong usage; 3 there is no such adapter.
#![allow(missing_docs, unreachable_pub, reason = "nothing here is public")]
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "figures are what it is for")]

mod adapter;
mod bundle;
mod child;
mod distance;
mod loader;
mod record;
mod steps;
mod trials;

use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::exit;
use std::time::{Duration, Instant};

use bundle::Bundle;
use record::{Outcome, Record, Step};

/// All steps together.
const ALL: Duration = Duration::from_secs(300);
const USAGE: &str = "usage: card.sh run [--dry] [--adapter NAME] OUT";

/// What the command line asks for.
#[derive(Debug, Default)]
struct Asked {
    is_dry: bool,
    adapter: Option<String>,
    out: PathBuf,
}

fn main() {
    let asked = asked(std::env::args().skip(1)).unwrap_or_else(|wrong| {
        eprintln!("{wrong}\n{USAGE}");
        exit(2)
    });
    let begun = Instant::now();
    if let Err(wrong) = unpack() {
        eprintln!("the bundle cannot be unpacked where it lies: {wrong}");
        exit(1);
    }
    let bundle = Bundle::open(&asked.out, begun + ALL).unwrap_or_else(|wrong| {
        eprintln!("{}: {wrong}", asked.out.display());
        exit(1)
    });
    let found = adapter::find(&bundle, asked.is_dry, asked.adapter.as_deref()).unwrap_or_else(|wrong| {
        eprintln!("{wrong}");
        exit(3)
    });
    let bundle = bundle.on(&found.device, asked.is_dry);
    let mut record = Record {
        date: std::env::var("CARD_DATE").unwrap_or_default(),
        version: found.host["version"].clone(),
        is_dry: asked.is_dry,
        device: found.device,
        host: found.host,
        steps: Vec::new(),
    };
    for (number, plan) in (1..).zip(steps::STEPS) {
        record.steps.push(plan.run(&bundle, number));
        let Some(step) = record.steps.last() else { continue };
        say(step);
        if let Err(wrong) = record.write(&asked.out) {
            eprintln!("{}: {wrong}", asked.out.display());
            exit(1);
        }
    }
    bundle.clear();
    println!("{:.0} s in all; {}", begun.elapsed().as_secs_f64(), asked.out.join("card.md").display());
    // Not by returning: nothing is waited for that hangs.
    exit(if record.is_sound() { 0 } else { 1 })
}

/// Unpacks the programs that lie compressed beside this one, each once.
fn unpack() -> io::Result<()> {
    let program = std::env::current_exe()?;
    let folder = program.parent().ok_or(io::ErrorKind::NotFound)?;
    for entry in std::fs::read_dir(folder)? {
        let packed = entry?.path();
        let unpacked = packed.with_extension("");
        if packed.extension().is_none_or(|ending| ending != "gz") || unpacked.exists() {
            continue;
        }
        // Under another name until it is whole.
        let part = packed.with_extension("part");
        let mut bytes = flate2::read::GzDecoder::new(std::fs::File::open(&packed)?);
        io::copy(&mut bytes, &mut std::fs::File::create(&part)?)?;
        std::fs::set_permissions(&part, std::fs::Permissions::from_mode(0o755))?;
        std::fs::rename(&part, &unpacked)?;
    }
    Ok(())
}

fn asked(mut arguments: impl Iterator<Item = String>) -> Result<Asked, String> {
    let mut asked = Asked::default();
    let mut out = None;
    if arguments.next().as_deref() != Some("run") {
        return Err("what is to be done is missing: run".to_owned());
    }
    while let Some(argument) = arguments.next() {
        match &argument[..] {
            "--dry" => asked.is_dry = true,
            "--adapter" => asked.adapter = Some(arguments.next().ok_or("--adapter needs a name")?),
            option if option.starts_with('-') => return Err(format!("{option} is unknown")),
            _ if out.is_some() => return Err(format!("{argument} is one folder too many")),
            _ => out = Some(PathBuf::from(argument)),
        }
    }
    asked.out = out.ok_or("the folder for the results is missing")?;
    Ok(asked)
}

/// One line a step, as it ends.
fn say(step: &Step) {
    let outcome = match step.outcome {
        Outcome::Ok => "ok",
        Outcome::Failed => "FAILED",
        Outcome::TimedOut => "TIMED OUT",
        Outcome::LeftOut => "left out",
    };
    println!("{outcome:10} {:6.1} s  {}  {}", step.seconds, step.name, step.notes.join("; "));
}
