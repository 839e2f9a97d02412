//! The command: the only home of printing and exit codes.

mod args;
mod bar;
mod bench;
mod bench_words;
mod check;
mod commands;
mod diagnostics;
mod doctor;
mod out;
mod stress;
mod words;

use std::path::PathBuf;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use clap::{CommandFactory, Parser};

use args::{Arguments, Command};

use crate::io::to_json;
use crate::job::{Stop, abandon};
use crate::{Error, Fault, Result, io};

/// Exit code where the input is at fault.
const INPUT: i32 = 1;
/// Exit code where the machine is at fault.
const MACHINE: i32 = 3;
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
    /// Whether the numbers of a solve are told, too.
    numbers: bool,
}

impl Manners {
    /// Prints a result: as JSON, which escapes what needs it, or as a person reads it.
    ///
    /// Errors: as [`out::result`].
    fn print(&self, json: &str, words: &str) -> Result<()> {
        if self.json { out::result(json) } else { out::result(&out::visible(words)) }
    }
}

/// Runs the command that the arguments of the process ask for, and ends the process.
pub fn main() -> ! {
    let arguments = Arguments::parse();
    watch_verbosity(&arguments);
    quieten_caught_panics();
    let manners = Manners { json: arguments.json, quiet: arguments.quiet, numbers: arguments.verbose > 0 };
    leave(match start_threads(arguments.threads).and_then(|()| run(&arguments.command, &manners)) {
        Ok(Done::Completely) => 0,
        Ok(Done::Interrupted) | Err(Error::Interrupted) => INTERRUPTED,
        Ok(Done::Broken) => INPUT,
        Err(error) => {
            diagnostics::show(&error);
            match error.fault() {
                Fault::Machine => MACHINE,
                Fault::Input => INPUT,
            }
        }
    })
}

/// Ends the process at once, without what libraries have registered for its end: a driver would free there what its threads still compute
/// with where a device hangs or was lost, and die of it. Nothing is lost: what is printed is flushed there and then.
fn leave(code: i32) -> ! {
    #[cfg(unix)]
    signal_hook::low_level::exit(code);
    #[cfg(not(unix))]
    std::process::exit(code)
}

/// More threads than any machine of today has processors.
const MOST_THREADS: usize = 4096;

/// Starts as many threads as the flag says, else `RAYON_NUM_THREADS`, else one for each processor.
///
/// Errors: [`Error::Value`] for more than can be meant, [`Error::Machine`] where the system refuses them.
fn start_threads(asked: Option<u16>) -> Result<()> {
    const VARIABLE: &str = "RAYON_NUM_THREADS";
    let from_variable = || std::env::var(VARIABLE).ok().and_then(|text| text.parse::<usize>().ok());
    let (name, threads) = match asked {
        Some(threads) => ("--threads", threads.into()),
        None => (VARIABLE, from_variable().unwrap_or(0)),
    };
    if threads > MOST_THREADS {
        return Err(Error::value(name, threads, "at most 4096"));
    }
    let built = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    let count = if threads == 0 { String::new() } else { format!("{threads} ") };
    let failed =
        |error| Error::Machine(format!("cannot start {count}threads: {error}; ask for fewer (--threads)"));
    built.map_err(failed)
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
        #[cfg(feature = "studio")]
        Command::Paint(arguments) => commands::paint(arguments, manners),
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
            manners.print(&schema, &schema)?;
            Ok(Done::Completely)
        }
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Arguments::command(), "unscatter", &mut script);
            out::result(&String::from_utf8_lossy(&script))?;
            Ok(Done::Completely)
        }
    }
}

/// Requests within this time are one: `timeout` sends its signal to the program and then to the program's group, so to the program again.
const ONE_REQUEST: Duration = Duration::from_millis(500);

/// Lets Ctrl-C end the work in order; a second one ends it at once, without the results that have begun in a folder. SIGTERM and SIGHUP
/// are the same, unless whoever started the program has it ignore them, as `nohup` does.
fn watch_interrupt(stop: &Stop, folder: Option<PathBuf>) -> Result<()> {
    let (stop, first) = (stop.clone(), OnceLock::new());
    let asked = move || {
        stop.ask();
        if first.get_or_init(Instant::now).elapsed() > ONE_REQUEST {
            folder.iter().for_each(|folder| abandon(folder));
            leave(INTERRUPTED);
        }
    };
    on_interrupt(asked).map_err(|error| Error::Machine(format!("cannot watch for Ctrl-C: {error}")))
}

#[cfg(unix)]
fn on_interrupt(asked: impl Fn() + Send + 'static) -> std::io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    let is_heard = |signal: &i32| ignored >> (signal - 1) & 1 == 0;
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP].iter().filter(|&signal| is_heard(signal)))?;
    std::thread::Builder::new().spawn(move || signals.forever().for_each(|_| asked()))?;
    Ok(())
}

#[cfg(not(unix))]
fn on_interrupt(asked: impl Fn() + Send + 'static) -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(asked)
}

fn watch_verbosity(arguments: &Arguments) {
    // The studio tells its page what others tell the terminal, and after every stroke.
    #[cfg(feature = "studio")]
    let is_quiet = arguments.quiet || matches!(arguments.command, Command::Paint(_));
    #[cfg(not(feature = "studio"))]
    let is_quiet = arguments.quiet;
    let level = match (is_quiet, arguments.verbose) {
        (true, _) => tracing::Level::ERROR,
        (_, 0) => tracing::Level::WARN,
        (_, 1) => tracing::Level::INFO,
        _ => tracing::Level::DEBUG,
    };
    let log = tracing_subscriber::fmt().with_max_level(level).with_ansi(false).with_target(false);
    match level <= tracing::Level::WARN {
        // A person reads no times and levels.
        true => {
            log.without_time().with_level(false).with_writer(|| diagnostics::Warnings("warning: ")).init()
        }
        false => log.with_writer(|| diagnostics::Warnings("")).init(),
    }
}
