//! A program that is run for so long and no longer, whatever it does.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// How long a killed program is waited for. One that hangs in a driver cannot be ended, and is left.
const AFTER_KILL: Duration = Duration::from_secs(1);

/// How a program ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum End {
    /// With an exit code; none when a signal ended it.
    Exit(Option<i32>),
    /// It was still running when its time was over.
    TimedOut,
    /// It could not be started.
    NotStarted(String),
}

/// What a program has left.
#[derive(Debug)]
pub struct Ended {
    pub end: End,
    pub seconds: f64,
    /// What it wrote to standard output.
    pub out: String,
}

/// Runs a program for at most `patience`. What it writes is added to the file `log`, standard error at once.
pub fn run(command: &mut Command, patience: Duration, log: &Path) -> Ended {
    let clock = Instant::now();
    let out = log.with_extension("out");
    let end = match started(command, log, &out) {
        Ok(child) => ended(child, patience),
        Err(error) => End::NotStarted(error.to_string()),
    };
    let seconds = clock.elapsed().as_secs_f64();
    let written = std::fs::read(&out).unwrap_or_default();
    let _ = std::fs::remove_file(&out);
    let out = String::from_utf8_lossy(&written).into_owned();
    if let Ok(mut log) = OpenOptions::new().append(true).open(log) {
        let _ = writeln!(log, "{out}\n== {end:?} after {seconds:.2} s\n");
    }
    Ended { end, seconds, out }
}

fn started(command: &mut Command, log: &Path, out: &Path) -> std::io::Result<Child> {
    let mut log = OpenOptions::new().create(true).append(true).open(log)?;
    writeln!(log, "$ {command:?}")?;
    // A group of its own, so that what it has started can be ended with it.
    command.stdin(Stdio::null()).stdout(File::create(out)?).stderr(log).process_group(0).spawn()
}

fn ended(mut child: Child, patience: Duration) -> End {
    if let Some(code) = waited(&mut child, patience) {
        return End::Exit(code);
    }
    let group = format!("kill -KILL -{}", child.id());
    let _ = Command::new("bash").args(["-c", &group]).stderr(Stdio::null()).status();
    let _ = child.kill();
    waited(&mut child, AFTER_KILL);
    End::TimedOut
}

/// The exit code, once there is one within so long.
fn waited(child: &mut Child, patience: Duration) -> Option<Option<i32>> {
    let clock = Instant::now();
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status.code()),
            Err(_) => return Some(None),
            Ok(None) if clock.elapsed() >= patience => return None,
            Ok(None) => std::thread::sleep(Duration::from_millis(5)),
        }
    }
}
