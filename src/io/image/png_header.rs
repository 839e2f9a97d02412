//! What a PNG file says before its pixels. The decoder passes over what its colours mean, and panics on some palettes.

use std::io::{BufRead, ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use flate2::Crc;

use super::srgb::{is_rec_709, linear_from_srgb};
use super::{PictureFormat, file_error, format_error};
use crate::Result;

/// What comes before the pixels.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PngHeader {
    pub(super) size: [usize; 2],
    /// Bytes of the pixels before they were compressed.
    pub(super) bytes: u128,
    pub(super) colors: PngColors,
}

/// The chunks that say what colours mean, as they are stored.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct PngColors {
    /// Primaries, transfer function, matrix, whether the range is full.
    cicp: Option<[u8; 4]>,
    is_srgb: bool,
    gamma: Option<f64>,
    /// White, red, green, blue.
    primaries: Option<[[f64; 2]; 4]>,
}

/// The linear value of a code from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Curve {
    Srgb,
    /// This power of the code.
    Power(f64),
}

impl Curve {
    pub(super) fn linear(self, code: f32) -> f32 {
        match self {
            Self::Srgb => linear_from_srgb(code),
            Self::Power(power) => f64::from(code).powf(power) as f32,
        }
    }
}

impl PngHeader {
    /// Reads the chunks before the pixels; the file begins with the signature.
    pub(super) fn read(path: &Path, file: &mut (impl BufRead + Seek)) -> Result<Self> {
        let damaged = |reason: String| format_error(path, PictureFormat::Png.name(), reason);
        let failed = |error: std::io::Error| match error.kind() {
            ErrorKind::UnexpectedEof => damaged("it is cut short before its pixels".to_owned()),
            _ => file_error("read", path, error),
        };
        file.seek(SeekFrom::Start(8)).map_err(failed)?;
        let header = match start_of_chunk(file).map_err(failed)? {
            (name, 13) if &name == b"IHDR" => checked_data::<13>(name, file).map_err(failed)?,
            _ => None,
        };
        let header = header.ok_or_else(|| damaged("its header is damaged".to_owned()))?;
        let size = [number(&header[..4]), number(&header[4..8])].map(|side| side as usize);
        let (depth, kind) = (header[8], header[9]);
        let mut colors = PngColors::default();
        let mut has_palette = false;
        loop {
            let (name, length) = start_of_chunk(file).map_err(failed)?;
            match (&name, length) {
                (b"IDAT" | b"IEND", _) => break,
                (b"PLTE", _) if length == 0 || length > 768 || !length.is_multiple_of(3) => {
                    let reason = format!("its palette has {length} bytes, and 1 to 256 colours have 3 each");
                    return Err(damaged(reason));
                }
                (b"PLTE", _) => has_palette = true,
                _ => {}
            }
            // The decoder, too, passes over what is damaged of these.
            let mut is_read = true;
            match (&name, length) {
                (b"cICP", 4) => colors.cicp = checked_data(name, file).map_err(failed)?,
                (b"sRGB", 1) => colors.is_srgb = checked_data::<1>(name, file).map_err(failed)?.is_some(),
                (b"gAMA", 4) => {
                    colors.gamma = checked_data::<4>(name, file).map_err(failed)?.map(|data| fraction(&data));
                }
                (b"cHRM", 32) => {
                    let data = checked_data::<32>(name, file).map_err(failed)?;
                    let at = |data: &[u8; 32], place: usize| fraction(&data[4 * place..][..4]);
                    colors.primaries =
                        data.map(|data| [0, 2, 4, 6].map(|place| [at(&data, place), at(&data, place + 1)]));
                }
                _ => is_read = false,
            }
            if !is_read {
                file.seek_relative(i64::from(length) + 4).map_err(failed)?;
            }
        }
        if kind == 3 && !has_palette {
            return Err(damaged("its palette is missing".to_owned()));
        }
        let channels = match kind {
            2 => 3,
            4 => 2,
            6 => 4,
            _ => 1,
        };
        let row = (size[0] as u128 * channels * u128::from(depth)).div_ceil(8) + 1;
        Ok(Self { size, bytes: row * size[1] as u128, colors })
    }
}

impl PngColors {
    /// Whether a colour profile would say more.
    pub(super) fn heeds_profile(&self) -> bool {
        self.cicp.is_none()
    }

