//! Pictures in and out: EXR is linear, PNG and JPEG are sRGB, HDR is linear with shared exponents.
//!
//! A PNG picture that says so has another curve than that of sRGB. The exposure of an HDR picture is divided out.
//! What else a picture says of its colours (profiles, primaries) is ignored, with a warning.

mod coded;
mod cover;
mod openexr;
mod png_header;
mod radiance;
mod srgb;

use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::input;
use super::whole::write_whole;
use crate::scene::{Camera, Image, RgbaImage};
use crate::{Error, Result, Warning};

pub(in crate::io) use cover::read_cover;
pub use openexr::{ExrCompression, write_exr, write_exr_as};
pub use srgb::{linear_from_srgb, srgb_from_linear};

/// The picture as the bytes of an 8-bit sRGB PNG file, brightened by `exposure` stops.
///
/// Errors: [`Error::NonFinite`] for a NaN or an infinity, [`Error::Value`] for a picture that is empty or larger than
/// 16384 pixels a side, or an exposure that is not finite.
pub fn png_bytes(image: &Image, exposure: f64) -> Result<Vec<u8>> {
    check_writable(image, "the picture")?;
    coded::png_bytes(image, exposure)
}

/// The picture in 8-bit sRGB with an alpha of 255, pixel by pixel, brightened by a factor, for screens.
#[cfg(feature = "studio")]
pub(crate) fn rgba_bytes(image: &Image, scale: f64) -> Vec<u8> {
    coded::rgba_bytes(image, scale)
}

/// Writes the picture as an 8-bit sRGB PNG, brightened by `exposure` stops.
///
/// Errors: as [`png_bytes`], and [`Error::File`].
pub fn write_png(path: &Path, image: &Image, exposure: f64) -> Result<()> {
    check_writable(image, &path.display().to_string())?;
    let bytes = coded::png_bytes(image, exposure)?;
    write_whole(path, |file| file.write_all(&bytes).map_err(|source| file_error("write", path, source)))
}

/// Writes the picture as Radiance HDR: linear, with 8 bits a channel and one exponent for the three.
///
/// Errors: as [`png_bytes`], [`Error::Value`] for a pixel that is negative, and [`Error::File`].
pub fn write_hdr(path: &Path, image: &Image) -> Result<()> {
    check_writable(image, &path.display().to_string())?;
    let bytes = coded::hdr_bytes(image)?;
    write_whole(path, |file| file.write_all(&bytes).map_err(|source| file_error("write", path, source)))
}

/// Width and height of a picture in pixels, from its header; nothing is decoded. Each is from 1 to 16384.
///
/// Errors: as [`read_image`], for what is before the pixels.
pub fn size_of(path: &Path) -> Result<[usize; 2]> {
    let mut source = PictureFile::open(path)?;
    match source.format {
        PictureFormat::Exr => openexr::size_of(path, source.file, source.bytes),
        PictureFormat::Hdr => radiance::size_of(path, &mut source.file, source.bytes),
        PictureFormat::Png | PictureFormat::Jpeg => coded::size_of(path, source),
    }
}

/// Reads an EXR, PNG, HDR or JPEG picture as linear radiance; its content says which it is, not its name.
///
/// Alpha is left out: the colours of an EXR are radiance already, those of a PNG are straight. Grey becomes RGB. The
/// size is that of the display window; what the data window of an EXR leaves open is black.
///
/// Errors: [`Error::File`] when it cannot be read, [`Error::Format`] when it is damaged, holds a NaN or an infinity, or
/// is larger than 16384 pixels a side, [`Error::Machine`] when there is no memory for it.
pub fn read_image(path: &Path) -> Result<Image> {
    let source = PictureFile::open(path)?;
    let (size, pixels) = match source.format {
        PictureFormat::Exr => openexr::read::<3>(path, source.file, source.bytes, Alpha::Optional)?,
        PictureFormat::Hdr => radiance::read::<3>(path, source.file, source.bytes)?,
        _ => coded::read::<3>(path, source, Alpha::Optional)?,
    };
    check_finite(path, size, &pixels)?;
    Image::new(size, pixels)
}

/// Reads a picture of radiance: an EXR or an HDR. The numbers of other pictures are made to be looked at.
///
/// Errors: as [`read_image`]; [`Error::Format`] for a PNG or a JPEG.
pub fn read_radiance(path: &Path) -> Result<Image> {
    let format = PictureFile::open(path)?.format;
    if matches!(format, PictureFormat::Png | PictureFormat::Jpeg) {
        let reason = "it is made to be looked at, with values that end at white, and is no radiance; \
                      give an EXR or HDR file, such as the one that was written beside it";
        return Err(format_error(path, format.name(), reason));
    }
    read_image(path)
}

