//! A file read at once, with a limit.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::{Error, Result};

/// No file is read at once beyond this many bytes.
const MAX_BYTES: u64 = 1 << 32;

/// The bytes of a file.
///
/// Errors: [`Error::File`] for what cannot be read or is no file, [`Error::TooLarge`] beyond 4 GiB.
pub(super) fn read(path: &Path) -> Result<Vec<u8>> {
    let failed = |source| Error::File { action: "read", path: path.into(), source };
    let file = File::open(path).map_err(failed)?;
    let metadata = file.metadata().map_err(failed)?;
    if !metadata.is_file() {
        return Err(failed(std::io::Error::other("it is not a file")));
    }
    if metadata.len() > MAX_BYTES {
        return Err(Error::TooLarge {
            what: path.display().to_string(),
            needed: format!("{} bytes", metadata.len()),
            limit: format!("{MAX_BYTES}"),
            remedy: "split the scene",
        });
    }
    let mut bytes = Vec::with_capacity(metadata.len() as usize);
    file.take(MAX_BYTES).read_to_end(&mut bytes).map_err(failed)?;
    Ok(bytes)
}
