//! T and a whole iteration on a graphics adapter, for a list of sizes: rays, non-zeros and bytes a second.
//!
//!     cargo bench --bench gpu                      hardware where there is some, else a software adapter
//!     cargo bench --bench gpu -- large             and six views of 1920 × 1080, all painted, map 2048²
//!                                                  (without it software adapters are spared the medium size, too)
//!     cargo bench --bench gpu -- volume            only a volume of the size of Klehm 2015, fig. 7.3
//!     cargo bench --bench gpu -- adapter=NAME
//!
//! Seconds are the adapter's own where it has timestamps, the median of a few trials. Shares are of the bandwidth with which
//! it copies a long vector. What a product must at least move is counted: kept rows 8 bytes a non-zero, walked ones
//! 160 bytes a ray, and each vector once; an iteration two products, and each vector of the method read and written once.
//! Rays through volumes are in tiles of 8 × 8 pixels, as the command has them.
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench that cannot go on should stop")]
#![allow(clippy::print_stdout, reason = "figures are what it is for")]

use std::sync::Arc;
use std::time::Instant;

use glam::{DAffine3, DQuat, DVec2, DVec3};
use unscatter::Result;
use unscatter::cpu::{Rows, Transport as CpuTransport, WalkPlan};
use unscatter::gpu::{Choice, Gpu, GpuVector, Kept, RowTable, Transport, Walked};
use unscatter::march::{
    Density, LightMapTransport, LightMapTraversal, Part, PixelRays, Quantity, Traversal, ViewRay,
    VolumeTransport, VolumeTraversal,
};
use unscatter::operator::{Blocks, Identity, LinearOperator, Stacked, Vector};
use unscatter::scene::{
    Basis, Camera, Extent, FovAxis, Grid, Interpolation, LightFrame, Medium, Quadrature, Samples, ShadowMap,
    Strategy, Volume, VoxelGrid, look_at,
};
use unscatter::solve::{Beginning, Cgls, Control, LeastSquares, Limits, drive};

const TRIALS: usize = 3;
const ITERATIONS: usize = 32;
/// Software adapters take seconds for one.
const SOFTWARE_ITERATIONS: usize = 4;
const RAY: f64 = 160.0;
const NONZERO: f64 = 8.0;
const COLOR: f64 = 12.0;

/// A field of pillars under a slanted sun, seen by some cameras, of whose pixels every `stride`-th is painted.
struct Field {
    name: &'static str,
    cameras: usize,
    pixels: [usize; 2],
    stride: usize,
    map: usize,
}

const SIZES: [Field; 3] = [
    Field { name: "small", cameras: 3, pixels: [320, 180], stride: 17, map: 256 },
    Field { name: "paper", cameras: 3, pixels: [640, 360], stride: 17, map: 512 },
    Field { name: "medium", cameras: 6, pixels: [640, 360], stride: 5, map: 1024 },
];
const LARGE: Field = Field { name: "large", cameras: 6, pixels: [1920, 1080], stride: 1, map: 2048 };

impl Field {
    fn traversal(&self) -> LightMapTraversal {
        let frame = LightFrame::along(DVec3::new(0.5, -1.0, 0.3).normalize());
        let extent = Extent { min: DVec2::splat(-20.0), max: DVec2::splat(20.0) };
        let grid = Grid::new(extent, [self.map; 2]).unwrap();
        let depth = |k: usize| {
            let p = grid.centre(k % self.map, k / self.map);
            if (p.x * 1.7).sin() * (p.y * 0.9).cos() > 0.1 { -6.0 } else { f32::INFINITY }
        };
        let depths: Vec<f32> = (0..grid.len()).map(depth).collect();
        let medium = Medium::new([0.05; 3], [0.9; 3], 0.3).unwrap();
        let transport = LightMapTransport {
            sigma_t: medium.sigma_t,
            shadow_map: Arc::new(ShadowMap::new(grid, 0.0, &depths).unwrap()),
            light_map: grid,
            basis: Basis::Bilinear,
            quadrature: Quadrature::Exact,
            transmittance_bound: f64::powi(2.0, -24),
            mask: None,
        };
        let mut rays = Vec::new();
        for view in 0..self.cameras {
            let angle = view as f64 / self.cameras as f64 * std::f64::consts::TAU;
            let eye = DVec3::new(17.0 * angle.cos(), 2.0 + view as f64, 17.0 * angle.sin());
            let world = look_at(eye, DVec3::ZERO, DVec3::Y).unwrap();
            let camera = Camera::new(world, 60.0, FovAxis::X, self.pixels).unwrap();
            let [width, height] = self.pixels;
            let pixels = (0..width * height).step_by(self.stride);
            rays.extend(
                pixels.map(|k| ViewRay::new(&camera.pixel_ray(k % width, k / width), 32.0, &frame, &medium)),
            );
        }
        LightMapTraversal::new(transport, rays.into())
    }
}

