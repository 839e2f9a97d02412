//! The materials of an OBJ file, from the MTL files and pictures that it names.

use std::collections::hash_map::Entry;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::mtl::{self, Description, OpacityMap};
use super::statements::shown;
use crate::io::cutout::Cutoff;
use crate::io::{image, input};
use crate::scene::{AlphaMask, Material, Rgb, Wrap};
use crate::{Error, Result};

/// Of faces without a material, and of materials without a diffuse colour.
pub(super) const GREY: Rgb = [0.6; 3];

/// Bytes of one MTL file.
const MAX_LIBRARY: u64 = 1 << 28;

/// Bytes of all masks together.
const MAX_MASKS: usize = 1 << 30;

/// Names in one warning.
const MAX_NAMES: usize = 3;

/// Width, height and alpha of a picture.
type Cover = ([usize; 2], Vec<u8>);

/// A picture, and whether it is clamped at its edges.
type MaskKey = (PathBuf, bool);

/// What is known of materials so far.
#[derive(Debug)]
pub(super) struct Materials {
    obj: PathBuf,
    described: HashMap<String, Description>,
    libraries: HashSet<PathBuf>,
    covers: HashMap<PathBuf, Cover>,
    masks: HashMap<MaskKey, Option<Arc<AlphaMask>>>,
    bytes_of_masks: usize,
    missing_libraries: BTreeSet<String>,
    missing_pictures: BTreeSet<String>,
    unknown: BTreeSet<String>,
}

impl Materials {
    /// Of the OBJ file at this path; MTL files lie beside it.
    pub(super) fn of(obj: &Path) -> Self {
        Self {
            obj: obj.to_owned(),
            described: HashMap::new(),
            libraries: HashSet::new(),
            covers: HashMap::new(),
            masks: HashMap::new(),
            bytes_of_masks: 0,
            missing_libraries: BTreeSet::new(),
            missing_pictures: BTreeSet::new(),
            unknown: BTreeSet::new(),
        }
    }

    /// Reads what a `mtllib` statement names: one file, or several that end in `.mtl`. Of two materials of
    /// one name the later counts.
    pub(super) fn add_libraries(&mut self, names: &[u8]) {
        let folder = self.obj.parent().unwrap_or(Path::new("")).to_owned();
        let whole = mtl::beside(&folder, names);
        if whole.is_file() {
            return self.add_library(&whole, names);
        }
        for name in library_names(names) {
            self.add_library(&mtl::beside(&folder, name), name);
        }
    }

