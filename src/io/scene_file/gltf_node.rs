use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::file_name::FileName;

/// A node of a glTF file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GltfNode {
    /// The .gltf or .glb file, relative to the scene file.
    pub file: FileName,
    /// Name of the node; when not given, whatever of the wanted kind the file holds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub node: Option<String>,
}
