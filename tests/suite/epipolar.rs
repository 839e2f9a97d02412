//! Slices: pictures by other methods than the exact rows, and solves with rows over slices.

use std::sync::Arc;

use unscatter::job::{Job, Options, Quiet};
use unscatter::march::EpipolarSettings;
use unscatter::operator::{OnHost, TransportOperator, adjoint_test};
use unscatter::problem::{
    Canvas, Drawing, DrawingMethod, DrawnLight, LightMapProblem, Paused, Problem, Renderer, Transports, fit,
    near, solve,
};
use unscatter::scene::{Scene, Strategy};
use unscatter::solve::{Control, StopReason};
use unscatter::visibility::Geometry;

use crate::root;

const DEMOS: [&str; 3] = ["citadel", "nave", "forest"];

fn scene(name: &str, overrides: &[&str]) -> Scene {
    let sets: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
    unscatter::io::scene_file::load(&root().join(format!("strokes/{name}.json")), &sets).unwrap()
}

/// The scattered light of the first view of a demo, under a light map of waves or under the plain light.
fn drawn(scene: &Scene, drawing: Drawing, waves: bool) -> unscatter::Result<Vec<[f32; 3]>> {
    let geometry = Arc::new(Geometry::new(scene.mesh.clone())?);
    let maps = fit(scene, &scene.light_map, &geometry)?;
    let [width, _] = maps.light_map.size;
    let wave = |k: usize| {
        let (x, y) = (k % width, k / width);
        let light = scene.light.radiance;
        [0.11, 0.07, 0.05]
            .map(|rate| 0.5 + 0.5 * (rate * (x as f32) + 0.3 * rate * y as f32).sin())
            .map(|it| it * light[0])
    };
    let texels: Vec<[f32; 3]> = (0..maps.light_map.len()).map(wave).collect();
    let texels = waves.then_some(&texels[..]);
    let renderer = Renderer::new(scene, &maps, texels)?.showing(DrawnLight::Scattered).drawing(drawing);
    Ok(renderer.picture(0, &Canvas::Processor)?.after.pixels)
}

/// Root mean square of the difference, and the largest, relative to the largest value.
fn apart(a: &[[f32; 3]], b: &[[f32; 3]]) -> [f64; 2] {
    let brightest = b.iter().flatten().copied().fold(0.0, f32::max);
    let differences =
        || a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| f64::from((a - b) / brightest));
    let count = (3 * a.len()) as f64;
    let rms = (differences().map(|it| it * it).sum::<f64>() / count).sqrt();
    [rms, differences().map(f64::abs).fold(0.0, f64::max)]
}

fn by(method: DrawingMethod) -> Drawing {
    Drawing { method, reduced: 1 }
}

const SMALL: [&str; 4] =
    ["views[0].strokes=[]", "views[0].camera.size=[192,108]", "light_map.size=128", "shadow_map.size=256"];

/// What each method is off by at most, root mean square and largest, relative to the brightest pixel.
const BOUNDS: [(DrawingMethod, [f64; 2]); 5] = [
    (DrawingMethod::March { steps: 2048 }, [2e-3, 2e-2]),
    (DrawingMethod::MinMax { samples: 2048 }, [5e-3, 0.1]),
    (DrawingMethod::Prefiltered { coefficients: 64 }, [3e-2, 0.3]),
    (DrawingMethod::Epipolar { samples: 2048 }, [5e-3, 0.1]),
    (DrawingMethod::Bilateral { steps: 32 }, [3e-2, 0.3]),
];

#[test]
fn every_method_draws_what_exact_rows_do() {
    for name in DEMOS {
        let scene = scene(name, &SMALL);
        for waves in [false, true] {
            let exact = drawn(&scene, Drawing::default(), waves).unwrap();
            for (method, bounds) in BOUNDS {
                if waves && matches!(method, DrawingMethod::MinMax { .. }) {
                    let refused = drawn(&scene, by(method), waves).unwrap_err().to_string();
                    assert!(refused.contains("colours of a light map"), "{refused}");
                    continue;
                }
                let errors = apart(&drawn(&scene, by(method), waves).unwrap(), &exact);
                assert!(
                    errors[0] <= bounds[0] && errors[1] <= bounds[1],
                    "{name}, {method}, light map {waves}: {errors:?}"
                );
                assert!(errors[0] > 1e-9, "{name}, {method}: drawn by exact rows");
            }
        }
    }
}

