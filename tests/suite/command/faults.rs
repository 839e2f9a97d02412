//! Every file operation of a run fails once, one run after the other, as on a disk that has just become full.
//!
//! Needs a C compiler.
#![cfg(target_os = "linux")]

use std::path::PathBuf;
use std::process::Command;

use tempfile::TempDir;

use super::{Desk, Ran};

/// The library that `LD_PRELOAD` puts before the system's.
struct Faults {
    library: PathBuf,
    _built: TempDir,
}

impl Faults {
    fn new() -> Self {
        let built = tempfile::tempdir().unwrap();
        let library = built.path().join("faulty_files.so");
        let mut compiler = Command::new("cc");
        compiler.args(["-shared", "-fPIC", "-o"]).arg(&library);
        compiler.arg(crate::root().join("tests/faulty_files.c")).arg("-ldl");
        assert!(compiler.status().unwrap().success());
        Self { library, _built: built }
    }

    /// A run whose operation of this number on a file below `out` fails; and whether there was one.
    fn run(&self, desk: &Desk, arguments: &[&str], at: usize) -> (Ran, bool) {
        let hit = desk.path("hit");
        _ = std::fs::remove_file(&hit);
        let output = Command::new(crate::program())
            .current_dir(desk.path("."))
            .args(arguments)
            .env("LD_PRELOAD", &self.library)
            .env("FAULTY_FOLDER", desk.path(".").canonicalize().unwrap().join("out"))
            .env("FAULTY_AT", at.to_string())
            // No space left on device.
            .env("FAULTY_ERROR", "28")
            .env("FAULTY_HIT", &hit)
            .output()
            .unwrap();
        (Ran::of(arguments, &output), hit.is_file())
    }
}

/// The results, without what has seconds in it and what is tidied up.
fn results(desk: &Desk) -> Vec<(String, Vec<u8>)> {
    let mut files = desk.files("out");
    let is_other =
        |name: &str| ["report.", "checkpoint", ".unscatter-"].iter().any(|begin| name.starts_with(begin));
    files.retain(|(name, _)| !is_other(name));
    files
}

/// Fails every `step`th operation of a command in turn; gives back how many failed, and how many of them changed nothing.
fn fails_in_turn(arguments: &[&str], step: usize) -> [usize; 2] {
    let (desk, faults) = (Desk::new(), Faults::new());
    desk.done(arguments);
    let new = results(&desk);
    let other = [arguments, &["--set", "light.radiance=3"]].concat();
    let (mut failed, mut harmless) = (0, 0);
    for at in (1..).step_by(step) {
        desk.done(&other);
        let old = results(&desk);
        assert!(old != new);
        let (ran, is_hit) = faults.run(&desk, arguments, at);
        if !is_hit {
            ran.exits_with(0);
            assert!(results(&desk) == new);
            return [failed, harmless];
        }
        assert!(!ran.err.contains("panicked"), "operation {at} of {arguments:?}: {}", ran.err);
        failed += 1;
        if ran.code == Some(0) {
            // What is tidied up, or kept to go on from, may stay behind.
            harmless += 1;
            assert!(results(&desk) == new, "operation {at} of {arguments:?}");
        } else {
            ran.exits_with(3).tells("No space left");
            let found = results(&desk);
            assert!(
                found == old || found == new,
                "operation {at} of {arguments:?} leaves results of two runs"
            );
        }
        desk.done(arguments);
        assert!(results(&desk) == new, "operation {at} of {arguments:?}");
        let left = std::fs::read_dir(desk.path("out")).unwrap().map(|entry| entry.unwrap().file_name());
        let left: Vec<_> = left
            .filter(|name| name.to_string_lossy().starts_with(".unscatter-") && name != ".unscatter-results")
            .collect();
        assert!(left.is_empty(), "operation {at} of {arguments:?} leaves {left:?}");
    }
    unreachable!()
}

#[test]
fn a_file_operation_that_fails_leaves_old_results_or_new_ones_and_says_so() {
    for (arguments, step, least) in [
        (&["light-map", "scene.json", "-q", "-o", "out", "--preview-every", "5"][..], 5, 20),
        (&["render", "scene.json", "-q", "-o", "out"], 1, 30),
        (&["matrix", "scene.json", "-q", "-o", "out"], 1, 30),
    ] {
        let [failed, harmless] = fails_in_turn(arguments, step);
        assert!(failed >= least && harmless < failed / 3, "{arguments:?}: {harmless} of {failed} harmless");
    }
}