/// Whether the colours of a picture hold its alpha.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Association {
    /// They are multiplied by it.
    Associated,
    /// They are not.
    Straight,
}

/// Reads a painted layer from an EXR or PNG picture with alpha, which is the weight of the constraint.
///
/// Associated alpha is divided out of the colours. Where `association` is none, that of an EXR is associated and that of a PNG straight, as
/// these formats are defined. Alpha that is outside [0, 1] by up to
/// 0.01, as filters of renderers leave it, becomes 0 or 1. Where it is too small to be divided by, it becomes 0. It is 0 too
/// where the data window of an EXR leaves the display window open.
///
/// Errors: as [`read_image`], and [`Error::Format`] when there is no alpha or it is further outside [0, 1].
pub fn read_layer(path: &Path, association: Option<Association>) -> Result<RgbaImage> {
    read_weighted(path, Alpha::Needed, association)
}

/// Reads a picture that a view should show, as [`read_layer`] does; where there is no alpha, all pixels weigh 1
/// that are there.
///
/// Errors: as [`read_image`], and [`Error::Format`] when an alpha is outside [0, 1] by more than 0.01.
pub fn read_target(path: &Path, association: Option<Association>) -> Result<RgbaImage> {
    read_weighted(path, Alpha::Optional, association)
}

/// Whether a picture must have alpha.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Alpha {
    Needed,
    Optional,
}

fn read_weighted(path: &Path, alpha: Alpha, association: Option<Association>) -> Result<RgbaImage> {
    let source = PictureFile::open(path)?;
    let is_exr = source.format == PictureFormat::Exr;
    let (size, mut pixels) = match source.format {
        PictureFormat::Exr => {
            let (size, pixels) = openexr::read::<4>(path, source.file, source.bytes, alpha)?;
            // Before alpha is divided out, so that a bad alpha is not blamed on the colour.
            check_weights(path, size, &pixels)?;
            check_finite(path, size, &pixels)?;
            (size, pixels)
        }
        PictureFormat::Hdr if alpha == Alpha::Needed => {
            let reason = "an HDR picture has no alpha, which is the weight of the constraint: save it as EXR with alpha";
            return Err(format_error(path, source.format.name(), reason));
        }
        PictureFormat::Hdr => radiance::read::<4>(path, source.file, source.bytes)?,
        _ => coded::read::<4>(path, source, alpha)?,
    };
    match association {
        Some(Association::Straight) => {
            pixels.iter_mut().for_each(|[.., alpha]| *alpha = alpha.clamp(0.0, 1.0))
        }
        None if !is_exr => {}
        Some(Association::Associated) | None => pixels.iter_mut().for_each(divide_out_alpha),
    }
    check_finite(path, size, &pixels)?;
    RgbaImage::new(size, pixels)
}

/// What a picture file is, by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PictureFormat {
    Exr,
    Png,
    Jpeg,
    Hdr,
}

impl PictureFormat {
    const SIGNATURES: [(Self, &'static [u8]); 4] = [
        (Self::Exr, &[0x76, 0x2f, 0x31, 0x01]),
        (Self::Png, b"\x89PNG\r\n\x1a\n"),
        (Self::Jpeg, &[0xff, 0xd8, 0xff]),
        // A program's name follows, such as RADIANCE or RGBE.
        (Self::Hdr, b"#?"),
    ];

    fn of(start: &[u8]) -> Option<Self> {
        Self::SIGNATURES.iter().find(|(_, signature)| start.starts_with(signature)).map(|&(format, _)| format)
    }

    fn name(self) -> &'static str {
        match self {
            Self::Exr => "EXR",
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
            Self::Hdr => "HDR",
        }
    }
}

/// An opened picture file, at its start.
struct PictureFile {
    file: BufReader<File>,
    bytes: u64,
    format: PictureFormat,
}

impl PictureFile {
    fn open(path: &Path) -> Result<Self> {
        let refused = |source| file_error("read", path, source);
        let (mut file, bytes) = input::open(path)?;
        let mut start = Vec::new();
        (&file).take(16).read_to_end(&mut start).map_err(refused)?;
        file.rewind().map_err(refused)?;
        let format = PictureFormat::of(&start).ok_or_else(|| {
            format_error(path, "picture", "its first bytes are not those of an EXR, PNG, HDR or JPEG file")
        })?;
        Ok(Self { file: BufReader::new(file), bytes, format })
    }
}

