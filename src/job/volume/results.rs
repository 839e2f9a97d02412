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
