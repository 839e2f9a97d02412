//! `scene.resolved.json`: what was asked lies with the results, and gives them again.

use std::fs;
use std::process::Command;

use glam::{DAffine3, DVec3};
use serde_json::{Value, json};
use unscatter::io::volume::{Format, write};
use unscatter::scene::{Samples, Volume, VoxelGrid};

use super::pictures::write_rgba_exr;
use super::{Desk, Ran, scene, volume, with};

/// A box that stands in the mist.
const BOX: &str = "v -3 0 -1\nv -2 0 -1\nv -2 3 -1\nv -3 3 -1\nf 1 2 3\nf 1 3 4\n";

/// A desk with a scene in `scenes/hall`, and room for what it names in `art`.
fn desk(scene: &Value) -> Desk {
    let desk = Desk::new();
    fs::remove_file(desk.path("scene.json")).unwrap();
    for folder in ["scenes/hall", "art", "elsewhere/far/away"] {
        fs::create_dir_all(desk.path(folder)).unwrap();
    }
    desk.put("scenes/hall/scene.json", scene.to_string());
    desk
}

/// Runs the program in a folder of the desk.
fn done_in(desk: &Desk, folder: &str, arguments: &[&str]) {
    let mut command = Command::new(crate::program());
    command.current_dir(desk.path(folder)).args(arguments).env("VK_DRIVER_FILES", "none");
    Ran::of(arguments, &command.env("VK_ICD_FILENAMES", "none").output().unwrap()).exits_with(0);
}

/// Asserts that two folders hold the same results, to the bit; times differ.
fn same_results(desk: &Desk, [one, other]: [&str; 2], least: usize) {
    let compared = |name: &str| !name.starts_with("report.") && !name.ends_with("checkpoint");
    let [one, other] = [one, other].map(|folder| {
        let mut files = desk.files(folder);
        files.retain(|(name, _)| compared(name));
        files
    });
    assert!(one.len() >= least, "{} files", one.len());
    for ((name, bytes), (other_name, other_bytes)) in one.iter().zip(&other) {
        assert!(name == other_name && bytes == other_bytes, "{name} and {other_name} differ");
    }
    assert_eq!(one.len(), other.len());
}

#[test]
fn a_light_map_comes_out_again_from_anywhere() {
    let mut hall = scene();
    hall["views"][0]["layers"] = json!(["../../art/paint.exr"]);
    hall["occluders"].as_array_mut().unwrap().push(json!({ "obj": { "file": "../../art/box.obj" } }));
    let desk = desk(&hall);
    desk.put("art/box.obj", BOX);
    write_rgba_exr(&desk.path("art/paint.exr"), [64, 36], |x, y| {
        [0.2, 0.9, 0.3, if x < 30 && y > 20 { 1.0 } else { 0.0 }]
    });
    let set = ["--set", "medium.g=0.25", "--set", "name=Hall", "--iterations", "7"];
    desk.done(&[&["light-map", "scenes/hall/scene.json", "-q", "-o", "out/first"], &set[..]].concat());
    let resolved = desk.json("out/first/scene.resolved.json");
    assert_eq!((&resolved["name"], &resolved["medium"]["g"]), (&json!("Hall"), &json!(0.25)));
    assert_eq!((&resolved["solve"]["iterations"], &resolved["solve"]["metric"]), (&json!(7), &json!("auto")));
    assert_eq!(resolved["solve"].get("memory"), None);
    assert_eq!(resolved["views"][0]["layers"], json!(["../../art/paint.exr"]));
    assert_eq!(resolved["views"][0]["strokes"][0]["hardness"], 0.8);

    let again = ["light-map", "../../../out/first/scene.resolved.json", "-q", "-o", "../../../out/second"];
    done_in(&desk, "elsewhere/far/away", &again);
    same_results(&desk, ["out/first", "out/second"], 20);
    // A folder deeper the names are others, and the files the same; where it is moved with all it names it works still.
    done_in(&desk, "out", &["light-map", "first/scene.resolved.json", "-q", "-o", "deep/third"]);
    let deep = desk.json("out/deep/third/scene.resolved.json");
    assert_eq!(deep["views"][0]["layers"], json!(["../../../art/paint.exr"]));
    fs::create_dir(desk.path("moved")).unwrap();
    for name in ["out", "art"] {
        fs::rename(desk.path(name), desk.path(&format!("moved/{name}"))).unwrap();
    }
    desk.done(&["light-map", "moved/out/deep/third/scene.resolved.json", "-q", "-o", "moved/out/fourth"]);
    same_results(&desk, ["moved/out/first", "moved/out/fourth"], 20);

    // Without one of the settings there is another light map.
    let other = ["--set", "medium.g=0", "-o", "moved/out/other"];
    desk.done(&[&["light-map", "moved/out/first/scene.resolved.json", "-q"], &other[..]].concat());
    assert!(desk.read("moved/out/other/light_map.exr") != desk.read("moved/out/first/light_map.exr"));
}

#[test]
fn a_light_map_of_default_settings_comes_out_again() {
    let mut plain = scene();
    plain.as_object_mut().unwrap().remove("solve");
    let desk = desk(&plain);
    desk.done(&["light-map", "scenes/hall/scene.json", "-q", "-o", "out/first"]);
    assert_eq!(desk.json("out/first/scene.resolved.json")["name"], "scene");
    desk.done(&["light-map", "out/first/scene.resolved.json", "-q", "-o", "out/second"]);
    same_results(&desk, ["out/first", "out/second"], 20);
}

