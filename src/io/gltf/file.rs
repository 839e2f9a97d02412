//! The file itself: JSON, binary chunk, external files and data URIs.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use base64::Engine;
use gltf_json::root::Get;
use gltf_json::{Index, Root};
use serde_json::Value;

use super::{extensions, unread};
use crate::io::input;
use crate::{Error, Result, Warning};

/// Neither a single file nor all buffers together are read beyond this many bytes.
const MAX_FILE: u64 = 1 << 32;

/// What to do about a larger one.
const SPLIT: &str = "split the scene";

/// A parsed file with its buffers. Nothing in it has been checked: indices go through [`GltfFile::get`].
#[derive(Debug)]
pub(super) struct GltfFile {
    pub(super) path: PathBuf,
    pub(super) root: Root,
    pub(super) buffers: Vec<Vec<u8>>,
    /// What was said already about what is left out.
    warnings: Mutex<Vec<String>>,
}

/// The JSON chunk of a binary container, and the binary chunk where there is one; chunks of other kinds are skipped
/// (glTF 2.0, "GLB File Format").
///
/// Errors: what is wrong with it, in words.
fn chunks(bytes: &[u8]) -> std::result::Result<(&[u8], Option<&[u8]>), String> {
    let word = |bytes: &[u8], at: usize| {
        let bytes = bytes.get(at..at + 4).and_then(|word| <[u8; 4]>::try_from(word).ok());
        bytes.map(u32::from_le_bytes)
    };
    let (Some(version), Some(length)) = (word(bytes, 4), word(bytes, 8)) else {
        return Err("its header is truncated".to_owned());
    };
    if version != 2 {
        return Err(format!("its container is of version {version}; 2 is needed"));
    }
    let Some(mut rest) = bytes.get(..length as usize).and_then(|all| all.get(12..)) else {
        return Err(format!("its header says {length} bytes, and it has {}", bytes.len()));
    };
    let mut found = [None; 2];
    while let (Some(length), Some(kind)) = (word(rest, 0), word(rest, 4)) {
        let Some(chunk) = rest[8..].get(..length as usize) else {
            return Err("it ends inside a chunk".to_owned());
        };
        if let Some(place) = [*b"JSON", *b"BIN\0"].iter().position(|name| u32::from_le_bytes(*name) == kind) {
            found[place].get_or_insert(chunk);
        }
        rest = &rest[8 + chunk.len()..];
    }
    match found {
        [Some(json), binary] => Ok((json, binary)),
        [None, _] => Err("it has no JSON chunk".to_owned()),
    }
}

impl GltfFile {
    pub(super) fn load(path: &Path) -> Result<Self> {
        let bytes = read_file(path)?;
        let mut gltf = Self {
            path: path.into(),
            root: Root::default(),
            buffers: Vec::new(),
            warnings: Mutex::default(),
        };
        let mut blob = None;
        gltf.root = if bytes.starts_with(b"glTF") {
            let (json, binary) = chunks(&bytes).map_err(|problem| gltf.broken(problem))?;
            blob = binary.map(<[u8]>::to_vec);
            gltf.parse(json)?
        } else {
            let text = input::decoded(&bytes).map_err(|error| gltf.broken(error.to_string()))?;
            gltf.parse(text.as_bytes())?
        };
        gltf.check_version()?;
        let missed = extensions::missed(&gltf.root.extensions_used, &gltf.root.extensions_required);
        missed.map_err(|problem| gltf.broken(problem))?.into_iter().for_each(|what| gltf.warn(what));
        gltf.read_buffers(blob)?;
        Ok(gltf)
    }

    fn parse(&self, json: &[u8]) -> Result<Root> {
        let mut value: Value =
            serde_json::from_slice(json).map_err(|error| self.broken(error.to_string()))?;
        unread::remove(&mut value);
        serde_path_to_error::deserialize(value).map_err(|error| self.broken(error.to_string()))
    }

