//! Edits of what casts shadows: pictures and solves see them, surfaces do not.

use std::path::Path;
use std::sync::Arc;

use unscatter::Error;
use unscatter::operator::{CpuVector, FromHost, LinearOperator, TransportOperator, adjoint_test};
use unscatter::problem::{
    Canvas, DrawnLight, LightMapProblem, Maps, Problem, Renderer, Traced, TransferProblem, constraints, fit,
    render,
};
use unscatter::scene::{OccluderEditKind, Rgb, Scene, Strategy};
use unscatter::visibility::Geometry;

/// Two halves of a roof with a slit of a fifth of a metre between them, a board beside them, and a black floor but for a white strip.
const SCENE: &str = r##"{
    "version": 1,
    "light": {"direction": [0, -1, 0], "radiance": 3},
    "medium": {"sigma_t": 0.05},
    "ambient": 0,
    "occluders": [
        {"box": {"center": [-1.6, 4, 0], "size": [3, 0.1, 4]}},
        {"box": {"center": [1.6, 4, 0], "size": [3, 0.1, 4]}},
        {"plane": {"center": [0, 0, 0], "sides": [[0, 0, 20], [20, 0, 0]], "albedo": 0.5}}
    ],
    "views": [{
        "name": "front",
        "camera": {"to_world": {"look_at": {"origin": [0.05, 1.5, 7], "target": [0, 1.8, 0]}}, "fov": 40, "size": [48, 48]},
        "strokes": [{"points": [[24, 8], [24, 40]], "radius": 9, "color": "#ff4020"}]
    }],
    "light_map": {"size": 64, "extent": {"min": [-3, -3], "max": [3, 3]}, "gobo": false},
    "shadow_map": {"size": 300, "extent": {"min": [-3, -3], "max": [3, 3]}},
    "looks": LOOKS
}"##;

fn loaded(looks: &str) -> unscatter::Result<Scene> {
    loaded_with(tempfile::tempdir().unwrap().path(), looks, &[])
}

/// From a folder, with values replaced.
pub(crate) fn loaded_with(folder: &Path, looks: &str, overrides: &[&str]) -> unscatter::Result<Scene> {
    let path = folder.join("scene.json");
    std::fs::write(&path, SCENE.replace("LOOKS", looks)).unwrap();
    let overrides: Vec<String> = overrides.iter().map(|&set| set.to_owned()).collect();
    unscatter::io::scene_file::load(&path, &overrides)
}

pub(crate) fn scene(looks: &str) -> Scene {
    loaded(looks).unwrap()
}

/// A transfer function is looked for behind its stroke.
pub(crate) fn transfer_problem(looks: &str) -> TransferProblem {
    let scene = scene(looks);
    let geometry = Arc::new(Geometry::new(scene.mesh.clone()).unwrap());
    TransferProblem::of(&scene, &geometry, constraints(&scene).unwrap(), &Traced).unwrap()
}

fn maps(scene: &Scene) -> Maps {
    fit(scene, &scene.light_map, &Arc::new(Geometry::new(scene.mesh.clone()).unwrap())).unwrap()
}

/// How much light there is in the air below the roof, and at one place of it: shares of the places asked.
fn lit(scene: &Scene, x: [f64; 2], height: f64) -> f64 {
    let maps = maps(scene);
    let count = 2000;
    let is_lit = |k: usize| {
        let at = |side: usize, k: usize| (k as f64 * [0.618_033_988_7, 0.754_877_666_2][side]).fract();
        let place = glam::DVec3::new(x[0] + (x[1] - x[0]) * at(0, k), height, 3.8 * at(1, k) - 1.9);
        maps.shadow_map.is_lit(maps.frame.light_from_world(place))
    };
    (0..count).filter(|&k| is_lit(k)).count() as f64 / f64::from(count as u32)
}

const SLIT: [f64; 2] = [-0.09, 0.09];

