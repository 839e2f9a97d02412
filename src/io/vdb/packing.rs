use std::io::{Read, Seek};

use flate2::{Compress, Decompress, FlushCompress, FlushDecompress, Status};

use super::blosc;
use super::byte_reader::ByteReader;
use crate::Result;

/// How the values of a written file are packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Compression {
    /// As they are.
    None,
    /// With zlib, which every program reads.
    #[default]
    Zip,
    /// With Blosc (LZ4 after a byte shuffle): faster to write, but unknown to programs that are built without it.
    Blosc,
}

/// Bits of the number that stands before each grid.
const ZIP: u32 = 1;
const ACTIVE_ONLY: u32 = 2;
const BLOSC: u32 = 4;

impl Compression {
    /// What the flags of a grid say, and whether only active values are stored; none for flags that are unknown.
    pub(super) fn of_flags(flags: u32) -> Option<(Self, bool)> {
        let packing = match flags & !ACTIVE_ONLY {
            0 => Self::None,
            ZIP => Self::Zip,
            // Blosc goes first where both are set.
            BLOSC | 5 => Self::Blosc,
            _ => return None,
        };
        Some((packing, flags & ACTIVE_ONLY != 0))
    }

    /// The flags of a grid that stores active values only.
    pub(super) fn flags(self) -> u32 {
        ACTIVE_ONLY
            | match self {
                Self::None => 0,
                Self::Zip => ZIP,
                Self::Blosc => BLOSC,
            }
    }

    /// How OpenVDB describes these flags.
    pub(super) fn description(self) -> &'static str {
        match self {
            Self::None => "active values",
            Self::Zip => "zip + active values",
            Self::Blosc => "blosc + active values",
        }
    }
}

/// Unpacks buffers one after the other.
pub(super) struct Unpacker {
    compression: Compression,
    inflate: Decompress,
}

impl Unpacker {
    pub(super) fn new(compression: Compression) -> Self {
        Self { compression, inflate: Decompress::new(true) }
    }

    /// The next buffer, `len` bytes when unpacked; the caller knows `len` from the kind of node.
    ///
    /// Errors: [`Error::Format`](crate::Error::Format).
    pub(super) fn unpack<R: Read + Seek>(
        &mut self,
        source: &mut ByteReader<R>,
        len: usize,
    ) -> Result<Vec<u8>> {
        if self.compression == Compression::None {
            return source.bytes(len);
        }
        let claim = source.i64()?;
        let packed = usize::try_from(claim.unsigned_abs()).unwrap_or(usize::MAX);
        if claim <= 0 {
            // Zero or less: as many bytes as they are.
            if packed != len {
                return Err(source.broken(format!("a buffer of {len} bytes claims {packed}")));
            }
            return source.bytes(len);
        }
        if packed > len + len / 64 + 1024 {
            return Err(source.broken(format!("a buffer of {len} bytes claims {packed} when packed")));
        }
        let packed = source.bytes(packed)?;
        let mut plain = vec![0; len];
        match self.compression {
            Compression::Zip => self.inflate(&packed, &mut plain),
            _ => blosc::decode(&packed, &mut plain),
        }
        .map_err(|reason| source.broken(reason))?;
        Ok(plain)
    }

    fn inflate(&mut self, packed: &[u8], plain: &mut [u8]) -> Result<(), String> {
        self.inflate.reset(true);
        let status = self.inflate.decompress(packed, plain, FlushDecompress::Finish);
        if !matches!(status, Ok(Status::StreamEnd)) || self.inflate.total_out() != plain.len() as u64 {
            return Err("a buffer that zlib packed does not unpack".to_owned());
        }
        Ok(())
    }
}

/// Packs buffers one after the other.
pub(super) struct Packer {
    compression: Compression,
    deflate: Compress,
}

impl Packer {
    pub(super) fn new(compression: Compression) -> Self {
        Self { compression, deflate: Compress::new(flate2::Compression::default(), true) }
    }

    /// The packed form of `plain`, which are values of `width` bytes; [`Unpacker::unpack`] undoes it.
    pub(super) fn pack(&mut self, plain: Vec<u8>, width: usize) -> Vec<u8> {
        let shorter = match self.compression {
            Compression::None => return plain,
            Compression::Zip => self.deflate(&plain),
            Compression::Blosc => blosc::encode(&plain, width),
        };
        match shorter {
            Some(packed) => [&(packed.len() as i64).to_le_bytes()[..], &packed].concat(),
            None => [&(-(plain.len() as i64)).to_le_bytes()[..], &plain].concat(),
        }
    }

    /// None where it would not be shorter.
    fn deflate(&mut self, plain: &[u8]) -> Option<Vec<u8>> {
        self.deflate.reset();
        let mut packed = vec![0; plain.len().checked_sub(1)?];
        let status = self.deflate.compress(plain, &mut packed, FlushCompress::Finish);
        packed.truncate(usize::try_from(self.deflate.total_out()).ok()?);
        matches!(status, Ok(Status::StreamEnd)).then_some(packed)
    }
}
