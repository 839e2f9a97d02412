//! NumPy arrays in a zip archive. The names of members are compared and printed, and never become paths.

use std::io::{self, Read, Seek};
use std::path::Path;

use glam::DAffine3;
use zip::read::ZipFile;
use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive};

use super::file::VolumeFile;
use super::{Stored, npy};
use crate::io::npy::{Archive, Array, write_archive, write_array, write_samples};
use crate::io::numbers::{affine_of_rows, rows_of_affine};
use crate::io::whole::write_whole_seekable;
use crate::scene::Volume;
use crate::{Error, Result};

/// The member that says where the volume lies: 4 × 4, metres from positions in voxels.
const PLACE: &str = "world_from_grid";

pub(super) fn read(source: VolumeFile, member: Option<&str>) -> Result<Stored> {
    let (file, bytes) = source.open()?;
    let archive = ZipArchive::new(file).map_err(|error| damaged(source, error))?;
    let mut arrays = Arrays { source, archive, bytes };
    let names = arrays.names();
    let index = choose(source, &names, member)?;
    let (size, channels, samples) = arrays.read(index, |file, bytes| npy::read_array(source, file, bytes))?;
    let place = match names.iter().find(|(_, name)| name == PLACE) {
        Some(&(index, _)) => Some(arrays.read(index, |file, bytes| read_place(source, file, bytes))?),
        None => None,
    };
    source.volume(size, channels, samples, place)
}

/// The arrays in an archive that is `bytes` long.
struct Arrays<'p, R> {
    source: VolumeFile<'p>,
    archive: ZipArchive<R>,
    bytes: u64,
}

impl<R: Read + Seek> Arrays<'_, R> {
    /// Index and name of the arrays, as NumPy calls them: without `.npy`.
    fn names(&self) -> Vec<(usize, String)> {
        let name = |index| self.archive.name_for_index(index)?.ok();
        let names = (0..self.archive.len()).filter_map(|index| Some((index, name(index)?)));
        names.filter_map(|(index, name)| Some((index, name.strip_suffix(".npy")?.to_owned()))).collect()
    }

    /// Reads one of them to its end with `read`, which is told how long it is at most.
    fn read<T>(
        &mut self,
        index: usize,
        read: impl FnOnce(&mut io::Take<ZipFile<'_, R>>, u64) -> Result<T>,
    ) -> Result<T> {
        /// Deflate makes 258 bytes of two bits at best.
        const MOST_OF_ONE: u64 = 1032;
        let source = self.source;
        let member = self.archive.by_index(index).map_err(|error| damaged(source, error))?;
        let (packed, size) = (member.compressed_size(), member.size());
        if packed > self.bytes || size > packed.saturating_mul(MOST_OF_ONE) {
            let reason = format!("a member claims to hold {size} bytes, packed into {packed}");
            return Err(source.wrong(format!("{reason}, where the whole file has {}", self.bytes)));
        }
        let mut member = member.take(size);
        let found = read(&mut member, size)?;
        // The checksum is looked at when the end is met.
        match member.into_inner().read(&mut [0]) {
            Ok(0) => Ok(found),
            Ok(_) => Err(source.wrong("a member holds more values than its shape says")),
            Err(failed) => Err(source.stopped(failed)),
        }
    }
}

fn choose(source: VolumeFile, names: &[(usize, String)], member: Option<&str>) -> Result<usize> {
    let volumes = || names.iter().filter(|(_, name)| name != PLACE);
    let found = match member {
        Some(member) => {
            let member = member.strip_suffix(".npy").unwrap_or(member);
            names.iter().find(|(_, name)| name == member)
        }
        None => volumes().next().filter(|_| volumes().count() == 1),
    };
    found.map(|&(index, _)| index).ok_or_else(|| {
        let list = list(volumes().map(|(_, name)| name.as_str()));
        source.wrong(match member {
            Some(member) => format!("it has no array `{member}`; it has {list}"),
            None => format!("it must be said which of its arrays is meant; it has {list}"),
        })
    })
}

/// The first names of an archive, which may hold anything.
fn list<'n>(names: impl Iterator<Item = &'n str> + Clone) -> String {
    const SHOWN: usize = 16;
    const LETTERS: usize = 64;
    let shown = |name: &str| {
        let letters: String = name.chars().take(LETTERS).collect();
        format!("`{}`", letters.escape_debug())
    };
    let count = names.clone().count();
    let shown: Vec<String> = names.take(SHOWN).map(shown).collect();
    match count {
        0 => "none".to_owned(),
        1..=SHOWN => shown.join(", "),
        _ => format!("{} and {} more", shown.join(", "), count - SHOWN),
    }
}

fn read_place(source: VolumeFile, file: &mut impl Read, bytes: u64) -> Result<DAffine3> {
    let array = Array::read(file, bytes).map_err(|fault| source.faulty(fault))?;
    if array.shape != [4, 4] {
        let shape = array.shape;
        return Err(source.wrong(format!("the shape of {PLACE} is {shape:?} instead of (4, 4)")));
    }
    let numbers = array.read_doubles(file).map_err(|failed| source.stopped(failed))?;
    let rows = std::array::from_fn(|row| std::array::from_fn(|column| numbers[4 * row + column]));
    affine_of_rows(&rows).map_err(|problem| source.wrong(format!("{PLACE} {problem}")))
}

/// An archive that cannot be understood.
fn damaged(source: VolumeFile, error: ZipError) -> Error {
    match error {
        ZipError::Io(failed) => source.stopped(failed),
        other => source.wrong(other.to_string()),
    }
}

pub(super) fn write(path: &Path, volume: &Volume) -> Result<()> {
    write_whole_seekable(path, |file| {
        write_archive(file, |archive| write_members(archive, volume)).map_err(|source| Error::File {
            action: "write",
            path: path.to_owned(),
            source,
        })
    })
}

fn write_members(mut archive: &mut Archive, volume: &Volume) -> io::Result<()> {
    // Floats hardly shrink; what does (empty space, constants) the quickest level finds as well.
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(1))
        .large_file(true);
    archive.start_file("volume.npy", options)?;
    write_samples(archive, &npy::shape(volume), volume.samples())?;
    archive.start_file(format!("{PLACE}.npy"), options)?;
    let rows = rows_of_affine(volume.grid().world_from_grid());
    write_array(&mut archive, &[4, 4], rows.as_flattened().iter().copied())
}