/// Fewer steps, samples and coefficients draw worse.
#[test]
fn the_number_of_a_method_says_how_exact_it_is() {
    let scene = scene("forest", &SMALL);
    let exact = drawn(&scene, Drawing::default(), true).unwrap();
    for [few, many] in [
        [DrawingMethod::March { steps: 16 }, DrawingMethod::March { steps: 256 }],
        [DrawingMethod::Prefiltered { coefficients: 4 }, DrawingMethod::Prefiltered { coefficients: 64 }],
        [DrawingMethod::Epipolar { samples: 32 }, DrawingMethod::Epipolar { samples: 512 }],
        [DrawingMethod::Bilateral { steps: 4 }, DrawingMethod::Bilateral { steps: 64 }],
    ] {
        let error = |method| apart(&drawn(&scene, by(method), true).unwrap(), &exact)[0];
        let errors = [few, many].map(error);
        assert!(errors[1] < 0.7 * errors[0], "{few} {:.1e}, {many} {:.1e}", errors[0], errors[1]);
    }
    let at = |reduced| {
        let drawing = Drawing { method: DrawingMethod::Epipolar { samples: 2048 }, reduced };
        apart(&drawn(&scene, drawing, true).unwrap(), &exact)[0]
    };
    let errors = [at(1), at(2), at(4)];
    assert!(errors[0] < errors[1] && errors[1] < errors[2] && errors[2] < 0.05, "{errors:?}");
}

#[test]
fn what_slices_cannot_show_is_refused() {
    let glass = scene("chapel", &["light_map.size=64", "shadow_map.size=64"]);
    for (method, _) in BOUNDS {
        let refused = drawn(&glass, by(method), false).unwrap_err().to_string();
        assert!(refused.contains("panes") && refused.contains("method exact"), "{method}: {refused}");
    }
    let reduced = Drawing { method: DrawingMethod::Exact, reduced: 2 };
    assert!(drawn(&glass, reduced, false).unwrap_err().to_string().contains("panes"));
    let sliced = LightMapProblem::new(&glass).unwrap().sliced(EpipolarSettings::default());
    let refused = sliced.unwrap().err().unwrap().to_string();
    assert!(refused.contains("pane") && refused.contains("solve.strategy"), "{refused}");
    let volume =
        Job::open_with(root().join("strokes/smoke.json"), &["solve.strategy=epipolar".to_owned()]).unwrap();
    let refused = volume.solve(&mut Quiet).unwrap_err().to_string();
    assert!(refused.contains("light maps alone"), "{refused}");
}

const PAINTED: [&str; 3] = ["light_map.size=96", "shadow_map.size=256", "solve.strategy=epipolar"];

struct Solving {
    scene: Scene,
    problem: LightMapProblem,
    exact: OnHost,
    near: OnHost,
}

impl Solving {
    fn new(name: &str, overrides: &[&str]) -> Self {
        let scene = scene(name, &[&PAINTED[..], overrides].concat());
        let problem = LightMapProblem::new(&scene).unwrap();
        let sliced = near(&problem, Strategy::Epipolar).unwrap().unwrap();
        let exact = problem.on_cpu(Strategy::MatrixFree, u64::MAX).unwrap();
        Self { scene, exact, near: sliced.on_cpu(Strategy::Epipolar, u64::MAX).unwrap(), problem }
    }

