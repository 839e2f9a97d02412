//! Pictures that are painted by a formula, and the brushes that it is made of.

use std::error::Error;
use std::path::Path;

use glam::DVec2;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

/// sRGB colour, and how much of the pixel has it, from 0 to 1.
pub(crate) type Ink = ([u8; 3], f64);

/// Samples along each side of a pixel.
const SAMPLES: u32 = 4;

/// Steps of alpha: few, so that files are small.
const STEPS: f64 = 15.0;

/// Writes a PNG picture with alpha; `ink` is asked at points with x to the right and y up, from −1 to 1 across the
/// shorter side.
pub(crate) fn write(
    path: &Path,
    [width, height]: [u32; 2],
    ink: impl Fn(DVec2) -> Option<Ink>,
) -> Result<(), Box<dyn Error>> {
    let half = 0.5 * f64::from(width.min(height));
    let middle = 0.5 * DVec2::new(f64::from(width), f64::from(height));
    let mut bytes = Vec::with_capacity((4 * width * height) as usize);
    for pixel in 0..width * height {
        let corner = DVec2::new(f64::from(pixel % width), f64::from(pixel / width));
        let mut sum = [0.0; 4];
        for sample in 0..SAMPLES * SAMPLES {
            let inside = DVec2::new(f64::from(sample % SAMPLES), f64::from(sample / SAMPLES)) + 0.5;
            let p = (corner + inside / f64::from(SAMPLES) - middle) / half;
            if let Some((color, alpha)) = ink(DVec2::new(p.x, -p.y)) {
                (0..3).for_each(|c| sum[c] += alpha * f64::from(color[c]));
                sum[3] += alpha;
            }
        }
        let alpha = (STEPS * sum[3] / f64::from(SAMPLES * SAMPLES)).round() * 255.0 / STEPS;
        let share = if alpha > 0.0 { sum[3].recip() } else { 0.0 };
        bytes.extend((0..3).map(|c| (sum[c] * share).round() as u8));
        bytes.push(alpha as u8);
    }
    let mut file = Vec::new();
    PngEncoder::new_with_quality(&mut file, CompressionType::Best, FilterType::Adaptive).write_image(
        &bytes,
        width,
        height,
        ExtendedColorType::Rgba8,
    )?;
    Ok(std::fs::write(path, file)?)
}

/// How far a point is outside of a disc; negative inside.
pub(crate) fn disc(p: DVec2, middle: [f64; 2], radius: f64) -> f64 {
    p.distance(DVec2::from_array(middle)) - radius
}

/// Whether a point is inside a polygon: an odd number of its sides lies to the right.
pub(crate) fn is_in_polygon(p: DVec2, corners: &[[f64; 2]]) -> bool {
    let sides = corners.iter().zip(corners.iter().cycle().skip(1));
    let crossed = sides.filter(|&(&[ax, ay], &[bx, by])| {
        (ay > p.y) != (by > p.y) && p.x < ax + (p.y - ay) / (by - ay) * (bx - ax)
    });
    crossed.count() % 2 == 1
}
