//! Transfer functions, in the document.

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::scene::{self, LayerKind, Mesh, TransferPlace};

use super::assets::Assets;
use super::channels::Paint;
use super::file_name::FileName;
use super::flaw::{At, Built, Flaw, checked, within};
use super::view::view_number;

/// Texels a side at most: more are not seen, and diffusion takes long.
const MOST: usize = 1024;
/// Constraints of a diffusion layer at most.
const MOST_POINTS: usize = 10_000;

/// A colour of scattered light for two properties of a view ray: what is far away, or in full light, gets a colour of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Transfer {
    /// What its colours are.
    #[serde(rename = "as", default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub role: TransferRole,
    /// Which properties, two different ones.
    #[serde(default = "axes")]
    pub axes: [TransferAxis; 2],
    /// The depth at the end of its axis, in units of the scene; a ray without a surface ends there. When not given, 95 % of the
    /// surfaces that the views see are nearer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub far: Option<f64>,
    /// Texels along both axes.
    #[serde(default = "size")]
    pub size: [usize; 2],
    /// What it is made of, from the bottom up, over white; at least one.
    #[schemars(length(min = 1))]
    pub layers: Vec<TransferLayer>,
    /// How far it goes from light as it is to what the layers say, from 0 to 1.
    #[serde(default = "one")]
    pub strength: f64,
}

/// What the colours of a transfer function are.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TransferRole {
    /// Scattered light is multiplied by them.
    #[default]
    Factor,
    /// They are scattered light, in its place, whatever the light map. White is as bright as air that scatters evenly to all sides, lit all
    /// along an endless ray.
    Color,
}

/// A layer of a transfer function.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TransferLayer {
    /// One colour.
    Solid(Solid),
    /// One colour at the beginning of an axis, another at its end.
    Gradient(Gradient),
    /// A picture: the first axis to the right, the second downwards.
    Image(TransferImage),
    /// What spreads from some points: one is one colour, two are a gradient.
    Diffusion(Diffusion),
}

/// One colour.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Solid {
    /// Which one.
    pub color: Paint,
    /// How it is laid over the layers below.
    #[serde(default)]
    pub blend: Blend,
    /// A factor of its alpha, from 0 to 1.
    #[serde(default = "one")]
    pub opacity: f64,
}

/// One colour at the beginning of an axis, another at its end.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gradient {
    /// Which of the function's axes.
    pub along: TransferAxis,
    /// At its beginning, such as where there is no light, or next to the eye.
    pub from: Paint,
    /// At its end, such as where all is lit, or far away.
    pub to: Paint,
    /// How it is laid over the layers below.
    #[serde(default)]
    pub blend: Blend,
    /// A factor of its alpha, from 0 to 1.
    #[serde(default = "one")]
    pub opacity: f64,
}

/// A picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TransferImage {
    /// An EXR or PNG picture of any size, relative to the scene file.
    pub file: FileName,
    /// How it is laid over the layers below.
    #[serde(default)]
    pub blend: Blend,
    /// A factor of its alpha, from 0 to 1.
    #[serde(default = "one")]
    pub opacity: f64,
}

/// What spreads from some points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Diffusion {
    /// At least one.
    #[schemars(length(min = 1))]
    pub points: Vec<TransferPoint>,
    /// How it is laid over the layers below.
    #[serde(default)]
    pub blend: Blend,
    /// A factor of its alpha, from 0 to 1.
    #[serde(default = "one")]
    pub opacity: f64,
}

/// A point from which colour spreads: `at` values of both axes, or at those that a `view` sees at a `pixel` or on a `triangle`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TransferPoint {
    /// Its colour.
    pub color: Paint,
    /// Its alpha, from 0 to 1.
    #[serde(default = "one")]
    pub alpha: f64,
    /// The values of both axes, from 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<[f64; 2]>,
    /// The view that sees it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub view: Option<String>,
    /// Its place in the picture of the view, in pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pixel: Option<[f64; 2]>,
    /// The triangle of the scene that it is on, counted from 0 over all `occluders`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub triangle: Option<usize>,
    /// Where on the triangle: the weights of its three corners, which add up to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub corners: Option<[f64; 3]>,
}

