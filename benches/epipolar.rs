//! Rows over slices: time and error beside the exact rows, by slices, samples and terms; and a solve of views that are painted all over.
//!
//!     cargo bench --bench epipolar [-- products|methods|sweeps|solve]
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench that cannot go on should stop")]
#![allow(clippy::print_stdout, reason = "figures are what it is for")]

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;
use unscatter::io::scene_file::load;
use unscatter::march::{
    EpipolarSettings, EpipolarTraversal, LightMapTransport, LightMapTraversal, Spacing, Traversal, ViewRay,
};
use unscatter::operator::{LinearOperator, TransportOperator};
use unscatter::problem::{
    DrawingMethod, DrawnView, LightMapProblem, Maps, Problem, ScatteredView, Transports, fit, near, solve,
};
use unscatter::scene::{Camera, Rgb, Scene, Strategy};
use unscatter::solve::Control;
use unscatter::visibility::Geometry;

const DEMOS: [&str; 3] = ["citadel", "nave", "forest"];
const PICTURE: EpipolarSettings = EpipolarSettings {
    slices: 1.0,
    density: 1.0,
    samples: 1024,
    tolerance: 1e-4,
    between: false,
    spacing: Spacing::Even,
};

fn main() {
    let asked: Vec<String> = std::env::args().skip(1).filter(|it| !it.starts_with("--")).collect();
    let is_asked = |name: &str| asked.is_empty() || asked.iter().any(|it| it == name);
    if is_asked("products") {
        products();
    }
    if is_asked("methods") {
        methods();
    }
    if is_asked("sweeps") {
        sweeps();
    }
    if is_asked("solve") {
        six_views();
    }
}

/// The rows of all pixels of the first view of a demo.
struct View {
    camera: Camera,
    rows: LightMapTraversal,
    texels: Vec<Rgb>,
    truth: Vec<[f64; 3]>,
    exact_seconds: f64,
}

impl View {
    fn new(name: &'static str, size: [usize; 2], map: usize) -> Self {
        let sets = [
            format!("views[0].camera.size={size:?}"),
            format!("shadow_map.size={map}"),
            format!("light_map.size={map}"),
        ];
        let scene = load(Path::new(&format!("strokes/{name}.json")), &sets).unwrap();
        let geometry = Arc::new(Geometry::new(scene.mesh.clone()).unwrap());
        let maps = fit(&scene, &scene.light_map, &geometry).unwrap();
        let camera = scene.views[0].camera.clone();
        let rows = rows(&scene, &maps, &camera);
        let [width, height] = maps.light_map.size;
        let texel = |k: usize| {
            let (x, y) = ((k % width) as f32 / width as f32, (k / width) as f32 / height as f32);
            [(12.0 * x).sin(), (9.0 * y).cos(), (20.0 * (x + y)).sin()].map(|value| 0.5 + 0.5 * value)
        };
        let texels: Vec<Rgb> = (0..width * height).map(texel).collect();
        let clock = Instant::now();
        let row = |row| Traversal::<f64, 1>::gather(&rows, row, &texels);
        let truth = (0..rows.rays().len()).into_par_iter().map(row).collect();
        let exact_seconds = clock.elapsed().as_secs_f64();
        Self { camera, rows, texels, truth, exact_seconds }
    }

    fn sliced(&self, settings: EpipolarSettings) -> (EpipolarTraversal, f64) {
        let clock = Instant::now();
        let width = self.camera.size()[0];
        // Angles change slowly over a picture.
        let [columns, lines] = self.camera.size().map(|side| side.div_ceil(16));
        let angle = |k: usize| self.camera.pixel_angle(k % columns * 16, k / columns * 16);
        let angles: Vec<f64> = (0..columns * lines).map(angle).collect();
        let angle = |row: usize| angles[row / width / 16 * columns + row % width / 16];
        let sliced = EpipolarTraversal::new(&self.rows, &angle, settings).unwrap();
        (sliced, clock.elapsed().as_secs_f64())
    }

