//! What a scene file asked for, with every setting in it: a document that says so by itself, and runs.
//!
//! Most defaults stand in the schema; those that depend on other settings are put in by the documents themselves (`settle`).
//! The schema also tells which strings name files.

#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::{Map, Value};

use crate::{Error, Result};

use super::file_name::{FORMAT, FileName, folder_of};
use super::write::text_of_value;
use super::{Subject, schema};

/// A scene file after its overrides, with every setting, defaults included.
///
/// What has no value is left out: a limit, a bound or a file that was not given. So is what follows from the rest of the scene where nobody
/// has [`Chosen`] it yet, and what would be another machine's affair: the memory budget, if it was not given.
#[derive(Debug, Clone)]
pub struct Resolved {
    subject: Subject,
    /// The settled document, still without what the schema says.
    text: String,
    /// Where the scene file lies.
    folder: PathBuf,
}

impl Resolved {
    /// Of a settled document that was read from `file`.
    pub(super) fn new(document: &impl Serialize, subject: Subject, file: &Path) -> Result<Self> {
        let text = serde_json::to_string(document)
            .map_err(|error| Error::Machine(format!("the scene cannot be written as JSON: {error}")))?;
        let beside = Path::new(".").join(folder_of(file));
        // Whoever changes the current directory later changes nothing here.
        let folder = std::path::absolute(&beside).unwrap_or(beside);
        Ok(Self { subject, text, folder })
    }

    /// The document as a scene file in `folder`, with values that were `chosen` because it has none: it is the same scene, and the files that it names are the same files. Their names are
    /// relative to `folder` where it has a folder in common with them that is not the root, else absolute.
    ///
    /// Errors: [`Error::Value`] for a file whose name is no Unicode, which JSON cannot hold.
    pub fn text_in(&self, folder: &Path, chosen: &[Chosen]) -> Result<String> {
        let broken = |error| Error::Machine(format!("the scene cannot be written as JSON: {error}"));
        let (mut document, root) = (serde_json::from_str(&self.text).map_err(broken)?, schema(self.subject));
        let to = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
        let moved = |name: &str| Ok(FileName::from(name).moved(&self.folder, &to)?.to_string());
        chosen.iter().for_each(|chosen| chosen.put_into(&mut document));
        complete(&mut document, &root, &root, &moved)?;
        text_of_value(&document)
    }
}

/// A value that a document has not, and that follows from the rest of its scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Chosen {
    /// Where it goes, such as `light_map.extent`.
    pub path: &'static str,
    /// The value.
    pub value: Value,
    /// Why it is that, in a few words.
    pub why: String,
}

impl Chosen {
    /// Puts it where there is no value, and says why.
    fn put_into(&self, document: &mut Value) {
        let mut place = &mut *document;
        for key in self.path.split('.') {
            if place.is_null() {
                *place = Value::Object(Map::new());
            }
            let Value::Object(object) = place else { return };
            place = object.entry(key).or_insert(Value::Null);
        }
        if place.is_null() {
            *place = self.value.clone();
            let Value::Object(document) = document else { return };
            let reasons = document.entry("chosen").or_insert_with(|| Value::Object(Map::new()));
            if let Value::Object(reasons) = reasons {
                reasons.insert(self.path.to_owned(), self.why.clone().into());
                // The order in which a document has them.
                reasons.sort_keys();
            }
        }
    }
}

/// Puts the defaults of a schema into a value, in the order of the schema, and `moved` names in place of the names of files.
fn complete(
    value: &mut Value,
    schema: &Value,
    root: &Value,
    moved: &impl Fn(&str) -> Result<String>,
) -> Result<()> {
    let reference = schema.get("$ref").and_then(Value::as_str).and_then(|path| path.strip_prefix('#'));
    if let Some(definition) = reference.and_then(|path| root.pointer(path)) {
        complete(value, definition, root, moved)?;
    }
    // What an alternative says is about one kind of value alone, or about the one key that names it.
    for alternative in ["anyOf", "oneOf"].iter().filter_map(|key| schema[key].as_array()).flatten() {
        complete(value, alternative, root, moved)?;
    }
    match value {
        Value::String(name) if schema["format"] == FORMAT => *name = moved(name)?,
        Value::Array(elements) => {
            elements.iter_mut().try_for_each(|element| complete(element, &schema["items"], root, moved))?;
        }
        Value::Object(object) => {
            let mut whole = Map::new();
            for (key, property) in schema["properties"].as_object().into_iter().flatten() {
                if let Some(mut value) = object.remove(key).or_else(|| property.get("default").cloned()) {
                    complete(&mut value, property, root, moved)?;
                    whole.insert(key.clone(), value);
                }
            }
            whole.append(object);
            *object = whole;
        }
        _ => {}
    }
    Ok(())
}
