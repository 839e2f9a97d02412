//! Cameras and what is painted on their pictures.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::io::image::Association;
use crate::scene;

use super::assets::Assets;
use super::file_name::FileName;
use super::flaw::{At, Built, Flaw, checked};
use super::stroke::Stroke;
use super::transform::Transform;
use super::wording::nearest;

/// A camera and what is painted on its picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct View {
    /// Names the result files of the view: letters, digits, `_` and `-`; unique also when case is ignored.
    pub name: String,
    /// Where it looks from, and the size of its picture.
    pub camera: Camera,
    /// Painted strokes, in painting order, over the layers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub strokes: Vec<Stroke>,
    /// Painted pictures of the view's size (PNG or EXR, alpha is the opacity), from the bottom up, relative to the
    /// scene file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub layers: Vec<FileName>,
    /// Whether the colours of `layers` are multiplied by their alpha: `associated` or `straight`. As their format has it
    /// when not given: those of an EXR are, those of a PNG are not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub association: Option<Association>,
    /// Weight with which pixels that nothing is painted on stay as they are, from 0 to 1.
    #[serde(default, skip_serializing_if = "is_zero")]
    #[schemars(!skip_serializing_if)]
    pub keep: f64,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// A camera: either `to_world` and `fov` or `lens`, or a camera of a glTF file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Where it stands; looks along its −Z axis, +Y up. Scale is ignored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_world: Option<Transform>,
    /// Field of view in degrees, inside (0, 180).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fov: Option<f64>,
    /// Which side of the picture `fov` is measured along; the height when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fov_axis: Option<FovAxis>,
    /// A lens as calibration finds it, instead of `fov`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lens: Option<CameraLens>,
    /// Takes place and field of view from a camera of a glTF file, instead of `to_world` and `fov`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gltf: Option<GltfCameraNode>,
    /// Width and height of the picture in pixels, each from 1 to 16384.
    pub size: [usize; 2],
}

/// A lens: focal lengths, where its axis meets the picture, and OpenCV's distortion of it. All are for pictures of the camera's `size`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraLens {
    /// In pixels, along the width and along the height.
    pub focal_length: [f64; 2],
    /// Where the axis meets the picture, in pixels from its top left corner; its middle when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub principal_point: Option<[f64; 2]>,
    /// Whether it is a fisheye, whose angles to the axis grow with the distance in the picture.
    #[serde(default)]
    pub fisheye: bool,
    /// Radial distortion.
    #[serde(default)]
    pub k1: f64,
    /// Radial distortion.
    #[serde(default)]
    pub k2: f64,
    /// Radial distortion.
    #[serde(default)]
    pub k3: f64,
    /// Radial distortion.
    #[serde(default)]
    pub k4: f64,
    /// Tangential distortion; none of a fisheye.
    #[serde(default)]
    pub p1: f64,
    /// Tangential distortion; none of a fisheye.
    #[serde(default)]
    pub p2: f64,
}

impl CameraLens {
    fn build(&self, size: [usize; 2]) -> Built<scene::Lens> {
        let tangential = [self.p1, self.p2];
        if self.fisheye && tangential != [0.0; 2] {
            return Err(Flaw::new("p1", "a fisheye has no `p1` and `p2`"));
        }
        let middle = size.map(|side| 0.5 * side as f64);
        let projection = match self.fisheye {
            true => scene::Projection::Equidistant,
            false => scene::Projection::Perspective,
        };
        let radial = [self.k1, self.k2, self.k3, self.k4];
        let lens = scene::Lens::new(self.focal_length, self.principal_point.unwrap_or(middle));
        Ok(scene::Lens { projection, radial, tangential, ..lens })
    }
}

/// A camera of a glTF file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GltfCameraNode {
    /// The .gltf or .glb file, relative to the scene file.
    pub file: FileName,
    /// Name of the node that holds the camera.
    pub node: String,
}

/// A side of a picture.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FovAxis {
    /// The width.
    X,
    /// The height.
    #[default]
    Y,
}

const MAX_NAME: usize = 64;

