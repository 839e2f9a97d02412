use std::collections::HashSet;
use std::io::{Read, Seek};
use std::path::Path;

use ::exr::block::{self, UncompressedBlock, lines::LineRef, reader::Reader};
use ::exr::image::{Blocks, Encoding, Image as ExrImage, SpecificChannels, write::WritableImage};
use ::exr::math::Vec2;
use ::exr::meta::BlockDescription;
use ::exr::meta::attribute::{Chromaticities, Compression, IntegerBounds, LineOrder, SampleType};
use ::exr::meta::header::Header;
use ::exr::prelude::f16;

use super::super::guard::guarded;
use super::super::whole::write_whole_seekable;
use super::srgb::is_rec_709;
use super::{
    Alpha, PictureFormat, check_size, check_writable, file_error, format_error, room, warn_of_ignored,
};
use crate::scene::{Camera, Image};
use crate::{Error, Result};

/// How the scan lines of an EXR file are packed; all of it without a loss.
///
/// What light is left in the 32 bits of a float hardly compresses: a picture of 640 × 360 pixels takes 2.77 MB as it is and with run lengths, 2.40 MB
/// with ZIP, 2.07 MB with PIZ, and 3, 6, 39 and 44 ms to write. Where it is mostly black all but the first take a tenth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ExrCompression {
    /// As they are.
    None,
    /// Run lengths: nearly as quick, and small where a picture is mostly black.
    #[default]
    Rle,
    /// Deflate, sixteen lines at once.
    Zip,
    /// Wavelets and Huffman's code: the smallest files of pictures.
    Piz,
}

/// As [`write_exr_as`], with run lengths.
///
/// Errors: as [`write_exr_as`].
pub fn write_exr(path: &Path, image: &Image) -> Result<()> {
    write_exr_as(path, image, ExrCompression::default())
}

/// Writes the picture as it is: one part with the channels R, G and B of 32-bit floats in scan lines.
///
/// Errors: [`Error::NonFinite`] for a NaN or an infinity, [`Error::Value`] for a picture that is empty or larger than
/// 16384 pixels a side, [`Error::File`].
pub fn write_exr_as(path: &Path, image: &Image, compression: ExrCompression) -> Result<()> {
    check_writable(image, &path.display().to_string())?;
    let encoding = Encoding {
        compression: match compression {
            ExrCompression::None => Compression::Uncompressed,
            ExrCompression::Rle => Compression::RLE,
            ExrCompression::Zip => Compression::ZIP16,
            ExrCompression::Piz => Compression::PIZ,
        },
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let channels = SpecificChannels::rgb(|Vec2(x, y)| {
        let [r, g, b] = image.at(x, y);
        (r, g, b)
    });
    let [width, height] = image.size();
    let picture = ExrImage::from_encoded_channels((width, height), encoding, channels);
    write_whole_seekable(path, |file| {
        picture.write().to_buffered(file).map_err(|error| exr_error("write", path, error))
    })
}

/// Size of the display window.
pub(super) fn size_of(path: &Path, file: impl Read + Seek, stored_bytes: u64) -> Result<[usize; 2]> {
    guarded(path, PictureFormat::Exr.name(), || {
        let reader = opened(path, file, stored_bytes)?;
        let header = reader.headers().first();
        let header =
            header.ok_or_else(|| format_error(path, PictureFormat::Exr.name(), "it has no picture"))?;
        let Vec2(width, height) = header.shared_attributes.display_window.size;
        Ok([width, height])
    })
}

/// Size of the display window, and in it the first N of R, G, B, A as they are stored. Where there is no A, the data window
/// has 1.
pub(super) fn read<const N: usize>(
    path: &Path,
    file: impl Read + Seek,
    stored_bytes: u64,
    alpha: Alpha,
) -> Result<([usize; 2], Vec<[f32; N]>)> {
    guarded(path, PictureFormat::Exr.name(), || decoded(path, file, stored_bytes, alpha))
}

fn decoded<const N: usize>(
    path: &Path,
    file: impl Read + Seek,
    stored_bytes: u64,
    alpha: Alpha,
) -> Result<([usize; 2], Vec<[f32; N]>)> {
    let failed = |error| exr_error("read", path, error);
    let reader = opened(path, file, stored_bytes)?;
    let source = ExrChannels::find(path, reader.headers(), alpha)?;
    let header = &reader.headers()[source.layer];
    if let Some(Chromaticities { white, red, green, blue }) = header.shared_attributes.chromaticities
        && !is_rec_709([white, red, green, blue].map(|Vec2(x, y)| [x.into(), y.into()]))
    {
        warn_of_ignored(path, &["its chromaticities are not those of Rec. 709".to_owned()]);
    }
    let mut picture = Picture::<N>::for_layer(path, header)?;
    let chunks = reader.all_chunks(false).map_err(failed)?;
    let meta_data = ::exr::block::reader::ChunksReader::meta_data(&chunks).clone();
    let header = &meta_data.headers[source.layer];
    let mut seen = HashSet::new();
    for chunk in chunks {
        let chunk = chunk.map_err(failed)?;
        if chunk.layer_index != source.layer {
            continue;
        }
        let place = header.get_block_data_indices(&chunk.compressed_block).map_err(failed)?;
        if place.level_index != Vec2(0, 0) {
            continue;
        }
        if !seen.insert(place.tile_index) {
            return Err(format_error(path, PictureFormat::Exr.name(), "one of its blocks is there twice"));
        }
        if !picture.shows(header.get_absolute_block_pixel_coordinates(place).map_err(failed)?) {
            continue;
        }
        let block = UncompressedBlock::decompress_chunk(chunk, &meta_data, false).map_err(failed)?;
        for line in block.lines(&header.channels) {
            picture.put(&line, &source, header).map_err(failed)?;
        }
    }
    if seen.len() != blocks_of_full_size(header) {
        return Err(format_error(path, PictureFormat::Exr.name(), "some of its blocks are missing"));
    }
    Ok((picture.size, picture.pixels))
}

/// A file whose headers have passed.
fn opened<F: Read + Seek>(path: &Path, file: F, stored_bytes: u64) -> Result<Reader<F>> {
    let reader = block::read(file, false).map_err(|error| exr_error("read", path, error))?;
    reader.headers().iter().try_for_each(|header| check_header(path, header, stored_bytes))?;
    Ok(reader)
}

/// Refuses windows, blocks and compressions that would make the decoder allocate without measure.
fn check_header(path: &Path, header: &Header, stored_bytes: u64) -> Result<()> {
    // Its decoder takes sizes from inside the compressed data as they are: one damaged byte there asks for a
    // terabyte and ends the process.
    if matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        let reason = "its compression is DWAA or DWAB; save it with ZIP";
        return Err(format_error(path, PictureFormat::Exr.name(), reason));
    }
    let Vec2(width, height) = header.layer_size;
    let bytes = [width, height, header.channels.bytes_per_pixel].map(|n| n as u128);
    let bytes = bytes[0].saturating_mul(bytes[1]).saturating_mul(bytes[2]);
    check_size(path, PictureFormat::Exr, [width, height], bytes, stored_bytes)?;
    // What the data window leaves open is not stored, so it may be much larger than the file.
    let Vec2(width, height) = header.shared_attributes.display_window.size;
    check_size(path, PictureFormat::Exr, [width, height], 0, stored_bytes)?;
    let Vec2(width, height) = match header.blocks {
        BlockDescription::Tiles(tiles) => tiles.tile_size,
        BlockDescription::ScanLines => Vec2(1, 1),
    };
    if [width, height].iter().any(|&side| side == 0 || side > Camera::MAX_SIZE) {
        let reason = format!("its tiles are {width} × {height} pixels, and a side must be from 1 to 16384");
        return Err(format_error(path, PictureFormat::Exr.name(), reason));
    }
    // A block is unpacked whole, however little of it is shown.
    let Vec2(width, height) = header.max_block_pixel_size();
    let bytes = [width, height, header.channels.bytes_per_pixel].map(|n| n as u128);
    if bytes.iter().product::<u128>() > BLOCK_BYTES {
        let reason = format!(
            "it is stored in blocks of {width} × {height} pixels; save it in scan lines or smaller tiles"
        );
        return Err(format_error(path, PictureFormat::Exr.name(), reason));
    }
    Ok(())
}

