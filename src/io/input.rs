//! The one way in: whatever is read is opened here.
//!
//! A regular file, and never a folder, a device or a pipe, which could have its reader wait for ever; a scene alone may come out of a
//! pipe, as it is read once and from front to back. Files are bounded before their bytes are taken. Text is UTF-8 with or without a byte
//! order mark.

use std::borrow::Cow;
use std::fs::{File, FileType};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// The mark that some editors put before UTF-8.
const MARK: &[u8] = b"\xEF\xBB\xBF";

/// A regular file at its start, and its length in bytes.
///
/// Errors: [`Error::File`] where it cannot be opened, or is no regular file.
pub(crate) fn open(path: &Path) -> Result<(File, u64)> {
    // Asked for before it is opened, as opening a pipe waits for someone to write into it.
    let about = std::fs::metadata(path).map_err(|source| unreadable(path, source))?;
    if let Some(kind) = irregular(about.file_type()) {
        let what = format!("it is {kind}, and must be a file");
        return Err(unreadable(path, io::Error::new(io::ErrorKind::InvalidInput, what)));
    }
    let file = File::open(path).map_err(|source| unreadable(path, source))?;
    Ok((file, about.len()))
}

/// All bytes of a regular file of at most `most` bytes. Of `remedy` the message speaks where it is longer.
///
/// Errors: as [`open`], and [`Error::TooLarge`].
pub(crate) fn bytes(path: &Path, most: u64, remedy: &'static str) -> Result<Vec<u8>> {
    let (file, length) = open(path)?;
    if length > most {
        return Err(too_large(path, &format!("{length} bytes"), most, remedy));
    }
    read(file, path, most, remedy)
}

/// All bytes of a regular file or of a pipe, as [`bytes`] does. A pipe is read until whoever writes into it closes it.
///
/// Errors: as [`bytes`].
pub(super) fn bytes_or_pipe(path: &Path, most: u64, remedy: &'static str) -> Result<Vec<u8>> {
    if !is_stream(path) {
        return bytes(path, most, remedy);
    }
    read(File::open(path).map_err(|source| unreadable(path, source))?, path, most, remedy)
}

/// Whether it is a pipe or a terminal, and no file that lies in a folder.
pub(super) fn is_stream(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|about| !about.is_file() && !about.is_dir())
}

/// The text of a regular file of at most `most` bytes, without a byte order mark.
///
/// Errors: as [`bytes`], and [`Error::Format`] of this name where it is no UTF-8.
pub(crate) fn text(path: &Path, most: u64, format: &'static str) -> Result<String> {
    let bytes = bytes(path, most, "give a shorter file")?;
    let wrong = |reason: String| Error::Format { path: path.to_owned(), format, reason };
    decoded(&bytes).map(str::to_owned).map_err(|error| wrong(error.to_string()))
}

/// Why bytes are no text, and from which of them on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(crate) enum NotUtf8<'a> {
    /// Two bytes a character, as some editors call "Unicode".
    #[error("the text is UTF-16; save it as UTF-8")]
    Utf16,
    /// Behind this text.
    #[error("the text is not UTF-8 from byte {} on; save it as UTF-8", .0.len())]
    Behind(&'a str),
}

/// Bytes as text, without a byte order mark.
///
/// Errors: what they are instead.
pub(crate) fn decoded(bytes: &[u8]) -> Result<&str, NotUtf8<'_>> {
    // Text in Latin letters has a zero in every pair, and JSON or OBJ has no zero at all.
    let is_utf16 =
        matches!(bytes, [0xFF, 0xFE, ..] | [0xFE, 0xFF, ..] | [0, 1..=0xFF, ..] | [1..=0xFF, 0, ..]);
    if is_utf16 {
        return Err(NotUtf8::Utf16);
    }
    let bytes = bytes.strip_prefix(MARK).unwrap_or(bytes);
    std::str::from_utf8(bytes).map_err(|error| {
        let (valid, _) = bytes.split_at(error.valid_up_to());
        NotUtf8::Behind(std::str::from_utf8(valid).unwrap_or_default())
    })
}

/// Where a file is that another one names.
///
/// The name is relative to `folder`, the folder of the file that names it, or absolute; `..` leads to the folder above. As programs on
/// Windows write `\` between folders, and some write `%20` for a space, these are tried where no file has the name as it is written.
///
/// Errors: [`Error::Value`] for an empty name, and for an address in the network: nothing is fetched.
pub(crate) fn named(folder: &Path, name: &str) -> Result<PathBuf> {
    if name.is_empty() {
        return Err(Error::value("", "an empty name", "a file, relative to the file that names it"));
    }
    let written = folder.join(name);
    if written.exists() {
        return Ok(written);
    }
    let is_address = name.contains("://") || name.starts_with(r"\\") || name.starts_with("//");
    if is_address {
        let expected = "a file on this machine: nothing is fetched from elsewhere";
        return Err(Error::value("", format!("`{name}`"), expected));
    }
    let slashed = name.replace('\\', "/");
    let others = [slashed.clone(), unescaped(&slashed).into_owned()].map(|name| folder.join(name));
    Ok(others.into_iter().find(|path| path.exists()).unwrap_or(written))
}

