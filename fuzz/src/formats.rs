//! Each format that people hand in, and what reads it. `tests/suite/corpus.rs` includes this file.

use std::path::{Path, PathBuf};

use unscatter::io::gltf::GltfScene;
use unscatter::io::{self, image, npy, obj, scene_file, transforms, volume};
use unscatter::{Error, Result};

/// Of the checkpoints in the corpus.
pub const FINGERPRINT: u64 = 0x0123_4567_89ab_cdef;

/// Triangles of a mesh at most.
const TRIANGLES: usize = 1_000_000;

/// Bytes of a volume at most.
const VOLUME: u64 = 64 << 20;

/// What scenes may take: enough for those of the corpus.
const MEMORY: &str = "solve.memory=\"64MiB\"";

/// A kind of file. Its corpus is `corpus/NAME`; files that are there while it is read are in `beside/NAME`.
pub struct Format {
    pub name: &'static str,
    /// What its files are called. A file of another kind that names it is in `beside`.
    pub file: &'static str,
    read: fn(&Path) -> Result<()>,
}

pub const FORMATS: &[Format] = &[
    row("animation", "a.json", |path| scene_file::load_animation(path, &[MEMORY.into()]).map(drop)),
    row("checkpoint", "a.checkpoint", |path| io::Checkpoint::read(path, FINGERPRINT).map(drop)),
    row("exr", "a.exr", picture),
    row("glb", "a.glb", gltf),
    row("gltf", "a.gltf", gltf),
    row("hdr", "a.hdr", picture),
    row("jpeg", "a.jpg", picture),
    row("mtl", "a.mtl", |path| obj::load(&path.with_extension("obj"), TRIANGLES).map(drop)),
    row("npy", "a.npy", |path| npy::read_f32(path).map(drop).or(grids(path))),
    row("npz", "a.npz", grids),
    row("obj", "a.obj", |path| obj::load(path, TRIANGLES).map(drop)),
    row("png", "a.png", picture),
    row("raw", "a.json", grids),
    row("scene", "a.json", |path| scene_file::load(path, &[MEMORY.into()]).map(drop)),
    row("transforms", "a.json", |path| transforms::read(path).map(drop)),
    row("vdb", "a.vdb", grids),
    row("vol", "a.vol", grids),
    row("volume", "a.json", |path| scene_file::load_volume(path, &[MEMORY.into()]).map(drop)),
];

const fn row(name: &'static str, file: &'static str, read: fn(&Path) -> Result<()>) -> Format {
    Format { name, file, read }
}

fn picture(path: &Path) -> Result<()> {
    let (plain, target) = (image::read_image(path), image::read_target(path, None));
    assert!(
        image::size_of(path).is_ok() || plain.is_err() && target.is_err(),
        "a picture without a size was read"
    );
    plain.map(drop).or(target.map(drop))
}

fn grids(path: &Path) -> Result<()> {
    let too_large = |bytes: u64| Error::TooLarge {
        what: "a volume".to_owned(),
        needed: format!("{bytes} bytes"),
        limit: format!("{VOLUME}"),
        remedy: "",
    };
    let allow = |bytes: u64| if bytes > VOLUME { Err(too_large(bytes)) } else { Ok(()) };
    volume::read_within(path, None, &allow).map(drop)
}

fn gltf(path: &Path) -> Result<()> {
    let scene = GltfScene::load(path)?;
    let (_sun, _camera) = (scene.sun(None), scene.camera("Camera"));
    scene.mesh(None, TRIANGLES).map(drop)
}

/// Reads bytes as one format, in a folder of its own.
pub struct Reader {
    pub format: &'static Format,
    _folder: tempfile::TempDir,
    path: PathBuf,
}

impl Reader {
    /// The folder is in memory where the system has one that is.
    pub fn new(name: &str) -> Self {
        let format = FORMATS.iter().find(|format| format.name == name).expect("a format that there is");
        let shared = Path::new("/dev/shm");
        let place = if shared.is_dir() { shared.to_owned() } else { std::env::temp_dir() };
        let folder = tempfile::tempdir_in(place).expect("a folder");
        for file in files(&root().join("beside").join(name)) {
            std::fs::copy(&file, folder.path().join(file.file_name().unwrap_or_default())).expect("a copy");
        }
        Self { format, path: folder.path().join(format.file), _folder: folder }
    }

    /// Reads bytes, and forgets what was read.
    pub fn read(&self, bytes: &[u8]) -> Result<()> {
        std::fs::write(&self.path, bytes).expect("a file");
        (self.format.read)(&self.path)
    }
}

/// Of the crate of the fuzzers.
pub fn root() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    if root.ends_with("fuzz") { root.to_owned() } else { root.join("fuzz") }
}

/// The files in a folder by name; none where there is no folder.
pub fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<_> = entries.map(|entry| entry.path()).filter(|path| path.is_file()).collect();
    files.sort();
    files
}
