//! Laws of scene files as a whole: what is loaded, what is refused and where, and that nothing panics.

use std::path::Path;

use proptest::prelude::*;

use super::path::{DocumentPath, Segment};
use super::*;
use crate::{Error, scene};

const GOOD: &str = r##"{
  "$schema": "https://example.org/scene.schema.json",
  "version": 1,
  "name": "beams",
  "light": { "direction": [0, -2, 0], "radiance": [3, 2, 1] },
  "medium": { "sigma_t": 0.2, "albedo": [0.9, 0.8, 0.7], "g": 0.3 },
  "ambient": 0.01,
  "occluders": [
    { "box": { "center": [0, 3, 0], "size": [4, 0.1, 4], "albedo": 0.2 } },
    { "sphere": { "center": [0, 1, 0], "radius": 0.5, "to_world": { "translate": [0, 1, 0] } } }
  ],
  "views": [
    {
      "name": "front",
      "camera": {
        "to_world": { "look_at": { "origin": [0, 2, 9], "target": [0, 2, 0] } },
        "fov": 40, "fov_axis": "x", "size": [64, 48]
      },
      "strokes": [
        { "points": [[8, 8], [32, 40.5]], "radius": 3, "color": "#ff8000" },
        { "points": [[60, 4]], "radius": 2, "hardness": 1, "opacity": 0.5, "color": [0, 0.25, 4] }
      ]
    },
    {
      "name": "side",
      "camera": { "to_world": { "translate": [0, 1, 5] }, "fov": 60, "size": [32, 32] }
    }
  ],
  "light_map": { "size": [128, 64], "extent": { "min": [-2, -1], "max": [2, 1] }, "basis": "nearest" },
  "shadow_map": { "size": 256 },
  "target": "radiance",
  "exposure": 1.5,
  "solve": { "iterations": 50, "seconds": 20, "memory": "2GiB", "quadrature": { "march": { "steps": 64 } } }
}
"##;

fn loaded(text: &str, overrides: &[&str]) -> Result<Scene> {
    let overrides: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
    scene_from_bytes(text.as_bytes(), Path::new("dir/fog.json"), &overrides)
}

/// What a person is told: line, column, path, problem and suggestion.
fn told(text: &str, overrides: &[&str]) -> (usize, usize, String, String, Option<String>) {
    match loaded(text, overrides) {
        Err(Error::Scene { line, column, path, problem, suggestion, file, .. }) => {
            assert_eq!(&*file, "dir/fog.json");
            (line, column, path, problem, suggestion)
        }
        other => panic!("expected a scene error, got {other:?}"),
    }
}

#[test]
fn everything_in_the_file_reaches_the_scene() {
    let scene = loaded(GOOD, &[]).unwrap();
    assert_eq!(scene.name, "beams");
    assert_eq!((scene.light.direction.y, scene.light.radiance), (-1.0, [3.0, 2.0, 1.0]));
    assert_eq!((scene.medium.sigma_t, scene.medium.albedo, scene.medium.g), ([0.2; 3], [0.9, 0.8, 0.7], 0.3));
    assert_eq!(
        (scene.ambient, scene.exposure, scene.target),
        ([0.01; 3], Some(1.5), scene::Target::Radiance)
    );
    assert_eq!((scene.light_map.size, scene.shadow_map.size), ([128, 64], [256, 256]));
    assert_eq!(scene.light_map.extent.unwrap().max.x, 2.0);
    assert_eq!((scene.solve.iterations, scene.solve.memory), (50, Some(2 << 30)));
    assert_eq!(scene.solve.basis, scene::Basis::Nearest);
    assert_eq!(scene.views.len(), 2);
    let view = &scene.views[0];
    assert_eq!((view.name.as_str(), view.camera.size(), view.strokes.len()), ("front", [64, 48], 2));
    assert_eq!(
        (view.strokes[0].hardness, view.strokes[0].opacity, view.strokes[0].color[0]),
        (0.8, 1.0, 1.0)
    );
    assert_eq!((view.strokes[1].points[0], view.strokes[1].color), ([60.0, 4.0], [0.0, 0.25, 4.0]));
    let position = scene.views[0].camera.position();
    assert_eq!((position.y, position.z), (2.0, 9.0));
}

