//! Chunks of Blosc 1 with its LZ4 codec: a header of 16 bytes, where each block starts, and the blocks, whose bytes are
//! sorted by significance ("shuffled") and may be split into one stream for each.
//!
//! Source  README_CHUNK_FORMAT.rst of c-blosc 1.21

use lz4_flex::block::{compress_into, decompress_into, get_maximum_output_size};

const HEADER: usize = 16;
const FORMAT: u8 = 2;
const FORMAT_OF_LZ4: u8 = 1;
const SHUFFLED: u8 = 0x01;
const COPIED: u8 = 0x02;
const SHUFFLED_BITS: u8 = 0x04;
const NOT_SPLIT: u8 = 0x10;
const CODEC: u8 = 5;
const LZ4: u8 = 1;
/// Of more bytes a value, or fewer values a block, no block is split.
const MAX_SPLITS: usize = 16;
const MIN_SPLIT: usize = 128;

/// Fills `out` from a chunk that says to hold exactly that many bytes.
///
/// Errors: what is wrong with the chunk.
pub(super) fn decode(chunk: &[u8], out: &mut [u8]) -> Result<(), String> {
    let header: &[u8; HEADER] = chunk.first_chunk().ok_or("a Blosc chunk is shorter than its header")?;
    let [format, _, flags, width, ..] = *header;
    let width = usize::from(width);
    let [bytes, block, packed] = [4, 8, 12].map(|at| number(header, at).unwrap_or(0));
    if !(1..=FORMAT).contains(&format) {
        return Err(format!("a Blosc chunk has format {format}, where 1 and 2 are read"));
    }
    if bytes != out.len() {
        return Err(format!("a Blosc chunk holds {bytes} bytes where {} are needed", out.len()));
    }
    let chunk = chunk.get(..packed).ok_or("a Blosc chunk is cut short")?;
    if flags & COPIED != 0 {
        out.copy_from_slice(chunk.get(HEADER..HEADER + bytes).ok_or("a Blosc chunk is cut short")?);
        return Ok(());
    }
    if flags >> CODEC != LZ4 {
        let codec = ["blosclz", "LZ4", "Snappy", "zlib", "Zstandard"].get(usize::from(flags >> CODEC));
        let codec = codec.unwrap_or(&"an unknown codec");
        return Err(format!("its Blosc chunks are packed with {codec}; only LZ4 is read"));
    }
    if flags & SHUFFLED_BITS != 0 {
        return Err("its Blosc chunks are shuffled by bits; only shuffling by bytes is read".to_owned());
    }
    if block == 0 || width == 0 {
        return Err("a Blosc chunk has blocks or values of no size".to_owned());
    }
    let may_split = flags & NOT_SPLIT == 0 && width <= MAX_SPLITS && block / width >= MIN_SPLIT;
    for (index, out) in out.chunks_mut(block).enumerate() {
        let start = number(chunk, HEADER + 4 * index).ok_or("a Blosc chunk is cut short")?;
        let streams = if may_split && out.len() == block { width } else { 1 };
        let plain = streams_at(chunk, start, out.len(), streams)?;
        if flags & SHUFFLED != 0 {
            unshuffle(&plain, width, out);
        } else {
            out.copy_from_slice(&plain);
        }
    }
    Ok(())
}

/// The `len` bytes of one block. Bytes that the streams do not share evenly stay zero, as no writer makes such blocks.
fn streams_at(chunk: &[u8], start: usize, len: usize, streams: usize) -> Result<Vec<u8>, String> {
    let mut block = vec![0; len];
    let mut at = start;
    for stream in block.chunks_exact_mut((len / streams).max(1)) {
        let size = number(chunk, at).ok_or("a Blosc block starts outside its chunk")?;
        let from = at.saturating_add(4);
        at = from.saturating_add(size);
        let packed = chunk.get(from..at).ok_or("a Blosc block ends outside its chunk")?;
        if size == stream.len() {
            stream.copy_from_slice(packed);
        } else if decompress_into(packed, stream).ok() != Some(stream.len()) {
            return Err("a Blosc block does not unpack".to_owned());
        }
    }
    Ok(block)
}

/// The chunk that holds `plain`, values of `width` bytes; none where it would not be shorter.
pub(super) fn encode(plain: &[u8], width: usize) -> Option<Vec<u8>> {
    let splits = width <= MAX_SPLITS && plain.len() / width >= MIN_SPLIT;
    let flags = SHUFFLED | LZ4 << CODEC | if splits { 0 } else { NOT_SPLIT };
    let size = u32::try_from(plain.len()).ok()?.to_le_bytes();
    let mut chunk = vec![FORMAT, FORMAT_OF_LZ4, flags, u8::try_from(width).ok()?];
    chunk.extend([size, size, [0; 4], (HEADER as u32 + 4).to_le_bytes()].as_flattened());
    let shuffled = shuffle(plain, width);
    let stream = plain.len() / if splits { width } else { 1 };
    let mut packed = vec![0; get_maximum_output_size(stream)];
    for stream in shuffled.chunks(stream.max(1)) {
        let shorter = compress_into(stream, &mut packed).ok().and_then(|len| packed.get(..len));
        let bytes = shorter.filter(|bytes| bytes.len() < stream.len()).unwrap_or(stream);
        chunk.extend((bytes.len() as u32).to_le_bytes());
        chunk.extend(bytes);
    }
    let packed = u32::try_from(chunk.len()).ok()?.to_le_bytes();
    chunk.get_mut(12..HEADER)?.copy_from_slice(&packed);
    (chunk.len() < plain.len()).then_some(chunk)
}

/// First byte of every value, second byte of every value, and so on; what is left over comes last as it is.
fn shuffle(plain: &[u8], width: usize) -> Vec<u8> {
    let values = plain.chunks_exact(width);
    let rest = values.remainder();
    let bytes = (0..width).flat_map(|byte| values.clone().filter_map(move |value| value.get(byte)));
    bytes.chain(rest).copied().collect()
}

fn unshuffle(shuffled: &[u8], width: usize, out: &mut [u8]) {
    let count = out.len() / width;
    let (sorted, rest) = shuffled.split_at(count * width);
    for (byte, of_all) in sorted.chunks_exact(count.max(1)).enumerate() {
        for (value, &from) in out.chunks_exact_mut(width).zip(of_all) {
            if let Some(to) = value.get_mut(byte) {
                *to = from;
            }
        }
    }
    for (to, &from) in out.iter_mut().skip(count * width).zip(rest) {
        *to = from;
    }
}

fn number(bytes: &[u8], at: usize) -> Option<usize> {
    let number = bytes.get(at..)?.first_chunk()?;
    usize::try_from(u32::from_le_bytes(*number)).ok()
}
