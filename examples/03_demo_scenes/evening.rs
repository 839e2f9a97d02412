//! A sky for surfaces: warm on one side, blue on the other, over dark ground.

use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::path::Path;

use glam::DVec3;
use unscatter::io::image::write_exr;
use unscatter::scene::Image;

/// Columns and rows of the picture of directions.
const SIZE: [usize; 2] = [64, 32];
/// Where the sun has gone down.
const WEST: DVec3 = DVec3::new(-0.8, 0.0, -0.6);

pub(crate) fn write(path: &Path) -> Result<(), Box<dyn Error>> {
    let [width, height] = SIZE;
    let pixel = |index: usize| {
        let (sin, cos) = (PI * ((index / width) as f64 + 0.5) / height as f64).sin_cos();
        let (across, ahead) = (TAU * (((index % width) as f64 + 0.5) / width as f64 - 0.5)).sin_cos();
        radiance(DVec3::new(sin * across, cos, -sin * ahead)).to_array().map(rounded)
    };
    write_exr(path, &Image::new(SIZE, (0..width * height).map(pixel).collect())?)?;
    Ok(())
}

/// From a direction, +Y up.
fn radiance(towards: DVec3) -> DVec3 {
    let (zenith, east) = (DVec3::new(0.16, 0.28, 0.62), DVec3::new(0.12, 0.2, 0.5));
    let (glow, ground) = (DVec3::new(2.6, 1.15, 0.35), DVec3::new(0.05, 0.04, 0.035));
    let height = towards.y.max(0.0);
    let west = 0.5 + 0.5 * towards.dot(WEST);
    let sky = zenith.lerp(east, (1.0 - height).powi(2)) + glow * (west.powi(3) * (-3.0 * height).exp());
    // The horizon is soft.
    sky.lerp(ground, (0.5 - 5.0 * towards.y).clamp(0.0, 1.0))
}

/// To a multiple of 1/4096, so that the last bits of sines do not matter.
fn rounded(value: f64) -> f32 {
    ((4096.0 * value).round() / 4096.0) as f32
}
