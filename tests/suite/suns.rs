//! One light map before several suns: its rows are those of each sun, as parts of the first one's light.

use std::sync::Arc;

use unscatter::operator::adjoint_test;
use unscatter::problem::{LightMapProblem, Problem, Traced, constraints};
use unscatter::scene::{Scene, Strategy};
use unscatter::visibility::Geometry;

use crate::looks::{loaded_with, scene};

/// Another sun, and other paint.
fn later(radiance: &str) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let sets = [
        "light.direction=[0.2, -1, 0.1]",
        &format!("light.radiance={radiance}"),
        r#"views[0].strokes=[{"points": [[26, 12], [30, 36]], "radius": 5, "color": [0.2, 0.5, 1]}]"#,
    ];
    loaded_with(folder.path(), "{}", &sets).unwrap()
}

fn of(scenes: &[&Scene]) -> unscatter::Result<LightMapProblem> {
    let geometry = Arc::new(Geometry::new(scenes[0].mesh.clone()).unwrap());
    let painted = scenes.iter().map(|scene| (*scene, constraints(scene).unwrap())).collect();
    LightMapProblem::before_suns(painted, &geometry, &Traced)
}

fn row(problem: &LightMapProblem, row: usize) -> Vec<(usize, [f64; 3])> {
    let mut nonzeros = Vec::new();
    problem.row(row, &mut |texel, weight| nonzeros.push((texel, weight)));
    nonzeros
}

#[test]
fn rows_are_those_of_each_sun_as_parts_of_the_first() {
    let first = scene("{}");
    for (radiance, share) in [("3", [1.0; 3]), ("[6, 1.5, 3]", [2.0, 0.5, 1.0])] {
        let second = later(radiance);
        let (both, alone) =
            (of(&[&first, &second]).unwrap(), [of(&[&first]).unwrap(), of(&[&second]).unwrap()]);
        assert_eq!(both.is_grey(), share == [1.0; 3]);
        assert_eq!(both.rows(), alone[0].rows() + alone[1].rows());
        for number in 0..both.rows() {
            let (own, of_own, share) = match number.checked_sub(alone[0].rows()) {
                None => (&alone[0], number, [1.0; 3]),
                Some(later) => (&alone[1], later, share),
            };
            let (found, expected) = (row(&both, number), row(own, of_own));
            assert_eq!(found.len(), expected.len(), "row {number}");
            for ((texel, weight), (expected_texel, expected)) in found.iter().zip(&expected) {
                assert_eq!(texel, expected_texel);
                for c in 0..3 {
                    assert!(
                        (weight[c] - share[c] * expected[c]).abs() <= 1e-12 * weight[c].abs(),
                        "row {number}"
                    );
                }
            }
            let views = usize::from(number >= alone[0].rows());
            assert_eq!(both.pixel(number), [own.pixel(of_own)[0] + views, own.pixel(of_own)[1]]);
            for (found, expected) in [
                (both.wanted(number), own.wanted(of_own)),
                (both.plain[number], own.plain[of_own]),
                (both.known_radiance[number], own.known_radiance[of_own]),
            ] {
                let close = |c: usize| (found[c] - expected[c]).abs() <= 1e-6 * (1.0 + expected[c].abs());
                assert!((0..3).all(close), "row {number}: {found:?}, not {expected:?}");
            }
        }
        for strategy in [Strategy::Assembled, Strategy::MatrixFree] {
            let operator = both.on_cpu(strategy, u64::MAX).unwrap();
            assert!(adjoint_test(&operator, 3, 5).unwrap().error < 1e-6);
        }
        let few: Vec<usize> = (0..both.rows()).step_by(37).collect();
        let picked = both.of_some(&few);
        assert!(few.iter().enumerate().all(|(new, &old)| row(&picked, new) == row(&both, old)));
    }
}

#[test]
fn a_sun_in_a_channel_that_the_first_has_not_is_refused() {
    let mut first = scene("{}");
    first.light.radiance = [3.0, 3.0, 0.0];
    let error = of(&[&first, &later("3")]).unwrap_err().to_string();
    assert!(error.contains("light.radiance") && error.contains("first key"), "{error}");
}
