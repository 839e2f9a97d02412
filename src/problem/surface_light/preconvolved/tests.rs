use super::*;

fn map(radiance: impl Fn(DVec3) -> Rgb) -> Environment {
    let size = [256, 128];
    let pixels =
        (0..size[0] * size[1]).map(|index| radiance(towards(size, index % size[0], index / size[0])));
    Environment::map(Image::new(size, pixels.collect()).unwrap(), 1).unwrap()
}

const AXES: [DVec3; 4] = [DVec3::Y, DVec3::Z, DVec3::new(0.6, 0.0, -0.8), DVec3::new(-0.48, -0.6, 0.64)];

#[test]
fn the_same_light_from_everywhere_is_itself() {
    let constant = PreconvolvedLight::new(&Environment::constant([1.0, 2.0, 3.0], 1).unwrap()).unwrap();
    // All but the same, so that it is convolved.
    let nearly = map(|towards| if towards.y > 0.999 { [1.0, 2.0, 3.000_01] } else { [1.0, 2.0, 3.0] });
    let nearly = PreconvolvedLight::new(&nearly).unwrap();
    assert!(matches!(nearly, PreconvolvedLight::Cones(_)));
    for light in [constant, nearly] {
        for towards in AXES {
            for degrees in [5.0f64, 20.0, 45.0, 77.0, 90.0] {
                let found = light.of_cone(towards, degrees.to_radians());
                assert!((0..3).all(|c| (found[c] - (c + 1) as f32).abs() < 2e-5), "{degrees}: {found:?}");
            }
        }
    }
}

/// A hemisphere of light is (1 + cos θ) / 2 at an angle θ from its axis.
#[test]
fn a_hemisphere_of_light_has_its_closed_form() {
    let sky = PreconvolvedLight::new(&map(|towards| [f32::from(u8::from(towards.y > 0.0)); 3])).unwrap();
    for degrees in [0.0f64, 30.0, 60.0, 90.0, 120.0, 175.0] {
        for turn in [0.0f64, 1.0, 3.1] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let towards = DVec3::new(sin * turn.sin(), cos, -sin * turn.cos());
            let found = f64::from(sky.of_hemisphere(towards)[0]);
            assert!((found - 0.5 * (1.0 + cos)).abs() < 5e-3, "{degrees}: {found}");
            // Narrow cones see all of it or nothing.
            let narrow = f64::from(sky.of_cone(towards, 0.3)[0]);
            assert!(
                degrees == 90.0 || (narrow - f64::from(u8::from(cos > 0.0))).abs() < 1e-6,
                "{degrees}: {narrow}"
            );
        }
    }
}

#[test]
fn cones_are_what_many_directions_find() {
    let radiance = |towards: DVec3| {
        rgb(|c| (1.2 + (2.0 * towards[c]).sin() + 0.2 * (3.0 * towards.x * towards.z).cos()) as f32)
    };
    let light = PreconvolvedLight::new(&map(radiance)).unwrap();
    for axis in AXES {
        let (x, y) = axis.any_orthonormal_pair();
        for degrees in [22.5f64, 45.0, 67.5, 90.0] {
            let count = 20_000;
            let sin2 = degrees.to_radians().sin().powi(2);
            let mut sum = [0.0; 3];
            for k in 0..count {
                // As dense as cosines: the square of the sine is even.
                let sin = (sin2 * (f64::from(k) + 0.5) / f64::from(count)).sqrt();
                let (b, a) = (TAU * (f64::from(k) * 0.618_033_988_75).fract()).sin_cos();
                let towards = (x * a + y * b) * sin + axis * (1.0 - sin * sin).sqrt();
                (0..3).for_each(|c| sum[c] += f64::from(radiance(towards)[c]) / f64::from(count));
            }
            let found = light.of_cone(axis, degrees.to_radians());
            for c in 0..3 {
                assert!((f64::from(found[c]) - sum[c]).abs() < 0.01, "{axis}, {degrees}: {found:?} {sum:?}");
            }
            // Another angle is another light.
            let other = light.of_cone(axis, 0.5 * degrees.to_radians());
            assert!((0..3).any(|c| (f64::from(other[c]) - sum[c]).abs() > 0.01));
        }
    }
}

/// Around the seam, where longitudes begin again.
#[test]
fn light_is_continuous_around_the_seam() {
    let light =
        PreconvolvedLight::new(&map(|towards| [(1.0 + towards.x) as f32, (1.0 + towards.z) as f32, 1.0]))
            .unwrap();
    let [left, right] = [-1e-9, 1e-9].map(|x| light.of_hemisphere(DVec3::new(x, 0.3, 1.0).normalize()));
    assert!((0..3).all(|c| (left[c] - right[c]).abs() < 1e-6));
    assert!((f64::from(left[0]) - 1.0).abs() < 5e-3);
}

/// A sun of one pixel of a large picture gives all of its light, wherever the pixel is.
#[test]
fn a_small_sun_gives_its_light() {
    let size = [2048, 1024];
    for (column, row) in [(700, 400), (701, 401), (1033, 507)] {
        let sun = |index: usize| if index == row * size[0] + column { [1e5; 3] } else { [0.0; 3] };
        let picture = Image::new(size, (0..size[0] * size[1]).map(sun).collect()).unwrap();
        let light = PreconvolvedLight::new(&Environment::map(picture, 1).unwrap()).unwrap();
        let axis = towards(size, column, row);
        let polar = |row: usize| (PI * row as f64 / size[1] as f64).cos();
        let expected = 1e5 * TAU / size[0] as f64 * (polar(row) - polar(row + 1)) / PI;
        let found = f64::from(light.of_hemisphere(axis)[0]);
        assert!((found - expected).abs() < 0.02 * expected, "{column}, {row}: {found}, not {expected}");
    }
}
