//! Laws of resolved documents: nothing is left out, and nothing means anything else than before.

use std::collections::BTreeSet;
use std::path::PathBuf;

use super::super::{
    Animated, AnimatedDocument, Describes, Document, Exposure, SceneFile, VolumeDocument, document,
    scene_text::SceneText,
};
use super::*;

/// Settings that may have no value, and why. All others are written, and a new one is until it is put in here.
const WITHOUT_VALUE: &[(&str, &[&str])] = &[
    // For editors of the file that it came from.
    ("unscatter scene", &["$schema", "surroundings", "animation"]),
    // Nothing, or derived from the rest: voxels of cached light, the environment as the background.
    ("unscatter volume scene", &["$schema", "light_size", "background", "transforms", "animation"]),
    // One of two, and the radiance of a glTF sun comes from its file.
    ("Light", &["direction", "gltf", "radiance"]),
    // The whole file.
    ("GltfNode", &["node"]),
    ("GltfMesh", &["node", "to_world"]),
    ("ObjMesh", &["to_world"]),
    ("BoxShape", &["to_world"]),
    ("PlaneShape", &["to_world"]),
    ("SphereShape", &["to_world"]),
    ("CylinderShape", &["to_world"]),
    // As the format of a picture has it.
    ("View", &["association"]),
    ("Stroke", &["group"]),
    // Either the one or the others.
    ("Camera", &["to_world", "fov", "fov_axis", "lens", "gltf"]),
    ("Transform", &["matrix", "look_at", "translate", "rotate", "scale"]),
    // Fitted to the scene.
    ("LightMap", &["extent", "size"]),
    ("ShadowMap", &["extent"]),
    // Baked on request.
    ("Heterogeneity", &["bake"]),
    ("Noise", &["size"]),
    ("BlendVolume", &["file", "grid"]),
    ("AirStroke", &["value", "view", "distance", "pixels", "points", "normal", "depth"]),
    // One of two, and only lines go towards a view.
    ("Fill", &["length", "view"]),
    ("Extrude", &["texels"]),
    // One way of saying where.
    ("TransferPoint", &["at", "view", "pixel", "triangle", "corners"]),
    ("Looks", &["file", "transfer", "heterogeneity", "surfaces"]),
    // Fitted to the scene, or as far as rays go.
    ("SurfaceLight", &["radius"]),
    // As far as the views see.
    ("Transfer", &["far"]),
    // No limits; what follows from the medium of a painted volume; and the memory of the machine.
    ("Solve", &["seconds", "noise", "upper", "tikhonov", "gradient", "fade", "memory"]),
    ("Surroundings", &["environment"]),
    ("Sky", &["file"]),
    ("Environment", &["file"]),
    // Discs have what maps have not, and only hemispheres an up.
    ("Lights", &["count", "map", "up", "softness", "samples", "gradient"]),
    // Where the files say; as many as the extinction has.
    ("Volume", &["to_world", "size", "refraction"]),
    ("FieldSource", &["value", "file", "member", "made", "size"]),
    ("Shapes", &["noise"]),
    // Half a voxel.
    ("Refraction", &["step"]),
    // No bound.
    ("Range", &["upper"]),
    ("VolumeView", &["association", "picture", "weight", "mask", "background"]),
    ("KeyView", &["association", "picture", "weight", "mask"]),
    // Those of the volume.
    ("Key", &["extinction", "albedo", "emission"]),
    // Where there are numbered files.
    ("Animation", &["first_file"]),
    // Those of the scene.
    ("LightKey", &["light", "looks"]),
    ("LightKeyView", &["camera", "strokes", "layers", "association", "keep"]),
];

