//! The first scene of a model: its cameras and its sun, or a view that frames it, in a little fog.

use std::path::Path;

use glam::DVec3;
use serde_json::{Value, json};

use crate::io::gltf::GltfScene;
use crate::io::obj;
use crate::scene::Mesh;
use crate::{Error, Result};

/// Of the view that frames a model, from top to bottom in degrees.
const FOV: f64 = 40.0;
/// Pictures of views.
const SIZE: [usize; 2] = [1280, 720];
/// Optical depth of the fog across the model.
const DEPTH: f64 = 0.3;
/// Views are no more than so many cameras.
const MOST_CAMERAS: usize = 8;
/// Triangles of a model at most.
const MOST_TRIANGLES: usize = 20_000_000;

/// Whether a file is a model, by its name.
pub(super) fn is_model(path: &Path) -> bool {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    matches!(extension.as_deref(), Some("glb" | "gltf" | "obj"))
}

/// The text of a scene beside a model.
///
/// Errors: those of reading it; [`Error::Empty`] for one without extent.
pub(super) fn scene_of(path: &Path) -> Result<String> {
    let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let is_obj = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("obj"));
    let (mesh, model) = match is_obj {
        true => (obj::load(path, MOST_TRIANGLES)?, None),
        false => {
            let model = GltfScene::load(path)?;
            (model.mesh(None, MOST_TRIANGLES)?, Some(model))
        }
    };
    let Some([low, high]) = bounds(&mesh) else {
        return Err(Error::Empty {
            reason: format!("{} has no extent", path.display()),
            remedy: "choose a model with triangles",
        });
    };
    let cameras = model.as_ref().map_or(Vec::new(), GltfScene::camera_names);
    let mut views: Vec<Value> = Vec::new();
    for name in cameras.iter().take(MOST_CAMERAS) {
        // Orthographic ones are left away.
        if model.as_ref().is_some_and(|model| model.camera(name).is_ok()) {
            let called = format!("view-{}", views.len() + 1);
            views.push(
                json!({ "name": called, "camera": { "gltf": { "file": file, "node": name }, "size": SIZE } }),
            );
        }
    }
    if views.is_empty() {
        views.push(json!({ "name": "view-1", "camera": framing([low, high]) }));
    }
    let light = match model.as_ref().is_some_and(GltfScene::has_sun) {
        true => json!({ "gltf": { "file": file } }),
        false => json!({ "direction": [0.5, -1, -0.3] }),
    };
    let occluder =
        if is_obj { json!({ "obj": { "file": file } }) } else { json!({ "gltf": { "file": file } }) };
    let sigma_t = rounded(DEPTH / (high - low).length());
    // Written as a person would, so that what is edited later stays readable.
    let lines = [
        ("version", json!(1)),
        ("light", light),
        ("medium", json!({ "sigma_t": sigma_t, "albedo": 0.95 })),
        ("occluders", json!([occluder])),
    ];
    let lines = lines.map(|(name, value)| format!("  \"{name}\": {value},\n"));
    let views: Vec<String> = views.iter().map(|view| format!("    {view}")).collect();
    Ok(format!("{{\n{}  \"views\": [\n{}\n  ]\n}}\n", lines.concat(), views.join(",\n")))
}

fn bounds(mesh: &Mesh) -> Option<[DVec3; 2]> {
    let low = mesh.positions.iter().fold(DVec3::INFINITY, |low, &p| low.min(p));
    let high = mesh.positions.iter().fold(DVec3::NEG_INFINITY, |high, &p| high.max(p));
    Some([low, high]).filter(|[low, high]| low.is_finite() && high.is_finite() && low != high)
}

/// A camera a little above, that sees all of it.
fn framing([low, high]: [DVec3; 2]) -> Value {
    let (middle, radius) = (0.5 * (low + high), 0.5 * (high - low).length());
    let away = 1.05 * radius / (0.5 * FOV.to_radians()).sin();
    let origin = middle + away * DVec3::new(0.5, 0.35, 0.8).normalize();
    let written = |p: DVec3| p.to_array().map(rounded);
    json!({
        "to_world": { "look_at": { "origin": written(origin), "target": written(middle) } },
        "fov": FOV,
        "size": SIZE
    })
}

/// With four digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::scene_file::{Document, SceneFile};

    fn opened(path: &Path) -> (Document, crate::scene::Scene) {
        let text = scene_of(path).unwrap();
        let scene = SceneFile::of(path.with_extension("json"), &text).open::<Document>(&[]).unwrap().0;
        (serde_json::from_str(&text).unwrap(), scene)
    }

    #[test]
    fn cameras_and_sun_are_the_model_s_own() {
        let (document, scene) = opened(&Path::new(env!("CARGO_MANIFEST_DIR")).join("strokes/chapel.glb"));
        assert!(document.light.gltf.is_some() == document.light.direction.is_none());
        assert!(document.views.iter().all(|view| view.camera.size == SIZE));
        assert!(!scene.mesh.triangles.is_empty() && scene.views.len() == document.views.len());
    }

    #[test]
    fn a_model_without_a_camera_is_seen_as_a_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("box.OBJ");
        std::fs::write(&path, "v 5 0 0\nv 9 0 0\nv 9 3 -7\nv 5 3 -7\nf 1 2 3 4\n").unwrap();
        assert!(is_model(&path) && !is_model(Path::new("scene.json")) && !is_model(Path::new("glb")));
        let (document, scene) = opened(&path);
        assert_eq!(document.views.len(), 1);
        for &corner in &scene.mesh.positions {
            let place = scene.views[0].camera.project(corner).unwrap();
            let is_inside = (0.0..1280.0).contains(&place.x) && (0.0..720.0).contains(&place.y);
            assert!(is_inside, "{corner} is at {place}");
        }
        std::fs::write(&path, "v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n").unwrap();
        assert!(scene_of(&path).is_err());
    }
}
