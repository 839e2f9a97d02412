use serde_json::{Value, json};

use super::{scene, scene_with};
use crate::command::{Desk, Ran};

/// Solves, which must fail as the input's fault and write nothing.
fn refused(scene: &Value) -> Ran {
    let desk = Desk::with(scene);
    let ran = desk.run(&["volume", "scene.json", "-o", "out"]).exits_with(1);
    assert!(ran.out.is_empty(), "nothing on standard output: {}", ran.out);
    assert!(desk.names("out").is_empty(), "{:?} was written by {}", desk.names("out"), ran.arguments);
    ran
}

#[test]
fn values_that_cannot_be_are_named() {
    let table: [(&str, Value, &str); 21] = [
        ("/volume/extinction", json!(-1), "must be not negative"),
        ("/volume/extinction", json!({ "file": "none.vdb" }), "none.vdb"),
        ("/volume/extinction", json!({}), "exactly one of `value`, `file` and `made`"),
        ("/volume/extinction", json!("thick"), "a number, [r, g, b], or an object"),
        ("/volume/albedo", json!(1.5), "must be from 0 to 1"),
        ("/volume/albedo", json!([0.5, -0.1, 0.5]), "must be from 0 to 1"),
        ("/volume/emission", json!(-0.5), "must be not negative"),
        ("/volume/size", json!([0, 4, 4]), "three whole numbers from 1 to 4096"),
        ("/volume/size", json!(5000), "three whole numbers from 1 to 4096"),
        ("/volume/g", json!(1), "inside (-1, 1)"),
        ("/volume/g", json!(0.5), "0 where there is environment light"),
        ("/volume/to_world", json!({ "scale": [1, 0, 1] }), "invertible"),
        ("/volume/refraction", json!({ "index": 0 }), "must be above 0"),
        ("/volume/extinction/made/edge", json!(0), "above 0 metres"),
        ("/find", json!("emissoin"), "emission"),
        ("/bounds", json!({ "albedo": { "upper": 2 } }), "at most 1"),
        ("/pull", json!({ "emission": 0 }), "above 0"),
        ("/solve/lower", json!(0.5), "given by `bounds`"),
        ("/environment", json!({ "radiance": -1 }), "finite and not negative"),
        ("/environment/directions", json!(0), "from 1 to 16384"),
        ("/light_size", json!(0), "whole numbers from 1 to 4096"),
    ];
    for (pointer, value, words) in table {
        refused(&scene_with(pointer, value)).tells(words);
    }
}

#[test]
fn problems_without_anything_to_solve_say_what_is_missing() {
    let table: [(&str, Value, &str); 8] = [
        ("/views", json!([]), "there is no view"),
        ("/volume/extinction", json!(0), "no extinction anywhere"),
        ("/volume/to_world", json!({ "translate": [50, 0, 0] }), "no extinction anywhere"),
        ("/views/0/weight", json!("w.png"), "there is no `picture`"),
        ("/views/0/picture", json!("none.exr"), "none.exr"),
        ("/views/0/name", json!("side"), "different from the name"),
        (
            "/views/0/strokes",
            json!([{ "points": [[900, 900]], "radius": 2, "color": "#ffffff" }]),
            "outside the view",
        ),
        ("/views/0/camera", json!({ "size": [32, 30] }), "missing field `to_world`"),
    ];
    for (pointer, value, words) in table {
        refused(&scene_with(pointer, value)).tells(words);
    }
    let mut aside = scene_with("/volume/extinction", json!(1));
    aside["volume"]["to_world"] = json!({ "translate": [50, 0, 0] });
    refused(&aside).tells("wanted rays meets a voxel");
    let mut unpainted = scene();
    for view in unpainted["views"].as_array_mut().unwrap() {
        view.as_object_mut().unwrap().remove("strokes");
    }
    refused(&unpainted).tells("no view says what its picture should show");
    let mut dark = scene_with("/find", json!("albedo"));
    dark["environment"] = json!({ "radiance": 0 });
    dark["lights"] = json!([]);
    refused(&dark).tells("albedo cannot be found in the dark");
}

#[test]
fn extinction_without_a_logarithm_is_refused() {
    let mut scene = scene_with("/find", json!("extinction"));
    scene["target"] = json!("radiance");
    scene["background"] = json!(0.5);
    scene["extinction"] = json!({ "medium_radiance": 0.6 });
    for view in scene["views"].as_array_mut().unwrap() {
        view["keep"] = json!(0);
        // Beyond the medium's own radiance, as no extinction makes it.
        view["strokes"] = json!([{ "points": [[15, 15]], "radius": 5, "color": [0.9, 0.9, 0.9] }]);
    }
    refused(&scene).tells("no extinction explains them");
}

#[test]
fn empty_hulls_and_pictures_of_other_sizes_are_refused() {
    let desk = Desk::with(&scene());
    let black = unscatter::scene::Image::constant([32, 30], [0.0; 3]);
    unscatter::io::image::write_png(&desk.path("black.png"), &black, 0.0).unwrap();
    let small = unscatter::scene::Image::constant([8, 8], [0.5; 3]);
    unscatter::io::image::write_exr(&desk.path("small.exr"), &small).unwrap();
    let run = |set: &str| desk.run(&["volume", "scene.json", "-o", "out", "--set", set]).exits_with(1);
    run("views[0].mask=black.png").tells("visual hull");
    run("views[0].picture=small.exr").tells("8 x 8 pixels and its view 32 x 30");
    run("views[1].background=small.exr").tells("8 x 8 pixels and its view 32 x 30");
    assert!(desk.names("out").is_empty());
}

#[test]
fn files_that_claim_too_much_are_refused_at_once() {
    let desk = Desk::with(&scene());
    let mut npy = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    npy.extend(
        format!("{:<117}\n", "{'descr': '<f4', 'fortran_order': False, 'shape': (1000000, 1000000, 1000), }")
            .bytes(),
    );
    desk.put("vast.npy", npy);
    let mut vol = b"VOL\x03".to_vec();
    for number in [1i32, 100_000, 100_000, 100_000, 1] {
        vol.extend(number.to_le_bytes());
    }
    vol.extend([0u8; 24]);
    desk.put("vast.vol", vol);
    desk.put(
        "raw.json",
        json!({ "data": "../../etc/passwd", "size": [4, 4, 4], "channels": 1, "type": "f32" }).to_string(),
    );
    desk.put("cut.vdb", &include_bytes!("../../../fixtures/vdb/float_zip.vdb")[..5000]);
    desk.put("nan.npy", {
        let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        bytes.extend(
            format!("{:<117}\n", "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 1, 2), }").bytes(),
        );
        bytes.extend(f32::NAN.to_le_bytes());
        bytes.extend(1f32.to_le_bytes());
        bytes
    });
    for file in ["vast.npy", "vast.vol", "raw.json", "cut.vdb", "nan.npy", "black.xyz"] {
        let set = format!("volume.extinction={}", json!({ "file": file }));
        let clock = std::time::Instant::now();
        let ran = desk.run(&["volume", "scene.json", "-o", "out", "--set", &set]).exits_with(1);
        assert!(ran.told().contains(file) || ran.told().contains("extension"), "{}", ran.told());
        assert!(clock.elapsed().as_secs() < 20, "{file}");
    }
    assert!(desk.names("out").is_empty());
}

#[test]
fn a_scene_that_is_too_large_is_refused_before_it_is_made() {
    let desk = Desk::with(&scene());
    desk.run(&["volume", "scene.json", "-o", "out", "--memory", "60MiB"])
        .exits_with(1)
        .tells("raise --memory");
    assert!(desk.names("out").is_empty());
}
