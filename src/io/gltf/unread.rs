//! What nobody reads here is taken out of a file's JSON first, so that nothing in there makes a file
//! unreadable.

use serde_json::{Map, Value, json};

/// The crate's types are strict about all of this. Nothing uses `animations` and `skins`, nor the other textures
/// of a material.
pub(super) fn remove(root: &mut Value) {
    remove_extras(root);
    let Some(root) = root.as_object_mut() else { return };
    for unread in ["animations", "skins"] {
        root.remove(unread);
    }
    // A scene may be empty.
    for scene in objects(root.get_mut("scenes")) {
        scene.entry("nodes").or_insert_with(|| json!([]));
    }
    for material in objects(root.get_mut("materials")) {
        for unread in ["normalTexture", "occlusionTexture", "emissiveTexture", "emissiveFactor"] {
            material.remove(unread);
        }
        if let Some(base) = inside(material, &["pbrMetallicRoughness"]) {
            for unread in ["metallicRoughnessTexture", "metallicFactor", "roughnessFactor"] {
                base.remove(unread);
            }
        }
        if let Some(older) = inside(material, &["extensions", "KHR_materials_pbrSpecularGlossiness"]) {
            for unread in ["specularGlossinessTexture", "specularFactor", "glossinessFactor"] {
                older.remove(unread);
            }
        }
    }
    let lights = inside(root, &["extensions", "KHR_lights_punctual"]);
    for light in objects(lights.and_then(|lights| lights.get_mut("lights"))) {
        light.remove("extensions");
        light.remove("spot");
    }
    // Morph targets have attributes of any name; that there are some is all that is asked.
    for mesh in objects(root.get_mut("meshes")) {
        for primitive in objects(mesh.get_mut("primitives")) {
            for target in objects(primitive.get_mut("targets")) {
                target.clear();
            }
        }
    }
}

/// Notes of programs for themselves, which may be anything.
fn remove_extras(value: &mut Value) {
    match value {
        Value::Object(members) => {
            members.remove("extras");
            members.values_mut().for_each(remove_extras);
        }
        Value::Array(elements) => elements.iter_mut().for_each(remove_extras),
        _ => {}
    }
}

fn inside<'a>(object: &'a mut Map<String, Value>, path: &[&str]) -> Option<&'a mut Map<String, Value>> {
    path.iter().try_fold(object, |object, &name| object.get_mut(name)?.as_object_mut())
}

fn objects(array: Option<&mut Value>) -> impl Iterator<Item = &mut Map<String, Value>> {
    array.and_then(Value::as_array_mut).into_iter().flatten().filter_map(Value::as_object_mut)
}