/// With `%20` and the like replaced by what they stand for.
fn unescaped(name: &str) -> Cow<'_, str> {
    if !name.contains('%') {
        return name.into();
    }
    let mut bytes = Vec::with_capacity(name.len());
    let mut rest = name.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let digits = (first == b'%').then(|| after.get(..2)).flatten();
        let digits = digits.filter(|digits| digits.iter().all(u8::is_ascii_hexdigit));
        let code = digits.and_then(|d| u8::from_str_radix(std::str::from_utf8(d).ok()?, 16).ok());
        bytes.push(code.unwrap_or(first));
        rest = if code.is_some() { &after[2..] } else { after };
    }
    String::from_utf8_lossy(&bytes).into_owned().into()
}

fn read(file: File, path: &Path, most: u64, remedy: &'static str) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    // Up to one byte more than allowed: the length that a file claims need not be its length.
    file.take(most + 1).read_to_end(&mut bytes).map_err(|source| unreadable(path, source))?;
    if bytes.len() as u64 > most {
        return Err(too_large(path, "more", most, remedy));
    }
    Ok(bytes)
}

/// What it is, where it is no regular file.
fn irregular(kind: FileType) -> Option<&'static str> {
    if kind.is_file() {
        return None;
    }
    if kind.is_dir() {
        return Some("a folder");
    }
    #[cfg(unix)]
    if std::os::unix::fs::FileTypeExt::is_fifo(&kind) {
        return Some("a pipe");
    }
    Some("a device")
}

fn unreadable(path: &Path, source: io::Error) -> Error {
    Error::File { action: "read", path: path.to_owned(), source }
}

fn too_large(path: &Path, needed: &str, most: u64, remedy: &'static str) -> Error {
    let limit = if most >= 1 << 20 { format!("{} MiB", most >> 20) } else { format!("{most} bytes") };
    Error::TooLarge { what: path.display().to_string(), needed: needed.to_owned(), limit, remedy }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        (folder, path)
    }

    #[test]
    fn a_file_is_read_up_to_its_bound_and_named_beyond_it() {
        let (_folder, path) = written("a b.json", b"12345");
        assert_eq!(bytes(&path, 5, "shorten it").unwrap(), b"12345");
        let message = bytes(&path, 4, "shorten it").unwrap_err().to_string();
        assert!(
            message.contains("a b.json would need 5 bytes and 4 bytes are allowed; shorten it"),
            "{message}"
        );
    }

    #[cfg(unix)]
    #[test]
    fn folders_devices_and_pipes_are_refused_by_name_and_nobody_waits() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
        assert!(made.success());
        for (path, kind) in
            [(folder.path(), "a folder"), (Path::new("/dev/null"), "a device"), (pipe.as_path(), "a pipe")]
        {
            let message = open(path).unwrap_err().to_string();
            assert!(message.contains(&format!("it is {kind}, and must be a file")), "{message}");
        }
        let missing = folder.path().join("missing");
        assert!(
            matches!(open(&missing), Err(Error::File { source, .. }) if source.kind() == io::ErrorKind::NotFound)
        );
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_is_read_to_its_end_where_one_may_be() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let writer = std::thread::spawn({
            let pipe = pipe.clone();
            move || std::fs::write(pipe, vec![b'x'; 100_000]).unwrap()
        });
        assert_eq!(bytes_or_pipe(&pipe, 1 << 20, "").unwrap(), vec![b'x'; 100_000]);
        writer.join().unwrap();
    }

    #[test]
    fn text_is_utf_8_with_or_without_a_mark_and_utf_16_is_called_so() {
        for (bytes, told) in [
            (&b"\xEF\xBB\xBF{\"\xC3\xA9\"}\r\n"[..], Ok("{\"é\"}\r\n")),
            (b"plain", Ok("plain")),
            (b"", Ok("")),
            (b"{\0\"\0", Err(NotUtf8::Utf16)),
            (b"\0{\0\"", Err(NotUtf8::Utf16)),
            (b"\xFF\xFE{\0", Err(NotUtf8::Utf16)),
            (b"ab\xFFc", Err(NotUtf8::Behind("ab"))),
        ] {
            assert_eq!(decoded(bytes), told);
        }
    }

    #[test]
    fn names_are_found_as_they_are_written_and_else_as_other_systems_write_them() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("back")).unwrap();
        for name in ["back/r 0.png", "50%20.png", "x.png"] {
            std::fs::write(folder.path().join(name), b"").unwrap();
        }
        for (name, found) in [
            ("back/r 0.png", "back/r 0.png"),
            (r"back\r 0.png", "back/r 0.png"),
            (r".\back\r%200.png", "./back/r 0.png"),
            ("50%20.png", "50%20.png"),
            ("back/../x.png", "back/../x.png"),
            ("missing%20.png", "missing%20.png"),
        ] {
            assert_eq!(named(folder.path(), name).unwrap(), folder.path().join(found), "{name}");
        }
        let absolute = folder.path().join("x.png");
        assert_eq!(named(Path::new("elsewhere"), absolute.to_str().unwrap()).unwrap(), absolute);
        for refused in ["", "https://example.org/a.png", r"\\server\a.png", "//server/a.png"] {
            assert!(matches!(named(folder.path(), refused), Err(Error::Value { .. })), "{refused}");
        }
    }
}
