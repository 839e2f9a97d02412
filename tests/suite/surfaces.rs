//! Light from everywhere on surfaces: what pictures know of it against rays and closed forms.

use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use unscatter::io::image::write_exr;
use unscatter::problem::{BentCone, LightMapProblem, LitSurfaces, fit, render};
use unscatter::scene::{Image, Looks, Rgb, Scene, SurfaceLight, SurfaceMethod, Weighting};
use unscatter::visibility::Geometry;

use crate::scenes::mist::{CASES, scene_of};
use crate::surroundings::{distance, pictured, shown, some_light};
use crate::tolerances::SURROUNDINGS_PICTURE;

/// Clear air over ground, with what else stands there.
const SCENE: &str = r##"{
    "version": 1,
    "light": {"direction": [0, -1, 0], "radiance": 0},
    "medium": {"sigma_t": 1e-7},
    "ambient": [0.2, 0.3, 0.4],
    "occluders": [
        THINGS
        {"plane": {"center": [0, 0, 0], "sides": [[0, 0, 60], [60, 0, 0]], "albedo": [0.5, 0.4, 0.3]}}
    ],
    "views": [{"name": "front", "camera": CAMERA}],
    "light_map": {"size": 16},
    "shadow_map": {"size": 64},
    "looks": LOOKS
}"##;
const CAMERA: &str =
    r#"{"to_world": {"look_at": {"origin": [5, 4, 6], "target": [0, 0.6, 0]}}, "fov": 60, "size": [96, 72]}"#;
const FISHEYE: &str = r#"{"to_world": {"look_at": {"origin": [5, 4, 6], "target": [0, 0.6, 0]}}, "size": [96, 72],
    "lens": {"focal_length": [55, 55], "fisheye": true}}"#;
/// A wall so large that it hides half of the sky from what is at its foot.
const WALL: &str =
    r#"{"plane": {"center": [0, 0, 0], "sides": [[0, 4000, 0], [0, 0, 4000]], "albedo": 0.5}},"#;
/// A court of walls and blocks.
const COURT: &str = r#"{"box": {"center": [-2, 1.5, 0], "size": [0.4, 3, 8], "albedo": 0.5}},
    {"box": {"center": [0, 1, -3], "size": [6, 2, 0.4], "albedo": 0.5}},
    {"box": {"center": [0.4, 0.5, 0.5], "size": [1, 1, 1], "albedo": 0.5}},
    {"sphere": {"center": [1.5, 0.7, -1], "radius": 0.7, "albedo": 0.5}},"#;
const METHODS: [&str; 5] = ["open", "ambient-occlusion", "bent-normals", "bent-cones", "rays"];

fn loaded(folder: &Path, [things, camera, looks]: [&str; 3]) -> unscatter::Result<Scene> {
    let path = folder.join("scene.json");
    let text = SCENE.replace("THINGS", things).replace("CAMERA", camera).replace("LOOKS", looks);
    std::fs::write(&path, text).unwrap();
    unscatter::io::scene_file::load(&path, &[])
}

