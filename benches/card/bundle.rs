//! The folder with the programs, and what they are run with.

use std::cell::{Cell, RefCell};
use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use serde_json::Value;

use super::child::{self, End, Ended};
use super::loader;
use super::record::{Outcome, Step};

/// Programs, scenes and libraries; where results go; the time there is.
pub struct Bundle {
    folder: PathBuf,
    out: PathBuf,
    variables: Vec<(&'static str, OsString)>,
    /// When everything must be over.
    end: Instant,
    /// When the step under way must be.
    step_end: Cell<Instant>,
    log: RefCell<PathBuf>,
    /// The adapter's name.
    pub adapter: String,
    pub is_dry: bool,
}

impl Bundle {
    /// The bundle that this program lies in.
    ///
    /// Errors: when nothing can be written to `out`.
    pub fn open(out: &Path, end: Instant) -> io::Result<Self> {
        let program = std::env::current_exe()?;
        let folder = program.parent().and_then(Path::parent).unwrap_or(Path::new(".")).to_owned();
        std::fs::create_dir_all(out.join("logs"))?;
        let out = out.canonicalize()?;
        std::fs::write(out.join("card.md"), "nothing has been measured yet\n")?;
        let variables = loader::environment(&folder.join("loader"), &out.join("lib"))?;
        let log = RefCell::new(out.join("logs/00-adapters.txt"));
        let (step_end, adapter) = (Cell::new(end), String::new());
        let bundle = Self { folder, out, variables, end, step_end, log, adapter, is_dry: false };
        bundle.clear();
        std::fs::create_dir_all(bundle.scratch(""))?;
        Ok(bundle)
    }

    /// With the adapter that everything is run on.
    pub fn on(self, device: &Value, is_dry: bool) -> Self {
        Self { adapter: device["name"].as_str().unwrap_or_default().to_owned(), is_dry, ..self }
    }

    /// Bundled libraries.
    pub fn libraries(&self) -> PathBuf {
        self.folder.join("loader")
    }

    /// A demo scene.
    pub fn scene(&self, name: &str) -> String {
        self.folder.join(format!("strokes/{name}.json")).to_string_lossy().into_owned()
    }

    /// A file or folder that is gone at the end.
    pub fn scratch(&self, name: &str) -> PathBuf {
        self.out.join("card.tmp").join(name)
    }

    /// A file or folder of the results.
    pub fn result(&self, name: &str) -> PathBuf {
        self.out.join(name)
    }

    /// Removes what is not a result.
    pub fn clear(&self) {
        let _ = std::fs::remove_dir_all(self.out.join("card.tmp"));
    }

    /// Seconds until everything must be over.
    pub fn time_left(&self) -> Duration {
        self.end.saturating_duration_since(Instant::now())
    }

    /// Begins a step, whose programs have so long all together.
    pub fn begin(&self, number: usize, name: &str, limit: Duration) {
        self.step_end.set(self.end.min(Instant::now() + limit));
        *self.log.borrow_mut() = self.out.join(format!("logs/{number:02}-{name}.txt"));
        let _ = std::fs::remove_file(&*self.log.borrow());
    }

    /// Whether the step under way has time left.
    pub fn has_time(&self) -> bool {
        Instant::now() < self.step_end.get()
    }

    /// A program of the bundle, in an environment in which it finds driver, scenes and adapter.
    pub fn program(&self, name: &str) -> Command {
        let mut command = Command::new(self.folder.join("bin").join(name));
        command.current_dir(self.scratch("")).envs(self.variables.iter().map(|(name, value)| (name, value)));
        command.env("CARGO_MANIFEST_DIR", &self.folder);
        command.env("UNSCATTER_PROGRAM", self.folder.join("bin/unscatter"));
        command.env("UNSCATTER_FAULTY_VULKAN", self.folder.join("faulty"));
        // Where there is no session, drivers complain about it on standard error.
        command
            .env("XDG_RUNTIME_DIR", std::env::var_os("XDG_RUNTIME_DIR").unwrap_or(self.scratch("").into()));
        if !self.adapter.is_empty() {
            command.env("UNSCATTER_ADAPTER", &self.adapter);
        }
        command
    }

    /// The command `unscatter`.
    pub fn unscatter(&self, arguments: &[&str]) -> Command {
        let mut command = self.program("unscatter");
        command.args(arguments);
        command
    }

    /// The command on the adapter.
    pub fn on_adapter(&self, arguments: &[&str]) -> Command {
        let mut command = self.unscatter(arguments);
        command.args(["--backend", "gpu", "--adapter", &self.adapter]);
        command
    }

    /// Runs a program within what is left of the step's time.
    pub fn run(&self, command: &mut Command) -> Ended {
        self.run_within(command, self.time_left())
    }

    /// The same within so long.
    pub fn run_within(&self, command: &mut Command, patience: Duration) -> Ended {
        let left = self.step_end.get().saturating_duration_since(Instant::now());
        child::run(command, patience.min(left), &self.log.borrow())
    }

    /// Runs a program that should end with 0; what else happens is what went wrong in the step. Gives what it left, or nothing then.
    pub fn done(&self, step: &mut Step, what: &str, command: &mut Command) -> Option<Ended> {
        let ended = self.run(command);
        match &ended.end {
            End::Exit(Some(0)) => return Some(ended),
            End::TimedOut => {
                step.went_wrong(Outcome::TimedOut, format!("{what}: not done after {:.0} s", ended.seconds))
            }
            end => step.went_wrong(Outcome::Failed, format!("{what}: {}", in_words(end))),
        }
        None
    }
}

/// How a program ended.
pub fn in_words(end: &End) -> String {
    match end {
        End::Exit(Some(code)) => format!("exit code {code}"),
        End::Exit(None) => "ended by a signal".to_owned(),
        End::TimedOut => "no end within its time".to_owned(),
        End::NotStarted(wrong) => format!("cannot be started ({wrong})"),
    }
}
