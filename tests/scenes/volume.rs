//! Scenes of one volume.

use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3};
use unscatter::problem::{Canvas, Desired, Model, Optics, VolumeProblem, VolumeRenderer, VolumeState};
use unscatter::scene::{
    Camera, Environment, ExtinctionSettings, Find, FovAxis, Image, Interpolation, LightBasis, Mesh, Opacity,
    Over, PropertyBounds, Regularization, RegularizationWeight, Rgb, Samples, SolveSettings, Target, View,
    Volume, VolumeMedium, VolumeScene, VolumeView, VoxelGrid, look_at,
};
use unscatter::visibility::Geometry;

/// Waves in the cube from −1 to 1, all of it or in a blob that fills 18 %, seen by cameras that look at its centre.
#[derive(Debug, Clone)]
pub struct Cloud {
    /// Voxels along each axis.
    pub side: usize,
    pub is_full: bool,
    pub basis: Interpolation,
    pub eyes: Vec<DVec3>,
    pub picture: [usize; 2],
    /// Discs over the upper hemisphere, where the light is looked for.
    pub lights: usize,
}

impl Cloud {
    /// The size of Klehm 2015, fig. 7.3: 128³ voxels, two views of 480 × 480.
    pub fn seen_twice(is_full: bool, basis: Interpolation) -> Self {
        let eyes = vec![DVec3::NEG_Z * 3.0, DVec3::NEG_X * 3.0];
        Self { side: 128, is_full, basis, eyes, picture: [480; 2], lights: 16 }
    }

    /// The size of Klehm 2015, fig. 7.4: 16 lights, 128³ voxels, ten views of 640 × 360.
    pub fn seen_from_around(is_full: bool, basis: Interpolation) -> Self {
        let distance = if is_full { 5.0 } else { 3.0 };
        let eye = |number: usize| {
            let turn = DQuat::from_rotation_y(std::f64::consts::TAU * number as f64 / 10.0);
            turn * DVec3::new(0.0, if number.is_multiple_of(2) { 0.5 } else { -0.3 }, distance)
        };
        let eyes = (0..10).map(eye).collect();
        Self { side: 128, is_full, basis, eyes, picture: [640, 360], lights: 16 }
    }

    /// The same with a part of the voxels and pixels along each axis.
    pub fn shrunk(self, by: usize) -> Self {
        Self { side: self.side / by, picture: self.picture.map(|side| side / by), ..self }
    }

    pub fn scene(&self) -> VolumeScene {
        let extinction = self.extinction();
        let everywhere = |value: f32| Volume::constant(*extinction.grid(), [value; 3]).unwrap();
        let medium = VolumeMedium {
            albedo: Arc::new(everywhere(0.9)),
            emission: Arc::new(everywhere(0.0)),
            extinction: Arc::new(extinction),
            g: 0.0,
            interpolation: self.basis,
            refraction: None,
        };
        let camera = |eye: &DVec3| {
            let world = look_at(*eye, DVec3::ZERO, DVec3::Y).unwrap();
            Camera::new(world, 53.0, FovAxis::Y, self.picture).unwrap()
        };
        let dark = Environment::constant([0.0; 3], 1).unwrap();
        let mut scene = scene(medium, dark, self.eyes.iter().map(camera).collect());
        let above = Over::Hemisphere(DVec3::Y);
        scene.light_basis = Arc::new(LightBasis::discs(self.lights, above, 0.5, 1).unwrap());
        scene.background = Some([0.1, 0.2, 0.3]);
        scene
    }

    fn extinction(&self) -> Volume {
        let cube =
            DAffine3::from_scale_rotation_translation(DVec3::splat(2.0), DQuat::IDENTITY, DVec3::NEG_ONE);
        let grid = VoxelGrid::over_cube([self.side; 3], cube).unwrap();
        let sigma_t = |index: usize| {
            let p = grid.centre(grid.voxel(index));
            let waves = 0.4 * (7.0 * p.x).sin() * (9.0 * p.y).sin() * (8.0 * p.z).sin();
            match self.is_full {
                true => 0.7 + waves,
                false => 6.0 * (1.0 - 2.0 * p.length_squared() + waves).max(0.0),
            }
        };
        let values = (0..grid.len()).map(|index| sigma_t(index) as f32).collect();
        Volume::new(grid, 1, Samples::F32(values)).unwrap()
    }

