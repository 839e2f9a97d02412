//! Pictures show the model that is solved.

use unscatter::operator::LinearOperator;
use unscatter::problem::{LightMapProblem, render};
use unscatter::scene::Scene;
use unscatter::sparse::ExplicitMatrix;

use crate::scenes::Numbers;

/// Black slats under a slanted sun, so that pictures hold scattered light and nothing else.
const SCENE: &str = r##"{
    "version": 1,
    "light": {"direction": [0.5, -1, 0.3], "radiance": [2, 1.5, 1]},
    "medium": {"sigma_t": 0.05, "albedo": 0.9, "g": 0.2},
    "ambient": 0,
    "occluders": [
        {"box": {"center": [0, 4, -1], "size": [6, 0.2, 0.7], "albedo": 0}},
        {"box": {"center": [0, 4, 1], "size": [6, 0.2, 0.7], "albedo": 0}},
        {"plane": {"center": [0, 0, 0], "sides": [[0, 0, 20], [20, 0, 0]], "albedo": 0}}
    ],
    "views": [{
        "name": "front",
        "camera": {"to_world": {"look_at": {"origin": [1, 2, 9], "target": [0, 2, 0]}}, "fov": 50, "size": [48, 32]},
        "strokes": [{"points": [[5, 5], [40, 28]], "radius": 9, "color": "#ff4020"}]
    }],
    "light_map": {"size": [37, 29], "basis": "BASIS"},
    "shadow_map": {"size": 128}
}"##;

fn scene(basis: &str) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    std::fs::write(&path, SCENE.replace("BASIS", basis)).unwrap();
    unscatter::io::scene_file::load(&path, &[]).unwrap()
}

#[test]
fn pictures_change_by_the_transport_of_what_changed_in_the_light_map() {
    for basis in ["nearest", "bilinear"] {
        let scene = scene(basis);
        let problem = LightMapProblem::new(&scene).unwrap();
        let explicit = ExplicitMatrix::new::<1>(&problem.traversal, u64::MAX).unwrap();
        let mut n = Numbers(99);
        // Most texels keep the light's radiance, for those are what rendering skips.
        let change: Vec<[f64; 3]> = (0..problem.maps.light_map.len())
            .map(|_| if n.next().is_multiple_of(7) { [n.uniform(-1.0, 3.0), 0.5, -0.25] } else { [0.0; 3] })
            .collect();
        let texels: Vec<[f32; 3]> =
            change.iter().map(|d| std::array::from_fn(|c| scene.light.radiance[c] + d[c] as f32)).collect();
        let pictures = render(&scene, &problem.maps, Some(&texels), 0).unwrap();
        let mut x = explicit.domain();
        x.0 = texels
            .iter()
            .map(|t| std::array::from_fn(|c| f64::from(t[c] - scene.light.radiance[c])))
            .collect();
        let mut expected = explicit.range();
        explicit.apply(&x, &mut expected).unwrap();
        assert!(expected.0.iter().flatten().any(|value| value.abs() > 1e-4));
        for (pixel, expected) in problem.constraints.iter().zip(&expected.0) {
            let (before, after) = (pictures.before.at(pixel.x, pixel.y), pictures.after.at(pixel.x, pixel.y));
            for c in 0..3 {
                let shown = f64::from(after[c]) - f64::from(before[c]);
                assert!(
                    (shown - expected[c]).abs() <= 1e-6,
                    "{basis}, {pixel:?}: {shown} is not {}",
                    expected[c]
                );
            }
        }
    }
}

#[test]
fn the_start_is_what_the_light_gives_without_a_light_map() {
    let scene = scene("bilinear");
    let problem = LightMapProblem::new(&scene).unwrap();
    let plain = render(&scene, &problem.maps, None, 0).unwrap();
    let start = vec![problem.start; problem.maps.light_map.len()];
    let same = render(&scene, &problem.maps, Some(&start), 0).unwrap();
    assert_eq!(plain, same);
    assert!(render(&scene, &problem.maps, Some(&start[1..]), 0).is_err());
}
