//! The node hierarchy and where its nodes are in the world.

use glam::{DAffine3, DMat4, DQuat, DVec3};
use gltf_json::scene::Node;

use super::file::GltfFile;
use crate::Result;

/// World transforms of all nodes, and a check that the hierarchy is one: no cycles, one parent a node.
#[derive(Debug)]
pub(super) struct NodeTree {
    children: Vec<Vec<usize>>,
    world_from_node: Vec<DAffine3>,
}

impl NodeTree {
    pub(super) fn new(file: &GltfFile) -> Result<Self> {
        let nodes = &file.root.nodes;
        let mut children = Vec::with_capacity(nodes.len());
        let mut is_child = vec![false; nodes.len()];
        for (index, node) in nodes.iter().enumerate() {
            let below: Vec<usize> = node.children.iter().flatten().map(|child| child.value()).collect();
            for &child in &below {
                match is_child.get_mut(child) {
                    Some(taken) if !*taken => *taken = true,
                    Some(_) => {
                        return Err(file.broken(format!("node {child} has two parents or repeats")));
                    }
                    None => {
                        return Err(file.broken(format!("node {index} has the unknown child {child}")));
                    }
                }
            }
            children.push(below);
        }
        let mut tree = Self { children, world_from_node: vec![DAffine3::NAN; nodes.len()] };
        let roots: Vec<usize> = (0..nodes.len()).filter(|&index| !is_child[index]).collect();
        let placed = tree.place(file, roots)?;
        // With one parent a node at most, what no root reaches hangs on itself.
        if placed < nodes.len() {
            return Err(file.broken("its nodes form a cycle".into()));
        }
        Ok(tree)
    }

    /// Computes the transforms of these nodes and all below, and tells how many there are.
    fn place(&mut self, file: &GltfFile, roots: Vec<usize>) -> Result<usize> {
        let mut open: Vec<(usize, DAffine3)> =
            roots.into_iter().map(|index| (index, DAffine3::IDENTITY)).collect();
        let mut placed = 0;
        while let Some((index, world_from_parent)) = open.pop() {
            let world_from_node = world_from_parent * parent_from_node(&file.root.nodes[index]);
            if !world_from_node.is_finite() {
                return Err(file.broken(format!("the transform of node {index} is not finite")));
            }
            self.world_from_node[index] = world_from_node;
            open.extend(self.children[index].iter().map(|&child| (child, world_from_node)));
            placed += 1;
        }
        Ok(placed)
    }

    pub(super) fn world_from_node(&self, node: usize) -> DAffine3 {
        self.world_from_node[node]
    }

    /// This node and all below it.
    pub(super) fn below(&self, node: usize) -> Vec<usize> {
        let mut found = vec![node];
        let mut next = 0;
        while let Some(&index) = found.get(next) {
            found.extend(&self.children[index]);
            next += 1;
        }
        found
    }

    /// The nodes of the default scene; of the first one, or all nodes, where the file does not say.
    pub(super) fn scene(&self, file: &GltfFile) -> Result<Vec<usize>> {
        let scene = match file.root.scene {
            Some(index) => {
                Some(file.get(index).ok_or_else(|| file.broken("its default scene is missing".into()))?)
            }
            None => file.root.scenes.first(),
        };
        let Some(scene) = scene else { return Ok((0..self.children.len()).collect()) };
        let mut nodes = Vec::new();
        for root in &scene.nodes {
            if root.value() >= self.children.len() {
                return Err(file.broken(format!("its scene has the unknown node {root}")));
            }
            nodes.extend(self.below(root.value()));
        }
        // A node that is listed beside its own ancestor is still one node.
        nodes.sort_unstable();
        nodes.dedup();
        Ok(nodes)
    }
}

fn parent_from_node(node: &Node) -> DAffine3 {
    if let Some(matrix) = node.matrix {
        return DAffine3::from_mat4(DMat4::from_cols_array(&matrix.map(f64::from)));
    }
    let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let rotation = DQuat::from_array(node.rotation.unwrap_or_default().0.map(f64::from));
    // A rotation of length zero is none.
    let rotation = if rotation.length() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    DAffine3::from_scale_rotation_translation(
        node.scale.map_or(DVec3::ONE, vector),
        rotation,
        node.translation.map_or(DVec3::ZERO, vector),
    )
}
