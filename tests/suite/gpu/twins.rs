//! Kernel, host side and twin on the processor stand side by side, and none of the three is missing.

use std::collections::BTreeSet;
use std::fs;

use unscatter::gpu::kernel_texts;

use crate::root;

/// Of each kernel: who dispatches it, the file of its twin on the processor, and what the twin is called there.
const TWINS: &[(&str, &str, &str, &str)] = &[
    ("axpby", "vector", "operator/cpu_vector", "fn axpby"),
    ("clamp", "vector", "operator/cpu_vector", "fn clamp"),
    ("difference", "vector", "operator/cpu_vector", "fn difference"),
    ("divergence", "vector", "operator/cpu_vector", "fn divergence"),
    ("dot", "vector", "operator/cpu_vector", "fn dot_later"),
    ("fill", "vector", "operator/cpu_vector", "fn fill"),
    // Sums on the processor need no fixed point: they are made in order, in f64.
    ("fixed_finish", "vector", "cpu/rows", "fn scatter"),
    ("fixed_scale", "fixed_point", "cpu/rows", "fn scatter"),
    ("gather", "walked", "cpu/transport", "fn gather"),
    ("hold", "vector", "operator/cpu_vector", "fn hold("),
    ("hold_at_bounds", "vector", "operator/cpu_vector", "fn hold_at_bounds"),
    ("invert", "vector", "operator/cpu_vector", "fn invert"),
    ("largest_bits", "vector", "cpu/rows", "fn scatter"),
    ("largest_step", "vector", "operator/cpu_vector", "fn largest_step"),
    ("multiply", "vector", "operator/cpu_vector", "fn multiply"),
    ("pick", "vector", "operator/cpu_vector", "fn pick"),
    ("place", "vector", "operator/cpu_vector", "fn place"),
    ("projected_norm_squared", "vector", "operator/cpu_vector", "fn projected_norm_squared_later"),
    ("rows", "rows", "cpu/rows", "fn gather"),
    ("scale", "vector", "operator/cpu_vector", "fn scale"),
    ("scatter", "walked", "cpu/transport", "fn apply_adjoint"),
    ("shorten", "vector", "operator/cpu_vector", "fn shorten"),
    ("squares", "walked", "cpu/transport", "fn squares"),
    // Rays find the same triangles by the hierarchy.
    ("surfaces", "surfaces", "visibility/geometry", "fn first_hit"),
    ("tiles", "tiles", "cpu/tiles", "fn sweep"),
];

/// The kernels that lie in a folder.
fn files(folder: &str) -> BTreeSet<String> {
    let entries = fs::read_dir(root().join(folder)).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter_map(|name| name.strip_suffix(".wgsl").map(str::to_owned)).collect()
}

#[test]
fn no_kernel_is_without_its_host_side_and_its_twin() {
    let named: BTreeSet<String> = TWINS.iter().map(|(name, ..)| (*name).to_owned()).collect();
    assert_eq!(files("kernels"), named);
    let assembled: BTreeSet<String> = kernel_texts().into_iter().map(|text| text.name.to_owned()).collect();
    assert_eq!(assembled, named);
    let read = |file: String| fs::read_to_string(root().join("src").join(file)).unwrap();
    for (name, host, twin, function) in TWINS {
        let words: String = name.split('_').map(|word| word[..1].to_uppercase() + &word[1..]).collect();
        let variant = match *name {
            "gather" | "scatter" | "squares" => format!("Consumer::{words}"),
            "surfaces" => "kernels/surfaces.wgsl".to_owned(),
            _ => format!("Kernel::{words}"),
        };
        assert!(read(format!("gpu/{host}.rs")).contains(&variant), "{variant} is not in gpu/{host}.rs");
        assert!(read(format!("{twin}.rs")).contains(function), "{function} is not in {twin}.rs");
    }
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
    let files = fs::read_dir(root().join("benches/kernels")).unwrap();
    let texts = files.map(|file| fs::read_to_string(file.unwrap().path()).unwrap());
    let benches: BTreeSet<String> = texts.flat_map(|text| words_of_literals(&text)).collect();
    for (name, ..) in TWINS {
        assert!(benches.contains(*name), "no bench of benches/kernels/ names {name}");
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