/// Names of results that are pictures or lie beside them.
const RESERVED: [&str; 8] =
    ["light_map", "coverage", "environment", "albedo", "emission", "extinction", "checkpoint", "report"];

/// Names that some system keeps for its devices.
const DEVICES: [&str; 6] = ["con", "prn", "aux", "nul", "com", "lpt"];

impl View {
    /// A view that nothing is painted on.
    pub fn new(name: String, camera: Camera) -> Self {
        Self { name, camera, strokes: Vec::new(), layers: Vec::new(), association: None, keep: 0.0 }
    }

    pub(super) fn build(&self, assets: &mut Assets) -> Built<scene::View> {
        let camera = checked_camera(&self.name, &self.camera, assets)?;
        painted(&self.name, camera, (&self.strokes, &self.layers, self.association), self.keep, assets)
    }
}

/// The camera of a view, once its name is known to be one.
pub(super) fn checked_camera(name: &str, camera: &Camera, assets: &mut Assets) -> Built<scene::Camera> {
    check_name(name)?;
    camera.build(assets).at("camera")
}

/// A view with what is painted on it.
pub(super) fn painted(
    name: &str,
    camera: scene::Camera,
    (strokes, layers, association): (&[Stroke], &[FileName], Option<Association>),
    keep: f64,
    assets: &Assets,
) -> Built<scene::View> {
    let size = camera.size();
    let strokes = strokes.iter().enumerate();
    let strokes = strokes
        .map(|(i, stroke)| stroke.built_in(&assets.groups, size).at(&format!("strokes[{i}]")))
        .filter_map(Built::transpose);
    let strokes = strokes.collect::<Built<Vec<_>>>()?;
    let layers = layers.iter().enumerate();
    let layers = layers.map(|(i, file)| assets.layer(file, size, association).at(&format!("layers[{i}]")));
    let keep = checked("keep", keep, "from 0 to 1", |keep| (0.0..=1.0).contains(&keep))? as f32;
    Ok(scene::View { name: name.to_owned(), camera, strokes, layers: layers.collect::<Built<_>>()?, keep })
}

fn check_name(name: &str) -> Built<()> {
    let usual = |b: u8| b.is_ascii_alphanumeric() || b == b'_' || b == b'-';
    if name.is_empty() || name.len() > MAX_NAME || !name.bytes().all(usual) {
        let expected = "1 to 64 of the letters A-Z and a-z, digits, `_` and `-`, for it names files";
        return Err(Flaw::value("name", format!("`{name}`"), expected));
    }
    let lower = name.to_ascii_lowercase();
    let device = lower.strip_suffix(|c: char| c.is_ascii_digit()).unwrap_or(&lower);
    if DEVICES.contains(&device) {
        return Err(Flaw::value(
            "name",
            format!("`{name}`"),
            "another name; Windows keeps this one for a device",
        ));
    }
    if RESERVED.contains(&lower.as_str()) || lower.starts_with("turntable_") {
        return Err(Flaw::value("name", format!("`{name}`"), "another name; results have this one"));
    }
    Ok(())
}

impl Camera {
    /// A camera at `to_world` with `fov` degrees along the height of its picture.
    pub fn new(to_world: Transform, fov: f64, size: [usize; 2]) -> Self {
        Self { to_world: Some(to_world), fov: Some(fov), fov_axis: None, lens: None, gltf: None, size }
    }

    fn build(&self, assets: &mut Assets) -> Built<scene::Camera> {
        if let Some(gltf) = &self.gltf {
            let is_alone = self.fov.is_none() && self.fov_axis.is_none() && self.lens.is_none();
            if self.to_world.is_some() || !is_alone {
                let problem = "give either `gltf`, or `to_world` and `fov` (with `fov_axis`) or `lens`";
                return Err(Flaw::new("gltf", problem));
            }
            let camera = assets.camera(&gltf.file, &gltf.node).at("gltf")?;
            return Ok(scene::Camera::new(camera.world_from_camera, camera.fov, camera.fov_axis, self.size)?);
        }
        let to_world = self.to_world.as_ref().ok_or_else(|| missing("to_world"))?.build().at("to_world")?;
        if let Some(lens) = &self.lens {
            if self.fov.is_some() || self.fov_axis.is_some() {
                return Err(Flaw::new("lens", "give either `lens`, or `fov` and `fov_axis`"));
            }
            let built = lens.build(self.size).at("lens")?;
            return scene::Camera::with_lens(to_world, built, self.size).at("lens");
        }
        let fov = self.fov.ok_or_else(|| missing("fov"))?;
        let fov_axis = match self.fov_axis.unwrap_or_default() {
            FovAxis::X => scene::FovAxis::X,
            FovAxis::Y => scene::FovAxis::Y,
        };
        Ok(scene::Camera::new(to_world, fov, fov_axis, self.size)?)
    }

