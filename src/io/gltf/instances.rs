//! Many copies of a node's mesh: the extension EXT_mesh_gpu_instancing.

use glam::{DAffine3, DQuat, DVec3};
use gltf_json::Index;
use gltf_json::accessor::Accessor;
use gltf_json::scene::Node;
use serde_json::Value;

use super::accessor::Elements;
use super::file::GltfFile;
use crate::Result;

/// Where the copies of a mesh are, relative to its node. Nothing is made before a copy is asked for.
#[derive(Debug)]
pub(super) struct Instances<'a> {
    count: usize,
    translations: Option<Elements<'a, 3>>,
    rotations: Option<Elements<'a, 4>>,
    scales: Option<Elements<'a, 3>>,
}

impl<'a> Instances<'a> {
    /// Errors: [`crate::Error::Format`] for attributes that are broken or of different lengths.
    pub(super) fn of(file: &'a GltfFile, node: &Node) -> Result<Self> {
        let once = Self { count: 1, translations: None, rotations: None, scales: None };
        let extension = node.extensions.as_ref().and_then(|all| all.others.get("EXT_mesh_gpu_instancing"));
        let Some(attributes) = extension.and_then(|extension| extension.get("attributes")) else {
            return Ok(once);
        };
        let accessor = |name: &str| -> Result<Option<Index<Accessor>>> {
            let Some(value) = attributes.get(name) else { return Ok(None) };
            let index = Value::as_u64(value).and_then(|index| u32::try_from(index).ok());
            let broken = || file.broken(format!("the instances of a node have {value} as their {name}"));
            Ok(Some(Index::new(index.ok_or_else(broken)?)))
        };
        let (translations, rotations, scales) =
            (accessor("TRANSLATION")?, accessor("ROTATION")?, accessor("SCALE")?);
        let translations = translations.map(|index| Elements::new(file, index)).transpose()?;
        let rotations = rotations.map(|index| Elements::new(file, index)).transpose()?;
        let scales = scales.map(|index| Elements::new(file, index)).transpose()?;
        let counts = [
            translations.as_ref().map(Elements::len),
            rotations.as_ref().map(Elements::len),
            scales.as_ref().map(Elements::len),
        ];
        let mut counts = counts.into_iter().flatten();
        // Attributes of other names are free, and say nothing about where an instance is.
        let Some(count) = counts.next() else { return Ok(once) };
        if let Some(other) = counts.find(|&other| other != count) {
            return Err(file.broken(format!("a node has instances with {count} and with {other} places")));
        }
        Ok(Self { count, translations, rotations, scales })
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// Expects one of the copies.
    pub(super) fn node_from_instance(&self, index: usize) -> DAffine3 {
        let vector = |all: &Elements<3>| DVec3::from_array(all.at(index));
        let rotation =
            self.rotations.as_ref().map_or(DQuat::IDENTITY, |all| DQuat::from_array(all.at(index)));
        DAffine3::from_scale_rotation_translation(
            self.scales.as_ref().map_or(DVec3::ONE, vector),
            unit(rotation),
            self.translations.as_ref().map_or(DVec3::ZERO, vector),
        )
    }
}

/// A rotation of length zero is none.
pub(super) fn unit(rotation: DQuat) -> DQuat {
    if rotation.length() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY }
}
