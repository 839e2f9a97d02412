//! The other files that a scene file names. Nothing else here knows how they are read.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::io::gltf::{GltfCamera, GltfScene};
use crate::io::transforms::Shot;
use crate::io::volume::Stored;
use crate::io::{image, machine, obj, transforms, volume};
use crate::scene::{Image, Mesh, Rgb, RgbaImage, VoxelGrid};
use crate::{Error, Result};

use super::file_name::{FileName, folder_of};
use super::gltf_node::GltfNode;
use super::size::MemorySize;

/// Triangles of one occluder: what memory holds beside the rest.
const MOST_TRIANGLES: usize = 100_000_000;

/// Reads files relative to a scene file.
#[derive(Debug)]
pub(super) struct Assets {
    folder: PathBuf,
    /// Bytes that what is read may take, each thing by itself.
    pub(super) budget: u64,
    /// Each glTF file is read once: light, cameras and occluders often share one.
    scenes: HashMap<PathBuf, GltfScene>,
}

impl Assets {
    /// Files beside `scene_file`, within the memory that a solve may take when nothing is said about it.
    pub(super) fn beside(scene_file: &Path) -> Self {
        Self {
            folder: folder_of(scene_file),
            budget: machine::default_budget(),
            scenes: HashMap::new(),
        }
    }

    /// The same within the memory that a document allows, if it says so.
    pub(super) fn within(self, memory: Option<MemorySize>) -> Self {
        Self { budget: memory.map_or(self.budget, |memory| memory.0), ..self }
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
        self.scene(&gltf.file)?.mesh(gltf.node.as_deref(), MOST_TRIANGLES)
    }

    /// Triangles of an OBJ file.
    pub(super) fn obj_mesh(&self, file: &FileName) -> Result<Mesh> {
        obj::load(&self.path(file)?)
    }

    /// A painted layer.
    pub(super) fn layer(&self, file: &FileName) -> Result<RgbaImage> {
        image::read_layer(&self.path(file)?)
    }

    /// A picture that a view should show, with the weights of its pixels: its alpha, or 1.
    pub(super) fn target(&self, file: &FileName) -> Result<RgbaImage> {
        image::read_target(&self.path(file)?)
    }

    /// A picture without weights.
    pub(super) fn image(&self, file: &FileName) -> Result<Image> {
        image::read_image(&self.path(file)?)
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

    /// The picture of a shot.
    pub(super) fn shot_picture(shot: &Shot) -> Result<RgbaImage> {
        image::read_target(&shot.file)
    }

    /// The mask of a shot.
    pub(super) fn shot_mask(shot: &Shot) -> Result<Option<Image>> {
        shot.mask.as_deref().map(image::read_image).transpose()
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
