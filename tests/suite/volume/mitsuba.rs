//! Pictures against Mitsuba's, which tests/fixtures/mitsuba/make.py made: single scattering, pixel centres only.

use unscatter::io::image::read_image;
use unscatter::problem::{Canvas, Model, VolumeRenderer, VolumeState};
use unscatter::scene::{DirectionalLight, Environment, Image, VolumeMedium, VolumeScene, look_at};

use super::*;
use crate::scenes::volume::optics;
use crate::tolerances::{MITSUBA_BIAS, MITSUBA_BIAS_THICK, MITSUBA_EMPTY, MITSUBA_LARGEST, MITSUBA_RMS};

struct Case {
    scale: f64,
    varied: bool,
    between: Interpolation,
    sun: bool,
}

const MEDIUM: Case = Case { scale: 3.0, varied: false, between: Interpolation::Nearest, sun: false };

/// The cube [−1, 1]³ of 24³ voxels, with the numbers of cases.json.
fn medium(case: &Case, albedo: f64) -> VolumeMedium {
    let cube = DAffine3 { matrix3: DMat3::from_diagonal(DVec3::splat(2.0)), translation: DVec3::splat(-1.0) };
    let grid = VoxelGrid::over_cube([24; 3], cube).unwrap();
    let extinction = |p: DVec3| {
        let waves = (6.0 * p.x).sin() * (7.0 * p.y).sin() * (5.0 * p.z).sin();
        (case.scale * (1.0 - 1.6 * p.length_squared() + 0.5 * waves).max(0.0)) as f32
    };
    let color = |p: DVec3| {
        let varied = [3.0 * p.x, 3.0 * p.y + 1.0, 3.0 * p.z + 2.0].map(|phase| 0.5 + 0.4 * phase.sin());
        (if case.varied { varied } else { [0.9, 0.7, 0.4] }).map(|value| (albedo * value) as f32)
    };
    let centres: Vec<DVec3> = (0..grid.len()).map(|index| grid.centre(grid.voxel(index))).collect();
    let sigma = Samples::F32(centres.iter().map(|&p| extinction(p)).collect());
    let colors: Vec<[f32; 3]> = centres.iter().map(|&p| color(p)).collect();
    VolumeMedium {
        extinction: Arc::new(Volume::new(grid, 1, sigma).unwrap()),
        albedo: Arc::new(Volume::of_colors(grid, &colors).unwrap()),
        emission: Arc::new(Volume::constant(grid, [0.0; 3]).unwrap()),
        g: 0.0,
        interpolation: case.between,
        refraction: None,
    }
}

/// Light is cached three times as finely as the medium, for it falls by a factor inside a voxel.
fn scene(case: &Case) -> VolumeScene {
    let eye = look_at(DVec3::new(2.6, 1.2, 3.4), DVec3::ZERO, DVec3::Y).unwrap();
    let camera = Camera::new(eye, 40.0, FovAxis::X, [48; 2]).unwrap();
    let radiance = if case.sun { [0.0; 3] } else { [1.0, 0.8, 0.6] };
    let sky = Environment::constant(radiance, 64).unwrap();
    let mut scene = scene::scene(medium(case, 1.0), sky, vec![camera]);
    if case.sun {
        let sun = DirectionalLight::new(DVec3::new(0.3, -1.0, -0.4), [2.0, 2.0, 1.5]).unwrap();
        scene.lights.push(sun);
    }
    scene.light_size = Some([72; 3]);
    scene
}

/// Root mean square and largest difference, in standard errors; the tracer's and a part of the value for ours.
fn deviation(ours: &Image, name: &str, bias: f64) -> [f64; 2] {
    let folder = crate::root().join("tests/fixtures/mitsuba");
    let mean = read_image(&folder.join(format!("{name}.exr"))).unwrap();
    let error = read_image(&folder.join(format!("{name}_se.exr"))).unwrap();
    let (mut sum, mut count, mut largest) = (0.0, 0.0, 0.0_f64);
    let all =
        |image: &Image| image.pixels.iter().flatten().map(|&value| f64::from(value)).collect::<Vec<f64>>();
    for ((ours, mean), error) in all(ours).into_iter().zip(all(&mean)).zip(all(&error)) {
        if error == 0.0 {
            if (ours - mean).abs() > MITSUBA_EMPTY {
                return [f64::INFINITY; 2];
            }
            continue;
        }
        let z = (ours - mean) / error.hypot(bias * mean);
        (sum, count, largest) = (sum + z * z, count + 1.0, largest.max(z.abs()));
    }
    assert!(count > 1500.0);
    [(sum / count).sqrt(), largest]
}

fn is_close([rms, largest]: [f64; 2]) -> bool {
    rms <= MITSUBA_RMS && largest <= MITSUBA_LARGEST
}

/// The picture of a case agrees, and neither albedo that is off by 3 % nor the picture of another case does.
fn agrees(name: &str, case: &Case, bias: f64, others: &[&str]) {
    let scene = scene(case);
    let optics = optics(&scene, &VolumeState::of(&scene).unwrap());
    let picture = |medium: &VolumeMedium| {
        VolumeRenderer::new(&scene, medium, &optics, Model::SingleScattering)
            .picture(0, &Canvas::Processor)
            .unwrap()
    };
    let ours = picture(&scene.medium);
    let found = deviation(&ours, name, bias);
    assert!(is_close(found), "{name}: {found:?} standard errors");
    for albedo in [0.97, 1.03] {
        let off = deviation(&picture(&medium(case, albedo)), name, bias);
        assert!(!is_close(off), "{name} with {albedo} of the albedo: {off:?}");
    }
    for other in others {
        let off = deviation(&ours, other, bias);
        assert!(!is_close(off), "{name} passes for {other}: {off:?}");
    }
}

#[test]
fn a_medium_under_an_even_sky() {
    agrees("medium_env", &MEDIUM, MITSUBA_BIAS, &["trilinear_env", "varied_env"]);
}

#[test]
fn a_thick_one() {
    agrees("thick_env", &Case { scale: 12.0, ..MEDIUM }, MITSUBA_BIAS_THICK, &["medium_env"]);
}

#[test]
fn one_of_many_colours() {
    agrees("varied_env", &Case { varied: true, ..MEDIUM }, MITSUBA_BIAS, &["medium_env"]);
}

#[test]
fn a_smooth_one() {
    let case = Case { between: Interpolation::Trilinear, ..MEDIUM };
    agrees("trilinear_env", &case, MITSUBA_BIAS, &["medium_env"]);
}

#[test]
fn one_in_the_sun() {
    agrees("sun", &Case { sun: true, ..MEDIUM }, MITSUBA_BIAS, &["medium_env"]);
}
