//! The folder of results, and the pictures of a view in it.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use tempfile::TempDir;

use super::held::{HELD, Held, Owner};
use super::lock::{LOCK, Lock};
use crate::io::image::ExrCompression;
use crate::problem::Rendering;
use crate::scene::{Image, Rgb};
use crate::{Error, Result};
use crate::{io, report};

/// The folder that a command writes its results to.
///
/// They are made in a folder inside it and moved out of that together, so that a disk that fills up half-way leaves
/// the results that were there as they were. A run that is killed while it moves them leaves a mark, and the next run moves the rest.
#[derive(Debug)]
pub(crate) struct Folder {
    path: PathBuf,
    making: TempDir,
    /// Whose results are written, where that is known.
    owner: Option<Owner>,
    written: Mutex<BTreeSet<String>>,
    /// How EXR files are packed.
    exr: ExrCompression,
    /// Until the run is over.
    _lock: Lock,
}

/// How the names of the folders begin in which results are made.
const MAKING: &str = ".unscatter-";
/// The folder of pictures of a solve that goes on, in that of its results.
const PREVIEW: &str = "preview";

/// Removes what is being made in a folder, and with it what a killed run left, once results that are whole have been moved out of it; for the
/// run that has the folder. What cannot be removed stays.
fn sweep(folder: &Path) {
    for name in names(folder).unwrap_or_default() {
        if name.starts_with(MAKING) && name != LOCK && name != HELD {
            let making = folder.join(name);
            if settle(folder, &making).is_ok() {
                // A file is a half of one, such as of a checkpoint.
                _ = fs::remove_dir_all(&making).or_else(|_| fs::remove_file(making));
            }
        }
    }
}

/// Removes the previews in a folder, and nothing that somebody else has put beside them.
fn remove_previews(folder: &Path) {
    let previews = folder.join(PREVIEW);
    let held = Held::of(&previews).unwrap_or_default();
    let is_ours = |name: &String| name.starts_with(MAKING) || held.names().any(|held| held == name);
    let ours: Vec<String> = names(&previews).unwrap_or_default().into_iter().filter(is_ours).collect();
    for name in &ours {
        _ = fs::remove_file(previews.join(name));
    }
    if !ours.is_empty() {
        _ = fs::remove_dir(previews);
    }
}

/// Whether it leads out of no folder.
fn is_name(name: &str) -> bool {
    Path::new(name).file_name().is_some_and(|file| file == name)
}

/// Moves results that are whole out of the folder that they were made in, removes those that they replace, and says what there is now. Does
/// nothing where they are not whole.
fn settle(folder: &Path, making: &Path) -> Result<()> {
    let Some(held) = Held::of(making) else { return Ok(()) };
    for name in names(making)?.into_iter().filter(|name| name != HELD) {
        rename(&making.join(&name), &folder.join(name))?;
    }
    for name in held.obsolete.iter().filter(|name| is_name(name)) {
        _ = fs::remove_file(folder.join(name));
    }
    rename(&making.join(HELD), &folder.join(HELD))?;
    sync(folder)
}

/// The names in a folder; all that are made here are UTF-8.
fn names(folder: &Path) -> Result<BTreeSet<String>> {
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
    let entries = entries.map_err(failed("read", folder))?;
    Ok(entries.into_iter().filter_map(|entry| entry.file_name().into_string().ok()).collect())
}

fn rename(from: &Path, to: &Path) -> Result<()> {
    fs::rename(from, to).map_err(failed("replace", to))
}

/// Makes sure that the names in a folder survive a power cut.
fn sync(folder: &Path) -> Result<()> {
    #[cfg(unix)]
    fs::File::open(folder).and_then(|folder| folder.sync_all()).map_err(failed("write into", folder))?;
    Ok(())
}

/// Removes what is being made in a folder and gives the folder up; for a run that ends at once.
#[cfg(feature = "cli")]
pub(crate) fn abandon(folder: &Path) {
    sweep(folder);
    _ = fs::remove_file(folder.join(LOCK));
}

impl Folder {
    /// Creates the folder, takes it for this run, and makes sure before any work is done that it can be written.
    ///
    /// Errors: [`Error::File`] where that fails; [`Error::Machine`] where another run has it.
    pub(crate) fn create(path: impl Into<PathBuf>) -> Result<Self> {
        let path = path.into();
        fs::create_dir_all(&path).map_err(failed("create the folder", &path))?;
        let lock = Lock::of(&path)?;
        sweep(&path);
        remove_previews(&path);
        let making = tempfile::Builder::new().prefix(MAKING).tempdir_in(&path);
        let making = making.map_err(failed("write into", &path))?;
        Ok(Self {
            path,
            making,
            owner: None,
            written: Mutex::default(),
            exr: ExrCompression::default(),
            _lock: lock,
        })
    }