/// Refuses sizes that are absurd, or that a file this short cannot hold in any compression, before they are allocated.
fn check_size(
    path: &Path,
    format: PictureFormat,
    size: [usize; 2],
    decoded: u128,
    stored: u64,
) -> Result<()> {
    /// Beyond what runs of equal pixels compress to, and still little enough to stop a header without a body.
    const DENSEST: u128 = 1 << 14;
    let [width, height] = size;
    if size.iter().any(|&side| side == 0 || side > Camera::MAX_SIZE) {
        let reason =
            format!("it is {width} × {height} pixels, and a side must be from 1 to {}", Camera::MAX_SIZE);
        return Err(format_error(path, format.name(), reason));
    }
    if decoded > DENSEST * u128::from(stored) {
        let reason = format!("{stored} bytes are too few for {width} × {height} pixels; it may be cut short");
        return Err(format_error(path, format.name(), reason));
    }
    Ok(())
}

/// How far outside [0, 1] an alpha may be.
const STRAY: f32 = 0.01;

fn divide_out_alpha(pixel: &mut [f32; 4]) {
    let [color @ .., alpha] = pixel;
    if *alpha > 0.0 {
        color.iter_mut().for_each(|c| *c /= *alpha);
    }
    if color.iter().all(|c| c.is_finite()) {
        *alpha = alpha.clamp(0.0, 1.0);
    } else {
        *pixel = [0.0; 4];
    }
}

fn check_weights(path: &Path, size: [usize; 2], pixels: &[[f32; 4]]) -> Result<()> {
    match pixels.iter().position(|p| !(-STRAY..=1.0 + STRAY).contains(&p[3])) {
        None => Ok(()),
        Some(index) => {
            let reason = format!(
                "alpha is {} at {}; it is the weight of the constraint and must be from 0 to 1",
                pixels[index][3],
                place(index, size)
            );
            Err(format_error(path, PictureFormat::Exr.name(), reason))
        }
    }
}

/// A list without pixels that has room for all of a picture.
fn room<const N: usize>(path: &Path, [width, height]: [usize; 2]) -> Result<Vec<[f32; N]>> {
    let mut pixels = Vec::new();
    pixels.try_reserve_exact(width * height).map_err(|_| {
        let file = path.display();
        Error::Machine(format!("there is no memory for the {width} × {height} pixels of {file}"))
    })?;
    Ok(pixels)
}

/// Says what a picture says of its colours and nobody listens to.
fn warn_of_ignored(path: &Path, ignored: &[String]) {
    if !ignored.is_empty() {
        let text = format!("{}: {}; this is ignored", path.display(), ignored.join(", and "));
        Warning::new("ignored", text, "convert it to sRGB, or save it as linear Rec. 709").tell();
    }
}

fn check_finite<const N: usize>(path: &Path, size: [usize; 2], pixels: &[[f32; N]]) -> Result<()> {
    match not_finite(pixels) {
        None => Ok(()),
        Some(index) => {
            Err(format_error(path, "picture", format!("{} is not a finite number", place(index, size))))
        }
    }
}

/// Whether there is something to write and all of it is finite.
fn check_writable(image: &Image, what: &str) -> Result<()> {
    let [width, height] = image.size();
    if [width, height].iter().any(|&side| side == 0 || side > Camera::MAX_SIZE) {
        return Err(Error::value("size", format!("{width} × {height}"), "from 1 to 16384 pixels a side"));
    }
    if image.pixels.len() != width * height {
        return Err(Error::Shape { what: "a picture", expected: width * height, got: image.pixels.len() });
    }
    match not_finite(&image.pixels) {
        None => Ok(()),
        Some(index) => Err(Error::NonFinite { what: what.to_owned(), place: place(index, image.size()) }),
    }
}

fn not_finite<const N: usize>(pixels: &[[f32; N]]) -> Option<usize> {
    pixels.iter().position(|pixel| !pixel.iter().all(|c| c.is_finite()))
}

fn place(index: usize, size: [usize; 2]) -> String {
    format!("pixel ({}, {})", index % size[0], index / size[0])
}

fn format_error(path: &Path, format: &'static str, reason: impl Into<String>) -> Error {
    Error::Format { path: path.to_owned(), format, reason: reason.into() }
}

fn file_error(action: &'static str, path: &Path, source: std::io::Error) -> Error {
    Error::File { action, path: path.to_owned(), source }
}

#[cfg(test)]
mod tests;
