//! A painted hall with a slit in its roof, of any size, anywhere, under any light.

use glam::{DAffine3, DVec3};

use super::rows::WorldPlace;
use crate::Result;
use crate::problem::LightMapProblem;
use crate::scene::{
    Camera, DirectionalLight, FovAxis, Looks, MapFit, MapSettings, Medium, Mesh, Opacity, Primitive, Scene,
    SolveSettings, Sought, Stroke, Target, View, look_at,
};

/// Walls, floor and roof: middle and size.
const BOXES: [[[f64; 3]; 2]; 7] = [
    [[0.0, -0.1, 0.0], [14.0, 0.2, 20.0]],
    [[0.0, 3.0, -10.0], [14.0, 6.0, 0.2]],
    [[0.0, 3.0, 10.0], [14.0, 6.0, 0.2]],
    [[-7.0, 3.0, 0.0], [0.2, 6.0, 20.0]],
    [[7.0, 3.0, 0.0], [0.2, 6.0, 20.0]],
    [[-4.0, 6.0, 0.0], [6.0, 0.2, 20.0]],
    [[3.5, 6.0, 0.0], [7.0, 0.2, 20.0]],
];

/// What of the hall is changed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hall {
    pub(super) place: WorldPlace,
    pub(super) radiance: f32,
    /// How often every surface is there.
    pub(super) copies: usize,
}

impl Hall {
    pub(super) const PLAIN: Self = Self { place: WorldPlace::PLAIN, radiance: 4.0, copies: 1 };
}

/// The scene.
pub(super) fn hall(of: &Hall) -> Result<Scene> {
    let Hall { place, radiance, copies } = *of;
    let mut mesh = Mesh::default();
    for [centre, size] in BOXES.iter().flat_map(|shape| std::iter::repeat_n(shape, copies)) {
        let centre = place.at(DVec3::from_array(*centre));
        let size = DVec3::from_array(*size) * place.scale;
        mesh.append(Primitive::Box { centre, size }.mesh([0.5; 3])?, DAffine3::IDENTITY);
    }
    // Round corners would be others at another scale or place.
    let map = |size| MapSettings { fit: MapFit::Seen, ..MapSettings::new([size; 2]) };
    Ok(Scene {
        name: "hall".to_owned(),
        light: DirectionalLight::new(DVec3::new(0.45, -1.0, -0.1), [radiance; 3])?,
        medium: Medium::new([0.08 / place.scale; 3], [0.9; 3], 0.3)?,
        mesh: mesh.into(),
        ambient: [0.0; 3],
        surroundings: None,
        looks: Looks::default(),
        views: vec![
            view("hall", [1.5, 1.7, 9.5], [0.5, 2.6, 0.0], &place)?,
            view("side", [-5.5, 2.0, 3.0], [1.0, 2.4, -1.0], &place)?,
        ],
        light_map: map(32),
        shadow_map: map(96),
        metres_per_unit: 1.0,
        find: Sought::LightMap,
        target: Target::Tint,
        opacity: Opacity::Strength,
        solve: SolveSettings { tolerance: 1e-6, iterations: 2000, ..SolveSettings::default() },
        exposure: None,
    })
}

fn view(name: &str, origin: [f64; 3], target: [f64; 3], place: &WorldPlace) -> Result<View> {
    let [origin, target] = [origin, target].map(|point| place.at(DVec3::from_array(point)));
    let stroke = |points: [[f32; 2]; 2], color| Stroke {
        points: points.to_vec(),
        radius: 4.0,
        hardness: 0.5,
        opacity: 1.0,
        weight: 1.0,
        pressure: Vec::new(),
        erases: false,
        color,
    };
    Ok(View {
        name: name.to_owned(),
        camera: Camera::new(look_at(origin, target, DVec3::Y)?, 55.0, FovAxis::Y, [48, 32])?,
        strokes: vec![
            stroke([[8.0, 6.0], [40.0, 26.0]], [1.0, 0.4, 0.1]),
            stroke([[24.0, 4.0], [30.0, 28.0]], [0.2, 0.5, 1.0]),
        ],
        layers: Vec::new(),
        keep: 0.0,
    })
}

/// Its problem.
pub(super) fn problem(of: &Hall) -> Result<(Scene, LightMapProblem)> {
    let scene = hall(of)?;
    let problem = LightMapProblem::new(&scene)?;
    Ok((scene, problem))
}