    fn check_version(&self) -> Result<()> {
        let version = &self.root.asset.version;
        if version.starts_with("2.") {
            return Ok(());
        }
        Err(self.broken(format!("its version is {version}; 2.0 is needed")))
    }

    fn read_buffers(&mut self, mut blob: Option<Vec<u8>>) -> Result<()> {
        let mut total = 0;
        for (index, buffer) in self.root.buffers.iter().enumerate() {
            let bytes = match &buffer.uri {
                Some(uri) => self.read_uri(uri)?,
                None if index == 0 => {
                    blob.take().ok_or_else(|| self.broken("its binary chunk is missing".into()))?
                }
                None => return Err(self.broken(format!("buffer {index} has no data"))),
            };
            if (bytes.len() as u64) < buffer.byte_length.0 {
                let (got, needed) = (bytes.len(), buffer.byte_length.0);
                return Err(self.broken(format!("buffer {index} has {got} bytes instead of {needed}")));
            }
            total += bytes.len() as u64;
            if total > MAX_FILE {
                return Err(too_large(&self.path, total));
            }
            self.buffers.push(bytes);
        }
        Ok(())
    }

    /// The content of a data URI or of a file beside this one.
    pub(super) fn read_uri(&self, uri: &str) -> Result<Vec<u8>> {
        if let Some(data) = uri.strip_prefix("data:") {
            let encoded = data.split_once(";base64,").map(|(_, encoded)| encoded);
            let encoded = encoded.ok_or_else(|| self.broken("a data URI is not base64".into()))?;
            let engine = base64::engine::general_purpose::GeneralPurpose::new(
                &base64::alphabet::STANDARD,
                base64::engine::GeneralPurposeConfig::new()
                    .with_decode_padding_mode(base64::engine::DecodePaddingMode::Indifferent),
            );
            return engine.decode(encoded).map_err(|error| self.broken(format!("a data URI: {error}")));
        }
        if uri.contains("://") {
            return Err(self.broken(format!("it refers to {uri}; only files beside it are read")));
        }
        let folder = self.path.parent().unwrap_or(Path::new(""));
        read_file(&input::named(folder, uri)?)
    }

    /// The bytes of a buffer view.
    pub(super) fn view(&self, index: Index<gltf_json::buffer::View>) -> Result<&[u8]> {
        let view = self.get(index).ok_or_else(|| self.broken(format!("buffer view {index} is missing")))?;
        let start = usize::try_from(view.byte_offset.unwrap_or_default().0).ok();
        let length = usize::try_from(view.byte_length.0).ok();
        let bytes = self
            .buffers
            .get(view.buffer.value())
            .zip(start)
            .zip(length)
            .and_then(|((buffer, start), length)| buffer.get(start..start.checked_add(length)?));
        bytes.ok_or_else(|| self.broken(format!("buffer view {index} lies outside of its buffer")))
    }

    pub(super) fn get<T>(&self, index: Index<T>) -> Option<&T>
    where
        Root: Get<T>,
    {
        self.root.get(index)
    }

    /// Says, once, what of the file is left out or means something else here.
    pub(super) fn warn(&self, what: String) {
        let mut said = self.warnings.lock().unwrap_or_else(PoisonError::into_inner);
        if !said.contains(&what) {
            Warning::new("ignored", format!("{}: {what}", self.path.display()), "").tell();
            said.push(what);
        }
    }

    #[cfg(test)]
    pub(super) fn warnings(&self) -> Vec<String> {
        self.warnings.lock().unwrap().clone()
    }

    pub(super) fn broken(&self, reason: String) -> Error {
        Error::Format { path: self.path.clone(), format: "glTF", reason }
    }
}

fn read_file(path: &Path) -> Result<Vec<u8>> {
    input::bytes(path, MAX_FILE, SPLIT)
}

fn too_large(path: &Path, bytes: u64) -> Error {
    Error::TooLarge {
        what: path.display().to_string(),
        needed: format!("{bytes} bytes"),
        limit: format!("{MAX_FILE}"),
        remedy: SPLIT,
    }
}
