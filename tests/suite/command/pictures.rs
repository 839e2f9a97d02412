//! Reading pictures with the crates that write them elsewhere, not with the code under test.

use std::path::Path;

use exr::prelude::{ReadChannels, ReadLayers};

/// The pixels of an EXR, row by row, once it is known to be one part with exactly R, G and B.
pub fn exr(path: &Path) -> ([usize; 2], Vec<[f32; 3]>) {
    let meta = exr::meta::MetaData::read_from_file(path, true).unwrap();
    assert_eq!(meta.headers.len(), 1, "{} has several parts", path.display());
    let names: Vec<String> = meta.headers[0].channels.list.iter().map(|c| c.name.to_string()).collect();
    assert_eq!(names, ["B", "G", "R"], "channels of {}", path.display());
    let size = meta.headers[0].layer_size;
    let picture = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| (size.width(), vec![[0.0f32; 3]; size.area()]),
            |(width, pixels), at, (r, g, b): (f32, f32, f32)| pixels[at.y() * *width + at.x()] = [r, g, b],
        )
        .first_valid_layer()
        .all_attributes()
        .from_file(path)
        .unwrap();
    ([size.width(), size.height()], picture.layer_data.channel_data.pixels.1)
}

pub fn png_size(path: &Path) -> [usize; 2] {
    let picture = image::open(path).unwrap();
    [picture.width() as usize, picture.height() as usize]
}

/// The largest difference of two pictures relative to the largest value of the second.
pub fn difference(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    assert_eq!(a.len(), b.len());
    let largest = b.iter().flatten().fold(0.0f32, |most, value| most.max(value.abs()));
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    f64::from(pairs.fold(0.0f32, |most, (a, b)| most.max((a - b).abs())) / largest)
}

/// Writes an RGBA picture of 32-bit floats.
pub fn write_rgba_exr(
    path: &Path,
    [width, height]: [usize; 2],
    pixel: impl Fn(usize, usize) -> [f32; 4] + Sync,
) {
    exr::prelude::write_rgba_file(path, width, height, |x, y| {
        let [r, g, b, a] = pixel(x, y);
        (r, g, b, a)
    })
    .unwrap();
}

/// A scene in another unit looks the same: shadow rays, maps and fog know no metre.
#[test]
fn a_scene_looks_the_same_in_every_unit() {
    let hall = super::scene();
    let lengths = ["center", "sides", "origin", "target"];
    fn scaled(value: &serde_json::Value, by: f64) -> serde_json::Value {
        match value {
            serde_json::Value::Array(values) => values.iter().map(|value| scaled(value, by)).collect(),
            number => (number.as_f64().unwrap() * by).into(),
        }
    }
    let in_unit = |by: f64| {
        let mut scene = hall.clone();
        for occluder in scene["occluders"].as_array_mut().unwrap() {
            for (kind, shape) in occluder.as_object_mut().unwrap() {
                for (key, value) in shape.as_object_mut().unwrap() {
                    if lengths.contains(&key.as_str()) || kind == "box" && key == "size" {
                        *value = scaled(value, by);
                    }
                }
            }
        }
        for view in scene["views"].as_array_mut().unwrap() {
            let look_at = view["camera"]["to_world"]["look_at"].as_object_mut().unwrap();
            for key in ["origin", "target"] {
                look_at[key] = scaled(&look_at[key], by);
            }
        }
        let sigma_t = scene["medium"]["sigma_t"].as_f64().unwrap();
        scene["medium"]["sigma_t"] = (sigma_t / by).into();
        // What reflects shows where shadow rays begin.
        scene["ambient"] = 0.2.into();
        scene
    };
    let pixels = |by: f64| {
        let desk = super::Desk::with(&in_unit(by));
        desk.done(&["render", "scene.json", "-q", "-o", "out"]);
        ["left", "right"].map(|view| exr(&desk.path(&format!("out/{view}.exr"))).1)
    };
    let metres = pixels(1.0);
    // A power of two changes no bit but the exponents.
    for by in [2.0_f64.powi(-20), 2.0_f64.powi(10)] {
        for (here, there) in metres.iter().zip(pixels(by)) {
            let differing = here
                .iter()
                .zip(&there)
                .filter(|(a, b)| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-6 * a[c]))
                .count();
            assert_eq!(differing, 0, "of {} pixels, by {by}", here.len());
        }
    }
}

#[test]
fn views_are_drawn_by_any_method_and_what_is_none_says_what_there_is() {
    let desk = super::Desk::new();
    let drawn = |name: &str, flags: &[&str]| {
        desk.run(&[&["render", "scene.json", "-q", "-o", name], flags].concat()).exits_with(0);
        image::load_from_memory(&desk.read(&format!("{name}/left.png"))).unwrap().to_rgb8().into_raw()
    };
    let exact = drawn("exact", &[]);
    for method in ["march", "min-max", "prefiltered", "epipolar", "bilateral"] {
        let other = drawn(method, &["--method", method]);
        let steps: u64 = exact.iter().zip(&other).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
        assert!(steps < 4 * exact.len() as u64, "{method} is off by {steps} steps");
    }
    drawn("reduced", &["--method", "epipolar:256", "--reduced", "4"]);
    desk.run(&["render", "scene.json", "--method", "marsh"]).exits_with(2).tells("prefiltered[:coefficients");
    desk.run(&["render", "scene.json", "--method", "epipolar:0"]).exits_with(2).tells("32768");
    desk.run(&["render", "scene.json", "--reduced", "0"]).exits_with(2);
}