    /// Median, 99 % and largest error relative to the brightest pixel, their root mean square, and the share within 1/255 of it.
    fn errors(&self, shown: &[Rgb]) -> [f64; 5] {
        let brightest = self.truth.iter().flatten().copied().fold(0.0, f64::max);
        let most =
            |(a, b): (&[f64; 3], &Rgb)| (0..3).map(|c| (a[c] - f64::from(b[c])).abs()).fold(0.0, f64::max);
        let mut errors: Vec<f64> = self.truth.iter().zip(shown).map(|pair| most(pair) / brightest).collect();
        errors.sort_by(f64::total_cmp);
        let squares: f64 = errors.iter().map(|error| error * error).sum();
        let count = errors.len();
        let within = errors.partition_point(|&error| error < 1.0 / 255.0);
        [
            errors[count / 2],
            errors[count * 99 / 100],
            errors[count - 1],
            (squares / count as f64).sqrt(),
            within as f64 / count as f64,
        ]
    }
}

fn rows(scene: &Scene, maps: &Maps, camera: &Camera) -> LightMapTraversal {
    let [width, height] = camera.size();
    let ray = |pixel: usize| {
        let ray = camera.pixel_ray(pixel % width, pixel / width);
        let hit = maps.geometry.first_hit(&ray, f64::INFINITY);
        maps.view_ray(&ray, hit.map_or(f64::INFINITY, |hit| hit.distance), &scene.medium).0
    };
    let rays: Vec<ViewRay> = (0..width * height).into_par_iter().map(ray).collect();
    let transport = LightMapTransport {
        sigma_t: scene.medium.sigma_t,
        shadow_map: maps.shadow_map.clone(),
        light_map: maps.light_map,
        basis: scene.solve.basis,
        quadrature: scene.solve.quadrature,
        transmittance_bound: scene.solve.transmittance_bound,
        mask: None,
    };
    LightMapTraversal::new(transport, rays.into())
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn timed<T>(trials: usize, mut make: impl FnMut() -> T) -> (T, f64) {
    let mut times = Vec::new();
    let mut made = None;
    for _ in 0..trials {
        let clock = Instant::now();
        made = Some(make());
        times.push(clock.elapsed().as_secs_f64());
    }
    (made.unwrap(), median(times))
}

/// Full HD: set-up, both products and errors, beside the exact rows, as maps grow.
fn products() {
    println!("1920 x 1080, first hits apart; errors relative to the brightest pixel");
    for name in DEMOS {
        for map in [512, 1024, 2048, 4096] {
            let view = View::new(name, [1920, 1080], map);
            for samples in [1024, 4096].into_iter().filter(|&samples| samples == 1024 || map > 1024) {
                let _warm = view.sliced(PICTURE);
                let (sliced, setup) = view.sliced(EpipolarSettings { samples, ..PICTURE });
                let (shown, forth) = timed(5, || sliced.shown(&view.texels));
                let y: Vec<Rgb> = (0..shown.len()).map(|k| [(k % 7) as f32; 3]).collect();
                let back =
                    || Traversal::<f64, 1>::scatter_rows::<f32>(&sliced, y.len(), &|row| (row, y[row]), 0);
                let (_, back) = timed(3, back);
                let [median, most_of, largest, rms, within] = view.errors(&shown);
                println!(
                    "  {name:8} {map:4}² {samples:4} samples: set-up {setup:.3} s, T x {forth:.3} s, Tᵀ y {back:.3} s, {:3} MiB; exact T x {:.2} s; \
                     error: median {median:.1e}, 99 % {most_of:.1e}, largest {largest:.1e}, rms {rms:.1e}, {:.3} % within 1/255",
                    sliced.bytes() >> 20,
                    view.exact_seconds,
                    100.0 * within
                );
            }
        }
    }
}

/// Every method in full HD, maps of 1024², under the plain light.
fn methods() {
    println!(
        "1920 x 1080, maps of 1024², plain light, first hits apart; errors relative to the brightest pixel"
    );
    for name in DEMOS {
        let sets = ["shadow_map.size=1024", "light_map.size=1024"].map(str::to_owned);
        let scene = load(Path::new(&format!("strokes/{name}.json")), &sets).unwrap();
        let geometry = Arc::new(Geometry::new(scene.mesh.clone()).unwrap());
        let maps = fit(&scene, &scene.light_map, &geometry).unwrap();
        let camera = scene.views[0].camera.moved(glam::DAffine3::IDENTITY, [1920, 1080]).unwrap();
        let view = ScatteredView::new(&scene, &maps, &camera);
        let truth = view.drawn(DrawingMethod::Exact, None).unwrap();
        let brightest = truth.pixels.iter().flatten().copied().fold(0.0, f32::max);
        for method in [
            "exact",
            "march:64",
            "march:256",
            "min-max:1024",
            "prefiltered:16",
            "prefiltered:32",
            "prefiltered:128",
            "epipolar:1024",
            "bilateral:32",
        ] {
            let drawn: Vec<DrawnView> =
                (0..2).map(|_| view.drawn(method.parse().unwrap(), None).unwrap()).collect();
            let least =
                |seconds: fn(&DrawnView) -> f64| drawn.iter().map(seconds).fold(f64::INFINITY, f64::min);
            let pairs = drawn[0].pixels.iter().flatten().zip(truth.pixels.iter().flatten());
            let squares: f64 = pairs.map(|(a, b)| f64::from((a - b) / brightest).powi(2)).sum();
            println!(
                "  {name:8} {method:16} set-up {:.3} s, picture {:.3} s, rms error {:.1e}, {:3} MiB",
                least(|it| it.set_up_seconds),
                least(|it| it.seconds),
                (squares / (3 * truth.pixels.len()) as f64).sqrt(),
                drawn[0].bytes >> 20
            );
        }
    }
}

/// Error against slices and samples, and against terms.
fn sweeps() {
    for name in DEMOS {
        let view = View::new(name, [960, 540], 1024);
        println!("{name}, 960 x 540, maps of 1024²: rms error relative to the brightest pixel");
        for times in [0.25, 0.5, 1.0, 2.0, 4.0] {
            let both = EpipolarSettings {
                slices: times,
                density: times,
                samples: 1 << 15,
                tolerance: 1e-7,
                ..PICTURE
            };
            let rms = |settings| {
                let (sliced, _) = view.sliced(settings);
                let (shown, seconds) = timed(3, || sliced.shown(&view.texels));
                (view.errors(&shown)[3], seconds)
            };
            let ((together, seconds), (slices, _), (samples, _), (between, _), (projective, _)) = (
                rms(both),
                rms(EpipolarSettings { density: 8.0, ..both }),
                rms(EpipolarSettings { slices: 8.0, ..both }),
                rms(EpipolarSettings { between: true, ..both }),
                rms(EpipolarSettings { spacing: Spacing::Projective, ..both }),
            );
            println!(
                "  {times:4} times as many slices and samples: {together:.1e} in {seconds:.3} s; slices alone {slices:.1e}, samples alone {samples:.1e}; \
                 between two slices {between:.1e}; in a projective map {projective:.1e}"
            );
        }
        let fine = view.sliced(EpipolarSettings { tolerance: 1e-9, ..PICTURE }).0.shown(&view.texels);
        for tolerance in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6] {
            let (sliced, _) = view.sliced(EpipolarSettings { tolerance, ..PICTURE });
            let brightest = fine.iter().flatten().copied().fold(0.0, f32::max);
            let shown = sliced.shown(&view.texels);
            let differences = fine.iter().flatten().zip(shown.iter().flatten()).map(|(a, b)| (a - b).abs());
            let largest = differences.fold(0.0, f32::max) / brightest;
            println!(
                "  tolerance {tolerance:.0e}: {} terms at most, largest error {largest:.1e}",
                sliced.fans().most_terms()
            );
        }
    }
}

