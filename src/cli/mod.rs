//! The command: the only home of printing and exit codes.

mod args;
mod bar;
mod bench;
mod bench_words;
mod check;
mod commands;
mod diagnostics;
mod doctor;
mod stress;
mod words;

use std::io::Write;
use std::process::ExitCode;

use clap::{CommandFactory, Parser};

use args::{Arguments, Command};

use crate::io::to_json;
use crate::job::Stop;
use crate::{Error, Fault, Result, io};

/// Exit code where the input is at fault.
const INPUT: u8 = 1;
/// Exit code where the machine is at fault.
const MACHINE: u8 = 3;
/// Exit code after Ctrl-C.
const INTERRUPTED: i32 = 130;

/// A fault to simulate, so that what happens then can be tested: see ARCHITECTURE.md.
const FAULT: &str = "UNSCATTER_FAULT";

/// How a command ended that did not fail.
enum Done {
    Completely,
    /// What was computed so far is written.
    Interrupted,
    /// Everything ran, and a law was found broken.
    Broken,
}

/// How results and progress are shown.
#[derive(Debug, Clone, Copy)]
struct Manners {
    json: bool,
    quiet: bool,
}

impl Manners {
    /// Prints a result: as JSON or as a person reads it.
    fn print(&self, json: &str, words: &str) {
        let text = if self.json { json } else { words };
        // A reader that has gone away, such as `head`, is no reason to fail.
        let _gone = writeln!(std::io::stdout().lock(), "{text}");
    }
}

/// Runs the command that the arguments of the process ask for.
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    watch_verbosity(&arguments);
    quieten_caught_panics();
    if let Some(threads) = arguments.threads {
        // Fails only where a pool exists already, and here none does.
        let _existing = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global();
    }
    let manners = Manners { json: arguments.json, quiet: arguments.quiet };
    match run(&arguments.command, &manners) {
        Ok(Done::Completely) => ExitCode::SUCCESS,
        Ok(Done::Interrupted) => ExitCode::from(INTERRUPTED as u8),
        Ok(Done::Broken) => ExitCode::from(INPUT),
        Err(error) => {
            diagnostics::show(&error);
            ExitCode::from(match error.fault() {
                Fault::Machine => MACHINE,
                Fault::Input => INPUT,
            })
        }
    }
}

/// A panic that is caught and told as an error is not told as a panic, too.
fn quieten_caught_panics() {
    #[cfg(feature = "gpu")]
    use crate::gpu::is_caught;
    #[cfg(not(feature = "gpu"))]
    let is_caught = |_: &std::panic::PanicHookInfo| false;
    let tell = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !is_caught(panic) && !io::is_guarded() {
            tell(panic);
        }
    }));
}

fn run(command: &Command, manners: &Manners) -> Result<Done> {
    match command {
        Command::LightMap(arguments) => commands::light_map(arguments, manners),
        Command::Volume(arguments) => commands::volume(arguments, manners),
        Command::Animate(arguments) => commands::animate(arguments, manners),
        Command::Render(arguments) => commands::render(arguments, manners),
        Command::Plan(arguments) => commands::plan(arguments, manners),
        Command::Check(arguments) => check::run(arguments, manners),
        Command::Bench(arguments) => bench::run(arguments, manners),
        Command::Matrix(arguments) => commands::matrix(arguments, manners),
        Command::Stress(arguments) => stress::run(arguments, manners),
        Command::Doctor => doctor::run(manners),
        Command::Schema { of } => {
            let schema = to_json(&io::scene_file::schema((*of).into()))?;
            manners.print(&schema, &schema);
            Ok(Done::Completely)
        }
        Command::Completions { shell } => {
            clap_complete::generate(*shell, &mut Arguments::command(), "unscatter", &mut std::io::stdout());
            Ok(Done::Completely)
        }
    }
}

/// Lets Ctrl-C end the work in order; a second one ends it at once.
fn watch_interrupt(stop: &Stop) -> Result<()> {
    let stop = stop.clone();
    ctrlc::set_handler(move || {
        if stop.ask() {
            std::process::exit(INTERRUPTED);
        }
    })
    .map_err(|error| Error::Machine(format!("cannot watch for Ctrl-C: {error}")))
}

fn watch_verbosity(arguments: &Arguments) {
    let level = match (arguments.quiet, arguments.verbose) {
        (true, _) => tracing::Level::ERROR,
        (_, 0) => tracing::Level::WARN,
        (_, 1) => tracing::Level::INFO,
        _ => tracing::Level::DEBUG,
    };
    tracing_subscriber::fmt()
        .with_max_level(level)
        .with_writer(|| diagnostics::Warnings)
        .with_target(false)
        .init();
}
