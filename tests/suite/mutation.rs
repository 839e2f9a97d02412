//! Scene files that have been damaged: an error or a success, never a panic, and never a number that is none.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;

use proptest::prelude::*;
use serde_json::{Value, json};
use tempfile::TempDir;
use unscatter::io::scene_file;
use unscatter::operator::{LinearOperator, Vector};
use unscatter::problem::{LightMapProblem, Problem};
use unscatter::scene::{Scene, Strategy as Keep};

/// A file with something of everything; small, so that thousands of variants are solved in seconds.
fn scene() -> Value {
    json!({
        "version": 1, "name": "beams",
        "light": { "direction": [0.2, -1, 0.1], "radiance": [3, 2, 1] },
        "medium": { "sigma_t": [0.1, 0.2, 0.3], "albedo": 0.9, "g": 0.3 },
        "ambient": 0.01,
        "occluders": [
            { "box": { "center": [0, 3, 0], "size": [2, 0.1, 2], "albedo": 0.2 } },
            { "sphere": { "center": [0, 1, 0], "radius": 0.5, "to_world": { "translate": [0, 1, 0] } } },
            { "plane": { "center": [0, 0, 0], "sides": [[9, 0, 0], [0, 0, 9]] } },
            { "cylinder": { "from": [2, 0, 0], "to": [2, 3, 0], "radius": 0.2 } },
            { "obj": { "file": "tile.obj", "to_world": { "rotate": { "axis": [0, 1, 0], "angle": 20 } } } }
        ],
        "views": [
            {
                "name": "front",
                "camera": {
                    "to_world": { "look_at": { "origin": [0, 2, 9], "target": [0, 2, 0] } },
                    "fov": 40, "fov_axis": "x", "size": [16, 12]
                },
                "strokes": [
                    { "points": [[2, 2], [8, 10.5]], "radius": 1.5, "color": "#ff8000" },
                    { "points": [[14, 4]], "radius": 2, "hardness": 1, "opacity": 0.5, "color": [0, 0.25, 4] }
                ]
            },
            {
                "name": "side",
                "camera": { "to_world": { "translate": [0, 1, 5] }, "fov": 60, "size": [8, 8] },
                "layers": ["paint.png"]
            }
        ],
        "light_map": { "size": [12, 8], "extent": { "min": [-2, -3], "max": [2, 3] }, "basis": "bilinear" },
        "shadow_map": { "size": 64 },
        "target": "tint", "exposure": 1.5,
        "solve": { "iterations": 5, "tolerance": 0, "tikhonov": 0.01, "quadrature": { "march": { "steps": 16 } },
            "strategy": "auto", "memory": "1GiB", "transmittance_bound": 1e-6 }
    })
}

/// The folder with what the scene names; one for all cases, each with a scene file of its own.
fn folder() -> &'static TempDir {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("tile.obj"), "v -3 2 0\nv -2 2 0\nv -2 2 1\nf 1 2 3\n").unwrap();
        let paint =
            image::RgbaImage::from_fn(8, 8, |x, y| image::Rgba([200, 90, 30, if x < y { 180 } else { 0 }]));
        paint.save(folder.path().join("paint.png")).unwrap();
        folder
    })
}

/// Loads a scene file of these bytes, and takes what it describes as far as T x; whether that went well.
///
/// Fails on a panic and on a weight, a target or a product that is not finite.
fn survives(bytes: &[u8]) -> Result<bool, TestCaseError> {
    let file = tempfile::Builder::new().suffix(".json").tempfile_in(folder().path()).unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    let outcome = catch_unwind(AssertUnwindSafe(|| -> unscatter::Result<Option<f64>> {
        let scene = scene_file::load(file.path(), &[])?;
        if is_large(&scene) {
            return Ok(None);
        }
        let problem = LightMapProblem::new(&scene)?;
        let operator = problem.on_cpu(Keep::Auto, 1 << 20)?;
        let (mut x, mut y) = (operator.domain(), operator.range());
        x.fill([1.0; 3]);
        operator.apply(&x, &mut y)?;
        operator.apply_adjoint(&y, &mut x)?;
        let numbers = [&y.0, &x.0, &problem.targets, &problem.known_radiance];
        Ok(Some(numbers.into_iter().flatten().flatten().map(|&value| f64::from(value)).sum()))
    }));
    match outcome {
        Err(_) => Err(TestCaseError::fail("a panic")),
        Ok(Err(error)) => {
            prop_assert!(!error.to_string().is_empty());
            Ok(false)
        }
        Ok(Ok(sum)) => {
            prop_assert!(sum.is_none_or(f64::is_finite), "a product that is not a number");
            Ok(true)
        }
    }
}

/// Allowed, and not for a test of many cases.
fn is_large(scene: &Scene) -> bool {
    let pixels: usize = scene.views.iter().map(|view| view.camera.size().iter().product::<usize>()).sum();
    let texels = [&scene.light_map, &scene.shadow_map].map(|map| map.size.iter().product::<usize>());
    let steps = match scene.solve.quadrature {
        unscatter::scene::Quadrature::Exact => 0,
        unscatter::scene::Quadrature::March { steps } => steps,
    };
    pixels > 1 << 14 || texels.iter().any(|&texels| texels > 1 << 14) || steps > 1 << 10
}

