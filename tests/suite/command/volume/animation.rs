use serde_json::{Value, json};

use unscatter::io::volume::{Format, read, write};
use unscatter::scene::{Samples, Volume, VoxelGrid};

use super::{scene, scene_with};
use crate::command::pictures::{difference, exr};
use crate::command::{Desk, with};
use crate::tolerances::VOLUME_PICTURES;

fn ball(x: f64) -> Value {
    json!({ "made": { "shapes": [{ "sphere": { "center": [x, 0.0, 0.0], "radius": 0.45 } }], "inside": 4.0, "edge": 0.3 } })
}

fn stroke(color: &str) -> Value {
    json!([{ "name": "front", "strokes": [{ "points": [[12, 16], [20, 14]], "radius": 4, "color": color }] }])
}

/// A ball of mist that moves in five frames, painted at the first and the last.
fn moving(between: &str) -> Value {
    let mut scene = scene_with("/volume/extinction", ball(-0.3));
    scene["animation"] = json!({
        "frames": 5,
        "between": between,
        "keys": [
            { "frame": 0, "views": stroke("#ff4020") },
            { "frame": 4, "extinction": ball(0.4), "views": stroke("#2060ff") }
        ]
    });
    scene
}

fn animated(scene: &Value, more: &[&str]) -> Desk {
    let desk = Desk::with(scene);
    desk.done(&[&["animate", "scene.json", "-q", "-o", "out"], more].concat());
    desk
}

#[test]
fn every_frame_is_written_and_keys_show_what_keys_show() {
    let desk = animated(&moving("shapes"), &[]);
    let names = desk.names("out");
    for frame in 0..5 {
        for view in ["front", "side"] {
            for ending in ["exr", "png"] {
                let name = format!("frame_{frame:04}_{view}.{ending}");
                assert!(names.contains(&name), "{name} is not among {names:?}");
            }
        }
    }
    for key in ["0000", "0004"] {
        for view in ["front", "side"] {
            let frame = desk.read(&format!("out/frame_{key}_{view}.exr"));
            assert!(frame == desk.read(&format!("out/key_{key}_{view}_after.exr")));
            assert!(frame != desk.read(&format!("out/key_{key}_{view}_before.exr")));
        }
        assert!(names.contains(&format!("key_{key}_emission.vdb")));
    }
    let report = desk.json("out/report.json");
    assert_eq!(report["command"], "animate");
    assert_eq!(report["animation"]["frames"], 5);
    assert_eq!(report["animation"]["drawn"], 5);
    assert_eq!(report["animation"]["between"], "shapes");
    let keys = report["animation"]["keys"].as_array().unwrap();
    assert_eq!(keys.len(), 2);
    for key in keys {
        let [before, after] =
            ["before", "after"].map(|when| key["weighted_residual"][when].as_f64().unwrap());
        assert!(after < before && key["spread_voxels"].as_u64().unwrap() > 0, "{key}");
    }
    assert_eq!(report["stages"].as_array().unwrap().len(), 2);
    let page = String::from_utf8(desk.read("out/report.html")).unwrap();
    assert!(page.contains("Frame 2") && page.contains("front, frame 4") && page.contains("frame 4, joint"));
}

#[test]
fn a_key_is_what_volume_finds_at_its_frame() {
    let desk = animated(&moving("shapes"), &[]);
    let mut alone = scene_with("/volume/extinction", ball(0.4));
    alone["views"][0]["strokes"] = stroke("#2060ff")[0]["strokes"].clone();
    desk.put("alone.json", alone.to_string());
    desk.done(&["volume", "alone.json", "-q", "-o", "alone", "--turntable", "0"]);
    for view in ["front", "side"] {
        let [key, volume] = [format!("out/frame_0004_{view}.exr"), format!("alone/{view}_after.exr")]
            .map(|name| exr(&desk.path(&name)).1);
        assert!(difference(&key, &volume) < VOLUME_PICTURES);
        let before = exr(&desk.path(&format!("alone/{view}_before.exr"))).1;
        assert!(difference(&key, &before) > VOLUME_PICTURES, "another picture is noticed");
    }
}

#[test]
fn some_frames_are_those_of_all() {
    let all = animated(&moving("blend"), &[]);
    let some = animated(&moving("blend"), &["--frames", "1..2"]);
    for frame in 0..5 {
        let name = format!("out/frame_{frame:04}_front.exr");
        let is_asked = (1..=2).contains(&frame);
        assert_eq!(some.path(&name).is_file(), is_asked, "{name}");
        assert!(!is_asked || all.read(&name) == some.read(&name), "{name}");
    }
    assert_eq!(some.json("out/report.json")["animation"]["drawn"], 2);
}

