//! The files of a volume solve.

use super::super::results::Folder;
use crate::Result;
use crate::io::volume::{self, Format};
use crate::problem::Desired;
use crate::report;
use crate::scene::{Find, Image, Rgb, Volume, VolumeMedium, VolumeScene};

/// Writes the volumes that were looked for, in every format that is asked for.
pub(super) fn write_volumes(
    folder: &Folder,
    finds: &[Find],
    medium: &VolumeMedium,
    formats: &[Format],
) -> Result<()> {
    let has = |properties: &[Find]| finds.iter().any(|find| properties.contains(find));
    let found: [(bool, &str, &Volume); 3] = [
        (has(&[Find::Emission, Find::Joint]), "emission", &medium.emission),
        (has(&[Find::Albedo, Find::Joint]), "albedo", &medium.albedo),
        (has(&[Find::Extinction]), "extinction", &medium.extinction),
    ];
    for (_, name, found) in found.iter().filter(|(is_found, ..)| *is_found) {
        for &format in formats {
            let path = folder.file(&format!("{name}.{}", format.extension()));
            volume::write(&path, name, found, format)?;
        }
    }
    Ok(())
}

/// Writes the pictures of all views; gives back their PNG files.
pub(super) fn write_views(
    folder: &Folder,
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
            folder.write_picture(&format!("{name}_{kind}"), picture, scene.exposure)
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
pub(super) fn write_turntable(folder: &Folder, turns: &[Image], exposure: f64) -> Result<Vec<Vec<u8>>> {
    turns
        .iter()
        .enumerate()
        .map(|(index, picture)| folder.write_png(&format!("turntable_{index:03}"), picture, exposure))
        .collect()
}
