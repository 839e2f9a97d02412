//! Kernel, host side and twin on the processor stand side by side, and none of the three is missing.

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

use unscatter::gpu::kernel_texts;

use crate::root;

/// The kernels that lie in a folder.
fn files(folder: &str) -> BTreeSet<String> {
    let entries = fs::read_dir(root().join(folder)).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter_map(|name| name.strip_suffix(".wgsl").map(str::to_owned)).collect()
}

/// All files below a folder, in one text.
fn texts(folder: PathBuf) -> String {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.map(|path| if path.is_dir() { texts(path) } else { fs::read_to_string(path).unwrap() }).collect()
}

#[test]
fn no_kernel_is_without_its_host_side_and_its_twin() {
    let assembled: BTreeSet<_> = kernel_texts().into_iter().map(|text| (text.name, text.twin)).collect();
    let named: BTreeSet<String> = assembled.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(files("kernels"), named);
    let hosts = texts(root().join("src/gpu/vectors")) + &texts(root().join("src/gpu/operators"));
    let is_there = |file: &str, function: &str| {
        let text = fs::read_to_string(root().join("src").join(file).with_extension("rs")).unwrap();
        text.contains(&format!("fn {function}(")) || text.contains(&format!("fn {function}<"))
    };
    for (name, [file, function]) in assembled {
        let words: String = name.split('_').map(|word| word[..1].to_uppercase() + &word[1..]).collect();
        // What draws is no row of the table.
        assert!(
            name == "surfaces" || hosts.contains(&format!("Kernel::{words}")),
            "nobody dispatches {name}"
        );
        assert!(is_there(file, function), "{function}, the twin of {name}, is not in {file}.rs");
    }
    assert!(!is_there("operator/cpu_vector", "unheard_of"));
}

/// The words inside the string literals of a bench.
fn words_of_literals(text: &str) -> BTreeSet<String> {
    let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    let words = |literal: &str| -> Vec<String> {
        literal.split(|c: char| !c.is_alphanumeric() && c != '_').map(str::to_owned).collect()
    };
    code.flat_map(|line| line.split('"').skip(1).step_by(2)).flat_map(words).collect()
}

#[test]
fn every_kernel_has_a_bench() {
    let sources = fs::read_dir(root().join("benches/kernels")).unwrap();
    let texts = sources.map(|file| fs::read_to_string(file.unwrap().path()).unwrap());
    let benches: BTreeSet<String> = texts.flat_map(|text| words_of_literals(&text)).collect();
    for name in files("kernels") {
        assert!(benches.contains(&name), "no bench of benches/kernels/ names {name}");
    }
    let noted = words_of_literals("// a bench of \"dot\"\nbench(\"hold_at_bounds, kept\");");
    assert!(noted.contains("hold_at_bounds") && !noted.contains("dot") && !noted.contains("hold"));
}

#[test]
fn every_text_of_the_prelude_is_part_of_a_kernel() {
    let texts = kernel_texts();
    for name in files("kernels/prelude") {
        let text = fs::read_to_string(root().join("kernels/prelude").join(format!("{name}.wgsl"))).unwrap();
        assert!(
            texts.iter().any(|kernel| kernel.source.contains(&text)),
            "prelude/{name}.wgsl is used nowhere"
        );
    }
}
