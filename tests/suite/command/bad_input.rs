//! Bad input, one case after another: exit 1, the place and what to do, no panic, and no result.

use std::fs;

use serde_json::{Value, json};

use super::{Desk, Ran, scene, scene_with};

/// Solves, which must fail as the input's fault and write nothing.
fn refused(desk: &Desk, more: &[&str]) -> Ran {
    let before = desk.files(".");
    let ran = desk.run(&[&["light-map", "scene.json", "-o", "out"], more].concat()).exits_with(1);
    assert!(ran.out.is_empty(), "nothing on standard output: {}", ran.out);
    assert!(desk.names("out").is_empty(), "{:?} was written by {}", desk.names("out"), ran.arguments);
    assert!(desk.files(".") == before);
    ran
}

/// The file, a line and a column that are not just the beginning.
fn tells_a_place(ran: &Ran) {
    let told = ran.told();
    let place = told.split_once("scene.json:").unwrap_or_else(|| panic!("no place in `{told}`")).1;
    let numbers: Vec<usize> = place.split(':').take(2).map(|number| number.parse().unwrap()).collect();
    assert!(numbers[0] > 1 && numbers[1] >= 1, "{told}");
}

#[test]
fn files_that_are_missing_or_not_scenes() {
    let desk = Desk::new();
    let table: [(&str, Option<&[u8]>, &str); 12] = [
        ("missing.json", None, "missing.json"),
        ("empty.json", Some(b""), "empty.json:1:1"),
        ("spaces.json", Some(b"  \n\n "), "spaces.json:3:"),
        ("binary.json", Some(b"\x00\x01\x02"), "binary.json:1:1"),
        ("latin1.json", Some(b"{\n \"name\": \"caf\xe9\""), "latin1.json:2:14"),
        ("utf16.json", Some(b"\xff\xfe{\0"), "the text is UTF-16"),
        ("list.json", Some(b"[]"), "list.json:1:1"),
        ("null.json", Some(b"null"), "null.json:1:1"),
        ("object.json", Some(b"{}"), "missing field `version`"),
        ("twice.json", Some(b"{\"version\": 1,\n\"version\": 1}"), "twice.json:2:1"),
        ("after.json", Some(b"{}\n{}"), "after.json:2:1"),
        ("number.json", Some(b"{\"version\": 1e999}"), "number out of range"),
    ];
    for (name, content, words) in table {
        if let Some(content) = content {
            desk.put(name, content);
        }
        for command in ["light-map", "plan", "check", "matrix", "render"] {
            desk.run(&[command, name]).exits_with(1).tells(words);
        }
    }
    fs::create_dir(desk.path("folder.json")).unwrap();
    desk.run(&["light-map", "folder.json"]).exits_with(1).tells("folder.json");
    desk.put("deep.json", "[".repeat(100_000));
    desk.run(&["light-map", "deep.json"]).exits_with(1).tells("recursion limit");
    assert!(!desk.path("out").exists());
}

#[test]
fn a_scene_that_is_cut_short_anywhere() {
    let desk = Desk::new();
    let whole = desk.read("scene.json");
    for part in 1..16 {
        desk.put("scene.json", &whole[..whole.len() * part / 16]);
        tells_a_place(&refused(&desk, &[]).tells("EOF"));
    }
}