    fn solve(
        &self,
        begin: Option<Paused>,
        pause_after: usize,
    ) -> (unscatter::problem::Solved, Option<Paused>) {
        let coverage = self.exact.squares(&self.problem.weights()).unwrap();
        let transports = Transports { exact: &self.exact, near: Some(&self.near) };
        let mut paused = None;
        let solved =
            solve(&self.problem, transports, &coverage, &self.scene.solve, begin, |history, snapshot| {
                if history.progress.len() == pause_after && !snapshot.is_final() {
                    paused = Some(Paused { history: history.clone(), state: snapshot.state()? });
                    return Ok(Control::Pause);
                }
                Ok(Control::Continue)
            });
        (solved.unwrap(), paused)
    }
}

/// The certificate is that of the exact gradient: the exact operator alone finds the same light map from there at once.
#[test]
fn corrected_solves_end_where_exact_rows_do() {
    let mut corrected = 0;
    for name in DEMOS {
        let solving = Solving::new(name, &["solve.tolerance=1e-2"]);
        let (solved, _) = solving.solve(None, usize::MAX);
        assert_eq!(
            solved.outcome.stop.reason,
            StopReason::Tolerance,
            "{name}: {:?}",
            solved.outcome.true_normal_residual
        );
        assert!(solved.outcome.true_normal_residual.iter().all(|&it| it <= 1e-2));
        // Few strokes on a small map: slices meet other texels than the exact rows.
        assert_eq!(solved.gave_up_near, name == "forest", "{name}");
        let coverage = solving.exact.squares(&solving.problem.weights()).unwrap();
        let begin = unscatter::problem::Begin::At(&solved.x);
        let again =
            solve(&solving.problem, &solving.exact, &coverage, &solving.scene.solve, begin, |_, _| {
                Ok(Control::Continue)
            });
        let again = again.unwrap();
        assert_eq!(again.outcome.history.progress.len(), 1, "{name}: exact rows go on");
        let bare = Transports { exact: &solving.near, near: None };
        let wrong = solve(&solving.problem, bare, &coverage, &solving.scene.solve, None, |_, _| {
            Ok(Control::Continue)
        });
        let begin = unscatter::problem::Begin::At(&wrong.unwrap().x);
        let off = solve(&solving.problem, &solving.exact, &coverage, &solving.scene.solve, begin, |_, _| {
            Ok(Control::Continue)
        });
        corrected += usize::from(off.unwrap().outcome.history.progress.len() > 1);
    }
    assert!(corrected > 0, "slices alone would have done");
}

#[test]
fn a_corrected_solve_goes_on_to_the_same_bits() {
    let solving = Solving::new("citadel", &["solve.tolerance=1e-3", "solve.iterations=40"]);
    let (whole, _) = solving.solve(None, usize::MAX);
    let corrections = whole.outcome.history.restarts;
    assert!(corrections > 0, "nothing was corrected");
    for after in [3, whole.outcome.history.progress.len() - 2] {
        let (_, paused) = solving.solve(None, after);
        let (resumed, _) = solving.solve(paused, usize::MAX);
        let bits = |x: &[[f32; 3]]| x.as_flattened().iter().map(|it| it.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&resumed.x), bits(&whole.x), "paused after {after}");
        assert_eq!(resumed.outcome.history.restarts, corrections);
    }
}

/// A tolerance that the iterations do not suffice for is still come nearer to than slices alone would.
#[test]
fn the_exact_gradient_is_looked_at_on_the_way() {
    for name in ["citadel", "nave"] {
        let solving = Solving::new(name, &["solve.tolerance=1e-5", "solve.iterations=40"]);
        let (solved, _) = solving.solve(None, usize::MAX);
        let outcome = &solved.outcome;
        assert_eq!(outcome.stop.reason, StopReason::Iterations, "{name}");
        assert!(outcome.history.restarts > 0, "{name}");
        let coverage = solving.exact.squares(&solving.problem.weights()).unwrap();
        let bare = Transports { exact: &solving.near, near: None };
        let near = solve(&solving.problem, bare, &coverage, &solving.scene.solve, None, |_, _| {
            Ok(Control::Continue)
        });
        let settings = unscatter::scene::SolveSettings { iterations: 0, ..solving.scene.solve.clone() };
        let begin = unscatter::problem::Begin::At(&near.unwrap().x);
        let of_near = solve(&solving.problem, &solving.exact, &coverage, &settings, begin, |_, _| {
            Ok(Control::Continue)
        });
        let sum = |normal: [f64; 3]| normal.iter().sum::<f64>();
        let [found, of_near] =
            [outcome, &of_near.unwrap().outcome].map(|outcome| sum(outcome.true_normal_residual));
        assert!(found < 0.7 * of_near, "{name}: {found:e}, and {of_near:e} by slices alone");
    }
}

