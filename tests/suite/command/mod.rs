//! The command as a person uses it: real files in, real files out, exit code and message.

mod bad_input;
mod bench;
#[cfg(feature = "gpu")]
mod driver;
mod faults;
#[cfg(feature = "gpu")]
mod gpu;
mod interrupt;
mod light_animation;
mod light_map;
mod matrix;
mod nothing_lost;
mod other_commands;
mod pictures;
mod pipes;
mod resolved;
mod skipping;
mod solving;
mod stress;
mod surroundings;
mod volume;
mod warnings;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::time::Duration;

use serde_json::{Value, json};
use tempfile::TempDir;

/// Nothing here takes a second; what takes this long hangs.
const PATIENCE: Duration = Duration::from_secs(60);

/// A folder with a scene in it, gone at the end.
pub struct Desk(TempDir);

impl Desk {
    /// With the [`scene`] in it.
    pub fn new() -> Self {
        Self::with(&scene())
    }

    pub fn with(scene: &Value) -> Self {
        let desk = Self(tempfile::tempdir().unwrap());
        desk.put("scene.json", serde_json::to_string_pretty(scene).unwrap());
        desk
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn put(&self, name: &str, bytes: impl AsRef<[u8]>) {
        fs::write(self.path(name), bytes).unwrap();
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&self.read(name)).unwrap()
    }

    /// Runs the program in this folder, where it finds no graphics adapter; relative paths are relative to it.
    pub fn run(&self, arguments: &[&str]) -> Ran {
        self.run_in(arguments, &[("VK_DRIVER_FILES", "none"), ("VK_ICD_FILENAMES", "none")])
    }

    /// Runs the program in this folder with these variables in its environment.
    pub fn run_in(&self, arguments: &[&str], variables: &[(&str, &str)]) -> Ran {
        let mut command = assert_cmd::Command::new(crate::program());
        command.current_dir(self.0.path()).args(arguments).envs(variables.iter().copied()).timeout(PATIENCE);
        Ran::of(arguments, &command.output().unwrap())
    }

    /// Runs the program, which must succeed.
    pub fn done(&self, arguments: &[&str]) -> Ran {
        self.run(arguments).exits_with(0)
    }

    /// The files of a folder, by name, with their content.
    pub fn files(&self, folder: &str) -> Vec<(String, Vec<u8>)> {
        files(&self.path(folder))
    }

    /// The names of those files.
    pub fn names(&self, folder: &str) -> Vec<String> {
        self.files(folder).into_iter().map(|(name, _)| name).collect()
    }
}

/// All files of a folder by name, but for what says which of them are results; none where there is no such folder.
pub fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap());
    let mut files: Vec<_> = entries
        .filter(|entry| entry.path().is_file() && entry.file_name() != ".unscatter-results")
        .map(|entry| (entry.file_name().into_string().unwrap(), fs::read(entry.path()).unwrap()))
        .collect();
    files.sort();
    files
}

/// How a run ended.
#[derive(Debug)]
pub struct Ran {
    pub arguments: String,
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

impl Ran {
    pub fn of(arguments: &[&str], output: &Output) -> Self {
        let ran = Self {
            arguments: arguments.join(" "),
            code: output.status.code(),
            out: String::from_utf8(output.stdout.clone()).unwrap(),
            err: String::from_utf8(output.stderr.clone()).unwrap(),
        };
        assert!(!ran.err.contains("panicked at"), "a panic: {ran:?}");
        ran
    }

    pub fn exits_with(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{self:#?}");
        self
    }

    /// Asserts that a person is told this; where the message breaks into lines does not matter.
    pub fn tells(self, words: &str) -> Self {
        let told = self.told();
        assert!(told.contains(words), "`{words}` is not in `{told}` of `{}`", self.arguments);
        self
    }

    /// Standard error without its frames and line breaks.
    pub fn told(&self) -> String {
        let plain = |line: &str| line.trim().trim_start_matches(['×', '│', ' ']).to_owned();
        let mut told = String::new();
        for line in self.err.lines().map(plain) {
            // A word that is too long for a line is broken without a space; the tests ask for words that fit.
            if !told.is_empty() {
                told.push(' ');
            }
            told.push_str(&line);
        }
        told
    }

    pub fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap_or_else(|error| panic!("{error} in {}", self.out))
    }
}

/// Two small views of a wall, a roof and a floor in light mist, painted in three colours that overlap.
pub fn scene() -> Value {
    json!({
        "version": 1,
        // What most laws are about is the plain problem; that of artists has tests of its own.
        "defaults": "paper",
        "light": { "direction": [0.3, -1.0, 0.2], "radiance": 4.0 },
        "medium": { "sigma_t": 0.08, "albedo": 0.9, "g": 0.3 },
        "occluders": [
            { "plane": { "center": [0, 4, 0], "sides": [[3, 0, 0], [0, 0, 8]] } },
            { "plane": { "center": [0, -1, 0], "sides": [[12, 0, 0], [0, 0, 12]] } },
            { "box": { "center": [2, 1, -1], "size": [1, 4, 1] } }
        ],
        "views": [
            {
                "name": "left",
                "camera": camera([-5.0, 1.5, 7.0]),
                "strokes": [
                    { "points": [[10, 8], [30, 20]], "radius": 4, "color": "#ff4020" },
                    { "points": [[40, 28]], "radius": 6, "opacity": 0.6, "color": [0.1, 0.4, 1.0] }
                ]
            },
            {
                "name": "right",
                "camera": camera([5.0, 2.0, 7.0]),
                "strokes": [{ "points": [[12, 10], [50, 24]], "radius": 5, "color": "#40ff30" }]
            }
        ],
        "light_map": { "size": 32 },
        "shadow_map": { "size": 64 },
        "solve": { "iterations": 12, "tolerance": 0.0 }
    })
}

fn camera(origin: [f64; 3]) -> Value {
    json!({
        "to_world": { "look_at": { "origin": origin, "target": [0.0, 1.5, 0.0] } },
        "fov": 45, "size": [64, 36]
    })
}

/// The scene with the value at a JSON pointer replaced, or made where there is none.
pub fn scene_with(pointer: &str, value: Value) -> Value {
    with(scene(), pointer, value)
}

fn with(mut scene: Value, pointer: &str, value: Value) -> Value {
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    match scene.pointer_mut(parent).unwrap() {
        Value::Object(object) => {
            object.insert(key.to_owned(), value);
        }
        Value::Array(array) => array[key.parse::<usize>().unwrap()] = value,
        other => panic!("{other} holds nothing"),
    }
    scene
}
