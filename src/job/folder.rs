//! The folder of results, and the pictures of a view in it.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::lock::{LOCK, Lock};

use crate::problem::Rendering;
use crate::scene::{Image, Rgb};
use crate::{Error, Result};
use crate::{io, report};

/// The folder that a command writes its results to.
///
/// They are made in a folder inside it and moved out of that together, so that a disk that fills up half-way leaves
/// the results that were there as they were.
#[derive(Debug)]
pub(crate) struct Folder {
    path: PathBuf,
    making: TempDir,
    /// Until the run is over.
    _lock: Lock,
}

/// How the names of the folders begin in which results are made.
const MAKING: &str = ".unscatter-";

/// Removes what is being made in a folder, and with it what a killed run left; for the run that has the folder. What cannot be removed stays.
fn sweep(folder: &Path) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let is_made = |name: &OsStr| name != LOCK && name.to_string_lossy().starts_with(MAKING);
    for entry in entries.flatten().filter(|entry| is_made(&entry.file_name())) {
        _ = std::fs::remove_dir_all(entry.path());
    }
}

/// Removes what is being made in a folder and gives the folder up; for a run that ends at once.
pub(crate) fn abandon(folder: &Path) {
    sweep(folder);
    _ = std::fs::remove_file(folder.join(LOCK));
}

impl Folder {
    /// Creates the folder, takes it for this run, and makes sure before any work is done that it can be written.
    ///
    /// Errors: [`Error::File`] where that fails; [`Error::Machine`] where another run has it.
    pub(crate) fn create(path: impl Into<PathBuf>) -> Result<Self> {
        let path = path.into();
        std::fs::create_dir_all(&path).map_err(failed("create the folder", &path))?;
        let lock = Lock::of(&path)?;
        sweep(&path);
        let making = tempfile::Builder::new().prefix(MAKING).tempdir_in(&path);
        let making = making.map_err(failed("write into", &path))?;
        Ok(Self { path, making, _lock: lock })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Where a result is made before it is published.
    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.making.path().join(name)
    }

    /// Moves everything that has been made to its place, over what was there.
    ///
    /// Errors: [`Error::File`] before anything is moved when a folder is in the way.
    pub(crate) fn publish(&self) -> Result<()> {
        let made = std::fs::read_dir(self.making.path())
            .and_then(|made| made.map(|result| Ok(result?.file_name())).collect::<std::io::Result<Vec<_>>>())
            .map_err(failed("read", self.making.path()))?;
        if let Some(place) = made.iter().map(|name| self.path.join(name)).find(|place| place.is_dir()) {
            return Err(failed("replace", &place)(std::io::ErrorKind::IsADirectory.into()));
        }
        for name in made {
            let place = self.path.join(&name);
            std::fs::rename(self.making.path().join(name), &place).map_err(failed("replace", &place))?;
        }
        Ok(())
    }

    /// Writes a picture as EXR, as radiance, and as PNG; gives back the PNG file.
    pub(crate) fn write_picture(&self, name: &str, picture: &Image, exposure: f64) -> Result<Vec<u8>> {
        io::image::write_exr(&self.file(&format!("{name}.exr")), picture)?;
        self.write_png(name, picture, exposure)
    }

    /// Writes a picture as PNG alone; gives back the file.
    pub(crate) fn write_png(&self, name: &str, picture: &Image, exposure: f64) -> Result<Vec<u8>> {
        let png = io::image::png_bytes(picture, exposure)?;
        self.write_bytes(&format!("{name}.png"), &png)?;
        Ok(png)
    }

    pub(crate) fn write_bytes(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.file(name);
        io::write_whole(&path, |file| file.write_all(bytes).map_err(failed("write", &path)))
    }
}

fn failed(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Error {
    let path = path.to_owned();
    move |source| Error::File { action, path, source }
}

/// The pictures of one view.
#[derive(Debug)]
pub(crate) struct ViewImages {
    pub(crate) name: String,
    /// What the strokes ask for: the picture before, its scattered light replaced where it is painted.
    pub(crate) target: Image,
    pub(crate) before: Image,
    pub(crate) after: Image,
    /// How far the scattered light misses what is painted, as radiance times alpha; black where nothing is.
    pub(crate) difference: Image,
}

/// A painted pixel: where it is, and its scattered radiance as it was, as it should be and as it has become.
pub(crate) struct Painted {
    pub(crate) pixel: usize,
    pub(crate) weight: f32,
    pub(crate) before: Rgb,
    pub(crate) wanted: Rgb,
    pub(crate) after: Rgb,
}

impl ViewImages {
    pub(crate) fn new(name: &str, painted: impl Iterator<Item = Painted>, rendering: Rendering) -> Self {
        let Rendering { before, after } = rendering;
        let mut target = before.clone();
        let mut difference = Image::constant(before.size(), [0.0; 3]);
        for Painted { pixel, weight, before, wanted, after } in painted {
            for c in 0..3 {
                let shown = target.pixels[pixel][c];
                target.pixels[pixel][c] = (shown + weight * (wanted[c] - before[c])).max(0.0);
                difference.pixels[pixel][c] = weight * (after[c] - wanted[c]).abs();
            }
        }
        Self { name: name.to_owned(), target, before, after, difference }
    }

    /// Writes the pictures, side by side; gives back their PNG files.
    pub(crate) fn write(&self, folder: &Folder, exposure: f64) -> Result<report::ViewPictures> {
        let write = |(kind, picture): (&str, &Image)| {
            folder.write_picture(&format!("{}_{kind}", self.name), picture, exposure)
        };
        let [target, before, after, difference] = self.each();
        let ((target, before), (after, difference)) = rayon::join(
            || rayon::join(|| write(target), || write(before)),
            || rayon::join(|| write(after), || write(difference)),
        );
        Ok(report::ViewPictures {
            name: self.name.clone(),
            target: target?,
            before: before?,
            after: after?,
            difference: difference?,
        })
    }

    fn each(&self) -> [(&'static str, &Image); 4] {
        [
            ("target", &self.target),
            ("before", &self.before),
            ("after", &self.after),
            ("difference", &self.difference),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn one_run_has_a_folder_and_leaves_nothing_but_results_in_it() {
        let folder = tempfile::tempdir().unwrap();
        // What a run left that was killed.
        std::fs::create_dir(folder.path().join(".unscatter-x1y2")).unwrap();
        std::fs::write(folder.path().join(".unscatter-x1y2/half.exr"), b"half").unwrap();
        let first = Folder::create(folder.path()).unwrap();
        let refused = Folder::create(folder.path()).unwrap_err();
        let told = format!("in use by process {};", std::process::id());
        assert!(matches!(&refused, Error::Machine(text) if text.contains(&told)), "{refused}");
        first.write_bytes("result", b"whole").unwrap();
        first.publish().unwrap();
        drop(first);
        assert_eq!(names(folder.path()), ["result"]);
        drop(Folder::create(folder.path()).unwrap());
        assert_eq!(names(folder.path()), ["result"]);
    }

    #[test]
    fn of_many_at_once_one_wins() {
        let folder = tempfile::tempdir().unwrap();
        let barrier = std::sync::Barrier::new(10);
        let run = || {
            barrier.wait();
            let mine = Folder::create(folder.path());
            // Until all have tried.
            barrier.wait();
            mine.is_ok()
        };
        let won = std::thread::scope(|scope| {
            let runs: Vec<_> = (0..10).map(|_| scope.spawn(run)).collect();
            runs.into_iter().map(|run| run.join().unwrap()).filter(|&won| won).count()
        });
        assert_eq!(won, 1);
        assert!(names(folder.path()).is_empty());
    }
}
