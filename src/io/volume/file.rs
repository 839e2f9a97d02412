//! A volume file, and what the readers of all formats share: errors that name the file, and the limits of a volume.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use glam::DAffine3;

use super::format::Format;
use crate::io::input;
use crate::io::npy::ArrayFault;
use crate::io::numbers::Encoding;
use crate::scene::{Samples, Volume, VoxelGrid};
use crate::{Error, Result};

/// Voxels at most in a file: half a billion, 6 GiB in RGB.
pub const MAX_VOXELS: usize = 1 << 29;

/// A volume as a file holds it.
#[derive(Debug, Clone, PartialEq)]
pub struct Stored {
    /// The values. Where the file does not say where they lie, they fill the cube from (0, 0, 0) to (1, 1, 1).
    pub volume: Volume,
    /// Whether the file says where they lie.
    pub placed: bool,
    /// The index that the file itself gives the first voxel: 0 but for OpenVDB.
    pub first: [i64; 3],
    /// What lies outside of the voxels: 0 but for OpenVDB, whose grids have a background.
    pub outside: [f32; 3],
}

/// A file that a volume is read from.
#[derive(Clone, Copy)]
pub(super) struct VolumeFile<'p> {
    pub(super) path: &'p Path,
    pub(super) format: Format,
    /// Whether its values may take so many bytes; asked before they do.
    pub(super) allow: &'p dyn Fn(u64) -> Result<()>,
}

impl VolumeFile<'_> {
    /// The file and its length in bytes.
    pub(super) fn open(self) -> Result<(BufReader<File>, u64)> {
        let (file, length) = input::open(self.path)?;
        Ok((BufReader::with_capacity(1 << 16, file), length))
    }

    /// The file is not what it should be.
    pub(super) fn wrong(self, reason: impl Into<String>) -> Error {
        Error::Format { path: self.path.to_owned(), format: self.format.name(), reason: reason.into() }
    }

    /// Reading has stopped: at the end of the file, at damaged content, or because the system refuses.
    pub(super) fn stopped(self, source: io::Error) -> Error {
        match source.kind() {
            io::ErrorKind::UnexpectedEof => self.wrong("it ends too early"),
            io::ErrorKind::OutOfMemory => self.refused(source),
            _ if source.raw_os_error().is_some() => self.refused(source),
            _ => self.wrong(format!("it is damaged: {source}")),
        }
    }

    /// An array in it cannot be read.
    pub(super) fn faulty(self, fault: ArrayFault) -> Error {
        match fault {
            ArrayFault::Read(source) => self.stopped(source),
            ArrayFault::Content(reason) => self.wrong(reason),
        }
    }

    fn refused(self, source: io::Error) -> Error {
        Error::File { action: "read", path: self.path.to_owned(), source }
    }

    /// The next `count` numbers, once they may be taken.
    pub(super) fn samples(self, file: &mut impl Read, encoding: Encoding, count: usize) -> Result<Samples> {
        (self.allow)(encoding.bytes(count))?;
        encoding.read_samples(file, count).map_err(|failed| self.stopped(failed))
    }

    /// How many numbers a volume has. `size` is x, y, z.
    pub(super) fn count(self, size: [usize; 3], channels: usize) -> Result<usize> {
        const MAX_SIDE: usize = VoxelGrid::MAX_SIDE;
        let [x, y, z] = size;
        if size.iter().any(|side| !(1..=MAX_SIDE).contains(side)) {
            return Err(self.wrong(format!("its size is {x} × {y} × {z}, and sides go from 1 to {MAX_SIDE}")));
        }
        if x * y * z > MAX_VOXELS {
            let voxels = x * y * z;
            return Err(self.wrong(format!("it has {voxels} voxels, and {MAX_VOXELS} are the most")));
        }
        if channels != 1 && channels != 3 {
            return Err(self.wrong(format!("it has {channels} channels instead of 1 (grey) or 3 (RGB)")));
        }
        Ok(x * y * z * channels)
    }

    /// The volume of these numbers, in the unit cube unless `world_from_grid` puts it elsewhere.
    pub(super) fn volume(
        self,
        size: [usize; 3],
        channels: usize,
        samples: Samples,
        world_from_grid: Option<DAffine3>,
    ) -> Result<Stored> {
        let grid = match world_from_grid {
            Some(world_from_grid) => VoxelGrid::new(size, world_from_grid),
            None => VoxelGrid::over_cube(size, DAffine3::IDENTITY),
        };
        let volume = grid.and_then(|grid| Volume::new(grid, channels, samples));
        let volume = volume.map_err(|error| match error {
            Error::NonFinite { place, .. } => self.wrong(format!("{place} is not a finite 32-bit number")),
            Error::Value { value, expected, .. } => {
                self.wrong(format!("it has {value}, where it must be {expected}"))
            }
            other => self.wrong(other.to_string()),
        })?;
        let placed = world_from_grid.is_some();
        Ok(Stored { volume, placed, first: [0; 3], outside: [0.0; 3] })
    }
}
