//! Transfer functions behind paint, and moods that carry them from scene to scene.

use std::path::Path;
use std::sync::Arc;

use unscatter::io::image::write_exr;
use unscatter::job::{Job, Options, Quiet, Solution};
use unscatter::operator::{CpuVector, FromHost, LinearOperator, adjoint_test};
use unscatter::problem::{Canvas, DrawnLight, Problem, Renderer, fit};
use unscatter::scene::{Image, Look, Rgb, RgbaImage, Scene, Strategy};
use unscatter::visibility::Geometry;

use crate::looks::{loaded_with, scene, transfer_problem};

/// A function with colours of its own everywhere.
const KNOWN: &str = r##"{"far": 12, "size": [24, 16], "layers": [
    {"diffusion": {"points": [
        {"color": [1.4, 0.2, 0.1], "at": [0.05, 0.5]}, {"color": [0.1, 0.3, 1.8], "at": [0.9, 0.3]},
        {"color": [0.5, 1.1, 0.4], "at": [0.4, 0.9]}
    ]}}
]}"##;
const FIND: &str = "find=transfer";
/// The white function of the same size.
const WHITE: &str = r#"{"far": 12, "size": [24, 16], "layers": [{"solid": {"color": [1, 1, 1]}}]}"#;

fn scattered(scene: &Scene) -> Image {
    let geometry = Arc::new(Geometry::new(scene.mesh.clone()).unwrap());
    let maps = fit(scene, &scene.light_map, &geometry).unwrap();
    let renderer = Renderer::new(scene, &maps, None).unwrap().showing(DrawnLight::Scattered);
    renderer.picture(0, &Canvas::Processor).unwrap().before
}

fn solved(scene: Scene) -> Solution {
    Job::new(scene).solve(&mut Quiet).unwrap()
}