/// What a value is replaced with.
fn nasty() -> impl Strategy<Value = Value> {
    let fixed = prop::sample::select(vec![
        json!(null),
        json!(true),
        json!(""),
        json!("x"),
        json!([]),
        json!({}),
        json!(0),
        json!(-0.0),
        json!(-1),
        json!(1),
        json!(2),
        json!(0.5),
        json!(1e-30),
        json!(1e-300),
        json!(1e9),
        json!(-1e9),
        json!(1e39),
        json!(-1e38),
        json!(f64::MAX),
        json!(f64::MIN_POSITIVE),
        json!(5e-324),
        json!(u64::MAX),
        json!(i64::MIN),
        json!([1, 2, 3]),
        json!([0, 0, 0]),
        json!([1e9, -1e9, 1e-9]),
        json!([[1, 2], [3, 4]]),
        json!("#ffffff"),
        json!("nearest"),
        json!("exact"),
        json!("radiance"),
        json!("matrix-free"),
        json!("paint.png"),
        json!("tile.obj"),
        json!({ "file": "tile.obj" }),
        json!({ "scale": 1e-5 }),
    ]);
    prop_oneof![3 => fixed, 1 => any::<f64>().prop_map(|value| json!(value)), 1 => (-20.0..20.0).prop_map(|v: f64| json!(v))]
}

#[derive(Debug, Clone)]
enum Change {
    Replace(Value),
    Remove,
    Double,
    Rename(String),
}

fn change() -> impl Strategy<Value = Change> {
    prop_oneof![
        6 => nasty().prop_map(Change::Replace),
        1 => Just(Change::Remove),
        1 => Just(Change::Double),
        1 => "[a-z_]{0,8}".prop_map(Change::Rename),
    ]
}

/// Pointers to all values below the top.
fn pointers(value: &Value, here: &str, found: &mut Vec<String>) {
    let mut enter = |key: String, value: &Value| {
        let there = format!("{here}/{key}");
        pointers(value, &there, found);
        found.push(there);
    };
    match value {
        Value::Object(object) => object.iter().for_each(|(key, value)| enter(key.clone(), value)),
        Value::Array(array) => array.iter().enumerate().for_each(|(i, value)| enter(i.to_string(), value)),
        _ => {}
    }
}

fn mutate(document: &mut Value, place: prop::sample::Index, change: Change) {
    let mut all = Vec::new();
    pointers(document, "", &mut all);
    if all.is_empty() {
        return;
    }
    let pointer = place.get(&all).clone();
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    match (document.pointer_mut(parent).unwrap(), change) {
        (Value::Object(object), Change::Replace(value)) => drop(object.insert(key.to_owned(), value)),
        (Value::Object(object), Change::Remove) => drop(object.remove(key)),
        (Value::Object(object), Change::Rename(name)) => {
            let value = object.remove(key).unwrap();
            object.insert(name, value);
        }
        (Value::Object(object), Change::Double) => {
            let value = object[key].clone();
            object[key] = json!([value.clone(), value]);
        }
        (Value::Array(array), change) => {
            let index: usize = key.parse().unwrap();
            match change {
                Change::Replace(value) => array[index] = value,
                Change::Remove => drop(array.remove(index)),
                Change::Double => array.insert(index, array[index].clone()),
                Change::Rename(name) => array[index] = json!({ name: array[index] }),
            }
        }
        _ => {}
    }
}

/// Cuts, overwrites, inserts or repeats bytes.
fn damage(bytes: &mut Vec<u8>, at: prop::sample::Index, kind: u8, new: &[u8]) {
    let at = at.index(bytes.len());
    let end = (at + new.len()).min(bytes.len());
    match kind % 5 {
        0 => bytes.truncate(at),
        1 => bytes[at..end].copy_from_slice(&new[..end - at]),
        2 => drop(bytes.splice(at..at, new.iter().copied())),
        3 => drop(bytes.drain(at..end)),
        _ => {
            let again = bytes[at..(at + 100).min(bytes.len())].to_vec();
            drop(bytes.splice(at..at, again));
        }
    }
}

/// Bytes that JSON is made of, so that damage is not always noticed by the first reader.
fn json_bytes() -> impl Strategy<Value = Vec<u8>> {
    let usual = prop::sample::select(b"0123456789.-+eE{}[]\",: \\nul#\n\xff\x00".to_vec());
    prop::collection::vec(usual, 1..6)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, failure_persistence: None, ..Default::default() })]

    #[test]
    fn changed_values_are_an_error_or_a_success(
        changes in prop::collection::vec((any::<prop::sample::Index>(), change()), 1..4)
    ) {
        let mut document = scene();
        changes.into_iter().for_each(|(place, change)| mutate(&mut document, place, change));
        survives(&serde_json::to_vec_pretty(&document).unwrap())?;
    }

    #[test]
    fn changed_bytes_are_an_error_or_a_success(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), json_bytes()), 1..4)
    ) {
        let mut bytes = serde_json::to_vec_pretty(&scene()).unwrap();
        for (at, kind, new) in changes {
            if !bytes.is_empty() {
                damage(&mut bytes, at, kind, &new);
            }
        }
        survives(&bytes)?;
    }
}

#[test]
fn the_whole_file_is_a_success_and_half_of_it_an_error() {
    let bytes = serde_json::to_vec(&scene()).unwrap();
    assert!(survives(&bytes).unwrap());
    assert!(!survives(&bytes[..bytes.len() / 2]).unwrap());
}
