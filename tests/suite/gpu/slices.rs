//! Rows over slices on an adapter, against their explicit matrix in f64.

use unscatter::gpu::{Choice, Gpu, Tactics};
use unscatter::job::{Backend, EngineChoice, Job, Options, Quiet};
use unscatter::march::{EpipolarSettings, Spacing};
use unscatter::operator::adjoint_test;
use unscatter::problem::{Canvas, Drawing, DrawingMethod, DrawnLight, LightMapProblem, Problem, Renderer};
use unscatter::scene::{Basis, Rgb, Scene, Strategy};

use super::{gpu, narrow, open, products, relative_difference};
use crate::root;

/// Relative to the explicit matrix in f64.
const AGAINST_EXPLICIT: f64 = 2e-6;

fn scene(name: &str, overrides: &[&str]) -> Scene {
    let sets: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
    unscatter::io::scene_file::load(&root().join(format!("strokes/{name}.json")), &sets).unwrap()
}

const SMALL: [&str; 2] = ["light_map.size=64", "shadow_map.size=192"];

/// Demos, one in coloured fog and with other texels, one under several suns where its strokes say so.
fn scenes() -> Vec<(String, Scene)> {
    let colored = [&SMALL[..], &["medium.sigma_t=[0.02,0.05,0.11]"]].concat();
    let mut scenes: Vec<_> =
        ["citadel", "nave", "forest"].map(|name| (name.to_owned(), scene(name, &SMALL))).into();
    let mut colored = scene("citadel", &colored);
    colored.solve.basis = Basis::Nearest;
    scenes.push(("citadel in coloured fog".to_owned(), colored));
    scenes
}

fn near(problem: &LightMapProblem, settings: EpipolarSettings) -> Box<dyn Problem> {
    problem.sliced(settings).unwrap().unwrap()
}

