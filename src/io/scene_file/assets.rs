//! The other files that a scene file names. Nothing else here knows how they are read.

use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec3};

use crate::scene::{FovAxis, Mesh, Rgb, RgbaImage};
use crate::{Error, Result};

use super::light::GltfNode;

/// Reads files relative to a scene file.
#[derive(Debug)]
pub(super) struct Assets {
    folder: PathBuf,
}

/// A camera of a glTF file.
#[derive(Debug)]
pub(super) struct AssetCamera {
    pub(super) world_from_camera: DAffine3,
    pub(super) fov: f64,
    pub(super) fov_axis: FovAxis,
}

impl Assets {
    /// Files beside `scene_file`.
    pub(super) fn beside(scene_file: &Path) -> Self {
        Self { folder: scene_file.parent().map(Path::to_owned).unwrap_or_default() }
    }

    /// Direction and colour of a glTF sun.
    pub(super) fn sun(&mut self, gltf: &GltfNode) -> Result<(DVec3, Rgb)> {
        self.unread(&gltf.file)
    }

    /// A glTF camera.
    pub(super) fn camera(&mut self, file: &str, _node: &str) -> Result<AssetCamera> {
        self.unread(file)
    }

    /// Triangles of a glTF node and everything below it.
    pub(super) fn gltf_mesh(&mut self, gltf: &GltfNode) -> Result<Mesh> {
        self.unread(&gltf.file)
    }

    /// Triangles of an OBJ file.
    pub(super) fn obj_mesh(&self, file: &str) -> Result<Mesh> {
        self.unread(file)
    }

    /// A painted layer.
    pub(super) fn layer(&self, file: &str) -> Result<RgbaImage> {
        self.unread(file)
    }

    fn path(&self, file: &str) -> Result<PathBuf> {
        if file.is_empty() {
            return Err(Error::value("", "an empty name", "a file, relative to the scene file"));
        }
        Ok(self.folder.join(file))
    }

    fn unread<T>(&self, file: &str) -> Result<T> {
        let path = self.path(file)?;
        Err(Error::Machine(format!("{} cannot be read by this build", path.display())))
    }
}
