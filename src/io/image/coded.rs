//! PNG, JPEG and what is written of HDR, through the `image` crate.

use std::io::{BufRead, Seek};
use std::path::Path;

use ::image::codecs::hdr::HdrEncoder;
use ::image::codecs::png::PngEncoder;
use ::image::{
    DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder, ImageError, ImageFormat, ImageReader,
    Limits, Rgb,
};
use rayon::prelude::*;

use super::super::guard::guarded;
use super::png_header::{Curve, PngHeader};
use super::{
    Alpha, PictureFile, PictureFormat, check_size, file_error, format_error, room, srgb_from_linear,
    warn_of_ignored,
};
use crate::scene::{Camera, Image};
use crate::{Error, Result};

/// The largest picture with four channels of 16 bits, and as much again for the decoder itself.
const DECODER_BYTES: u64 = 16 * (Camera::MAX_SIZE as u64) * (Camera::MAX_SIZE as u64);

/// Expects a picture that can be written.
pub(super) fn png_bytes(image: &Image, exposure: f64) -> Result<Vec<u8>> {
    if !exposure.is_finite() {
        return Err(Error::value("exposure", exposure, "a finite number of stops"));
    }
    let scale = exposure.exp2();
    let mut codes = vec![0; 3 * image.pixels.len()];
    codes.par_chunks_exact_mut(3).zip(&image.pixels).for_each(|(code, pixel)| {
        for (code, &linear) in code.iter_mut().zip(pixel) {
            *code = code_from_linear((f64::from(linear) * scale).clamp(0.0, 1.0) as f32);
        }
    });
    let mut bytes = Vec::new();
    let [width, height] = image.size().map(|side| side as u32);
    PngEncoder::new(&mut bytes)
        .write_image(&codes, width, height, ExtendedColorType::Rgb8)
        .map_err(|error| Error::Machine(format!("a PNG picture could not be encoded: {error}")))?;
    Ok(bytes)
}

/// 8-bit sRGB with an alpha of 255, for screens.
#[cfg(feature = "studio")]
pub(super) fn rgba_bytes(image: &Image, scale: f64) -> Vec<u8> {
    let mut codes = vec![255; 4 * image.pixels.len()];
    codes.par_chunks_exact_mut(4).zip(&image.pixels).for_each(|(code, pixel)| {
        for (code, &linear) in code.iter_mut().zip(pixel) {
            *code = code_from_linear((f64::from(linear) * scale).clamp(0.0, 1.0) as f32);
        }
    });
    codes
}

/// Expects a picture that can be written.
pub(super) fn hdr_bytes(image: &Image) -> Result<Vec<u8>> {
    if let Some(pixel) = image.pixels.iter().find(|pixel| pixel.iter().any(|&value| value < 0.0)) {
        return Err(Error::value(
            "a pixel",
            format!("{pixel:?}"),
            "not negative, which HDR files cannot hold",
        ));
    }
    let pixels: Vec<Rgb<f32>> = image.pixels.iter().map(|&pixel| Rgb(pixel)).collect();
    let mut bytes = Vec::new();
    HdrEncoder::new(&mut bytes)
        .encode(&pixels, image.size()[0], image.size()[1])
        .map_err(|error| Error::Machine(format!("an HDR picture could not be encoded: {error}")))?;
    Ok(bytes)
}

fn code_from_linear(linear: f32) -> u8 {
    (255.0 * srgb_from_linear(linear)).round() as u8
}

/// Size of a PNG or JPEG picture.
pub(super) fn size_of(path: &Path, source: PictureFile) -> Result<[usize; 2]> {
    let PictureFile { mut file, bytes, format } = source;
    match format {
        PictureFormat::Png => sound_header(path, &mut file, bytes).map(|header| header.size),
        _ => guarded(path, format.name(), || Ok(size(&decoder(path, format, file, bytes)?))),
    }
}

/// Size and pixels: linear colour, and straight alpha for N = 4.
pub(super) fn read<const N: usize>(
    path: &Path,
    source: PictureFile,
    alpha: Alpha,
) -> Result<([usize; 2], Vec<[f32; N]>)> {
    let PictureFile { mut file, bytes, format } = source;
    let (mut curve, mut ignored, mut heeds_profile) = (Curve::Srgb, Vec::new(), true);
    if format == PictureFormat::Png {
        let header = sound_header(path, &mut file, bytes)?;
        file.rewind().map_err(|error| file_error("read", path, error))?;
        (curve, ignored) = header.colors.meaning();
        heeds_profile = header.colors.heeds_profile();
    }
    let (picture, profile) = guarded(path, format.name(), || {
        let mut decoder = decoder(path, format, file, bytes)?;
        if alpha == Alpha::Needed && !decoder.color_type().has_alpha() {
            let reason = "it has no alpha, which is the weight of the constraint: paint on a transparent layer and \
                          save it as PNG or EXR with alpha";
            return Err(format_error(path, format.name(), reason));
        }
        // One that is damaged says nothing.
        let profile = decoder.icc_profile().ok().flatten();
        let picture = DynamicImage::from_decoder(decoder);
        Ok((picture.map_err(|error| decoder_error(path, format, error))?, profile))
    })?;
    if heeds_profile && profile.is_some_and(|profile| !is_srgb(&profile)) {
        ignored.push("its colour profile is not called sRGB".to_owned());
    }
    warn_of_ignored(path, &ignored);
    let size = [picture.width() as usize, picture.height() as usize];
    let mut pixels = room(path, size)?;
    put_linear(&picture, curve, &mut pixels)
        .ok_or_else(|| format_error(path, format.name(), "its kind of pixels is not supported"))?;
    Ok((size, pixels))
}

