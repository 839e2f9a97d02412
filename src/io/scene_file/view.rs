//! Cameras and what is painted on their pictures.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::io::image::Association;
use crate::scene;

use super::assets::Assets;
use super::channels::Paint;
use super::file_name::FileName;
use super::flaw::{At, Built, Flaw, checked};
use super::transform::Transform;

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

/// A painted stroke: a polyline with round caps and joins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stroke {
    /// Points [x, y] in pixels, (0, 0) is the top left corner of the picture; one point is a dab.
    pub points: Vec<[f64; 2]>,
    /// Half the width in pixels, above 0 and at most 4096.
    pub radius: f64,
    /// From 0 (the opacity falls off linearly from the middle to the edge) to 1 (a hard edge).
    #[serde(default = "Stroke::default_hardness", skip_serializing_if = "Stroke::is_default_hardness")]
    #[schemars(!skip_serializing_if)]
    pub hardness: f64,
    /// How strong the paint is in the middle of the stroke, above 0 and at most 1: at 0.25 it asks for a faint tint.
    #[serde(default = "Stroke::default_opacity", skip_serializing_if = "Stroke::is_default_opacity")]
    #[schemars(!skip_serializing_if)]
    pub opacity: f64,
    /// How much its pixels weigh in the solve, above 0 and at most 1, whatever their opacity; less on its soft edge.
    #[serde(default = "Stroke::default_weight", skip_serializing_if = "Stroke::is_default_weight")]
    #[schemars(!skip_serializing_if)]
    pub weight: f64,
    /// Whether it takes paint away from what is below it, layers included, instead of putting some on. Its colour and weight say nothing then.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    #[schemars(!skip_serializing_if)]
    pub erase: bool,
    /// The desired colour: "#rrggbb" in sRGB, or [r, g, b] in linear Rec. 709.
    pub color: Paint,
}

const MAX_NAME: usize = 64;
const MAX_POINTS: usize = 100_000;
const MAX_RADIUS: f64 = 4096.0;

/// Farther away from the picture no point of a stroke can matter, and pixels are no longer told apart in f32.
const MAX_COORDINATE: f64 = 1e6;

/// Names of results that are pictures or lie beside them.
const RESERVED: [&str; 8] =
    ["light_map", "coverage", "environment", "albedo", "emission", "extinction", "checkpoint", "report"];

/// Names that some system keeps for its devices.
const DEVICES: [&str; 6] = ["con", "prn", "aux", "nul", "com", "lpt"];

impl View {
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
    let strokes = strokes.map(|(i, stroke)| stroke.build(size).at(&format!("strokes[{i}]")));
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

impl Stroke {
    /// A stroke of the default hardness and opacity.
    pub fn new(points: Vec<[f64; 2]>, radius: f64, color: Paint) -> Self {
        Self {
            points,
            radius,
            hardness: Self::default_hardness(),
            opacity: Self::default_opacity(),
            weight: Self::default_weight(),
            erase: false,
            color,
        }
    }

    /// The stroke on a picture of this size.
    ///
    /// Errors: what is wrong with it, in words.
    pub fn on(&self, size: [usize; 2]) -> Result<scene::Stroke, String> {
        self.build(size).map_err(|flaw| match flaw {
            Flaw::Document { path, problem } if path.is_empty() => problem,
            Flaw::Document { path, problem } => format!("{path}: {problem}"),
            Flaw::Machine(error) => error.to_string(),
        })
    }

    fn build(&self, size: [usize; 2]) -> Built<scene::Stroke> {
        let radius = checked("radius", self.radius, "above 0 and at most 4096 pixels", |r| {
            r > 0.0 && r <= MAX_RADIUS
        })?;
        let hardness =
            checked("hardness", self.hardness, "from 0 (soft) to 1 (hard)", |h| (0.0..=1.0).contains(&h))?;
        let opacity = checked("opacity", self.opacity, "above 0 and at most 1", |o| o > 0.0 && o <= 1.0)?;
        let weight = checked("weight", self.weight, "above 0 and at most 1", |w| w > 0.0 && w <= 1.0)?;
        self.check_points()?;
        let color = self.color.rgb("color")?;
        if !touches(&self.points, radius, size.map(|side| side as f64)) {
            let [width, height] = size;
            let problem =
                format!("the stroke lies outside the view, whose picture has {width} x {height} pixels");
            return Err(Flaw::new("", problem));
        }
        let points = self.points.iter().map(|point| point.map(|c| c as f32)).collect();
        Ok(scene::Stroke {
            points,
            radius: radius as f32,
            hardness: hardness as f32,
            opacity: opacity as f32,
            weight: weight as f32,
            erases: self.erase,
            color,
        })
    }

    fn check_points(&self) -> Built<()> {
        if self.points.is_empty() || self.points.len() > MAX_POINTS {
            return Err(Flaw::value(
                "points",
                format!("a list of {} points", self.points.len()),
                "a list of 1 to 100000 points",
            ));
        }
        let near = |c: f64| c.is_finite() && c.abs() <= MAX_COORDINATE;
        match self.points.iter().position(|point| !point.iter().all(|&c| near(c))) {
            None => Ok(()),
            Some(index) => Err(Flaw::value(
                format!("points[{index}]"),
                format!("{:?}", self.points[index]),
                "finite and within 1000000 pixels of the view",
            )),
        }
    }

    fn default_hardness() -> f64 {
        0.8
    }

    fn is_default_hardness(hardness: &f64) -> bool {
        *hardness == Self::default_hardness()
    }

    fn default_opacity() -> f64 {
        1.0
    }

    fn is_default_opacity(opacity: &f64) -> bool {
        *opacity == Self::default_opacity()
    }

