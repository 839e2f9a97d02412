//! Light around a volume at the size of Klehm 2015, fig. 7.4: 16 lights, ten views of 640 × 360, 128³ voxels.
//!
//! `cargo bench --bench environment [-- blob|trilinear|sky|volumes|lights=256|trials=1]`; times are medians. The volume is full; a
//! `blob` fills 18 % of it.

#![allow(missing_docs, clippy::print_stdout, reason = "figures are what it is for")]

use std::sync::Arc;
use std::time::Instant;

use glam::{DAffine3, DQuat, DVec3};
use unscatter::operator::adjoint_test;
use unscatter::problem::{
    Desired, Optics, TransportOperator, VolumeProblem, VolumeRenderer, VolumeState, minimize,
};
use unscatter::scene::{
    Camera, Environment, ExtinctionSettings, Find, FovAxis, Geometry, Interpolation, LightBasis, Mesh, Over,
    PropertyBounds, Rgb, Samples, SolveSettings, Strategy, Target, View, Volume, VolumeMedium, VolumeScene,
    VolumeView, VoxelGrid, look_at,
};
use unscatter::solve::Control;

const SIDE: usize = 128;
const PICTURE: [usize; 2] = [640, 360];
const VIEWS: usize = 10;
const ITERATIONS: usize = 6;

/// What is asked for on the command line.
struct Asked {
    words: Vec<String>,
}

impl Asked {
    fn has(&self, word: &str) -> bool {
        self.words.iter().any(|asked| asked == word)
    }

    fn number(&self, name: &str, default: usize) -> usize {
        let value = |word: &String| word.strip_prefix(name)?.strip_prefix('=')?.parse().ok();
        self.words.iter().find_map(value).unwrap_or(default)
    }
}

fn main() -> unscatter::Result<()> {
    let asked = Asked { words: std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect() };
    let scene = scene(&asked)?;
    let desired = desired(&scene)?;
    let strategy = if asked.has("volumes") { Strategy::MatrixFree } else { Strategy::Auto };
    let mut times: Vec<[f64; 3]> = Vec::new();
    for _ in 0..asked.number("trials", 7) {
        times.push(measure(&scene, &desired, strategy)?);
    }
    let median = |part: &dyn Fn(&[f64; 3]) -> f64| {
        let mut seconds: Vec<f64> = times.iter().map(part).collect();
        seconds.sort_by(f64::total_cmp);
        seconds[seconds.len() / 2]
    };
    println!(
        "set-up {:.2} s, walking {:.2} s, {ITERATIONS} iterations {:.2} s, together {:.2} s",
        median(&|t| t[0]),
        median(&|t| t[1]),
        median(&|t| t[2]),
        median(&|t| t.iter().sum())
    );
    Ok(())
}

/// Seconds for rows and light volumes; for walking, coverage and the test of the adjoint; and for the iterations.
fn measure(scene: &VolumeScene, desired: &[Desired], strategy: Strategy) -> unscatter::Result<[f64; 3]> {
    let mut clock = Instant::now();
    let mut lap = || {
        let seconds = clock.elapsed().as_secs_f64();
        clock = Instant::now();
        seconds
    };
    let optics = Optics::new(scene, &VolumeState::of(scene)?)?;
    let problem = VolumeProblem::new(scene, &scene.medium, &optics, desired, Find::Environment)?;
    let set_up = lap();
    let operator = problem.operator(strategy, 4 << 30)?;
    let coverage = operator.squares(&problem.row_weights())?;
    let adjoint = adjoint_test(&operator, 1, 1)?.error;
    let walking = lap();
    let settings = VolumeProblem::settings(scene, Find::Environment);
    let solved = minimize(&problem.formulation(), &operator, &coverage, &settings, None, |_, _| {
        Ok(Control::Continue)
    })?;
    let solving = lap();
    let storage = operator.storage();
    println!(
        "{} rows, {} non-zeros kept, adjoint {adjoint:.0e}; {} iterations: {set_up:.2} + {walking:.2} + {solving:.2} s",
        problem.targets.len(),
        storage.kept_nonzeros,
        solved.outcome.stop.iteration
    );
    Ok([set_up, walking, solving])
}