#[test]
fn between_keys_volumes_are_blended() {
    let desk = animated(&moving("blend"), &["--volumes", "--format", "npz"]);
    for property in ["extinction", "emission", "albedo"] {
        let [from, middle, to] = [0, 2, 4].map(|frame| {
            read(&desk.path(&format!("out/frame_{frame:04}_{property}.npz")), None).unwrap().volume
        });
        let mut differ = false;
        for index in 0..from.grid().len() {
            let (a, b) = (from.color(index), to.color(index));
            assert_eq!(middle.color(index), std::array::from_fn(|c| 0.5 * (a[c] + b[c])), "{property}");
            differ |= a != b;
        }
        assert!(differ, "{property}: the keys differ");
    }
}

/// Numbered files with a ball that moves; `size` voxels a side.
fn put_files(desk: &Desk, frames: std::ops::Range<usize>, size: usize) {
    let cube = glam::DAffine3::from_scale_rotation_translation(
        glam::DVec3::splat(2.0),
        glam::DQuat::IDENTITY,
        glam::DVec3::splat(-1.0),
    );
    for frame in frames {
        let grid = VoxelGrid::over_cube([size; 3], cube).unwrap();
        let middle = glam::DVec3::new(-0.3 + 0.15 * frame as f64, 0.0, 0.0);
        let sigma_t = |index| if grid.centre(grid.voxel(index)).distance(middle) < 0.5 { 3.0 } else { 0.0 };
        let samples = Samples::F32((0..grid.len()).map(sigma_t).collect());
        let volume = Volume::new(grid, 1, samples).unwrap();
        write(&desk.path(&format!("smoke_{:03}.vdb", frame + 7)), "density", &volume, Format::Vdb).unwrap();
    }
}

fn of_files() -> Value {
    let mut scene = moving("blend");
    scene["volume"]["extinction"] = json!({ "file": "smoke_###.vdb" });
    scene["volume"]["size"] = json!(12);
    // The files say where they lie.
    scene["volume"].as_object_mut().unwrap().remove("to_world");
    scene["animation"]["first_file"] = json!(7);
    scene["animation"]["keys"][1].as_object_mut().unwrap().remove("extinction");
    scene
}

#[test]
fn the_extinction_of_frames_can_come_from_numbered_files() {
    let desk = Desk::with(&of_files());
    put_files(&desk, 0..5, 12);
    desk.done(&["animate", "scene.json", "-q", "-o", "out", "--volumes", "--format", "npz"]);
    for frame in 0..5 {
        let drawn = read(&desk.path(&format!("out/frame_{frame:04}_extinction.npz")), None).unwrap().volume;
        let given = read(&desk.path(&format!("smoke_{:03}.vdb", frame + 7)), None).unwrap().volume;
        // Each file has a box of active voxels of its own, and the frames share the one around them.
        for index in 0..drawn.grid().len() {
            let centre = drawn.grid().centre(drawn.grid().voxel(index));
            let at = given.grid().grid_from_world().transform_point3(centre).floor().as_i64vec3().to_array();
            let is_inside =
                at.iter().zip(given.grid().size()).all(|(&at, side)| (0..side as i64).contains(&at));
            let expected = match is_inside {
                true => given.color(given.grid().index(at.map(|at| at as usize))),
                false => [0.0; 3],
            };
            assert_eq!(drawn.color(index), expected, "voxel {index} of frame {frame}");
        }
    }
    assert_eq!(desk.json("out/report.json")["animation"]["between"], "files");
    std::fs::remove_file(desk.path("smoke_009.vdb")).unwrap();
    let refused = |words: &str| {
        desk.run(&["animate", "scene.json", "-o", "again"]).exits_with(1).tells(words);
        assert!(desk.names("again").is_empty());
    };
    refused("smoke_009.vdb");
}