#[test]
fn what_is_not_given_has_its_default() {
    let text = r#"{"version": 1, "light": {"direction": [0, -1, 0]}, "medium": {"sigma_t": 1},
        "views": [{"name": "v", "camera": {"to_world": {}, "fov": 50, "size": [8, 8]}}]}"#;
    let scene = loaded(text, &[]).unwrap();
    assert_eq!((scene.name.as_str(), scene.light.radiance, scene.ambient), ("fog", [1.0; 3], [0.02; 3]));
    assert_eq!((scene.light_map.size, scene.light_map.extent), ([512; 2], None));
    assert_eq!((scene.target, scene.opacity), (scene::Target::Tint, scene::Opacity::Strength));
    let smooth = scene::Regularization {
        gradient: scene::RegularizationWeight::Relative(1.0),
        ..scene::Regularization::default()
    };
    let expected = scene::SolveSettings {
        bounds: [[0.0; 3], [1.0; 3]],
        regularization: smooth,
        fade: scene::Fade::OfMap(1.0 / 32.0),
        ..scene::SolveSettings::default()
    };
    assert_eq!(scene.solve, expected);
    // As in the paper.
    let paper = loaded(text, &["defaults=paper"]).unwrap();
    let plain =
        scene::SolveSettings { fade: scene::Fade::OfMap(1.0 / 32.0), ..scene::SolveSettings::default() };
    assert_eq!((paper.solve, paper.target), (plain, scene::Target::WhiteTint));
    assert_eq!((paper.opacity, paper.exposure), (scene::Opacity::Weight, Some(0.0)));
    assert_eq!((paper.light_map.fit, paper.light_map.square_texels), (scene::MapFit::Seen, false));
}

#[test]
fn a_gobo_only_dims_unless_it_is_told_otherwise() {
    let text = r#"{"version": 1, "light": {"direction": [0, -1, 0], "radiance": [3, 2, 1]}, "medium": {"sigma_t": 1},
        "views": [{"name": "v", "camera": {"to_world": {}, "fov": 50, "size": [8, 8]}}]}"#;
    let upper = |set: &[&str]| loaded(text, set).unwrap().solve.bounds[1];
    assert_eq!(upper(&[]), [3.0, 2.0, 1.0]);
    assert_eq!(upper(&["light_map.gobo=false"]), [f64::INFINITY; 3]);
    assert_eq!(upper(&["target=radiance"]), [f64::INFINITY; 3]);
    assert_eq!(upper(&["target=radiance", "light_map.gobo=true"]), [3.0, 2.0, 1.0]);
    assert_eq!(upper(&["solve.upper=7"]), [7.0; 3]);
    // A method without bounds has none.
    assert!(loaded(text, &["solve.solver=lsqr"]).is_ok());
}

#[test]
fn fog_is_per_metre_whatever_the_unit_of_lengths() {
    let text = r#"{"version": 1, "light": {"direction": [0, -1, 0]}, "medium": {"sigma_t": 0.5},
        "views": [{"name": "v", "camera": {"to_world": {}, "fov": 50, "size": [8, 8]}}]}"#;
    for (unit, sigma) in
        [("m", 0.5), ("cm", 0.005), ("mm", 0.0005), ("km", 500.0), ("in", 0.0127), ("ft", 0.1524)]
    {
        let scene = loaded(text, &[&format!("unit={unit}")]).unwrap();
        assert!((scene.medium.sigma_t[0] / sigma - 1.0).abs() < 1e-12, "{unit}");
    }
    assert!(loaded(text, &["unit=parsec"]).is_err());
}

/// Replaces the one occurrence of `from` in the good document.
fn changed(from: &str, to: &str) -> String {
    assert_eq!(GOOD.matches(from).count(), 1, "`{from}` must be unique in the document");
    GOOD.replace(from, to)
}

