//! Serde's messages in the words of a scene file.

use super::path::shown;

/// What is wrong, and the valid name that is nearest to the given one.
#[derive(Debug, PartialEq)]
pub(super) struct Wording {
    pub(super) problem: String,
    pub(super) suggestion: Option<String>,
    /// Whether a name is wrong, and not a value.
    pub(super) about: About,
}

/// What a message is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum About {
    /// The key at the end of the path.
    Field,
    /// The name of an alternative: the value at the path, or the one key in it.
    Variant,
    /// The value at the path.
    Value,
}

/// Names that are at least this similar are suggested.
const SIMILAR: f64 = 0.8;

/// Serde's names for what it wanted or got, and ours.
const WORDS: [(&str, &str); 16] = [
    ("f64", "a number"),
    ("usize", "a whole number that is not negative"),
    ("u64", "a whole number that is not negative"),
    ("u32", "a whole number from 0 to 4294967295"),
    ("map", "an object"),
    ("sequence", "a list"),
    ("a sequence", "a list"),
    ("a string", "a text"),
    ("null", "nothing (null)"),
    ("unit value", "nothing (null)"),
    ("unit variant", "a name alone"),
    ("newtype variant", "an object"),
    ("struct variant", "an object"),
    ("string or map", "a name, or an object with one name in it"),
    ("map with a single key", "an object with one name in it"),
    ("fewer elements in array", "a shorter list"),
];

/// Puts a message of serde into our words.
pub(super) fn of(message: &str) -> Wording {
    for (start, about) in [("unknown field `", About::Field), ("unknown variant `", About::Variant)] {
        if let Some(rest) = message.strip_prefix(start) {
            return unknown(rest, about);
        }
    }
    let invalid = ["invalid type: ", "invalid value: ", "invalid length "];
    let stripped = invalid.iter().find_map(|start| Some((*start, message.strip_prefix(start)?)));
    let problem = match stripped.and_then(|(start, rest)| Some((start, rest.rsplit_once(", expected ")?))) {
        Some(("invalid length ", (length, wanted))) => mismatch(&format!("a list of {length}"), wanted),
        Some((_, (got, wanted))) => mismatch(got, wanted),
        None => shown_long(message),
    };
    Wording { problem, suggestion: None, about: About::Value }
}

fn unknown(rest: &str, about: About) -> Wording {
    let (name, expected) = rest.rsplit_once("`, expected ").unwrap_or((rest, ""));
    let valid: Vec<&str> = expected.split('`').skip(1).step_by(2).collect();
    let what = if about == About::Field { "field" } else { "name" };
    let problem = format!("unknown {what} `{}`; possible here: {}", shown(name), valid.join(", "));
    Wording { problem, suggestion: nearest(name, &valid), about }
}

fn mismatch(got: &str, wanted: &str) -> String {
    format!("{} is not allowed; it must be {}", shown(&translated(got)), translated(wanted))
}

fn translated(words: &str) -> String {
    let ours = WORDS.iter().find(|(theirs, _)| *theirs == words).map(|(_, ours)| *ours);
    if let Some(ours) = ours {
        return ours.to_owned();
    }
    if words.starts_with("struct ") || words.starts_with("struct variant ") {
        return "an object".to_owned();
    }
    if let Some(length) = words.strip_prefix("an array of length ") {
        return format!("a list of {length}");
    }
    let kinds = [("string ", "the text "), ("floating point ", ""), ("integer ", ""), ("boolean ", "")];
    let kind = kinds.iter().find_map(|(theirs, ours)| Some(format!("{ours}{}", words.strip_prefix(theirs)?)));
    kind.unwrap_or_else(|| words.to_owned())
}

/// The valid name that is most similar to the given one, when it is similar at all.
pub(super) fn nearest(name: &str, valid: &[&str]) -> Option<String> {
    let simple = |text: &str| text.chars().take(64).filter(|c| c.is_alphanumeric()).collect::<String>();
    let name = simple(name).to_lowercase();
    let similarity = |candidate: &&str| strsim::jaro_winkler(&name, &simple(candidate));
    let rated = valid.iter().map(|candidate| (similarity(candidate), *candidate));
    let best = rated.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (best.0 >= SIMILAR).then(|| best.1.to_owned())
}

fn shown_long(message: &str) -> String {
    message.split('`').map(shown).collect::<Vec<_>>().join("`")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_suggested_and_no_far_one() {
        let camera = ["to_world", "fov", "fov_axis", "gltf", "size"];
        let table = [
            ("toWorld", Some("to_world")),
            ("fovaxis", Some("fov_axis")),
            ("fow", Some("fov")),
            ("sizes", Some("size")),
            ("zzz", None),
            ("", None),
        ];
        for (name, expected) in table {
            assert_eq!(nearest(name, &camera).as_deref(), expected, "{name}");
        }
    }

    #[test]
    fn messages_speak_of_lists_and_texts() {
        let table = [
            (
                r#"invalid type: string "a", expected f64"#,
                r#"the text "a" is not allowed; it must be a number"#,
            ),
            (
                "invalid length 2, expected an array of length 3",
                "a list of 2 is not allowed; it must be a list of 3",
            ),
            ("invalid type: map, expected a sequence", "an object is not allowed; it must be a list"),
            ("invalid type: integer `5`, expected struct Camera", "`5` is not allowed; it must be an object"),
            ("missing field `fov`", "missing field `fov`"),
        ];
        for (message, expected) in table {
            assert_eq!(of(message).problem, expected);
        }
    }

    #[test]
    fn a_name_cannot_fake_the_message_around_it() {
        let wording = of("unknown field `a`, expected `b`, expected one of `size`, `fov`");
        assert_eq!(wording.problem, "unknown field `a`, expected `b`; possible here: size, fov");
    }
}