    /// What the codes mean, and what is said of them that is ignored. Of several chunks one decides, in the order of the
    /// third edition of the specification.
    pub(super) fn meaning(&self) -> (Curve, Vec<String>) {
        /// Around the 1/2.2 that pictures in sRGB give for want of a better number.
        const USUAL: std::ops::RangeInclusive<f64> = 0.44..=0.47;
        let mut ignored = Vec::new();
        if let Some([primaries, function, _, range]) = self.cicp {
            if primaries != 1 {
                ignored.push(format!("its primaries are number {primaries} of ITU-T H.273"));
            }
            if range == 0 {
                ignored.push("its range is narrow".to_owned());
            }
            let (curve, name) = match function {
                4 => (Curve::Power(2.2), None),
                5 => (Curve::Power(2.8), None),
                8 => (Curve::Power(1.0), None),
                13 => (Curve::Srgb, None),
                16 => (Curve::Srgb, Some("PQ".to_owned())),
                18 => (Curve::Srgb, Some("HLG".to_owned())),
                other => (Curve::Srgb, Some(format!("number {other} of ITU-T H.273"))),
            };
            ignored.extend(name.map(|name| format!("its curve is {name}")));
            return (curve, ignored);
        }
        if self.is_srgb {
            return (Curve::Srgb, ignored);
        }
        if self.primaries.is_some_and(|primaries| !is_rec_709(primaries)) {
            ignored.push("its primaries are not those of Rec. 709".to_owned());
        }
        let curve = match self.gamma {
            Some(gamma) if gamma > 0.0 && !USUAL.contains(&gamma) => Curve::Power(1.0 / gamma),
            _ => Curve::Srgb,
        };
        (curve, ignored)
    }
}

/// Name and length.
fn start_of_chunk(file: &mut impl Read) -> std::io::Result<([u8; 4], u32)> {
    let mut start = [[0; 4]; 2];
    file.read_exact(start.as_flattened_mut())?;
    Ok((start[1], u32::from_be_bytes(start[0])))
}

/// What is in a chunk; none where its sum is wrong.
fn checked_data<const N: usize>(name: [u8; 4], file: &mut impl Read) -> std::io::Result<Option<[u8; N]>> {
    let (mut data, mut stored) = ([0; N], [0; 4]);
    file.read_exact(&mut data)?;
    file.read_exact(&mut stored)?;
    let mut sum = Crc::new();
    sum.update(&name);
    sum.update(&data);
    Ok((sum.sum() == u32::from_be_bytes(stored)).then_some(data))
}

fn number(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |number, &byte| number << 8 | u32::from(byte))
}

/// Fractions are whole hundred-thousandths.
fn fraction(bytes: &[u8]) -> f64 {
    f64::from(number(bytes)) / 1e5
}

#[cfg(test)]
pub(super) mod tests {
    use std::io::{Cursor, Write};

    use super::*;
    use crate::Error;

    pub(in crate::io::image) type Chunk<'a> = (&'a [u8; 4], &'a [u8]);

    /// A file of one grey or indexed pixel, or whatever a `kind` of one sample has, with chunks before its pixel.
    pub(in crate::io::image) fn png(depth: u8, kind: u8, chunks: &[Chunk], sample: &[u8]) -> Vec<u8> {
        let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
        packed.write_all(&[&[0], sample].concat()).unwrap();
        let packed = packed.finish().unwrap();
        let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
        let header = [0, 0, 0, 1, 0, 0, 0, 1, depth, kind, 0, 0, 0];
        let first: [Chunk; 1] = [(b"IHDR", &header)];
        let last: [Chunk; 2] = [(b"IDAT", &packed), (b"IEND", &[])];
        for &(name, data) in first.iter().chain(chunks).chain(&last) {
            let mut sum = Crc::new();
            sum.update(name);
            sum.update(data);
            bytes.extend((data.len() as u32).to_be_bytes());
            bytes.extend_from_slice(name);
            bytes.extend_from_slice(data);
            bytes.extend(sum.sum().to_be_bytes());
        }
        bytes
    }

    fn header(bytes: &[u8]) -> Result<PngHeader> {
        PngHeader::read("a.png".as_ref(), &mut Cursor::new(bytes))
    }

    fn meaning(chunks: &[Chunk]) -> (Curve, String) {
        let (curve, ignored) = header(&png(8, 0, chunks, &[128])).unwrap().colors.meaning();
        (curve, ignored.join(", and "))
    }

