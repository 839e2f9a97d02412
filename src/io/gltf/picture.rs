//! The pictures of textures: each is decoded once a file, and only what a surface needs of it is kept.

use std::collections::HashMap;
use std::io::Cursor;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use gltf_json::Index;
use gltf_json::image::Image;
use image::{DynamicImage, GenericImageView, ImageDecoder, ImageError, ImageReader, Limits};

use super::file::GltfFile;
use crate::io::cutout::Cutoff;
use crate::io::film::passing;
use crate::io::guard::guarded;
use crate::scene::{AlphaMask, Rgb, Tint, Wrap};
use crate::{Error, Result};

/// Pixels along a side.
const MAX_SIDE: u32 = 16384;
/// Alpha that is kept of all pictures of a file, in bytes.
const MAX_KEPT: u64 = 1 << 30;
/// All pictures of a file as they are decoded one after the other, in bytes: sixteen of the largest ones.
const MAX_DECODED: u64 = 1 << 34;

/// A picture without its colours.
#[derive(Debug)]
pub(super) struct Picture {
    /// Whether its kind has an alpha channel at all.
    pub(super) has_alpha: bool,
    size: [usize; 2],
    /// Row by row; empty where nobody asked for it.
    alpha: Vec<u8>,
    /// For each alpha how many pixels there are, and the sum of their linear colours.
    tallies: Vec<(u64, [f64; 3])>,
}

impl Picture {
    /// Linear mean colour of the pixels that are there; transparent ones are often black.
    pub(super) fn mean_where_there(&self, cutoff: Option<Cutoff>) -> Rgb {
        let mut sum = [0.0; 3];
        let mut count = 0_u64;
        for (_, (pixels, colors)) in
            self.tallies().filter(|&(alpha, _)| cutoff.is_none_or(|cutoff| cutoff.keeps(alpha)))
        {
            sum = [0, 1, 2].map(|channel| sum[channel] + colors[channel]);
            count += pixels;
        }
        sum.map(|sum| (sum / count.max(1) as f64) as f32)
    }

    /// Whether a pixel is not there.
    pub(super) fn has_holes(&self, cutoff: Cutoff) -> bool {
        self.tallies().any(|(alpha, (pixels, _))| *pixels > 0 && !cutoff.keeps(alpha))
    }

    fn tallies(&self) -> impl Iterator<Item = (u8, &(u64, [f64; 3]))> {
        (0..=u8::MAX).zip(&self.tallies)
    }
}

/// A picture whose every pixel says what passes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PicturedGlass {
    /// Of the base colour.
    pub(super) base: Option<Index<Image>>,
    /// Of the transmission.
    pub(super) transmission: Option<Index<Image>>,
    pub(super) color: [f32; 4],
    pub(super) factor: f32,
    pub(super) blends: bool,
    pub(super) wrap: [Wrap; 2],
}

impl PicturedGlass {
    /// What passes where the pictures have these values.
    pub(super) fn passing(&self, color: Rgb, alpha: f32, transmission: f32) -> Rgb {
        let color = [0, 1, 2].map(|c| self.color[c] * color[c]);
        let alpha = if self.blends { self.color[3] * alpha } else { 1.0 };
        passing(color, alpha, self.factor * transmission)
    }
}

/// What a picture is made of: two pictures of a file may be the same.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum Source {
    View(usize),
    File(String),
    Inside(usize),
}

/// What makes two masks of the same picture the same: their cut-off and how they wrap.
type MaskKey = (Source, u32, [u8; 2]);

/// The pictures of one file that have been decoded, and the masks and the glass that were made of them.
#[derive(Debug, Default)]
pub(super) struct Pictures(Mutex<Known>);

#[derive(Debug, Default)]
struct Known {
    pictures: HashMap<Source, Arc<Picture>>,
    masks: HashMap<MaskKey, Arc<AlphaMask>>,
    tints: Vec<(PicturedGlass, Arc<Tint>)>,
    kept: u64,
    decoded: u64,
}