/// Says as little as it can and has everything that a scene of a light map may have; `@` stands before each file.
const LIGHT_MAP: &str = r##"{
  "$schema": "scene.schema.json",
  "version": 1,
  "light": { "gltf": { "file": "@sun.glb" } },
  "medium": { "sigma_t": 0.2 },
  "surroundings": { "sun": true, "environment": { "file": "@sky.hdr" } },
  "occluders": [
    { "box": { "center": [0, 3, 0], "size": [4, 0.1, 4] } },
    { "plane": { "center": [0, 3, 0], "sides": [[1, 0, 0], [0, 1, 0]] } },
    { "sphere": { "center": [0, 1, 0], "radius": 0.5, "to_world": { "rotate": { "axis": [0, 1, 0], "angle": 9 } } } },
    { "sphere": { "center": [0, 1, 0], "radius": 0.5 } },
    { "cylinder": { "from": [0, 1, 0], "to": [0, 2, 0], "radius": 0.5 } },
    { "gltf": { "file": "@hall.glb" } },
    { "obj": { "file": "@folder/hall.obj" } }
  ],
  "views": [
    {
      "name": "front",
      "camera": { "to_world": { "look_at": { "origin": [0, 2, 9], "target": [0, 2, 0] } }, "fov": 40, "size": [64, 48] },
      "strokes": [{ "points": [[8, 8], [32, 40.5]], "radius": 3, "color": "#ff8000", "group": "warm" }],
      "layers": ["@paint.png"]
    },
    { "name": "side", "camera": { "gltf": { "file": "@hall.glb", "node": "Eye" }, "size": [32, 32] } },
    { "name": "photo", "camera": { "to_world": {}, "lens": { "focal_length": [60, 58], "k1": -0.1 }, "size": [64, 48] } }
  ],
  "groups": [{ "name": "warm" }],
  "looks": { "occluders": [
    { "fill": { "texels": 2 } }, { "extrude": { "view": "front", "length": 0.5 } }, { "pierce": { "size": 0.2, "sway": { "turn": 30 } } }
  ], "transfer": { "far": 20, "layers": [
    { "solid": { "color": "#ffeedd" } }, { "gradient": { "along": "depth", "from": "#fff", "to": "#888" } }, { "image": { "file": "@paint.png" } },
    { "diffusion": { "points": [{ "color": "#f80", "at": [0.1, 0.2] }, { "color": "#08f", "view": "front", "pixel": [3, 4] }] } }
  ] }, "heterogeneity": {
    "amount": { "file": "@smoke.vdb", "grid": "density" }, "bounds": { "min": [0, 0, 0], "max": [4, 4, 4] },
    "intensity": { "strokes": [
      { "value": 2, "view": "front", "distance": 3, "pixels": [[8, 8]], "radius": 1 },
      { "erase": true, "points": [[1, 1, 1]], "normal": [0, 0, 1], "radius": 1, "depth": 2 }
    ] }
  }, "surfaces": { "environment": { "file": "@sky.hdr" } } },
  "light_map": { "extent": { "min": [-2, -1], "max": [2, 1] } },
  "solve": { "quadrature": { "march": { "steps": 64 } } }
}"##;

/// What moves in it, put in before its last bracket.
const LIGHT_ANIMATION: &str = r##",
  "animation": { "frames": 9, "keys": [
    { "frame": 0 },
    { "frame": 8, "light": { "direction": [0, -1, 0] }, "looks": { "occluders": [{ "fill": { "texels": 3 } }] }, "views": [
      { "name": "front", "camera": { "to_world": {}, "fov": 50, "size": [64, 48] }, "layers": ["@dusk.png"],
        "strokes": [{ "points": [[8, 8]], "radius": 3, "color": "#ff8000" }] },
      { "name": "side" }
    ] }
  ] }
}"##;

fn light_animation() -> String {
    LIGHT_MAP.strip_suffix("\n}").unwrap().to_owned() + LIGHT_ANIMATION
}

