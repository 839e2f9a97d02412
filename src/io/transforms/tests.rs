use glam::DVec3;
use proptest::prelude::*;
use serde_json::{Value, json};
use tempfile::TempDir;

use super::*;
use crate::scene::Image;

const POSE: [[f64; 4]; 4] =
    [[0.0, 0.0, 1.0, 4.0], [1.0, 0.0, 0.0, 0.5], [0.0, 1.0, 0.0, 2.0], [0.0, 0.0, 0.0, 1.0]];

fn read_text(text: &[u8]) -> (TempDir, Result<Vec<Shot>>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("transforms.json");
    std::fs::write(&path, text).unwrap();
    let shots = read(&path);
    (folder, shots)
}

fn read_value(value: &Value) -> (TempDir, Result<Vec<Shot>>) {
    read_text(value.to_string().as_bytes())
}

/// A file with one frame whose keys, or those of the whole file, are replaced.
fn with(of_all: Value, of_frame: Value) -> Value {
    let mut document = json!({ "fl_x": 500.0, "w": 640, "h": 480 });
    let mut frame = json!({ "file_path": "images/0001.jpg", "transform_matrix": POSE });
    for (target, changes) in [(&mut document, of_all), (&mut frame, of_frame)] {
        for (key, value) in changes.as_object().unwrap() {
            target[key] = value.clone();
        }
    }
    document["frames"] = json!([frame]);
    document
}

fn reason(of_all: Value, of_frame: Value) -> String {
    match read_value(&with(of_all, of_frame)).1 {
        Err(Error::Format { reason, .. }) => reason,
        other => unreachable!("{other:?}"),
    }
}

fn fov(of_all: Value, of_frame: Value) -> f64 {
    read_value(&with(of_all, of_frame)).1.unwrap()[0].fov_x
}

#[test]
fn the_files_of_the_original_are_read() {
    let frames = ["./train/r_0", "./train/r_1"]
        .map(|name| json!({ "file_path": name, "rotation": 0.0125, "transform_matrix": POSE }));
    let document = json!({ "camera_angle_x": 0.6911112070083618, "frames": frames });
    let (folder, shots) = read_value(&document);
    let shots = shots.unwrap();
    assert_eq!(shots.len(), 2);
    assert_eq!(shots[1].file, folder.path().join("./train/r_1.png"));
    assert!((shots[0].fov_x - 39.5978).abs() < 1e-4);
    assert_eq!((shots[0].size, &shots[0].mask, &shots[0].depth), (None, &None, &None));
    let looks_along = shots[0].world_from_camera.transform_vector3(DVec3::NEG_Z);
    assert_eq!(looks_along, DVec3::NEG_X, "the third column, turned around");
    assert_eq!(shots[0].world_from_camera.translation, DVec3::new(4.0, 0.5, 2.0));
}

#[test]
fn the_files_of_its_followers_are_read() {
    let frame = json!({
        "file_path": "images/frame_00001.jpeg", "sharpness": 31.5, "colmap_im_id": 1, "mask_path": "masks/1.png",
        "depth_file_path": "depth/1.png", "transform_matrix": POSE
    });
    let document = json!({
        "camera_angle_x": 1.1, "camera_angle_y": 0.9, "fl_x": 1000.0, "fl_y": 1000.5, "k1": 0, "k2": 0.0, "p1": null,
        "is_fisheye": false, "camera_model": "OPENCV", "cx": 959.5, "cy": 540.75, "w": 1920.0, "h": 1080,
        "aabb_scale": 16, "applied_transform": [[1, 0], [0, 1]], "ply_file_path": "sparse.ply", "frames": [frame]
    });
    let (folder, shots) = read_value(&document);
    let shot = &shots.unwrap()[0];
    assert_eq!(shot.file, folder.path().join("images/frame_00001.jpeg"));
    assert_eq!(shot.mask, Some(folder.path().join("masks/1.png")));
    assert_eq!(shot.depth, Some(folder.path().join("depth/1.png")));
    assert_eq!(shot.size, Some([1920, 1080]));
    assert!((shot.fov_x - 2.0 * 0.96_f64.atan().to_degrees()).abs() < 1e-12, "the focal length goes first");
}

#[test]
fn a_file_without_an_extension_is_itself_when_it_is_there() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("picture"), b"x").unwrap();
    std::fs::create_dir(folder.path().join("back")).unwrap();
    for name in ["x.y.0001.png", "photo.JPG", "photo.jpg", "back/r 0.exr"] {
        std::fs::write(folder.path().join(name), b"x").unwrap();
    }
    for (name, found) in [
        ("picture", "picture"),
        ("other", "other.png"),
        ("r_0.25.jpg", "r_0.25.jpg"),
        ("x.y.0001", "x.y.0001.png"),
        ("photo", "photo.jpg"),
        (r"back\r 0", "back/r 0.exr"),
        ("back/r%200.exr", "back/r 0.exr"),
    ] {
        assert_eq!(picture(folder.path(), name), Ok(folder.path().join(found)), "{name}");
    }
}

