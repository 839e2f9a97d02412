//! Names of other files in a document.

use std::borrow::Cow;
use std::fmt;
use std::path::{Component, Path, PathBuf, is_separator};

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use crate::io::input;
use crate::{Error, Result};

/// What the schema calls the format of a string that names a file. Resolved documents find file names by it.
pub(super) const FORMAT: &str = "file";

/// A file that a document names, relative to the scene file or absolute.
///
/// `Assets` reads nothing that has not this type, so no field of a document can name a file without it.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct FileName(String);

impl<T: Into<String>> From<T> for FileName {
    fn from(name: T) -> Self {
        Self(name.into())
    }
}

impl fmt::Display for FileName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl JsonSchema for FileName {
    fn schema_name() -> Cow<'static, str> {
        "FileName".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A file, relative to the scene file or absolute.", "type": "string", "format": FORMAT
        })
    }
}

/// The folder that the names in a scene file are relative to: its own; of a pipe the current one.
pub(super) fn folder_of(scene_file: &Path) -> PathBuf {
    let own = scene_file.parent().filter(|_| !input::is_stream(scene_file));
    own.map(Path::to_owned).unwrap_or_default()
}

impl FileName {
    /// Where the file is, when the scene file lies in `folder`.
    ///
    /// Errors: [`Error::Value`] for an empty name or an address in the network.
    pub(super) fn in_folder(&self, folder: &Path) -> Result<PathBuf> {
        input::named(folder, &self.0)
    }

    /// Whether it stands for many files, with a run of `#` for the number.
    pub(super) fn is_numbered(&self) -> bool {
        self.number_begins().is_some()
    }

    /// The file with a number for the first run of `#`.
    pub(super) fn numbered(&self, number: usize) -> Self {
        let Some(at) = self.number_begins() else { return self.clone() };
        let (before, rest) = self.0.split_at(at);
        let after = rest.trim_start_matches('#');
        // More digits than a number has are no names of files.
        let digits = (rest.len() - after.len()).min(20);
        Self(format!("{before}{number:0digits$}{after}"))
    }

    /// Folders may be called what they like: `#` counts in the file's own name alone.
    fn number_begins(&self) -> Option<usize> {
        let own = self.0.rfind(is_separator).map_or(0, |separator| separator + 1);
        self.0[own..].find('#').map(|at| own + at)
    }

    /// The same file for a document in `to`, when this name stands in a document in `from`; both are absolute, and exist.
    ///
    /// The name is relative, with `/` between its parts, where both folders have a folder in common that is not the root, so that
    /// scene and results can be moved together. Else it is absolute.
    ///
    /// Errors: [`Error::Value`] for a name that is no Unicode, which JSON cannot hold.
    pub(super) fn moved(&self, from: &Path, to: &Path) -> Result<Self> {
        let file = self.in_folder(from)?;
        if Path::new(&self.0).has_root() {
            return Ok(self.clone());
        }
        let name = relative(from, &self.0, to).or_else(|| Some(file.to_str()?.to_owned()));
        let name = name.ok_or_else(|| Error::value("", file.display(), "a name in Unicode"))?;
        Ok(Self(name))
    }
}

/// The name, relative to `to`; none where that would lead through the root, or is no Unicode.
fn relative(from: &Path, name: &str, to: &Path) -> Option<String> {
    // Without symbolic links, for `..` leads to the folder above the one that a link points to.
    let (mut from, to) = (from.canonicalize().ok()?, to.canonicalize().ok()?);
    let mut below = Path::new(name).components().peekable();
    while let Some(up) = below.next_if(|part| matches!(part, Component::ParentDir | Component::CurDir)) {
        if up == Component::ParentDir {
            from.pop();
        }
    }
    let common = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    if !from.components().take(common).any(|part| matches!(part, Component::Normal(_))) {
        return None;
    }
    let up = to.components().skip(common).map(|_| Component::ParentDir);
    let parts = up.chain(from.components().skip(common)).chain(below);
    let parts: Option<Vec<&str>> = parts.map(|part| part.as_os_str().to_str()).collect();
    Some(parts?.join("/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moved_name_is_the_same_file() {
        let desk = tempfile::tempdir().unwrap();
        let at = |name: &str| desk.path().join(name);
        for folder in ["scenes/hall", "art/walls", "out/hall", "elsewhere"] {
            std::fs::create_dir_all(at(folder)).unwrap();
        }
        for file in ["scenes/hall/a.png", "scenes/b.png", "art/walls/c.png"] {
            std::fs::write(at(file), file).unwrap();
        }
        let absolute = at("art/walls/c.png").to_str().unwrap().to_owned();
        let mut rows = vec![
            ("scenes/hall", "a.png", "out/hall", "../../scenes/hall/a.png"),
            ("scenes/hall", "./a.png", "scenes/hall", "a.png"),
            ("scenes/hall", "../b.png", "scenes", "b.png"),
            ("scenes/hall", "../../art/walls/c.png", "out/hall", "../../art/walls/c.png"),
            ("scenes/hall", "../.././art/../art/walls/c.png", "out/hall", "../../art/../art/walls/c.png"),
            ("scenes/hall", &absolute, "out/hall", &absolute),
        ];
        #[cfg(unix)]
        {
            // `..` leads out of where a link points to, and not to where it stands.
            std::os::unix::fs::symlink(at("scenes/hall"), at("elsewhere/link")).unwrap();
            std::os::unix::fs::symlink(at("out/hall"), at("link")).unwrap();
            rows.push(("elsewhere/link", "../b.png", "link", "../../scenes/b.png"));
        }
        for (from, name, to, expected) in rows {
            let (from, to) = (at(from), at(to));
            let moved = FileName::from(name).moved(&from, &to).unwrap();
            assert_eq!(moved.to_string(), expected);
            let file =
                |folder: &Path, name: &FileName| name.in_folder(folder).unwrap().canonicalize().unwrap();
            assert_eq!(file(&to, &moved), file(&from, &FileName::from(name)));
        }
        // Where nothing but the root is common, and where nobody knows, a name is absolute.
        for to in ["/", "/no/such/folder"] {
            let moved = FileName::from("a.png").moved(&at("scenes/hall"), Path::new(to)).unwrap();
            assert_eq!(Path::new(&moved.to_string()), at("scenes/hall/a.png"));
        }
        assert!(FileName::from("").moved(desk.path(), desk.path()).is_err());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_name_that_is_no_unicode_is_refused() {
        use std::os::unix::ffi::OsStrExt;
        let desk = tempfile::tempdir().unwrap();
        let strange = desk.path().join(std::ffi::OsStr::from_bytes(b"\xff"));
        let below = strange.join("out");
        std::fs::create_dir_all(&below).unwrap();
        assert_eq!(FileName::from("a.png").moved(&strange, &below).unwrap().to_string(), "../a.png");
        assert!(FileName::from("a.png").moved(&strange, desk.path()).is_err());
    }

    #[test]
    fn numbers_stand_in_the_own_name_of_a_file() {
        let numbered = |name: &str| FileName::from(name).numbered(7).to_string();
        assert_eq!(numbered("smoke_###.vdb"), "smoke_007.vdb");
        assert_eq!(numbered("c#/smoke_##_#.vdb"), "c#/smoke_07_#.vdb");
        assert_eq!(numbered("c#/smoke.vdb"), "c#/smoke.vdb");
        assert!(FileName::from("smoke_#.vdb").is_numbered() && !FileName::from("c#/smoke.vdb").is_numbered());
    }
}