    /// Pictures of one colour, all of whose pixels are wanted.
    pub fn even(&self) -> Vec<Desired> {
        let [width, height] = self.picture;
        let picture = || Desired { pixels: vec![[0.3, 0.4, 0.5, 1.0]; width * height] };
        self.eyes.iter().map(|_| picture()).collect()
    }

    /// The problem of finding something behind even pictures.
    pub fn problem(&self, find: Find) -> VolumeProblem {
        problem(&self.scene(), &self.even(), find)
    }

    /// Pictures of the cloud in lights of different colours, all of whose pixels are wanted.
    pub fn lit(&self) -> Vec<Desired> {
        let scene = self.scene();
        let color =
            |light: usize| [0.2 + (light % 5) as f32, 0.5 + (light % 3) as f32, 1.0 + (light % 2) as f32];
        let colors: Vec<Rgb> = (0..scene.light_basis.len()).map(color).collect();
        let environment = Environment::lights(scene.light_basis.clone(), colors).unwrap();
        let state = VolumeState { environment, ..VolumeState::of(&scene).unwrap() };
        wanted(&pictures_in(&scene, &state, Find::Environment))
    }
}

/// A medium under a sky, without surfaces, seen by some cameras; nothing pulls at what is looked for.
pub fn scene(medium: VolumeMedium, environment: Environment, cameras: Vec<Camera>) -> VolumeScene {
    let view = |(index, camera): (usize, Camera)| VolumeView {
        view: View {
            name: format!("view {index}"),
            camera,
            strokes: Vec::new(),
            layers: Vec::new(),
            keep: 1.0,
        },
        picture: None,
        mask: None,
        background: None,
    };
    let regularization =
        Regularization { tikhonov: RegularizationWeight::Relative(0.0), ..Regularization::default() };
    VolumeScene {
        name: String::new(),
        medium,
        lights: Vec::new(),
        environment,
        light_basis: Arc::new(LightBasis::discs(1, Over::Sphere, 0.5, 1).unwrap()),
        light_size: None,
        background: None,
        mesh: Arc::new(Mesh::default()),
        views: cameras.into_iter().enumerate().map(view).collect(),
        target: Target::Radiance,
        opacity: Opacity::default(),
        stages: Vec::new(),
        rounds: 1,
        extinction: ExtinctionSettings {
            medium_radiance: [0.0; 3],
            is_grey: true,
            steps: 10,
            is_scattering: false,
        },
        bounds: PropertyBounds::default(),
        pull: [1.0; 2],
        hull: true,
        is_painted: false,
        regularization_of_sky: regularization,
        solve: SolveSettings { regularization, iterations: 400, tolerance: 1e-6, ..SolveSettings::default() },
        exposure: 0.0,
    }
}

/// A state of a scene as rays meet it, surfaces and all.
pub fn optics(scene: &VolumeScene, state: &VolumeState) -> Optics {
    let geometry = Arc::new(Geometry::new(scene.mesh.clone()).unwrap());
    Optics::new(scene, &geometry, state).unwrap()
}

/// What every view sees of a medium.
pub fn pictures(scene: &VolumeScene, medium: &VolumeMedium, find: Find) -> Vec<Image> {
    let state = VolumeState { medium: medium.clone(), ..VolumeState::of(scene).unwrap() };
    pictures_in(scene, &state, find)
}

/// The same of a medium and the light around it.
pub fn pictures_in(scene: &VolumeScene, state: &VolumeState, find: Find) -> Vec<Image> {
    let medium = &state.medium;
    let optics = optics(scene, state);
    let model: Model = VolumeProblem::model(scene, find);
    let renderer = VolumeRenderer::new(scene, medium, &optics, model);
    (0..scene.views.len()).map(|view| renderer.picture(view, &Canvas::Processor).unwrap()).collect()
}

/// Every pixel is wanted to be as in a picture.
pub fn wanted(pictures: &[Image]) -> Vec<Desired> {
    let pixels = |picture: &Image| picture.pixels.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect();
    pictures.iter().map(|picture| Desired { pixels: pixels(picture) }).collect()
}

/// The problem of finding something of a scene's medium.
pub fn problem(scene: &VolumeScene, desired: &[Desired], find: Find) -> VolumeProblem {
    let optics = optics(scene, &VolumeState::of(scene).unwrap());
    VolumeProblem::new(scene, &scene.medium, &optics, desired, find).unwrap()
}