    fn add_library(&mut self, path: &Path, name: &[u8]) {
        // Whatever it is called, it is read once.
        if path.canonicalize().is_ok_and(|path| !self.libraries.insert(path)) {
            return;
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        match input::bytes(path, MAX_LIBRARY, "").ok().and_then(|bytes| mtl::parse(&bytes, folder).ok()) {
            Some(materials) => self.described.extend(materials),
            None => _ = self.missing_libraries.insert(shown(name)),
        }
    }

    /// What faces of a material are made of; none where it is nowhere. A picture cannot be placed on faces
    /// without texture coordinates.
    ///
    /// Errors: those of a picture that is there and cannot be read; [`Error::TooLarge`].
    pub(super) fn material(&mut self, name: &str, has_coordinates: bool) -> Result<Option<Material>> {
        let mut material = Material { name: None, albedo: GREY, mask: None, glass: None };
        let Some(description) = self.described.get(name) else {
            self.unknown.extend((!name.is_empty()).then(|| shown(name.as_bytes())));
            return Ok(Some(material));
        };
        material.name = Some(name.to_owned());
        material.albedo = description.albedo.unwrap_or(GREY);
        let glass = description.glass();
        if glass.at([0.0; 2]) == [1.0; 3] {
            return Ok(None);
        }
        material.glass = glass.colors().then_some(glass);
        if let Some(OpacityMap { file, wrap }) = description.opacity_map.as_ref().filter(|_| has_coordinates)
        {
            let (file, wrap) = (file.clone(), *wrap);
            material.mask = self.mask(&file, wrap)?;
        }
        Ok(Some(material))
    }

    fn mask(&mut self, file: &Path, wrap: Wrap) -> Result<Option<Arc<AlphaMask>>> {
        // Whatever it is called, it is decoded once.
        let Some(real) = file.canonicalize().ok().filter(|file| file.is_file()) else {
            let name = file.file_name().unwrap_or_default();
            self.missing_pictures.insert(shown(name.as_encoded_bytes()));
            return Ok(None);
        };
        let key = (real, wrap == Wrap::Clamp);
        if let Some(mask) = self.masks.get(&key) {
            return Ok(mask.clone());
        }
        let cover = match self.covers.entry(key.0.clone()) {
            Entry::Occupied(read) => read.into_mut(),
            Entry::Vacant(unread) => unread.insert(image::read_cover(file)?),
        };
        let (size, alpha) = cover;
        let mask = Cutoff::new(Cutoff::HALF, 1.0).mask(*size, alpha.iter().copied(), [wrap; 2]);
        self.bytes_of_masks += mask.as_ref().map_or(0, |_| alpha.len());
        if self.bytes_of_masks > MAX_MASKS {
            return Err(Error::TooLarge {
                what: format!("the opacity maps of {}", self.obj.display()),
                needed: format!("{} bytes or more", self.bytes_of_masks),
                limit: MAX_MASKS.to_string(),
                remedy: "use smaller pictures, or fewer materials with such a map",
            });
        }
        self.masks.insert(key, mask.clone());
        Ok(mask)
    }

    /// What was left out, in words.
    pub(super) fn warnings(&self) -> Vec<String> {
        let none = BTreeSet::new();
        // What a missing file would have described is no news.
        let unknown = if self.missing_libraries.is_empty() { &self.unknown } else { &none };
        let all = [
            (&self.missing_libraries, "the material file", "cannot be read; what it describes is grey"),
            (&self.missing_pictures, "the opacity map", "is not there; what has it is opaque"),
            (unknown, "the material", "is in no material file; what has it is grey"),
        ];
        let found = all.into_iter().filter(|(names, ..)| !names.is_empty());
        let warnings = found.map(|(names, what, outcome)| {
            let more = names.len().saturating_sub(MAX_NAMES);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            let names: Vec<_> = names.iter().take(MAX_NAMES).map(|name| format!("`{name}`")).collect();
            format!("{what} {}{more} {outcome}", names.join(", "))
        });
        warnings.collect()
    }
}

/// Names that end in `.mtl` and may have blanks in them.
fn library_names(text: &[u8]) -> Vec<&[u8]> {
    let mut names = Vec::new();
    let mut begin = 0;
    for end in 1..=text.len() {
        let is_over = text.get(end).is_none_or(u8::is_ascii_whitespace);
        let name = text[begin..end].trim_ascii();
        let suffix = name.last_chunk::<4>().is_some_and(|suffix| suffix.eq_ignore_ascii_case(b".mtl"));
        if end == text.len() || is_over && suffix {
            names.push(name);
            begin = end;
        }
    }
    names.retain(|name| !name.is_empty());
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_material_files_end_in_mtl_and_may_have_blanks() {
        let names = |text: &str| -> Vec<String> {
            let names = library_names(text.as_bytes());
            names.into_iter().map(|name| String::from_utf8(name.to_vec()).unwrap()).collect()
        };
        assert_eq!(names("a.mtl b c.MTL  d.mtl "), ["a.mtl", "b c.MTL", "d.mtl"]);
        assert_eq!(names("my file"), ["my file"]);
        assert_eq!(names("a.mtl.mtl b"), ["a.mtl.mtl", "b"]);
        assert_eq!(names(""), [""; 0]);
    }
}
