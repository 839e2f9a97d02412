use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use crate::io::input;
use crate::{Error, Result};

/// The bytes of a file, least significant first. Nothing is allocated before the file is known to have it.
pub(super) struct ByteReader<'p, R> {
    bytes: R,
    path: &'p Path,
    at: u64,
    end: u64,
}

impl<'p> ByteReader<'p, BufReader<File>> {
    /// Errors: [`Error::File`].
    pub(super) fn open(path: &'p Path) -> Result<Self> {
        Self::new(BufReader::new(input::open(path)?.0), path)
    }
}

impl<'p, R: Read + Seek> ByteReader<'p, R> {
    /// Errors: [`Error::File`] where the length cannot be found out.
    pub(super) fn new(bytes: R, path: &'p Path) -> Result<Self> {
        let mut source = Self { bytes, path, at: 0, end: 0 };
        source.end = source.bytes.seek(SeekFrom::End(0)).map_err(|error| source.refused(error))?;
        source.go_to(0)?;
        Ok(source)
    }

    /// The file.
    pub(super) fn path(&self) -> &'p Path {
        self.path
    }

    /// How far into the file the next byte is.
    pub(super) fn at(&self) -> u64 {
        self.at
    }

    /// Continues at a place between the first byte and the last.
    pub(super) fn go_to(&mut self, place: u64) -> Result<()> {
        if place > self.end {
            return Err(self.broken(format!("it points to byte {place} and ends at byte {}", self.end)));
        }
        self.bytes.seek(SeekFrom::Start(place)).map_err(|error| self.refused(error))?;
        self.at = place;
        Ok(())
    }

    /// Ends earlier, so that what belongs to one grid cannot run into the next.
    pub(super) fn end_at(&mut self, place: u64) {
        self.end = self.end.min(place);
    }

    /// Leaves `count` bytes out.
    pub(super) fn skip(&mut self, count: u64) -> Result<()> {
        self.need(count)?;
        // Less than the length of a file, which is a signed number.
        self.bytes.seek_relative(count as i64).map_err(|error| self.refused(error))?;
        self.at += count;
        Ok(())
    }

    /// Errors: [`Error::Format`] where the file has fewer, before any memory is taken.
    pub(super) fn bytes(&mut self, count: usize) -> Result<Vec<u8>> {
        self.need(count as u64)?;
        let mut bytes = vec![0; count];
        self.fill(&mut bytes)?;
        Ok(bytes)
    }

    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        self.need(N as u64)?;
        let mut bytes = [0; N];
        self.fill(&mut bytes)?;
        Ok(bytes)
    }

    fn fill(&mut self, bytes: &mut [u8]) -> Result<()> {
        self.bytes.read_exact(bytes).map_err(|error| self.refused(error))?;
        self.at += bytes.len() as u64;
        Ok(())
    }

    pub(super) fn u8(&mut self) -> Result<u8> {
        Ok(u8::from_le_bytes(self.array()?))
    }

    pub(super) fn u32(&mut self) -> Result<u32> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(super) fn i64(&mut self) -> Result<i64> {
        Ok(i64::from_le_bytes(self.array()?))
    }

    /// A point of the index space.
    pub(super) fn index(&mut self) -> Result<[i64; 3]> {
        let mut index = [0; 3];
        for side in &mut index {
            *side = i32::from_le_bytes(self.array()?).into();
        }
        Ok(index)
    }

    pub(super) fn f64s<const N: usize>(&mut self) -> Result<[f64; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = f64::from_le_bytes(self.array()?);
        }
        Ok(values)
    }

    pub(super) fn f32s<const N: usize>(&mut self) -> Result<[f32; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = f32::from_le_bytes(self.array()?);
        }
        Ok(values)
    }

    /// A name or a type, with its length before it.
    pub(super) fn text(&mut self) -> Result<String> {
        let length = self.u32()? as usize;
        if length > MAX_TEXT {
            return Err(self.broken(format!("a name in it claims {length} letters")));
        }
        Ok(String::from_utf8_lossy(&self.bytes(length)?).into_owned())
    }

    fn need(&self, count: u64) -> Result<()> {
        if count > self.end.saturating_sub(self.at) {
            return Err(
                self.broken(format!("it is cut short: {count} bytes are missing at byte {}", self.at))
            );
        }
        Ok(())
    }

    /// The error of a file that is not what its format promises.
    pub(super) fn broken(&self, reason: impl Into<String>) -> Error {
        Error::Format { path: self.path.to_owned(), format: "VDB", reason: reason.into() }
    }

    fn refused(&self, source: std::io::Error) -> Error {
        Error::File { action: "read", path: self.path.to_owned(), source }
    }
}

/// Letters of a name or a type at most.
const MAX_TEXT: usize = 4096;
