//! The same solvers on the device: the metric of tiles against its twin, and whole problems against the processor.

use unscatter::Error;
use unscatter::cpu::TileMetric;
use unscatter::gpu::{self, Choice, Gpu, GpuVector, SimulatedFault, adapters, known_answers};
use unscatter::io::scene_file;
use unscatter::operator::{
    Bounds, CpuVector, Indexed, MatrixRows, Metric, TileBlocks, Tiling, TransportOperator, Vector,
};
use unscatter::problem::{Assessor, LightMapProblem, Problem, Solved, evenly, solve};
use unscatter::scene::{MetricName, RegularizationWeight, Rgb, Scene, SolverName, Strategy};
use unscatter::solve::Control;

use super::{as_on_hardware, device, gpu, narrow, open, random, relative_difference};
use crate::scenes::Numbers;
use crate::tolerances::{DEVICE_LIGHT_MAP, DEVICE_OBJECTIVE, DEVICE_TILES};

/// Random rows over a lattice of 23 × 17, without negative weights.
struct Random<const C: usize>(Vec<Vec<(usize, [f32; C])>>);

impl<const C: usize> Random<C> {
    fn new() -> Self {
        let mut n = Numbers(77);
        let row = |n: &mut Numbers| {
            let mut row = Vec::new();
            for element in 0..23 * 17 {
                if n.next().is_multiple_of(9) {
                    row.push((element, std::array::from_fn(|_| n.uniform(0.1, 1.0) as f32)));
                }
            }
            row
        };
        Self((0..120).map(|_| row(&mut n)).collect())
    }
}

impl<const C: usize> MatrixRows<f32, C> for Random<C> {
    fn rows(&self) -> usize {
        self.0.len()
    }

    fn visit(&self, row: usize, visit: &mut impl FnMut(usize, [f32; C])) {
        self.0[row].iter().for_each(|&(element, weight)| visit(element, weight));
    }
}

/// Everything that a metric does, on the host.
fn metric_at_work<V: Indexed>(metric: &dyn Metric<V>, zeros: &V, unknowns: usize) -> [Vec<[f64; 3]>; 6] {
    let (mut stretched, mut shrunk) = (random(zeros.zeros(unknowns), 1), random(zeros.zeros(unknowns), 2));
    metric.stretch(&mut stretched);
    metric.shrink(&mut shrunk);
    let [one, two, three, four] = parts().map(|bounds| {
        let (mut x, mut y) = (random(zeros.zeros(unknowns), 3), random(zeros.zeros(unknowns), 4));
        y.clamp(&bounds);
        metric.descend(&mut x, &y, [1.0, 2.0, 0.5], &bounds);
        x
    });
    [stretched, shrunk, one, two, three, four].map(|vector| vector.to_host().unwrap())
}

/// Bounds of one to four parts; tiles are 8 × 8 of 23 × 17, so that every boundary goes through several.
fn parts() -> [Bounds; 4] {
    const NONE: f64 = f64::INFINITY;
    let of = |lower, upper| Bounds::new(lower, upper).unwrap();
    let one = of([0.0, -0.2, -NONE], [0.4, NONE, NONE]);
    let two = one.clone().then(31, of([-0.4; 3], [0.1, 0.2, NONE]));
    let three = two.clone().then(33, of([0.2; 3], [NONE; 3]));
    let four = three.clone().then(201, of([-NONE, -0.3, -NONE], [0.3, 0.0, -0.1]));
    [one, two, three, four]
}

