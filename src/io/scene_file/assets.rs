//! The other files that a scene file names. Nothing else here knows how they are read.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::io::gltf::{GltfCamera, GltfScene};
use crate::io::image::Association;
use crate::io::transforms::Shot;
use crate::io::volume::Stored;
use crate::io::{image, input, machine, obj, transforms, volume};
use crate::scene::{Image, Mesh, Rgb, RgbaImage, VoxelGrid};
use crate::{Error, Result};

use super::file_name::{FileName, folder_of};
use super::flaw::{Built, Flaw};
use super::gltf_node::GltfNode;
use super::size::MemorySize;
use super::stroke::{Group, check_groups};

/// Bytes of a triangle: its corners, what it is of, and its place in the hierarchy.
const TRIANGLE: u64 = 256;

/// Reads files relative to a scene file.
#[derive(Debug)]
pub(super) struct Assets {
    folder: PathBuf,
    /// Bytes that what is read may take, each thing by itself.
    pub(super) budget: u64,
    /// Each glTF file is read once: light, cameras and occluders often share one.
    scenes: HashMap<PathBuf, GltfScene>,
    /// What strokes name.
    pub(super) groups: Vec<Group>,
}

impl Assets {
    /// Files beside `scene_file`, within the memory that a solve may take when nothing is said about it.
    pub(super) fn beside(scene_file: &Path) -> Self {
        Self {
            folder: folder_of(scene_file),
            budget: machine::default_budget(),
            scenes: HashMap::new(),
            groups: Vec::new(),
        }
    }

    /// The same within the memory that a document allows, if it says so.
    pub(super) fn within(self, memory: Option<MemorySize>) -> Self {
        Self { budget: memory.map_or(self.budget, |memory| memory.0), ..self }
    }

    /// The same with groups that strokes may be in.
    pub(super) fn grouped(self, groups: &[Group]) -> Built<Self> {
        check_groups(groups)?;
        Ok(Self { groups: groups.to_vec(), ..self })
    }

    /// Errors: [`Error::TooLarge`] when `bytes`, which `what` is about to take, exceed the budget.
    pub(super) fn allow(&self, what: &str, bytes: u64) -> Result<()> {
        if bytes <= self.budget {
            return Ok(());
        }
        // Above and below, so that the two numbers never look the same.
        let mebibytes = |bytes: f64| format!("{bytes:.0} MiB");
        let of = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        Err(Error::TooLarge {
            what: what.to_owned(),
            needed: mebibytes(of(bytes).ceil()),
            limit: mebibytes(of(self.budget).floor()),
            remedy: "raise solve.memory, or lower its size",
        })
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
        let most = self.most_triangles();
        self.scene(&gltf.file)?.mesh(gltf.node.as_deref(), most)
    }

    /// Triangles of an OBJ file.
    pub(super) fn obj_mesh(&self, file: &FileName) -> Result<Mesh> {
        obj::load(&self.path(file)?, self.most_triangles())
    }

    fn most_triangles(&self) -> usize {
        (self.budget / TRIANGLE) as usize
    }

    /// A painted layer of a view of that size.
    pub(super) fn layer(
        &self,
        file: &FileName,
        size: [usize; 2],
        association: Option<Association>,
    ) -> Built<RgbaImage> {
        self.of_size("layer", file, size, |path| image::read_layer(path, association))
    }

    /// A picture that a view of that size should show, with the weights of its pixels: its alpha, or 1.
    pub(super) fn target(
        &self,
        file: &FileName,
        size: [usize; 2],
        association: Option<Association>,
    ) -> Built<RgbaImage> {
        self.of_size("picture", file, size, |path| image::read_target(path, association))
    }

    /// A picture without weights, for a view of that size.
    pub(super) fn image(&self, file: &FileName, size: [usize; 2]) -> Built<Image> {
        self.of_size("picture", file, size, image::read_image)
    }

    /// The bytes of a file of looks, and where it lies.
    pub(super) fn text(&self, file: &FileName) -> Result<(PathBuf, Vec<u8>)> {
        const MOST: u64 = 16 << 20;
        let path = self.path(file)?;
        let bytes = input::bytes(&path, MOST, "keep pictures in files of their own")?;
        Ok((path, bytes))
    }

    /// The same for names in another file.
    pub(super) fn beside_file(&self, file: &Path) -> Self {
        Self { budget: self.budget, ..Self::beside(file) }
    }

    /// Width and height of a picture.
    pub(super) fn size_of(&self, file: &FileName) -> Result<[usize; 2]> {
        image::size_of(&self.path(file)?)
    }

    /// A picture of a transfer function.
    pub(super) fn transfer(&self, file: &FileName) -> Result<RgbaImage> {
        let path = self.path(file)?;
        let [width, height] = image::size_of(&path)?;
        let what = format!("{} of {width} × {height} pixels", path.display());
        self.allow(&what, (width * height * size_of::<[f32; 4]>()) as u64)?;
        image::read_target(&path, None)
    }

    /// A picture of all directions.
    pub(super) fn directions(&self, file: &FileName) -> Result<Image> {
        let path = self.path(file)?;
        let [width, height] = image::size_of(&path)?;
        let what = format!("{} of {width} × {height} pixels", path.display());
        self.allow(&what, (width * height * size_of::<Rgb>()) as u64)?;
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
        volume::read_within(&self.path(file)?, member, &|bytes| self.allow(&file.to_string(), bytes))
    }

    /// Where a volume lies, if its file says so.
    pub(super) fn volume_place(&self, file: &FileName, member: Option<&str>) -> Result<Option<VoxelGrid>> {
        volume::place(&self.path(file)?, member, &|bytes| self.allow(&file.to_string(), bytes))
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
        image::read_target(&shot.file, None)
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
            assets.layer(&file, [8, 6], None).err(),
            assets.target(&file, [8, 6], None).err(),
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
        assert!(is_too_large(assets(&folder, "-Y 16384 +X 16384").within(Some(MemorySize((3 << 30) - 1)))));
        assert!(!is_too_large(assets(&folder, "-Y 512 +X 1024")));
        assert!(!is_too_large(assets(&folder, "-Y 512 +X 1024").within(Some(MemorySize(6 << 20)))));
        assert!(is_too_large(assets(&folder, "-Y 512 +X 1024").within(Some(MemorySize((6 << 20) - 1)))));
    }
}