/// JSON pointer, value, and what a person is told.
fn bad_values() -> Vec<(&'static str, Value, &'static str)> {
    let a_camera = |size: [i64; 2]| json!({ "to_world": {}, "fov": 45, "size": size });
    vec![
        // Unknown and misspelt names.
        ("/medum", json!({}), "did you mean `medium`"),
        ("/medium/sigmat", json!(1), "did you mean `sigma_t`"),
        ("/views/0/camera/fovaxis", json!("x"), "did you mean `fov_axis`"),
        ("/views/0/strokes/0/colour", json!("#ffffff"), "did you mean `color`"),
        ("/occluders/0", json!({ "spheer": {} }), "did you mean `sphere`"),
        ("/light_map/basis", json!("billinear"), "did you mean `bilinear`"),
        ("/solve/solver", json!("cgsl"), "did you mean `cgls`"),
        ("/solve/strategy", json!("matrixfree"), "did you mean `matrix-free`"),
        ("/frobnicate", json!(1), "unknown field `frobnicate`"),
        // Wrong kinds of values.
        ("/version", json!(2), "version"),
        ("/version", json!("1"), "version"),
        ("/views", json!([]), "no view"),
        ("/views", json!({}), "views"),
        ("/views/0/name", json!(7), "views[0].name"),
        ("/light/direction", json!([1, 2]), "light.direction"),
        ("/light/direction", json!("down"), "light.direction"),
        ("/medium/sigma_t", json!("thick"), "medium.sigma_t"),
        ("/medium/sigma_t", json!([0.1, 0.1]), "medium.sigma_t"),
        ("/light_map/size", json!(1.5), "light_map.size"),
        ("/light_map/size", json!([8]), "light_map.size"),
        ("/views/0/strokes/0/points", json!([[1]]), "points"),
        ("/views/0/strokes/0/color", json!("red"), "color"),
        // Numbers that cannot be.
        ("/light/direction", json!([0, 0, 0]), "light"),
        ("/light/direction", json!([1e-320, 0, 0]), "light"),
        ("/light/direction", json!([1e308, 1e308, 1e308]), "light"),
        ("/light/radiance", json!(-1), "radiance"),
        ("/light/radiance", json!(1e300), "radiance"),
        ("/light", json!({}), "either `direction` or `gltf`"),
        ("/medium/sigma_t", json!(0), "sigma_t"),
        ("/medium/sigma_t", json!(-0.1), "sigma_t"),
        ("/medium/sigma_t", json!([0.1, 0.1, 0]), "sigma_t"),
        ("/medium/albedo", json!(1.1), "albedo"),
        ("/medium/albedo", json!(-0.1), "albedo"),
        ("/medium/g", json!(1), "g"),
        ("/medium/g", json!(-1), "g"),
        ("/ambient", json!(-1), "ambient"),
        ("/exposure", json!(1000), "exposure"),
        // Sizes.
        ("/views/0/camera", a_camera([0, 36]), "views[0].camera"),
        ("/views/0/camera", a_camera([-64, 36]), "views[0].camera.size"),
        ("/views/0/camera", a_camera([16385, 1]), "from 1 to 16384"),
        ("/views/0/camera", a_camera([i64::MAX, i64::MAX]), "from 1 to 16384"),
        ("/light_map/size", json!(0), "light_map.size"),
        ("/light_map/size", json!(-4), "light_map.size"),
        ("/light_map/size", json!([32, 8193]), "light_map.size"),
        ("/light_map/size", json!(u64::MAX), "light_map.size"),
        ("/light_map/extent", json!({ "min": [0, 0], "max": [0, 1] }), "light_map.extent"),
        ("/light_map/extent", json!({ "min": [0, 0], "max": [-1, 1] }), "light_map.extent"),
        ("/shadow_map/size", json!(32), "shadow_map.size"),
        ("/shadow_map/size", json!(100_000), "shadow_map.size"),
        // Cameras.
        ("/views/0/camera/fov", json!(0), "fov"),
        ("/views/0/camera/fov", json!(180), "fov"),
        ("/views/0/camera/fov", json!(-45), "fov"),
        ("/views/0/camera/to_world", json!({ "scale": 0 }), "to_world"),
        ("/views/0/camera/to_world", json!({ "scale": [1, 0, 1] }), "to_world"),
        (
            "/views/0/camera/to_world",
            json!({ "matrix": [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]] }),
            "to_world",
        ),
        ("/views/0/camera/to_world/look_at", json!({ "origin": [1, 1, 1], "target": [1, 1, 1] }), "to_world"),
        ("/views/0/camera/to_world/look_at/up", json!([5, 0, -7]), "to_world"),
        ("/views/0/camera/gltf", json!({ "file": "a.glb", "node": "b" }), "either `gltf`, or"),
        // Names that would not do for files.
        ("/views/0/name", json!(""), "views[0].name"),
        ("/views/0/name", json!("../left"), "views[0].name"),
        ("/views/0/name", json!("RIGHT"), "views[1].name"),
        // Strokes.
        ("/views/0/strokes/0/points", json!([]), "views[0].strokes[0].points"),
        ("/views/0/strokes/0/points", json!([[1e300, 0]]), "points[0]"),
        ("/views/0/strokes/0/points", json!([[-40, -40], [-20, 99]]), "outside the view"),
        ("/views/0/strokes/0/points", json!([[64.0, 100.0]]), "views[0].strokes[0]"),
        ("/views/0/strokes/0/radius", json!(0), "views[0].strokes[0].radius"),
        ("/views/0/strokes/0/radius", json!(-3), "views[0].strokes[0].radius"),
        ("/views/0/strokes/0/radius", json!(1e9), "views[0].strokes[0].radius"),
        ("/views/0/strokes/0/opacity", json!(0), "opacity"),
        ("/views/0/strokes/0/opacity", json!(1.5), "opacity"),
        ("/views/0/strokes/0/hardness", json!(2), "hardness"),
        ("/views/0/strokes/0/color", json!([0, -1, 0]), "color"),
        ("/views/0/strokes/0/color", json!([0, 1e300, 0]), "color"),
        // Occluders.
        ("/occluders/2/box/size", json!([1, 0, 1]), "occluders[2].box.size"),
        ("/occluders/2/box/size", json!([1, -1, 1]), "occluders[2].box.size"),
        ("/occluders/2/box/center", json!([1e300, 0, 0]), "occluders[2].box.center"),
        ("/occluders/2/box/albedo", json!(2), "albedo"),
        ("/occluders/0/plane/sides", json!([[1, 0, 0], [2, 0, 0]]), "span an area"),
        ("/occluders/0", json!({ "sphere": { "center": [0, 0, 0], "radius": 0 } }), "radius"),
        (
            "/occluders/0",
            json!({ "cylinder": { "from": [0, 0, 0], "to": [0, 0, 0], "radius": 1 } }),
            "cylinder.to",
        ),
        // The solve.
        ("/solve/iterations", json!(0), "solve.iterations"),
        ("/solve/iterations", json!(1e9), "solve.iterations"),
        ("/solve/tolerance", json!(-1), "solve.tolerance"),
        ("/solve/tolerance", json!(1), "solve.tolerance"),
        ("/solve/seconds", json!(0), "solve.seconds"),
        ("/solve/tikhonov", json!(-1), "solve.tikhonov"),
        ("/solve/memory", json!("4 cats"), "solve.memory"),
        ("/solve/quadrature", json!({ "march": { "steps": 0 } }), "steps"),
        ("/solve/quadrature", json!({ "march": { "steps": 4_294_967_296_u64 } }), "steps"),
        ("/solve/transmittance_bound", json!(1), "transmittance_bound"),
    ]
}