    fn default_weight() -> f64 {
        1.0
    }

    fn is_default_weight(weight: &f64) -> bool {
        *weight == Self::default_weight()
    }
}

/// Whether any part of the stroke's area lies inside the picture.
fn touches(points: &[[f64; 2]], radius: f64, size: [f64; 2]) -> bool {
    let dab = points.first().map(|&point| [point, point]);
    let segments = points.windows(2).map(|pair| [pair[0], pair[1]]);
    dab.into_iter().chain(segments).any(|segment| distance_to_picture(segment, size) < radius)
}

/// The distance between a segment and the rectangle from (0, 0) to `size`.
fn distance_to_picture([a, b]: [[f64; 2]; 2], size: [f64; 2]) -> f64 {
    if crosses([a, b], size) {
        return 0.0;
    }
    let outside = |p: [f64; 2]| length([0, 1].map(|axis| p[axis] - p[axis].clamp(0.0, size[axis])));
    let corners = [[0.0, 0.0], [size[0], 0.0], [0.0, size[1]], size];
    let to_corners = corners.map(|corner| distance_to_segment(corner, [a, b]));
    to_corners.into_iter().fold(outside(a).min(outside(b)), f64::min)
}

/// Liang–Barsky clipping: whether some part of the segment is inside.
fn crosses([a, b]: [[f64; 2]; 2], size: [f64; 2]) -> bool {
    let mut inside = [0.0f64, 1.0];
    for axis in 0..2 {
        let step = b[axis] - a[axis];
        if step == 0.0 {
            if a[axis] < 0.0 || a[axis] > size[axis] {
                return false;
            }
            continue;
        }
        let (s, t) = (-a[axis] / step, (size[axis] - a[axis]) / step);
        inside = [inside[0].max(s.min(t)), inside[1].min(s.max(t))];
    }
    inside[0] <= inside[1]
}

fn distance_to_segment(p: [f64; 2], [a, b]: [[f64; 2]; 2]) -> f64 {
    let (along, from) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let squared = along[0] * along[0] + along[1] * along[1];
    let dot = along[0] * from[0] + along[1] * from[1];
    let t = if squared > 0.0 { (dot / squared).clamp(0.0, 1.0) } else { 0.0 };
    length([from[0] - t * along[0], from[1] - t * along[1]])
}

fn length([x, y]: [f64; 2]) -> f64 {
    x.hypot(y)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [f64; 2] = [100.0, 50.0];

    #[test]
    fn a_stroke_touches_where_its_area_overlaps_the_picture() {
        assert!(touches(&[[50.0, 25.0]], 1.0, SIZE), "a dab inside");
        assert!(touches(&[[-3.0, 10.0]], 3.5, SIZE), "a dab beside the edge");
        assert!(!touches(&[[-3.0, 10.0]], 3.0, SIZE), "a dab that only meets the edge");
        assert!(touches(&[[-50.0, 25.0], [200.0, 25.0]], 0.1, SIZE), "both ends are outside");
        assert!(!touches(&[[-10.0, 5.0], [5.0, -10.0]], 3.5, SIZE), "passes the corner at 3.54");
        assert!(touches(&[[-10.0, 5.0], [5.0, -10.0]], 3.6, SIZE));
        assert!(!touches(&[[0.0, 60.0], [100.0, 70.0], [200.0, 25.0]], 5.0, SIZE));
    }

    #[test]
    fn the_distance_agrees_with_dense_sampling() {
        let points = [[-30.0, -20.0], [130.0, -7.0], [140.0, 80.0], [40.0, 53.0], [-5.0, 70.0], [20.0, 20.0]];
        for a in points {
            for b in points {
                let sampled = (0..=4000).map(|i| {
                    let t = f64::from(i) / 4000.0;
                    let p = [0, 1].map(|axis| a[axis] + t * (b[axis] - a[axis]));
                    length([0, 1].map(|axis| p[axis] - p[axis].clamp(0.0, SIZE[axis])))
                });
                let sampled = sampled.fold(f64::INFINITY, f64::min);
                let got = distance_to_picture([a, b], SIZE);
                assert!((got - sampled).abs() < 0.05, "{a:?} {b:?}: {got} and {sampled}");
            }
        }
    }

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

    #[test]
    fn strokes_without_sense_are_refused_at_their_fault() {
        let good = Stroke::new(vec![[1.0, 2.0]], 2.0, Paint::Hex([1, 2, 3]));
        assert!(good.build([10, 10]).is_ok());
        let bad = [
            ("radius", Stroke { radius: 0.0, ..good.clone() }),
            ("radius", Stroke { radius: 4097.0, ..good.clone() }),
            ("radius", Stroke { radius: f64::NAN, ..good.clone() }),
            ("hardness", Stroke { hardness: -0.1, ..good.clone() }),
            ("opacity", Stroke { opacity: 0.0, ..good.clone() }),
            ("opacity", Stroke { opacity: 1.1, ..good.clone() }),
            ("color", Stroke { color: Paint::Linear([0.0, -1.0, 0.0]), ..good.clone() }),
            ("points", Stroke { points: vec![], ..good.clone() }),
            ("points", Stroke { points: vec![[1.0; 2]; MAX_POINTS + 1], ..good.clone() }),
            ("points[1]", Stroke { points: vec![[1.0; 2], [1.0, f64::INFINITY]], ..good.clone() }),
            ("", Stroke { points: vec![[-2.0, -2.0]], ..good.clone() }),
        ];
        for (expected, stroke) in bad {
            let Err(Flaw::Document { path, .. }) = stroke.build([10, 10]) else {
                unreachable!("{expected} was accepted")
            };
            assert_eq!(path, expected);
        }
    }
}
