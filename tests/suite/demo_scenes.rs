//! The demo scenes of volumes and of the sunrise, as they are committed.

use std::fs;
use std::path::PathBuf;

use unscatter::io::scene_file::{self, Document, VolumeDocument};
use unscatter::scene::LightMaps;

fn file(name: &str) -> PathBuf {
    crate::root().join(format!("strokes/{name}.json"))
}

/// The document, and the text that it was read from.
fn document(name: &str) -> (VolumeDocument, String) {
    let text = fs::read_to_string(file(name)).unwrap();
    (serde_json::from_str(&text).unwrap(), text)
}

#[test]
fn documents_of_volumes_are_written_as_they_were_read() {
    for name in ["hand", "glass", "cloud", "smoke"] {
        let (mut document, text) = document(name);
        assert!(scene_file::write_volume(&document).unwrap() == text, "{name}");
        document.exposure += 1.0;
        assert!(scene_file::write_volume(&document).unwrap() != text, "{name}: another exposure");
    }
}

#[test]
fn the_sunrise_has_a_transfer_function_of_its_own_at_each_of_five_keys() {
    let text = fs::read_to_string(file("sunrise")).unwrap();
    let document: Document = serde_json::from_str(&text).unwrap();
    assert!(scene_file::write(&document).unwrap() == text);
    let animated = scene_file::load_animated_scene(&file("sunrise"), &[]).unwrap();
    let keys = &animated.animation.keys;
    assert_eq!((animated.animation.frames, keys.len(), animated.light_maps), (48, 5, LightMaps::None));
    assert_eq!((keys[0].frame, keys[4].frame), (0, 47));
    for pair in keys.windows(2) {
        let [from, to] = [&pair[0].scene, &pair[1].scene];
        assert!(from.looks.transfer != to.looks.transfer && to.light.direction.y < from.light.direction.y);
    }
    // Half-way both have half a part.
    let parts: Vec<f64> = animated.at(6).unwrap().looks.transfer.iter().map(|(part, _)| *part).collect();
    assert_eq!(parts, [0.5, 0.5]);
}

#[test]
fn demo_scenes_of_volumes_want_something_of_every_view() {
    for (name, views) in [("hand", 2), ("glass", 4), ("cloud", 10), ("smoke", 2)] {
        let scene = scene_file::load_volume(&file(name), &[]).unwrap();
        assert_eq!(scene.views.len(), views, "{name}");
        for view in &scene.views {
            let is_painted = !view.view.strokes.is_empty() || !view.view.layers.is_empty();
            assert!(is_painted || view.picture.is_some(), "{name}: {}", view.view.name);
        }
    }
}

#[test]
fn demo_scenes_of_volumes_are_small() {
    for entry in fs::read_dir(file("hand").parent().unwrap()).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        let is_of_volume = ["hand", "glass", "cloud", "smoke"].iter().any(|start| name.starts_with(start));
        let bytes = entry.metadata().unwrap().len();
        assert!(!is_of_volume || bytes < 60_000, "{name}: {bytes} bytes");
    }
}
