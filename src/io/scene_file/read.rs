//! From the bytes of a scene file to JSON values, within bounds.

use std::cell::RefCell;
use std::fmt;

use serde::Deserializer;
use serde::de::{DeserializeSeed, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};

use crate::{Error, Result};

use super::path::{DocumentPath, Segment};

/// A document may hold this many values; one takes a good hundred bytes of memory.
const MAX_VALUES: usize = 4_000_000;

/// What to do about a file that is too long.
pub(super) const REMEDY: &str = "paint what is large as a layer, and keep triangles in glTF files";

/// What is wrong with a text as JSON.
#[derive(Debug)]
pub(super) enum Broken {
    /// A key occurs twice in one object.
    Duplicate(DocumentPath),
    /// Not JSON at this byte offset, inside the value at the path.
    Syntax {
        /// Where in the document.
        path: DocumentPath,
        /// Where in the text.
        offset: usize,
        /// What is wrong.
        problem: String,
    },
    /// More values than memory should be spent on.
    TooMany(Error),
}

/// The JSON value of a text in which no object has a key twice.
pub(super) fn value(text: &str) -> Result<Value, Broken> {
    let trail = RefCell::new(Trail::default());
    let mut deserializer = serde_json::Deserializer::from_str(text);
    let value = Node(&trail).deserialize(&mut deserializer);
    let value = value.and_then(|value| deserializer.end().map(|()| value));
    value.map_err(|error| broken(text, &error, trail.into_inner()))
}

fn broken(text: &str, error: &serde_json::Error, trail: Trail) -> Broken {
    match trail.stopped {
        Some(Stopped::Duplicate) => Broken::Duplicate(DocumentPath(trail.path)),
        Some(Stopped::TooMany) => Broken::TooMany(Error::TooLarge {
            what: "the scene".to_owned(),
            needed: format!("more than {MAX_VALUES} values"),
            limit: format!("{MAX_VALUES} values"),
            remedy: REMEDY,
        }),
        None => {
            let message = error.to_string();
            let problem = message.rsplit_once(" at line ").map_or(message.as_str(), |(problem, _)| problem);
            let offset = offset(text, error.line(), error.column());
            Broken::Syntax { path: DocumentPath(trail.path), offset, problem: problem.to_owned() }
        }
    }
}

/// The byte offset of a line and a column in bytes, both from 1.
fn offset(text: &str, line: usize, column: usize) -> usize {
    let lines = text.split_inclusive('\n').take(line.saturating_sub(1));
    let start: usize = lines.map(str::len).sum();
    (start + column.saturating_sub(1)).min(text.len())
}

/// Where the reader is and why it stopped.
#[derive(Debug, Default)]
struct Trail {
    path: Vec<Segment>,
    values: usize,
    stopped: Option<Stopped>,
}

#[derive(Debug)]
enum Stopped {
    Duplicate,
    TooMany,
}

/// Reads one value; what fails leaves its path in the trail.
#[derive(Clone, Copy)]
struct Node<'a>(&'a RefCell<Trail>);

impl Node<'_> {
    fn enter(self, segment: Segment) {
        self.0.borrow_mut().path.push(segment);
    }

    fn leave(self) {
        self.0.borrow_mut().path.pop();
    }

    fn stop<E: serde::de::Error>(self, why: Stopped) -> E {
        self.0.borrow_mut().stopped = Some(why);
        E::custom("stopped")
    }

    fn count<E: serde::de::Error>(self) -> Result<(), E> {
        self.0.borrow_mut().values += 1;
        if self.0.borrow().values > MAX_VALUES { Err(self.stop(Stopped::TooMany)) } else { Ok(()) }
    }
}

impl<'de> DeserializeSeed<'de> for Node<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        self.count()?;
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Node<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Bool(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(Value::Number(value.into()))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(Value::Number(value.into()))
    }

    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<Value, E> {
        Number::from_f64(value).map(Value::Number).ok_or_else(|| E::custom("number out of range"))
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(Value::String(value.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Value, A::Error> {
        let mut elements = Vec::new();
        self.enter(Segment::Index(0));
        while let Some(element) = sequence.next_element_seed(self)? {
            elements.push(element);
            self.leave();
            self.enter(Segment::Index(elements.len()));
        }
        self.leave();
        elements.shrink_to_fit();
        Ok(Value::Array(elements))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut object = Map::new();
        while let Some(key) = entries.next_key::<String>()? {
            self.enter(Segment::Key(key.clone()));
            if object.contains_key(&key) {
                return Err(self.stop(Stopped::Duplicate));
            }
            object.insert(key, entries.next_value_seed(self)?);
            self.leave();
        }
        Ok(Value::Object(object))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_read_is_what_serde_json_reads() {
        let text = r#" {"a": [1, -2, 2.5, 1e10, "x\n", true, null, {}], "b": {"c": [[]]}} "#;
        assert_eq!(value(text).unwrap(), serde_json::from_str::<Value>(text).unwrap());
    }

    #[test]
    fn a_key_that_occurs_twice_is_refused_also_when_it_is_escaped() {
        let Err(Broken::Duplicate(path)) = value(r#"{"a": [{}, {"b": 1, "\u0062": 2}]}"#) else {
            unreachable!()
        };
        assert_eq!(path.to_string(), "a[1].b");
    }

    #[test]
    fn syntax_errors_know_where_they_are() {
        let table = [
            ("{\"a\": [1,\n  x]}", "a[1]", 12),
            ("{\"a\": 1e999}", "a", 10),
            ("{} {}", "document", 3),
            ("", "document", 0),
        ];
        for (text, expected, at) in table {
            let Err(Broken::Syntax { path, offset, .. }) = value(text) else { unreachable!("{text}") };
            assert_eq!((path.to_string().as_str(), offset), (expected, at), "{text}");
        }
    }

    #[test]
    fn deep_and_wide_documents_are_refused() {
        assert!(matches!(value(&"[".repeat(1_000_000)), Err(Broken::Syntax { .. })));
        let wide = format!("[{}0]", "0,".repeat(MAX_VALUES));
        assert!(matches!(value(&wide), Err(Broken::TooMany(_))));
    }
}
