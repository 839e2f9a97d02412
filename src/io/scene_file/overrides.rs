//! Values of a document that are set from outside: `views[0].camera.fov=50`.

use serde_json::{Map, Value};

use crate::{Error, Result};

use super::path::{DocumentPath, Segment, shown};
use super::read;

/// A value and where it goes.
#[derive(Debug)]
pub(super) struct Override {
    pub(super) path: DocumentPath,
    value: Value,
}

impl Override {
    /// Reads `path=value`. The value is JSON, or else a string.
    ///
    /// Errors: [`Error::Value`] when it is not of this form.
    pub(super) fn parse(text: &str) -> Result<Self> {
        let parsed = text.split_once('=').and_then(|(path, value)| {
            let value = read::value(value).unwrap_or_else(|_| Value::String(value.to_owned()));
            Some(Self { path: DocumentPath::parse(path.trim())?, value })
        });
        let expected = "path=value, such as views[0].camera.fov=50";
        parsed.ok_or_else(|| Error::value("override", format!("`{}`", shown(text)), expected))
    }

    /// Puts the value into the document; objects that are missing on the way are made.
    ///
    /// Errors: what is wrong, when the path leads through something that cannot hold it.
    pub(super) fn apply(self, document: &mut Value) -> Result<(), String> {
        let mut place = document;
        for segment in &self.path.0 {
            place = enter(place, segment)?;
        }
        *place = self.value;
        Ok(())
    }
}

fn enter<'a>(place: &'a mut Value, segment: &Segment) -> Result<&'a mut Value, String> {
    if place.is_null() && matches!(segment, Segment::Key(_)) {
        *place = Value::Object(Map::new());
    }
    match (segment, place) {
        (Segment::Key(key), Value::Object(object)) => Ok(object.entry(key.as_str()).or_insert(Value::Null)),
        (Segment::Index(index), Value::Array(elements)) => {
            let length = elements.len();
            elements.get_mut(*index).ok_or_else(|| match length {
                0 => format!("there is no element {index}; the list is empty"),
                _ => format!("there is no element {index}; the last one is {}", length - 1),
            })
        }
        (Segment::Index(_), Value::Null) => Err("there is no list of this name".to_owned()),
        (Segment::Key(key), other) => Err(format!("there is no field `{}` in {}", shown(key), kind(other))),
        (Segment::Index(index), other) => Err(format!("there is no element {index} in {}", kind(other))),
    }
}

fn kind(value: &Value) -> &'static str {
    match value {
        Value::Null => "nothing",
        Value::Bool(_) => "a true or false",
        Value::Number(_) => "a number",
        Value::String(_) => "a text",
        Value::Array(_) => "a list",
        Value::Object(_) => "an object",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn applied(texts: &[&str]) -> Result<Value, String> {
        let mut document = json!({ "a": [{ "b": 1 }, 2], "c": "x" });
        for text in texts {
            Override::parse(text).map_err(|error| error.to_string())?.apply(&mut document)?;
        }
        Ok(document)
    }

    #[test]
    fn values_are_replaced_and_missing_objects_made() {
        let got = applied(&["a[0].b=5", "d.e.f=[1, 2]", "c=plain text", "a[1]=\"7\"", "d.g=a=b"]).unwrap();
        let expected = json!({
            "a": [{ "b": 5 }, "7"], "c": "plain text", "d": { "e": { "f": [1, 2] }, "g": "a=b" }
        });
        assert_eq!(got, expected);
    }

    #[test]
    fn paths_that_lead_nowhere_are_refused() {
        let table = [
            ("a[2]=1", "the last one is 1"),
            ("a.b=1", "no field `b` in a list"),
            ("c[0]=1", "no element 0 in a text"),
            ("new[0]=1", "no list of this name"),
            ("a[0][0]=1", "no element 0 in an object"),
            ("c", "path=value"),
            ("=1", "path=value"),
            ("a[-1]=1", "path=value"),
        ];
        for (text, expected) in table {
            let problem = applied(&[text]).unwrap_err();
            assert!(problem.contains(expected), "{text}: {problem}");
        }
    }
}
