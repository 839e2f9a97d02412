//! The one error of the library, split by cause and carrying values.
//!
//! Not reaching a tolerance is not an error: a solve that stops early says so in its
//! [`Ending`](crate::solve::Ending).

use std::path::PathBuf;

/// The result of everything here that can fail.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What went wrong. Sentences are made in `Display`; the variants carry the values.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A scene file that cannot be understood, with the place in it.
    #[error("{file}:{line}:{column}: {path}: {problem}{}", hint(.suggestion))]
    Scene {
        /// The scene file.
        file: Box<str>,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// Path inside the document, such as `views[1].strokes[0].radius`.
        path: String,
        /// What is wrong there and what would be right.
        problem: String,
        /// The nearest valid name, where one is near.
        suggestion: Option<String>,
        /// That line with the one before it, where there is one, and the one after it; empty where they are too long to be read.
        excerpt: Box<str>,
    },

    /// A value that is outside what it may be; becomes [`Error::Scene`] where its place in a file is known.
    #[error("{path}: {value} is not allowed; it must be {expected}")]
    Value {
        /// Which value, as a path such as `medium.sigma_t`.
        path: String,
        /// What was given.
        value: String,
        /// What would be right.
        expected: &'static str,
    },

    /// A file or folder that cannot be read or written.
    #[error("cannot {action} {}: {source}", path.display())]
    File {
        /// `read`, `write`, `create`, `rename`.
        action: &'static str,
        /// Which file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },

    /// A file whose content is not what its format promises.
    #[error("{} is not a usable {format} file: {reason}", path.display())]
    Format {
        /// Which file.
        path: PathBuf,
        /// Name of the format, such as `EXR`.
        format: &'static str,
        /// What is wrong with it.
        reason: String,
    },

    /// Vectors or pictures whose sizes do not belong together.
    #[error("{what} has {got} elements where {expected} are needed")]
    Shape {
        /// Which one.
        what: &'static str,
        /// What is needed.
        expected: usize,
        /// What was given.
        got: usize,
    },

    /// A NaN or an infinity on its way into a result.
    #[error("{what} is not a finite number at {place}")]
    NonFinite {
        /// Which quantity.
        what: String,
        /// Pixel, texel or voxel.
        place: String,
    },

    /// A problem with nothing to solve.
    #[error("{reason}; {remedy}")]
    Empty {
        /// What is missing.
        reason: String,
        /// What a person can do about it.
        remedy: &'static str,
    },

    /// More memory or more elements than allowed, found before anything is allocated.
    #[error("{what} would need {needed} and {limit} are allowed; {remedy}")]
    TooLarge {
        /// Which thing.
        what: String,
        /// How much it needs.
        needed: String,
        /// How much there is.
        limit: String,
        /// What to lower.
        remedy: &'static str,
    },

    /// A matrix that should be positive (semi-)definite is not.
    #[error(
        "curvature {value:e} along a search direction in iteration {iteration}; the operator and its adjoint do not match"
    )]
    Curvature {
        /// The curvature found.
        value: f64,
        /// In which iteration.
        iteration: usize,
    },

    /// A checkpoint that belongs to another problem.
    #[error("{} does not continue this solve: {reason}", path.display())]
    Checkpoint {
        /// Which file.
        path: PathBuf,
        /// What differs.
        reason: String,
    },

    /// Somebody wanted to stop, and there is nothing to keep.
    #[error("interrupted")]
    Interrupted,

    /// The machine could not do it: threads, memory, disk.
    #[error("{0}")]
    Machine(String),

    /// A graphics adapter that is missing, lacks something that is needed, or has failed.
    #[error("the adapter `{adapter}` {problem}; {remedy}")]
    Adapter {
        /// The name of the adapter, or the part of a name that was asked for.
        adapter: String,
        /// What is wrong with it.
        problem: String,
        /// What a person can do about it.
        remedy: &'static str,
    },

    /// Something that is in order, but that no kernel of a graphics adapter computes.
    #[error("the adapter `{adapter}` {problem}; {remedy}")]
    Unsupported {
        /// What it calls itself.
        adapter: String,
        /// What it does instead, or cannot.
        problem: String,
        /// What a person can do about it.
        remedy: &'static str,
    },

    /// More memory than a graphics adapter has left.
    #[error(
        "the adapter `{adapter}` has no room for {what}: {needed} are needed beside {held} in use; {remedy}"
    )]
    AdapterMemory {
        /// What it calls itself.
        adapter: String,
        /// What there is no room for.
        what: String,
        /// How much that needs.
        needed: String,
        /// How much is in use already.
        held: String,
        /// What to lower.
        remedy: &'static str,
    },
}

/// Whose fault an [`Error`] is; the command turns it into its exit code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The input: exit code 1.
    Input,
    /// The machine: exit code 3.
    Machine,
}

impl Error {
    /// Whether the input or the machine is at fault.
    pub fn fault(&self) -> Fault {
        use std::io::ErrorKind::{FileTooLarge, OutOfMemory, QuotaExceeded, ReadOnlyFilesystem, StorageFull};
        match self {
            Self::Interrupted
            | Self::Machine(_)
            | Self::Adapter { .. }
            | Self::Unsupported { .. }
            | Self::AdapterMemory { .. } => Fault::Machine,
            Self::File { source, .. }
                if matches!(
                    source.kind(),
                    StorageFull | QuotaExceeded | FileTooLarge | OutOfMemory | ReadOnlyFilesystem
                ) =>
            {
                Fault::Machine
            }
            _ => Fault::Input,
        }
    }

    /// Whether a graphics adapter is at fault, so that the processor can do without it.
    pub fn is_of_adapter(&self) -> bool {
        matches!(self, Self::Adapter { .. } | Self::Unsupported { .. } | Self::AdapterMemory { .. })
    }

    /// Whether nothing is wrong but the way of computing: there is no room for it here, or no kernel.
    pub fn is_not_possible_here(&self) -> bool {
        matches!(self, Self::TooLarge { .. } | Self::Unsupported { .. } | Self::AdapterMemory { .. })
    }

    /// A value at `path` that is not allowed.
    pub fn value(path: impl Into<String>, value: impl ToString, expected: &'static str) -> Self {
        Self::Value { path: path.into(), value: value.to_string(), expected }
    }

    /// The same error, saying in which iteration a [`Error::Curvature`] was met.
    pub(crate) fn in_iteration(self, iteration: usize) -> Self {
        match self {
            Self::Curvature { value, .. } => Self::Curvature { value, iteration },
            other => other,
        }
    }

    /// The same error with `prefix` put before the path of a [`Error::Value`], as errors travel
    /// outwards through a document.
    pub fn inside(self, prefix: &str) -> Self {
        match self {
            Self::Value { path, value, expected } => {
                let dot = if path.is_empty() || path.starts_with('[') { "" } else { "." };
                Self::Value { path: format!("{prefix}{dot}{path}"), value, expected }
            }
            other => other,
        }
    }
}

fn hint(suggestion: &Option<String>) -> String {
    suggestion.as_ref().map(|name| format!("; did you mean `{name}`?")).unwrap_or_default()
}
