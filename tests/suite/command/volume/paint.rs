//! What a painted volume is by default: smooth, no brighter than paint asks for, and nowhere outside its masks.

use super::*;

/// The scene with nothing said of how paint is solved.
fn painted() -> Value {
    let mut scene = scene_with("/find", json!("emission"));
    scene["volume"].as_object_mut().unwrap().remove("interpolation");
    scene["solve"] = json!({ "iterations": 400, "tolerance": 1e-4 });
    // Emission brightens, whatever is scattered.
    scene["target"] = json!("radiance");
    scene["views"][0]["strokes"][0]["color"] = json!([2, 1, 0.4]);
    scene["views"][1]["strokes"][0]["color"] = json!([0.4, 0.8, 2]);
    scene
}

/// Shape and values of a result, and the sum of its squared differences between neighbours.
fn found(desk: &Desk, name: &str) -> (Vec<f32>, f64) {
    let (shape, values) = unscatter::io::npy::read_f32(&desk.path(name)).unwrap();
    let (depth, height, width, channels) = (shape[0], shape[1], shape[2], shape.get(3).copied().unwrap_or(1));
    let at = |z: usize, y: usize, x: usize, c: usize| {
        f64::from(values[((z * height + y) * width + x) * channels + c])
    };
    let mut sum = 0.0;
    for (z, y, x) in each_voxel(depth, height, width) {
        for c in 0..channels {
            for (dz, dy, dx) in [(1, 0, 0), (0, 1, 0), (0, 0, 1)] {
                if z + dz < depth && y + dy < height && x + dx < width {
                    sum += (at(z + dz, y + dy, x + dx, c) - at(z, y, x, c)).powi(2);
                }
            }
        }
    }
    (values, sum)
}

fn each_voxel(depth: usize, height: usize, width: usize) -> impl Iterator<Item = (usize, usize, usize)> {
    (0..depth).flat_map(move |z| (0..height).flat_map(move |y| (0..width).map(move |x| (z, y, x))))
}

#[test]
fn paint_is_smooth_where_nobody_painted_and_no_brighter_than_it_must_be() {
    let desk = Desk::with(&painted());
    desk.done(&["volume", "scene.json", "-q", "-o", "out", "--turntable", "0"]);
    let as_it_was = [
        "volume.interpolation=\"nearest\"",
        "solve.tikhonov=0.001953125",
        "solve.gradient=0",
        "bounds.emission.upper=1e6",
    ];
    let set: Vec<&str> = as_it_was.iter().flat_map(|set| ["--set", set]).collect();
    desk.done(&[&["volume", "scene.json", "-q", "-o", "old", "--turntable", "0"][..], &set].concat());
    let ((now, smooth), (then, rough)) = (found(&desk, "out/emission.npy"), found(&desk, "old/emission.npy"));
    let most = |values: &[f32]| values.iter().copied().fold(0.0, f32::max);
    let after = |folder: &str| {
        desk.json(&format!("{folder}/report.json"))["weighted_residual"]["after"].as_f64().unwrap()
    };
    assert!(smooth < rough / 2.0, "{smooth} of {rough}");
    assert!(most(&now) < 0.25 * most(&then), "{} of {}", most(&now), most(&then));
    let before = desk.json("out/report.json")["weighted_residual"]["before"].as_f64().unwrap();
    assert!(after("out") < 1.1 * after("old") && after("out") < before, "{before}, {}", after("out"));
    // What follows from the medium is left to follow from it.
    let resolved = desk.json("out/scene.resolved.json");
    assert_eq!(resolved["volume"]["interpolation"], "trilinear");
    assert!(resolved["solve"]["gradient"].is_null() && resolved["solve"]["tikhonov"].is_null());
    // A weight that is given counts.
    desk.done(&[
        "volume",
        "scene.json",
        "-q",
        "-o",
        "stiff",
        "--turntable",
        "0",
        "--set",
        "solve.gradient=100",
    ]);
    assert!(found(&desk, "stiff/emission.npy").1 < smooth / 4.0);
}

#[test]
fn voxels_that_no_ray_reaches_are_as_those_beside_them() {
    let mut scene = painted();
    // Only the middle of the volume is seen.
    for view in scene["views"].as_array_mut().unwrap() {
        view["camera"]["fov"] = json!(9);
    }
    let desk = Desk::with(&scene);
    desk.done(&["volume", "scene.json", "-q", "-o", "out", "--turntable", "0"]);
    let coverage = desk.json("out/report.json")["coverage"].clone();
    assert!(coverage["joined"].as_u64().unwrap() > 100, "{coverage}");
    desk.done(&[
        "volume",
        "scene.json",
        "-q",
        "-o",
        "alone",
        "--turntable",
        "0",
        "--set",
        "solve.gradient=0",
    ]);
    let glowing = |folder: &str| {
        found(&desk, &format!("{folder}/emission.npy")).0.iter().filter(|&&it| it > 1e-3).count()
    };
    assert!(glowing("out") > 2 * glowing("alone"), "{} and {}", glowing("out"), glowing("alone"));
}

#[test]
fn a_hull_carves_the_extinction_that_is_looked_for() {
    let mut scene = scene_with("/find", json!("extinction"));
    scene["volume"] =
        json!({ "size": 16, "extinction": 2, "to_world": { "translate": [-1, -1, -1], "scale": 2 } });
    scene["background"] = json!(1);
    scene["views"] = json!([{ "name": "front", "camera": camera([0.0, 0.0, 4.0]), "picture": "pic.png", "mask": "mask.png" }]);
    let desk = Desk::with(&scene);
    let disc = |x: u32, y: u32| (f64::from(x) - 15.5).hypot(f64::from(y) - 14.5) < 5.0;
    let grey = |name: &str, of: &dyn Fn(u32, u32) -> u8| {
        image::GrayImage::from_fn(32, 30, |x, y| image::Luma([of(x, y)])).save(desk.path(name)).unwrap();
    };
    grey("pic.png", &|x, y| if disc(x, y) { 90 } else { 255 });
    grey("mask.png", &|x, y| if disc(x, y) { 255 } else { 0 });
    desk.done(&["volume", "scene.json", "-q", "-o", "out", "--turntable", "0"]);
    let (values, _) = found(&desk, "out/extinction.npy");
    let empty = values.iter().filter(|&&value| value == 0.0).count();
    assert!(empty > values.len() / 2, "{empty} of {} are empty", values.len());
    let report = desk.json("out/report.json");
    assert!(report["weighted_residual"]["after"].as_f64().unwrap() < 0.05, "{}", report["weighted_residual"]);
}
