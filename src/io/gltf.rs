//! Geometry, cameras and suns from glTF 2.0 files (`.gltf` and `.glb`).
//!
//! What is read: triangles of all kinds with the transforms of their nodes and instances, base colour and
//! alpha of materials and what they let through, perspective cameras, directional lights. Skins, morph targets and animations are not
//! applied.

mod accessor;
mod extensions;
mod file;
mod glass;
mod instances;
mod material;
mod node_tree;
mod picture;
mod texture;
mod triangles;
mod unread;

use std::collections::HashSet;
use std::path::Path;

use glam::{DAffine3, DVec3};
use gltf_json::camera::Type as CameraType;
use gltf_json::extensions::scene::khr_lights_punctual::{Light, Type as LightType};
use gltf_json::scene::Node;
use gltf_json::validation::Checked;

use self::file::GltfFile;
use self::node_tree::NodeTree;
use self::picture::Pictures;
use crate::Result;
use crate::scene::{FovAxis, Mesh, Rgb};

/// A glTF file with its buffers; textures are read when a mesh asks for them.
#[derive(Debug)]
pub struct GltfScene {
    file: GltfFile,
    tree: NodeTree,
    pictures: Pictures,
}

/// A perspective camera of a glTF file.
#[derive(Debug, Clone, PartialEq)]
pub struct GltfCamera {
    /// Where it is; looks along −Z. May have a scale, which means nothing for a camera.
    pub world_from_camera: DAffine3,
    /// Field of view along `fov_axis`, in degrees.
    pub fov: f64,
    /// The height, always, in glTF.
    pub fov_axis: FovAxis,
}

impl GltfScene {
    /// Reads a `.gltf` or `.glb` file and the buffers that it names.
    ///
    /// Errors: [`crate::Error::File`] for a file that cannot be read; [`crate::Error::Format`] for one that is truncated, is
    /// not glTF 2.0, requires an extension that changes shapes and is not read, or has a broken node hierarchy.
    pub fn load(path: &Path) -> Result<Self> {
        let file = GltfFile::load(path)?;
        let tree = NodeTree::new(&file)?;
        Ok(Self { file, tree, pictures: Pictures::default() })
    }

    /// The triangles of the default scene, or of the node with this name and of all below it, in world space.
    ///
    /// Albedo is the base colour factor times the linear mean of its texture. Materials with alpha mode `MASK`
    /// keep their texture's alpha as a mask; `BLEND` is read as a mask with cut-off 0.5. Each node with triangles is an object.
    ///
    /// Triangles are counted before any is made. A warning tells what is left out.
    ///
    /// Errors: [`crate::Error::Format`] for an unknown name (the message lists the nearest ones), data that is
    /// broken or no triangles at all; [`crate::Error::File`] for textures that cannot be read;
    /// [`crate::Error::TooLarge`] for more than `most_triangles`, or too large textures.
    pub fn mesh(&self, node: Option<&str>, most_triangles: usize) -> Result<Mesh> {
        let nodes = match node {
            Some(name) => self.tree.below([self.find(name, "node", |_| true)?]),
            None => self.tree.scene(&self.file)?,
        };
        let (mesh, left_out) =
            triangles::collect(&self.file, &self.pictures, &self.tree, &nodes, most_triangles)?;
        if mesh.triangles.is_empty() {
            let place = node.map_or("the scene".into(), |name| format!("the node `{name}`"));
            let reason = match left_out {
                0 => format!("{place} has no triangles"),
                _ => format!(
                    "{place} has no triangles that are there: the alpha of their material is below its cut-off \
                     ({left_out} left out); raise the material's alpha, or make it opaque"
                ),
            };
            return Err(self.file.broken(reason));
        }
        Ok(mesh)
    }

    /// The camera at the node with this name, or at the only node with a camera below that.
    ///
    /// Errors: [`crate::Error::Format`] for an unknown name or a camera that is not a perspective one.
    pub fn camera(&self, node: &str) -> Result<GltfCamera> {
        let index = self.find(node, "camera", |node| node.camera.is_some())?;
        let camera = self.file.root.nodes[index].camera.and_then(|camera| self.file.get(camera));
        let camera = camera.ok_or_else(|| self.file.broken(format!("`{node}` has an unknown camera")))?;
        let (Checked::Valid(CameraType::Perspective), Some(lens)) = (camera.type_, &camera.perspective)
        else {
            return Err(self.file.broken(format!(
                "the camera `{node}` is orthographic; make it a perspective one in the modelling \
                 program, or write the camera into the scene file"
            )));
        };
        Ok(GltfCamera {
            world_from_camera: self.tree.world_from_node(index),
            fov: f64::from(lens.yfov).to_degrees(),
            fov_axis: FovAxis::Y,
        })
    }