#[test]
fn values_that_cannot_be_are_refused_at_their_place() {
    let desk = Desk::new();
    for (pointer, value, words) in bad_values() {
        desk.put("scene.json", serde_json::to_string_pretty(&scene_with(pointer, value)).unwrap());
        tells_a_place(&refused(&desk, &[]).tells(words));
    }
    desk.put("scene.json", serde_json::to_string_pretty(&scene()).unwrap());
    desk.done(&["light-map", "scene.json", "-o", "out"]);
}

#[test]
fn overrides_that_lead_nowhere_or_hold_nothing() {
    let desk = Desk::new();
    for (set, words) in [
        ("light_map", "path=value"),
        ("=1", "path=value"),
        ("views[7].name=x", "views[7]"),
        ("veiws[0].name=x", "veiws"),
        ("views[-1].name=x", "path=value"),
        ("views.name=x", "views"),
        ("light_map.sise=4", "did you mean `size`"),
        ("light_map.size=4000000", "set by --set"),
        ("version=", "version"),
        ("medium.sigma_t=NaN", "medium.sigma_t"),
        ("medium.sigma_t=inf", "medium.sigma_t"),
    ] {
        refused(&desk, &["--set", set]).tells(words);
    }
    for size in ["lots", "0", "\""] {
        let arguments = ["light-map", "scene.json", "-o", "out", "--memory", size];
        desk.run(&arguments).exits_with(2).tells("--memory <SIZE>");
    }
    refused(&desk, &["--iterations", "0"]).tells("solve.iterations");
    refused(&desk, &["--tolerance", "nan"]).tells("solve.tolerance");
    refused(&desk, &["--tolerance", "2"]).tells("solve.tolerance");
    refused(&desk, &["--solver", "magic"]).tells("solve.solver");
}

