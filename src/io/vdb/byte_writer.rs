use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

use crate::{Error, Result};

/// Writes bytes in the order in which a [`ByteReader`](super::byte_reader::ByteReader) reads them.
pub(super) struct ByteWriter<'p, W> {
    file: W,
    path: &'p Path,
}

impl<'p, W: Write + Seek> ByteWriter<'p, W> {
    pub(super) fn new(file: W, path: &'p Path) -> Self {
        Self { file, path }
    }

    /// Errors: [`Error::File`].
    pub(super) fn put(&mut self, bytes: &[u8]) -> Result<()> {
        self.file.write_all(bytes).map_err(|error| self.refused(error))
    }

    pub(super) fn at(&mut self) -> Result<u64> {
        self.file.stream_position().map_err(|error| self.refused(error))
    }

    /// Replaces what was put at `place` and continues at the end.
    pub(super) fn replace(&mut self, place: u64, bytes: &[u8]) -> Result<()> {
        self.file.seek(SeekFrom::Start(place)).map_err(|error| self.refused(error))?;
        self.put(bytes)?;
        self.file.seek(SeekFrom::End(0)).map(|_| ()).map_err(|error| self.refused(error))
    }

    fn refused(&self, source: std::io::Error) -> Error {
        Error::File { action: "write", path: self.path.to_owned(), source }
    }
}
