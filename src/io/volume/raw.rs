//! A file of nothing but numbers, x the fastest axis and the channels of a voxel side by side, and beside it a header
//! in JSON.

use std::io::Read;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::file::VolumeFile;
use super::{Format, Stored};
use crate::io::numbers::{Encoding, NumberType, affine_of_rows, rows_of_affine, write_samples};
use crate::io::write_whole;
use crate::scene::{Samples, Volume};
use crate::{Error, Result};

/// A header is a few lines long.
const MAX_HEADER_BYTES: u64 = 1 << 16;

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    /// The name of a file in the same folder.
    data: String,
    /// x, y, z.
    size: [usize; 3],
    channels: usize,
    #[serde(rename = "type")]
    kind: HeaderKind,
    #[serde(default)]
    byte_order: ByteOrder,
    /// Four rows.
    #[serde(skip_serializing_if = "Option::is_none")]
    world_from_grid: Option<[[f64; 4]; 4]>,
}

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum HeaderKind {
    F32,
    F16,
    /// Whole numbers from 0 to 255.
    U8,
}

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ByteOrder {
    #[default]
    Little,
    Big,
}

impl Header {
    fn encoding(&self) -> Encoding {
        let kind = match self.kind {
            HeaderKind::F32 => NumberType::F32,
            HeaderKind::F16 => NumberType::F16,
            HeaderKind::U8 => NumberType::U8,
        };
        Encoding { kind, big_endian: self.byte_order == ByteOrder::Big }
    }
}

pub(super) fn read(source: VolumeFile) -> Result<Stored> {
    let header = read_header(source)?;
    if !is_plain_name(&header.data) {
        let reason = format!("`data` is {:?} and must be the name of a file beside it", header.data);
        return Err(source.wrong(reason));
    }
    let place = header.world_from_grid.as_ref().map(affine_of_rows).transpose();
    let place = place.map_err(|problem| source.wrong(format!("`world_from_grid` {problem}")))?;
    let count = source.count(header.size, header.channels)?;
    let data = source.path.with_file_name(&header.data);
    let samples = read_data(VolumeFile { path: &data, ..source }, header.encoding(), count)?;
    source.volume(header.size, header.channels, samples, place)
}

fn read_header(source: VolumeFile) -> Result<Header> {
    let (file, bytes) = source.open()?;
    if bytes > MAX_HEADER_BYTES {
        return Err(source.wrong(format!("it has {bytes} bytes, and {MAX_HEADER_BYTES} are the most")));
    }
    let mut text = Vec::new();
    file.take(MAX_HEADER_BYTES).read_to_end(&mut text).map_err(|failed| source.stopped(failed))?;
    serde_json::from_slice(&text).map_err(|error| source.wrong(error.to_string()))
}

/// Headers come from elsewhere, and must not make anyone read files that lie elsewhere.
fn is_plain_name(name: &str) -> bool {
    let separates = |letter: char| matches!(letter, '/' | '\\' | ':') || letter.is_control();
    !matches!(name, "" | "." | "..") && !name.contains(separates)
}

fn read_data(source: VolumeFile, encoding: Encoding, count: usize) -> Result<Samples> {
    let (mut file, bytes) = source.open()?;
    let needed = (count * encoding.width()) as u64;
    if bytes != needed {
        return Err(source.wrong(format!("it has {bytes} bytes, where its header asks for {needed}")));
    }
    source.samples(&mut file, encoding, count)
}

pub(super) fn write(path: &Path, volume: &Volume) -> Result<()> {
    let data = path.with_extension("raw");
    let name = data.file_name().and_then(|name| name.to_str()).filter(|name| is_plain_name(name));
    let header = Header {
        data: name.ok_or_else(|| unnameable(path))?.to_owned(),
        size: volume.grid().size(),
        channels: volume.channels(),
        kind: match volume.samples() {
            Samples::F32(_) => HeaderKind::F32,
            Samples::F16(_) => HeaderKind::F16,
        },
        byte_order: ByteOrder::Little,
        world_from_grid: Some(rows_of_affine(volume.grid().world_from_grid())),
    };
    let text = serde_json::to_string_pretty(&header).map_err(|error| Error::Machine(error.to_string()))?;
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| Error::File { action: "write", path, source }
    };
    // A header that is there must never promise numbers that are not.
    write_whole(&data, |file| write_samples(file, volume.samples()).map_err(failed(&data)))?;
    write_whole(path, |file| writeln!(file, "{text}").map_err(failed(path)))
}

fn unnameable(path: &Path) -> Error {
    let reason = "its name cannot stand in JSON as a plain file name".to_owned();
    Error::Format { path: path.to_owned(), format: Format::Raw.name(), reason }
}