fn tiles<const C: usize>(gpu: &Gpu) {
    let columns: Vec<u32> = (0..23 * 17).filter(|k| k % 5 != 2).collect();
    let tiling = Tiling::new([23, 17], &columns);
    let added: Vec<f64> = (0..columns.len()).map(|k| 0.01 * (k % 3) as f64).collect();
    let metric = TileMetric::<f32, C>::new(&Random::<C>::new(), &tiling, &[1.0; 120], &added).unwrap();
    let there = gpu::TileMetric::new(gpu, columns.len(), C, metric.blocks()).unwrap();
    let truth = metric_at_work(&metric, &CpuVector::zeros(0), columns.len());
    let got = metric_at_work(&there, &device(gpu, 0), columns.len());
    let names = ["stretch", "shrink", "one part", "two parts", "three parts", "four parts"];
    for (name, (truth, got)) in names.into_iter().zip(truth.iter().zip(&got)) {
        let error = relative_difference(got, truth);
        assert!(error <= DEVICE_TILES, "{name}: {error:e}");
    }
    // One block wrong is noticed.
    let mut blocks: Vec<(Vec<u32>, Vec<f32>)> =
        metric.blocks().map(|(members, matrix)| (members.to_vec(), matrix.to_vec())).collect();
    blocks[1].1.chunks_exact_mut(C).for_each(|entry| entry[0] *= 1.1);
    let sabotaged = gpu::TileMetric::new(gpu, columns.len(), C, blocks.iter().map(|(m, b)| (&m[..], &b[..])));
    let got = metric_at_work(&sabotaged.unwrap(), &device(gpu, 0), columns.len());
    assert!((0..6).all(|k| relative_difference(&got[k], &truth[k]) > DEVICE_TILES));
    // So are the bounds of the step before.
    assert!((2..6).all(|k| relative_difference(&truth[k], &truth[2 + (k + 3) % 4]) > DEVICE_TILES));
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn tiles_are_those_of_the_twin() {
    // All at once; a channel at a time and few tiles at once.
    for gpu in [gpu(), as_on_hardware(), narrow(64 * 64 * 3 * 4)] {
        tiles::<1>(&gpu);
        tiles::<3>(&gpu);
    }
}

/// A demo scene.
fn demo(name: &str) -> Scene {
    scene_file::load(&crate::root().join(format!("strokes/{name}.json")), &[]).unwrap()
}

fn solved(problem: &LightMapProblem, operator: &impl TransportOperator, scene: &Scene) -> (Solved, f64) {
    let coverage = operator.squares(&problem.weights()).unwrap();
    let solved =
        solve(problem, operator, &coverage, &scene.solve, None, |_, _| Ok(Control::Continue)).unwrap();
    let shown = Assessor::new(problem, operator).unwrap().assess(&solved.x, scene.views.len()).unwrap();
    let start = vec![problem.start; solved.x.len()];
    let before = Assessor::new(problem, operator).unwrap().assess(&start, scene.views.len()).unwrap();
    (solved, shown.all.residual.powi(2) / before.all.residual.powi(2))
}

fn on_device(scene: &Scene, problem: &LightMapProblem, gpu: &Gpu, deterministic: bool) -> gpu::GpuOperator {
    problem.on_gpu(gpu, scene.solve.strategy, u64::MAX, deterministic).unwrap()
}

/// ‖a − b‖ / ‖b‖.
fn apart(a: &[Rgb], b: &[Rgb]) -> f64 {
    let wide = |map: &[Rgb]| map.iter().map(|texel| texel.map(f64::from)).collect::<Vec<_>>();
    relative_difference(&wide(a), &wide(b))
}

/// Light maps and objectives of the processor and of a device.
fn compare(scene: &Scene, problem: &LightMapProblem, gpu: &Gpu) -> [f64; 2] {
    let (here, objective) = solved(problem, &problem.on_cpu(scene.solve.strategy, u64::MAX).unwrap(), scene);
    let (there, its_objective) = solved(problem, &on_device(scene, problem, gpu, false), scene);
    // In f32 and in another order of sums, an iterate may meet the tolerance an iteration sooner or later.
    let (stop, its_stop) = (here.outcome.stop, there.outcome.stop);
    assert_eq!(stop.reason, its_stop.reason);
    assert!(stop.iteration.abs_diff(its_stop.iteration) <= 1, "{stop:?} and {its_stop:?}");
    [apart(&there.x, &here.x), (its_objective / objective - 1.0).abs()]
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn a_demo_scene_is_solved_as_on_the_processor() {
    for strategy in [Strategy::Assembled, Strategy::MatrixFree] {
        let mut scene = demo("citadel");
        scene.solve.strategy = strategy;
        let problem = LightMapProblem::new(&scene).unwrap();
        let [light_map, objective] = compare(&scene, &problem, &gpu());
        assert!(light_map <= DEVICE_LIGHT_MAP, "{strategy:?}: light maps are {light_map:e} apart");
        assert!(objective <= DEVICE_OBJECTIVE, "{strategy:?}: objectives are {objective:e} apart");
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn another_medium_is_noticed() {
    let scene = demo("citadel");
    let mut thicker = demo("citadel");
    thicker.medium.sigma_t = thicker.medium.sigma_t.map(|sigma| 1.01 * sigma);
    let (problem, other) = (LightMapProblem::new(&scene).unwrap(), LightMapProblem::new(&thicker).unwrap());
    let (here, _) = solved(&problem, &problem.on_cpu(scene.solve.strategy, u64::MAX).unwrap(), &scene);
    let (there, _) = solved(&other, &on_device(&thicker, &other, &gpu(), false), &thicker);
    assert!(apart(&there.x, &here.x) > DEVICE_LIGHT_MAP);
}

/// A demo scene of few texels and some of its painted pixels, for eight iterations. Methods of conjugate gradients lose
/// their orthogonality in f32 after more, on the processor as on a device, and then part.
fn small(solver: SolverName) -> (Scene, LightMapProblem) {
    let mut scene = demo("nave");
    scene.light_map.size = [96, 96];
    scene.shadow_map.size = [256, 256];
    scene.solve.solver = solver;
    scene.solve.iterations = 8;
    scene.solve.tolerance = 0.0;
    let all = LightMapProblem::new(&scene).unwrap();
    let problem = all.of_some(&evenly(5000, all.constraints.len()));
    (scene, problem)
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn every_solver_takes_the_same_path() {
    let gpu = gpu();
    for solver in SolverName::ALL {
        let (mut scene, problem) = small(solver);
        scene.solve.regularization.gradient = RegularizationWeight::Relative(1e-3);
        scene.solve.regularization.laplacian = RegularizationWeight::Relative(1e-4);
        if solver == SolverName::Lbfgs {
            // It divides by differences of gradients, so roundings grow by some five times in every two iterations.
            scene.solve.iterations = 5;
        }
        let [light_map, objective] = compare(&scene, &problem, &gpu);
        assert!(light_map <= DEVICE_LIGHT_MAP, "{solver:?}: light maps are {light_map:e} apart");
        assert!(objective <= DEVICE_OBJECTIVE, "{solver:?}: objectives are {objective:e} apart");
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn every_metric_and_the_choice_of_a_weight_are_the_same() {
    let gpu = gpu();
    for metric in [MetricName::Tiles, MetricName::Sqs, MetricName::Jacobi, MetricName::None] {
        let (mut scene, problem) = small(SolverName::Fista);
        scene.solve.metric = metric;
        scene.solve.regularization.tikhonov = RegularizationWeight::Gcv;
        let [light_map, objective] = compare(&scene, &problem, &gpu);
        assert!(light_map <= DEVICE_LIGHT_MAP, "{metric:?}: light maps are {light_map:e} apart");
        assert!(objective <= DEVICE_OBJECTIVE, "{metric:?}: objectives are {objective:e} apart");
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn ten_deterministic_runs_give_the_same_bytes() {
    let gpu = gpu();
    let (mut scene, problem) = small(SolverName::Fista);
    scene.solve.strategy = Strategy::MatrixFree;
    let run = || {
        let operator = on_device(&scene, &problem, &gpu, true);
        assert!(operator.is_deterministic());
        solved(&problem, &operator, &scene).0.x
    };
    let bits = |map: Vec<Rgb>| map.iter().flatten().map(|value| value.to_bits()).collect::<Vec<_>>();
    let first = bits(run());
    (1..10).for_each(|_| assert_eq!(bits(run()), first));
    // What is kept is gathered in order, whatever was asked for.
    scene.solve.strategy = Strategy::Assembled;
    assert!(on_device(&scene, &problem, &gpu, false).is_deterministic());
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn an_iteration_of_the_default_waits_once() {
    let gpu = gpu();
    let (scene, problem) = small(SolverName::Fista);
    let operator = on_device(&scene, &problem, &gpu, false);
    let coverage = operator.squares(&problem.weights()).unwrap();
    let mut waits = Vec::new();
    solve(&problem, &operator, &coverage, &scene.solve, None, |_, snapshot| {
        if !snapshot.is_final() {
            waits.push(gpu.round_trips());
        }
        Ok(Control::Continue)
    })
    .unwrap();
    assert!(waits.len() == 8);
    assert!(waits.windows(2).all(|pair| pair[1] - pair[0] == 1), "{waits:?}");
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn a_device_that_is_lost_while_it_is_waited_for_or_hangs_is_an_error_and_dropped_without_waiting() {
    let (scene, problem) = small(SolverName::Fista);
    for (fault, words) in
        [(SimulatedFault::Crash(9), "was lost"), (SimulatedFault::Hang(9), "has not answered for 0.")]
    {
        let gpu = open(Choice { fault: Some(fault), ..Choice::default() });
        let operator = on_device(&scene, &problem, &gpu, false);
        let coverage = operator.squares(&problem.weights()).unwrap();
        let ended = solve(&problem, &operator, &coverage, &scene.solve, None, |_, _| Ok(Control::Continue));
        let Err(error) = ended else { panic!("{fault:?} was not noticed") };
        assert!(error.is_of_adapter() && error.to_string().contains(words), "{error}");
        // What comes after says the same at once.
        let again = operator.squares(&problem.weights()).unwrap_err();
        assert!(again.to_string().contains(words), "{again}");
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn a_device_that_is_lost_is_an_error_and_the_state_before_is_worth_something() {
    let gpu = gpu();
    let (scene, problem) = small(SolverName::Fista);
    let operator = on_device(&scene, &problem, &gpu, false);
    let coverage = operator.squares(&problem.weights()).unwrap();
    let mut kept = None;
    let lost = solve(&problem, &operator, &coverage, &scene.solve, None, |history, snapshot| {
        if history.progress.len() == 3 {
            kept = Some(unscatter::problem::Paused { history: history.clone(), state: snapshot.state()? });
        }
        if history.progress.len() == 5 {
            gpu.destroy();
        }
        Ok(Control::Continue)
    });
    let Err(error) = lost else { panic!("a lost device was not noticed") };
    assert!(matches!(&error, Error::Adapter { .. }) && error.is_of_adapter(), "{error}");
    assert!(error.to_string().contains("lost"), "{error}");
    // Everything after that says the same, and the processor goes on from where the device was.
    assert!(operator.squares(&problem.weights()).is_err());
    let here = problem.on_cpu(scene.solve.strategy, u64::MAX).unwrap();
    let resumed =
        solve(&problem, &here, &coverage, &scene.solve, kept, |_, _| Ok(Control::Continue)).unwrap();
    let whole = solve(&problem, &here, &coverage, &scene.solve, None, |_, _| Ok(Control::Continue)).unwrap();
    assert!(apart(&resumed.x, &whole.x) <= DEVICE_LIGHT_MAP);
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn what_exceeds_a_binding_is_taken_in_slabs_and_what_exceeds_the_memory_is_refused() {
    let (scene, problem) = small(SolverName::Fista);
    let whole = solved(&problem, &on_device(&scene, &problem, &gpu(), false), &scene);
    // A channel of the light map takes 36 KiB, the shadow map 256 KiB, the rows more.
    let sliced = solved(&problem, &on_device(&scene, &problem, &narrow(300 << 10), false), &scene);
    assert!(apart(&sliced.0.x, &whole.0.x) <= DEVICE_LIGHT_MAP);
    let crowded = open(Choice { fault: Some(SimulatedFault::Memory), ..Choice::default() });
    let refused = problem.on_gpu(&crowded, Strategy::Assembled, u64::MAX, false);
    assert!(matches!(&refused, Err(Error::AdapterMemory { .. })), "{refused:?}");
    let refused = problem.on_gpu(&gpu(), Strategy::Assembled, 1 << 20, false);
    assert!(matches!(&refused, Err(Error::TooLarge { .. })), "{refused:?}");
    let mut large = GpuVector::zeros(&crowded, 100_000);
    assert!(large.set_from_host(&vec![[0.0; 3]; 100_000]).is_err());
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn every_adapter_is_asked_what_is_known_and_is_the_one_that_was_meant() {
    for record in adapters().into_iter().filter(|record| record.missing.is_empty()) {
        known_answers(&record).unwrap();
        let meant = Gpu::open(&Choice { number: Some(record.number), ..Choice::default() }).unwrap();
        assert_eq!(*meant.record(), record);
        if !record.bus.is_empty() {
            let by_bus = Gpu::open(&Choice { name: Some(record.bus.clone()), ..Choice::default() }).unwrap();
            assert_eq!(*by_bus.record(), record);
        }
    }
    let none = Gpu::open(&Choice { number: Some(99), ..Choice::default() });
    assert!(matches!(none, Err(Error::Adapter { .. })));
}
