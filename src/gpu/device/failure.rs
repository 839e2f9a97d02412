//! What has gone wrong on a device: the first failure is kept, because those that follow are its consequences.

use std::sync::Mutex;

use crate::Error;
use crate::operator::lock;

/// What to do about an adapter that has failed.
pub(super) const WITHOUT: &str = "compute on the processor; resume continues from the last checkpoint";

/// The same, where its memory was too small.
pub(super) const SMALLER: &str =
    "lower the maps' or views' sizes, or compute on the processor; resume continues from the last checkpoint";

/// Keeps a failure, if it is the first.
pub(in crate::gpu) fn note(failure: &Mutex<Option<Error>>, error: Error) {
    tracing::debug!("{error}");
    lock(failure).get_or_insert(error);
}

/// The same error again; only those of an adapter are ever kept.
pub(super) fn copy_of(error: &Error) -> Error {
    match error {
        Error::Adapter { adapter, problem, remedy } => {
            Error::Adapter { adapter: adapter.clone(), problem: problem.clone(), remedy }
        }
        Error::AdapterMemory { adapter, what, needed, held, remedy } => Error::AdapterMemory {
            adapter: adapter.clone(),
            what: what.clone(),
            needed: needed.clone(),
            held: held.clone(),
            remedy,
        },
        other => Error::Machine(other.to_string()),
    }
}

/// What a driver says, without its line breaks and frames.
pub(super) fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