#[test]
fn scenes_with_nothing_to_solve_say_so() {
    let mut unpainted = scene_with("/views/0/strokes", json!([]));
    unpainted["views"][1]["strokes"] = json!([]);
    refused(&Desk::with(&unpainted), &[]).tells("no pixel is painted").tells("add strokes");
    let roof = json!({ "plane": { "center": [0, 90, 0], "sides": [[500, 0, 0], [0, 0, 500]] } });
    refused(&Desk::with(&scene_with("/occluders/0", roof)), &[]).tells("the rest is in shadow");
    // The views see the walls of the inner room, far from where the roof of the outer one ends.
    let room = |side: f64| json!({ "box": { "center": [0, 0, 0], "size": [side, side, side] } });
    refused(&Desk::with(&scene_with("/occluders", json!([room(30.0), room(300.0)]))), &[])
        .tells("painted pixels is in shadow");
    let faint = json!([{ "points": [[10, 10]], "radius": 2, "opacity": 0.001, "color": "#ffffff" }]);
    refused(&Desk::with(&scene_with("/views/0/strokes", faint)), &[]).tells("strokes[0]");
    let thin = json!([{ "points": [[10, 10]], "radius": 1e-9, "color": "#ffffff" }]);
    refused(&Desk::with(&scene_with("/views/0/strokes", thin)), &[]).tells("strokes[0]");
}

/// Writes a file for the first view's layer or the first occluder, and solves.
fn refused_file(field: &str, name: &str, content: &[u8]) -> Ran {
    let (pointer, value) = match field {
        "layer" => ("/views/0/layers", json!([name])),
        "sun" => ("/light", json!({ "gltf": { "file": name } })),
        "camera" => ("/views/0/camera", json!({ "gltf": { "file": name, "node": "Eye" }, "size": [64, 36] })),
        other => ("/occluders/0", json!({ other: { "file": name } })),
    };
    let desk = Desk::with(&scene_with(pointer, value));
    desk.put(name, content);
    let ran = refused(&desk, &[]);
    tells_a_place(&ran);
    assert!(ran.told().contains(name), "{}", ran.told());
    ran
}

#[test]
fn files_that_a_scene_names() {
    for (pointer, value) in [
        ("/views/0/layers", json!(["missing.png"])),
        ("/occluders/0", json!({ "gltf": { "file": "missing.png" } })),
        ("/occluders/0", json!({ "obj": { "file": "missing.png" } })),
        ("/light", json!({ "gltf": { "file": "missing.png" } })),
        ("/views/0/layers", json!([""])),
        ("/views/0/layers", json!(["."])),
    ] {
        let words = if value.to_string().contains("missing") { "missing.png" } else { "layers[0]" };
        tells_a_place(&refused(&Desk::with(&scene_with(pointer, value)), &[]).tells(words));
    }
    for field in ["layer", "gltf", "obj", "sun", "camera"] {
        refused_file(field, "empty.bin", b"");
        refused_file(field, "noise.bin", &[0xa7; 4096]);
        refused_file(field, "words.bin", "nothing of the kind\n".repeat(50).as_bytes());
    }
    for content in ["{}", "{\"asset\": {\"version\": \"2.0\"}}", "[1]", "null"] {
        for field in ["gltf", "sun", "camera"] {
            refused_file(field, "empty.gltf", content.as_bytes());
        }
    }
    for content in
        ["v 0 0 0\nv 1 0 0\nv 0 1 0\n", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "v a b c\nf 1 1 1\n"]
    {
        refused_file("obj", "few.obj", content.as_bytes());
    }
}

#[test]
fn gltf_files_with_indices_and_numbers_out_of_range() {
    let triangle = |count: u64, index: u16, corner: f32| {
        let mut bytes = Vec::new();
        for value in [0.0, 0.0, 0.0, corner, 0.0, 0.0, 0.0, 1.0, 0.0] {
            bytes.extend(f32::to_le_bytes(value));
        }
        for value in [0, 1, index, 0] {
            bytes.extend(u16::to_le_bytes(value));
        }
        use base64::Engine;
        let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
        let position = json!({ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] });
        json!({
            "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
            "buffers": [{ "byteLength": bytes.len(), "uri": format!("data:application/octet-stream;base64,{data}") }],
            "bufferViews": [{ "buffer": 0, "byteLength": 36 }, { "buffer": 0, "byteOffset": 36, "byteLength": 8 }],
            "accessors": [position, { "bufferView": 1, "componentType": 5123, "count": count, "type": "SCALAR" }]
        })
        .to_string()
    };
    let desk = Desk::with(&scene_with("/occluders/0", json!({ "gltf": { "file": "t.gltf" } })));
    desk.put("t.gltf", triangle(3, 2, 1.0));
    desk.done(&["light-map", "scene.json", "-o", "out"]);
    for content in [
        triangle(3, 3, 1.0),
        triangle(3, u16::MAX, 1.0),
        triangle(3, 2, f32::NAN),
        triangle(3, 2, f32::INFINITY),
        triangle(3, 2, 1e30),
        triangle(3_000_000_000, 2, 1.0),
        triangle(u64::MAX, 2, 1.0),
        triangle(0, 2, 1.0),
    ] {
        refused_file("gltf", "t.gltf", content.as_bytes());
    }
}

