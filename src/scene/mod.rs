//! Plain data of a scene: what there is, where it is, and what has been painted.
//!
//! World space is right-handed, in metres; cameras look along −Z with +Y up (glTF). Radiance is
//! linear Rec. 709. Pixel (0, 0) is the top left one and its centre is at (0.5, 0.5).

mod animation;
mod camera;
mod directions;
mod environment;
mod glass;
mod grid;
mod heterogeneity;
mod image;
mod lens;
mod light;
mod light_basis;
mod looks;
mod medium;
mod mesh;
mod primitive;
mod procedural;
mod settings;
mod skipping;
mod strokes;
mod surface_light;
mod surroundings;
mod transfer;
mod view;
mod volume;
mod volume_scene;
mod voxel_set;
mod wrap;

use std::sync::Arc;

pub use animation::{AnimatedScene, Animation, KeyFrame, KeySpan, LightMaps};
pub use camera::{Camera, FovAxis, Ray, look_at};
pub use environment::Environment;
pub use glass::{Glass, Tint};
pub use grid::{Extent, Grid};
pub use heterogeneity::{AirNoise, AirStroke, BlendVolume, Blends, Heterogeneity};
pub use image::{Image, RgbaImage};
pub use lens::{Lens, Projection};
pub use light::{DirectionalLight, LightFrame};
pub use light_basis::{BasisLight, LightBasis, Over};
pub use looks::{HoleNoise, Holes, Kernel, Look, Looks, OccluderEdit, OccluderEditKind, Radius, Sway};
pub use medium::{Medium, henyey_greenstein};
pub use mesh::{AlphaMask, Material, Mesh, Object};
pub use primitive::Primitive;
pub(crate) use procedural::tileable_noise;
pub use procedural::{Blob, Noise, Procedural};
pub use settings::{
    Basis, Fade, MapFit, MapSettings, MetricName, Opacity, Quadrature, Regularization, RegularizationWeight,
    SolveSettings, SolverName, Sought, Strategy, Target,
};
pub use skipping::Skipping;
pub use strokes::Stroke;
pub use surface_light::{SurfaceLight, SurfaceMethod, Weighting};
pub use surroundings::{Sky, Surroundings};
pub use transfer::{
    Blend, LayerKind, Transfer, TransferAxis, TransferLayer, TransferPlace, TransferPoint, TransferRole,
};
pub use view::View;
pub use volume::{Interpolation, Samples, Volume, VoxelGrid};
pub use volume_scene::{ExtinctionSettings, Find, PropertyBounds, VolumeMedium, VolumeScene, VolumeView};
pub use voxel_set::{BRICK, VoxelSet};
pub use wrap::Wrap;

/// One colour or one value a channel: linear Rec. 709.
pub type Rgb = [f32; 3];

/// A colour from its channels.
pub(crate) fn rgb(channel: impl Fn(usize) -> f32) -> Rgb {
    std::array::from_fn(channel)
}

/// Relative luminance of a linear Rec. 709 colour: a white light of this radiance is as bright.
pub fn luminance(color: Rgb) -> f32 {
    0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2]
}

/// A colour a `share` of the way from one to another.
pub(crate) fn mixed(from: &Rgb, to: &Rgb, share: f64) -> Rgb {
    std::array::from_fn(|c| ((1.0 - share) * f64::from(from[c]) + share * f64::from(to[c])) as f32)
}

/// Everything that a light-map solve starts from.
#[derive(Debug, Clone)]
pub struct Scene {
    /// What the scene is called in titles and reports.
    pub name: String,
    /// The sun.
    pub light: DirectionalLight,
    /// The air, per unit of length of the scene.
    pub medium: Medium,
    /// Metres in a unit of length of the scene, of which there is only talk.
    pub metres_per_unit: f64,
    /// What casts shadows and what the views see.
    pub mesh: Arc<Mesh>,
    /// Radiance from everywhere but the sun: surfaces reflect it, and the medium scatters it towards the eye.
    pub ambient: Rgb,
    /// Light beside that of the light map which is looked for together with it.
    pub surroundings: Option<Surroundings>,
    /// Cameras and what is painted on their pictures.
    pub views: Vec<View>,
    /// How shafts are bent beyond what is physical.
    pub looks: Looks,
    /// Resolution, extent and basis of the light map.
    pub light_map: MapSettings,
    /// Resolution and extent of the shadow map.
    pub shadow_map: MapSettings,
    /// What is looked for behind paint.
    pub find: Sought,
    /// What a painted colour means.
    pub target: Target,
    /// What the opacity of paint means.
    pub opacity: Opacity,
    /// How the problem is solved.
    pub solve: SolveSettings,
    /// Stops by which PNG pictures are brightened; where none are given, as many as make them readable. EXR pictures hold radiance as it
    /// is.
    pub exposure: Option<f64>,
}

impl Scene {
    /// Pixels of all views.
    pub fn pixels(&self) -> usize {
        self.views.iter().map(|view| view.camera.size().iter().product::<usize>()).sum()
    }
}
