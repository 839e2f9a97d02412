//! Meshes of nodes as triangles in world space.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use glam::{DAffine3, DVec3};
use gltf_json::mesh::{Mesh as JsonMesh, Mode, Primitive, Semantic};
use gltf_json::validation::Checked;

use super::accessor::Elements;
use super::file::GltfFile;
use super::instances::Instances;
use super::material::{self, Surface};
use super::node_tree::NodeTree;
use super::picture::Pictures;
use super::{extensions, listed};
use crate::scene::{Mesh, Object};
use crate::{Error, Result};

/// The triangles of these nodes, each node an object that has the node's name or, where it has none, that of
/// its mesh. Also how many are left out because their material is nowhere.
///
/// Triangles are counted before any is made: a mesh can be instanced by any number of nodes, and a node any
/// number of times.
pub(super) fn collect(
    file: &GltfFile,
    pictures: &Pictures,
    tree: &NodeTree,
    nodes: &[usize],
    most_triangles: usize,
) -> Result<(Mesh, usize)> {
    let mut plan = Plan { file, meshes: HashMap::new(), triangles: 0 };
    let mut objects = Vec::new();
    for &node in nodes {
        if file.root.nodes[node].mesh.is_none() {
            continue;
        }
        if tree.is_visible(node) {
            objects.extend(plan.object(node)?.map(|instances| (node, instances)));
        } else {
            file.warn("nodes that are hidden (KHR_node_visibility) are left out".into());
        }
    }
    // Vertices, of which a triangle has three at most, are counted in 32 bits.
    let most_triangles = most_triangles.min(u32::MAX as usize / 3);
    if plan.triangles > most_triangles {
        return Err(Error::TooLarge {
            what: file.path.display().to_string(),
            needed: format!("{} triangles", plan.triangles),
            limit: most_triangles.to_string(),
            remedy: "choose a single node or simplify the scene",
        });
    }
    let mut collector = Collector {
        file,
        pictures,
        mesh: Mesh::default(),
        surfaces: HashMap::new(),
        left_out: 0,
        nowhere: Vec::new(),
    };
    for (node, instances) in objects {
        let Some((mesh, parts)) = file.root.nodes[node].mesh.and_then(|mesh| plan.meshes.get(&mesh.value()))
        else {
            continue;
        };
        let world_from_node = tree.world_from_node(node);
        for part in parts {
            collector.add(part, world_from_node, &instances)?;
        }
        let name = file.root.nodes[node].name.as_ref().or(mesh.name.as_ref());
        collector.close(name.cloned());
    }
    Ok(collector.finish())
}

/// A primitive with triangles, none of which has been made.
struct Part<'a> {
    primitive: &'a Primitive,
    mode: Mode,
    positions: Elements<'a, 3>,
    indices: Option<Elements<'a, 1>>,
    triangles: usize,
}

/// What there is to be made.
struct Plan<'a> {
    file: &'a GltfFile,
    /// Each mesh that a node has, with those of its primitives that have triangles.
    meshes: HashMap<usize, (&'a JsonMesh, Vec<Part<'a>>)>,
    triangles: usize,
}

impl<'a> Plan<'a> {
    /// Counts the triangles of a node's mesh; gives where they are, where there are any.
    fn object(&mut self, node: usize) -> Result<Option<Instances<'a>>> {
        let file = self.file;
        let node = &file.root.nodes[node];
        let Some(index) = node.mesh else { return Ok(None) };
        let (_, parts) = match self.meshes.entry(index.value()) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(unknown) => {
                let mesh = file.get(index).ok_or_else(|| file.broken(format!("mesh {index} is missing")))?;
                let parts = mesh.primitives.iter().filter_map(|primitive| part(file, primitive).transpose());
                unknown.insert((mesh, parts.collect::<Result<_>>()?))
            }
        };
        if parts.is_empty() {
            return Ok(None);
        }
        if node.skin.is_some() {
            file.warn("skins are not applied: their meshes are taken in the pose of rest".into());
        }
        let triangles = parts.iter().fold(0, |sum: usize, part| sum.saturating_add(part.triangles));
        let instances = Instances::of(file, node)?;
        self.triangles = self.triangles.saturating_add(triangles.saturating_mul(instances.len()));
        Ok(Some(instances))
    }
}

