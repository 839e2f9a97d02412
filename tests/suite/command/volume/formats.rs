use glam::DAffine3;
use serde_json::json;
use unscatter::io::volume::{self, Format};

use super::desk;

#[test]
fn results_are_written_in_every_format_and_read_as_starts() {
    let desk = desk();
    desk.done(&["volume", "scene.json", "-q", "-o", "out", "--format", "all", "--turntable", "0"]);
    let read = |name: &str, member| volume::read(&desk.path(name), member).unwrap();
    let npy = read("out/emission.npy", None).volume;
    for format in Format::ALL {
        let stored = read(&format!("out/emission.{}", format.extension()), None);
        // A VDB file holds the box of what is not zero.
        let grid = stored.volume.grid();
        let to_npy = |voxel: [usize; 3]| {
            let p = grid.centre(voxel);
            let cube = DAffine3::from_scale_rotation_translation(
                glam::DVec3::splat(2.0),
                glam::DQuat::IDENTITY,
                glam::DVec3::NEG_ONE,
            );
            let unit = if stored.placed { cube.inverse().transform_point3(p) } else { p };
            let size = npy.grid().size();
            npy.grid().index(std::array::from_fn(|axis| (unit[axis] * size[axis] as f64) as usize))
        };
        for index in 0..grid.len() {
            let here = stored.volume.color(index);
            let there = npy.color(to_npy(grid.voxel(index)));
            assert_eq!(here, there, "voxel {:?} of {}", grid.voxel(index), format.name());
        }
    }
    for format in Format::ALL {
        let file = format!("volume.emission={{\"file\": \"out/emission.{}\"}}", format.extension());
        let arguments = ["volume", "scene.json", "-q", "--turntable", "0", "--iterations", "2"];
        desk.done(&[&arguments[..], &["--find", "emission", "--set", &file, "-o", format.name()]].concat());
    }
    desk.run(&["volume", "scene.json", "--format", "obj", "-o", "no"]).exits_with(1).tells("vdb, npy, npz");
}

#[test]
fn a_format_is_asked_for_by_the_word_that_the_help_lists() {
    let desk = desk();
    let words = [("vdb", "vdb"), ("npy", "npy"), ("NPZ", "npz"), ("vol", "vol"), ("raw", "json")];
    for (word, extension) in words {
        let arguments = ["volume", "scene.json", "-q", "--turntable", "0", "--iterations", "1"];
        desk.done(&[&arguments[..], &["-o", word, "--format", word]].concat());
        assert!(desk.path(&format!("{word}/emission.{extension}")).is_file(), "{word}");
    }
}

#[test]
fn properties_may_differ_in_resolution() {
    let desk = desk();
    let emission = "volume.emission={\"value\": 0, \"size\": [5, 4, 6]}";
    let arguments = [
        "volume",
        "scene.json",
        "-q",
        "--turntable",
        "0",
        "--find",
        "emission",
        "--set",
        emission,
        "-o",
        "out",
    ];
    desk.done(&arguments);
    let (shape, _) = unscatter::io::npy::read_f32(&desk.path("out/emission.npy")).unwrap();
    assert_eq!(shape, [6, 4, 5, 3]);
    let residual = desk.json("out/report.json")["weighted_residual"].clone();
    assert!(residual["after"].as_f64() < residual["before"].as_f64(), "{residual}");
    let joint = json!({ "value": 0, "size": 5 });
    desk.run(&["volume", "scene.json", "--set", &format!("volume.emission={joint}"), "-o", "no"])
        .exits_with(1)
        .tells("the same number of voxels");
}
