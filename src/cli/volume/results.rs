//! The files of a volume solve.

use serde::Serialize;

use super::super::results::Folder;
use super::super::to_json;
use crate::Result;
use crate::io;
use crate::io::volume::{self, Format};
use crate::problem::Desired;
use crate::report;
use crate::scene::{Environment, Find, Image, Rgb, Volume, VolumeMedium, VolumeScene};

/// Writes the volumes that were looked for, in every format that is asked for.
pub(super) fn write_volumes(
    folder: &Folder,
    prefix: &str,
    finds: &[Find],
    medium: &VolumeMedium,
    formats: &[Format],
) -> Result<()> {
    let has = |properties: &[Find]| finds.iter().any(|find| properties.contains(find));
    let found: [(bool, &str, &Volume); 3] = [
        (has(&[Find::Emission, Find::Joint]), "emission", &medium.emission),
        (has(&[Find::Albedo, Find::Joint]), "albedo", &medium.albedo),
        (has(&[Find::Extinction, Find::Refinement]), "extinction", &medium.extinction),
    ];
    for (_, name, found) in found.iter().filter(|(is_found, ..)| *is_found) {
        for &format in formats {
            let path = folder.file(&format!("{prefix}{name}.{}", format.extension()));
            volume::write(&path, name, found, format)?;
        }
    }
    Ok(())
}

/// The longer side of a small picture at most.
const LONGEST: usize = 320;

/// Columns and rows of the picture of an environment.
const SKY_SIZE: [usize; 2] = [512, 256];

/// A combination of lights, as a file.
#[derive(Serialize)]
struct Lights {
    /// `discs`, or `map`: the pixels of a latitude-longitude picture.
    kind: &'static str,
    /// Columns and rows of the map.
    #[serde(skip_serializing_if = "Option::is_none")]
    size: Option<[usize; 2]>,
    lights: Vec<Light>,
}

#[derive(Serialize)]
struct Light {
    /// Unit vector to the middle of the light.
    towards: [f64; 3],
    /// In steradians.
    solid_angle: f64,
    radiance: Rgb,
}

/// Writes the light around a volume as pictures (EXR, HDR, PNG) and as a list of lights; gives back the PNG file.
pub(super) fn write_environment(
    folder: &Folder,
    prefix: &str,
    scene: &VolumeScene,
    environment: &Environment,
) -> Result<Vec<u8>> {
    let basis = &scene.light_basis;
    let lights = basis.lights().iter().zip(basis.coefficients_of(environment));
    let list = Lights {
        kind: if basis.is_map() { "map" } else { "discs" },
        size: basis.is_map().then(|| basis.lattice()),
        lights: lights
            .map(|(light, radiance)| Light {
                towards: light.towards.to_array(),
                solid_angle: light.solid_angle,
                radiance,
            })
            .collect(),
    };
    let name = format!("{prefix}environment");
    folder.write_bytes(&format!("{name}.json"), to_json(&list)?.as_bytes())?;
    // A map as it is, so that it can be the start of another solve without a loss.
    let picture = environment.picture(if basis.is_map() { basis.lattice() } else { SKY_SIZE })?;
    io::image::write_hdr(&folder.file(&format!("{name}.hdr")), &picture)?;
    io::image::write_exr(&folder.file(&format!("{name}.exr")), &picture)?;
    // The brightest light is white, unless the scene's pictures are darker than that.
    let white = f64::from(environment.brightest());
    let exposure = if white > 0.0 { scene.exposure.min(-white.log2()) } else { 0.0 };
    folder.write_png(&name, &environment.picture(SKY_SIZE)?, exposure)
}

/// Writes the pictures of all views; gives back their PNG files.
pub(super) fn write_views(
    folder: &Folder,
    prefix: &str,
    scene: &VolumeScene,
    desired: &[Desired],
    before: &[Image],
    after: &[Image],
) -> Result<Vec<report::ViewPictures>> {
    let mut written = Vec::with_capacity(scene.views.len());
    for (index, view) in scene.views.iter().enumerate() {
        let (before, after, desired) = (&before[index], &after[index], &desired[index]);
        let mut target = before.clone();
        let mut difference = Image::constant(before.size(), [0.0; 3]);
        for (pixel, &[r, g, b, weight]) in desired.pixels.iter().enumerate() {
            let wanted: Rgb = [r, g, b];
            for c in 0..3 {
                let shown = before.pixels[pixel][c];
                target.pixels[pixel][c] = shown + weight * (wanted[c] - shown);
                difference.pixels[pixel][c] = weight * (after.pixels[pixel][c] - wanted[c]).abs();
            }
        }
        let name = &view.view.name;
        let write = |kind: &str, picture: &Image| {
            folder.write_picture(&format!("{prefix}{name}_{kind}"), picture, scene.exposure)
        };
        let ((target, before), (after, difference)) = rayon::join(
            || rayon::join(|| write("target", &target), || write("before", before)),
            || rayon::join(|| write("after", after), || write("difference", &difference)),
        );
        written.push(report::ViewPictures {
            name: name.clone(),
            target: target?,
            before: before?,
            after: after?,
            difference: difference?,
        });
    }
    Ok(written)
}

/// Writes the pictures of a turntable; gives back the files.
pub(super) fn write_turntable(
    folder: &Folder,
    prefix: &str,
    turns: &[Image],
    exposure: f64,
) -> Result<Vec<Vec<u8>>> {
    turns
        .iter()
        .enumerate()
        .map(|(index, picture)| folder.write_png(&format!("{prefix}turntable_{index:03}"), picture, exposure))
        .collect()
}

/// A picture as PNG, with the means of blocks of pixels for pixels where it is large.
pub(super) fn small_png(picture: &Image, exposure: f64) -> Result<Vec<u8>> {
    let [width, height] = picture.size();
    let side = width.max(height).div_ceil(LONGEST).max(1);
    let size = [width.div_ceil(side), height.div_ceil(side)];
    let mean = |index: usize| {
        let (left, top) = (index % size[0] * side, index / size[0] * side);
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for y in top..(top + side).min(height) {
            for x in left..(left + side).min(width) {
                let pixel = picture.at(x, y);
                (0..3).for_each(|c| sum[c] += pixel[c]);
                count += 1.0;
            }
        }
        sum.map(|value: f32| value / count)
    };
    let small = Image::new(size, (0..size[0] * size[1]).map(mean).collect())?;
    io::image::png_bytes(&small, exposure)
}
