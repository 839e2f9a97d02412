//! Volumes in and out. The extension of a file decides what it must be; what it holds is never trusted.
//!
//! | extension | what                          | numbers           | place               |
//! |-----------|-------------------------------|-------------------|---------------------|
//! | `.npy`    | one NumPy array               | f16, f32, f64, u8 | none                |
//! | `.npz`    | NumPy arrays in an archive    | f16, f32, f64, u8 | any, `world_from_grid` |
//! | `.vol`    | grid volume of Mitsuba        | f32 (in: f16, u8) | a box along the axes |
//! | `.json`   | header of a raw file          | f16, f32 (in: u8) | any                 |
//! | `.vdb`    | OpenVDB                       | f16, f32          | any                 |
//!
//! Numbers keep their values (bytes are 0 to 255), except for the bytes of a `.vol`, which stand for 0 to 1.

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
use crate::scene::Volume;
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
    let format = Format::of(path)?;
    if let (Some(member), Format::Npy | Format::Vol | Format::Raw) = (member, format) {
        let reason = format!("it holds one volume without a name, so `{member}` cannot be chosen");
        return Err(VolumeFile { path, format }.wrong(reason));
    }
    match format {
        Format::Npy => npy::read(path),
        Format::Npz => npz::read(path, member),
        Format::Vol => vol::read(path),
        Format::Raw => raw::read(path),
        Format::Vdb => vdb::read(path, member).map(|volume| Stored { volume, placed: true }),
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
        return Err(VolumeFile { path, format }.wrong(reason));
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
