//! The node hierarchy and where its nodes are in the world.

use glam::{DAffine3, DMat4, DQuat, DVec3};
use gltf_json::scene::Node;
use serde_json::Value;

use super::file::GltfFile;
use super::instances::unit;
use crate::Result;

/// World transforms of all nodes, and a check that the hierarchy is one: no cycles, one parent a node.
#[derive(Debug)]
pub(super) struct NodeTree {
    children: Vec<Vec<usize>>,
    world_from_node: Vec<DAffine3>,
    is_visible: Vec<bool>,
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
        let mut tree = Self {
            children,
            world_from_node: vec![DAffine3::NAN; nodes.len()],
            is_visible: vec![true; nodes.len()],
        };
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
        let mut open: Vec<(usize, DAffine3, bool)> =
            roots.into_iter().map(|index| (index, DAffine3::IDENTITY, true)).collect();
        let mut placed = 0;
        while let Some((index, world_from_parent, parent_is_visible)) = open.pop() {
            let node = &file.root.nodes[index];
            let world_from_node = world_from_parent * parent_from_node(node);
            if !world_from_node.is_finite() {
                return Err(file.broken(format!("the transform of node {index} is not finite")));
            }
            let is_visible = parent_is_visible && !is_hidden(node);
            self.world_from_node[index] = world_from_node;
            self.is_visible[index] = is_visible;
            open.extend(self.children[index].iter().map(|&child| (child, world_from_node, is_visible)));
            placed += 1;
        }
        Ok(placed)
    }

    pub(super) fn world_from_node(&self, node: usize) -> DAffine3 {
        self.world_from_node[node]
    }

    /// Whether neither the node nor one above it is hidden (KHR_node_visibility).
    pub(super) fn is_visible(&self, node: usize) -> bool {
        self.is_visible[node]
    }

    /// These nodes and all below them, each once, in the order of the file.
    pub(super) fn below(&self, roots: impl IntoIterator<Item = usize>) -> Vec<usize> {
        let mut is_found = vec![false; self.children.len()];
        let mut open: Vec<usize> = roots.into_iter().collect();
        while let Some(index) = open.pop() {
            if !std::mem::replace(&mut is_found[index], true) {
                open.extend(&self.children[index]);
            }
        }
        (0..is_found.len()).filter(|&index| is_found[index]).collect()
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
        let roots: Vec<usize> = scene.nodes.iter().map(|root| root.value()).collect();
        match roots.iter().find(|&&root| root >= self.children.len()) {
            Some(root) => Err(file.broken(format!("its scene has the unknown node {root}"))),
            None => Ok(self.below(roots)),
        }
    }
}

fn is_hidden(node: &Node) -> bool {
    let extension = node.extensions.as_ref().and_then(|all| all.others.get("KHR_node_visibility"));
    extension.and_then(|extension| extension.get("visible")).and_then(Value::as_bool) == Some(false)
}

fn parent_from_node(node: &Node) -> DAffine3 {
    if let Some(matrix) = node.matrix {
        return DAffine3::from_mat4(DMat4::from_cols_array(&matrix.map(f64::from)));
    }
    let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let rotation = unit(DQuat::from_array(node.rotation.unwrap_or_default().0.map(f64::from)));
    DAffine3::from_scale_rotation_translation(
        node.scale.map_or(DVec3::ONE, vector),
        rotation,
        node.translation.map_or(DVec3::ZERO, vector),
    )
}