impl Pictures {
    /// A picture; one without its alpha where that is not needed.
    ///
    /// Errors: [`Error::Format`], [`Error::File`], [`Error::TooLarge`].
    pub(super) fn picture(
        &self,
        file: &GltfFile,
        index: Index<Image>,
        needs_alpha: bool,
    ) -> Result<Arc<Picture>> {
        let (image, source) = source(file, index)?;
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(picture) = known.pictures.get(&source)
            && !(needs_alpha && picture.has_alpha && picture.alpha.is_empty())
        {
            return Ok(picture.clone());
        }
        let decoded = guarded(&file.path, "glTF", || known.decode(file, image, needs_alpha));
        let picture = Arc::new(decoded?);
        known.pictures.insert(source, picture.clone());
        Ok(picture)
    }

    /// The mask that a picture with alpha makes. Errors: [`Error::TooLarge`], and those of a picture.
    pub(super) fn mask(
        &self,
        file: &GltfFile,
        index: Index<Image>,
        cutoff: Cutoff,
        wrap: [Wrap; 2],
    ) -> Result<Arc<AlphaMask>> {
        let picture = self.picture(file, index, true)?;
        let key = (source(file, index)?.1, cutoff.bits(), wrap.map(|wrap| wrap as u8));
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(mask) = known.masks.get(&key) {
            return Ok(mask.clone());
        }
        known.keep(file, picture.alpha.len() as u64)?;
        let mask = Arc::new(AlphaMask {
            size: picture.size,
            alpha: picture.alpha.clone(),
            cutoff: cutoff.value(),
            wrap,
        });
        known.masks.insert(key, mask.clone());
        Ok(mask)
    }

    /// What passes through glass that pictures describe. Errors: [`Error::TooLarge`], and those of a picture.
    pub(super) fn tint(&self, file: &GltfFile, glass: &PicturedGlass) -> Result<Arc<Tint>> {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, tint)) = known.tints.iter().find(|(of, _)| of == glass) {
            return Ok(tint.clone());
        }
        let (base, transmission) =
            (known.decoded(file, glass.base)?, known.decoded(file, glass.transmission)?);
        let Some(carrier) = base.as_ref().or(transmission.as_ref()) else {
            return Err(file.broken("glass has no picture".into()));
        };
        let (width, height) = carrier.dimensions();
        known.keep(file, 3 * u64::from(width) * u64::from(height))?;
        let linear = |code: u8| LINEAR[usize::from(code)] as f32;
        let value = |y: u32, x: u32| {
            let color = base.as_ref().map_or([255; 4], |picture| picture.get_pixel(x, y).0);
            // The nearest pixel of a picture of another size.
            let through = transmission.as_ref().map_or(1.0, |picture| {
                let at = |place: u32, of: u32, side: u32| {
                    (u64::from(2 * place + 1) * u64::from(side) / u64::from(2 * of)) as u32
                };
                let (x, y) = (at(x, width, picture.width()), at(y, height, picture.height()));
                f32::from(picture.get_pixel(x, y).0[0]) / 255.0
            });
            let alpha = f32::from(color[3]) / 255.0;
            glass.passing([0, 1, 2].map(|c| linear(color[c])), alpha, through).map(Tint::value)
        };
        let values = (0..height).flat_map(|y| (0..width).map(move |x| (y, x)));
        let tint = Arc::new(Tint {
            size: [width as usize, height as usize],
            values: values.map(|(y, x)| value(y, x)).collect(),
            wrap: glass.wrap,
        });
        known.tints.push((*glass, tint.clone()));
        Ok(tint)
    }

    #[cfg(test)]
    pub(super) fn decoded_bytes(&self) -> u64 {
        self.0.lock().unwrap().decoded
    }
}

impl Known {
    fn keep(&mut self, file: &GltfFile, bytes: u64) -> Result<()> {
        self.kept += bytes;
        within(self.kept, MAX_KEPT, || format!("alpha of the pictures of {}", file.path.display()))
    }

