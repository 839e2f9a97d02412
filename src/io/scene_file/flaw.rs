//! Something wrong in a document, on its way out to where the text of the document is known.

use crate::error::Fault;
use crate::{Error, Result};

use super::path::shown;

/// What is wrong, and where inside the part of the document that is being looked at.
#[derive(Debug)]
pub(crate) enum Flaw {
    /// The document is at fault.
    Document {
        /// Path from the part that is being looked at.
        path: String,
        /// What is wrong and what would be right.
        problem: String,
    },
    /// The machine is at fault, and no place in the document has anything to do with it.
    Machine(Error),
}

/// The result of turning a part of a document into a part of a scene.
pub(crate) type Built<T> = Result<T, Flaw>;

impl Flaw {
    /// A flaw at `path`, which is empty for the part itself.
    pub(super) fn new(path: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Document { path: path.into(), problem: problem.into() }
    }

    /// A value that is not what it must be.
    pub(super) fn value(path: impl Into<String>, value: impl ToString, expected: &str) -> Self {
        let value = shown(&value.to_string());
        Self::new(path, format!("{value} is not allowed; it must be {expected}"))
    }

    /// Whether it is in the field `name` of the part that is being looked at.
    pub(super) fn is_at(&self, name: &str) -> bool {
        matches!(self, Self::Document { path, .. } if path.split(['.', '[']).next() == Some(name))
    }

    /// The same with `prefix` put before its path.
    pub(super) fn inside(self, prefix: &str) -> Self {
        match self {
            Self::Document { path, problem } => {
                let dot = if path.is_empty() || path.starts_with('[') { "" } else { "." };
                Self::Document { path: format!("{prefix}{dot}{path}"), problem }
            }
            machine => machine,
        }
    }
}

impl From<Error> for Flaw {
    /// An error in a file that the scene names, or in a value, is told at its place in the scene.
    fn from(error: Error) -> Self {
        match error {
            Error::Value { path, value, expected } => Self::value(path, value, expected),
            other if other.fault() == Fault::Machine => Self::Machine(other),
            other => Self::new("", other.to_string()),
        }
    }
}

/// Says where in the document something went wrong.
pub(super) trait At<T> {
    /// The same with `prefix` put before the path of a flaw.
    fn at(self, prefix: &str) -> Built<T>;
}

impl<T, E: Into<Flaw>> At<T> for Result<T, E> {
    fn at(self, prefix: &str) -> Built<T> {
        self.map_err(|error| error.into().inside(prefix))
    }
}

/// The value when it is finite and passes `allowed`, else a flaw at `path`.
pub(super) fn checked(path: &str, value: f64, expected: &str, allowed: impl Fn(f64) -> bool) -> Built<f64> {
    if value.is_finite() && allowed(value) { Ok(value) } else { Err(Flaw::value(path, value, expected)) }
}

/// The value when it is one of `range`, else a flaw at `path`.
pub(super) fn within<T: PartialOrd + Copy + ToString>(path: &str, value: T, range: [T; 2]) -> Built<T> {
    if range[0] <= value && value <= range[1] {
        return Ok(value);
    }
    let expected = format!("from {} to {}", range[0].to_string(), range[1].to_string());
    Err(Flaw::value(path, value.to_string(), &expected))
}
