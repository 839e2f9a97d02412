use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use crate::io::input;
use crate::job::Stop;
use crate::{Error, Result};

/// What has been measured so far, one line a case in `records.jsonl`, written as soon as it is known.
#[derive(Debug)]
pub(super) struct Log {
    path: PathBuf,
    file: File,
    known: HashMap<String, Value>,
    /// How many cases were taken from an earlier run.
    pub(super) taken: usize,
    stop: Stop,
}

impl Log {
    /// Begins a log, or goes on with that of an earlier run of the same `kind`; a last line that was cut off is forgotten.
    ///
    /// Errors: [`Error::File`]; [`Error::Value`] where there is no log to go on with, or it is of other scenes or settings.
    pub(super) fn open(folder: &Path, kind: &str, resume: bool, stop: &Stop) -> Result<Self> {
        let path = folder.join("records.jsonl");
        let known = if resume { read(&path, kind)? } else { HashMap::new() };
        let open = || {
            if resume {
                let mut file = OpenOptions::new().append(true).open(&path)?;
                // Ends a line that was cut off.
                writeln!(file)?;
                return Ok(file);
            }
            let mut file = File::create(&path)?;
            writeln!(file, "{}", json!({ "kind": kind }))?;
            Ok(file)
        };
        let file = open().map_err(failed("write", &path))?;
        Ok(Self { path, file, known, taken: 0, stop: stop.clone() })
    }

    /// What was measured of a case before, or is measured now; none where somebody cut that short.
    ///
    /// Errors: those of `measure`, and [`Error::File`].
    pub(super) fn once<T: Serialize + DeserializeOwned>(
        &mut self,
        case: &str,
        measure: impl FnOnce() -> Result<T>,
    ) -> Result<Option<T>> {
        if let Some(known) = self.known.get(case) {
            self.taken += 1;
            let known = serde_json::from_value(known.clone());
            return known.map(Some).map_err(|error| broken(&self.path, case, &error));
        }
        let measured = measure();
        if self.stop.is_asked() {
            // What was cut short may be wrong, and so may be what it fails with.
            return Ok(None);
        }
        let measured = measured?;
        let line = json!({ "case": case, "value": measured });
        writeln!(self.file, "{line}")
            .and_then(|()| self.file.flush())
            .map_err(failed("write", &self.path))?;
        Ok(Some(measured))
    }
}

/// Bytes of a log at most.
const MAX_BYTES: u64 = 1 << 30;

fn read(path: &Path, kind: &str) -> Result<HashMap<String, Value>> {
    let text = input::text(path, MAX_BYTES, "log of a run")?;
    let mut lines = text.lines();
    let is_of = |line: &str| {
        serde_json::from_str::<Value>(line).is_ok_and(|line| line.get("kind") == Some(&json!(kind)))
    };
    if !lines.next().is_some_and(is_of) {
        let expected = "of the same program, scenes and settings; leave resume away to begin anew";
        return Err(Error::value("resume", format!("{} of another run", path.display()), expected));
    }
    let mut known = HashMap::new();
    for line in lines {
        let Ok(mut line) = serde_json::from_str::<Value>(line) else { continue };
        if let Some(Value::String(case)) = line.get("case").cloned() {
            known.insert(case, line["value"].take());
        }
    }
    Ok(known)
}

fn broken(path: &Path, case: &str, error: &serde_json::Error) -> Error {
    Error::value(
        "resume",
        format!("the case {case} in {} ({error})", path.display()),
        "one that this program wrote; leave resume away to begin anew",
    )
}

fn failed(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Error {
    let path = path.to_owned();
    move |source| Error::File { action, path, source }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_is_not_measured_again_and_half_a_line_is_forgotten() {
        let (folder, stop) = (tempfile::tempdir().unwrap(), Stop::default());
        let mut log = Log::open(folder.path(), "k", false, &stop).unwrap();
        assert_eq!(log.once("a", || Ok(1)).unwrap(), Some(1));
        assert_eq!(log.once("b", || Ok(2)).unwrap(), Some(2));
        let path = folder.path().join("records.jsonl");
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, &text[..text.len() - 4]).unwrap();
        let mut log = Log::open(folder.path(), "k", true, &stop).unwrap();
        assert_eq!(log.once("a", || Ok(7)).unwrap(), Some(1));
        assert_eq!(log.once("b", || Ok(7)).unwrap(), Some(7));
        assert_eq!(log.taken, 1);
        assert!(Log::open(folder.path(), "other", true, &stop).is_err());
        assert!(Log::open(&folder.path().join("nowhere"), "k", true, &stop).is_err());
    }
}