#[test]
fn holes_are_filled_in_the_air_and_surfaces_stay_lit() {
    let plain = scene("{}");
    assert_eq!((lit(&plain, SLIT, 2.0), lit(&plain, [0.2, 3.0], 2.0)), (1.0, 0.0));
    // The slit is ten texels wide.
    for (fill, is_filled) in [
        (r#"{"texels": 3}"#, false),
        (r#"{"texels": 7}"#, true),
        (r#"{"length": 0.14, "kernel": "square"}"#, true),
        (r#"{"length": 0.06, "kernel": "square"}"#, false),
        (r#"{"texels": 7, "strength": 0}"#, false),
    ] {
        let filled = scene(&format!(r#"{{"occluders": [{{"fill": {fill}}}]}}"#));
        assert_eq!(lit(&filled, SLIT, 2.0), f64::from(u8::from(!is_filled)), "{fill}");
        // What has no hole around it is as it was.
        assert_eq!(lit(&filled, [0.2, 3.0], 2.0), 0.0);
        assert_eq!(lit(&filled, [-2.9, 2.9], 4.5), 1.0);
        let [was, is] = [&plain, &filled].map(|scene| render(scene, &maps(scene), None, 0).unwrap().before);
        // In the middle of the picture there is air before a dark floor, at its lower end the strip that the slit lights.
        let strip = (38..47).max_by(|&a, &b| was.at(24, a)[0].total_cmp(&was.at(24, b)[0])).unwrap();
        assert!(was.at(24, strip)[0] > 0.3, "{:?}", was.at(24, strip));
        assert!(is.at(24, strip)[0] > 0.8 * was.at(24, strip)[0], "{fill}: surfaces keep their light");
        // The view looks through lit air before the roof, too.
        let [was, is] = [was, is].map(|picture| picture.at(24, 12)[0]);
        assert_eq!(is < 0.98 * was, is_filled, "{fill}: {was} and {is}");
    }
    // Half of the way: the shaft ends between the roof and the floor.
    let half = scene(r#"{"occluders": [{"fill": {"texels": 7, "strength": 0.5}}]}"#);
    assert_eq!((lit(&half, SLIT, 3.0), lit(&half, SLIT, 1.0)), (1.0, 0.0));
}

#[test]
fn what_is_extruded_is_hidden_behind_what_the_view_sees() {
    let extruded = scene(r#"{"occluders": [{"extrude": {"view": "front", "length": 2}}]}"#);
    let (plain, maps) = (maps(&scene("{}")), maps(&extruded));
    let camera = &extruded.views[0].camera;
    let (mut darker, mut seen) = (0, 0);
    for pixel in 0..48 * 48 {
        let ray = camera.pixel_ray(pixel % 48, pixel / 48);
        let end = plain.geometry.first_hit(&ray, f64::INFINITY).map_or(12.0, |hit| hit.distance);
        for step in 0..100 {
            let place = ray.origin + ray.direction * (end * f64::from(step) / 100.0);
            let place = maps.frame.light_from_world(place);
            let [was, is] = [&plain, &maps].map(|maps| maps.shadow_map.is_lit(place));
            assert!(was || !is, "nothing is lit that was not");
            seen += usize::from(was);
            darker += usize::from(was && !is);
        }
    }
    // The roof's rim is seen from below: behind it the extension takes shafts away, and no more than a part.
    assert!(darker > seen / 100 && darker < seen / 2, "{darker} of {seen}");
    // As far as the eye sees the roof, its own depth stays.
    let edit = &extruded.looks.occluders[0].kind;
    assert!(matches!(edit, OccluderEditKind::Extrude { eye, .. } if eye.distance(camera.position()) < 1e-12));
}

#[test]
fn holes_are_in_what_is_named_and_have_their_share() {
    for (whose, left, right) in
        [("", 0.3, 0.3), (r#", "occluders": [0]"#, 0.3, 0.0), (r#", "occluders": [1]"#, 0.0, 0.3)]
    {
        let pierced =
            scene(&format!(r#"{{"occluders": [{{"pierce": {{"size": 0.2, "share": 0.3{whose}}}}}]}}"#));
        let close = |found: f64, share: f64| (found - share).abs() < if share > 0.0 { 0.05 } else { 1e-12 };
        assert!(close(lit(&pierced, [-3.0, -0.2], 2.0), left), "{whose}");
        assert!(close(lit(&pierced, [0.2, 3.0], 2.0), right), "{whose}");
        assert_eq!(lit(&pierced, SLIT, 2.0), 1.0);
    }
    let at = |turn: f64| {
        let looks =
            format!(r#"{{"occluders": [{{"pierce": {{"size": 0.2, "sway": {{"turn": {turn}}}}}}}]}}"#);
        maps(&scene(&looks)).shadow_map
    };
    let depths = |map: &unscatter::visibility::ShadowMap| -> Vec<f32> {
        (0..300 * 300).map(|texel| map.depth(texel % 300, texel / 300)).collect()
    };
    let [now, again, later] = [at(0.0), at(360.0), at(30.0)].map(|map| depths(&map));
    assert_ne!(now, later);
    let differ = now.iter().zip(&again).filter(|(a, b)| a != b).count();
    assert!(differ < 30, "after a whole turn all is as before, to rounding: {differ}");
}

#[test]
fn edits_follow_each_other() {
    let twice = r#"{"occluders": [{"pierce": {"size": 0.1, "share": 0.4}}, {"fill": {"length": 0.3, "kernel": "square"}}]}"#;
    assert!(lit(&scene(twice), [-3.0, 3.0], 2.0) < 0.02, "what was pierced is filled");
    let other = r#"{"occluders": [{"fill": {"length": 0.3, "kernel": "square"}}, {"pierce": {"size": 0.1, "share": 0.4}}]}"#;
    let found = lit(&scene(other), [-3.0, 3.0], 2.0);
    assert!((found - 0.4).abs() < 0.1, "what was filled is pierced but where nothing is: {found}");
}

#[test]
fn rows_are_those_of_the_edited_scene() {
    let looks = r#"{"occluders": [{"pierce": {"size": 0.3}}, {"fill": {"texels": 2, "kernel": "lines", "view": "front"}}]}"#;
    let problem = LightMapProblem::new(&scene(looks)).unwrap();
    let operator = problem.on_cpu(Strategy::Assembled, u64::MAX).unwrap();
    assert!(adjoint_test(&operator, 3, 5).unwrap().error < 1e-6);
    let explicit = problem.explicit(u64::MAX).unwrap();
    let x: Vec<Rgb> = (0..problem.elements()).map(|i| [i as f32 % 7.0, 1.0, 0.5]).collect();
    let wide = CpuVector(x.iter().map(|value| value.map(f64::from)).collect());
    let (shown, mut expected) = (operator.shown(&x).unwrap(), explicit.range());
    explicit.apply(&wide, &mut expected).unwrap();
    let most = expected.0.iter().flatten().copied().fold(0.0, f64::max);
    for (shown, expected) in shown.iter().flatten().zip(expected.0.iter().flatten()) {
        assert!((f64::from(*shown) - expected).abs() < 1e-5 * most);
    }
    let plain = LightMapProblem::new(&scene("{}")).unwrap();
    assert_ne!(operator.storage(), plain.on_cpu(Strategy::Assembled, u64::MAX).unwrap().storage());
    let found = unscatter::job::Job::new(scene(looks)).solve(&mut unscatter::job::Quiet).unwrap();
    let last = found.report().history.last().unwrap();
    assert!(last.normal_residual.iter().all(|&residual| residual <= 1e-3), "{last:?}");
}

#[test]
fn transfer_functions_multiply_rows_and_pictures() {
    let looks = r##"{"transfer": {"far": 12, "layers": [
        {"gradient": {"along": "depth", "from": "#ffffff", "to": [0.2, 0.5, 1]}},
        {"diffusion": {"blend": "multiply", "points": [
            {"color": [2, 1, 0.5], "at": [0.9, 0.5]}, {"color": "#4060ff", "view": "front", "pixel": [24, 12]},
            {"color": "#808080", "view": "front", "triangle": 0, "corners": [0.5, 0.25, 0.25]}
        ]}}
    ]}}"##;
    let [colored, plain] = [looks, "{}"].map(|looks| LightMapProblem::new(&scene(looks)).unwrap());
    let function = colored.maps.transfer.clone().unwrap();
    assert!(!colored.is_grey() && plain.is_grey());
    let [with, without] =
        [&colored, &plain].map(|problem| problem.on_cpu(Strategy::Assembled, u64::MAX).unwrap());
    assert!(adjoint_test(&with, 3, 5).unwrap().error < 1e-6);
    let x: Vec<Rgb> = (0..plain.elements()).map(|i| [i as f32 % 7.0, 1.0, 0.5]).collect();
    let [with, without] = [with, without].map(|operator| operator.shown(&x).unwrap());
    let mut colors = std::collections::BTreeSet::new();
    for (row, pixel) in plain.constraints.iter().enumerate() {
        let color = function.of_ray(&plain.traversal.rays()[row], &plain.maps.shadow_map).factor;
        colors.insert(color.map(|value| (value * 100.0) as i64));
        for c in 0..3 {
            let close = |found: f32, expected: f32| {
                (found - color[c] as f32 * expected).abs() <= 2e-6 * (1.0 + expected)
            };
            assert!(close(with[row][c], without[row][c]), "{pixel:?}");
            assert!(close(colored.plain[row][c], plain.plain[row][c]), "{pixel:?}");
        }
    }
    assert!(colors.len() > 30, "rays have many colours: {}", colors.len());
    let picture = |looks: &str| {
        let scene = scene(looks);
        let maps = maps(&scene);
        let renderer = Renderer::new(&scene, &maps, None).unwrap().showing(DrawnLight::Scattered);
        renderer.picture(0, &Canvas::Processor).unwrap().before
    };
    let [with, without] = [looks, "{}"].map(picture);
    for (row, pixel) in plain.constraints.iter().enumerate() {
        let color = function.of_ray(&plain.traversal.rays()[row], &plain.maps.shadow_map).factor;
        let [with, without] = [&with, &without].map(|picture| picture.at(pixel.x, pixel.y));
        for c in 0..3 {
            assert!((with[c] - color[c] as f32 * without[c]).abs() <= 2e-6 * (1.0 + without[c]));
        }
    }
    // As far as it is asked for.
    let half = looks.replace(r#""far": 12"#, r#""far": 12, "strength": 0.5"#);
    let half = LightMapProblem::new(&scene(&half)).unwrap().plain;
    for ((half, colored), plain) in half.iter().zip(&colored.plain).zip(&plain.plain) {
        assert!((0..3).all(|c| (half[c] - 0.5 * (colored[c] + plain[c])).abs() <= 2e-6 * (1.0 + plain[c])));
    }
}

#[test]
fn transfer_functions_as_colors_take_the_place_of_scattered_light() {
    let looks = |strength: f64| {
        format!(
            r##"{{"transfer": {{"as": "color", "axes": ["visibility", "angle"], "strength": {strength}, "layers": [
            {{"gradient": {{"along": "visibility", "from": [0, 0, 0], "to": [4, 1, 0.5]}}}},
            {{"gradient": {{"along": "angle", "from": "#ffffff", "to": "#4060ff", "blend": "multiply"}}}}
        ]}}}}"##
        )
    };
    let of = |looks: &str| LightMapProblem::new(&scene(looks)).unwrap();
    let (plain, half) = (of("{}"), of(&looks(0.5)));
    let function = half.maps.transfer.clone().unwrap();
    let [table] = function.tables() else { panic!("one function") };
    let air = &scene("{}").medium;
    let light = scene("{}").light.radiance;
    let luminance: f64 =
        (0..3).map(|c| [0.2126, 0.7152, 0.0722][c] * air.albedo[c] * f64::from(light[c])).sum();
    assert!((table.white - luminance / (4.0 * std::f64::consts::PI)).abs() < 1e-6 * table.white);
    // A row is the light map's in half, and the colour's in half, whatever the light map.
    assert_eq!(half.is_grey(), plain.is_grey());
    for row in 0..plain.rows() {
        let ray = &plain.traversal.rays()[row];
        let tinted = function.of_ray(ray, &plain.maps.shadow_map);
        assert_eq!(tinted.factor, [0.5; 3]);
        for c in 0..3 {
            let expected = 0.5 * plain.plain[row][c] + tinted.added[c];
            assert!((half.plain[row][c] - expected).abs() <= 2e-6 * (1.0 + expected), "{row}");
            let known = half.known_radiance[row][c] - 0.5 * plain.known_radiance[row][c];
            assert!((known - tinted.added[c]).abs() <= 2e-6 * (1.0 + tinted.added[c]), "{row}");
        }
        let angle = (-ray.direction.z).acos() / std::f64::consts::PI;
        let green = table.at([0.0, angle])[1] / table.at([1.0, angle])[1];
        assert!(green < 0.01, "the first axis is visibility: {green}");
    }
    // What no light map can change says so.
    let error = unscatter::job::Job::new(scene(&looks(1.0))).solve(&mut unscatter::job::Quiet).unwrap_err();
    assert!(error.to_string().contains("looks.transfer"), "{error}");
}

#[test]
fn two_functions_with_shares_are_mixed_as_keys_are() {
    let of = |transfer: Vec<(f64, unscatter::scene::Transfer)>| {
        let mut scene = scene("{}");
        scene.looks.transfer = transfer;
        LightMapProblem::new(&scene).unwrap().plain
    };
    let functions: Vec<unscatter::scene::Transfer> = [
        r##"{"far": 8, "layers": [{"gradient": {"along": "depth", "from": "#ff0000", "to": "#ffffff"}}]}"##,
        r##"{"as": "color", "strength": 0.8, "size": [7, 3], "axes": ["position", "visibility"], "layers": [{"solid": {"color": [0.2, 2, 1]}}]}"##,
    ]
    .iter()
    .map(|transfer| scene(&format!(r#"{{"transfer": {transfer}}}"#)).looks.transfer.remove(0).1)
    .collect();
    let [first, second] = [0, 1].map(|k| of(vec![(1.0, functions[k].clone())]));
    let mixed = of(vec![(0.25, functions[0].clone()), (0.75, functions[1].clone())]);
    for row in 0..mixed.len() {
        for c in 0..3 {
            let expected = 0.25 * first[row][c] + 0.75 * second[row][c];
            assert!((mixed[row][c] - expected).abs() <= 2e-6 * (1.0 + expected), "{row}");
        }
    }
}

#[test]
fn transfer_functions_that_cannot_be_say_what_to_do() {
    for (transfer, told) in [
        (r#""far": 9, "layers": []"#, "looks.transfer.layers: there is no layer"),
        (
            r#""axes": ["depth", "depth"], "layers": [{"solid": {"color": [1, 1, 1]}}]"#,
            "looks.transfer.axes: both are the same",
        ),
        (
            r#""axes": ["depth", "angle"], "layers": [{"gradient": {"along": "visibility", "from": [1, 1, 1], "to": [0, 0, 0]}}]"#,
            "layers[0].gradient.along: it is none of the function's `axes`",
        ),
        (r#""far": 0, "layers": [{"solid": {"color": [1, 1, 1]}}]"#, "looks.transfer.far: 0 is not allowed"),
        (
            r#""far": 9, "size": [4000, 2], "layers": [{"solid": {"color": [1, 1, 1]}}]"#,
            "size[0]: 4000 is not allowed; it must be from 1 to 1024",
        ),
        (
            r#""far": 9, "layers": [{"solid": {"color": [1, 1, 1], "opacity": 2}}]"#,
            "layers[0].solid.opacity: 2",
        ),
        (r#""far": 9, "layers": [{"image": {"file": "none.png"}}]"#, "none.png"),
        (r#""far": 9, "layers": [{"diffusion": {"points": []}}]"#, "points: 0 is not allowed"),
        (
            r#""far": 9, "layers": [{"diffusion": {"points": [{"color": [1, 1, 1]}]}}]"#,
            "points[0]: say where it is",
        ),
        (
            r#""far": 9, "layers": [{"diffusion": {"points": [{"color": [1, 1, 1], "at": [0, 2]}]}}]"#,
            "at[1]: 2 is not allowed",
        ),
        (
            r#""far": 9, "layers": [{"diffusion": {"points": [{"color": [1, 1, 1], "view": "side", "pixel": [1, 1]}]}}]"#,
            "no view is called `side`",
        ),
        (
            r#""far": 9, "layers": [{"diffusion": {"points": [{"color": [1, 1, 1], "view": "front", "triangle": 99, "corners": [1, 0, 0]}]}}]"#,
            "triangle: 99 is not allowed; it must be below",
        ),
    ] {
        let error = loaded(&format!(r#"{{"transfer": {{{transfer}}}}}"#)).unwrap_err().to_string();
        assert!(error.contains(told), "{transfer}: {error}");
    }
}

#[test]
fn edits_that_cannot_be_say_what_to_do() {
    for (edit, told) in [
        (r#"{"fill": {}}"#, "looks.occluders[0].fill: say how far it reaches"),
        (r#"{"fill": {"texels": 3, "length": 1}}"#, "either as `texels` or as a `length`"),
        (
            r#"{"fill": {"texels": -1}}"#,
            "looks.occluders[0].fill.texels: -1 is not allowed; it must be 0 or more",
        ),
        (r#"{"fill": {"texels": 3, "kernel": "lines"}}"#, "give the name of one as `view`"),
        (r#"{"fill": {"texels": 3, "view": "front"}}"#, "only the kernel `lines` has a view"),
        (r#"{"fill": {"texels": 3, "strength": 2}}"#, "looks.occluders[0].fill.strength"),
        (
            r#"{"extrude": {"view": "frint", "texels": 3}}"#,
            "no view is called `frint`; did you mean `front`?",
        ),
        (r#"{"pierce": {"size": 0}}"#, "looks.occluders[0].pierce.size"),
        (
            r#"{"pierce": {"size": 1, "octaves": 40}}"#,
            "pierce.octaves: 40 is not allowed; it must be from 1 to 12",
        ),
        (r#"{"pierce": {"size": 1, "objects": ["leaves"]}}"#, "no object is called `leaves`"),
        (r#"{"pierce": {"size": 1, "materials": ["bark"]}}"#, "no material is called `bark`"),
        (r#"{"pierce": {"size": 1, "occluders": [3]}}"#, "pierce.occluders[0]: 3 is not allowed"),
        (r#"{"pierced": {"size": 1}}"#, "did you mean `pierce`?"),
    ] {
        let error = loaded(&format!(r#"{{"occluders": [{edit}]}}"#)).unwrap_err().to_string();
        assert!(error.contains(told), "{edit}: {error}");
    }
    // The size of the map is known only where it lies.
    let large = scene(r#"{"occluders": [{"pierce": {"size": 1}}, {"fill": {"length": 30}}]}"#);
    let error = fit(&large, &large.light_map, &Arc::new(Geometry::new(large.mesh.clone()).unwrap()));
    let Err(Error::Value { path, .. }) = error else { panic!("a kernel larger than the map") };
    assert_eq!(path, "looks.occluders[1].length");
}
