use std::io::{Read, Seek};

use super::byte_reader::ByteReader;
use crate::Result;

/// One bit for each slot of a node. Slot (x, y, z) of a node with 2ˡ slots a side has number (x·2ˡ + y)·2ˡ + z: z runs
/// fastest.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mask(Vec<u64>);

impl Mask {
    /// All bits off; `len` is a multiple of 64.
    pub(super) fn none(len: usize) -> Self {
        Self(vec![0; len / 64])
    }

    pub(super) fn read<R: Read + Seek>(source: &mut ByteReader<R>, len: usize) -> Result<Self> {
        let bytes = source.bytes(len / 8)?;
        Ok(Self(bytes.as_chunks().0.iter().map(|&word| u64::from_le_bytes(word)).collect()))
    }

    pub(super) fn bytes(&self) -> impl Iterator<Item = u8> + '_ {
        self.0.iter().flat_map(|word| word.to_le_bytes())
    }

    pub(super) fn len(&self) -> usize {
        64 * self.0.len()
    }

    pub(super) fn set(&mut self, slot: usize) {
        if let Some(word) = self.0.get_mut(slot / 64) {
            *word |= 1 << (slot % 64);
        }
    }

    /// Slots outside are off.
    pub(super) fn has(&self, slot: usize) -> bool {
        self.0.get(slot / 64).is_some_and(|word| word >> (slot % 64) & 1 == 1)
    }

    /// How many are on.
    pub(super) fn count(&self) -> usize {
        self.0.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// Those that are on, in order.
    pub(super) fn slots(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.len()).filter(|&slot| self.has(slot))
    }
}

/// Where slot number `slot` is among 2ˡ slots a side.
pub(super) fn place_of(slot: usize, log2: u32) -> [usize; 3] {
    let side = (1 << log2) - 1;
    [slot >> (2 * log2), slot >> log2 & side, slot & side]
}

/// The inverse of [`place_of`].
pub(super) fn slot_at([x, y, z]: [usize; 3], log2: u32) -> usize {
    (x << log2 | y) << log2 | z
}