    /// The same for the results that a command has of a scene. When the last have come, what it wrote there before and has not written
    /// again goes, and so do the results of other scenes.
    pub(crate) fn of(mut self, command: &'static str, scene: &str) -> Self {
        self.owner = Some(Owner { command, scene: scene.to_owned() });
        self
    }

    /// The same with EXR files that are packed in another way.
    pub(crate) fn with_exr(mut self, exr: ExrCompression) -> Self {
        self.exr = exr;
        self
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Where a result is made before it is published.
    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.making.path().join(name)
    }

    /// Moves everything that has been made to its place, over what was there. More will come.
    ///
    /// Errors: [`Error::File`] before anything is moved when a folder is in the way.
    pub(crate) fn publish(&self) -> Result<()> {
        self.move_out(false)
    }

    /// As [`Folder::finish`], of results that are some of many, such as frames: those of the same scene that are there stay.
    pub(crate) fn finish_some(&self) -> Result<()> {
        if let (Some(owner), Some(held)) = (&self.owner, Held::of(&self.path)) {
            self.written.lock().unwrap_or_else(PoisonError::into_inner).extend(held.of_owner(owner));
        }
        self.finish()
    }

    /// The same as [`Folder::publish`], after which nothing more comes: see [`Folder::of`]. Previews go.
    pub(crate) fn finish(&self) -> Result<()> {
        self.move_out(true)?;
        remove_previews(&self.path);
        Ok(())
    }

    fn move_out(&self, is_last: bool) -> Result<()> {
        let made = names(self.making.path())?;
        if let Some(place) = made.iter().map(|name| self.path.join(name)).find(|place| place.is_dir()) {
            return Err(failed("replace", &place)(std::io::ErrorKind::IsADirectory.into()));
        }
        let mut held = Held::of(&self.path).unwrap_or_default();
        if let Some(owner) = &self.owner {
            let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
            written.extend(made.iter().cloned());
            held = if is_last { held.only(owner, &written) } else { held.with(owner, &made) };
        }
        held.write(self.making.path())?;
        sync(self.making.path())?;
        settle(&self.path, self.making.path())
    }

    /// Moves everything that has been made to a folder of previews, so that results that are whole stay whole.
    ///
    /// Errors: [`Error::File`].
    pub(crate) fn publish_preview(&self) -> Result<()> {
        let folder = self.path.join(PREVIEW);
        fs::create_dir_all(&folder).map_err(failed("create the folder", &folder))?;
        let made = names(self.making.path())?;
        let owner = Owner { command: PREVIEW, scene: String::new() };
        Held::of(&folder).unwrap_or_default().with(&owner, &made).write(&folder)?;
        made.iter().try_for_each(|name| rename(&self.file(name), &folder.join(name)))
    }

    /// Writes a picture as EXR, as radiance, and as PNG; gives back the PNG file.
    pub(crate) fn write_picture(&self, name: &str, picture: &Image, exposure: f64) -> Result<Vec<u8>> {
        self.write_exr(name, picture)?;
        self.write_png(name, picture, exposure)
    }