/// None for what has no surface: points, lines, and vertices that are all zero.
fn part<'a>(file: &'a GltfFile, primitive: &'a Primitive) -> Result<Option<Part<'a>>> {
    let mode = match primitive.mode {
        Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
        Checked::Valid(_) => return Ok(None),
        Checked::Invalid => return Err(file.broken("a mesh has an unknown mode".into())),
    };
    let Some(&positions) = primitive.attributes.get(&Checked::Valid(Semantic::Positions)) else {
        return Ok(None);
    };
    let positions = Elements::new(file, positions)?;
    let indices = primitive.indices.map(|indices| Elements::new(file, indices)).transpose()?;
    let drawn = indices.as_ref().map_or(positions.len(), Elements::len);
    let triangles = match mode {
        Mode::Triangles => drawn / 3,
        _ => drawn.saturating_sub(2),
    };
    if triangles == 0 {
        return Ok(None);
    }
    if positions.is_empty_of_data() || indices.as_ref().is_some_and(Elements::is_empty_of_data) {
        let extensions = primitive.extensions.as_ref();
        if extensions.is_some_and(|all| all.others.contains_key("KHR_draco_mesh_compression")) {
            let remedy = extensions::remedy_for_packed();
            return Err(
                file.broken(format!("a mesh is only there in compressed form, which is not read; {remedy}"))
            );
        }
        file.warn("meshes whose vertices are all zero are left out".into());
        return Ok(None);
    }
    if primitive.targets.as_ref().is_some_and(|targets| !targets.is_empty()) {
        file.warn("morph targets are not applied: their meshes are taken in the pose of rest".into());
    }
    Ok(Some(Part { primitive, mode, positions, indices, triangles }))
}

/// Which material, and which sets of texture coordinates there are for it.
type SurfaceKey = (Option<usize>, Vec<u32>);

struct Collector<'a> {
    file: &'a GltfFile,
    pictures: &'a Pictures,
    mesh: Mesh,
    /// With the index of their material in the mesh.
    surfaces: HashMap<SurfaceKey, (Surface, u32)>,
    /// Triangles of materials whose alpha is below their cut-off everywhere.
    left_out: usize,
    /// The names of these materials.
    nowhere: Vec<String>,
}