/// Bytes of an unpacked block at most.
const BLOCK_BYTES: u128 = 1 << 29;

fn blocks_of_full_size(header: &Header) -> usize {
    let Vec2(width, height) = header.layer_size;
    let Vec2(block_width, block_height) = header.max_block_pixel_size();
    width.div_ceil(block_width) * height.div_ceil(block_height)
}

/// Which stored channels are R, G, B and A.
struct ExrChannels {
    /// Index of the header; a file may hold several pictures.
    layer: usize,
    /// What stands before the dot in names such as `paint.R`, with the dot.
    prefix: String,
    /// Indices into the channels of the header; grey has one for all three colours.
    rgba: [Option<usize>; 4],
}

impl ExrChannels {
    /// Plain names before names in a layer, the first picture before the others.
    fn find(path: &Path, headers: &[Header], alpha: Alpha) -> Result<Self> {
        let failed = |reason: String| format_error(path, PictureFormat::Exr.name(), reason);
        let mut found: Vec<Self> =
            headers.iter().enumerate().flat_map(|(layer, header)| Self::in_header(layer, header)).collect();
        let layered = found.iter().all(|channels| !channels.prefix.is_empty());
        if layered && found.len() > 1 {
            let names: Vec<_> = found.iter().map(|channels| channels.prefix.trim_end_matches('.')).collect();
            let reason =
                format!("it holds several layers ({}); save the one that is meant alone", names.join(", "));
            return Err(failed(reason));
        }
        let best = found.iter().position(|channels| layered || channels.prefix.is_empty());
        let best = best.map(|index| found.swap_remove(index)).ok_or_else(|| {
            let names = headers.iter().flat_map(names_of).collect::<Vec<_>>().join(", ");
            failed(format!("it has no channels R, G, B or Y at full resolution, only {names}"))
        })?;
        if alpha == Alpha::Needed && best.rgba[3].is_none() {
            let reason = "it has no channel A; alpha is the weight of the constraint, so a layer needs it";
            return Err(failed(reason.to_owned()));
        }
        Ok(best)
    }

