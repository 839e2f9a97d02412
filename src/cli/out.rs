//! What the command writes: results on standard output, all else on standard error.

use std::borrow::Cow;
use std::io::{ErrorKind, Write};

use crate::{Error, Result};

/// Writes a result and a line's end on standard output, whole.
///
/// A reader that has gone away, such as `head`, is no reason to fail.
///
/// Errors: [`Error::Machine`] for all else that keeps it from being written, such as a full disk.
pub(super) fn result(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Error::Machine(format!("cannot write to standard output: {error}")))
        }
        _ => Ok(()),
    }
}

/// Writes on standard error. Whether anybody reads that, or can, changes nothing.
pub(super) fn remark(text: &str) {
    let mut out = std::io::stderr().lock();
    _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

/// The text without control characters, which could make a terminal do something: each is shown as its picture, such as `␛`. Line ends and
/// tabs stay.
pub(super) fn visible(text: &str) -> Cow<'_, str> {
    let is_hidden = |c: char| c.is_control() && c != '\n' && c != '\t';
    if !text.contains(is_hidden) {
        return text.into();
    }
    let shown = |c: char| match u32::from(c) {
        _ if !is_hidden(c) => c,
        code @ ..0x20 => char::from_u32(0x2400 + code).unwrap_or(char::REPLACEMENT_CHARACTER),
        0x7F => '\u{2421}',
        _ => char::REPLACEMENT_CHARACTER,
    };
    text.chars().map(shown).collect::<String>().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_shown_and_do_nothing() {
        for (text, shown) in [
            ("a\tb\nc é", "a\tb\nc é"),
            ("\u{1b}[31mred", "␛[31mred"),
            ("\u{9b}31m\r\u{7}\u{7f}", "\u{fffd}31m␍␇␡"),
        ] {
            assert_eq!(visible(text), shown);
        }
    }
}