impl Collector<'_> {
    /// Makes an object of the triangles that are of none yet, if there are any.
    fn close(&mut self, name: Option<String>) {
        let Mesh { triangles, object_of, objects, .. } = &mut self.mesh;
        if object_of.len() < triangles.len() {
            object_of.resize(triangles.len(), objects.len() as u32);
            objects.push(Object { name, occluder: 0 });
        }
    }

    fn add(&mut self, part: &Part, world_from_node: DAffine3, instances: &Instances) -> Result<()> {
        if instances.len() == 0 {
            return Ok(());
        }
        let (surface, material) = self.surface(part.primitive)?;
        if surface.is_invisible {
            self.left_out += part.triangles * instances.len();
            return Ok(());
        }
        let (vertices, order) = self.drawn(part)?;
        let positions: Vec<DVec3> =
            vertices.iter().map(|&vertex| DVec3::from_array(part.positions.at(vertex as usize))).collect();
        let coordinates = self.coordinates(part, &surface, &vertices)?;
        let triangles = triangulate(part.mode, &order);
        for instance in 0..instances.len() {
            let world_from_instance = world_from_node * instances.node_from_instance(instance);
            let first = self.mesh.positions.len() as u32;
            for &position in &positions {
                let position = world_from_instance.transform_point3(position);
                if !position.is_finite() {
                    return Err(self.file.broken("a vertex is not finite".into()));
                }
                self.mesh.positions.push(position);
            }
            self.mesh.coordinates.extend(&coordinates);
            // A mirrored mesh would be inside out.
            let mirrored = world_from_instance.matrix3.determinant() < 0.0;
            let outward = |[a, b, c]: [u32; 3]| if mirrored { [a, c, b] } else { [a, b, c] };
            self.mesh.material_of.extend(std::iter::repeat_n(material, triangles.len()));
            let placed = triangles.iter().map(|&triangle| outward(triangle).map(|vertex| vertex + first));
            self.mesh.triangles.extend(placed);
        }
        Ok(())
    }

    fn surface(&mut self, primitive: &Primitive) -> Result<(Surface, u32)> {
        let set = |key: &Checked<Semantic>| match key {
            Checked::Valid(Semantic::TexCoords(set)) => Some(*set),
            _ => None,
        };
        let sets: Vec<u32> = primitive.attributes.keys().filter_map(set).collect();
        let key = (primitive.material.map(|material| material.value()), sets);
        if let Some(known) = self.surfaces.get(&key) {
            return Ok(known.clone());
        }
        let surface = material::read(self.file, self.pictures, primitive.material, &key.1)?;
        let name = || surface.material.name.clone().unwrap_or("(without a name)".into());
        if surface.is_invisible {
            self.nowhere.push(name());
        }
        let material = self.mesh.materials.len() as u32;
        self.mesh.materials.push(surface.material.clone());
        self.surfaces.insert(key, (surface.clone(), material));
        Ok((surface, material))
    }

    /// Which vertices are taken, and in which order these are drawn.
    fn drawn(&self, part: &Part) -> Result<(Vec<u32>, Vec<u32>)> {
        let known = part.positions.len();
        let Some(indices) = &part.indices else {
            let all: Vec<u32> = (0..known as u32).collect();
            return Ok((all.clone(), all));
        };
        let index = |at: usize| {
            let [index] = indices.at(at);
            // A number that is not one is not below any other.
            let is_known = index >= 0.0 && index < known as f64;
            let broken = || self.file.broken(format!("a triangle has vertex {index} of {known}"));
            is_known.then_some(index as u32).ok_or_else(broken)
        };
        let order = (0..indices.len()).map(index).collect::<Result<Vec<u32>>>()?;
        if known <= order.len() {
            return Ok(((0..known as u32).collect(), order));
        }
        // Of many vertices that primitives share, or that nobody uses, only the drawn ones are taken.
        let in_order = (0..order.len() as u32).collect();
        Ok((order, in_order))
    }

    /// Of these vertices.
    fn coordinates(&self, part: &Part, surface: &Surface, vertices: &[u32]) -> Result<Vec<[f32; 2]>> {
        let semantic = Semantic::TexCoords(surface.coordinates.set);
        let Some(&index) = part.primitive.attributes.get(&Checked::Valid(semantic)) else {
            return Ok(vec![[0.0; 2]; vertices.len()]);
        };
        let coordinates = Elements::<2>::new(self.file, index)?;
        let (got, expected) = (coordinates.len(), part.positions.len());
        if got != expected {
            return Err(self.file.broken(format!("{got} texture coordinates belong to {expected} vertices")));
        }
        Ok(vertices
            .iter()
            .map(|&vertex| surface.coordinates.apply(coordinates.at(vertex as usize)))
            .collect())
    }

    fn finish(self) -> (Mesh, usize) {
        if self.left_out > 0 {
            self.file.warn(format!(
                "{} of its triangles left out, because the alpha of their material is below its cut-off: {}",
                self.left_out,
                listed(&self.nowhere)
            ));
        }
        (self.mesh, self.left_out)
    }
}

/// glTF 2.0, sec. 3.7.2.1. Vertices that do not fill a triangle are left over.
fn triangulate(mode: Mode, order: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => {
            // Every other triangle is turned round, so that all face the same side.
            let turned =
                |(i, t): (usize, &[u32])| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[0], t[2], t[1]] };
            order.windows(3).enumerate().map(turned).collect()
        }
        Mode::TriangleFan => match order.split_first() {
            Some((&middle, rim)) => rim.windows(2).map(|edge| [middle, edge[0], edge[1]]).collect(),
            None => Vec::new(),
        },
        _ => order.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    }
}