fn transfer(function: &str) -> String {
    format!(r#"{{"transfer": {function}}}"#)
}

/// With the known function as a factor or as a colour.
fn known(role: &str) -> String {
    KNOWN.replacen('{', &format!(r#"{{"as": "{role}", "#), 1)
}

#[test]
fn rows_show_what_a_picture_under_the_function_shows() {
    let blue = r#"{"as": "color", "strength": 0.7, "layers": [{"solid": {"color": [0.1, 0.3, 1]}}]}"#;
    for (looks, strength) in [("{}".to_owned(), 1.0), (transfer(blue), 0.7)] {
        let problem = transfer_problem(&looks);
        let table = &problem.table;
        assert_eq!(table.strength, strength);
        let operator = problem.on_cpu(Strategy::Assembled, u64::MAX).unwrap();
        assert!(adjoint_test(&operator, 3, 5).unwrap().error < 1e-6);
        let x: Vec<Rgb> = (0..table.texels.len())
            .map(|texel| [(texel % 13) as f32 / 6.0, 0.5, (texel % 5) as f32])
            .collect();
        let shown = operator.shown(&x).unwrap();
        // The explicit matrix, and a picture.
        let explicit = problem.explicit(u64::MAX).unwrap();
        let mut rows = explicit.range();
        explicit.apply(&CpuVector(x.iter().map(|value| value.map(f64::from)).collect()), &mut rows).unwrap();
        let scene = scene(&looks);
        let maps = problem.pixels.maps.tinted(problem.function(x));
        let renderer = Renderer::new(&scene, &maps, None).unwrap().showing(DrawnLight::Scattered);
        let picture = renderer.picture(0, &Canvas::Processor).unwrap().before;
        let most = shown.iter().flatten().copied().fold(0.0, f32::max);
        for (row, pixel) in problem.pixels.constraints.iter().enumerate() {
            let seen = picture.at(pixel.x, pixel.y);
            for c in 0..3 {
                assert!((f64::from(shown[row][c]) - rows.0[row][c]).abs() < 1e-6 * f64::from(most));
                let all = shown[row][c] + problem.pixels.known_radiance[row][c];
                assert!((all - seen[c]).abs() < 2e-6 * (most + seen[c]), "{row}: {all}, not {}", seen[c]);
            }
        }
        assert!(most > 0.01, "{most}");
    }
}

#[test]
fn a_function_comes_back_from_the_picture_that_it_made() {
    for role in ["factor", "color"] {
        let folder = tempfile::tempdir().unwrap();
        let shown = scattered(&scene(&transfer(&known(role))));
        let sets = [
            FIND,
            "target=radiance",
            "solve.tikhonov=0",
            "solve.gradient=1e-6",
            "solve.tolerance=1e-7",
            "solve.iterations=2000",
        ];
        let white = transfer(&WHITE.replacen('{', &format!(r#"{{"as": "{role}", "#), 1));
        let mut painted = loaded_with(folder.path(), &white, &sets).unwrap();
        let pixels = shown.pixels.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect();
        painted.views[0].strokes.clear();
        painted.views[0].layers = vec![RgbaImage::new(shown.size(), pixels).unwrap()];
        let found = solved(painted);
        let written = tempfile::tempdir().unwrap();
        found.write(written.path()).unwrap();
        // Its mood, put into the scene, shows the picture again.
        let mood = format!(r#"{{"file": "{}/mood.json"}}"#, written.path().display());
        let again = scattered(&loaded_with(folder.path(), &mood, &[]).unwrap());
        let most = shown.pixels.iter().flatten().copied().fold(0.0, f32::max);
        let worst = again.pixels.iter().flatten().zip(shown.pixels.iter().flatten());
        let worst = worst.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst <= 1e-3 * most, "{role}: {}", worst / most);
        let match_ = found.report().weighted_residual;
        assert!(match_.after < 1e-3 && match_.before > 0.2, "{role}: {match_:?}");
    }
}

#[test]
fn paint_asks_for_a_function_and_what_is_kept_stays() {
    let found = solved(loaded_with(tempfile::tempdir().unwrap().path(), "{}", &[FIND]).unwrap());
    let report = found.report();
    assert_eq!(report.nouns.found, "transfer function");
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    let change = report.weighted_residual;
    assert!(change.after < 0.3 * change.before, "{change:?}");
    let table = found.transfer().unwrap();
    assert_eq!(table.size(), [128, 128]);
    assert!(table.pixels.iter().flatten().all(|&value| value >= 0.0));
    // Red was painted: no texel gives more of the others than there was.
    assert!(table.pixels.iter().all(|[r, g, b]| *r >= *g - 0.05 && *r >= *b - 0.05));
    assert!(found.light_map().unwrap_err().to_string().contains("find=light-map"));
    let picture = found.picture("front").unwrap();
    let written = tempfile::tempdir().unwrap();
    found.write(written.path()).unwrap();
    for file in ["transfer.exr", "transfer.png", "mood.json", "front_after.exr", "report.html", "report.json"]
    {
        assert!(written.path().join(file).exists(), "{file}");
    }
    let page = std::fs::read_to_string(written.path().join("report.html")).unwrap();
    assert!(
        page.contains("The transfer function") && page.contains("visibility to the right, depth downwards")
    );
    // The mood carries it, and so does the picture of the table where the far end is the same.
    for looks in [
        format!(r#"{{"file": "{}/mood.json"}}"#, written.path().display()),
        format!(r#"{{"file": "{}/transfer.exr"}}"#, written.path().display()),
    ] {
        let scene = loaded_with(written.path(), &looks, &[]).unwrap();
        let geometry = Arc::new(Geometry::new(scene.mesh.clone()).unwrap());
        let maps = fit(&scene, &scene.light_map, &geometry).unwrap();
        let again = Renderer::new(&scene, &maps, None).unwrap().picture(0, &Canvas::Processor).unwrap();
        assert!(again.before == picture, "{looks}");
    }
}

#[test]
fn paint_that_no_function_meets_is_told_of() {
    let across = r#"views[0].strokes=[{"points": [[24, 8], [24, 40]], "radius": 9, "color": [1, 0.2, 0.2]},
        {"points": [[24, 8], [24, 40]], "radius": 3, "color": [0.1, 0.4, 1]}]"#;
    let scene = loaded_with(tempfile::tempdir().unwrap().path(), "{}", &[FIND, across]).unwrap();
    let found = solved(scene);
    let told = &found.report().warnings;
    assert!(told.iter().any(|told| told.code == "contradicted-paint"), "{told:?}");
}

#[test]
fn what_no_function_can_be_found_for_says_so() {
    let refused = |looks: &str, sets: &[&str]| {
        let scene = loaded_with(tempfile::tempdir().unwrap().path(), looks, sets);
        let found = scene.and_then(|scene| Job::new(scene).solve(&mut Quiet));
        found.unwrap_err().to_string()
    };
    let around = refused("{}", &[FIND, r#"surroundings={"sun": true}"#]);
    assert!(around.contains("take `surroundings` away"), "{around}");
    let moving = [FIND, r#"animation={"frames": 4, "keys": [{"frame": 0}, {"frame": 3}]}"#];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    loaded_with(folder.path(), "{}", &[]).unwrap();
    let moving = Job::open_with(&path, &moving.map(str::to_owned)).unwrap_err().to_string();
    assert!(moving.contains("find: transfer functions are looked for in scenes that stay"), "{moving}");
    let weak = transfer(&WHITE.replacen('{', r#"{"strength": 0, "#, 1));
    assert!(refused(&weak, &[FIND]).contains("raise looks.transfer.strength"));
    let unknown = refused("{}", &["find=gobo"]);
    assert!(unknown.contains("light-map, transfer"), "{unknown}");
    let live = loaded_with(tempfile::tempdir().unwrap().path(), "{}", &[FIND]).unwrap();
    let live = Job::new(live).live(unscatter::job::Preview::Width(24)).map(|_| ()).unwrap_err();
    assert!(live.to_string().contains("find=light-map"), "{live}");
}

/// Two scenes with looks from files give the same plain radiance.
fn same(folder: &Path, looks: &str, own: &str) {
    let of = |looks: &str| scattered(&loaded_with(folder, looks, &[]).unwrap());
    assert!(of(looks) == of(own), "{looks}");
}

#[test]
fn moods_are_files_that_any_scene_can_name() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir(at("moods")).unwrap();
    let fill = r#"{"fill": {"texels": 12}}"#;
    let mood = format!(r#"{{"occluders": [{fill}], "transfer": {KNOWN}}}"#);
    std::fs::write(at("moods/dusk.json"), &mood).unwrap();
    same(folder.path(), r#"{"file": "moods/dusk.json"}"#, &mood);
    // What stands beside it takes its place.
    let both = format!(r#"{{"occluders": [{fill}], "transfer": {WHITE}}}"#);
    same(folder.path(), &format!(r#"{{"file": "moods/dusk.json", "transfer": {WHITE}}}"#), &both);
    let edits = r#"[{"extrude": {"view": "front", "texels": 9}}]"#;
    let both = format!(r#"{{"occluders": {edits}, "transfer": {KNOWN}}}"#);
    same(folder.path(), &format!(r#"{{"file": "moods/dusk.json", "occluders": {edits}}}"#), &both);
    // Of another scene the looks alone count; pictures lie beside the file that names them.
    let colors = (0..6).map(|k| [k as f32, 0.5, 1.0]).collect();
    write_exr(&at("moods/table.exr"), &Image::new([3, 2], colors).unwrap()).unwrap();
    let named = r#"{"far": 7, "size": [3, 2], "layers": [{"image": {"file": "table.exr"}}]}"#;
    std::fs::write(at("moods/scene.json"), format!(r#"{{"looks": {{"transfer": {named}}}, "views": 7}}"#))
        .unwrap();
    let own = transfer(&named.replace("table.exr", "moods/table.exr"));
    same(folder.path(), r#"{"file": "moods/scene.json"}"#, &own);
    same(folder.path(), r#"{"file": "moods/table.exr"}"#, &own.replace(r#""far": 7, "#, ""));
    for (name, text, told) in [
        ("a.json", r#"{"transfer": {"layers": []}}"#, ["transfer.layers", "there is no layer"]),
        ("b.json", r#"{"ocluders": []}"#, ["b.json", "occluders"]),
        ("c.json", r#"{"file": "a.json"}"#, ["looks.file", "names no other"]),
        ("d.json", r#"{"occluders": ["#, ["d.json", "EOF"]),
        (
            "e.json",
            r#"{"looks": {"occluders": [{"fill": {"texels": -1}}]}}"#,
            ["looks.occluders[0].fill.texels", "0 or more"],
        ),
    ] {
        std::fs::write(at(name), text).unwrap();
        let error =
            loaded_with(folder.path(), &format!(r#"{{"file": "{name}"}}"#), &[]).unwrap_err().to_string();
        assert!(told.iter().all(|told| error.contains(told)), "{name}: {error}");
    }
    let none = loaded_with(folder.path(), r#"{"file": "none.json"}"#, &[]).unwrap_err().to_string();
    assert!(none.contains("none.json"), "{none}");
    let large = Image::constant([1025, 1], [1.0; 3]);
    write_exr(&at("large.exr"), &large).unwrap();
    let large = loaded_with(folder.path(), r#"{"file": "large.exr"}"#, &[]).unwrap_err().to_string();
    assert!(large.contains("1025 x 1 pixels; 1024 a side"), "{large}");
}

#[test]
fn pictures_without_some_looks_are_those_of_a_scene_without_them() {
    let folder = tempfile::tempdir().unwrap();
    let all = format!(r#"{{"occluders": [{{"fill": {{"texels": 12}}}}], "transfer": {KNOWN}}}"#);
    let drawn = |looks: &str, without: Vec<Look>| {
        let scene = loaded_with(folder.path(), looks, &[]).unwrap();
        let options = Options { without, ..Options::default() };
        let files = Job::new(scene).with(options).draw(None, folder.path().join("out"), &mut Quiet).unwrap();
        std::fs::read(&files.unwrap()[0]).unwrap()
    };
    let filled = drawn(r#"{"occluders": [{"fill": {"texels": 12}}]}"#, Vec::new());
    assert!(drawn(&all, vec![Look::Transfer]) == filled);
    assert!(drawn(&all, vec![Look::Fill]) == drawn(&transfer(KNOWN), Vec::new()));
    assert!(drawn(&all, vec![Look::Fill, Look::Transfer, Look::Pierce]) == drawn("{}", Vec::new()));
    assert!(drawn(&all, Vec::new()) != filled);
}

#[test]
fn moods_of_the_demos_go_with_scenes_that_know_nothing_of_them() {
    let load = |scene: &str, mood: &str| {
        let looks = format!("looks.file=moods/{mood}");
        unscatter::io::scene_file::load(Path::new(&format!("strokes/{scene}.json")), &[looks])
    };
    let moods = std::fs::read_dir("strokes/moods").unwrap().map(|file| file.unwrap().file_name());
    let moods: Vec<String> = moods.map(|name| name.into_string().unwrap()).collect();
    for mood in moods.iter().filter(|name| name.ends_with(".json")) {
        // One of them is about leaves, and a view of the forest.
        let scenes: &[&str] =
            if mood == "clearing.json" { &["forest"] } else { &["citadel", "nave", "forest"] };
        for scene in scenes {
            let looks = load(scene, mood).unwrap().looks;
            assert!(looks.in_words().is_some() && looks.transfer.len() == 1, "{scene}, {mood}");
        }
    }
    assert!(moods.len() > 4 && load("citadel", "clearing.json").unwrap_err().to_string().contains("leaves"));
}
