//! One NumPy array: shape (z, y, x) or (z, y, x, channel), values only.

use std::io::Read;
use std::path::Path;

use super::Stored;
use super::file::VolumeFile;
use crate::io::npy::{self, Array};
use crate::io::write_whole;
use crate::scene::{Samples, Volume};
use crate::{Error, Result};

pub(super) fn read(source: VolumeFile) -> Result<Stored> {
    let (mut file, bytes) = source.open()?;
    let (size, channels, samples) = read_array(source, &mut file, bytes)?;
    source.volume(size, channels, samples, None)
}

/// Size (x, y, z), channels and numbers of an array that is at most `bytes` long with its header.
pub(super) fn read_array(
    source: VolumeFile,
    file: &mut impl Read,
    bytes: u64,
) -> Result<([usize; 3], usize, Samples)> {
    let array = Array::read(file, bytes).map_err(|fault| source.faulty(fault))?;
    let (size, channels) = match array.shape[..] {
        [z, y, x] => ([x, y, z], 1),
        [z, y, x, channels] => ([x, y, z], channels),
        _ => {
            let shape = &array.shape;
            let reason = format!("its shape is {shape:?} instead of (z, y, x) or (z, y, x, channel)");
            return Err(source.wrong(reason));
        }
    };
    source.count(size, channels)?;
    (source.allow)(array.bytes())?;
    let samples = array.read_samples(file).map_err(|failed| source.stopped(failed))?;
    Ok((size, channels, samples))
}

pub(super) fn write(path: &Path, volume: &Volume) -> Result<()> {
    write_whole(path, |file| {
        npy::write_samples(file, &shape(volume), volume.samples()).map_err(|source| Error::File {
            action: "write",
            path: path.to_owned(),
            source,
        })
    })
}

/// In NumPy's order, without the axis of channels where there is one.
pub(super) fn shape(volume: &Volume) -> Vec<usize> {
    let [x, y, z] = volume.grid().size();
    match volume.channels() {
        1 => vec![z, y, x],
        channels => vec![z, y, x, channels],
    }
}