/// How far both products are from those of the explicit matrix.
fn errors(problem: &dyn Problem, gpu: &Gpu) -> [f64; 2] {
    let operator = problem.on_gpu(gpu, Strategy::MatrixFree, u64::MAX, true).unwrap();
    assert!(operator.is_deterministic());
    // Products of f64 draw the same random numbers.
    let [exact, found] = [products(&problem.explicit(u64::MAX).unwrap(), 7), products(&operator, 7)];
    [0, 1].map(|direction| relative_difference(&found[direction], &exact[direction]))
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn swept_rows_are_the_explicit_matrix() {
    let hardware = open(Choice { tactics: Some(Tactics::HARDWARE), ..Choice::default() });
    for (name, scene) in scenes() {
        let problem = LightMapProblem::new(&scene).unwrap();
        let settings = EpipolarSettings { spacing: Spacing::Projective, ..EpipolarSettings::default() };
        for settings in [EpipolarSettings::CORRECTED, settings] {
            let sliced = near(&problem, settings);
            // The second one sees a megabyte: many batches, and channels one by one.
            for gpu in [gpu(), narrow(1 << 20), hardware.clone()] {
                let errors = errors(&*sliced, &gpu);
                assert!(errors.iter().all(|&error| error < AGAINST_EXPLICIT), "{name}: {errors:?}");
            }
        }
        let operator = near(&problem, EpipolarSettings::CORRECTED)
            .on_gpu(&gpu(), Strategy::MatrixFree, u64::MAX, false)
            .unwrap();
        assert!(adjoint_test(&operator, 1, 1).unwrap().error < 1e-6, "{name}");
        assert_eq!(products(&operator, 3), products(&operator, 3));
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn what_an_adapter_cannot_sweep_is_refused() {
    let problem = LightMapProblem::new(&scene("nave", &SMALL)).unwrap();
    let sliced = near(&problem, EpipolarSettings { between: true, ..EpipolarSettings::default() });
    let refused = sliced.on_gpu(&gpu(), Strategy::MatrixFree, u64::MAX, false).unwrap_err().to_string();
    assert!(refused.contains("between two slices"), "{refused}");
    let refused = near(&problem, EpipolarSettings::CORRECTED)
        .on_gpu(&gpu(), Strategy::MatrixFree, 1 << 20, false)
        .unwrap_err();
    assert!(refused.is_not_possible_here() && refused.to_string().contains("solve.memory"), "{refused}");
}

/// A solve over slices on an adapter ends at a light map that the exact gradient certifies, as that on the processor does.
#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn solves_are_corrected_on_an_adapter() {
    let sets =
        ["light_map.size=96", "shadow_map.size=256", "solve.tolerance=1e-2", "solve.strategy=epipolar"];
    let solved = |backend| {
        let adapter = (backend == Backend::Gpu).then(|| gpu().record().name.clone());
        let engine = EngineChoice { backend, adapter, fault: None };
        let options = Options { pictures: false, engine, ..Options::default() };
        let job = Job::open_with(root().join("strokes/citadel.json"), &sets.map(str::to_owned)).unwrap();
        job.with(options).solve(&mut Quiet).unwrap()
    };
    let found = [Backend::Cpu, Backend::Gpu].map(solved);
    for solution in &found {
        assert!(solution.certificate().value.iter().all(|&value| value <= 1e-2));
    }
    let met = |found: &unscatter::job::Solution| found.report().weighted_residual.after;
    assert!((met(&found[0]) - met(&found[1])).abs() < 0.01, "{} and {}", met(&found[0]), met(&found[1]));
}

/// What methods on the adapter are off from themselves on the processor, root mean square and for all but a thousandth of the channels,
/// relative to the brightest pixel. Steps of a march may be lit there and dark here, where they are on the border of a texel.
const PICTURES: [(DrawingMethod, [f64; 2]); 3] = [
    (DrawingMethod::March { steps: 200 }, [1e-4, 1e-3]),
    (DrawingMethod::Prefiltered { coefficients: 32 }, [1e-4, 1e-3]),
    (DrawingMethod::Epipolar { samples: 1024 }, [1e-6, 1e-5]),
];

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn methods_draw_on_an_adapter_what_they_draw_on_the_processor() {
    for (name, scene) in scenes() {
        let problem = LightMapProblem::new(&scene).unwrap();
        let wave = |k: usize| -> Rgb { [0.11, 0.07, 0.05].map(|rate| 2.0 + 2.0 * (rate * k as f32).sin()) };
        let texels: Vec<Rgb> = (0..problem.maps.light_map.len()).map(wave).collect();
        // The second one sees four megabytes: many batches and slabs, and channels one by one.
        for gpu in [gpu(), narrow(4 << 20)] {
            for (method, bounds) in PICTURES {
                let drawn = |canvas: &Canvas| {
                    let drawing = Drawing { method, reduced: 1 };
                    let renderer = Renderer::new(&scene, &problem.maps, Some(&texels)).unwrap();
                    renderer.drawing(drawing).showing(DrawnLight::Scattered).picture(0, canvas).unwrap()
                };
                let [expected, found] = [&Canvas::Processor, &Canvas::Adapter(gpu.clone())].map(drawn);
                for (what, found, expected) in
                    [("before", &found.before, &expected.before), ("after", &found.after, &expected.after)]
                {
                    let all = |image: &unscatter::scene::Image| image.pixels.concat();
                    let (found, expected) = (all(found), all(expected));
                    let brightest = expected.iter().copied().fold(0.0, f32::max);
                    let mut off: Vec<f64> =
                        found.iter().zip(&expected).map(|(a, b)| f64::from((a - b) / brightest)).collect();
                    let square = off.iter().map(|it| it * it).sum::<f64>() / off.len() as f64;
                    off.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
                    let errors = [square.sqrt(), off[off.len() - off.len() / 1000 - 1].abs()];
                    assert!(
                        errors[0] <= bounds[0] && errors[1] <= bounds[1],
                        "{name}, {method}, {what}: {errors:?}"
                    );
                    assert!(errors[0] > 0.0, "{name}, {method}: drawn by the processor");
                }
            }
        }
    }
}