#[test]
fn what_a_frame_says_goes_before_what_all_say() {
    let of_length = |fl_x: f64, width: f64| 2.0 * (0.5 * width / fl_x).atan().to_degrees();
    let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    near(fov(json!({}), json!({})), of_length(500.0, 640.0));
    near(fov(json!({}), json!({ "fl_x": 250.0 })), of_length(250.0, 640.0));
    near(fov(json!({}), json!({ "w": 320 })), of_length(500.0, 320.0));
    near(fov(json!({}), json!({ "camera_angle_x": 0.5 })), 0.5_f64.to_degrees());
    near(fov(json!({ "fl_y": 500.0 }), json!({ "fl_x": 250.0 })), of_length(250.0, 640.0));
    near(fov(json!({ "w": null, "camera_angle_x": 0.5 }), json!({})), 0.5_f64.to_degrees());
    near(fov(json!({ "k1": 0.1 }), json!({ "k1": 0.0 })), of_length(500.0, 640.0));
}

fn lens(of_all: Value) -> Option<Lens> {
    read_value(&with(of_all, json!({}))).1.unwrap()[0].lens
}

#[test]
fn lenses_are_read_as_calibration_wrote_them() {
    assert_eq!(lens(json!({})), None);
    assert_eq!(lens(json!({ "fl_y": 500.0, "cx": 320, "cy": 240.0, "k1": 0, "p1": null })), None);
    let shifted = Lens::new([500.0, 500.0], [321.5, 240.0]);
    assert_eq!(lens(json!({ "cx": 321.5 })), Some(shifted));
    assert_eq!(lens(json!({ "fl_y": 450.0 })), Some(Lens::new([500.0, 450.0], [320.0, 240.0])));
    let bent = Lens { radial: [-0.1, 0.02, 0.0, 0.0], tangential: [1e-3, -2e-3], ..shifted };
    let keys =
        json!({ "cx": 321.5, "k1": -0.1, "k2": 0.02, "p1": 1e-3, "p2": -2e-3, "camera_model": "OPENCV" });
    assert_eq!(lens(keys), Some(bent));
    let fisheye = Lens { projection: Projection::Equidistant, radial: [0.1, 0.0, 0.0, 0.0], ..shifted };
    for says in [json!({ "is_fisheye": true }), json!({ "camera_model": "opencv_fisheye" })] {
        let mut keys = json!({ "cx": 321.5, "k1": 0.1 });
        keys.as_object_mut().unwrap().extend(says.as_object().unwrap().clone());
        assert_eq!(lens(keys), Some(fisheye));
    }
    // Two angles of their own, and of a focal length neither counts.
    let angles = json!({ "fl_x": null, "camera_angle_x": 1.0, "camera_angle_y": 1.0 });
    let [x, y] = [320.0, 240.0].map(|half: f64| half / 0.5_f64.tan());
    assert_eq!(lens(angles), Some(Lens::new([x, y], [320.0, 240.0])));
    assert_eq!(lens(json!({ "camera_angle_x": 1.1, "camera_angle_y": 0.9 })), None);
    assert!(read_value(&with(json!({ "k1": 0.01 }), json!({ "k1": 0.0 }))).1.unwrap()[0].lens.is_none());
}

#[test]
fn what_is_not_said_of_width_and_height_is_that_of_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    let picture = image::png_bytes(&Image::constant([64, 48], [0.5; 3]), 1.0).unwrap();
    std::fs::write(folder.path().join("a.png"), picture).unwrap();
    let of_picture = |keys: Value| {
        let mut document = keys;
        document["frames"] = json!([{ "file_path": "a.png", "transform_matrix": POSE }]);
        let path = folder.path().join("transforms.json");
        std::fs::write(&path, document.to_string()).unwrap();
        read(&path).unwrap().remove(0)
    };
    let contradicting = of_picture(json!({ "camera_angle_x": 0.7, "camera_angle_y": 1.4 }));
    let [x, y] = [32.0 / 0.35_f64.tan(), 24.0 / 0.7_f64.tan()];
    assert_eq!(contradicting.lens, Some(Lens::new([x, y], [32.0, 24.0])));
    assert_eq!(of_picture(json!({ "fl_x": 50.0, "fl_y": 60.0, "h": 40 })).size, Some([64, 40]));
    assert_eq!(
        of_picture(json!({ "fl_x": 50.0, "cx": 30.0 })).lens,
        Some(Lens::new([50.0; 2], [30.0, 24.0]))
    );
    let plain = of_picture(json!({ "camera_angle_x": 0.7 }));
    assert_eq!((plain.lens, plain.size), (None, None), "nothing was looked up");
}

