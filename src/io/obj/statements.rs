//! Statements of OBJ and MTL files: a word, and what follows it.

use std::borrow::Cow;

/// Words that a name follows. A name may hold a `#`, as `Material #25` does.
const NAMING: [&[u8]; 6] = [b"o", b"g", b"usemtl", b"mtllib", b"newmtl", b"map_d"];

/// Longer text of a file is shortened in messages.
const MAX_SHOWN: usize = 40;

/// The statements of a file, without comments; a statement may go on over several lines.
pub(super) struct Statements<'a> {
    rest: &'a [u8],
    /// Lines read so far.
    line: usize,
}

/// One statement.
pub(super) struct Statement<'a> {
    /// Where it begins; lines are counted from 1.
    pub(super) line: usize,
    text: Cow<'a, [u8]>,
}

impl<'a> Statements<'a> {
    /// Errors: why the bytes are no text, as the end of a sentence.
    pub(super) fn new(bytes: &'a [u8]) -> Result<Self, &'static str> {
        let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        if text.starts_with(b"\xff\xfe") || text.starts_with(b"\xfe\xff") {
            return Err("it is UTF-16; save it as UTF-8");
        }
        if text.iter().take(4).any(|&byte| byte == 0) {
            return Err("it is UTF-16 or no text at all; save it as UTF-8");
        }
        Ok(Self { rest: text, line: 0 })
    }

    /// Ends with LF, CR or both.
    fn line(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.iter().position(|byte| b"\r\n".contains(byte)).unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at(end);
        self.rest = rest.strip_prefix(b"\r\n").unwrap_or(rest.get(1..).unwrap_or_default());
        self.line += 1;
        Some(line)
    }
}

impl<'a> Iterator for Statements<'a> {
    type Item = Statement<'a>;

    /// Empty lines are empty statements.
    fn next(&mut self) -> Option<Statement<'a>> {
        let line = self.line()?;
        let begins = self.line;
        let names = NAMING.contains(&split(line.trim_ascii()).0);
        let (part, mut goes_on) = content(line, names);
        let mut text = Cow::Borrowed(part);
        while goes_on && let Some(line) = self.line() {
            let (part, further) = content(line, names);
            text.to_mut().push(b' ');
            text.to_mut().extend_from_slice(part);
            goes_on = further;
        }
        Some(Statement { line: begins, text })
    }
}

impl Statement<'_> {
    /// The word that says what it is, and the rest.
    pub(super) fn parts(&self) -> (&[u8], &[u8]) {
        split(self.text.trim_ascii())
    }
}

/// A line without its comment, and whether it goes on in the next one. In names a comment has blanks around
/// its `#`.
fn content(line: &[u8], names: bool) -> (&[u8], bool) {
    let is_blank = |byte: Option<&u8>| byte.is_none_or(u8::is_ascii_whitespace);
    let is_apart = |at: usize| {
        let before = at.checked_sub(1).and_then(|before| line.get(before));
        is_blank(before) && is_blank(line.get(at + 1))
    };
    let comment = (0..line.len()).find(|&at| line[at] == b'#' && (!names || is_apart(at)));
    let text = line[..comment.unwrap_or(line.len())].trim_ascii();
    match text.strip_suffix(b"\\") {
        Some(text) => (text.trim_ascii_end(), true),
        None => (text, false),
    }
}

/// The first word and the rest, for text without blanks before and behind it.
pub(super) fn split(text: &[u8]) -> (&[u8], &[u8]) {
    let end = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
    let (word, rest) = text.split_at(end);
    (word, rest.trim_ascii_start())
}

/// The words of a text.
pub(super) fn words(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// A number; it need not be finite.
pub(super) fn number(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// Names need not be UTF-8.
pub(super) fn name(text: &[u8]) -> String {
    String::from_utf8_lossy(text).into_owned()
}

/// Text of a file as it may stand in a message: short, and without control characters.
pub(super) fn shown(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(&text[..text.len().min(4 * MAX_SHOWN)]);
    let clean = |c: char| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c };
    let mut short: String = text.chars().take(MAX_SHOWN).map(clean).collect();
    if text.chars().nth(MAX_SHOWN).is_some() {
        short.push('…');
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    fn statements(text: &[u8]) -> Vec<(usize, String)> {
        let all = Statements::new(text).unwrap().map(|statement| {
            let (word, rest) = statement.parts();
            (statement.line, format!("{}|{}", name(word), name(rest)))
        });
        all.filter(|(_, text)| text != "|").collect()
    }

    #[test]
    fn lines_end_in_any_way_and_may_go_on() {
        let expected = [(1, "v|1 2 3"), (4, "f|1 2 3"), (6, "o|a b")].map(|(line, s)| (line, s.to_owned()));
        for end in ["\n", "\r\n", "\r"] {
            let text = ["v 1 2 3", "", "# x \\", "\tf 1 2 \\", " 3", "o  a b  ", "# \\"].join(end);
            assert_eq!(statements(text.as_bytes()), expected, "{end:?}");
            assert_eq!(statements(format!("\u{feff}{text}{end}").as_bytes()), expected, "{end:?}");
        }
        assert_eq!(statements(b"f 1 \\"), [(1, "f|1".to_owned())], "the end of the file ends everything");
    }

    #[test]
    fn comments_begin_anywhere_but_inside_of_names() {
        let words = |text: &str| statements(text.as_bytes()).pop().map(|(_, text)| text);
        for (text, expected) in [
            ("f 1 2 3 # quad", "f|1 2 3"),
            ("f 1 2 3#4", "f|1 2 3"),
            ("f 1 \\ # goes on\n2 # 3", "f|1 2"),
            ("usemtl Material #25", "usemtl|Material #25"),
            ("usemtl C# # loud", "usemtl|C#"),
        ] {
            assert_eq!(words(text).as_deref(), Some(expected), "{text}");
        }
        assert_eq!(words("# f 1 2 3"), None);
    }

    #[test]
    fn what_is_not_utf_8_is_refused_by_name() {
        for text in [&b"\xff\xfev\0 \0"[..], b"\xfe\xff\0v\0 ", b"v\0 \0\n\0"] {
            assert!(Statements::new(text).is_err_and(|reason| reason.contains("UTF-16")));
        }
        assert!(Statements::new(b"").is_ok());
    }

    #[test]
    fn text_in_messages_is_short_and_harmless() {
        assert_eq!(shown(b"a\x1b[31m"), "a\u{fffd}[31m");
        assert_eq!(shown(&[b'x'; 1000]), format!("{}…", "x".repeat(40)));
    }
}