    const LINEAR: Chunk = (b"gAMA", &100_000_u32.to_be_bytes());
    const USUAL: Chunk = (b"gAMA", &45_455_u32.to_be_bytes());
    const SRGB: Chunk = (b"sRGB", &[0]);

    fn primaries(values: [u32; 8]) -> Vec<u8> {
        values.iter().flat_map(|value| value.to_be_bytes()).collect()
    }

    #[test]
    fn one_chunk_decides_what_codes_mean() {
        let silent = String::new();
        assert_eq!(meaning(&[]), (Curve::Srgb, silent.clone()));
        assert_eq!(meaning(&[USUAL]), (Curve::Srgb, silent.clone()));
        assert_eq!(meaning(&[LINEAR]), (Curve::Power(1.0), silent.clone()));
        assert_eq!(meaning(&[(b"gAMA", &50_000_u32.to_be_bytes())]).0, Curve::Power(2.0));
        assert_eq!(meaning(&[(b"gAMA", &[0; 4])]).0, Curve::Srgb, "0 says nothing");
        assert_eq!(meaning(&[LINEAR, SRGB]), (Curve::Srgb, silent.clone()));
        assert_eq!(meaning(&[(b"cICP", &[1, 13, 0, 1]), LINEAR]), (Curve::Srgb, silent.clone()));
        assert_eq!(meaning(&[(b"cICP", &[1, 8, 0, 1]), SRGB]), (Curve::Power(1.0), silent));
        assert_eq!(meaning(&[(b"cICP", &[1, 4, 0, 1])]).0, Curve::Power(2.2));
    }

    #[test]
    fn what_is_ignored_is_named() {
        let (curve, ignored) = meaning(&[(b"cICP", &[9, 16, 0, 1])]);
        assert!(curve == Curve::Srgb && ignored.contains("PQ") && ignored.contains("number 9"), "{ignored}");
        assert!(meaning(&[(b"cICP", &[1, 18, 0, 1])]).1.contains("HLG"));
        assert!(
            meaning(&[(b"cICP", &[1, 1, 0, 0])]).1.contains("range is narrow, and its curve is number 1")
        );
        let wide = primaries([31270, 32900, 68000, 32000, 26500, 69000, 15000, 6000]);
        assert!(meaning(&[(b"cHRM", &wide)]).1.contains("primaries are not those of Rec. 709"));
        assert_eq!(meaning(&[(b"cHRM", &wide), SRGB]).1, "", "sRGB goes before it");
        let usual = primaries([31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000]);
        assert_eq!(meaning(&[(b"cHRM", &usual)]).1, "");
    }

    #[test]
    fn a_damaged_chunk_says_nothing() {
        let mut bytes = png(8, 0, &[LINEAR], &[128]);
        let at = bytes.windows(4).position(|name| name == b"gAMA").unwrap();
        bytes[at + 9] ^= 1;
        assert_eq!(header(&bytes).unwrap().colors, PngColors::default());
    }

    #[test]
    fn palettes_that_the_decoder_panics_on_are_refused() {
        let reason = |chunks: &[Chunk]| match header(&png(8, 3, chunks, &[0])) {
            Err(Error::Format { reason, .. }) => reason,
            other => panic!("a format error was expected, not {other:?}"),
        };
        for length in [0, 4, 769, 771] {
            assert!(
                reason(&[(b"PLTE", &vec![0; length])]).contains(&format!("its palette has {length} bytes"))
            );
        }
        assert!(reason(&[]).contains("its palette is missing"));
        assert!(header(&png(8, 3, &[(b"PLTE", &[0; 768])], &[0])).is_ok());
    }

    #[test]
    fn every_file_cut_short_before_its_pixels_is_an_error() {
        let bytes = png(16, 0, &[LINEAR, SRGB], &[1, 2]);
        let whole = header(&bytes).unwrap();
        assert_eq!((whole.size, whole.bytes), ([1, 1], 3));
        let pixels = bytes.windows(4).position(|name| name == b"IDAT").unwrap() + 4;
        for length in 0..pixels {
            assert!(matches!(header(&bytes[..length]), Err(Error::Format { .. })), "{length}");
        }
        assert_eq!(header(&bytes[..pixels]).unwrap(), whole);
    }
}