#[test]
fn lenses_that_are_none_are_refused() {
    let cases = [
        (json!({ "camera_model": "EQUIRECTANGULAR" }), "EQUIRECTANGULAR"),
        (json!({ "is_fisheye": true, "p1": 0.01 }), "`p1`"),
        (json!({ "h": null, "cy": 240 }), "`h`"),
        (json!({ "w": null, "camera_angle_x": 1.0, "cx": 240 }), "`w`"),
        (json!({ "fl_x": 0.0 }), "field of view"),
        (json!({ "fl_x": -500.0 }), "field of view"),
        (json!({ "fl_x": null, "camera_angle_x": 3.2 }), "field of view"),
        (json!({ "fl_x": null, "camera_angle_x": 0 }), "field of view"),
        (json!({ "fl_x": null }), "`camera_angle_x`"),
        (json!({ "w": null }), "`w`"),
        (json!({ "w": 640.5 }), "`w`"),
        (json!({ "h": 0 }), "`h`"),
        (json!({ "h": 1e300 }), "`h`"),
    ];
    for (changes, expected) in cases {
        let reason = reason(changes.clone(), json!({}));
        assert!(reason.contains(expected) && reason.starts_with("frames[0]: "), "{changes}: {reason}");
    }
}

#[test]
fn frames_that_are_none_are_refused_by_their_index() {
    let zeros = [[0.0; 4]; 4];
    let mut singular = POSE;
    singular[1] = singular[0];
    let cases = [
        (json!({ "file_path": null }), "`file_path`"),
        (json!({ "file_path": "" }), "`file_path`"),
        (json!({ "transform_matrix": null }), "`transform_matrix`"),
        (json!({ "transform_matrix": [[1, 2], [3, 4]] }), "four rows of four"),
        (json!({ "transform_matrix": POSE[..3] }), "four rows of four"),
        (json!({ "transform_matrix": singular }), "singular"),
        (json!({ "transform_matrix": zeros }), "0 0 0 1"),
    ];
    for (changes, expected) in cases {
        let mut document = with(json!({}), changes);
        let good = with(json!({}), json!({}))["frames"][0].clone();
        document["frames"].as_array_mut().unwrap().insert(0, good);
        let error = read_value(&document).1.unwrap_err().to_string();
        assert!(error.contains("frames[1]: ") && error.contains(expected), "{error}");
    }
}

#[test]
fn files_that_are_none_are_refused() {
    for text in
        ["", "[]", "{", "null", "{\"frames\": 3}", "{\"w\": \"640\"}", "{\"frames\": [{\"w\": 1e999}]}"]
    {
        let is_told = matches!(read_text(text.as_bytes()).1, Err(Error::Format { .. }));
        assert!(is_told, "{text}");
    }
    assert!(read_text(b"{\"frames\": []}").1.unwrap_err().to_string().contains("no `frames`"));
    assert!(read_text(b"{}").1.unwrap_err().to_string().contains("no `frames`"));
    assert!(read_text(&b"[".repeat(1 << 20)).1.is_err());
    assert!(read_text(&b"{\"a\":".repeat(1 << 18)).1.is_err());
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(read(folder.path()), Err(Error::File { .. })));
    assert!(matches!(read(&folder.path().join("none")), Err(Error::File { .. })));
    let long = folder.path().join("long.json");
    std::fs::File::create(&long).unwrap().set_len(MAX_BYTES + 1).unwrap();
    assert!(matches!(read(&long), Err(Error::TooLarge { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

    #[test]
    fn poses_come_back(numbers in prop::array::uniform12(-10.0_f64..10.0)) {
        let [a, b, c] = [0, 4, 8].map(|at| <[f64; 4]>::try_from(&numbers[at..at + 4]).unwrap());
        let document = with(json!({}), json!({ "transform_matrix": [a, b, c, POSE[3]] }));
        if let Ok(shots) = read_value(&document).1 {
            let found = shots[0].world_from_camera;
            prop_assert_eq!(found.matrix3.row(1), DVec3::new(b[0], b[1], b[2]));
            prop_assert_eq!(found.translation, DVec3::new(a[3], b[3], c[3]));
        }
    }

    #[test]
    fn damaged_files_never_panic(
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
        cut in any::<prop::sample::Index>(),
    ) {
        let mut text = with(json!({ "fl_y": 500.0, "cx": 320 }), json!({ "k1": 0.0 })).to_string().into_bytes();
        for (index, value) in damage {
            *index.get_mut(&mut text) = value;
        }
        if cut.index(4) == 0 {
            text.truncate(cut.index(text.len()));
        }
        let _ = read_text(&text).1.map_err(|error| error.to_string());
    }
}
