//! Meshes of nodes as triangles in world space.

use std::collections::HashMap;

use glam::{DAffine3, DVec3};
use gltf_json::mesh::{Mode, Primitive, Semantic};
use gltf_json::validation::Checked;

use super::accessor;
use super::file::GltfFile;
use super::material::{self, Surface};
use super::node_tree::NodeTree;
use crate::scene::{Mesh, Object};
use crate::{Error, Result};

/// A mesh can be instanced by any number of nodes; this bounds what a small file can grow to.
const MAX_TRIANGLES: usize = 50_000_000;
const MAX_VERTICES: usize = 150_000_000;

/// The triangles of these nodes, each node an object that has the node's name or, where it has none, that of its mesh.
pub(super) fn collect(file: &GltfFile, tree: &NodeTree, nodes: &[usize]) -> Result<Mesh> {
    let mut collector = Collector { file, mesh: Mesh::default(), surfaces: HashMap::new() };
    for &node in nodes {
        let Some(index) = file.root.nodes[node].mesh else { continue };
        let mesh = file.get(index).ok_or_else(|| file.broken(format!("mesh {index} is missing")))?;
        for primitive in &mesh.primitives {
            collector.add(primitive, tree.world_from_node(node))?;
        }
        let name = file.root.nodes[node].name.as_ref().or(mesh.name.as_ref());
        collector.close(name.cloned());
    }
    Ok(collector.mesh)
}

/// Which material, and which sets of texture coordinates there are for it.
type SurfaceKey = (Option<usize>, Vec<u32>);

struct Collector<'a> {
    file: &'a GltfFile,
    mesh: Mesh,
    /// With the index of their material in the mesh.
    surfaces: HashMap<SurfaceKey, (Surface, u32)>,
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

    fn add(&mut self, primitive: &Primitive, world_from_node: DAffine3) -> Result<()> {
        let mode = match primitive.mode {
            Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
            Checked::Valid(_) => return Ok(()),
            Checked::Invalid => return Err(self.file.broken("a mesh has an unknown mode".into())),
        };
        let Some(&positions) = primitive.attributes.get(&Checked::Valid(Semantic::Positions)) else {
            return Ok(());
        };
        let (surface, material) = self.surface(primitive)?;
        if surface.is_invisible {
            return Ok(());
        }
        let positions = accessor::read::<3>(self.file, positions)?;
        let order = self.order(primitive, positions.len())?;
        let triangles = triangulate(mode, &order);
        self.check_size(positions.len(), triangles.len())?;
        let coordinates = self.coordinates(primitive, &surface, positions.len())?;

        let first = self.mesh.positions.len() as u32;
        for position in positions {
            let position = world_from_node.transform_point3(DVec3::from_array(position));
            if !position.is_finite() {
                return Err(self.file.broken("a vertex is not finite".into()));
            }
            self.mesh.positions.push(position);
        }
        self.mesh.coordinates.extend(coordinates);
        // A mirrored mesh would be inside out.
        let mirrored = world_from_node.matrix3.determinant() < 0.0;
        let outward = |[a, b, c]: [u32; 3]| if mirrored { [a, c, b] } else { [a, b, c] };
        self.mesh.material_of.extend(std::iter::repeat_n(material, triangles.len()));
        self.mesh.triangles.extend(triangles.into_iter().map(|t| outward(t).map(|vertex| vertex + first)));
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
        let surface = material::read(self.file, primitive.material, &key.1)?;
        let material = self.mesh.materials.len() as u32;
        self.mesh.materials.push(surface.material.clone());
        self.surfaces.insert(key, (surface.clone(), material));
        Ok((surface, material))
    }

    /// The vertices in the order in which they are drawn.
    fn order(&self, primitive: &Primitive, vertices: usize) -> Result<Vec<u32>> {
        if vertices > MAX_VERTICES {
            return Err(too_large(self.file, "vertices", vertices, MAX_VERTICES));
        }
        let Some(indices) = primitive.indices else { return Ok((0..vertices as u32).collect()) };
        let indices = accessor::read::<1>(self.file, indices)?;
        indices
            .into_iter()
            .map(|[index]| {
                let known = index >= 0.0 && index < vertices as f64;
                known
                    .then_some(index as u32)
                    .ok_or_else(|| self.file.broken(format!("a triangle has vertex {index} of {vertices}")))
            })
            .collect()
    }

    fn coordinates(
        &self,
        primitive: &Primitive,
        surface: &Surface,
        vertices: usize,
    ) -> Result<Vec<[f32; 2]>> {
        let semantic = Semantic::TexCoords(surface.coordinates.set);
        let Some(&index) = primitive.attributes.get(&Checked::Valid(semantic)) else {
            return Ok(vec![[0.0; 2]; vertices]);
        };
        let coordinates = accessor::read::<2>(self.file, index)?;
        if coordinates.len() != vertices {
            let (got, expected) = (coordinates.len(), vertices);
            return Err(self.file.broken(format!("{got} texture coordinates belong to {expected} vertices")));
        }
        Ok(coordinates.into_iter().map(|at| surface.coordinates.apply(at)).collect())
    }

    fn check_size(&self, vertices: usize, triangles: usize) -> Result<()> {
        let triangles = self.mesh.triangles.len() + triangles;
        if triangles > MAX_TRIANGLES {
            return Err(too_large(self.file, "triangles", triangles, MAX_TRIANGLES));
        }
        let vertices = self.mesh.positions.len() + vertices;
        if vertices > MAX_VERTICES {
            return Err(too_large(self.file, "vertices", vertices, MAX_VERTICES));
        }
        Ok(())
    }
}

fn too_large(file: &GltfFile, what: &str, needed: usize, limit: usize) -> Error {
    Error::TooLarge {
        what: file.path.display().to_string(),
        needed: format!("{needed} {what} or more"),
        limit: limit.to_string(),
        remedy: "choose a single node or simplify the scene",
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
