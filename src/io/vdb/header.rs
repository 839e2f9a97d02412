use std::collections::HashMap;
use std::io::{Read, Seek};

use super::byte_reader::ByteReader;
use super::packing::Compression;
use crate::Result;

/// The first eight bytes.
pub(super) const MAGIC: u64 = 0x5644_4220;
/// What a written file says of its format and of the library that would have written it.
pub(super) const WRITTEN: [u32; 3] = [224, 10, 0];
/// From this version on, each grid says how it is packed and each node what its inactive values are.
pub(super) const CODED_NODES: u32 = 222;
const VERSIONS: std::ops::RangeInclusive<u32> = 220..=225;
/// Hexadecimal digits and hyphens that tell files apart.
pub(super) const UUID: u64 = 36;
/// Stands between a name that several grids share and a number.
const SEPARATOR: char = '\u{1e}';
/// Follows the type of a grid that is stored in half precision.
pub(super) const HALF: &str = "_HalfFloat";

/// What a file says of itself before its first grid, and of each grid.
pub(super) struct Header {
    pub(super) version: u32,
    /// How all grids are packed, in versions before [`CODED_NODES`].
    pub(super) compression: Compression,
    pub(super) grids: Vec<Descriptor>,
}

/// What stands before a grid.
pub(super) struct Descriptor {
    /// As people write it: `density`, or `density[1]` where several share a name.
    pub(super) name: String,
    /// Such as `Tree_float_5_4_3`.
    pub(super) tree: String,
    pub(super) half: bool,
    /// The grid whose voxels this one shares; empty for a grid of its own.
    pub(super) instance_of: String,
    pub(super) start: u64,
    pub(super) end: u64,
}

impl Header {
    /// Errors: [`Error::Format`](crate::Error::Format).
    pub(super) fn read<R: Read + Seek>(source: &mut ByteReader<R>) -> Result<Self> {
        if source.array()? != MAGIC.to_le_bytes() {
            return Err(source.broken("it does not begin like one"));
        }
        let version = source.u32()?;
        if !VERSIONS.contains(&version) {
            let [least, most] = [VERSIONS.start(), VERSIONS.end()];
            return Err(source.broken(format!(
                "its version is {version}, where {least} to {most} are read; save it again"
            )));
        }
        // The version of the library that wrote it.
        source.skip(8)?;
        if source.u8()? == 0 {
            return Err(source
                .broken("it was written as a stream, without saying where its grids are; save it again"));
        }
        let mut compression = Compression::None;
        if version < CODED_NODES && source.u8()? != 0 {
            compression = Compression::Zip;
        }
        source.skip(UUID)?;
        Metadata::read(source)?;
        let count = source.u32()?;
        // Grows with what is read, as the count may claim anything.
        let mut grids = Vec::new();
        for _ in 0..count {
            grids.push(Descriptor::read(source)?);
        }
        number_namesakes(&mut grids);
        Ok(Self { version, compression, grids })
    }

    /// The grid with a name; without one the only grid, or `density` among several.
    ///
    /// Errors: a sentence with the names that there are.
    pub(super) fn choose(&self, name: Option<&str>) -> Result<&Descriptor, String> {
        if let (None, [only]) = (name, self.grids.as_slice()) {
            return Ok(only);
        }
        let wanted = name.unwrap_or("density");
        let is_one_of_many = |grid: &Descriptor| {
            let number = grid.name.strip_prefix(wanted).and_then(|rest| rest.strip_prefix('['));
            number.is_some_and(|number| number.ends_with(']'))
        };
        let mut found: Vec<_> = self.grids.iter().filter(|grid| grid.name == wanted).collect();
        if found.is_empty() {
            found = self.grids.iter().filter(|grid| is_one_of_many(grid)).collect();
        }
        if let [only] = found[..] {
            return Ok(only);
        }
        let shown = |grid: &Descriptor| format!("`{}`", grid.name);
        let names: Vec<_> = self.grids.iter().map(shown).collect();
        Err(match (names.is_empty(), found.is_empty(), name) {
            (true, ..) => "it holds no grids".to_owned(),
            (_, false, _) => {
                let found: Vec<_> = found.into_iter().map(shown).collect();
                format!("it has several grids `{wanted}`, name one of {}", found.join(", "))
            }
            (.., Some(name)) => format!("it has no grid `{name}`, but {}", names.join(", ")),
            (.., None) => format!("it has several grids, name one of {}", names.join(", ")),
        })
    }
}

