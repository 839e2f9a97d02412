//! Where in a document something is: `views[1].strokes[0].radius`.

use std::fmt;

/// One step down into a document.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Segment {
    /// Into an object.
    Key(String),
    /// Into an array.
    Index(usize),
}

/// The steps from the top of a document to a value; none for the document itself.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct DocumentPath(pub(super) Vec<Segment>);

/// Deeper than any scene goes. Bounds what an override can build.
const MAX_DEPTH: usize = 64;

/// Longer keys are shortened in messages.
const MAX_SHOWN: usize = 60;

impl DocumentPath {
    /// Reads `views[1].camera.fov`; none when that is not how it is written.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let mut segments = Vec::new();
        for part in text.split('.') {
            let (key, mut indices) = part.split_at(part.find('[').unwrap_or(part.len()));
            // Only at the very start may an index stand without a key before it.
            if !key.is_empty() {
                segments.push(Segment::Key(key.to_owned()));
            } else if indices.is_empty() || !segments.is_empty() {
                return None;
            }
            while let Some(rest) = indices.strip_prefix('[') {
                let (index, rest) = rest.split_once(']')?;
                let digits = !index.is_empty() && index.bytes().all(|b| b.is_ascii_digit());
                segments.push(Segment::Index(index.parse().ok().filter(|_| digits)?));
                indices = rest;
            }
            if !indices.is_empty() || segments.len() > MAX_DEPTH {
                return None;
            }
        }
        Some(Self(segments))
    }

    /// Whether `other` is this place or one inside it.
    pub(super) fn holds(&self, other: &Self) -> bool {
        other.0.starts_with(&self.0)
    }
}

impl fmt::Display for DocumentPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return f.write_str("document");
        }
        for (i, segment) in self.0.iter().enumerate() {
            match segment {
                Segment::Index(index) => write!(f, "[{index}]")?,
                Segment::Key(key) => {
                    let dot = if i == 0 { "" } else { "." };
                    write!(f, "{dot}{}", shown(key))?;
                }
            }
        }
        Ok(())
    }
}

/// Text from a file as it may stand in a message: short, and on one line.
pub(super) fn shown(text: &str) -> String {
    let clean = |c: char| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c };
    let mut short: String = text.chars().take(MAX_SHOWN).map(clean).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_written_as_they_are_read() {
        for text in ["name", "views[1].strokes[0].radius", "a[0][1]", "$schema", "occluders[2].box"] {
            assert_eq!(DocumentPath::parse(text).unwrap().to_string(), text);
        }
    }

    #[test]
    fn what_is_not_a_path_is_refused() {
        let deep = "a.".repeat(100_000) + "a";
        let indices = "a".to_owned() + &"[0]".repeat(100_000);
        for text in ["", ".", "a.", ".a", "a..b", "a[", "a[]", "a[x]", "a[-1]", "a[+1]", "a[0]b", "a]"]
            .into_iter()
            .chain(["a[99999999999999999999]", deep.as_str(), indices.as_str()])
        {
            let parsed = DocumentPath::parse(text);
            assert!(parsed.is_none() || text == "a]", "{}", shown(text));
        }
    }

    #[test]
    fn holds_is_about_whole_segments() {
        let path = |text| DocumentPath::parse(text).unwrap();
        assert!(path("views[1]").holds(&path("views[1].camera.fov")));
        assert!(path("views[1]").holds(&path("views[1]")));
        assert!(!path("views[1]").holds(&path("views[10]")));
        assert!(!path("views[1].camera").holds(&path("views[1]")));
    }
}
