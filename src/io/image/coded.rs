//! PNG, JPEG and HDR, through the `image` crate.

use std::path::Path;

use ::image::codecs::hdr::HdrEncoder;
use ::image::codecs::png::PngEncoder;
use ::image::{
    DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder, ImageError, ImageFormat, ImageReader,
    Limits, Rgb,
};
use rayon::prelude::*;

use super::{
    Alpha, PictureFile, PictureFormat, check_size, file_error, format_error, linear_from_srgb,
    srgb_from_linear,
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

/// Size and pixels: linear colour, and straight alpha for N = 4.
pub(super) fn read<const N: usize>(
    path: &Path,
    source: PictureFile,
    alpha: Alpha,
) -> Result<([usize; 2], Vec<[f32; N]>)> {
    let PictureFile { file, bytes, format } = source;
    let failed = |error| decoder_error(path, format, error);
    let mut reader = ImageReader::with_format(file, crate_format(path, format)?);
    let mut limits = Limits::default();
    let side = Camera::MAX_SIZE as u32;
    (limits.max_image_width, limits.max_image_height) = (Some(side), Some(side));
    limits.max_alloc = Some(DECODER_BYTES);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(failed)?;
    let (width, height) = decoder.dimensions();
    let size = [width as usize, height as usize];
    check_size(path, format, size, decoder.total_bytes().into(), bytes)?;
    if alpha == Alpha::Needed && !decoder.color_type().has_alpha() {
        let reason = "it has no alpha, which is the weight of the constraint: paint on a transparent layer and \
                      save it as PNG or EXR with alpha";
        return Err(format_error(path, format.name(), reason));
    }
    let picture = DynamicImage::from_decoder(decoder).map_err(failed)?;
    let pixels = linear_pixels(&picture)
        .ok_or_else(|| format_error(path, format.name(), "its kind of pixels is not supported"))?;
    Ok((size, pixels))
}

fn crate_format(path: &Path, format: PictureFormat) -> Result<ImageFormat> {
    match format {
        PictureFormat::Png => Ok(ImageFormat::Png),
        PictureFormat::Jpeg => Ok(ImageFormat::Jpeg),
        PictureFormat::Hdr => Ok(ImageFormat::Hdr),
        PictureFormat::Exr => Err(format_error(path, format.name(), "it is read elsewhere")),
    }
}

/// None for a kind of pixels that the `image` crate may learn one day.
fn linear_pixels<const N: usize>(picture: &DynamicImage) -> Option<Vec<[f32; N]>> {
    let channels = usize::from(picture.color().channel_count());
    let bytes = |samples: &[u8]| {
        let linear = linear_codes(255);
        pixels(samples, channels, |code| linear[usize::from(code)], |code| f32::from(code) / 255.0)
    };
    let words = |samples: &[u16]| {
        let linear = linear_codes(65535);
        pixels(samples, channels, |code| linear[usize::from(code)], |code| f32::from(code) / 65535.0)
    };
    let floats = |samples: &[f32]| pixels(samples, channels, |value| value, |value| value);
    Some(match picture {
        DynamicImage::ImageLuma8(p) => bytes(p),
        DynamicImage::ImageLumaA8(p) => bytes(p),
        DynamicImage::ImageRgb8(p) => bytes(p),
        DynamicImage::ImageRgba8(p) => bytes(p),
        DynamicImage::ImageLuma16(p) => words(p),
        DynamicImage::ImageLumaA16(p) => words(p),
        DynamicImage::ImageRgb16(p) => words(p),
        DynamicImage::ImageRgba16(p) => words(p),
        DynamicImage::ImageRgb32F(p) => floats(p),
        DynamicImage::ImageRgba32F(p) => floats(p),
        _ => return None,
    })
}

/// The linear value of each sRGB code from 0 to `top`.
fn linear_codes(top: u16) -> Vec<f32> {
    (0..=top).map(|code| linear_from_srgb(f32::from(code) / f32::from(top))).collect()
}

/// The first N of R, G, B, A; grey counts as all three colours, and where there is no alpha it is 1.
fn pixels<T: Copy, const N: usize>(
    samples: &[T],
    channels: usize,
    color: impl Fn(T) -> f32,
    alpha: impl Fn(T) -> f32,
) -> Vec<[f32; N]> {
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
    samples.chunks_exact(channels).map(pixel).collect()
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