    /// Writes a picture as EXR alone.
    pub(crate) fn write_exr(&self, name: &str, picture: &Image) -> Result<()> {
        io::image::write_exr_as(&self.file(&format!("{name}.exr")), picture, self.exr)
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

impl Drop for Folder {
    fn drop(&mut self) {
        // Moving them has failed half-way: what is not moved now is left for the next run.
        let is_settled = settle(&self.path, self.making.path()).is_ok();
        self.making.disable_cleanup(!is_settled);
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

    /// The results, and what else lies there.
    fn seen(folder: &Path) -> Vec<String> {
        names(folder).unwrap().into_iter().filter(|name| name != HELD).collect()
    }

    /// A run of a command that writes these results at once.
    fn run(folder: &Path, command: &'static str, scene: &str, results: &[&str]) {
        let folder = Folder::create(folder).unwrap().of(command, scene);
        results.iter().for_each(|name| folder.write_bytes(name, scene.as_bytes()).unwrap());
        folder.finish().unwrap();
    }

    #[test]
    fn results_of_two_scenes_are_not_mixed_and_other_files_stay() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        fs::write(path.join("mine.txt"), b"x").unwrap();
        run(path, "light-map", "hall", &["light_map", "left_after", "right_after"]);
        run(path, "render", "hall", &["left"]);
        assert_eq!(seen(path), ["left", "left_after", "light_map", "mine.txt", "right_after"]);
        // A view less: what was of it goes. What another command wrote of the scene stays.
        run(path, "light-map", "hall", &["light_map", "left_after"]);
        assert_eq!(seen(path), ["left", "left_after", "light_map", "mine.txt"]);
        run(path, "render", "nave", &["left", "apse"]);
        assert_eq!(seen(path), ["apse", "left", "mine.txt"]);
        // Results that come one after the other belong together.
        let animated = Folder::create(path).unwrap().of("render", "nave");
        for name in ["frame_0", "frame_1"] {
            animated.write_bytes(name, b"x").unwrap();
            animated.publish().unwrap();
            assert!(seen(path).contains(&"apse".to_owned()));
        }
        animated.finish().unwrap();
        drop(animated);
        assert_eq!(seen(path), ["frame_0", "frame_1", "mine.txt"]);
        // Frames may be drawn some at a time.
        let further = Folder::create(path).unwrap().of("render", "nave");
        further.write_bytes("frame_2", b"x").unwrap();
        further.finish_some().unwrap();
        drop(further);
        assert_eq!(seen(path), ["frame_0", "frame_1", "frame_2", "mine.txt"]);
    }

    #[test]
    fn previews_leave_results_alone_and_go_with_the_next() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        run(path, "light-map", "old", &["light_map"]);
        let again = Folder::create(path).unwrap().of("light-map", "new");
        for preview in [b"one", b"two"] {
            again.write_bytes("light_map", preview).unwrap();
            again.publish_preview().unwrap();
            assert_eq!(fs::read(path.join("preview/light_map")).unwrap(), preview);
            assert_eq!(fs::read(path.join("light_map")).unwrap(), b"old");
        }
        again.write_bytes("light_map", b"new").unwrap();
        again.finish().unwrap();
        drop(again);
        assert_eq!(fs::read(path.join("light_map")).unwrap(), b"new");
        assert_eq!(seen(path), ["light_map"]);
        // Those of a run that was killed go, too; what is another's stays.
        let killed = Folder::create(path).unwrap();
        killed.write_bytes("light_map", b"half").unwrap();
        killed.publish_preview().unwrap();
        fs::write(path.join("preview/mine.txt"), b"x").unwrap();
        fs::write(path.join("preview/.unscatter-z3.part"), b"half").unwrap();
        drop(killed);
        drop(Folder::create(path).unwrap());
        assert_eq!(seen(&path.join("preview")), ["mine.txt"]);
    }

    /// A run is killed after any step of moving its results out: the next one finds all of them, or none.
    #[test]
    fn a_kill_between_two_moves_leaves_all_or_nothing() {
        let new = ["a", "b", "c"];
        for (steps, is_marked) in [(0, false), (0, true), (1, true), (2, true), (3, true)] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path();
            run(path, "light-map", "hall", &["a", "b", "old"]);
            let making = path.join(".unscatter-killed");
            fs::create_dir(&making).unwrap();
            new.iter().for_each(|name| fs::write(making.join(name), b"new").unwrap());
            if is_marked {
                let owner = Owner { command: "light-map", scene: "hall".to_owned() };
                let written = new.iter().map(|name| (*name).to_owned()).collect();
                Held::of(path).unwrap().only(&owner, &written).write(&making).unwrap();
            }
            for name in &new[..steps] {
                fs::rename(making.join(name), path.join(name)).unwrap();
            }
            drop(Folder::create(path).unwrap());
            let expected: &[&str] = if is_marked { &["a", "b", "c"] } else { &["a", "b", "old"] };
            assert_eq!(seen(path), expected, "{steps}");
            let content: &[u8] = if is_marked { b"new" } else { b"hall" };
            assert!(expected.iter().all(|name| fs::read(path.join(name)).unwrap() == content), "{steps}");
        }
    }

    #[test]
    fn one_run_has_a_folder_and_leaves_nothing_but_results_in_it() {
        let folder = tempfile::tempdir().unwrap();
        // What a run left that was killed.
        fs::create_dir(folder.path().join(".unscatter-x1y2")).unwrap();
        fs::write(folder.path().join(".unscatter-x1y2/half.exr"), b"half").unwrap();
        fs::write(folder.path().join(".unscatter-z3.part"), b"half").unwrap();
        let first = Folder::create(folder.path()).unwrap();
        let refused = Folder::create(folder.path()).unwrap_err();
        let told = format!("in use by process {};", std::process::id());
        assert!(matches!(&refused, Error::Machine(text) if text.contains(&told)), "{refused}");
        first.write_bytes("result", b"whole").unwrap();
        first.publish().unwrap();
        drop(first);
        assert_eq!(seen(folder.path()), ["result"]);
        drop(Folder::create(folder.path()).unwrap());
        assert_eq!(seen(folder.path()), ["result"]);
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
        assert!(seen(folder.path()).is_empty());
    }
}
