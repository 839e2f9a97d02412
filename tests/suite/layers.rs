//! The layers of ARCHITECTURE.md: imports go downwards only, and siblings do not import each other.

use std::fs;
use std::path::{Path, PathBuf};

/// Modules, lowest first; those on one line are siblings.
struct Layers {
    /// What a path to one of them begins with.
    prefix: &'static str,
    /// Where items come from that are named at the root of them.
    root: &'static str,
    modules: &'static [&'static [&'static str]],
}

const CRATE: Layers = Layers {
    prefix: "crate::",
    root: "error",
    modules: &[
        &["error", "simd", "warning"],
        &["scene"],
        &["visibility"],
        &["march"],
        &["operator"],
        &["solve", "cpu", "gpu", "sparse", "io"],
        &["problem"],
        &["report"],
        &["job"],
        &["lab", "studio"],
        &["lib", "cli", "main"],
    ],
};

const GPU: Layers = Layers {
    prefix: "crate::gpu::",
    root: "mod",
    modules: &[
        &["kernels"],
        &["device"],
        &["vectors"],
        &["operators"],
        &["surfaces", "known_answers"],
        &["mod"],
    ],
};

impl Layers {
    fn layer(&self, module: &str) -> usize {
        let layer = self.modules.iter().position(|layer| layer.contains(&module));
        layer.unwrap_or_else(|| panic!("module `{module}` stands in no layer"))
    }

    /// The modules that a line names.
    fn named(&self, line: &str) -> Vec<String> {
        let begins = line.match_indices(self.prefix);
        let begins =
            begins.filter(|(at, _)| !line[..*at].ends_with(|c: char| c.is_alphanumeric() || c == '_'));
        let of = |rest: &str| -> Vec<String> {
            let names: Vec<&str> =
                rest.strip_prefix('{').map_or(vec![rest], |group| group.split(',').collect());
            let name =
                |name: &str| name.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            names.into_iter().map(name).collect()
        };
        begins.flat_map(|(at, _)| of(&line[at + self.prefix.len()..])).collect()
    }

    fn violations(&self, module: &str, text: &str) -> Vec<String> {
        let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
        let mut found = Vec::new();
        for line in code {
            for name in self.named(line) {
                let name = if name.starts_with(char::is_uppercase) { self.root.to_owned() } else { name };
                if !name.is_empty() && name != module && self.layer(&name) >= self.layer(module) {
                    found.push(format!("{module} imports {name}: {}", line.trim()));
                }
            }
        }
        found
    }

    /// The violations of all files below a folder whose entries are the modules, but for those of the uppermost layer.
    fn violations_in(&self, folder: &Path) -> Vec<String> {
        let mut files = Vec::new();
        sources(folder, &mut files);
        assert!(files.len() > 20);
        let mut found = Vec::new();
        for file in files {
            let relative = file.strip_prefix(folder).unwrap();
            let first = relative.components().next().unwrap().as_os_str().to_string_lossy().into_owned();
            let module = first.trim_end_matches(".rs");
            if self.layer(module) < self.modules.len() - 1 {
                found.extend(self.violations(module, &fs::read_to_string(&file).unwrap()));
            }
        }
        found
    }
}

pub fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn imports_go_downwards_only() {
    let root = crate::root().join("src");
    let found = [CRATE.violations_in(&root), GPU.violations_in(&root.join("gpu"))].concat();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn an_upward_import_is_noticed() {
    let count = |module: &str, text: &str| CRATE.violations(module, text).len();
    assert_eq!(count("scene", "use crate::{Error, Result};\nuse crate::march::Real;"), 1);
    assert_eq!(count("scene", "use crate::visibility::Geometry;"), 1);
    assert_eq!(count("march", "use crate::visibility::ShadowMap;"), 0);
    assert_eq!(count("cpu", "let x = crate::solve::Cgls::new();"), 1);
    assert_eq!(count("problem", "use crate::cpu;\n// crate::report is above"), 0);
    assert_eq!(GPU.violations("device", "use crate::gpu::Gpu;").len(), 1);
    assert_eq!(GPU.violations("device", "use crate::gpu::vectors::GpuVector;").len(), 1);
    assert_eq!(
        GPU.violations("device", "use crate::gpu::kernels::Kernel;\nuse crate::operator::lock;").len(),
        0
    );
}

/// Words between quotation marks.
fn literals(text: &str) -> impl Iterator<Item = &str> {
    let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    code.flat_map(|line| line.split('"').skip(1).step_by(2))
}

#[test]
fn the_library_names_settings_and_the_command_says_which_flag_that_is() {
    let mut files = Vec::new();
    sources(&crate::root().join("src"), &mut files);
    let (command, library): (Vec<_>, Vec<_>) =
        files.iter().partition(|path| path.starts_with(crate::root().join("src/cli")));
    let read = |paths: &[&PathBuf]| -> String {
        paths.iter().map(|path| fs::read_to_string(path).unwrap()).collect()
    };
    let (command, library) = (read(&command), read(&library));
    let is_flag = |words: &&str| {
        let mut after = words.split("--").skip(1);
        // Variables of the report's style sheet begin like that, too.
        after.any(|word| word.starts_with(|c: char| c.is_ascii_lowercase()) && !word.starts_with("chart"))
    };
    let flags: Vec<&str> = literals(&library).filter(is_flag).collect();
    assert!(flags.is_empty(), "{flags:?}");
    // Every setting that the command translates is one that the library names.
    let table = command.split("const FLAGS").nth(1).unwrap().split("];").next().unwrap();
    let settings: Vec<&str> = literals(table).step_by(2).collect();
    assert!(settings.len() > 5);
    for setting in settings {
        assert!(library.contains(setting), "{setting}");
    }
}