#[test]
fn methods_that_cannot_be_corrected_say_so() {
    let job = Job::open_with(
        root().join("strokes/citadel.json"),
        &[&PAINTED[..], &["solve.solver=lsqr"]].concat().iter().map(|&it| it.to_owned()).collect::<Vec<_>>(),
    );
    let refused = job.unwrap().solve(&mut Quiet).unwrap_err().to_string();
    assert!(refused.contains("fista, cgls or clamped-cgls"), "{refused}");
}

/// Of all demos: T over slices against the exact rows, and its own adjoint and matrix.
#[test]
fn rows_over_slices_are_near_the_exact_ones_and_their_own_transpose() {
    for name in DEMOS {
        let scene = scene(name, &PAINTED);
        let problem = LightMapProblem::new(&scene).unwrap();
        let exact = problem.on_cpu(Strategy::MatrixFree, u64::MAX).unwrap();
        let shown = |operator: &OnHost| {
            use unscatter::operator::{LinearOperator, Vector};
            let (mut x, mut y) = (operator.domain(), operator.range());
            x.0.iter_mut()
                .enumerate()
                .for_each(|(k, x)| *x = [(k % 97) as f32 / 97.0, 1.0, (k % 31) as f32 / 31.0]);
            operator.apply(&x, &mut y).unwrap();
            assert!(y.norm_squared().unwrap()[0] > 0.0);
            y.0
        };
        let truth = shown(&exact);
        let errors = [1.0, 2.0, 4.0].map(|times| {
            let settings = EpipolarSettings {
                slices: times,
                density: times,
                samples: 8192,
                ..EpipolarSettings::default()
            };
            let sliced = problem.sliced(settings).unwrap().unwrap();
            let operator = sliced.on_cpu(Strategy::MatrixFree, u64::MAX).unwrap();
            assert!(adjoint_test(&operator, 1, 1).unwrap().error < 1e-6, "{name}");
            assert!(
                adjoint_test(&sliced.wide(Strategy::MatrixFree).unwrap(), 1, 1).unwrap().error < 1e-13,
                "{name}"
            );
            apart(&shown(&operator), &truth)[0]
        });
        assert!(errors[0] < 2e-2 && errors[2] < 0.5 * errors[0], "{name}: {errors:?}");
    }
}

#[test]
fn jobs_solve_over_slices() {
    let open = |strategy: &str| {
        let sets =
            ["light_map.size=96", "shadow_map.size=256", "solve.tolerance=1e-2", strategy].map(str::to_owned);
        let options = Options { pictures: false, ..Options::default() };
        Job::open_with(root().join("strokes/citadel.json"), &sets).unwrap().with(options)
    };
    let plan = open("solve.strategy=epipolar").plan(&mut Quiet).unwrap();
    assert_eq!(plan[0].strategy, "epipolar");
    let [exact, sliced] = ["solve.strategy=matrix-free", "solve.strategy=epipolar"]
        .map(|strategy| open(strategy).solve(&mut Quiet).unwrap());
    assert!(sliced.certificate().value.iter().all(|&value| value <= 1e-2));
    let met = |found: &unscatter::job::Solution| found.report().weighted_residual.after;
    assert!((met(&sliced) - met(&exact)).abs() < 0.02, "{} and {}", met(&sliced), met(&exact));
}
