use std::path::{Path, PathBuf};

use crate::problem::Rendering;
use crate::scene::{Image, Rgb, RgbaImage, Scene};
use crate::{Error, Result};
use crate::{io, report};

/// The folder that a command writes its results to.
#[derive(Debug)]
pub(crate) struct Folder(PathBuf);

impl Folder {
    /// Creates the folder, and makes sure before any work is done that it can be written.
    pub(crate) fn create(asked: Option<PathBuf>, scene: &Path) -> Result<Self> {
        let path = asked.unwrap_or_else(|| Path::new("out").join(scene.file_stem().unwrap_or_default()));
        let failed = |action: &'static str| {
            let path = path.clone();
            move |source| Error::File { action, path, source }
        };
        std::fs::create_dir_all(&path).map_err(failed("create the folder"))?;
        tempfile::NamedTempFile::new_in(&path).map_err(failed("write into"))?;
        Ok(Self(path))
    }

    pub(crate) fn path(&self) -> &Path {
        &self.0
    }

    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Writes a picture as EXR, as radiance, and as PNG.
    pub(crate) fn write_picture(&self, name: &str, picture: &Image, exposure: f64) -> Result<()> {
        io::image::write_exr(&self.file(&format!("{name}.exr")), picture)?;
        io::image::write_png(&self.file(&format!("{name}.png")), picture, exposure)
    }

    pub(crate) fn write_text(&self, name: &str, text: &str) -> Result<()> {
        let path = self.file(name);
        io::write_whole(&path, |file| {
            let failed = |source| Error::File { action: "write", path: path.clone(), source };
            file.write_all(text.as_bytes()).map_err(failed)
        })
    }
}

/// The pictures of one view.
#[derive(Debug)]
pub(crate) struct ViewPictures {
    pub(crate) name: String,
    /// What the strokes ask for: the picture before, its scattered light replaced where it is painted.
    pub(crate) target: Image,
    pub(crate) before: Image,
    pub(crate) after: Image,
    /// |after − target| where it is painted, black elsewhere.
    pub(crate) difference: Image,
}

impl ViewPictures {
    /// `wanted` holds, for each painted pixel of this view, its index, and the change of its scattered light that
    /// the strokes ask for.
    pub(crate) fn new(
        scene: &Scene,
        view: usize,
        painting: &RgbaImage,
        wanted: impl Iterator<Item = (usize, Rgb)>,
        rendering: Rendering,
    ) -> Self {
        let Rendering { before, after } = rendering;
        let mut target = before.clone();
        let mut difference = Image::constant(before.size(), [0.0; 3]);
        for (pixel, change) in wanted {
            let weight = painting.pixels[pixel][3];
            for c in 0..3 {
                let asked = (before.pixels[pixel][c] + change[c]).max(0.0);
                let shown = before.pixels[pixel][c];
                target.pixels[pixel][c] = shown + weight * (asked - shown);
                difference.pixels[pixel][c] = (after.pixels[pixel][c] - asked).abs() * weight;
            }
        }
        Self { name: scene.views[view].name.clone(), target, before, after, difference }
    }

    pub(crate) fn write(&self, folder: &Folder, exposure: f64) -> Result<()> {
        for (kind, picture) in self.each() {
            folder.write_picture(&format!("{}_{kind}", self.name), picture, exposure)?;
        }
        Ok(())
    }

    pub(crate) fn for_report(&self, exposure: f64) -> Result<report::ViewPictures> {
        let png = |picture| io::image::png_bytes(picture, exposure);
        Ok(report::ViewPictures {
            name: self.name.clone(),
            target: png(&self.target)?,
            before: png(&self.before)?,
            after: png(&self.after)?,
            difference: png(&self.difference)?,
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
