//! Volumes in and out. The extension of a file decides what it must be; what it holds is never trusted.
//!
//! | extension | what                          | numbers           | place               |
//! |-----------|-------------------------------|-------------------|---------------------|
//! | `.npy`    | one NumPy array               | f16, f32 (in: f64, whole numbers, bool) | none |
//! | `.npz`    | NumPy arrays in an archive    | f16, f32 (in: f64, whole numbers, bool) | any, `world_from_grid` |
//! | `.vol`    | grid volume of Mitsuba        | f32 (in: f16, u8) | a box along the axes |
//! | `.json`   | header of a raw file          | f16, f32 (in: u8) | any                 |
//! | `.vdb`    | OpenVDB                       | f16, f32          | any                 |
//!
//! Numbers keep their values: bytes are 0 to 255, 16 bits 0 to 65535 or −32768 to 32767, true is 1. The bytes of a
//! `.vol` alone stand for 0 to 1. NumPy arrays may be in C or Fortran order and of either byte order.

mod file;
mod format;
mod npy;
mod npz;
mod raw;
#[cfg(test)]
mod tests;
mod vol;

use std::path::Path;

use file::VolumeFile;

pub use file::{MAX_VOXELS, Stored};
pub use format::Format;

use super::vdb;
use crate::scene::{Volume, VoxelGrid};
use crate::{Error, Result};

/// Reads a volume in the format that its extension stands for.
///
/// `member` names one of several volumes in an `.npz` or `.vdb`; without it there must be only one.
///
/// Errors: [`Error::File`] when the file cannot be read; [`Error::Format`] when its extension is unknown, its content is
/// not what the extension says, it has no such member, it is damaged or too large, or a value is not finite.
///
/// Cost: memory for the values, which the length of the file must make plausible before it is taken.
pub fn read(path: &Path, member: Option<&str>) -> Result<Stored> {
    read_within(path, member, &|_| Ok(()))
}

/// Reads a volume as [`read`] does, once `allow` has said that its values may take so many bytes.
///
/// Errors: as [`read`], and those of `allow`.
pub fn read_within(path: &Path, member: Option<&str>, allow: &dyn Fn(u64) -> Result<()>) -> Result<Stored> {
    let source = VolumeFile { path, format: Format::of(path)?, allow };
    if let (Some(member), Format::Npy | Format::Vol | Format::Raw) = (member, source.format) {
        let reason = format!("it holds one volume without a name, so `{member}` cannot be chosen");
        return Err(source.wrong(reason));
    }
    match source.format {
        Format::Npy => npy::read(source),
        Format::Npz => npz::read(source, member),
        Format::Vol => vol::read(source),
        Format::Raw => raw::read(source),
        Format::Vdb => {
            let vdb::Boxed { volume, first, outside } = vdb::read_within(path, member, allow)?;
            Ok(Stored { volume, placed: true, first, outside })
        }
    }
}

/// Where a volume lies, if its file says so. Of an OpenVDB file no values are kept for that.
///
/// Errors: as [`read_within`].
pub fn place(
    path: &Path,
    member: Option<&str>,
    allow: &dyn Fn(u64) -> Result<()>,
) -> Result<Option<VoxelGrid>> {
    match Format::of(path)? {
        Format::Npy => Ok(None),
        Format::Vdb => vdb::place(path, member).map(Some),
        _ => {
            let stored = read_within(path, member, allow)?;
            Ok(stored.placed.then(|| *stored.volume.grid()))
        }
    }
}

/// Writes a volume whole or not at all, over what is there.
///
/// `name` is what the volume is called inside an OpenVDB file; the other formats call it nothing, or `volume`.
///
/// `.npz`, `.json` and `.vdb` keep numbers and place. `.npy` loses the place. `.vol` keeps a box along the axes, loses
/// any other place and then fills the unit cube; its numbers become single precision, the only one that Mitsuba 3 reads.
/// A `.json` is two files, and the one with the numbers, `.raw`, is written first.
///
/// Errors: [`Error::Format`] when `path` does not end as files of that format do, [`Error::TooLarge`] for more voxels than
/// could be read again, [`Error::File`].
pub fn write(path: &Path, name: &str, volume: &Volume, format: Format) -> Result<()> {
    if Format::of(path).ok() != Some(format) {
        let reason = format!("its name must end in .{}", format.extension());
        return Err(VolumeFile { path, format, allow: &|_| Ok(()) }.wrong(reason));
    }
    let voxels = volume.grid().len();
    if voxels > MAX_VOXELS {
        return Err(Error::TooLarge {
            what: path.display().to_string(),
            needed: format!("{voxels} voxels"),
            limit: MAX_VOXELS.to_string(),
            remedy: "use fewer voxels",
        });
    }
    match format {
        Format::Npy => npy::write(path, volume),
        Format::Npz => npz::write(path, volume),
        Format::Vol => vol::write(path, volume),
        Format::Raw => raw::write(path, volume),
        Format::Vdb => vdb::write(path, &[(name, volume)], vdb::WriteOptions::default()),
    }
}