/// The same of a volume that changes from frame to frame.
const ANIMATION: &str = r##"{
  "version": 1,
  "volume": {
    "extinction": { "file": "@smoke_###.vdb" },
    "albedo": { "value": 0.5 },
    "emission": { "made": {
      "shapes": [
        { "sphere": { "center": [0, 0, 0], "radius": 0.7 } },
        { "capsule": { "from": [0, 0, 0], "to": [0, 0, 1], "radii": [0.5, 0.7] } }
      ],
      "inside": 8, "edge": 0.2, "noise": {}
    } },
    "refraction": { "index": { "file": "@index.npy" } }
  },
  "find": "environment-then-joint",
  "lights": [{ "direction": [0, -1, 0] }, { "gltf": { "file": "@sun.glb" } }],
  "environment": { "file": "@sky.hdr", "lights": { "map": [24, 12] } },
  "occluders": [{ "obj": { "file": "@hall.obj" } }],
  "views": [{
    "name": "front", "camera": { "to_world": {}, "fov": 40, "size": [64, 48] },
    "picture": "@picture.exr", "weight": "@weight.png", "mask": "@mask.png", "background": "@back.png",
    "layers": ["@layer.png"]
  }],
  "transforms": { "file": "@transforms.json" },
  "bounds": { "albedo": { "lower": 0.25 } },
  "animation": { "frames": 9, "keys": [
    { "frame": 0, "albedo": { "file": "@albedo.vol" }, "emission": { "file": "@emission.npz" } },
    { "frame": 8, "extinction": { "file": "@other.vdb" }, "views": [{
      "name": "front", "picture": "@picture.exr", "weight": "@weight.png", "mask": "@mask.png", "layers": ["@layer.png"]
    }] }
  ] }
}"##;

/// The document of a text in a file, settled but for what the schema says.
fn settled<D: Describes>(text: &str, file: &Path) -> D {
    let mut source = SceneText { file, text, set: Vec::new() };
    let mut read: D = document(&mut source, &[]).unwrap();
    read.settle(file);
    read
}

/// The same as it is written to a folder.
fn written<D: Describes>(text: &str, file: &Path, folder: &Path) -> String {
    Resolved::new(&settled::<D>(text, file), D::SUBJECT, file).unwrap().text_in(folder, &[]).unwrap()
}

/// All documents of light maps, then of volumes: the demos, the two above, and the first with less in it, each as it is written beside itself.
fn all() -> [Vec<String>; 2] {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("strokes");
    let files = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    let files = files.filter(|file| file.extension().is_some_and(|extension| extension == "json"));
    let mut texts: Vec<_> = files.map(|file| (std::fs::read_to_string(&file).unwrap(), file)).collect();
    let dark = changed(LIGHT_MAP, ", \"environment\": { \"file\": \"@sky.hdr\" }", "");
    let grey =
        changed(LIGHT_MAP, "true, \"environment\": { \"file\": \"@sky.hdr\" }", "true, \"environment\": {}");
    let fitted = changed(&grey, "\"extent\": { \"min\": [-2, -1], \"max\": [2, 1] }", "");
    let made = [dark, light_animation(), fitted, LIGHT_MAP.to_owned(), ANIMATION.to_owned()];
    texts.extend(made.map(|text| (text, folder.join("scene.json"))));
    let (volumes, light_maps): (Vec<_>, Vec<_>) =
        texts.into_iter().partition(|(text, _)| text.contains("\"volume\""));
    assert_eq!((volumes.len(), light_maps.len()), (5, 9));
    let of = |(text, file): (String, PathBuf)| whole::<Document>(&text, &file);
    let of_volume = |(text, file): (String, PathBuf)| whole::<VolumeDocument>(&text, &file);
    [light_maps.into_iter().map(of).collect(), volumes.into_iter().map(of_volume).collect()]
}

/// The text that is written of a document, once it is known to be the same document.
fn whole<D: Describes + PartialEq + std::fmt::Debug>(text: &str, file: &Path) -> String {
    let beside = file.parent().unwrap();
    let whole = written::<D>(text, file, beside);
    assert!(settled::<D>(text, file) == settled::<D>(&whole, Path::new("another.json")), "{whole}");
    assert!(
        written::<D>(&whole, &beside.join("another.json"), beside) == whole,
        "nothing is left to be put in"
    );
    whole
}

