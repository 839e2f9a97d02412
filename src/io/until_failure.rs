use std::io::{Error, ErrorKind, Result, Seek, SeekFrom, Write};

/// A writer that fails once: after its first error it takes everything and keeps nothing.
///
/// For encoders that write again when they are dropped, and have no other way to say that this failed than to print.
#[derive(Debug)]
pub(super) struct UntilFailure<W> {
    writer: W,
    failed: bool,
    /// Where the next byte goes and where the last one ended; kept for when the writer cannot be asked any more.
    position: u64,
    end: u64,
}

impl<W: Write + Seek> UntilFailure<W> {
    /// Around a writer that is at its start and empty.
    pub(super) fn new(writer: W) -> Self {
        Self { writer, failed: false, position: 0, end: 0 }
    }

    fn noted<T>(&mut self, result: Result<T>) -> Result<T> {
        self.failed |= result.as_ref().is_err_and(|error| error.kind() != ErrorKind::Interrupted);
        result
    }
}

impl<W: Write + Seek> Write for UntilFailure<W> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        let mut written = bytes.len();
        if !self.failed {
            let result = self.writer.write(bytes);
            written = self.noted(result)?;
        }
        self.position += written as u64;
        self.end = self.end.max(self.position);
        Ok(written)
    }

    fn flush(&mut self) -> Result<()> {
        if self.failed {
            return Ok(());
        }
        let result = self.writer.flush();
        self.noted(result)
    }
}

impl<W: Write + Seek> Seek for UntilFailure<W> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.position = if self.failed {
            let place = match to {
                SeekFrom::Start(place) => Some(place),
                SeekFrom::End(offset) => self.end.checked_add_signed(offset),
                SeekFrom::Current(offset) => self.position.checked_add_signed(offset),
            };
            place.ok_or_else(|| Error::from(ErrorKind::InvalidInput))?
        } else {
            let result = self.writer.seek(to);
            self.noted(result)?
        };
        Ok(self.position)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::io::Cursor;

    use super::*;

    #[test]
    fn what_is_written_arrives() {
        let mut bytes = Cursor::new(Vec::new());
        let mut writer = UntilFailure::new(&mut bytes);
        writer.write_all(b"hallo").unwrap();
        assert_eq!(writer.seek(SeekFrom::Start(1)).unwrap(), 1);
        writer.write_all(b"e").unwrap();
        assert_eq!(writer.seek(SeekFrom::End(0)).unwrap(), 5);
        writer.flush().unwrap();
        assert_eq!(bytes.into_inner(), b"hello");
    }

    #[test]
    fn it_fails_once_and_still_knows_where_it_is() {
        let mut room = [0; 4];
        let mut writer = UntilFailure::new(Cursor::new(&mut room[..]));
        assert!(writer.write_all(b"too much").is_err());
        // `write_all` gives up on a writer that takes nothing, which that writer does not call an error.
        writer.failed = true;
        writer.write_all(b"more").unwrap();
        assert_eq!(writer.stream_position().unwrap(), 8);
        assert_eq!(writer.seek(SeekFrom::End(-6)).unwrap(), 2);
        assert!(writer.seek(SeekFrom::Current(-3)).is_err());
        writer.flush().unwrap();
        assert_eq!(&room, b"too ");
    }
}