    fn in_header(layer: usize, header: &Header) -> Vec<Self> {
        // Subsampled channels (luminance and chroma) are not pictures of full size.
        if header.channels.list.iter().any(|channel| channel.sampling != Vec2(1, 1)) {
            return Vec::new();
        }
        let names = names_of(header);
        let index_of = |prefix: &str, name: &str| names.iter().position(|n| *n == format!("{prefix}{name}"));
        let candidate = |prefix: &str, colors: [&str; 3]| {
            let [r, g, b] = colors.map(|name| index_of(prefix, name));
            let complete = r.is_some() && g.is_some() && b.is_some();
            let rgba = [r, g, b, index_of(prefix, "A")];
            complete.then(|| Self { layer, prefix: prefix.to_owned(), rgba })
        };
        let prefixes = |name| names.iter().filter_map(move |n| prefix_before(n, name));
        let color = prefixes("R").filter_map(|prefix| candidate(prefix, ["R", "G", "B"]));
        let is_grey = |prefix: &&str| index_of(prefix, "RY").is_none() && index_of(prefix, "BY").is_none();
        let grey = prefixes("Y").filter(is_grey).filter_map(|prefix| candidate(prefix, ["Y"; 3]));
        color.chain(grey).collect()
    }
}

fn names_of(header: &Header) -> Vec<String> {
    header.channels.list.iter().map(|channel| channel.name.to_string()).collect()
}

/// `paint.` of `paint.R`, nothing of `R`; none when the name ends otherwise.
fn prefix_before<'n>(name: &'n str, end: &str) -> Option<&'n str> {
    name.strip_suffix(end).filter(|prefix| prefix.is_empty() || prefix.ends_with('.'))
}

struct Picture<const N: usize> {
    size: [usize; 2],
    /// Where the data window lies in the display window.
    offset: [i64; 2],
    pixels: Vec<[f32; N]>,
}

impl<const N: usize> Picture<N> {
    fn for_layer(path: &Path, header: &Header) -> Result<Self> {
        let display = header.shared_attributes.display_window;
        let data = header.own_attributes.layer_position;
        let offset = |data: i32, display: i32| i64::from(data) - i64::from(display);
        let size = [display.size.0, display.size.1];
        let mut pixels = room(path, size)?;
        pixels.resize(display.size.area(), [0.0; N]);
        let offset = [offset(data.0, display.position.0), offset(data.1, display.position.1)];
        Ok(Self { size, offset, pixels })
    }

    /// Whether a part of the data window reaches into the display window.
    fn shows(&self, part: IntegerBounds) -> bool {
        let overlaps = |start: i32, length: usize, axis: usize| {
            let start = i64::from(start) + self.offset[axis];
            start < self.size[axis] as i64 && start + length as i64 > 0
        };
        overlaps(part.position.0, part.size.0, 0) && overlaps(part.position.1, part.size.1, 1)
    }

    /// Keeps what a line of one channel has inside the display window.
    fn put(&mut self, line: &LineRef<'_>, source: &ExrChannels, header: &Header) -> ::exr::error::UnitResult {
        let channel = line.location.channel;
        if !source.rgba[..N].contains(&Some(channel)) {
            return Ok(());
        }
        let Vec2(x, y) = line.location.position;
        let components = &source.rgba[..N];
        let stands_for_alpha = N == 4 && source.rgba[3].is_none() && source.rgba[0] == Some(channel);
        let mut put = |index: usize, value: f32| {
            if let Some(pixel) = self.at(x + index, y) {
                for (component, _) in components.iter().enumerate().filter(|(_, c)| **c == Some(channel)) {
                    pixel[component] = value;
                }
                if stands_for_alpha {
                    pixel[N - 1] = 1.0;
                }
            }
        };
        match header.channels.list[channel].sample_type {
            SampleType::F16 => {
                for (index, value) in line.read_samples::<f16>().enumerate() {
                    put(index, value?.to_f32());
                }
            }
            SampleType::F32 => {
                for (index, value) in line.read_samples::<f32>().enumerate() {
                    put(index, value?);
                }
            }
            SampleType::U32 => {
                for (index, value) in line.read_samples::<u32>().enumerate() {
                    put(index, value? as f32);
                }
            }
        }
        Ok(())
    }

    /// The pixel at a place of the data window.
    fn at(&mut self, x: usize, y: usize) -> Option<&mut [f32; N]> {
        let inside = |place: usize, offset: i64, side: usize| {
            usize::try_from(place as i64 + offset).ok().filter(|&place| place < side)
        };
        let x = inside(x, self.offset[0], self.size[0])?;
        let y = inside(y, self.offset[1], self.size[1])?;
        self.pixels.get_mut(y * self.size[0] + x)
    }
}

fn exr_error(action: &'static str, path: &Path, error: ::exr::error::Error) -> Error {
    match error {
        ::exr::error::Error::Io(source) => file_error(action, path, source),
        other => format_error(path, PictureFormat::Exr.name(), other.to_string()),
    }
}
