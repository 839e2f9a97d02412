//! The crates that the program is made of: their licences allow it, NOTICE names them, and none is there twice without a reason.
//!
//! `UPDATE_NOTICE=1 cargo test --test suite licences` writes NOTICE anew.

use std::collections::BTreeMap;
use std::process::Command;

/// Licences under which the program may be handed on with no more than its notices.
const ALLOWED: &[&str] = &[
    "0BSD",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "CC0-1.0",
    "ISC",
    "MIT",
    "MIT-0",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
];

/// Crates of which there are two versions, and what needs the older one.
const TWICE: &[(&str, &str)] = &[
    ("getrandom", "rand, for axum's sockets"),
    ("hashbrown", "gpu-allocator, for wgpu"),
    ("miniz_oxide", "exr and png"),
    ("r-efi", "getrandom"),
    ("syn", "macros of gltf-json, miette, tracing and windows"),
    ("unicode-width", "miette"),
];

const HEAD: &str =
    "unscatter is licensed under MIT or Apache-2.0, at your option (LICENSE-MIT, LICENSE-APACHE).

Its binary holds these crates, each under its own licence. Their texts are in the packages on crates.io.

";

/// Each crate, with all its features and on every platform: name, version and licence.
fn crates() -> Vec<[String; 3]> {
    let output = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--locked",
            "--all-features",
            "--edges",
            "normal",
            "--target",
            "all",
            "--prefix",
            "none",
        ])
        .args(["--format", "{p}|{l}"])
        .current_dir(crate::root())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let mut crates: Vec<[String; 3]> = text
        .lines()
        .filter(|line| !line.starts_with("unscatter "))
        .map(|line| {
            let (package, licence) = line.trim_end_matches(" (*)").split_once('|').unwrap();
            let mut words = package.split(' ');
            let (name, version) = (words.next().unwrap(), words.next().unwrap().trim_start_matches('v'));
            [name.to_owned(), version.to_owned(), licence.to_owned()]
        })
        .collect();
    crates.sort();
    crates.dedup();
    crates
}

/// Whether an SPDX expression, with `/` for `OR` as older crates have it, can be met by licences that are allowed.
fn is_allowed(expression: &str) -> bool {
    let expression = expression.replace('/', " OR ");
    let all = split(&expression, " AND ");
    if all.len() > 1 {
        return all.into_iter().all(is_allowed);
    }
    let any = split(&expression, " OR ");
    if any.len() > 1 {
        return any.into_iter().any(is_allowed);
    }
    let one = expression.trim();
    match one.strip_prefix('(').and_then(|inner| inner.strip_suffix(')')) {
        Some(inner) => is_allowed(inner),
        None => ALLOWED.contains(&one),
    }
}

/// The parts of an expression between words that are in no bracket.
fn split<'a>(expression: &'a str, word: &str) -> Vec<&'a str> {
    let (mut parts, mut begin) = (Vec::new(), 0);
    for (at, _) in expression.match_indices(word) {
        let before = &expression[..at];
        if before.matches('(').count() == before.matches(')').count() {
            parts.push(&expression[begin..at]);
            begin = at + word.len();
        }
    }
    parts.push(&expression[begin..]);
    parts
}

#[test]
fn licences_of_all_crates_allow_it_and_are_in_the_notice() {
    let crates = crates();
    assert!(crates.len() > 100, "{}", crates.len());
    for [name, version, licence] in &crates {
        assert!(
            is_allowed(licence),
            "{name} {version} is licensed under `{licence}`, which is not in the list"
        );
    }
    let lines: String =
        crates.iter().map(|[name, version, licence]| format!("{name} {version}: {licence}\n")).collect();
    let path = crate::root().join("NOTICE");
    if std::env::var_os("UPDATE_NOTICE").is_some() {
        std::fs::write(&path, format!("{HEAD}{lines}")).unwrap();
    }
    let notice = std::fs::read_to_string(path).unwrap();
    assert!(
        notice == format!("{HEAD}{lines}"),
        "NOTICE is not of these crates: UPDATE_NOTICE=1 writes it anew"
    );
}

#[test]
fn no_crate_is_there_twice_without_a_reason() {
    let mut versions: BTreeMap<String, Vec<String>> = BTreeMap::new();
    crates().into_iter().for_each(|[name, version, _]| versions.entry(name).or_default().push(version));
    versions.retain(|_, versions| versions.len() > 1);
    let found: Vec<&str> = versions.keys().map(String::as_str).collect();
    let expected: Vec<&str> = TWICE.iter().map(|(name, _)| *name).collect();
    assert_eq!(found, expected, "crates of several versions: {versions:?}");
}

#[test]
fn expressions_of_licences_are_understood() {
    for allowed in ["MIT", "GPL-3.0 OR MIT", "Unlicense/MIT", "(GPL-3.0 OR Zlib) AND Unicode-3.0"] {
        assert!(is_allowed(allowed), "{allowed}");
    }
    for refused in ["", "GPL-3.0", "MIT AND GPL-3.0", "(MIT OR Zlib) AND GPL-3.0", "Apache-2.0 WITH other"] {
        assert!(!is_allowed(refused), "{refused}");
    }
}