fn scene(things: &str, camera: &str, surfaces: &str) -> Scene {
    let looks = format!(r#"{{"surfaces": {surfaces}}}"#);
    loaded(tempfile::tempdir().unwrap().path(), [things, camera, &looks]).unwrap()
}

fn geometry(scene: &Scene) -> Arc<Geometry> {
    Arc::new(Geometry::new(scene.mesh.clone()).unwrap())
}

fn arriving(scene: &Scene) -> Vec<Rgb> {
    let geometry = geometry(scene);
    let surfaces = LitSurfaces::of(scene, &geometry).unwrap().unwrap();
    surfaces.arriving(&scene.views[0].camera, &geometry)
}

fn cones(scene: &Scene) -> Vec<Option<BentCone>> {
    let geometry = geometry(scene);
    let surfaces = LitSurfaces::of(scene, &geometry).unwrap().unwrap();
    surfaces.bent_cones(&scene.views[0].camera, &geometry)
}

fn picture(scene: &Scene) -> Image {
    render(scene, &fit(scene, &scene.light_map, &geometry(scene)).unwrap(), None, 0).unwrap().before
}

/// The largest difference of two pictures, relative to the largest value.
fn apart(a: &[Rgb], b: &[Rgb]) -> f64 {
    let most = b.iter().flatten().fold(0.0, |most: f32, &value| most.max(value));
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.map(|(a, b)| f64::from((a - b).abs() / most)).fold(0.0, f64::max)
}

#[test]
fn constant_light_on_open_ground_is_albedo_times_radiance() {
    for camera in [CAMERA, FISHEYE] {
        let plain = Scene { looks: Looks::default(), ..scene("", camera, "{}") };
        let expected = picture(&plain);
        let ray = plain.views[0].camera.pixel_ray(48, 50);
        assert!(geometry(&plain).first_hit(&ray, f64::INFINITY).is_some());
        let ground = expected.at(48, 50);
        assert!((0..3).all(|c| (ground[c] - [0.1, 0.12, 0.12][c]).abs() < 1e-5), "{ground:?}");
        for method in METHODS {
            for weighting in ["cosine", "uniform"] {
                let surfaces =
                    format!(r#"{{"method": "{method}", "weighting": "{weighting}", "samples": 16}}"#);
                let lit = picture(&scene("", camera, &surfaces));
                let error = apart(&lit.pixels, &expected.pixels);
                assert!(error < 2e-6, "{method}, {weighting}: {error:e}");
                // A court hides some of it.
                let court = picture(&scene(COURT, camera, &surfaces));
                let open = picture(&Scene { looks: Looks::default(), ..scene(COURT, camera, "{}") });
                assert_eq!(apart(&court.pixels, &open.pixels) > 0.2, method != "open", "{method}");
            }
        }
    }
}

/// The pixels of the ground at the foot of the wall, with how far they are from it.
fn foot(scene: &Scene) -> Vec<(usize, f64)> {
    let (camera, geometry) = (&scene.views[0].camera, geometry(scene));
    let at_foot = |index: usize| {
        let ray = camera.pixel_ray(index % 96, index / 96);
        let hit = geometry.first_hit(&ray, f64::INFINITY)?;
        let point = ray.at(hit.distance);
        let is_foot = hit.normal.y > 0.5 && point.x > 0.0 && point.x < 0.15 && point.z.abs() < 1.5;
        is_foot.then_some((index, point.x))
    };
    (0..96 * 72).filter_map(at_foot).collect()
}

#[test]
fn the_foot_of_a_large_wall_sees_half_of_the_sky() {
    let of = |more: &str| {
        scene(WALL, CAMERA, &format!(r#"{{"environment": {{"radiance": [1, 2, 3]}}, "radius": 3, {more}}}"#))
    };
    let rays = of(r#""method": "rays", "samples": 1024"#);
    let feet = foot(&rays);
    assert!(feet.len() > 8, "{}", feet.len());
    let (light, traced) = (arriving(&of(r#""method": "rays""#)), cones(&rays));
    // Without a blur, which would take in what is farther from the wall.
    let seen = cones(&of(r#""samples": 256, "steps": 24, "pattern": 1"#));
    // By cosine: the mean is (4 / 3π, 2/3) along wall and ground.
    let mean = DVec3::new(4.0 / (3.0 * PI), 2.0 / 3.0, 0.0);
    // ⅔ (1 + c + c²) / (1 + c) of the cone's cosine c is its length.
    let length = |c: f64| 2.0 / 3.0 * (1.0 + c + c * c) / (1.0 + c);
    for (index, apart) in feet {
        // A wall that counts up to the radius: the part of the unit disc beyond apart / radius.
        let s = apart / 3.0;
        let expected = 0.5 + (s * (1.0 - s * s).sqrt() + s.asin()) / PI;
        assert!(
            (0..3).all(|c| (f64::from(light[index][c]) / (c + 1) as f64 - expected).abs() < 0.02),
            "{:?}",
            light[index]
        );
        for (cone, tolerance, degrees) in [(&traced[index], 0.02, 3.0), (&seen[index], 0.06, 6.0)] {
            let cone = cone.unwrap();
            assert!((cone.visibility - expected).abs() < tolerance, "{expected}: {cone:?}");
            let angle = cone.direction.dot(mean.normalize()).min(1.0).acos().to_degrees();
            // The normal is 32° away.
            assert!(angle < degrees, "{angle}: {cone:?}");
            assert!((length(cone.angle.cos()) - mean.length()).abs() < tolerance, "{cone:?}");
        }
    }
}

/// Red light from one side, blue from the other, and a little green from above.
fn write_sky(path: &Path) {
    let [width, height] = [64, 32];
    let pixel = |index: usize| {
        let (sin, cos) = (PI * ((index / width) as f64 + 0.5) / height as f64).sin_cos();
        let across = (2.0 * PI * (((index % width) as f64 + 0.5) / width as f64 - 0.5)).sin() * sin;
        [(1.0 + across).powi(3) as f32, 0.3 + cos.max(0.0) as f32, (1.0 - across).powi(3) as f32]
    };
    write_exr(path, &Image::new([width, height], (0..width * height).map(pixel).collect()).unwrap()).unwrap();
}

#[test]
fn bent_normals_are_nearer_to_rays_than_occlusion_alone_and_cones_nearer_still() {
    let folder = tempfile::tempdir().unwrap();
    write_sky(&folder.path().join("sky.exr"));
    let of = |more: &str| {
        let looks =
            format!(r#"{{"surfaces": {{"environment": {{"file": "sky.exr"}}, "radius": 3, {more}}}}}"#);
        arriving(&loaded(folder.path(), [COURT, CAMERA, &looks]).unwrap())
    };
    let rays = of(r#""method": "rays", "samples": 1024"#);
    let error = |method: &str, more: &str| distance(&of(&format!(r#""method": "{method}"{more}"#)), &rays);
    let errors = |more: &str| METHODS[..4].iter().map(|method| error(method, more)).collect::<Vec<_>>();
    // 0.288, 0.109, 0.089, 0.091: of few directions cones are as good as normals.
    let few = errors("");
    assert!(few[1] < 0.5 * few[0] && few[2] < 0.9 * few[1] && few[3] < 0.9 * few[1], "{few:?}");
    // 0.288, 0.111, 0.100, 0.082.
    let many = errors(r#", "samples": 64, "steps": 16"#);
    assert!(many.windows(2).all(|pair| pair[1] < 0.95 * pair[0]), "{many:?}");
    let as_in_paper = error("bent-cones", r#", "weighting": "uniform""#);
    assert!(few[3] < as_in_paper, "{few:?}, {as_in_paper}");
}

#[test]
fn pictures_are_the_same_for_any_number_of_threads() {
    for method in ["bent-cones", "rays"] {
        let scene = scene(COURT, CAMERA, &format!(r#"{{"method": "{method}", "samples": 5}}"#));
        let on = |threads: usize| {
            rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| picture(&scene))
        };
        assert_eq!(on(1), on(3));
    }
}

#[test]
fn glass_before_the_eye_colours_the_light_of_surfaces() {
    let pane = r#"{"plane": {"center": [3.75, 3.15, 4.5], "sides": [[0, 20, 0], [16, 0, -13.3]], "transmittance": [0.9, 0.5, 0.2]}},"#;
    let surfaces = r#"{"method": "bent-cones"}"#;
    let plain = picture(&scene(COURT, CAMERA, surfaces));
    let behind = picture(&scene(&format!("{COURT}{pane}"), CAMERA, surfaces));
    let scene = scene(COURT, CAMERA, surfaces);
    let (geometry, camera) = (geometry(&scene), &scene.views[0].camera);
    let mut seen = 0;
    for index in 0..96 * 72 {
        let ray = camera.pixel_ray(index % 96, index / 96);
        if geometry.first_hit(&ray, f64::INFINITY).is_some_and(|hit| hit.distance > 4.0) {
            let [with, without] = [&behind, &plain].map(|picture| picture.pixels[index]);
            assert!(
                (0..3).all(|c| (with[c] - [0.9, 0.5, 0.2][c] * without[c]).abs() < 1e-5),
                "{index}: {with:?} {without:?}"
            );
            seen += 1;
        }
    }
    assert!(seen > 2000, "{seen}");
}

/// A pane above all of the ground, which the eye does not look through.
#[test]
fn rays_bring_what_panes_let_through() {
    let pane = r#"{"plane": {"center": [0, 9, 0], "sides": [[0, 0, 40000], [40000, 0, 0]], "transmittance": [0.9, 0.5, 0.2]}},"#;
    let [open, below] =
        ["", pane].map(|things| arriving(&scene(things, CAMERA, r#"{"method": "rays", "samples": 64}"#)));
    let mut lit = 0;
    for (open, below) in open.iter().zip(&below).filter(|(open, _)| **open != [0.0; 3]) {
        // The hit is of the ground in both: a pane is no surface.
        assert!((0..3).all(|c| (below[c] - [0.9, 0.5, 0.2][c] * open[c]).abs() < 2e-3), "{open:?} {below:?}");
        lit += 1;
    }
    assert!(lit > 2000, "{lit}");
}

#[test]
fn rows_show_what_pictures_show_of_surfaces() {
    for case in CASES {
        let light = SurfaceLight {
            environment: Some(unscatter::scene::Environment::constant([0.3, 0.2, 0.6], 1).unwrap()),
            method: SurfaceMethod::BentCones,
            weighting: Weighting::Cosine,
            samples: 6,
            steps: 3,
            radius: None,
            pattern: 4,
        };
        let looks = Looks { surfaces: vec![(0.75, light)], ..Looks::default() };
        let plain = scene_of(&case);
        let scene = Scene { looks, ..scene_of(&case) };
        let problem = LightMapProblem::new(&scene).unwrap();
        let light = some_light(&problem, 71);
        let [before, after] = pictured(&scene, &problem, &light);
        for (of, light) in [(&before, &problem.starts()), (&after, &light)] {
            let error = distance(&shown(&problem, light), of);
            assert!(error <= SURROUNDINGS_PICTURE, "{case:?}: {error:e}");
            let without = LightMapProblem::new(&plain).unwrap();
            assert!(distance(&shown(&without, light), of) > 100.0 * SURROUNDINGS_PICTURE);
        }
        assert!(distance(&problem.plain, &before) <= SURROUNDINGS_PICTURE);
    }
}

#[test]
fn surfaces_between_two_keys_are_part_of_each() {
    let lit = scene(COURT, CAMERA, r#"{"environment": {"radiance": [0.5, 0.1, 0.2]}}"#);
    let plain = Scene { looks: Looks::default(), ..lit.clone() };
    let between = Scene { looks: lit.looks.between(&plain.looks, 0.25), ..lit.clone() };
    let [lit, plain, between] = [&lit, &plain, &between].map(picture);
    let mixed = lit.pixels.iter().zip(&plain.pixels);
    let mixed: Vec<Rgb> = mixed.map(|(a, b)| std::array::from_fn(|c| 0.75 * a[c] + 0.25 * b[c])).collect();
    assert!(apart(&between.pixels, &mixed) < 2e-6);
    assert!(apart(&between.pixels, &lit.pixels) > 0.05);
}

#[test]
fn surfaces_that_cannot_be_say_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    for (surfaces, told) in [
        (r#""samples": 0"#, "looks.surfaces.samples: 0 is not allowed; it must be from 1 to 4096"),
        (r#""steps": 0"#, "looks.surfaces.steps: 0 is not allowed; it must be from 1 to 64"),
        (r#""pattern": 17"#, "looks.surfaces.pattern: 17 is not allowed; it must be from 1 to 16"),
        (r#""radius": -1"#, "looks.surfaces.radius: -1 is not allowed; it must be above 0"),
        (r#""method": "bent""#, "`bent`"),
        (r#""environment": {}"#, "looks.surfaces.environment: say what light it is"),
        (r#""environment": {"radiance": -1}"#, "looks.surfaces.environment.radiance"),
        (r#""environment": {"file": "none.exr"}"#, "none.exr"),
    ] {
        let looks = format!(r#"{{"surfaces": {{{surfaces}}}}}"#);
        let error = loaded(folder.path(), ["", CAMERA, &looks]).unwrap_err().to_string();
        assert!(error.contains(told), "{surfaces}: {error}");
    }
}
