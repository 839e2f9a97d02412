//! The text of a scene file, which knows where in it something is.

use std::path::Path;

use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::io::input::{self, NotUtf8};
use crate::{Error, Result};

use super::flaw::Flaw;
use super::locate::{Aim, locate, position};
use super::path::{DocumentPath, Segment};
use super::read::{self, Broken};
use super::wording::{self, About};

/// Bytes of a line that a person can still read; longer ones are written by programs, and a column says more than they do.
const READABLE: usize = 200;

/// A scene file's text, and which of its values were set from outside.
#[derive(Debug)]
pub(super) struct SceneText<'a> {
    pub(super) file: &'a Path,
    pub(super) text: &'a str,
    /// What the caller has set.
    pub(super) set: Vec<DocumentPath>,
}

impl<'a> SceneText<'a> {
    /// The text of a file's bytes.
    pub(super) fn of(bytes: &'a [u8], file: &'a Path) -> Result<Self> {
        let text = input::decoded(bytes).map_err(|error| {
            let valid = if let NotUtf8::Behind(text) = error { text } else { "" };
            let source = SceneText { file, text: valid, set: Vec::new() };
            source.error_at_offset(valid.len(), &DocumentPath::default(), error.to_string())
        })?;
        Ok(Self { file, text, set: Vec::new() })
    }
}

impl SceneText<'_> {
    /// The text as JSON.
    pub(super) fn value(&self) -> Result<Value> {
        read::value(self.text).map_err(|broken| match broken {
            Broken::TooMany(error) => error,
            Broken::Syntax { path, offset, problem } => self.error_at_offset(offset, &path, problem),
            Broken::Duplicate(path) => {
                let problem = "this key occurs twice in its object; remove one".to_owned();
                self.error(&path, Aim::SecondKey, problem, None)
            }
        })
    }

    /// What the JSON of the text says.
    pub(super) fn read<T: DeserializeOwned>(&self, value: &Value) -> Result<T> {
        serde_path_to_error::deserialize(value).map_err(|error| self.mismatch(value, &error))
    }

    /// The error for JSON values that are not what is read.
    fn mismatch(&self, value: &Value, error: &serde_path_to_error::Error<serde_json::Error>) -> Error {
        use serde_path_to_error::Segment as Step;
        let steps = error.path().iter().filter_map(|step| match step {
            Step::Seq { index } => Some(Segment::Index(*index)),
            Step::Map { key } | Step::Enum { variant: key } => Some(Segment::Key(key.clone())),
            Step::Unknown => None,
        });
        let mut path = DocumentPath(steps.collect());
        let wording = wording::of(&error.inner().to_string());
        let aim = match (wording.about, only_key(value, &path)) {
            (About::Field, _) => Aim::Key,
            (About::Variant, Some(key)) => {
                path.0.push(Segment::Key(key));
                Aim::Key
            }
            _ => Aim::Value,
        };
        self.error(&path, aim, wording.problem, wording.suggestion)
    }

    /// The error for what is wrong at `path`.
    pub(super) fn error(
        &self,
        path: &DocumentPath,
        aim: Aim,
        problem: String,
        suggestion: Option<String>,
    ) -> Error {
        let place = locate(self.text, path, aim);
        let problem = format!("{problem}{}", self.origin(path));
        self.error_at(place, path, problem, suggestion)
    }

    /// The error for what is wrong at a byte offset of the text.
    pub(super) fn error_at_offset(&self, offset: usize, path: &DocumentPath, problem: String) -> Error {
        self.error_at(position(self.text, offset), path, problem, None)
    }

    /// The value, or the flaw with its place.
    pub(super) fn placed<T>(&self, built: Result<T, Flaw>) -> Result<T> {
        built.map_err(|flaw| match flaw {
            Flaw::Machine(error) => error,
            Flaw::Document { path, problem } => {
                let path = DocumentPath::parse(&path).unwrap_or_default();
                self.error(&path, Aim::Value, problem, None)
            }
        })
    }

    fn error_at(
        &self,
        (line, column): (usize, usize),
        path: &DocumentPath,
        problem: String,
        suggestion: Option<String>,
    ) -> Error {
        let file = self.file.display().to_string().into();
        let excerpt = excerpt(self.text, line).into();
        Error::Scene { file, line, column, path: path.to_string(), problem, suggestion, excerpt }
    }

    /// Tells a reader who would look for the value in the file that it does not come from there.
    fn origin(&self, path: &DocumentPath) -> &'static str {
        if self.set.iter().any(|set| set.holds(path)) {
            " (set by an override)"
        } else if !path.0.is_empty() && self.set.iter().any(|set| path.holds(set)) {
            " (partly set by an override)"
        } else {
            ""
        }
    }
}

/// The key of the object at `path`, when it has exactly one.
fn only_key(value: &Value, path: &DocumentPath) -> Option<String> {
    let place = path.0.iter().try_fold(value, |place, segment| match segment {
        Segment::Key(key) => place.get(key),
        Segment::Index(index) => place.get(index),
    });
    let object = place?.as_object()?;
    object.keys().next().filter(|_| object.len() == 1).cloned()
}

/// A line and those beside it; nothing where they are too long to be read.
fn excerpt(text: &str, line: usize) -> String {
    let around: Vec<&str> =
        text.lines().skip(line.saturating_sub(2)).take(if line > 1 { 3 } else { 2 }).collect();
    if around.iter().any(|line| line.len() > READABLE) { String::new() } else { around.join("\n") }
}