/// Six views of the citadel that are painted all over: to a certificate of 1e-2 over slices, and with exact rows, both in the same metric.
fn six_views() {
    let scene = painted_all_over();
    let clock = Instant::now();
    let problem = LightMapProblem::new(&scene).unwrap();
    println!(
        "{} rows, {} texels; made in {:.1} s",
        problem.rows(),
        problem.elements(),
        clock.elapsed().as_secs_f64()
    );
    let budget = 0;
    let exact = problem.on_cpu(Strategy::MatrixFree, budget).unwrap();
    let clock = Instant::now();
    let coverage = exact.squares(&problem.weights()).unwrap();
    println!("coverage, which both need: {:.1} s", clock.elapsed().as_secs_f64());
    let clock = Instant::now();
    let sliced = near(&problem, Strategy::Epipolar).unwrap().unwrap();
    let over_slices = sliced.on_cpu(Strategy::Epipolar, budget).unwrap();
    let set_up = clock.elapsed().as_secs_f64();
    let (mut shown, mut back) = (over_slices.range(), over_slices.domain());
    let (_, forward) = timed(3, || over_slices.apply(&coverage, &mut shown).unwrap());
    let (_, backward) = timed(3, || over_slices.apply_adjoint(&shown, &mut back).unwrap());
    println!("products over slices: T x {forward:.2} s, Tᵀ y {backward:.2} s");
    let transports = Transports { exact: &exact, near: Some(&over_slices) };
    let clock = Instant::now();
    let solved =
        solve(&problem, transports, &coverage, &scene.solve, None, |_, _| Ok(Control::Continue)).unwrap();
    let seconds = clock.elapsed().as_secs_f64();
    let outcome = &solved.outcome;
    println!(
        "epipolar: set-up {set_up:.1} s, solved in {seconds:.1} s, {} iterations, {} corrections, certificate {:?}, {:?}; slices {} MiB",
        outcome.history.progress.len() - 1,
        outcome.history.restarts,
        outcome.true_normal_residual,
        outcome.stop.reason,
        (sliced.prepared_bytes() - problem.prepared_bytes()) >> 20
    );
    let clock = Instant::now();
    let mut iterations = 0;
    let patience = 4;
    let _ = solve(&problem, &exact, &coverage, &scene.solve, None, |history, _| {
        iterations = history.progress.len() - 1;
        Ok(if iterations >= patience { Control::Pause } else { Control::Continue })
    });
    let each = clock.elapsed().as_secs_f64() / (iterations + 1) as f64;
    println!("exact, walked: {each:.1} s an iteration and for its start, measured over {iterations}");
    let needed = outcome.history.progress.len() - 1;
    println!("  so about {:.0} s for as many iterations as over slices", each * (needed + 2) as f64);
}

