//! What a solve needs to be continued, in one file.
//!
//! A line of magic, a line of JSON with the lengths, then all numbers as little-endian f64, then the CRC-32 of all that, least
//! significant byte first. f32 vectors survive the way there and back to the last bit.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{input, write_whole};
use crate::{Error, Result};

const MAGIC: &str = "unscatter checkpoint 3";

/// Bytes of the checksum.
const CHECKSUM: u64 = 4;

/// Named blocks of numbers, and which problem they belong to.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Checkpoint {
    /// Identifies problem and method; a checkpoint is of no use to another one.
    pub fingerprint: u64,
    /// The numbers.
    pub blocks: Vec<Vec<f64>>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    /// As text, for JSON numbers are not 64 bits wide everywhere.
    fingerprint: String,
    lengths: Vec<u64>,
}

impl Checkpoint {
    /// Writes blocks of the given `lengths`, whole or not at all. `hand_out` gives the blocks away one after the other, so that
    /// only one need be in memory.
    ///
    /// Errors: [`Error::File`] when it cannot be written; those of `hand_out`.
    pub fn write(
        path: &Path,
        fingerprint: u64,
        lengths: &[usize],
        mut hand_out: impl FnMut(&mut dyn FnMut(&[f64]) -> Result<()>) -> Result<()>,
    ) -> Result<()> {
        let header = Header {
            fingerprint: format!("{fingerprint:016x}"),
            lengths: lengths.iter().map(|&length| length as u64).collect(),
        };
        let header = serde_json::to_string(&header).map_err(|error| Error::Machine(error.to_string()))?;
        write_whole(path, |file| {
            let failed = |source| Error::File { action: "write", path: path.to_owned(), source };
            let mut sum = crc32fast::Hasher::new();
            let mut put = |bytes: &[u8]| {
                sum.update(bytes);
                file.write_all(bytes).map_err(failed)
            };
            put(format!("{MAGIC}\n{header}\n").as_bytes())?;
            hand_out(&mut |block| block.iter().try_for_each(|value| put(&value.to_le_bytes())))?;
            file.write_all(&sum.finalize().to_le_bytes()).map_err(failed)
        })
    }

    /// Reads a file that [`Checkpoint::write`] has written for the same problem.
    ///
    /// Errors: [`Error::Checkpoint`] when it is another problem's, or damaged: any changed bit is found.
    pub fn read(path: &Path, fingerprint: u64) -> Result<Self> {
        let wrong = |reason: &str| Error::Checkpoint { path: path.to_owned(), reason: reason.to_owned() };
        let damaged = || wrong("it is damaged; solve again without resume");
        let (file, size) = input::open(path)?;
        let mut file = BufReader::new(file.take(size));
        let mut sum = crc32fast::Hasher::new();
        let mut line = |limit: u64| -> Result<String> {
            let mut text = String::new();
            file.by_ref().take(limit).read_line(&mut text).map_err(|_| damaged())?;
            sum.update(text.as_bytes());
            Ok(text)
        };
        let (magic, text) = (line(64)?, line(1 << 16)?);
        if magic.trim_end() != MAGIC {
            return Err(wrong("it is not a checkpoint of this version"));
        }
        let header: Header = serde_json::from_str(&text).map_err(|_| damaged())?;
        // Nothing is allocated on the word of the header alone.
        let words = header.lengths.iter().try_fold(0_u64, |sum, &length| sum.checked_add(length));
        let body = words.and_then(|words| words.checked_mul(8)).ok_or_else(damaged)?;
        if body.checked_add((magic.len() + text.len()) as u64 + CHECKSUM) != Some(size) {
            return Err(wrong("it is not as long as it says, and damaged; solve again without resume"));
        }
        let mut blocks = Vec::with_capacity(header.lengths.len());
        for length in header.lengths {
            let mut bytes = vec![0; length as usize * 8];
            file.read_exact(&mut bytes).map_err(|_| damaged())?;
            sum.update(&bytes);
            let (words, _) = bytes.as_chunks::<8>();
            blocks.push(words.iter().map(|&word| f64::from_le_bytes(word)).collect());
        }
        let mut written = [0; CHECKSUM as usize];
        file.read_exact(&mut written).map_err(|_| damaged())?;
        if sum.finalize() != u32::from_le_bytes(written) {
            return Err(damaged());
        }
        if header.fingerprint != format!("{fingerprint:016x}") {
            return Err(wrong("the scene or its settings have changed; solve again without resume"));
        }
        Ok(Self { fingerprint, blocks })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(path: &Path, saved: &Checkpoint) {
        let lengths: Vec<usize> = saved.blocks.iter().map(Vec::len).collect();
        let written = Checkpoint::write(path, saved.fingerprint, &lengths, |put| {
            saved.blocks.iter().try_for_each(|block| put(block))
        });
        written.unwrap();
    }

    #[test]
    fn numbers_survive_and_other_problems_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint");
        let saved = Checkpoint {
            fingerprint: u64::MAX - 5,
            blocks: vec![vec![0.1, -0.0, 1e-310], vec![], vec![3.0]],
        };
        write(&path, &saved);
        assert_eq!(Checkpoint::read(&path, u64::MAX - 5).unwrap(), saved);
        assert!(matches!(Checkpoint::read(&path, 7), Err(Error::Checkpoint { .. })));
    }

    #[test]
    fn every_flipped_bit_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint");
        write(&path, &Checkpoint { fingerprint: 1, blocks: vec![vec![1.0; 5], vec![0.1, f64::INFINITY]] });
        let whole = std::fs::read(&path).unwrap();
        for bit in 0..8 * whole.len() {
            let mut flipped = whole.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            std::fs::write(&path, flipped).unwrap();
            assert!(matches!(Checkpoint::read(&path, 1), Err(Error::Checkpoint { .. })), "bit {bit}");
        }
        std::fs::write(&path, [&whole[..], b"\0"].concat()).unwrap();
        assert!(Checkpoint::read(&path, 1).is_err(), "a byte too many");
    }

    #[test]
    fn damaged_files_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint");
        write(&path, &Checkpoint { fingerprint: 1, blocks: vec![vec![1.0; 9]] });
        let whole = std::fs::read(&path).unwrap();
        for cut in 0..whole.len() {
            std::fs::write(&path, &whole[..cut]).unwrap();
            assert!(Checkpoint::read(&path, 1).is_err(), "{cut} bytes");
        }
        let absurd =
            format!("{MAGIC}\n{{\"fingerprint\":\"0000000000000001\",\"lengths\":[{}]}}\n", u64::MAX);
        std::fs::write(&path, absurd).unwrap();
        assert!(Checkpoint::read(&path, 1).is_err());
    }
}
