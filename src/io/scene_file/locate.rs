//! Line and column of a place in a JSON text.
//!
//! A bounded scanner and no parser: it never allocates a document, does not recurse, and answers with
//! the nearest enclosing place when the text ends early or the path leads nowhere.

use super::path::{DocumentPath, Segment};

/// What to point at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Aim {
    /// The value at the path.
    Value,
    /// The last key of the path, where that is what is wrong.
    Key,
    /// The second key of that name in its object.
    SecondKey,
}

/// Line and column, both from 1 and in characters, of `path` or of its nearest existing ancestor.
pub(super) fn locate(text: &str, path: &DocumentPath, aim: Aim) -> (usize, usize) {
    let mut scanner = Scanner { bytes: text.as_bytes(), at: 0 };
    scanner.skip_space();
    let mut best = scanner.at;
    for (depth, segment) in path.0.iter().enumerate() {
        let last = depth + 1 == path.0.len();
        let found = match segment {
            Segment::Index(index) => scanner.enter_array(*index).map(|value| (value, value)),
            Segment::Key(key) => {
                let nth = if last && aim == Aim::SecondKey { 1 } else { 0 };
                scanner.enter_object(key, nth)
            }
        };
        let Some((key, value)) = found else { break };
        best = if last && aim != Aim::Value { key } else { value };
    }
    position(text, best)
}

/// Line and column of a byte offset.
pub(super) fn position(text: &str, offset: usize) -> (usize, usize) {
    let before = &text.as_bytes()[..offset.min(text.len())];
    let line_start = before.iter().rposition(|&b| b == b'\n').map_or(0, |newline| newline + 1);
    let line = before.iter().filter(|&&b| b == b'\n').count() + 1;
    // UTF-8 continuation bytes do not begin a character.
    let column = before[line_start..].iter().filter(|&&b| b & 0xC0 != 0x80).count() + 1;
    (line, column)
}

struct Scanner<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Scanner<'_> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    fn skip_space(&mut self) {
        while self.peek().is_some_and(|b| b.is_ascii_whitespace()) {
            self.at += 1;
        }
    }

    /// Steps over `byte` and the space after it.
    fn accept(&mut self, byte: u8) -> Option<()> {
        (self.peek() == Some(byte)).then(|| self.at += 1)?;
        self.skip_space();
        Some(())
    }

    /// Moves to element `index` of the array that begins here; its offset.
    fn enter_array(&mut self, index: usize) -> Option<usize> {
        self.accept(b'[')?;
        for _ in 0..index {
            self.skip_value()?;
            self.accept(b',')?;
        }
        (self.peek()? != b']').then_some(self.at)
    }

    /// Moves to the value of the `nth` key of this name in the object that begins here; the offsets of key
    /// and value.
    fn enter_object(&mut self, name: &str, mut nth: usize) -> Option<(usize, usize)> {
        self.accept(b'{')?;
        loop {
            let key = self.at;
            let raw = self.skip_string()?;
            self.accept(b':')?;
            let same = matches_key(&self.bytes[raw.0..raw.1], name);
            if same && nth == 0 {
                return Some((key, self.at));
            }
            nth -= usize::from(same);
            self.skip_value()?;
            self.accept(b',')?;
        }
    }

    /// Steps over a string and the space after it; where it begins and ends, quotes included.
    fn skip_string(&mut self) -> Option<(usize, usize)> {
        let start = self.at;
        (self.peek()? == b'"').then_some(())?;
        self.at += 1;
        loop {
            match self.peek()? {
                b'"' => break,
                b'\\' => self.at += 2,
                _ => self.at += 1,
            }
        }
        self.at += 1;
        let end = self.at;
        self.skip_space();
        Some((start, end))
    }

    /// Steps over one value of any depth and the space after it.
    fn skip_value(&mut self) -> Option<()> {
        let mut depth = 0usize;
        loop {
            match self.peek()? {
                b'"' => {
                    self.skip_string()?;
                }
                b'[' | b'{' => {
                    depth += 1;
                    self.at += 1;
                }
                b']' | b'}' => {
                    depth = depth.checked_sub(1)?;
                    self.at += 1;
                }
                b',' | b':' if depth > 0 => self.at += 1,
                b',' | b':' => return None,
                _ => self.skip_scalar(),
            }
            self.skip_space();
            if depth == 0 {
                return Some(());
            }
        }
    }

    fn skip_scalar(&mut self) {
        let ends = |b: u8| b.is_ascii_whitespace() || b",:]}[{\"".contains(&b);
        while self.peek().is_some_and(|b| !ends(b)) {
            self.at += 1;
        }
    }
}

/// Whether a quoted and perhaps escaped key is `name`.
fn matches_key(raw: &[u8], name: &str) -> bool {
    if raw.contains(&b'\\') {
        return serde_json::from_slice::<String>(raw).is_ok_and(|key| key == name);
    }
    raw.get(1..raw.len().saturating_sub(1)) == Some(name.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"{
  "a": [1, {"b": "x]}\"", "c": [[], [2, 3]]}],
  "ä\u0041": {"ö": 1, "d": -1e5 , "d": {}}
}"#;

    fn at(path: &str, aim: Aim) -> (usize, usize) {
        locate(TEXT, &DocumentPath::parse(path).unwrap(), aim)
    }

    #[test]
    fn values_and_keys_are_found() {
        assert_eq!(at("a", Aim::Value), (2, 8));
        assert_eq!(at("a", Aim::Key), (2, 3));
        assert_eq!(at("a[0]", Aim::Value), (2, 9));
        assert_eq!(at("a[1].b", Aim::Value), (2, 18));
        assert_eq!(at("a[1].c[1][1]", Aim::Value), (2, 41));
        assert_eq!(at("äA.d", Aim::Value), (3, 28), "columns count characters, escapes are read");
        assert_eq!(at("äA.d", Aim::SecondKey), (3, 35));
    }

    #[test]
    fn a_path_that_leads_nowhere_ends_at_its_nearest_ancestor() {
        assert_eq!(at("a[1].nothing.there", Aim::Key), at("a[1]", Aim::Value));
        assert_eq!(at("a[2]", Aim::Value), at("a", Aim::Value));
        assert_eq!(at("a[1].c[0][0]", Aim::Value), at("a[1].c[0]", Aim::Value));
        assert_eq!(at("nothing", Aim::Value), (1, 1));
    }

    #[test]
    fn every_truncation_and_every_garbled_byte_still_has_an_answer() {
        let path = DocumentPath::parse("a[1].c[1][1]").unwrap();
        for end in (0..TEXT.len()).filter(|&end| TEXT.is_char_boundary(end)) {
            let (line, column) = locate(&TEXT[..end], &path, Aim::Value);
            assert!(line >= 1 && column >= 1);
        }
        for garble in ["\"", "\\", "[", "}", ",", ":"] {
            for at in (0..TEXT.len()).filter(|&at| TEXT.is_char_boundary(at)) {
                let text = format!("{}{garble}{}", &TEXT[..at], &TEXT[at..]);
                locate(&text, &path, Aim::SecondKey);
            }
        }
        locate(&"[".repeat(1_000_000), &path, Aim::Value);
        locate(&format!("{{\"z\":{}", "[".repeat(1_000_000)), &path, Aim::Value);
    }
}
