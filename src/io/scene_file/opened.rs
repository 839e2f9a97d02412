//! A scene file that was read.

use std::path::{Path, PathBuf};

use super::read;
use super::resolved::Resolved;
use super::{Describes, Subject, scene_of};
use crate::Result;
use crate::io::input;

/// A scene file may have this many bytes.
const MAX_BYTES: u64 = 64 << 20;

/// The bytes of a scene file. They are read once, so that it may come out of a pipe.
#[derive(Debug, Clone)]
pub struct SceneFile {
    path: PathBuf,
    bytes: Vec<u8>,
}

impl SceneFile {
    /// Reads a file or a pipe, such as `/dev/stdin`. The names in it are relative to the folder of the file; of a pipe, to the current
    /// folder.
    ///
    /// Errors: [`crate::Error::File`] when it cannot be read, [`crate::Error::TooLarge`] above 64 MiB.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref().to_owned();
        let bytes = input::bytes_or_pipe(&path, MAX_BYTES, read::REMEDY)?;
        Ok(Self { path, bytes })
    }

    /// A text that stands for the file at `path`, such as one that is edited and not saved yet.
    pub fn of(path: impl Into<PathBuf>, text: impl Into<String>) -> Self {
        Self { path: path.into(), bytes: text.into().into_bytes() }
    }

    /// What it is called.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What is in it.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// What it is about, as far as can be told from its outermost fields; a file that is wrong is left to the reader to complain about.
    pub fn subject(&self) -> Subject {
        let value = input::decoded(&self.bytes).ok().and_then(|text| read::value(text).ok());
        let has = |name: &str| value.as_ref().is_some_and(|value| value.get(name).is_some());
        match (has("volume"), has("animation")) {
            (true, true) => Subject::Animation,
            (true, false) => Subject::Volume,
            (false, true) => Subject::LightAnimation,
            (false, false) => Subject::LightMap,
        }
    }

    /// The scene of a kind, and everything that it names; and the document with every setting.
    ///
    /// Errors: as [`super::load`].
    pub(crate) fn open<D: Describes>(&self, overrides: &[String]) -> Result<(D::Scene, Resolved)> {
        let (scene, mut document) = scene_of::<D>(&self.bytes, &self.path, overrides)?;
        document.settle(&self.path);
        Ok((scene, Resolved::new(&document, D::SUBJECT, &self.path)?))
    }
}
