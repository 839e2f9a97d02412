use std::io::{Seek, Write};
use std::path::Path;

use glam::{DAffine3, DVec3};

use super::byte_writer::ByteWriter;
use super::header::{CLASS, HALF, MAGIC, SAVED_AS_HALF, WRITTEN, entry, text};
use super::packing::Compression;
use super::sparse::{Pending, Sparse, active_voxels};
use super::transform;
use super::values::Encoder;
use crate::io::whole::write_whole_seekable;
use crate::scene::Volume;
use crate::{Error, Result};

/// How a VDB file is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct WriteOptions {
    /// How values are packed.
    pub compression: Compression,
    /// In half precision: half the size, three decimal digits, at most 65504.
    pub half: bool,
}

/// Writes volumes as grids of a VDB file (version 224): grey ones as `float` fog volumes, RGB ones as `Vec3s`.
///
/// The background is 0. Voxels that are 0 are inactive, so that [`read`](super::read) gives back the box around the
/// others; where all are 0 it finds no active voxel. Only leaves with active voxels are stored, and cubes of one
/// value as tiles. The same volumes make the same file.
///
/// Errors: [`Error::Value`] for no grids or names that are empty, longer than 1000 bytes, have control characters or
/// are not distinct; [`Error::NonFinite`] for a number beyond half precision; [`Error::File`].
pub fn write(path: &Path, grids: &[(&str, &Volume)], options: WriteOptions) -> Result<()> {
    write_whole_seekable(path, |file| write_to(ByteWriter::new(file, path), grids, options))
}

/// [`write`] to anything that takes bytes.
pub(super) fn write_to<W: Write + Seek>(
    mut sink: ByteWriter<W>,
    grids: &[(&str, &Volume)],
    options: WriteOptions,
) -> Result<()> {
    check_names(grids)?;
    let library = WRITTEN.map(u32::to_le_bytes);
    sink.put(&MAGIC.to_le_bytes())?;
    sink.put(library.as_flattened())?;
    // Every grid says where it is.
    sink.put(&[1])?;
    sink.put(uuid_of(grids, options).as_bytes())?;
    // Nothing more on the file as a whole.
    sink.put(&0_u32.to_le_bytes())?;
    sink.put(&(grids.len() as u32).to_le_bytes())?;
    for (name, volume) in grids {
        let halved;
        let mut volume = *volume;
        if options.half {
            halved = volume.halved()?;
            volume = &halved;
        }
        match volume.channels() {
            1 => write_grid::<W, 1>(&mut sink, name, volume, options)?,
            _ => write_grid::<W, 3>(&mut sink, name, volume, options)?,
        }
    }
    Ok(())
}

/// Bytes of a name at most; other programs have less patience with names than with voxels.
const MAX_NAME: usize = 1000;

fn check_names(grids: &[(&str, &Volume)]) -> Result<()> {
    if grids.is_empty() {
        return Err(Error::value("grids", "an empty list", "at least one grid"));
    }
    for (index, (name, _)) in grids.iter().enumerate() {
        let shared = grids.iter().take(index).any(|(other, _)| other == name);
        if shared || name.is_empty() || name.len() > MAX_NAME || name.chars().any(char::is_control) {
            let expected = "a name of its own, of at most 1000 bytes and no control characters";
            return Err(Error::value(format!("grids[{index}]"), format!("`{name}`"), expected));
        }
    }
    Ok(())
}

fn write_grid<W: Write + Seek, const C: usize>(
    sink: &mut ByteWriter<W>,
    name: &str,
    volume: &Volume,
    options: WriteOptions,
) -> Result<()> {
    let tree = if C == 1 { "Tree_float_5_4_3" } else { "Tree_vec3s_5_4_3" };
    let suffix = if options.half { HALF } else { "" };
    // The third text would name the grid whose voxels this one shares.
    sink.put(&[text(name), text(&format!("{tree}{suffix}")), text("")].concat())?;
    let places = sink.at()?;
    sink.put(&[0; 24])?;
    let start = sink.at()?;
    sink.put(&options.compression.flags().to_le_bytes())?;
    sink.put(&metadata(name, volume, options))?;
    let centre = DAffine3::from_translation(DVec3::splat(0.5));
    sink.put(&transform::bytes(&(*volume.grid().world_from_grid() * centre)))?;
    let mut blocks = start;
    let mut encoder = Encoder::new(options.compression, options.half);
    Sparse::<C>::new(volume).write(&mut encoder, |piece| match piece {
        Pending::Bytes(bytes) => sink.put(&bytes),
        Pending::Blocks => sink.at().map(|at| blocks = at),
    })?;
    let end = sink.at()?;
    sink.replace(places, [start, blocks, end].map(u64::to_le_bytes).as_flattened())
}

fn metadata(name: &str, volume: &Volume, options: WriteOptions) -> Vec<u8> {
    let (bounds, count) = active_voxels(volume);
    let class = if volume.channels() == 1 { "fog volume" } else { "unknown" };
    let corner = |corner: [i64; 3]| corner.map(|side| (side as i32).to_le_bytes());
    let mut entries = vec![
        entry(CLASS, "string", class.as_bytes()),
        entry("creator", "string", b"unscatter"),
        entry("file_compression", "string", options.compression.description().as_bytes()),
        entry("file_voxel_count", "int64", &count.to_le_bytes()),
        entry(SAVED_AS_HALF, "bool", &[options.half.into()]),
        entry("name", "string", name.as_bytes()),
    ];
    if !bounds.is_empty() {
        entries.push(entry("file_bbox_min", "vec3i", corner(bounds.min).as_flattened()));
        entries.push(entry("file_bbox_max", "vec3i", corner(bounds.max).as_flattened()));
    }
    let number = (entries.len() as u32).to_le_bytes();
    [&number[..], &entries.concat()].concat()
}

/// Programs take files with the same one for the same file, so it follows from the content.
fn uuid_of(grids: &[(&str, &Volume)], options: WriteOptions) -> String {
    let digest = |seed: u64| {
        let mut digest = seed;
        // FNV-1a, word by word.
        let mut add = |word: u64| digest = (digest ^ word).wrapping_mul(0x0100_0000_01b3);
        add(u64::from(options.half) << 8 | options.compression as u64);
        for (name, volume) in grids {
            name.bytes().for_each(|byte| add(byte.into()));
            volume.grid().size().iter().for_each(|&side| add(side as u64));
            volume.grid().world_from_grid().to_cols_array().iter().for_each(|number| add(number.to_bits()));
            volume.samples().iter().for_each(|value| add(value.to_bits().into()));
        }
        digest
    };
    let [a, b] = [digest(0xcbf2_9ce4_8422_2325), digest(0x9e37_79b9_7f4a_7c15)];
    format!(
        "{:08x}-{:04x}-{:04x}-{:04x}-{:012x}",
        a >> 32,
        a >> 16 & 0xffff,
        a & 0xffff,
        b >> 48,
        b & (!0 >> 16)
    )
}