    fn decode(&mut self, file: &GltfFile, image: &Image, needs_alpha: bool) -> Result<Picture> {
        let pixels = self.pixels(file, image, needs_alpha)?;
        let has_alpha = pixels.color().has_alpha();
        let size = [pixels.width() as usize, pixels.height() as usize];
        let kept = if needs_alpha && has_alpha { size[0] * size[1] } else { 0 };
        let mut picture =
            Picture { has_alpha, size, alpha: Vec::with_capacity(kept), tallies: vec![(0, [0.0; 3]); 256] };
        let linear = &*LINEAR;
        if let DynamicImage::ImageLuma8(grey) = &pixels {
            let mut counts = [0_u64; 256];
            grey.as_raw().iter().for_each(|&byte| counts[usize::from(byte)] += 1);
            let sum: f64 = counts.iter().zip(linear).map(|(&count, value)| count as f64 * value).sum();
            picture.tallies[usize::from(u8::MAX)] = (grey.as_raw().len() as u64, [sum; 3]);
            return Ok(picture);
        }
        for (_, _, pixel) in pixels.pixels() {
            let [red, green, blue, alpha] = pixel.0;
            let (count, sums) = &mut picture.tallies[usize::from(alpha)];
            *count += 1;
            for (sum, code) in sums.iter_mut().zip([red, green, blue]) {
                *sum += linear[usize::from(code)];
            }
            if kept > 0 {
                picture.alpha.push(alpha);
            }
        }
        Ok(picture)
    }

    /// The pixels themselves; where alpha is to be kept, that counts.
    fn pixels(&mut self, file: &GltfFile, image: &Image, keeps_alpha: bool) -> Result<DynamicImage> {
        let bytes = match (&image.uri, image.buffer_view) {
            (_, Some(view)) => file.view(view)?.to_vec(),
            (Some(uri), None) => file.read_uri(uri)?,
            (None, None) => return Err(file.broken("a picture has no data".into())),
        };
        let name = image.uri.as_deref().filter(|uri| !uri.starts_with("data:")).unwrap_or("inside of it");
        let failed = |error: ImageError| file.broken(format!("the picture {name}: {error}"));
        let mut reader =
            ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| failed(e.into()))?;
        let mut limits = Limits::no_limits();
        limits.max_alloc = Some(16 * u64::from(MAX_SIDE) * u64::from(MAX_SIDE));
        reader.limits(limits);
        let decoder = reader.into_decoder().map_err(failed)?;
        let (width, height) = decoder.dimensions();
        if width.max(height) > MAX_SIDE {
            return Err(Error::TooLarge {
                what: format!("the picture {name} of {}", file.path.display()),
                needed: format!("{width} by {height} pixels"),
                limit: format!("{MAX_SIDE} by {MAX_SIDE}"),
                remedy: "scale the texture down",
            });
        }
        self.decoded += decoder.total_bytes();
        within(self.decoded, MAX_DECODED, || format!("all pictures of {}", file.path.display()))?;
        if keeps_alpha && decoder.color_type().has_alpha() {
            self.keep(file, u64::from(width) * u64::from(height))?;
        }
        DynamicImage::from_decoder(decoder).map_err(failed)
    }

    /// The pixels of a picture, if there is one.
    fn decoded(&mut self, file: &GltfFile, index: Option<Index<Image>>) -> Result<Option<image::RgbaImage>> {
        let Some(index) = index else { return Ok(None) };
        let (image, _) = source(file, index)?;
        Ok(Some(guarded(&file.path, "glTF", || self.pixels(file, image, false))?.into_rgba8()))
    }
}

fn source(file: &GltfFile, index: Index<Image>) -> Result<(&Image, Source)> {
    let image = file.get(index).ok_or_else(|| file.broken(format!("picture {index} is missing")))?;
    let source = match (&image.uri, image.buffer_view) {
        (_, Some(view)) => Source::View(view.value()),
        (Some(uri), None) if !uri.starts_with("data:") => Source::File(uri.clone()),
        _ => Source::Inside(index.value()),
    };
    Ok((image, source))
}

fn within(bytes: u64, limit: u64, what: impl Fn() -> String) -> Result<()> {
    if bytes <= limit {
        return Ok(());
    }
    Err(Error::TooLarge {
        what: what(),
        needed: format!("{bytes} bytes or more"),
        limit: limit.to_string(),
        remedy: "scale the textures down, or choose a single node",
    })
}

static LINEAR: LazyLock<[f64; 256]> = LazyLock::new(|| {
    std::array::from_fn(|byte| {
        let value = byte as f64 / 255.0;
        if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    })
});
