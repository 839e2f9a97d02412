//! The other files that a scene file names. Nothing else here knows how they are read.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::io::gltf::{GltfCamera, GltfScene};
use crate::io::transforms::Shot;
use crate::io::volume::Stored;
use crate::io::{image, obj, transforms, volume};
use crate::scene::{Camera, Image, Mesh, Rgb, RgbaImage};
use crate::{Error, Result};

use super::file_name::FileName;
use super::flaw::{Built, Flaw};
use super::gltf_node::GltfNode;
use super::size::MemorySize;

/// Reads files relative to a scene file.
#[derive(Debug)]
pub(super) struct Assets {
    folder: PathBuf,
    /// Each glTF file is read once: light, cameras and occluders often share one.
    scenes: HashMap<PathBuf, GltfScene>,
    /// Bytes that a picture may take whose size nothing else says.
    memory: u64,
}

impl Assets {
    /// Bytes of the largest picture of all directions: twice as wide as high.
    const LARGEST: u64 = (Camera::MAX_SIZE * Camera::MAX_SIZE / 2 * size_of::<Rgb>()) as u64;

    /// Files beside `scene_file`.
    pub(super) fn beside(scene_file: &Path) -> Self {
        let folder = scene_file.parent().map(Path::to_owned).unwrap_or_default();
        Self { folder, scenes: HashMap::new(), memory: Self::LARGEST }
    }

    /// The same for a scene that may use so much memory.
    pub(super) fn within(self, memory: Option<MemorySize>) -> Self {
        Self { memory: memory.map_or(self.memory, |memory| memory.0.min(self.memory)), ..self }
    }

    /// Direction and colour of a glTF sun.
    pub(super) fn sun(&mut self, gltf: &GltfNode) -> Result<(DVec3, Rgb)> {
        self.scene(&gltf.file)?.sun(gltf.node.as_deref())
    }

    /// A glTF camera.
    pub(super) fn camera(&mut self, file: &FileName, node: &str) -> Result<GltfCamera> {
        self.scene(file)?.camera(node)
    }

    /// Triangles of a glTF node and everything below it.
    pub(super) fn gltf_mesh(&mut self, gltf: &GltfNode) -> Result<Mesh> {
        self.scene(&gltf.file)?.mesh(gltf.node.as_deref())
    }

    /// Triangles of an OBJ file.
    pub(super) fn obj_mesh(&self, file: &FileName) -> Result<Mesh> {
        obj::load(&self.path(file)?)
    }

    /// A painted layer of a view of that size.
    pub(super) fn layer(&self, file: &FileName, size: [usize; 2]) -> Built<RgbaImage> {
        self.of_size("layer", file, size, image::read_layer)
    }

    /// A picture that a view of that size should show, with the weights of its pixels: its alpha, or 1.
    pub(super) fn target(&self, file: &FileName, size: [usize; 2]) -> Built<RgbaImage> {
        self.of_size("picture", file, size, image::read_target)
    }

    /// A picture without weights, for a view of that size.
    pub(super) fn image(&self, file: &FileName, size: [usize; 2]) -> Built<Image> {
        self.of_size("picture", file, size, image::read_image)
    }

    /// A picture of all directions.
    pub(super) fn directions(&self, file: &FileName) -> Result<Image> {
        let path = self.path(file)?;
        let [width, height] = image::size_of(&path)?;
        let needed = (width * height * size_of::<Rgb>()) as u64;
        if needed > self.memory {
            let mebibytes = |bytes: u64| format!("{} MiB", bytes.div_ceil(1 << 20));
            return Err(Error::TooLarge {
                what: format!("{} of {width} x {height} pixels", path.display()),
                needed: mebibytes(needed),
                limit: mebibytes(self.memory),
                remedy: match self.memory {
                    Self::LARGEST => "scale it down",
                    _ => "scale it down, or raise solve.memory",
                },
            });
        }
        image::read_image(&path)
    }

    fn of_size<T>(
        &self,
        what: &str,
        file: &FileName,
        size: [usize; 2],
        read: impl FnOnce(&Path) -> Result<T>,
    ) -> Built<T> {
        of_size(what, &self.path(file)?, size, read)
    }