/// The chunks before the pixels of a PNG picture whose size is usual.
fn sound_header(path: &Path, file: &mut (impl BufRead + Seek), stored_bytes: u64) -> Result<PngHeader> {
    let header = PngHeader::read(path, file)?;
    check_size(path, PictureFormat::Png, header.size, header.bytes, stored_bytes)?;
    Ok(header)
}

/// A decoder of a picture whose size is usual.
fn decoder<'a>(
    path: &Path,
    format: PictureFormat,
    file: impl BufRead + Seek + 'a,
    stored_bytes: u64,
) -> Result<impl ImageDecoder + 'a> {
    let mut reader = ImageReader::with_format(file, crate_format(path, format)?);
    let mut limits = Limits::default();
    let side = Camera::MAX_SIZE as u32;
    (limits.max_image_width, limits.max_image_height) = (Some(side), Some(side));
    limits.max_alloc = Some(DECODER_BYTES);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|error| decoder_error(path, format, error))?;
    // Those of a PNG are checked as they are stored: up to 32 bits come of one.
    if format != PictureFormat::Png {
        check_size(path, format, size(&decoder), decoder.total_bytes().into(), stored_bytes)?;
    }
    Ok(decoder)
}

fn size(decoder: &impl ImageDecoder) -> [usize; 2] {
    let (width, height) = decoder.dimensions();
    [width as usize, height as usize]
}

/// Whether an ICC profile calls itself sRGB, and not linear.
fn is_srgb(profile: &[u8]) -> bool {
    let says = |name: &str| {
        let wide: Vec<u8> = name.bytes().flat_map(|letter| [0, letter]).collect();
        [name.as_bytes(), &wide].iter().any(|name| profile.windows(name.len()).any(|part| part == *name))
    };
    says("sRGB") && !says("inear")
}

fn crate_format(path: &Path, format: PictureFormat) -> Result<ImageFormat> {
    match format {
        PictureFormat::Png => Ok(ImageFormat::Png),
        PictureFormat::Jpeg => Ok(ImageFormat::Jpeg),
        PictureFormat::Hdr | PictureFormat::Exr => {
            Err(format_error(path, format.name(), "it is read elsewhere"))
        }
    }
}

/// None for a kind of pixels that the `image` crate may learn one day.
fn put_linear<const N: usize>(picture: &DynamicImage, curve: Curve, to: &mut Vec<[f32; N]>) -> Option<()> {
    let channels = usize::from(picture.color().channel_count());
    let mut bytes = |samples: &[u8]| {
        let linear = linear_codes(255, curve);
        put(samples, channels, |code| linear[usize::from(code)], |code| f32::from(code) / 255.0, to);
    };
    match picture {
        DynamicImage::ImageLuma8(p) => bytes(p),
        DynamicImage::ImageLumaA8(p) => bytes(p),
        DynamicImage::ImageRgb8(p) => bytes(p),
        DynamicImage::ImageRgba8(p) => bytes(p),
        _ => {
            let samples: &[u16] = match picture {
                DynamicImage::ImageLuma16(p) => p,
                DynamicImage::ImageLumaA16(p) => p,
                DynamicImage::ImageRgb16(p) => p,
                DynamicImage::ImageRgba16(p) => p,
                _ => return None,
            };
            let linear = linear_codes(65535, curve);
            put(samples, channels, |code| linear[usize::from(code)], |code| f32::from(code) / 65535.0, to);
        }
    }
    Some(())
}

/// The linear value of each code from 0 to `top`.
fn linear_codes(top: u16, curve: Curve) -> Vec<f32> {
    (0..=top).map(|code| curve.linear(f32::from(code) / f32::from(top))).collect()
}

/// The first N of R, G, B, A; grey counts as all three colours, and where there is no alpha it is 1.
fn put<T: Copy, const N: usize>(
    samples: &[T],
    channels: usize,
    color: impl Fn(T) -> f32,
    alpha: impl Fn(T) -> f32,
    to: &mut Vec<[f32; N]>,
) {
    let has_alpha = channels.is_multiple_of(2);
    let is_grey = channels < 3;
    let pixel = |samples: &[T]| {
        std::array::from_fn(|component| match component {
            3 if has_alpha => alpha(samples[channels - 1]),
            3 => 1.0,
            _ if is_grey => color(samples[0]),
            _ => color(samples[component]),
        })
    };
    to.extend(samples.chunks_exact(channels).map(pixel));
}

fn decoder_error(path: &Path, format: PictureFormat, error: ImageError) -> Error {
    use std::io::ErrorKind::{InvalidData, InvalidInput, UnexpectedEof};
    match error {
        ImageError::IoError(source)
            if !matches!(source.kind(), UnexpectedEof | InvalidData | InvalidInput) =>
        {
            file_error("read", path, source)
        }
        other => format_error(path, format.name(), other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_is_srgb_by_its_name() {
        let wide: Vec<u8> = "GIMP built-in sRGB".bytes().flat_map(|letter| [0, letter]).collect();
        assert!(is_srgb(b"..desc..sRGB IEC61966-2.1..") && is_srgb(&wide));
        assert!(!is_srgb(b"..desc..Display P3..") && !is_srgb(b"Linear sRGB") && !is_srgb(b"linear sRGB"));
    }
}
