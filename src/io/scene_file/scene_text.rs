//! The text of a scene file, which knows where in it something is.

use std::path::Path;

use crate::{Error, Result};

use super::flaw::Flaw;
use super::locate::{Aim, locate, position};
use super::path::DocumentPath;

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

impl SceneText<'_> {
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

/// A line and those beside it; nothing where they are too long to be read.
fn excerpt(text: &str, line: usize) -> String {
    let around: Vec<&str> =
        text.lines().skip(line.saturating_sub(2)).take(if line > 1 { 3 } else { 2 }).collect();
    if around.iter().any(|line| line.len() > READABLE) { String::new() } else { around.join("\n") }
}
