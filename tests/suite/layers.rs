//! The layers of ARCHITECTURE.md: imports go downwards only, and siblings do not import each other.

use std::fs;
use std::path::{Path, PathBuf};

/// The modules of the crate, lowest first; those on one line are siblings.
const LAYERS: &[&[&str]] = &[
    &["error"],
    &["scene"],
    &["visibility"],
    &["march"],
    &["operator"],
    &["solve", "cpu", "gpu", "sparse", "io"],
    &["problem"],
    &["report"],
    &["job"],
    &["lab"],
    &["lib", "cli", "main"],
];

fn layer(module: &str) -> usize {
    LAYERS
        .iter()
        .position(|layer| layer.contains(&module))
        .unwrap_or_else(|| panic!("module `{module}` stands in no layer"))
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

/// The modules of the crate that a line names by `crate::name`; items at the root come from `error`.
fn named(line: &str) -> impl Iterator<Item = String> + '_ {
    line.match_indices("crate::")
        .filter(|(at, _)| !line[..*at].ends_with(|c: char| c.is_alphanumeric() || c == '_'))
        .flat_map(|(at, _)| {
            let rest = &line[at + "crate::".len()..];
            let names: Vec<&str> = match rest.strip_prefix('{') {
                Some(group) => group.split(',').collect(),
                None => vec![rest],
            };
            names
                .into_iter()
                .map(|name| {
                    name.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>()
                })
                .collect::<Vec<_>>()
        })
}

fn violations(module: &str, text: &str) -> Vec<String> {
    let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    let mut found = Vec::new();
    for line in code {
        for name in named(line) {
            let name = if name.starts_with(char::is_uppercase) { "error".to_owned() } else { name };
            if name.is_empty() || name == module {
                continue;
            }
            if layer(&name) >= layer(module) {
                found.push(format!("{module} imports {name}: {}", line.trim()));
            }
        }
    }
    found
}

#[test]
fn imports_go_downwards_only() {
    let root = crate::root().join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    assert!(files.len() > 20);
    let mut found = Vec::new();
    for file in files {
        let relative = file.strip_prefix(&root).unwrap();
        let first = relative.components().next().unwrap().as_os_str().to_string_lossy().into_owned();
        let module = first.trim_end_matches(".rs");
        if layer(module) < LAYERS.len() - 1 {
            found.extend(violations(module, &fs::read_to_string(&file).unwrap()));
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn an_upward_import_is_noticed() {
    assert_eq!(violations("scene", "use crate::{Error, Result};\nuse crate::march::Real;").len(), 1);
    assert_eq!(violations("scene", "use crate::visibility::Geometry;").len(), 1);
    assert_eq!(violations("march", "use crate::visibility::ShadowMap;").len(), 0);
    assert_eq!(violations("cpu", "let x = crate::solve::Cgls::new();").len(), 1);
    assert_eq!(violations("problem", "use crate::cpu;\n// crate::report is above").len(), 0);
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