/// A ball of mist in a cube, written beside the scene's folder.
fn put_ball(desk: &Desk, name: &str, x: f64, format: Format) {
    let cube =
        DAffine3::from_scale_rotation_translation(DVec3::splat(2.0), glam::DQuat::IDENTITY, DVec3::NEG_ONE);
    let grid = VoxelGrid::over_cube([10, 12, 11], cube).unwrap();
    let inside = |index| grid.centre(grid.voxel(index)).distance(DVec3::new(x, 0.0, 0.0)) < 0.6;
    let samples = (0..grid.len()).map(|index| if inside(index) { 3.0 } else { 0.0 }).collect();
    let ball = Volume::new(grid, 1, Samples::F32(samples)).unwrap();
    write(&desk.path(name), "density", &ball, format).unwrap();
}

#[test]
fn a_volume_comes_out_again_from_anywhere() {
    for (name, format) in [("ball.npy", Format::Npy), ("ball.vol", Format::Vol)] {
        let mut mist =
            with(volume::scene(), "/volume/extinction", json!({ "file": format!("../../art/{name}") }));
        mist["volume"].as_object_mut().unwrap().remove("size");
        let desk = desk(&mist);
        put_ball(&desk, &format!("art/{name}"), 0.1, format);
        let set = ["--set", "environment.directions=8", "--find", "emission", "--turntable", "1"];
        desk.done(&[&["volume", "scenes/hall/scene.json", "-q", "-o", "out/first"], &set[..]].concat());
        let resolved = desk.json("out/first/scene.resolved.json");
        assert_eq!(
            (&resolved["find"], &resolved["environment"]["directions"]),
            (&json!("emission"), &json!(8))
        );
        assert_eq!((&resolved["hull"], &resolved["rounds"]), (&json!(true), &json!(1)));
        assert_eq!(resolved["volume"]["extinction"]["file"], json!(format!("../../art/{name}")));
        let again = ["volume", "../../../out/first/scene.resolved.json", "-q", "-o", "../../../out/second"];
        done_in(&desk, "elsewhere/far/away", &[&again[..], &["--turntable", "1"]].concat());
        same_results(&desk, ["out/first", "out/second"], 20);
    }
}

#[test]
fn an_animation_of_numbered_files_comes_out_again() {
    let stroke = |color: &str| json!([{ "points": [[12, 16], [20, 14]], "radius": 4, "color": color }]);
    let key = |frame: usize, color: &str| json!({ "frame": frame, "views": [{ "name": "front", "strokes": stroke(color) }] });
    let mut smoke = with(volume::scene(), "/volume/extinction", json!({ "file": "../../art/smoke_###.vdb" }));
    smoke["volume"]["size"] = json!([10, 12, 11]);
    smoke["animation"] =
        json!({ "frames": 3, "first_file": 7, "keys": [key(0, "#ff4020"), key(2, "#2060ff")] });
    let desk = desk(&smoke);
    for frame in 0..3 {
        // By a voxel each, as a VDB file holds the box of what is not zero.
        put_ball(&desk, &format!("art/smoke_{:03}.vdb", frame + 7), 0.2 * frame as f64, Format::Vdb);
    }
    desk.done(&["animate", "scenes/hall/scene.json", "-q", "-o", "out/c#/first"]);
    let file = "out/c#/first/scene.resolved.json";
    assert_eq!(desk.json(file)["volume"]["extinction"]["file"], "../../../art/smoke_###.vdb");
    done_in(&desk, "elsewhere", &["animate", &format!("../{file}"), "-q", "-o", "../out/c#/second"]);
    same_results(&desk, ["out/c#/first", "out/c#/second"], 20);
}

#[test]
fn views_of_a_transforms_file_come_out_again() {
    let desk = desk(&volume::scene());
    desk.done(&["render", "scenes/hall/scene.json", "-q", "-o", "art/train"]);
    let eye = unscatter::scene::look_at(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, DVec3::Y).unwrap();
    let rows = glam::DMat4::from(eye).transpose().to_cols_array_2d();
    let frames = json!([{ "file_path": "train/front.exr", "transform_matrix": rows }]);
    desk.put("art/transforms.json", json!({ "camera_angle_x": 0.6, "frames": frames }).to_string());
    let mut seen = with(volume::scene(), "/views", json!([]));
    seen["transforms"] = json!({ "file": "../../art/transforms.json" });
    seen["volume"]["emission"] = json!(0.5);
    desk.put("scenes/hall/scene.json", seen.to_string());
    let arguments = ["-q", "--turntable", "0", "-o"];
    desk.done(&[&["volume", "scenes/hall/scene.json"], &arguments[..], &["out/first"]].concat());
    let resolved = desk.json("out/first/scene.resolved.json");
    assert_eq!(
        resolved["transforms"],
        json!({ "file": "../../art/transforms.json", "every": 1, "alpha": "weight" })
    );
    let again = ["volume", "../out/first/scene.resolved.json"];
    done_in(&desk, "elsewhere", &[&again[..], &arguments, &["../out/second"]].concat());
    same_results(&desk, ["out/first", "out/second"], 8);
}