    /// A volume.
    pub(super) fn volume(&self, file: &FileName, member: Option<&str>) -> Result<Stored> {
        volume::read(&self.path(file)?, member)
    }

    /// Cameras of a `transforms.json`, each with the picture that it took and, where there is one, its mask. Names in that file are
    /// relative to it.
    pub(super) fn shots(&self, file: &FileName) -> Result<Vec<Shot>> {
        transforms::read(&self.path(file)?)
    }

    /// Width and height of the picture of a shot.
    pub(super) fn shot_size(shot: &Shot) -> Result<[usize; 2]> {
        image::size_of(&shot.file)
    }

    /// The picture of a shot.
    pub(super) fn shot_picture(shot: &Shot) -> Result<RgbaImage> {
        image::read_target(&shot.file)
    }

    /// The mask of a shot, whose picture has that size.
    pub(super) fn shot_mask(shot: &Shot, size: [usize; 2]) -> Built<Option<Image>> {
        let read = |mask: &Path| of_size("mask", mask, size, image::read_image);
        shot.mask.as_deref().map(read).transpose()
    }

    fn scene(&mut self, file: &FileName) -> Result<&GltfScene> {
        use std::collections::hash_map::Entry;
        let path = self.path(file)?;
        match self.scenes.entry(path) {
            Entry::Occupied(read) => Ok(read.into_mut()),
            Entry::Vacant(unread) => {
                let scene = GltfScene::load(unread.key())?;
                Ok(unread.insert(scene))
            }
        }
    }

    fn path(&self, file: &FileName) -> Result<PathBuf> {
        file.in_folder(&self.folder)
    }
}

/// What `read` makes of a picture, once its header says that it has the size of its view.
fn of_size<T>(what: &str, path: &Path, size: [usize; 2], read: impl FnOnce(&Path) -> Result<T>) -> Built<T> {
    let [w, h] = image::size_of(path)?;
    if [w, h] == size {
        return Ok(read(path)?);
    }
    let [width, height] = size;
    let problem =
        format!("the {what} has {w} x {h} pixels and its view {width} x {height}; they must be the same");
    Err(Flaw::new("", problem))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Files beside a scene, of which `sky.hdr` ends soon after its header.
    fn assets(folder: &tempfile::TempDir, size: &str) -> Assets {
        let mut bytes = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\n").into_bytes();
        bytes.resize(1 << 18, 0);
        std::fs::write(folder.path().join("sky.hdr"), bytes).unwrap();
        Assets::beside(&folder.path().join("scene.json"))
    }

    #[test]
    fn a_picture_of_another_size_than_its_view_is_not_decoded() {
        let folder = tempfile::tempdir().unwrap();
        let assets = assets(&folder, "-Y 16000 +X 16384");
        let file = "sky.hdr".into();
        let read = [
            assets.layer(&file, [8, 6]).err(),
            assets.target(&file, [8, 6]).err(),
            assets.image(&file, [8, 6]).err(),
        ];
        for (flaw, what) in read.into_iter().zip(["layer", "picture", "picture"]) {
            let Some(Flaw::Document { problem, .. }) = flaw else { panic!("the scene is at fault") };
            assert!(problem.starts_with(&format!("the {what} has 16384 x 16000 pixels and its view 8 x 6")));
        }
    }

    #[test]
    fn a_picture_of_all_directions_fits_the_memory_of_the_scene() {
        let folder = tempfile::tempdir().unwrap();
        let file = "sky.hdr".into();
        let is_too_large = |assets: Assets| matches!(assets.directions(&file), Err(Error::TooLarge { .. }));
        assert!(is_too_large(assets(&folder, "-Y 16384 +X 16384")));
        assert!(!is_too_large(assets(&folder, "-Y 512 +X 1024")));
        assert!(!is_too_large(assets(&folder, "-Y 512 +X 1024").within(Some(MemorySize(6 << 20)))));
        assert!(is_too_large(assets(&folder, "-Y 512 +X 1024").within(Some(MemorySize((6 << 20) - 1)))));
    }
}