/// Numbers the grids that share a name where the file does not.
fn number_namesakes(grids: &mut [Descriptor]) {
    let mut count: HashMap<String, usize> = HashMap::new();
    grids.iter().for_each(|grid| *count.entry(grid.name.clone()).or_default() += 1);
    count.retain(|_, count| *count > 1);
    for grid in grids.iter_mut().rev() {
        if let Some(left) = count.get_mut(&grid.name) {
            *left -= 1;
            grid.name = format!("{}[{left}]", grid.name);
        }
    }
}

impl Descriptor {
    /// Reads one and continues behind its grid.
    fn read<R: Read + Seek>(source: &mut ByteReader<R>) -> Result<Self> {
        let unique = source.text()?;
        let tree = source.text()?;
        let instance_of = source.text()?;
        let [start, blocks, end] = [source.i64()?, source.i64()?, source.i64()?];
        let name = match unique.split_once(SEPARATOR) {
            Some((name, number)) => format!("{name}[{number}]"),
            None => unique,
        };
        let [start, end] = [start, end].map(|place| u64::try_from(place).unwrap_or(0));
        // A grid that ended before its beginning would be read again and again.
        if start < source.at() || end < start || blocks < 0 {
            return Err(source.broken(format!("it does not say where its grid `{name}` is")));
        }
        source.go_to(end)?;
        let (tree, half) = match tree.strip_suffix(HALF) {
            Some(tree) => (tree.to_owned(), true),
            None => (tree, false),
        };
        Ok(Self { name, tree, half, instance_of, start, end })
    }
}

/// What is wanted of the named values of a file or grid.
pub(super) struct Metadata {
    /// Whether numbers are stored in half precision, where that is said.
    pub(super) half: Option<bool>,
    /// Whether the grid holds distances to a surface.
    pub(super) is_level_set: bool,
}

impl Metadata {
    /// Errors: [`Error::Format`](crate::Error::Format).
    pub(super) fn read<R: Read + Seek>(source: &mut ByteReader<R>) -> Result<Self> {
        let (mut half, mut is_level_set) = (None, false);
        for _ in 0..source.u32()? {
            let name = source.text()?;
            source.text()?;
            match (name.as_str(), source.u32()?) {
                (SAVED_AS_HALF, 1) => half = Some(source.u8()? != 0),
                (CLASS, size) if size == LEVEL_SET.len() as u32 => {
                    is_level_set = source.array()? == *LEVEL_SET
                }
                (_, size) => source.skip(size.into())?,
            }
        }
        Ok(Self { half, is_level_set })
    }
}

/// Says that a grid is stored in half precision.
pub(super) const SAVED_AS_HALF: &str = "is_saved_as_half_float";

/// Says what a grid is for.
pub(super) const CLASS: &str = "class";
/// It holds distances to a surface, negative inside.
pub(super) const LEVEL_SET: &[u8; 9] = b"level set";

/// A text with its length before it.
pub(super) fn text(text: &str) -> Vec<u8> {
    let length = text.len() as u32;
    [&length.to_le_bytes(), text.as_bytes()].concat()
}

/// A named value, as [`Metadata::read`] takes it.
pub(super) fn entry(name: &str, kind: &str, value: &[u8]) -> Vec<u8> {
    let size = value.len() as u32;
    [text(name), text(kind), size.to_le_bytes().to_vec(), value.to_vec()].concat()
}
