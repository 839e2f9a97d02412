//! The file itself: JSON, binary chunk, external files and data URIs.

use std::path::{Path, PathBuf};

use base64::Engine;
use gltf_json::root::Get;
use gltf_json::{Index, Root};

use crate::io::whole_file;
use crate::{Error, Result};

/// Extensions that a file may require: known here, or without influence on shape, albedo and alpha.
const EXTENSIONS: [&str; 13] = [
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_materials_unlit",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_emissive_strength",
    "KHR_materials_clearcoat",
    "KHR_materials_sheen",
    "KHR_materials_anisotropy",
    "KHR_materials_iridescence",
    "KHR_materials_dispersion",
    "KHR_materials_variants",
];

/// A parsed file with its buffers. Nothing in it has been checked: indices go through [`GltfFile::get`].
#[derive(Debug)]
pub(super) struct GltfFile {
    pub(super) path: PathBuf,
    pub(super) root: Root,
    pub(super) buffers: Vec<Vec<u8>>,
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
        let bytes = whole_file::read(path)?;
        let mut gltf = Self { path: path.into(), root: Root::default(), buffers: Vec::new() };
        let mut blob = None;
        gltf.root = if bytes.starts_with(b"glTF") {
            let (json, binary) = chunks(&bytes).map_err(|problem| gltf.broken(problem))?;
            blob = binary.map(<[u8]>::to_vec);
            gltf.parse(json)?
        } else {
            gltf.parse(&bytes)?
        };
        gltf.check_header()?;
        gltf.read_buffers(blob)?;
        Ok(gltf)
    }

    fn parse(&self, json: &[u8]) -> Result<Root> {
        Root::from_slice(json).map_err(|error| self.broken(error.to_string()))
    }

    fn check_header(&self) -> Result<()> {
        let version = &self.root.asset.version;
        if !version.starts_with("2.") {
            return Err(self.broken(format!("its version is {version}; 2.0 is needed")));
        }
        let required = &self.root.extensions_required;
        match required.iter().find(|name| !EXTENSIONS.contains(&name.as_str())) {
            Some(name) => Err(self.broken(format!(
                "it requires the extension {name}, which is not supported; export it without (no mesh or texture \
                 compression)"
            ))),
            None => Ok(()),
        }
    }

    fn read_buffers(&mut self, mut blob: Option<Vec<u8>>) -> Result<()> {
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
        let literal = folder.join(uri);
        // Some exporters do not escape names: a file that is called just so comes first.
        whole_file::read(&if literal.is_file() { literal } else { folder.join(unescaped(uri)) })
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

    pub(super) fn broken(&self, reason: String) -> Error {
        Error::Format { path: self.path.clone(), format: "glTF", reason }
    }
}

/// With %20 and the like replaced by what they stand for.
fn unescaped(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let digits = (first == b'%').then(|| after.get(..2)).flatten();
        let digits = digits.filter(|digits| digits.iter().all(u8::is_ascii_hexdigit));
        let code = digits.and_then(|d| u8::from_str_radix(std::str::from_utf8(d).ok()?, 16).ok());
        bytes.push(code.unwrap_or(first));
        rest = if code.is_some() { &after[2..] } else { after };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}