#[test]
fn bad_documents_are_told_with_their_place() {
    // What is replaced, by what; line, column, path, a part of the problem, the suggestion.
    type Row = (&'static str, &'static str, usize, usize, &'static str, &'static str, Option<&'static str>);
    let table: &[Row] = &[
        // Not JSON, or not one document.
        ("\"name\": \"beams\",", "\"name\": \"beams\"", 5, 3, "document", "expected `,` or `}`", None),
        ("[3, 2, 1]", "[3, 2,, 1]", 5, 57, "light.radiance[2]", "expected value", None),
        ("\"ambient\": 0.01", "\"ambient\": 1e999", 7, 18, "ambient", "number out of range", None),
        ("\"g\": 0.3", "\"g\": 0.3, \"g\": 0.4", 6, 68, "medium.g", "twice", None),
        ("\"side\",", "\"side\", \"n\\u0061me\": \"x\",", 25, 23, "views[1].name", "twice", None),
        // Names.
        ("\"fov\": 40", "\"fow\": 40", 17, 9, "views[0].camera.fow", "unknown field `fow`", Some("fov")),
        ("\"ambient\"", "\"Ambience\"", 7, 3, "Ambience", "unknown field", Some("ambient")),
        ("\"sphere\"", "\"spere\"", 10, 7, "occluders[1].spere", "unknown name `spere`", Some("sphere")),
        ("\"nearest\"", "\"neares\"", 29, 92, "light_map.basis", "unknown name", Some("nearest")),
        ("\"march\"", "\"walk\"", 33, 81, "solve.quadrature.walk", "exact, march", None),
        ("\"sigma_t\": 0.2, ", "", 6, 13, "medium", "missing field `sigma_t`", None),
        ("\"fov\": 60, ", "", 26, 17, "views[1].camera", "missing field `fov`", None),
        ("\"version\": 1,", "\"version\": 2, \"other\": 1,", 3, 14, "version", "1, the version", None),
        ("\"version\": 1,", "", 1, 1, "document", "missing field `version`", None),
        // Types.
        ("\"fov\": 60", "\"fov\": \"wide\"", 26, 66, "views[1].camera.fov", "must be a number", None),
        ("[3, 2, 1]", "[3, 2]", 5, 51, "light.radiance", "a number or [r, g, b]", None),
        ("[3, 2, 1]", "[3, \"2\", 1]", 5, 55, "light.radiance[1]", "a number", None),
        ("[8, 8]", "[8, 8, 8]", 20, 22, "views[0].strokes[0].points[0]", "", None),
        ("[64, 48]", "[64, -48]", 17, 50, "views[0].camera.size[1]", "whole number", None),
        ("[64, 48]", "[64, 48.5]", 17, 50, "views[0].camera.size[1]", "48.5", None),
        ("#ff8000", "#ff800", 20, 65, "views[0].strokes[0].color", "\"#rrggbb\"", None),
        ("\"2GiB\"", "\"2 cats\"", 33, 57, "solve.memory", "a number of bytes", None),
        (
            "{ \"sphere\":",
            "{ \"obj\": {\"file\": \"x\"}, \"sphere\":",
            10,
            5,
            "occluders[1]",
            "one name",
            None,
        ),
        // Values.
        ("[0, -2, 0]", "[0, 0, 0]", 5, 27, "light.direction", "not zero", None),
        ("[3, 2, 1]", "[3, -2, 1]", 5, 51, "light.radiance", "not negative", None),
        ("0.01", "1e300", 7, 14, "ambient", "not negative", None),
        ("\"sigma_t\": 0.2", "\"sigma_t\": 0", 6, 26, "medium.sigma_t", "positive", None),
        ("0.3", "1", 6, 63, "medium.g", "inside (-1, 1)", None),
        ("\"radius\": 0.5", "\"radius\": -0.5", 10, 50, "occluders[1].sphere.radius", "above 0", None),
        ("\"fov\": 40", "\"fov\": 180", 17, 16, "views[0].camera.fov", "180", None),
        ("[32, 32]", "[32, 0]", 26, 78, "views[1].camera.size", "1 to 16384", None),
        ("[64, 48]", "[64, 16385]", 17, 45, "views[0].camera.size", "1 to 16384", None),
        ("\"side\"", "\"FRONT\"", 25, 15, "views[1].name", "views[0]", None),
        ("\"side\"", "\"../side\"", 25, 15, "views[1].name", "letters", None),
        ("[[60, 4]]", "[[-60, 4]]", 21, 9, "views[0].strokes[1]", "outside the view", None),
        ("[[60, 4]]", "[]", 21, 21, "views[0].strokes[1].points", "0 points", None),
        ("[60, 4]", "[60, 4e40]", 21, 22, "views[0].strokes[1].points[0]", "finite", None),
        ("\"size\": 256", "\"size\": 32", 30, 27, "shadow_map.size", "from 64 to 8192", None),
        ("\"max\": [2, 1]", "\"max\": [2, -1]", 29, 47, "light_map.extent", "min below max", None),
        ("1.5", "1e9", 32, 15, "exposure", "stops", None),
        ("\"seconds\": 20", "\"seconds\": -1", 33, 43, "solve.seconds", "above 0", None),
        ("\"steps\": 64", "\"steps\": 0", 33, 101, "solve.quadrature.march.steps", "1 to", None),
        (
            "{ \"translate\": [0, 1, 5] }",
            "{ \"scale\": 0 }",
            26,
            42,
            "views[1].camera.to_world.scale",
            "",
            None,
        ),
        (
            "\"fov\": 60",
            "\"fov\": 60, \"gltf\": {\"file\": \"a\", \"node\": \"b\"}",
            26,
            78,
            "views[1].camera.gltf",
            "either",
            None,
        ),
    ];
    let mut wrong = Vec::new();
    for &(from, to, line, column, path, problem, suggestion) in table {
        let text = changed(from, to);
        let got = told(&text, &[]);
        let place = (got.0, got.1, got.2.as_str(), got.4.as_deref());
        if place != (line, column, path, suggestion) || !got.3.contains(problem) {
            let rest: String =
                text.lines().nth(got.0 - 1).unwrap_or("").chars().skip(got.1 - 1).take(20).collect();
            wrong.push(format!(
                "{to}: {got:?} at `{rest}`, not {line}:{column} {path} {suggestion:?} {problem}"
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_scene_without_views_or_without_anything_is_refused() {
    let start = GOOD.find("\"views\": [").unwrap() + "\"views\": [".len();
    let end = GOOD.find("\n  ],\n  \"light_map\"").unwrap();
    let empty = format!("{}{}", &GOOD[..start], &GOOD[end..]);
    let (line, column, path, problem, _) = told(&empty, &[]);
    assert_eq!((line, column, path.as_str()), (12, 12, "views"));
    assert!(problem.contains("add one"), "{problem}");
    for nothing in ["", " ", "{}", "[]", "null", "1", "\"x\"", "\u{feff}{}"] {
        assert_eq!(told(nothing, &[]).2, "document", "{nothing}");
    }
}

#[test]
fn overrides_take_the_place_of_what_the_file_says() {
    let overrides = [
        "views[1].camera.fov=90",
        "name=other name",
        "medium={\"sigma_t\": [1, 2, 3]}",
        "solve.memory=1000000",
        "solve.quadrature=exact",
        "views[1].camera.size[0]=64",
    ];
    let scene = loaded(GOOD, &overrides).unwrap();
    assert_eq!((scene.name.as_str(), scene.medium.sigma_t), ("other name", [1.0, 2.0, 3.0]));
    assert_eq!((scene.solve.memory, scene.solve.quadrature), (Some(1_000_000), scene::Quadrature::Exact));
    assert_eq!(scene.views[1].camera.size(), [64, 32]);
    assert_eq!(
        loaded(GOOD, &["exposure=1", "exposure=2"]).unwrap().exposure,
        Some(2.0),
        "the last one counts"
    );
}

#[test]
fn bad_overrides_are_told_as_such() {
    let table = [
        ("views[0].camera.fov=0", (17, 16), "views[0].camera.fov", "(set by an override)"),
        ("views[7].name=x", (12, 12), "views[7].name", "the last one is 1 (set by an override)"),
        ("solver=cgls", (1, 1), "solver", "unknown field `solver`"),
        ("ambient=bright", (7, 14), "ambient", "the text \"bright\" is not allowed"),
        ("ambient=1e999", (7, 14), "ambient", "(set by an override)"),
        (
            "views[1].camera.to_world.look_at={\"origin\": [0,0,0], \"target\": [0,0,0]}",
            (26, 31),
            "views[1].camera.to_world",
            "(partly set by an override)",
        ),
        ("version=3", (3, 14), "version", "(set by an override)"),
    ];
    for (text, (line, column), path, problem) in table {
        let got = told(GOOD, &[text]);
        assert_eq!((got.0, got.1, got.2.as_str()), (line, column, path), "{text}: {}", got.3);
        assert!(got.3.contains(problem), "{text}: {}", got.3);
    }
    assert_eq!(told(GOOD, &["solver=cgls"]).4.as_deref(), Some("solve"));
    assert!(!told(GOOD, &["exposure=1", "ambient=-1"]).3.contains("partly"));
    let Err(Error::Value { path, .. }) = loaded(GOOD, &["no equals sign"]) else { panic!("was accepted") };
    assert_eq!(path, "override");
}

fn document_from(text: &str) -> Document {
    let mut source = SceneText { file: Path::new("fog.json"), text, set: Vec::new() };
    document(&mut source, &[]).unwrap()
}

#[test]
fn documents_are_read_as_they_were_written() {
    let document = document_from(GOOD);
    let text = write(&document).unwrap();
    assert_eq!(document_from(&text), document);
    assert_eq!(write(&document_from(&text)).unwrap(), text);
    assert!(text.lines().all(|line| line.len() <= 120), "{text}");
    assert!(
        text.contains("\n  \"light\": { \"direction\": [0, -2, 0], \"radiance\": [3, 2, 1] },\n"),
        "{text}"
    );
    assert!(text.contains("\"points\": [[8, 8], [32, 40.5]]"), "{text}");
}

#[test]
fn long_strokes_fill_their_lines_and_what_is_not_finite_is_not_written() {
    let points: Vec<[f64; 2]> = (0..1000).map(|i| [f64::from(i) * 0.25, 7.0]).collect();
    let mut document = document_from(GOOD);
    document.views[0].strokes.push(Stroke::new(points, 2.0, Paint::Hex([1, 2, 3])));
    let text = write(&document).unwrap();
    assert_eq!(document_from(&text), document);
    assert!(text.lines().count() < 250, "{}", text.lines().count());
    document.views[0].strokes[2].points[3][1] = f64::NAN;
    let Err(Error::NonFinite { place, .. }) = write(&document) else { panic!("was written") };
    assert_eq!(place, "views[0].strokes[2].points[3][1]");
}

#[test]
fn the_schema_describes_every_field_and_allows_no_others() {
    fn check(name: &str, schema: &Value) {
        for (field, property) in schema.get("properties").and_then(Value::as_object).into_iter().flatten() {
            assert!(property.get("description").is_some(), "{name}.{field} has no description");
        }
        if schema.get("properties").is_some() {
            assert_eq!(schema.get("additionalProperties"), Some(&Value::Bool(false)), "{name}");
        }
    }
    let schema = schema(Subject::LightMap);
    check("Document", &schema);
    let definitions = schema["$defs"].as_object().unwrap();
    for name in ["Channels", "Paint", "Transform", "Occluder", "Stroke", "Solve", "MemorySize"] {
        assert!(definitions.contains_key(name), "{name} is missing");
    }
    for (name, definition) in definitions.iter().filter(|(name, _)| *name != "Occluder") {
        check(name, definition);
    }
    assert_eq!(schema["properties"]["version"]["maximum"], 1);
}

#[test]
fn files_that_cannot_be_read_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.json");
    assert!(matches!(load(&file, &[]), Err(Error::File { .. })));
    assert!(matches!(load(folder.path(), &[]), Err(Error::File { .. })));
    std::fs::write(&file, format!("\u{feff}{GOOD}")).unwrap();
    assert!(load(&file, &[]).is_ok(), "a byte order mark does no harm");
    std::fs::write(&file, b"{\n \"name\": \"\xff\"}").unwrap();
    assert!(matches!(load(&file, &[]), Err(Error::Scene { line: 2, column: 11, .. })));
    std::fs::File::create(&file).unwrap().set_len((64 << 20) + 1).unwrap();
    assert!(matches!(load(&file, &[]), Err(Error::TooLarge { .. })));
}

/// Every place in the good document that holds a value.
fn places() -> Vec<String> {
    fn collect(value: &Value, path: &DocumentPath, into: &mut Vec<String>) {
        let mut child = |segment, value| {
            let mut path = path.clone();
            path.0.push(segment);
            into.push(path.to_string());
            collect(value, &path, into);
        };
        match value {
            Value::Object(object) => {
                object.iter().for_each(|(key, value)| child(Segment::Key(key.clone()), value));
            }
            Value::Array(elements) => {
                elements.iter().enumerate().for_each(|(i, value)| child(Segment::Index(i), value));
            }
            _ => {}
        }
    }
    let mut places = Vec::new();
    collect(&serde_json::from_str(GOOD).unwrap(), &DocumentPath::default(), &mut places);
    places
}

/// Values that programs tend to trip over.
const NASTY: [&str; 26] = [
    "null",
    "true",
    "0",
    "-0.0",
    "-1",
    "1",
    "1e308",
    "-1e308",
    "1e-320",
    "1e38",
    "18446744073709551615",
    "-9223372036854775808",
    "4294967296",
    "[]",
    "{}",
    "\"\"",
    "\"a\\u0000b\"",
    "[0, 0]",
    "[1e308, 1e308, 1e308]",
    "[1e-200, 0, 0]",
    "[[]]",
    "[8192, 8192]",
    "\"#ffffff\"",
    "0.5",
    "\"ü\"",
    "[[1e308, -1e308]]",
];

#[test]
fn no_single_nasty_value_anywhere_panics_and_every_error_has_a_place() {
    let lines = GOOD.lines().count();
    for place in places() {
        for nasty in NASTY {
            match loaded(GOOD, &[&format!("{place}={nasty}")]) {
                Ok(_) | Err(Error::Machine(_)) => {}
                Err(Error::Scene { line, column, problem, .. }) => {
                    assert!((1..=lines).contains(&line) && column >= 1, "{place}={nasty}");
                    assert!(
                        !problem.contains("f64") && !problem.contains("usize"),
                        "{place}={nasty}: {problem}"
                    );
                }
                Err(other) => panic!("{place}={nasty}: {other}"),
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn garbled_bytes_never_panic(
        edits in prop::collection::vec((0..GOOD.len(), 0u8..4, any::<u8>(), 0..GOOD.len()), 1..6),
    ) {
        let mut bytes = GOOD.as_bytes().to_vec();
        for (at, edit, byte, other) in edits {
            let at = at % bytes.len();
            match edit {
                0 => bytes[at] = byte,
                1 => bytes.insert(at, b"{}[]\",:0-e.\\"[usize::from(byte) % 12]),
                2 => { bytes.remove(at); }
                _ => bytes.truncate(1 + (at + other) % bytes.len()),
            }
            if bytes.is_empty() {
                bytes.push(b' ');
            }
        }
        match scene_from_bytes(&bytes, Path::new("x.json"), &[]) {
            Ok(_) | Err(Error::Machine(_)) => {}
            Err(Error::Scene { line, column, .. }) => prop_assert!(line >= 1 && column >= 1),
            Err(other) => prop_assert!(false, "{other}"),
        }
    }

    #[test]
    fn several_nasty_values_at_once_never_panic(
        picks in prop::collection::vec((any::<prop::sample::Index>(), 0..NASTY.len()), 2..8),
    ) {
        let places = places();
        let set: Vec<String> = picks.iter().map(|(i, n)| format!("{}={}", i.get(&places), NASTY[*n])).collect();
        let set: Vec<&str> = set.iter().map(String::as_str).collect();
        let result = loaded(GOOD, &set);
        prop_assert!(matches!(result, Ok(_) | Err(Error::Scene { .. } | Error::Machine(_))), "{result:?}");
    }

    #[test]
    fn strange_overrides_never_panic(text in "[a-z\\[\\].=0-9{}\"-]{0,40}") {
        let result = loaded(GOOD, &[&text]);
        prop_assert!(matches!(result, Ok(_) | Err(Error::Scene { .. } | Error::Value { .. })), "{result:?}");
    }

    #[test]
    fn numbers_survive_being_written(x in prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL, y in -1e4..1e4f64) {
        let mut document = document_from(GOOD);
        document.views[0].strokes[0].points = vec![[x, y]];
        document.ambient = Channels::Rgb([x, -0.0, y]);
        let read = document_from(&write(&document).unwrap());
        let [rx, ry] = read.views[0].strokes[0].points[0];
        prop_assert_eq!((rx.to_bits(), ry.to_bits()), (x.to_bits(), y.to_bits()));
        prop_assert_eq!(read, document);
    }
}
