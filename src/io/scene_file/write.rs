//! Documents as text: pretty, but short.

use serde::Serialize;
use serde_json::{Number, Value};

use crate::{Error, Result};

use super::document::Document;
use super::volume::VolumeDocument;

/// Lines are filled up to this many bytes where that is possible.
const WIDTH: usize = 100;

/// The document as JSON, ready to be loaded again. What fits on a line is on one line, so that points,
/// vectors and shapes stay readable and files small.
///
/// Errors: [`Error::NonFinite`] for a NaN or an infinity, which JSON cannot hold.
pub fn write(document: &Document) -> Result<String> {
    text_of(document)
}

/// The document of a volume as JSON, laid out as [`write()`] does.
///
/// Errors: as [`write()`].
pub fn write_volume(document: &VolumeDocument) -> Result<String> {
    text_of(document)
}

fn text_of(document: &impl Serialize) -> Result<String> {
    let value = serde_json::to_value(document)
        .map_err(|error| Error::Machine(format!("the scene cannot be written as JSON: {error}")))?;
    text_of_value(&value)
}

/// A document that has become JSON, laid out as [`write()`] does.
///
/// Errors: as [`write()`].
pub(super) fn text_of_value(value: &Value) -> Result<String> {
    if let Some(place) = first_null(value) {
        return Err(Error::NonFinite { what: "a value of the scene".to_owned(), place });
    }
    let mut text = String::new();
    match value {
        Value::Object(_) => lay_out_object(value, 0, &mut text),
        other => lay_out(other, 0, &mut text),
    }
    text.push('\n');
    Ok(text)
}

/// Where serde put a null, its word for a number that is not finite; options that are not set are left out.
fn first_null(value: &Value) -> Option<String> {
    match value {
        Value::Null => Some(String::new()),
        Value::Array(elements) => elements
            .iter()
            .enumerate()
            .find_map(|(i, value)| Some(joined(&format!("[{i}]"), &first_null(value)?))),
        Value::Object(object) => {
            object.iter().find_map(|(key, value)| Some(joined(key, &first_null(value)?)))
        }
        _ => None,
    }
}

fn joined(parent: &str, child: &str) -> String {
    let dot = if child.is_empty() || child.starts_with('[') { "" } else { "." };
    format!("{parent}{dot}{child}")
}

fn lay_out(value: &Value, indent: usize, text: &mut String) {
    let room = WIDTH.saturating_sub(column(text) + 1);
    let mut flat = String::new();
    if flatten(value, room, &mut flat) {
        text.push_str(&flat);
        return;
    }
    match value {
        Value::Object(_) => lay_out_object(value, indent, text),
        Value::Array(elements) if elements.iter().all(is_numeric) => fill(elements, indent, text),
        Value::Array(elements) => {
            lines(text, '[', ']', indent, elements, |element, text| lay_out(element, indent + 1, text));
        }
        scalar => text.push_str(&scalar_text(scalar)),
    }
}

fn lay_out_object(value: &Value, indent: usize, text: &mut String) {
    let entries = value.as_object().into_iter().flatten();
    lines(text, '{', '}', indent, entries, |(key, value), text| {
        text.push_str(&key_text(key));
        lay_out(value, indent + 1, text);
    });
}

/// Writes each item on a line of its own.
fn lines<T>(
    text: &mut String,
    open: char,
    close: char,
    indent: usize,
    items: impl IntoIterator<Item = T>,
    mut write: impl FnMut(T, &mut String),
) {
    text.push(open);
    for (i, item) in items.into_iter().enumerate() {
        text.push_str(if i == 0 { "" } else { "," });
        new_line(indent + 1, text);
        write(item, text);
    }
    new_line(indent, text);
    text.push(close);
}

/// Writes numbers or points, as many as fit on each line.
fn fill(elements: &[Value], indent: usize, text: &mut String) {
    text.push('[');
    for (i, element) in elements.iter().enumerate() {
        let mut flat = String::new();
        flatten(element, usize::MAX, &mut flat);
        text.push_str(if i == 0 { "" } else { "," });
        if i == 0 || column(text) + flat.len() + 2 > WIDTH {
            new_line(indent + 1, text);
        } else {
            text.push(' ');
        }
        text.push_str(&flat);
    }
    new_line(indent, text);
    text.push(']');
}

fn new_line(indent: usize, text: &mut String) {
    text.push('\n');
    text.extend(std::iter::repeat_n("  ", indent));
}

fn column(text: &str) -> usize {
    text.len() - text.rfind('\n').map_or(0, |newline| newline + 1)
}

/// A number, or an array of nothing but numbers.
fn is_numeric(value: &Value) -> bool {
    value.is_number() || value.as_array().is_some_and(|elements| elements.iter().all(Value::is_number))
}

/// Appends the value on one line; false as soon as that takes more than `room` bytes.
fn flatten(value: &Value, room: usize, text: &mut String) -> bool {
    match value {
        Value::Array(elements) => {
            text.push('[');
            for (i, element) in elements.iter().enumerate() {
                text.push_str(if i == 0 { "" } else { ", " });
                if !flatten(element, room, text) {
                    return false;
                }
            }
            text.push(']');
        }
        Value::Object(object) if object.is_empty() => text.push_str("{}"),
        Value::Object(object) => {
            text.push_str("{ ");
            for (i, (key, value)) in object.iter().enumerate() {
                text.push_str(if i == 0 { "" } else { ", " });
                text.push_str(&key_text(key));
                if !flatten(value, room, text) {
                    return false;
                }
            }
            text.push_str(" }");
        }
        scalar => text.push_str(&scalar_text(scalar)),
    }
    text.len() <= room
}

fn key_text(key: &str) -> String {
    format!("{}: ", Value::from(key))
}

fn scalar_text(value: &Value) -> String {
    match value {
        Value::Number(number) => number_text(number),
        other => other.to_string(),
    }
}

/// `2` instead of `2.0`: the same number, and shorter.
fn number_text(number: &Number) -> String {
    let text = number.to_string();
    match text.strip_suffix(".0") {
        Some(whole) if whole != "-0" && whole.len() < 16 => whole.to_owned(),
        _ => text,
    }
}