/// A property of a view ray, up to the first surface or the far end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TransferAxis {
    /// The share of it that is lit.
    Visibility,
    /// Its length, as a share of `far`.
    Depth,
    /// The mean distance of its lit points, as a share of its length; 0 where nothing is lit.
    Position,
    /// The angle between its direction and that towards the light: 0 looks at the light, 1 away from it.
    Angle,
}

/// How a layer is laid over those below.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Blend {
    /// In their place, as far as its alpha says.
    #[default]
    Alpha,
    /// They are multiplied, as far as its alpha says.
    Multiply,
    /// It is added, times its alpha.
    Add,
}

impl Transfer {
    /// One of these layers, with everything else at its default.
    pub fn new(layers: Vec<TransferLayer>) -> Self {
        let role = TransferRole::default();
        Self { role, axes: axes(), far: None, size: size(), layers, strength: one() }
    }

    /// A picture as a function, texel by texel.
    pub(super) fn picture(file: &FileName, assets: &Assets) -> Built<Self> {
        let size = assets.size_of(file)?;
        if size.iter().any(|side| *side > MOST) {
            let problem =
                format!("the picture has {} x {} pixels; {MOST} a side are allowed", size[0], size[1]);
            return Err(Flaw::new("", problem));
        }
        let image = TransferImage { file: file.clone(), blend: Blend::Alpha, opacity: 1.0 };
        Ok(Self { size, ..Self::new(vec![TransferLayer::Image(image)]) })
    }

    pub(super) fn build(
        &self,
        views: &[scene::View],
        mesh: &Mesh,
        assets: &Assets,
    ) -> Built<scene::Transfer> {
        let far = self.far.map(|far| checked("far", far, "above 0", |far| far > 0.0)).transpose()?;
        if self.axes[0] == self.axes[1] {
            return Err(Flaw::new("axes", "both are the same; give two different ones"));
        }
        for (axis, side) in self.size.into_iter().enumerate() {
            within(&format!("size[{axis}]"), side, [1, MOST])?;
        }
        if self.layers.is_empty() {
            return Err(Flaw::new("layers", "there is no layer; add one, or leave `transfer` away"));
        }
        let layers = self.layers.iter().enumerate();
        let within_axes = |layer: &TransferLayer| layer.build(self.axes, views, mesh, assets);
        let layers = layers.map(|(i, layer)| within_axes(layer).at(&format!("layers[{i}]")));
        let layers = layers.collect::<Built<_>>()?;
        let strength = within("strength", self.strength, [0.0, 1.0])?;
        let axes = self.axes.map(Into::into);
        Ok(scene::Transfer { role: self.role.into(), axes, size: self.size, far, layers, strength })
    }
}

impl TransferLayer {
    fn build(
        &self,
        axes: [TransferAxis; 2],
        views: &[scene::View],
        mesh: &Mesh,
        assets: &Assets,
    ) -> Built<scene::TransferLayer> {
        let (name, shows, blend, opacity) = match self {
            Self::Solid(it) => ("solid", it.color.rgb("color").map(LayerKind::Solid), it.blend, it.opacity),
            Self::Gradient(it) => ("gradient", it.build(axes), it.blend, it.opacity),
            Self::Image(it) => {
                let picture = assets.transfer(&it.file).at("file").map(LayerKind::Picture);
                ("image", picture, it.blend, it.opacity)
            }
            Self::Diffusion(it) => ("diffusion", it.build(views, mesh), it.blend, it.opacity),
        };
        let shows = shows.at(name)?;
        let opacity = within("opacity", opacity, [0.0, 1.0]).at(name)?;
        Ok(scene::TransferLayer { shows, blend: blend.into(), opacity })
    }
}