    /// Puts in the settings that are not given; those of a glTF camera stay in its file.
    pub(super) fn settle(&mut self) {
        if let Some(lens) = &mut self.lens {
            lens.principal_point.get_or_insert(self.size.map(|side| 0.5 * side as f64));
        } else if self.gltf.is_none() {
            self.fov_axis.get_or_insert_default();
        }
    }
}

fn missing(field: &str) -> Flaw {
    Flaw::new(
        "",
        format!("missing field `{field}`; a camera needs `to_world` and `fov` or `lens`, or `gltf`"),
    )
}

/// Which view has a name.
pub(super) fn view_number(name: &str, views: &[scene::View]) -> Built<usize> {
    let names: Vec<&str> = views.iter().map(|view| view.name.as_str()).collect();
    names.iter().position(|&view| view == name).ok_or_else(|| {
        let near = nearest(name, &names);
        let remedy = near.map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
        Flaw::new("view", format!("no view is called `{name}`{remedy}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lens_is_what_calibration_says() {
        let read = |text: &str| serde_json::from_str::<Camera>(text).unwrap();
        let build = |text: &str| read(text).build(&mut Assets::beside(std::path::Path::new("x.json")));
        let bent = build(
            r#"{"to_world": {}, "size": [64, 48],
                "lens": {"focal_length": [60, 58], "principal_point": [33, 22], "k1": -0.1, "p2": 0.01}}"#,
        );
        let lens = scene::Lens {
            radial: [-0.1, 0.0, 0.0, 0.0],
            tangential: [0.0, 0.01],
            ..scene::Lens::new([60.0, 58.0], [33.0, 22.0])
        };
        let expected = scene::Camera::with_lens(glam::DAffine3::IDENTITY, lens, [64, 48]).unwrap();
        assert_eq!(bent.unwrap(), expected);
        // In the middle and square, it is the pinhole of that field of view.
        let plain =
            build(r#"{"to_world": {}, "size": [64, 48], "lens": {"focal_length": [60, 60]}}"#).unwrap();
        let pinhole = build(r#"{"to_world": {}, "size": [64, 48], "fov": 43.60281897270362}"#).unwrap();
        let apart = plain.pixel_ray(3, 5).direction - pinhole.pixel_ray(3, 5).direction;
        assert!(apart.length() < 1e-12);
        for bad in [
            r#"{"to_world": {}, "size": [64, 48], "fov": 40, "lens": {"focal_length": [60, 60]}}"#,
            r#"{"to_world": {}, "size": [64, 48], "lens": {"focal_length": [60, 0]}}"#,
            r#"{"to_world": {}, "size": [64, 48], "lens": {"focal_length": [60, 60], "fisheye": true, "p1": 1}}"#,
            r#"{"to_world": {}, "size": [640, 480], "lens": {"focal_length": [60, 60], "k1": -0.4}}"#,
        ] {
            assert!(build(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn names_are_safe_as_file_names() {
        for good in ["a", "left_eye-2", "0", "console", "a".repeat(64).as_str()] {
            assert!(check_name(good).is_ok(), "{good}");
        }
        for bad in [
            "",
            "..",
            "a/b",
            "a b",
            "ä",
            "CON",
            "com1",
            "-\n",
            "light_map",
            "Coverage",
            "turntable_7",
            "a".repeat(65).as_str(),
        ] {
            assert!(check_name(bad).is_err(), "{bad}");
        }
    }
}