/// Which properties of which objects a value does not have, as `Object.property`; names of the objects that it has.
fn absent(value: &Value, schema: &Value, root: &Value, name: &str, into: &mut [BTreeSet<String>; 2]) {
    if let Some(definition) = schema["$ref"].as_str() {
        let name = definition.rsplit('/').next().unwrap();
        return absent(value, root.pointer(&definition[1..]).unwrap(), root, name, into);
    }
    if let Value::Object(object) = value
        && let Some(properties) = schema["properties"].as_object()
    {
        into[1].insert(name.to_owned());
        for (key, property) in properties {
            match object.get(key) {
                Some(value) => absent(value, property, root, key, into),
                None => {
                    into[0].insert(format!("{name}.{key}"));
                }
            }
        }
        return;
    }
    for element in value.as_array().into_iter().flatten() {
        absent(element, &schema["items"], root, name, into);
    }
    let alternatives = ["anyOf", "oneOf"].iter().filter_map(|key| schema[key].as_array()).flatten();
    for alternative in alternatives {
        let required = alternative["required"].as_array().into_iter().flatten();
        if required.into_iter().all(|key| value.get(key.as_str().unwrap()).is_some()) {
            absent(value, alternative, root, name, into);
        }
    }
}

fn absent_of(texts: &[String], subject: Subject) -> [BTreeSet<String>; 2] {
    let (root, mut sets) = (schema(subject), Default::default());
    let title = root["title"].as_str().unwrap();
    for text in texts {
        absent(&serde_json::from_str(text).unwrap(), &root, &root, title, &mut sets);
    }
    sets
}

#[test]
fn resolved_documents_have_every_setting_of_the_schema() {
    let allowed: BTreeSet<String> = WITHOUT_VALUE
        .iter()
        .flat_map(|(name, keys)| keys.iter().map(move |key| format!("{name}.{key}")))
        .collect();
    let subjects = [Subject::LightMap, Subject::Volume];
    let [mut missing, mut met] = <[BTreeSet<String>; 2]>::default();
    for (texts, subject) in all().iter().zip(subjects) {
        let [absent, also_met] = absent_of(texts, subject);
        missing.extend(absent);
        met.extend(also_met);
    }
    for (name, definition) in
        subjects.map(|subject| schema(subject)["$defs"].clone()).iter().flat_map(Value::as_object).flatten()
    {
        assert!(definition["properties"].is_null() || met.contains(name), "{name} is in no document here");
    }
    let forgotten: Vec<_> = missing.difference(&allowed).collect();
    assert!(forgotten.is_empty(), "not written, see `settle` and `!skip_serializing_if`: {forgotten:?}");
    let idle: Vec<_> = allowed.difference(&missing).collect();
    assert!(idle.is_empty(), "always written, so no exceptions: {idle:?}");

    // Documents as they are written by hand lack what they may, and that is noticed.
    let [absent, _] = absent_of(&[LIGHT_MAP.to_owned()], Subject::LightMap);
    for name in
        ["unscatter scene.name", "unscatter scene.exposure", "Solve.skip", "Sky.shadow_map", "LookAt.up"]
    {
        assert!(absent.contains(name), "{name} is not among {absent:?}");
    }
}