impl Gradient {
    fn build(&self, axes: [TransferAxis; 2]) -> Built<LayerKind> {
        let ends = [self.from.rgb("from")?, self.to.rgb("to")?];
        let axis = axes.iter().position(|axis| *axis == self.along);
        let axis = axis.ok_or_else(|| Flaw::new("along", "it is none of the function's `axes`"))?;
        Ok(LayerKind::Gradient { axis, ends })
    }
}

impl Diffusion {
    fn build(&self, views: &[scene::View], mesh: &Mesh) -> Built<LayerKind> {
        within("points", self.points.len(), [1, MOST_POINTS])?;
        let points = self.points.iter().enumerate();
        let points = points.map(|(i, point)| point.build(views, mesh).at(&format!("points[{i}]")));
        Ok(LayerKind::Diffusion(points.collect::<Built<_>>()?))
    }
}

impl TransferPoint {
    fn build(&self, views: &[scene::View], mesh: &Mesh) -> Built<scene::TransferPoint> {
        let color = self.color.rgb("color")?;
        let alpha = within("alpha", self.alpha, [0.0, 1.0])?;
        let Self { at, view, pixel, triangle, corners, .. } = self;
        let place = match (at, view, pixel, triangle, corners) {
            (Some(at), None, None, None, None) => {
                for (axis, &value) in at.iter().enumerate() {
                    within(&format!("at[{axis}]"), value, [0.0, 1.0])?;
                }
                TransferPlace::Axes(*at)
            }
            (None, Some(view), Some(pixel), None, None) => {
                let view = view_number(view, views)?;
                let size = views[view].camera.size();
                for (axis, &value) in pixel.iter().enumerate() {
                    within(&format!("pixel[{axis}]"), value, [0.0, size[axis] as f64])?;
                }
                TransferPlace::Pixel { view, at: [0, 1].map(|axis| pixel[axis] / size[axis] as f64) }
            }
            (None, Some(view), None, Some(triangle), Some(corners)) => {
                let view = view_number(view, views)?;
                TransferPlace::Point { view, point: on_triangle(mesh, *triangle, *corners)? }
            }
            _ => {
                let problem =
                    "say where it is: `at`, or `view` and `pixel`, or `view`, `triangle` and `corners`";
                return Err(Flaw::new("", problem));
            }
        };
        Ok(scene::TransferPoint { place, color, alpha })
    }
}

fn on_triangle(mesh: &Mesh, triangle: usize, corners: [f64; 3]) -> Built<DVec3> {
    let Some(vertices) = mesh.triangles.get(triangle) else {
        let expected = format!("below {}, the number of triangles of the scene", mesh.triangles.len());
        return Err(Flaw::value("triangle", triangle, &expected));
    };
    if corners.iter().any(|weight| !(0.0..=1.0).contains(weight))
        || (corners.iter().sum::<f64>() - 1.0).abs() > 1e-6
    {
        let expected = "three weights from 0 to 1 that add up to 1";
        return Err(Flaw::value("corners", format!("{corners:?}"), expected));
    }
    Ok(vertices.iter().zip(corners).map(|(&vertex, weight)| weight * mesh.positions[vertex as usize]).sum())
}

impl From<Blend> for scene::Blend {
    fn from(blend: Blend) -> Self {
        match blend {
            Blend::Alpha => Self::Alpha,
            Blend::Multiply => Self::Multiply,
            Blend::Add => Self::Add,
        }
    }
}

impl From<TransferRole> for scene::TransferRole {
    fn from(role: TransferRole) -> Self {
        match role {
            TransferRole::Factor => Self::Factor,
            TransferRole::Color => Self::Color,
        }
    }
}

impl From<TransferAxis> for scene::TransferAxis {
    fn from(axis: TransferAxis) -> Self {
        match axis {
            TransferAxis::Visibility => Self::Visibility,
            TransferAxis::Depth => Self::Depth,
            TransferAxis::Position => Self::Position,
            TransferAxis::Angle => Self::Angle,
        }
    }
}

fn axes() -> [TransferAxis; 2] {
    [TransferAxis::Visibility, TransferAxis::Depth]
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

fn size() -> [usize; 2] {
    [128, 128]
}

fn one() -> f64 {
    1.0
}