    /// Direction in which the light of a sun goes, of unit length, and its colour times intensity.
    ///
    /// The sun is the directional light at the named node, or at the only node with one below that; without a name
    /// it is the only one in the file.
    ///
    /// Errors: [`crate::Error::Format`] for an unknown name, or for no name where there is not exactly one sun.
    pub fn sun(&self, node: Option<&str>) -> Result<(DVec3, Rgb)> {
        let index = match node {
            Some(name) => self.find(name, "sun", |node| self.sun_of(node).is_some())?,
            None => self.only_sun()?,
        };
        let broken = || self.file.broken(format!("the sun at node {index} has no direction"));
        let light = self.sun_of(&self.file.root.nodes[index]).ok_or_else(broken)?;
        let world_from_node = self.tree.world_from_node(index);
        let direction = world_from_node.transform_vector3(DVec3::NEG_Z).try_normalize().ok_or_else(broken)?;
        Ok((direction, light.color.map(|c| c * light.intensity)))
    }

    /// Names of the nodes that hold cameras.
    pub fn camera_names(&self) -> Vec<String> {
        self.names(|node| node.camera.is_some())
    }

    /// Whether there is exactly one directional light.
    pub fn has_sun(&self) -> bool {
        self.only_sun().is_ok()
    }

    /// Names of the nodes with a directional light, for messages.
    fn sun_names(&self) -> Vec<String> {
        self.names(|node| self.sun_of(node).is_some())
    }

    fn sun_of(&self, node: &Node) -> Option<&Light> {
        let light = node.extensions.as_ref()?.khr_lights_punctual.as_ref()?.light;
        let light = self.file.get(light)?;
        matches!(light.type_, Checked::Valid(LightType::Directional)).then_some(light)
    }

    fn only_sun(&self) -> Result<usize> {
        let nodes = self.file.root.nodes.iter().enumerate();
        let suns: Vec<usize> =
            nodes.filter(|(_, node)| self.sun_of(node).is_some()).map(|(index, _)| index).collect();
        match suns[..] {
            [sun] => Ok(sun),
            [] => Err(self.file.broken("it has no directional light (KHR_lights_punctual)".into())),
            _ => Err(self.file.broken(format!(
                "it has several directional lights; choose one by its node: {}",
                listed(&self.sun_names())
            ))),
        }
    }

    fn names(&self, has: impl Fn(&Node) -> bool) -> Vec<String> {
        self.file.root.nodes.iter().filter(|node| has(node)).filter_map(|node| node.name.clone()).collect()
    }

    /// The node of this name that `has` it, or the only one that does below a node of this name.
    ///
    /// Exporters hang cameras and lights below the node that carries the name, to turn their axes.
    fn find(&self, name: &str, what: &str, has: impl Fn(&Node) -> bool) -> Result<usize> {
        let nodes = &self.file.root.nodes;
        let named: Vec<usize> =
            (0..nodes.len()).filter(|&index| nodes[index].name.as_deref() == Some(name)).collect();
        let mut holders: Vec<usize> = named.iter().copied().filter(|&index| has(&nodes[index])).collect();
        if holders.is_empty() {
            holders = self.tree.below(named);
            holders.retain(|&index| has(&nodes[index]));
        }
        match holders[..] {
            [index] => Ok(index),
            [] => Err(self.file.broken(unknown(name, what, self.names(has)))),
            _ => {
                Err(self.file.broken(format!("{what} `{name}` is ambiguous; give the nodes different names")))
            }
        }
    }
}

/// At most this many names in a message.
const NAMES: usize = 12;

/// Names that are equally near come in the order of the file.
fn unknown(name: &str, what: &str, mut names: Vec<String>) -> String {
    let mut known = HashSet::new();
    names.retain(|name| known.insert(name.clone()));
    if names.is_empty() {
        return format!("it has no {what} `{name}`, and none with a name at all");
    }
    let sought = name.to_lowercase();
    names.sort_by_cached_key(|other| strsim::damerau_levenshtein(&sought, &other.to_lowercase()));
    format!("it has no {what} `{name}`; there are {}", listed(&names))
}

/// The first names, and how many more there are.
fn listed(names: &[String]) -> String {
    let shown = &names[..names.len().min(NAMES)];
    match names.len() - shown.len() {
        0 => quoted(shown),
        more => format!("{} and {more} more", quoted(shown)),
    }
}

fn quoted(names: &[String]) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests;