#[test]
fn settings_that_depend_on_others_are_written_where_they_mean_something() {
    let [light_maps, volumes] = all().map(|texts| {
        texts.iter().map(|text| serde_json::from_str::<Value>(text).unwrap()).collect::<Vec<_>>()
    });
    let (hall, smoke) = (light_maps.last().unwrap(), volumes.last().unwrap());
    assert_eq!(hall["name"], "scene");
    assert!(hall["light"].get("radiance").is_none(), "a glTF sun has a colour of its own");
    let cameras = [&hall["views"][0]["camera"], &hall["views"][1]["camera"]];
    assert_eq!(cameras.map(|camera| camera.get("fov_axis").is_some()), [true, false]);
    let sky = &hall["surroundings"]["environment"];
    assert_eq!((&sky["radiance"], &sky["lights"]["count"]), (&Value::from(1), &Value::from(128)));
    assert_eq!(smoke["lights"][0]["radiance"], 1);
    assert!(smoke["environment"]["lights"].get("count").is_none(), "a map has no discs");
    assert_eq!((&smoke["animation"]["first_file"], &smoke["rounds"]), (&Value::from(0), &Value::from(1)));
    assert_eq!((&smoke["hull"], &smoke["bounds"]["albedo"]["upper"]), (&Value::from(true), &Value::from(1)));
    assert_eq!(
        (&smoke["bounds"]["albedo"]["lower"], &smoke["bounds"]["emission"]["lower"]),
        (&Value::from(0.25), &Value::from(0))
    );
    assert_eq!(smoke["animation"]["keys"][1]["views"][0]["keep"], 1);
    let moving = light_maps.iter().find(|scene| scene["animation"]["frames"] == 9).unwrap();
    let key = &moving["animation"]["keys"][1];
    assert_eq!(
        (&moving["animation"]["light_map"], &key["light"]["radiance"]),
        (&Value::from("each"), &Value::from(1))
    );
    assert_eq!(key["views"][0]["camera"]["fov_axis"], "y");
    // Without a word of an environment there is the one that the solve begins with.
    let bare = changed(
        ANIMATION,
        "  \"environment\": { \"file\": \"@sky.hdr\", \"lights\": { \"map\": [24, 12] } },\n",
        "",
    );
    let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("scene.json");
    let bare: Value = serde_json::from_str(&whole::<VolumeDocument>(&bare, &here)).unwrap();
    assert_eq!(
        (&bare["environment"]["radiance"], &bare["environment"]["directions"]),
        (&Value::from(0), &Value::from(64))
    );
}

fn changed(text: &str, from: &str, to: &str) -> String {
    assert_eq!(text.matches(from).count(), 1, "{from}");
    text.replace(from, to)
}

/// All strings of a value with this in them.
fn strings<'a>(value: &'a Value, part: &str) -> Vec<&'a str> {
    match value {
        Value::String(text) if text.contains(part) => vec![text],
        Value::Array(elements) => elements.iter().flat_map(|element| strings(element, part)).collect(),
        Value::Object(object) => object.values().flat_map(|value| strings(value, part)).collect(),
        _ => Vec::new(),
    }
}

#[test]
fn every_file_of_a_document_is_named_anew() {
    let folder = tempfile::tempdir().unwrap();
    let [scenes, results] = ["scenes/hall", "out/hall"].map(|name| folder.path().join(name));
    for path in [&scenes, &results] {
        std::fs::create_dir_all(path).unwrap();
    }
    let file = scenes.join("scene.json");
    for (text, written) in [
        (LIGHT_MAP, written::<Document>(LIGHT_MAP, &file, &results)),
        (&light_animation(), written::<AnimatedDocument>(&light_animation(), &file, &results)),
        (ANIMATION, written::<VolumeDocument>(ANIMATION, &file, &results)),
        (ANIMATION, written::<Animated>(ANIMATION, &file, &results)),
    ] {
        let [before, after]: [Value; 2] = [text, &written].map(|text| serde_json::from_str(text).unwrap());
        let mut expected: Vec<String> =
            strings(&before, "@").iter().map(|name| format!("../../scenes/hall/{name}")).collect();
        expected.sort();
        let mut got = strings(&after, "@");
        got.sort_unstable();
        assert_eq!(got, expected);
    }
}