#[test]
fn layers_that_do_not_fit_or_hold_no_numbers() {
    let desk = Desk::with(&scene_with("/views/0/layers", json!(["paint.exr"])));
    let paint = |size, pixel: [f32; 4]| {
        super::pictures::write_rgba_exr(&desk.path("paint.exr"), size, move |x, y| {
            if (x, y) == (5, 7) { pixel } else { [0.5, 0.5, 0.5, 1.0] }
        });
    };
    for (pixel, words) in [
        ([f32::NAN, 0.0, 0.0, 1.0], "pixel (5, 7)"),
        ([0.0, f32::INFINITY, 0.0, 1.0], "pixel (5, 7)"),
        ([0.0, 0.0, 0.0, f32::NAN], "pixel (5, 7)"),
        ([0.0, 0.0, 0.0, 1.5], "pixel (5, 7)"),
        ([0.0, 0.0, 0.0, -0.5], "pixel (5, 7)"),
    ] {
        paint([64, 36], pixel);
        tells_a_place(&refused(&desk, &[]).tells(words));
    }
    paint([36, 64], [0.5; 4]);
    tells_a_place(&refused(&desk, &[]).tells("36 x 64").tells("64 x 36"));
    paint([64, 36], [0.5; 4]);
    let whole = desk.read("paint.exr");
    for part in [1, 4, 20, 63] {
        desk.put("paint.exr", &whole[..whole.len() * part / 64]);
        tells_a_place(&refused(&desk, &[]).tells("paint.exr"));
    }
    image::RgbImage::new(64, 36).save(desk.path("paint.png")).unwrap();
    let opaque = Desk::with(&scene_with("/views/0/layers", json!(["paint.png"])));
    opaque.put("paint.png", desk.read("paint.png"));
    tells_a_place(&refused(&opaque, &[]).tells("alpha"));
    desk.put("paint.exr", whole);
    desk.done(&["light-map", "scene.json", "-o", "out"]);
}

#[test]
fn light_maps_to_render_with_are_read_with_the_same_care() {
    let desk = Desk::new();
    desk.put("empty.exr", b"");
    for (file, words) in
        [("missing.exr", "missing.exr"), ("empty.exr", "empty.exr"), ("scene.json", "scene.json")]
    {
        desk.run(&["render", "scene.json", "-o", "out", "--light-map", file]).exits_with(1).tells(words);
        assert!(desk.names("out").is_empty());
    }
}

/// Memory is checked by sizes alone: a second is enough to refuse what would take minutes to fill.
#[test]
fn sizes_beyond_the_memory_are_refused_at_once() {
    let desk = Desk::new();
    for set in ["views[0].camera.size=[16384, 16384]", "light_map.size=8192", "shadow_map.size=8192"] {
        for command in ["light-map", "render", "plan", "check", "matrix"] {
            let begun = std::time::Instant::now();
            let ran = desk.run(&[command, "scene.json", "--memory", "64MiB", "--set", set]).exits_with(1);
            ran.tells("MiB are allowed").tells("--memory");
            assert!(begun.elapsed().as_secs_f64() < 5.0, "{command} {set} took {:?}", begun.elapsed());
        }
    }
    refused(&desk, &["--memory", "1MiB"]).tells("1 MiB are allowed");
    let tight = ["--set", "solve.strategy=assembled", "--memory", "68MiB", "--set", "light_map.size=64"];
    refused(&desk, &[&tight[..], &["--set", "views[0].strokes[0].radius=90"]].concat()).tells("matrix-free");
}

/// Programs write files of one line, and nobody finds a mistake in a wall of text.
#[test]
fn a_file_of_one_long_line_is_not_shown() {
    let mut scene = scene();
    scene["medium"]["sigma_t"] = json!(-1);
    let desk = Desk::new();
    desk.put("scene.json", serde_json::to_string(&scene).unwrap());
    let ran = refused(&desk, &[]);
    assert!(ran.err.lines().all(|line| line.chars().count() <= 200), "{}", ran.err);
    assert!(ran.told().contains("scene.json:1:"), "{}", ran.err);
    desk.put("scene.json", serde_json::to_string_pretty(&scene).unwrap());
    let ran = refused(&desk, &[]);
    assert!(ran.err.contains("here"), "{}", ran.err);
    tells_a_place(&ran);
}
