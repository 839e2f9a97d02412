use std::sync::Arc;

use super::{
    DirectionalLight, Environment, Image, Interpolation, LightBasis, Mesh, Opacity, Regularization, Rgb,
    SolveSettings, Target, View, Volume,
};

/// Everything that a volume solve starts from.
#[derive(Debug, Clone)]
pub struct VolumeScene {
    /// What the scene is called in titles and reports.
    pub name: String,
    /// The medium as it is before the solve.
    pub medium: VolumeMedium,
    /// Suns.
    pub lights: Vec<DirectionalLight>,
    /// Light from everywhere, as it is before the solve.
    pub environment: Environment,
    /// The basis functions of an environment that is looked for.
    pub light_basis: Arc<LightBasis>,
    /// Voxels of the cached light along each axis. Where it is none, as many as the extinction, for suns up to 128 and for
    /// the environment up to 64.
    pub light_size: Option<[usize; 3]>,
    /// Radiance that is seen where a ray leaves the volume and meets no surface; that of the environment where it is none.
    pub background: Option<Rgb>,
    /// Surfaces in front of the volume, inside it and behind.
    pub mesh: Arc<Mesh>,
    /// Cameras, and what their pictures should show.
    pub views: Vec<VolumeView>,
    /// What a painted colour means.
    pub target: Target,
    /// What the opacity of paint means.
    pub opacity: Opacity,
    /// What is looked for, in turn.
    pub stages: Vec<Find>,
    /// How often the stages are gone through at most: over and over, until the pictures come no nearer.
    pub rounds: usize,
    /// How extinction is looked for.
    pub extinction: ExtinctionSettings,
    /// Bounds of emission, albedo and extinction: the least and the largest value a channel.
    pub bounds: PropertyBounds,
    /// Pull of emission and albedo to their start in a joint solve, relative to `solve.regularization.tikhonov`.
    pub pull: [f64; 2],
    /// Whether voxels outside the visual hull of the masks are left out.
    pub hull: bool,
    /// Whether views are painted: then there is not one row a voxel and more, and what paint leaves open is smooth.
    pub is_painted: bool,
    /// What lights of an environment that is looked for are pulled to, in place of `solve.regularization`.
    pub regularization_of_sky: Regularization,
    /// How problems are solved.
    pub solve: SolveSettings,
    /// Stops by which PNG pictures are brightened; EXR pictures hold radiance as it is.
    pub exposure: f64,
}

impl VolumeScene {
    /// Pixels of all views.
    pub fn pixels(&self) -> usize {
        self.views.iter().map(|view| view.view.camera.size().iter().product::<usize>()).sum()
    }
}

/// A heterogeneous medium.
#[derive(Debug, Clone)]
pub struct VolumeMedium {
    /// σ_t in 1/metre.
    pub extinction: Arc<Volume>,
    /// ρ, from 0 to 1.
    pub albedo: Arc<Volume>,
    /// Emitted radiance L_e, of which a piece of the medium with optical depth dτ gives L_e dτ.
    pub emission: Arc<Volume>,
    /// Mean cosine g of the Henyey–Greenstein phase function, inside (−1, 1).
    pub g: f64,
    /// What lies between the centres of voxels, and the basis of what is looked for.
    pub interpolation: Interpolation,
    /// What bends the rays: the index of refraction, and the step in metres (none: half a voxel).
    pub refraction: Option<(Arc<Volume>, Option<f64>)>,
}

/// A camera and what its picture should show.
#[derive(Debug, Clone)]
pub struct VolumeView {
    /// Name, camera, and what is painted over the picture.
    pub view: View,
    /// Radiance that the picture should show and, in alpha, the weight of each pixel.
    pub picture: Option<super::RgbaImage>,
    /// Whether the volume is seen in each pixel, row by row; none where nobody says.
    pub mask: Option<Vec<bool>>,
    /// Radiance that is seen behind the volume, instead of the scene's background.
    pub background: Option<Image>,
}

impl VolumeView {
    /// Whether it says what its picture should show.
    pub fn is_wanted(&self) -> bool {
        self.picture.is_some() || !self.view.strokes.is_empty() || !self.view.layers.is_empty()
    }
}

/// What is looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Find {
    /// Emission.
    Emission,
    /// Albedo.
    Albedo,
    /// Emission and albedo together.
    Joint,
    /// Extinction in log space, for a medium of the same radiance everywhere.
    Extinction,
    /// Extinction by Gauss–Newton on the radiance, from what it is.
    Refinement,
    /// The light around the volume.
    Environment,
}

impl Find {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Emission, Self::Albedo, Self::Joint, Self::Extinction, Self::Refinement, Self::Environment];

    /// Its name in scene files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Emission => "emission",
            Self::Albedo => "albedo",
            Self::Joint => "joint",
            Self::Extinction => "extinction",
            Self::Refinement => "refinement",
            Self::Environment => "environment",
        }
    }
}

/// How extinction is looked for (Klehm 2015, eq. 7.13).
#[derive(Debug, Clone, PartialEq)]
pub struct ExtinctionSettings {
    /// L_m, the radiance that the medium gives per optical depth everywhere and in every direction.
    pub medium_radiance: Rgb,
    /// One σ_t for all channels, or one a channel.
    pub is_grey: bool,
    /// Steps of Gauss–Newton that a refinement takes at most.
    pub steps: usize,
    /// Whether a refinement takes the medium to emit and to scatter once, rather than to give `medium_radiance` everywhere.
    pub is_scattering: bool,
}

/// The least and the largest value a channel of each property.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PropertyBounds {
    /// Of emission: radiance per optical depth.
    pub emission: [[f64; 3]; 2],
    /// Of albedo: dimensionless.
    pub albedo: [[f64; 3]; 2],
    /// Of extinction: 1/metre.
    pub extinction: [[f64; 3]; 2],
    /// Of the lights of the environment: radiance.
    pub environment: [[f64; 3]; 2],
}

impl Default for PropertyBounds {
    fn default() -> Self {
        let not_negative = [[0.0; 3], [f64::INFINITY; 3]];
        let albedo = [[0.0; 3], [1.0; 3]];
        Self { emission: not_negative, albedo, extinction: not_negative, environment: not_negative }
    }
}
