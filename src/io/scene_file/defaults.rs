//! Sets of defaults.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// Which defaults settings have that are not given.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Defaults {
    /// Those that pose the problem that people mean who paint: they are the ones that the schema states.
    #[default]
    Artist,
    /// Those that pose the problem as Kol et al. 2017 do.
    Paper,
}

/// The values under `defaults: paper` that are others than the schema's.
fn of_paper() -> Value {
    json!({
        "target": "white-tint",
        "opacity": "weight",
        "exposure": 0,
        "light_map": { "size": 512, "fit": "seen", "gobo": false },
        "solve": { "gradient": 0, "laplacian": 0 }
    })
}

/// Puts the values of a document's set of defaults where it says nothing itself.
pub(super) fn put_into(document: &mut Value) {
    if document.get("defaults") == Some(&json!("paper")) {
        fill(document, of_paper());
    }
}

/// Puts values into an object where it has none of their name.
fn fill(object: &mut Value, values: Value) {
    let (Value::Object(object), Value::Object(values)) = (object, values) else { return };
    for (key, value) in values {
        match object.get_mut(&key) {
            Some(given) => fill(given, value),
            None => _ = object.insert(key, value),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_given_stays_and_what_is_not_comes_from_the_paper() {
        let mut document = json!({ "defaults": "paper", "target": "radiance", "solve": { "gradient": 2 } });
        put_into(&mut document);
        assert_eq!(document["target"], "radiance");
        assert_eq!(document["solve"], json!({ "gradient": 2, "laplacian": 0 }));
        assert_eq!((&document["opacity"], &document["light_map"]["gobo"]), (&json!("weight"), &json!(false)));
        let mut other = json!({ "defaults": "artist", "version": 1 });
        put_into(&mut other);
        assert_eq!(other, json!({ "defaults": "artist", "version": 1 }));
    }
}