fn painted_all_over() -> Scene {
    let text = std::fs::read_to_string("strokes/citadel.json").unwrap();
    let mut scene: serde_json::Value = serde_json::from_str(&text).unwrap();
    let colors = ["#f02818", "#ffd038", "#1890d8", "#20c8b0", "#c030f0", "#8fe040"];
    let [width, height] = [960.0, 540.0];
    let known = scene["views"].as_array().unwrap().clone();
    let view = |k: usize| {
        let mut view = known[k % known.len()].clone();
        view["name"] = format!("view-{k}").into();
        view["camera"]["size"] = serde_json::json!([960, 540]);
        if k >= known.len() {
            let origin = &mut view["camera"]["to_world"]["look_at"]["origin"];
            for (axis, by) in [1.5, 0.7, -1.0].into_iter().enumerate() {
                origin[axis] = (origin[axis].as_f64().unwrap() + by * (k / known.len()) as f64).into();
            }
        }
        let dot = |j: usize| {
            let at = [width * (j as f64 + 0.5) / 8.0, height * ((3 * j % 8) as f64 + 0.5) / 8.0];
            serde_json::json!({"points": [at], "radius": width / 9.0, "color": colors[(j + k) % 6]})
        };
        let ground = serde_json::json!({"points": [[width / 2.0, height / 2.0]], "radius": 4.0 * width, "color": colors[k % 6]});
        view["strokes"] = std::iter::once(ground).chain((0..8).map(dot)).collect();
        view
    };
    scene["views"] = (0..6).map(view).collect();
    let path = std::env::temp_dir().join(format!("unscatter-{}-six.json", std::process::id()));
    std::fs::write(&path, scene.to_string()).unwrap();
    let sets = ["light_map.size=2048", "shadow_map.size=2048", "solve.tolerance=1e-2", "solve.metric=sqs"]
        .map(str::to_owned);
    let scene = load(&path, &sets).unwrap();
    std::fs::remove_file(&path).unwrap();
    scene
}
