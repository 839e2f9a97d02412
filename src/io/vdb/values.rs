use std::io::{Read, Seek};

use half::f16;

use super::byte_reader::ByteReader;
use super::mask::Mask;
use super::packing::{Compression, Packer, Unpacker};
use crate::Result;

/// What the byte before the values of a node says of its inactive ones. Where the grid stores active values only,
/// this is enough to restore the others.
mod inactive {
    /// All are the background.
    pub(super) const BACKGROUND: u8 = 0;
    // All are minus the background: 1.
    /// All are one value, which follows.
    pub(super) const ONE: u8 = 2;
    /// Each is minus the background or, where a mask is on, the background.
    pub(super) const SIGNED: u8 = 3;
    /// Each is a value, which follows, or, where a mask is on, the background.
    pub(super) const BACKGROUND_AND_ONE: u8 = 4;
    /// Each is the first or, where a mask is on, the second of two values, which follow.
    pub(super) const TWO: u8 = 5;
    /// They are stored like active ones.
    pub(super) const STORED: u8 = 6;
}

/// Reads the values of nodes: `C` numbers a voxel.
pub(super) struct Decoder<const C: usize> {
    pub(super) background: [f32; C],
    half: bool,
    active_only: bool,
    unpacker: Unpacker,
}

impl<const C: usize> Decoder<C> {
    pub(super) fn new(compression: Compression, active_only: bool, half: bool) -> Self {
        Self { background: [0.0; C], half, active_only, unpacker: Unpacker::new(compression) }
    }

    /// The values of a node, one for each bit of its mask.
    ///
    /// Errors: [`Error::Format`](crate::Error::Format).
    pub(super) fn node<R: Read + Seek>(
        &mut self,
        source: &mut ByteReader<R>,
        active: &Mask,
    ) -> Result<Vec<[f32; C]>> {
        let code = source.u8()?;
        if code > inactive::STORED {
            return Err(source.broken(format!("a node has an unknown code, {code}, for its inactive values")));
        }
        let mut first = self.background;
        let mut second = self.background;
        match code {
            inactive::BACKGROUND => {}
            inactive::ONE | inactive::BACKGROUND_AND_ONE => first = source.f32s()?,
            inactive::TWO => [first, second] = [source.f32s()?, source.f32s()?],
            _ => first = first.map(|value| -value),
        }
        let mut chosen = Mask::none(0);
        if (inactive::SIGNED..=inactive::TWO).contains(&code) {
            chosen = Mask::read(source, active.len())?;
        }
        if !self.active_only || code == inactive::STORED {
            return self.plain(source, active.len());
        }
        let mut stored = self.plain(source, active.count())?.into_iter();
        let inactive = |slot| if chosen.has(slot) { second } else { first };
        let value =
            |slot| active.has(slot).then(|| stored.next()).flatten().unwrap_or_else(|| inactive(slot));
        Ok((0..active.len()).map(value).collect())
    }

    /// `count` values in a row.
    ///
    /// Errors: [`Error::Format`](crate::Error::Format).
    pub(super) fn plain<R: Read + Seek>(
        &mut self,
        source: &mut ByteReader<R>,
        count: usize,
    ) -> Result<Vec<[f32; C]>> {
        if self.half && count == 0 {
            // Not even a length is stored then.
            return Ok(Vec::new());
        }
        let bytes = self.unpacker.unpack(source, count * C * if self.half { 2 } else { 4 })?;
        let numbers: Vec<f32> = if self.half {
            bytes.as_chunks().0.iter().map(|&number| f16::from_le_bytes(number).to_f32()).collect()
        } else {
            bytes.as_chunks().0.iter().map(|&number| f32::from_le_bytes(number)).collect()
        };
        Ok(numbers.as_chunks().0.to_vec())
    }
}

/// Writes the values of nodes whose inactive ones are all the background.
pub(super) struct Encoder {
    half: bool,
    packer: Packer,
}

impl Encoder {
    pub(super) fn new(compression: Compression, half: bool) -> Self {
        Self { half, packer: Packer::new(compression) }
    }

    /// The stored form of the values of a node, given its active ones; [`Decoder::node`] undoes it.
    pub(super) fn node<const C: usize>(&mut self, active: &[[f32; C]]) -> Vec<u8> {
        let numbers = active.as_flattened();
        let mut bytes = vec![inactive::BACKGROUND];
        if self.half && !numbers.is_empty() {
            let plain = numbers.iter().flat_map(|&number| f16::from_f32(number).to_le_bytes()).collect();
            bytes.extend(self.packer.pack(plain, 2));
        } else if !self.half {
            let plain = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
            bytes.extend(self.packer.pack(plain, 4));
        }
        bytes
    }
}
