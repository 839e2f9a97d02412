//! Which extensions of glTF matter here, decided in one place.
//!
//! What touches neither shape nor alpha never stops a file. What does is read, or is refused where the file
//! says that it cannot do without, or is told.

/// What an extension does to a mesh of occluders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Effect {
    /// It is read.
    Read,
    /// It changes neither the shape of a surface nor where a surface is.
    Nothing,
    /// It packs what is also there unpacked, unless the file requires it.
    Packs,
    /// It changes what is there.
    Missed,
}

/// Names, or beginnings of names that end with `_`, each with its effect and with what to do about one that is
/// not read. The first one that fits counts.
const EXTENSIONS: &[(&str, Effect, &str)] = &[
    ("KHR_lights_punctual", Effect::Read, ""),
    ("KHR_mesh_quantization", Effect::Read, ""),
    ("KHR_node_visibility", Effect::Read, ""),
    ("EXT_mesh_gpu_instancing", Effect::Read, ""),
    ("KHR_draco_mesh_compression", Effect::Packs, UNPACKED),
    ("EXT_meshopt_compression", Effect::Packs, UNPACKED),
    ("KHR_meshopt_compression", Effect::Packs, UNPACKED),
    ("CESIUM_RTC", Effect::Missed, "put the offset into the transform of a node"),
    // Materials and textures: what a mask needs is decided where it is made.
    ("KHR_materials_", Effect::Nothing, ""),
    ("EXT_materials_", Effect::Nothing, ""),
    ("MSFT_materials_", Effect::Nothing, ""),
    ("ADOBE_materials_", Effect::Nothing, ""),
    ("NV_materials_", Effect::Nothing, ""),
    ("VRMC_materials_", Effect::Nothing, ""),
    ("KHR_texture_", Effect::Nothing, ""),
    ("EXT_texture_", Effect::Nothing, ""),
    ("MSFT_texture_", Effect::Nothing, ""),
    ("MSFT_packing_", Effect::Nothing, ""),
    ("KHR_techniques_webgl", Effect::Nothing, ""),
    // Light, sound, movement and behaviour.
    ("EXT_lights_", Effect::Nothing, ""),
    ("KHR_audio_", Effect::Nothing, ""),
    ("KHR_audio", Effect::Nothing, ""),
    ("KHR_animation_", Effect::Nothing, ""),
    ("KHR_physics_", Effect::Nothing, ""),
    ("KHR_collision_", Effect::Nothing, ""),
    ("KHR_implicit_shapes", Effect::Nothing, ""),
    ("KHR_interactivity", Effect::Nothing, ""),
    ("KHR_node_hoverability", Effect::Nothing, ""),
    ("KHR_node_selectability", Effect::Nothing, ""),
    ("AGI_articulations", Effect::Nothing, ""),
    ("VRM", Effect::Nothing, ""),
    ("VRMC_", Effect::Nothing, ""),
    // What is written beside the geometry.
    ("KHR_xmp", Effect::Nothing, ""),
    ("KHR_xmp_", Effect::Nothing, ""),
    ("EXT_structural_metadata", Effect::Nothing, ""),
    ("EXT_mesh_features", Effect::Nothing, ""),
    ("EXT_instance_features", Effect::Nothing, ""),
    ("EXT_mesh_manifold", Effect::Nothing, ""),
    ("FB_geometry_metadata", Effect::Nothing, ""),
    ("FB_ngon_encoding", Effect::Nothing, ""),
    ("CESIUM_primitive_outline", Effect::Nothing, ""),
    ("AGI_stk_metadata", Effect::Nothing, ""),
    // A node is the finest one of its levels.
    ("MSFT_lod", Effect::Nothing, ""),
];

const UNPACKED: &str = "export it without compression (Blender: Compression unticked; gltfpack: without -c \
                        and -cc), or unpack it with `gltf-transform copy IN OUT`";

const UNKNOWN: (Effect, &str) = (Effect::Missed, "export it without");

fn effect(extension: &str) -> (Effect, &'static str) {
    let fits = |name: &str| extension == name || (name.ends_with('_') && extension.starts_with(name));
    let known = EXTENSIONS.iter().find(|(name, ..)| fits(name));
    known.map_or(UNKNOWN, |&(_, effect, remedy)| (effect, remedy))
}

/// What to do about geometry that only an extension could unpack.
pub(super) fn remedy_for_packed() -> &'static str {
    UNPACKED
}

/// What of the extensions that a file uses is not read, a sentence each.
///
/// Errors: one that it cannot do without is not read, in words.
pub(super) fn missed(used: &[String], required: &[String]) -> Result<Vec<String>, String> {
    for name in required {
        let (effect, remedy) = effect(name);
        if matches!(effect, Effect::Packs | Effect::Missed) {
            return Err(format!("it requires the extension {name}, which is not read; {remedy}"));
        }
    }
    let missed =
        used.iter().map(|name| (name, effect(name))).filter(|(_, (effect, _))| *effect == Effect::Missed);
    let told = |(name, (_, remedy))| {
        format!("the extension {name} is not read, and what it changes is missing; {remedy}")
    };
    Ok(missed.map(told).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_touches_neither_shape_nor_alpha_is_of_no_effect() {
        for name in ["KHR_materials_clearcoat", "KHR_animation_pointer", "KHR_xmp_json_ld", "MSFT_lod", "VRM"]
        {
            assert_eq!(effect(name).0, Effect::Nothing, "{name}");
        }
        for name in ["KHR_node_visibility", "EXT_mesh_gpu_instancing"] {
            assert_eq!(effect(name).0, Effect::Read, "{name}");
        }
        for name in ["ACME_holes", "KHR_materials", "VRM_0", ""] {
            assert_eq!(effect(name).0, Effect::Missed, "{name}");
        }
    }
}