/// The rows as the processor keeps them, and how often the texel that most rays meet is met.
fn table<T: Traversal<f64, 1> + Clone>(traversal: &T, plan: &WalkPlan) -> (RowTable, usize) {
    let kept =
        CpuTransport::<_, f32, 1>::new(traversal.clone(), plan, Strategy::Assembled, u64::MAX).unwrap();
    let mut table = RowTable { offsets: vec![0], elements: Vec::new(), weights: vec![Vec::new()] };
    let mut met = vec![0; traversal.elements()];
    for row in 0..Rows::<f32, 1>::rows(&kept) {
        kept.visit(row, &mut |element, [weight]: [f32; 1]| {
            met[element] += 1;
            table.elements.push(element as u32);
            table.weights[0].push(weight);
        });
        table.offsets.push(table.elements.len());
    }
    (table, met.into_iter().max().unwrap_or(0))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The median of the seconds that the adapter takes for some work.
fn seconds(gpu: &Gpu, mut work: impl FnMut() -> Result<()>) -> f64 {
    work().unwrap();
    let mut once = || {
        let clock = Instant::now();
        let own = gpu.seconds(&mut work).unwrap();
        gpu.finish().unwrap();
        own.unwrap_or_else(|| clock.elapsed().as_secs_f64())
    };
    median((0..TRIALS).map(|_| once()).collect())
}

/// Bytes a second that the adapter copies, reading and writing counted.
fn bandwidth(gpu: &Gpu) -> f64 {
    let elements = (gpu.record().binding_limit / 16).min(16 << 20) as usize;
    let (mut to, from) = (GpuVector::zeros(gpu, elements), GpuVector::zeros(gpu, elements));
    let seconds = seconds(gpu, || {
        to.copy_from(&from);
        Ok(())
    });
    2.0 * COLOR * elements as f64 / seconds
}

/// Seconds of the clock that an iteration of conjugate gradients takes, and how often it waits.
fn iteration(gpu: &Gpu, operator: &Transport) -> [f64; 2] {
    let pull = Identity::scaled(&operator.domain(), [0.05; 3]);
    let stacked = Stacked::new(operator).over(pull).unwrap();
    let mut targets = operator.range();
    targets.fill([0.02, 0.01, 0.03]);
    let rhs = Blocks(vec![targets, operator.domain()]);
    let mut method = Cgls::new(&stacked);
    let iterations = if gpu.record().is_hardware() { ITERATIONS } else { SOFTWARE_ITERATIONS };
    let limits = Limits::new(iterations, 0.0);
    let problem = LeastSquares::new(&stacked, &rhs);
    let start = stacked.domain();
    let mut marks = Vec::new();
    drive(&mut method, &problem, Beginning::At(&start), &limits, |_, _| {
        marks.push((Instant::now(), gpu.round_trips()));
        Ok(Control::Continue)
    })
    .unwrap();
    let [(begun, trips), .., (ended, all_trips)] = marks[..] else { return [f64::NAN; 2] };
    let iterations = (marks.len() - 1) as f64;
    [(ended - begun).as_secs_f64() / iterations, (all_trips - trips) as f64 / iterations]
}

/// A blob with waves on it, 18 % of a cube of 128³ voxels, seen by 2 cameras of 480 × 480 pixels.
fn blob(basis: Interpolation) -> VolumeTraversal {
    const SIDE: u32 = 480;
    let cube = DAffine3::from_scale_rotation_translation(DVec3::splat(2.0), DQuat::IDENTITY, DVec3::NEG_ONE);
    let grid = VoxelGrid::over_cube([128; 3], cube).unwrap();
    let sigma_t = |index: usize| {
        let p = grid.centre(grid.voxel(index));
        let waves = 0.4 * (7.0 * p.x).sin() * (9.0 * p.y).sin() * (8.0 * p.z).sin();
        6.0 * (1.0 - 2.0 * p.length_squared() + waves).max(0.0)
    };
    let samples = Samples::F32((0..grid.len()).map(|index| sigma_t(index) as f32).collect());
    let density = Arc::new(Density::new(Arc::new(Volume::new(grid, 1, samples).unwrap()), basis));
    let camera = |eye: DVec3| {
        Camera::new(look_at(eye, DVec3::ZERO, DVec3::Y).unwrap(), 53.0, FovAxis::Y, [SIDE as usize; 2])
            .unwrap()
    };
    let cameras = [DVec3::new(0.0, 0.0, -3.0), DVec3::new(-3.0, 0.0, 0.0)].map(camera);
    let pixel = |n: u32| {
        let (tile, inside) = (n / 64, n % 64);
        let (x, y) = (tile % (SIDE / 8) * 8 + inside % 8, tile / (SIDE / 8) * 8 + inside / 8);
        y * SIDE + x
    };
    let pixels: Vec<[u32; 2]> =
        (0..2).flat_map(|view| (0..SIDE * SIDE).map(move |n| [view, pixel(n)])).collect();
    let some = Arc::new(grid.set(|index| sigma_t(index) > 0.0));
    let part = Part::new(Quantity::Emission, grid, some, basis);
    let transport = VolumeTransport {
        density,
        basis,
        quadrature: Quadrature::Exact,
        transmittance_bound: f64::powi(2.0, -24),
        refraction: None,
    };
    VolumeTraversal::new(transport, PixelRays::new(cameras.into(), pixels, Vec::new().into()), vec![part])
}

/// Emission of a volume, walked and from kept rows.
fn volume(gpu: &Gpu) {
    println!(
        "{:<12}{:<16}{:>9}{:>11}{:>12}{:>11}",
        "volume", "rows are", "rays", "elements", "gather ms", "scatter ms"
    );
    for (name, basis) in [("nearest", Interpolation::Nearest), ("trilinear", Interpolation::Trilinear)] {
        let traversal = blob(basis);
        let (rows, elements) = (traversal.rays().len(), traversal.parts()[0].voxels().len());
        let walked = |deterministic| {
            let walked = Walked::volume(gpu, &traversal, false, deterministic).unwrap();
            Transport::Walked(walked)
        };
        let kept = || {
            let (table, _) = table(&traversal, &WalkPlan::new::<f32, 1>(&traversal));
            Transport::Kept(Kept::new(gpu, table, elements).unwrap())
        };
        // One at a time: each takes memory.
        let ways: [(&str, &dyn Fn() -> Transport); 3] =
            [("walked", &|| walked(false)), ("walked, fixed", &|| walked(true)), ("kept", &kept)];
        for (way, operator) in ways {
            let operator = operator();
            let (mut x, mut y) = (operator.domain(), operator.range());
            x.fill([1.0, 0.5, 0.25]);
            let gather = seconds(gpu, || operator.apply(&x, &mut y));
            let scatter = seconds(gpu, || operator.apply_adjoint(&y, &mut x));
            println!(
                "{name:<12}{way:<16}{rows:>9}{elements:>11}{:>12.3}{:>11.3}",
                1e3 * gather,
                1e3 * scatter
            );
        }
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let name = arguments.iter().find_map(|argument| argument.strip_prefix("adapter=").map(str::to_owned));
    let choice = Choice { name, software: true, ..Choice::default() };
    // One texel after the other, or those around the eye inside a workgroup first.
    let gpu = Gpu::open(&Choice { sums_near: Some(false), ..choice.clone() }).unwrap();
    let near = Gpu::open(&Choice { sums_near: Some(true), ..choice }).unwrap();
    let copied = bandwidth(&gpu);
    let record = gpu.record();
    println!("{} ({}, {}), copies {:.1} GB/s", record.name, record.kind, record.driver, copied * 1e-9);
    if arguments.iter().any(|argument| argument == "volume") {
        return volume(&gpu);
    }
    println!(
        "{:<8}{:<13}{:>9}{:>9}{:>11}{:>9}{:>9}{:>8}{:>11}{:>9}{:>9}{:>8}{:>11}{:>8}{:>8}",
        "size",
        "rows are",
        "rays",
        "Mnnz",
        "gather ms",
        "Mrays/s",
        "Mnnz/s",
        "share",
        "scatter ms",
        "Mrays/s",
        "Mnnz/s",
        "share",
        "iter ms",
        "share",
        "waits"
    );
    let large = arguments.iter().any(|argument| argument == "large");
    let usual = if large || record.is_hardware() { &SIZES[..] } else { &SIZES[..2] };
    for field in usual.iter().chain(large.then_some(&LARGE)) {
        let traversal = field.traversal();
        let plan = WalkPlan::new::<f32, 1>(&traversal);
        let elements = traversal.transport().light_map.len();
        let rows = Traversal::<f64, 1>::rows(&traversal);
        let mut nonzeros = plan.nonzeros as f64;
        let mut ways: Vec<(&str, Transport)> = Vec::new();
        if plan.nonzeros < 400_000_000 {
            let (table, met) = table(&traversal, &plan);
            nonzeros = table.elements.len() as f64;
            println!("{:<8}one texel is met by {met} of {rows} rays", field.name);
            ways.push(("kept", Transport::Kept(Kept::new(&gpu, table, elements).unwrap())));
        }
        for (name, gpu, deterministic) in
            [("walked", &gpu, false), ("walked, near", &near, false), ("walked, fixed", &gpu, true)]
        {
            let walked = Walked::light_map(gpu, &traversal, false, deterministic).unwrap();
            ways.push((name, Transport::Walked(walked)));
        }
        for (name, operator) in ways {
            let (mut x, mut y) = (operator.domain(), operator.range());
            x.fill([1.0, 0.5, 0.25]);
            let gpu = if name == "walked, near" { &near } else { &gpu };
            let gather = seconds(gpu, || operator.apply(&x, &mut y));
            let scatter = seconds(gpu, || operator.apply_adjoint(&y, &mut x));
            let [seconds, waits] = iteration(gpu, &operator);
            let matrix = if name == "kept" { NONZERO * nonzeros } else { RAY * rows as f64 };
            let moved = matrix + COLOR * (rows + elements) as f64;
            let [rays, terms] = [rows as f64 * 1e-6, nonzeros * 1e-6];
            let of = |moved: f64, seconds: f64| format!("{:.0} %", 100.0 * moved / seconds / copied);
            let share = |seconds: f64| of(moved, seconds);
            let kept = Cgls::<Stacked<GpuVector>>::VECTORS;
            let vectors = (kept.domain * elements + kept.range * (rows + elements)) as f64;
            let in_iteration = 2.0 * moved + 2.0 * COLOR * vectors;
            println!(
                "{:<8}{name:<13}{rows:>9}{terms:>9.2}{:>11.3}{:>9.2}{:>9.0}{:>8}{:>11.3}{:>9.2}{:>9.0}{:>8}{:>11.3}{:>8}{waits:>8.1}",
                field.name,
                1e3 * gather,
                rays / gather,
                terms / gather,
                share(gather),
                1e3 * scatter,
                rays / scatter,
                terms / scatter,
                share(scatter),
                1e3 * seconds,
                of(in_iteration, seconds),
            );
        }
    }
}
