//! Decoders of other crates that may panic on a damaged file.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use crate::{Error, Result};

thread_local! {
    static IS_GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Whether a panic of this thread now would be caught and told as an error, because it is inside of a decoder that
/// may panic on a damaged file. A program that has a panic hook can keep quiet about it.
pub fn is_guarded() -> bool {
    IS_GUARDED.get()
}

/// What `decode` makes of the file at `path`, with its panics as errors. It must keep to this thread, and what it changes
/// must not be looked at after an error.
///
/// Errors: those of `decode`; [`Error::Format`] where it panics.
pub(super) fn guarded<T>(path: &Path, format: &'static str, decode: impl FnOnce() -> Result<T>) -> Result<T> {
    let before = IS_GUARDED.replace(true);
    let decoded = catch_unwind(AssertUnwindSafe(decode));
    IS_GUARDED.set(before);
    decoded.unwrap_or_else(|_| {
        let reason = "the decoder failed on it; it is damaged".to_owned();
        Err(Error::Format { path: path.to_owned(), format, reason })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_of_a_decoder_is_an_error_that_names_the_file() {
        let fails = || -> Result<u8> {
            assert!(is_guarded());
            panic!("index out of bounds");
        };
        let error = guarded("a.png".as_ref(), "PNG", fails).unwrap_err();
        assert!(error.to_string().contains("a.png is not a usable PNG file: the decoder failed"), "{error}");
        assert!(!is_guarded());
        assert_eq!(guarded("a.png".as_ref(), "PNG", || Ok(1)).unwrap(), 1);
    }
}