#[test]
fn a_resolved_file_is_the_same_scene() {
    let folder = tempfile::tempdir().unwrap();
    let moving = r#"{"version": 1, "find": "joint",
        "volume": { "size": 5, "albedo": 0.5, "extinction": { "made": {
            "shapes": [{ "sphere": { "center": [0.5, 0.5, 0.5], "radius": 0.3 } }], "inside": 8, "edge": 0.2, "noise": {} } } },
        "environment": { "lights": { "over": "upper-hemisphere" } },
        "lights": [{ "direction": [0, -1, 0] }],
        "views": [{ "name": "v", "camera": { "to_world": { "translate": [0.5, 0.5, 4] }, "fov": 30, "size": [8, 8] },
            "strokes": [{ "points": [[4, 4]], "radius": 2, "color": [1, 0, 0] }] }],
        "animation": { "frames": 3, "between": "shapes", "keys": [{ "frame": 0 }, { "frame": 2 }] } }"#;
    let hall = r#"{"version": 1, "light": { "direction": [0, -1, 0.1] }, "medium": { "sigma_t": 1 },
        "surroundings": { "sun": true, "environment": {} },
        "occluders": [{ "box": { "center": [0, 1, 0], "size": [1, 1, 1] } }],
        "views": [{ "name": "v", "camera": { "to_world": {}, "fov": 50, "size": [8, 8] } }]}"#;
    let dawn = r#"{"version": 1, "light": { "direction": [0, -1, 0.1] }, "medium": { "sigma_t": 1 },
        "occluders": [{ "box": { "center": [0, 1, 0], "size": [1, 1, 1] } }],
        "views": [{ "name": "v", "camera": { "to_world": {}, "fov": 50, "size": [8, 8] },
            "strokes": [{ "points": [[4, 4]], "radius": 2, "color": [1, 0, 0] }] }],
        "animation": { "frames": 3, "keys": [{ "frame": 0 }, { "frame": 2, "light": { "direction": [1, -1, 0] },
            "views": [{ "name": "v", "camera": { "to_world": { "translate": [1, 0, 0] }, "fov": 40, "size": [8, 8] } }] }] } }"#;
    for text in [moving, hall, dawn] {
        let [first, second] = ["first.json", "second.json"].map(|name| folder.path().join(name));
        std::fs::write(&first, text).unwrap();
        let set = ["exposure=0.5".to_owned()];
        let scenes = if text == moving {
            let (scene, resolved) = SceneFile::read(&first).unwrap().open::<Animated>(&set).unwrap();
            std::fs::write(&second, resolved.text_in(folder.path(), &[]).unwrap()).unwrap();
            [
                format!("{scene:?}"),
                format!("{:?}", SceneFile::read(&second).unwrap().open::<Animated>(&[]).unwrap().0),
            ]
        } else if text == dawn {
            let (scene, resolved) = SceneFile::read(&first).unwrap().open::<AnimatedDocument>(&set).unwrap();
            std::fs::write(&second, resolved.text_in(folder.path(), &[]).unwrap()).unwrap();
            [
                format!("{scene:?}"),
                format!("{:?}", SceneFile::read(&second).unwrap().open::<AnimatedDocument>(&[]).unwrap().0),
            ]
        } else {
            let (scene, resolved) = SceneFile::read(&first).unwrap().open::<Document>(&set).unwrap();
            std::fs::write(&second, resolved.text_in(folder.path(), &[]).unwrap()).unwrap();
            [
                format!("{scene:?}"),
                format!("{:?}", SceneFile::read(&second).unwrap().open::<Document>(&[]).unwrap().0),
            ]
        };
        // What lies between two keys are documents still, of which the second says more.
        let [first, second] = scenes.map(|text| text.split("frames: Frames").next().unwrap().to_owned());
        assert!(
            first == second
                && first.len() > 1000
                && (first.contains("exposure: 0.5") || first.contains("exposure: Some(0.5)")),
            "{first}\n{second}"
        );
    }
}

#[test]
fn numbers_that_json_cannot_hold_never_reach_a_document() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.json");
    let small = r#"{"version": 1, "light": {"direction": [0, -1, 0]}, "medium": {"sigma_t": 1},
        "views": [{"name": "v", "camera": {"to_world": {}, "fov": 50, "size": [8, 8]}}]}"#;
    std::fs::write(&file, small).unwrap();
    assert!(SceneFile::read(&file).unwrap().open::<Document>(&["exposure=1".to_owned()]).is_ok());
    for word in ["NaN", "nan", "inf", "-Infinity", "1e999", "null"] {
        let refused = SceneFile::read(&file).unwrap().open::<Document>(&[format!("exposure={word}")]);
        assert!(matches!(refused, Err(Error::Scene { .. })), "{word}");
    }
    // Where one comes about all the same it is an error, and no null.
    let mut made: Document = serde_json::from_str(small).unwrap();
    made.exposure = Exposure(Some(f64::NAN));
    made.settle(&file);
    let refused = Resolved::new(&made, Subject::LightMap, &file).unwrap().text_in(folder.path(), &[]);
    assert!(matches!(refused, Err(Error::NonFinite { place, .. }) if place == "exposure"));
}
