//! How far results are apart.

use std::path::{Path, PathBuf};

use unscatter::Result;
use unscatter::io;

/// ‖a − b‖ / ‖b‖ of the files that two folders of results have in common: the largest of what was found (light maps or volumes), and the
/// largest of the pictures after.
pub fn of_results(a: &Path, b: &Path) -> Result<[Option<f64>; 2]> {
    let mut largest = [None, None];
    for path in files(b) {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let other = a.join(&name);
        let kind = match &name[..] {
            "light_map.exr" => 0,
            name if name.ends_with(".npy") => 0,
            name if name.ends_with("_after.exr") || name.starts_with("frame") && name.ends_with(".exr") => 1,
            _ => continue,
        };
        if !other.exists() {
            continue;
        }
        let distance = relative(&numbers(&other)?, &numbers(&path)?);
        largest[kind] = Some(largest[kind].unwrap_or(0.0_f64).max(distance));
    }
    Ok(largest)
}

/// ‖a − b‖ / ‖b‖; infinite where they are not as long as each other.
pub fn relative(a: &[f64], b: &[f64]) -> f64 {
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>().sqrt();
    let apart = norm(&mut a.iter().zip(b).map(|(a, b)| a - b));
    let length = norm(&mut b.iter().copied());
    if apart == 0.0 { 0.0 } else { apart / length }
}

fn numbers(path: &Path) -> Result<Vec<f64>> {
    if path.extension().is_some_and(|ending| ending == "npy") {
        let volume = io::volume::read(path, None)?.volume;
        return Ok(volume.samples().iter().map(f64::from).collect());
    }
    let image = io::image::read_image(path)?;
    Ok(image.pixels.into_iter().flatten().map(f64::from).collect())
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| path.is_file()).collect();
    files.sort();
    files
}