#[test]
fn bad_animations_are_named() {
    let keys = |keys: Value| with(moving("blend"), "/animation/keys", keys);
    let key = |frame: usize| json!({ "frame": frame, "views": stroke("#ff4020") });
    let shapes = |pointer: &str, value: Value| with(moving("shapes"), pointer, value);
    let extinction = |value: Value| shapes("/animation/keys/1/extinction", value);
    let two = json!({ "made": { "shapes": [
        { "sphere": { "center": [0, 0, 0], "radius": 0.4 } }, { "sphere": { "center": [0.3, 0, 0], "radius": 0.4 } }
    ], "inside": 4.0, "edge": 0.3 } });
    let mut small = ball(0.4);
    small["size"] = json!(8);
    let mut unpainted = keys(json!([key(0), { "frame": 4 }]));
    for view in unpainted["views"].as_array_mut().unwrap() {
        view.as_object_mut().unwrap().remove("strokes");
    }
    let mut looked_for = shapes("/find", json!("extinction"));
    looked_for["target"] = json!("radiance");
    let table: [(Value, [&str; 2]); 17] = [
        (keys(json!([key(3), key(1)])), ["animation.keys[1].frame", "above 3"]),
        (keys(json!([key(2), key(2)])), ["animation.keys[1].frame", "above 2"]),
        (keys(json!([key(1)])), ["animation.keys", "at least two are needed"]),
        (keys(json!([])), ["animation.keys", "at least two are needed"]),
        (keys(json!([key(0), key(5)])), ["animation.keys[1].frame", "below 5"]),
        (with(moving("blend"), "/animation/frames", json!(1)), ["animation.frames", "from 2 to 10000"]),
        (extinction(small), ["animation.keys[1].extinction", "8 x 8 x 8 voxels"]),
        (extinction(json!({ "file": "none.vdb" })), ["animation.keys[1].extinction.file", "none.vdb"]),
        (extinction(json!(1.5)), ["animation.keys[1].extinction", "only what is `made`"]),
        (extinction(two), ["animation.keys[1].extinction.made.shapes", "needs its partner"]),
        (extinction(json!(-1)), ["animation.keys[1].extinction", "must be not negative"]),
        (shapes("/animation/keys/1/views/0/name", json!("top")), ["views[0].name", "a view of the scene"]),
        (shapes("/animation/between", json!("magic")), ["animation.between", "blend"]),
        (shapes("/animation/first_file", json!(3)), ["animation.first_file", "no numbered files"]),
        (unpainted, ["animation.keys[1]", "no view says"]),
        (looked_for, ["animation.between", "only be blended"]),
        (
            with(of_files(), "/animation/keys/1/extinction", ball(0.0)),
            ["animation.keys[1].extinction", "leave it away"],
        ),
    ];
    for (scene, words) in table {
        let desk = Desk::with(&scene);
        let ran = desk.run(&["animate", "scene.json", "-o", "out"]).exits_with(1);
        words.iter().for_each(|words| assert!(ran.told().contains(words), "{words}: {}", ran.told()));
        assert!(desk.names("out").is_empty());
    }
}

#[test]
fn commands_say_who_makes_animations_and_who_does_not() {
    let desk = Desk::with(&moving("shapes"));
    desk.run(&["volume", "scene.json", "-o", "out"]).exits_with(1).tells("`unscatter animate`");
    let set = ["--frames", "3..9"];
    let ran = desk.run(&[&["animate", "scene.json", "-o", "out"], &set[..]].concat()).exits_with(1);
    ran.tells("within the frames of the animation");
    desk.run(&["animate", "scene.json", "--frames", "4..2"]).exits_with(2);
    let still = Desk::with(&scene());
    still.run(&["animate", "scene.json", "-o", "out"]).exits_with(1).tells("`unscatter volume`");
}

#[test]
fn other_commands_look_at_the_keys() {
    let desk = Desk::with(&moving("shapes"));
    let plans = desk.done(&["plan", "scene.json", "--json"]).json();
    let scenes: Vec<&str> =
        plans.as_array().unwrap().iter().map(|plan| plan["scene"].as_str().unwrap()).collect();
    assert_eq!(scenes, ["scene, frame 0", "scene, frame 4"]);
    assert!(desk.done(&["check", "scene.json"]).out.contains("scene, frame 4, joint"));
    desk.done(&["render", "scene.json", "-q", "-o", "out"]);
    let names = desk.names("out");
    assert!(
        ["frame_0000_front.png", "frame_0004_side.exr"].iter().all(|name| names.iter().any(|n| n == name))
    );
    desk.done(&["matrix", "scene.json", "-q", "-o", "matrix", "--set", "environment.radiance=0.5"]);
}

#[test]
#[cfg(unix)]
fn ctrl_c_writes_the_keys_that_there_are_and_resume_goes_on() {
    let desk = Desk::with(&moving("shapes"));
    let long = ["animate", "scene.json", "-o", "out", "--iterations", "1000000", "--tolerance", "0"];
    crate::command::interrupt::interrupted(&desk, &long, "key_0000_front_after.png");
    let report = desk.json("out/report.json");
    assert_eq!(report["stop"]["reason"], "interrupted");
    assert_eq!(report["animation"]["keys"].as_array().unwrap().len(), 1);
    assert_eq!(report["animation"]["drawn"], 1);
    let names = desk.names("out");
    assert!(
        names.iter().any(|name| name == "key_0000_checkpoint")
            && !names.iter().any(|n| n.starts_with("key_0004"))
    );
    let stopped = report["stop"]["iteration"].as_u64().unwrap();
    let goal = (stopped + 5).to_string();
    desk.done(&[
        "animate",
        "scene.json",
        "-q",
        "-o",
        "out",
        "--resume",
        "--iterations",
        &goal,
        "--tolerance",
        "0",
    ]);
    let stages = desk.json("out/report.json")["stages"].clone();
    assert!(stages[0]["stop"]["iteration"].as_u64().unwrap() >= stopped, "{stages}");
    assert!(desk.path("out/frame_0003_side.exr").is_file());
}
