//! What a solve needs to be continued, in one file.
//!
//! A line of magic, a line of JSON with the lengths, then all numbers as little-endian f64: f32 vectors survive
//! the way there and back to the last bit.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{input, write_whole};
use crate::{Error, Result};

const MAGIC: &str = "unscatter checkpoint 2";

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
            writeln!(file, "{MAGIC}\n{header}").map_err(failed)?;
            hand_out(&mut |block| {
                block.iter().try_for_each(|value| file.write_all(&value.to_le_bytes())).map_err(failed)
            })
        })
    }

    /// Reads a file that [`Checkpoint::write`] has written for the same problem.
    ///
    /// Errors: [`Error::Checkpoint`] when it is another problem's, or damaged.
    pub fn read(path: &Path, fingerprint: u64) -> Result<Self> {
        let wrong = |reason: &str| Error::Checkpoint { path: path.to_owned(), reason: reason.to_owned() };
        let (file, size) = input::open(path)?;
        let mut file = BufReader::new(file.take(size));
        let mut line = |limit: u64| -> Result<String> {
            let mut text = String::new();
            file.by_ref().take(limit).read_line(&mut text).map_err(|_| wrong("its header is not text"))?;
            Ok(text)
        };
        if line(64)?.trim_end() != MAGIC {
            return Err(wrong("it is not a checkpoint of this version"));
        }
        let header: Header =
            serde_json::from_str(&line(1 << 16)?).map_err(|_| wrong("its header cannot be read"))?;
        if header.fingerprint != format!("{fingerprint:016x}") {
            return Err(wrong("the scene or its settings have changed; solve again without resume"));
        }
        let mut blocks = Vec::new();
        for length in header.lengths {
            // Nothing is allocated on the word of the header alone.
            if length > size / 8 {
                return Err(wrong("it is shorter than its header says"));
            }
            let mut bytes = vec![0; length as usize * 8];
            file.read_exact(&mut bytes).map_err(|_| wrong("it is shorter than its header says"))?;
            let (words, _) = bytes.as_chunks::<8>();
            blocks.push(words.iter().map(|&word| f64::from_le_bytes(word)).collect());
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