/// The pictures of the volume in a light of the basis, all pixels of which are wanted.
fn desired(scene: &VolumeScene) -> unscatter::Result<Vec<Desired>> {
    let color = |light: usize| [0.2 + (light % 5) as f32, 0.5 + (light % 3) as f32, 1.0 + (light % 2) as f32];
    let colors: Vec<Rgb> = (0..scene.light_basis.len()).map(color).collect();
    let environment = Environment::lights(scene.light_basis.clone(), colors)?;
    let state = VolumeState { environment, ..VolumeState::of(scene)? };
    let optics = Optics::new(scene, &state)?;
    let model = VolumeProblem::model(scene, Find::Environment);
    let renderer = VolumeRenderer::new(scene, &scene.medium, &optics, model);
    (0..VIEWS)
        .map(|view| {
            let picture = renderer.picture(view)?;
            Ok(Desired { pixels: picture.pixels.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect() })
        })
        .collect()
}

fn scene(asked: &Asked) -> unscatter::Result<VolumeScene> {
    let is_blob = asked.has("blob");
    let extinction = extinction(is_blob)?;
    let everywhere = |value: f32| Volume::new(*extinction.grid(), 1, Samples::F32(vec![value; SIDE.pow(3)]));
    let interpolation =
        if asked.has("trilinear") { Interpolation::Trilinear } else { Interpolation::Nearest };
    let medium = VolumeMedium {
        albedo: Arc::new(everywhere(0.9)?),
        emission: Arc::new(everywhere(0.0)?),
        extinction: Arc::new(extinction),
        g: 0.0,
        interpolation,
        refraction: None,
    };
    let lights = asked.number("lights", 16);
    Ok(VolumeScene {
        name: String::new(),
        medium,
        lights: Vec::new(),
        environment: Environment::constant([0.0; 3], 1)?,
        light_basis: Arc::new(LightBasis::discs(lights, Over::Hemisphere(DVec3::Y), 0.5, 1)?),
        light_size: None,
        background: if asked.has("sky") { None } else { Some([0.1, 0.2, 0.3]) },
        geometry: Geometry::new(Mesh::default())?.into(),
        views: (0..VIEWS)
            .map(|number| view(number, if is_blob { 3.0 } else { 5.0 }))
            .collect::<unscatter::Result<_>>()?,
        target: Target::Radiance,
        stages: vec![Find::Environment],
        rounds: 1,
        extinction: ExtinctionSettings {
            medium_radiance: [0.0; 3],
            is_grey: true,
            steps: 1,
            is_scattering: false,
        },
        bounds: PropertyBounds::default(),
        pull: [1.0; 2],
        hull: true,
        solve: SolveSettings { iterations: ITERATIONS, tolerance: 0.0, ..SolveSettings::default() },
        exposure: 0.0,
    })
}

fn view(number: usize, distance: f64) -> unscatter::Result<VolumeView> {
    let turn = DQuat::from_rotation_y(std::f64::consts::TAU * number as f64 / VIEWS as f64);
    let eye = turn * DVec3::new(0.0, if number.is_multiple_of(2) { 0.5 } else { -0.3 }, distance);
    let camera = Camera::new(look_at(eye, DVec3::ZERO, DVec3::Y)?, 53.0, FovAxis::Y, PICTURE)?;
    Ok(VolumeView {
        view: View { name: format!("view {number}"), camera, strokes: Vec::new(), layers: Vec::new() },
        picture: None,
        keep: 1.0,
        mask: None,
        background: None,
    })
}

/// Waves in the cube from −1 to 1, or a blob with waves on it.
fn extinction(is_blob: bool) -> unscatter::Result<Volume> {
    let cube = DAffine3::from_scale_rotation_translation(DVec3::splat(2.0), DQuat::IDENTITY, DVec3::NEG_ONE);
    let grid = VoxelGrid::over_cube([SIDE; 3], cube)?;
    let sigma_t = |index: usize| {
        let p = grid.centre(grid.voxel(index));
        let waves = 0.4 * (7.0 * p.x).sin() * (9.0 * p.y).sin() * (8.0 * p.z).sin();
        match is_blob {
            true => 6.0 * (1.0 - 2.0 * p.length_squared() + waves).max(0.0),
            false => 0.7 + waves,
        }
    };
    Volume::new(grid, 1, Samples::F32((0..grid.len()).map(|index| sigma_t(index) as f32).collect()))
}
