//! The files of a volume solve.

use super::super::folder::{Folder, Painted, ViewImages};
use crate::Result;
use crate::io::volume::{self, Format};
use crate::problem::{Desired, Rendering};
use crate::report;
use crate::scene::{Find, Image, Volume, VolumeMedium, VolumeScene, VolumeView};

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

/// Writes the pictures of all views; gives back their PNG files.
pub(super) fn write_views(
    folder: &Folder,
    prefix: &str,
    scene: &VolumeScene,
    desired: &[Desired],
    before: &[Image],
    after: &[Image],
) -> Result<Vec<report::ViewPictures>> {
    let write = |(index, view): (usize, &VolumeView)| {
        let (before, after) = (&before[index], &after[index]);
        let painted = desired[index].pixels.iter().enumerate().map(|(pixel, &[r, g, b, weight])| Painted {
            pixel,
            weight,
            before: before.pixels[pixel],
            wanted: [r, g, b],
            after: after.pixels[pixel],
        });
        let rendering = Rendering { before: before.clone(), after: after.clone() };
        let name = &view.view.name;
        let pictures = ViewImages::new(&format!("{prefix}{name}"), painted, rendering);
        Ok(report::ViewPictures { name: name.clone(), ..pictures.write(folder, scene.exposure)? })
    };
    scene.views.iter().enumerate().map(write).collect()
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

/// A picture as PNG. A large one is shrunk: each pixel is the mean of a block.
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
    crate::io::image::png_bytes(&small, exposure)
}
