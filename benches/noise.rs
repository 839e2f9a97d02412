//! Volumes behind noisy pictures: how far off the volume is, and how far its pictures.
//!
//!     cargo bench --bench noise [-- --quick]
//!
//! A phantom like Shepp and Logan's (Kak and Slaney 1988, tab. 3.1) of 128³ voxels in 32 views of 96 × 96, looked for at 64³, with normal
//! noise of 0 to 5 % of what is behind it. Three problems: its extinction, the same refined, and emission and albedo together.
//! Beside them stand SIRT (Gregor and Benson 2008) and CGLS on the same rows, from the same start, without weights, bounds (CGLS) or pull. They
//! are given what nobody has: they stop at the iteration whose volume is nearest to the truth.
//! Errors are ‖x − x*‖ / ‖x*‖, of the volume against the phantom at 64³, of pictures against those without noise.
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench that cannot go on should stop")]
#![allow(clippy::print_stdout, reason = "figures are what it is for")]
#![allow(unreachable_pub, reason = "nothing here is public")]

#[path = "../tests/scenes/mod.rs"]
mod scenes;

use std::sync::Arc;
use std::time::Instant;

use glam::{DAffine3, DQuat, DVec3};
use scenes::Numbers;
use scenes::volume::{pictures_in, problem, scene, wanted};
use unscatter::job::{Job, Options, Quiet};
use unscatter::operator::{Blocks, CpuVector, LinearOperator, OnHost, Stacked, Vector};
use unscatter::problem::{Problem, VolumeProblem, VolumeState};
use unscatter::scene::{
    Camera, DirectionalLight, Environment, Find, FovAxis, Image, Interpolation, Regularization, Rgb,
    RgbaImage, Samples, SolveSettings, Strategy, Volume, VolumeMedium, VolumeScene, VoxelGrid, look_at,
};
use unscatter::solve::{Beginning, Cgls, Control, LeastSquares, Limits, Method, drive};

/// Value, half axes, centre and turn in degrees of each ellipsoid.
const ELLIPSOIDS: [(f64, [f64; 3], [f64; 3], f64); 10] = [
    (1.0, [0.69, 0.92, 0.81], [0.0, 0.0, 0.0], 0.0),
    (-0.8, [0.6624, 0.874, 0.78], [0.0, -0.0184, 0.0], 0.0),
    (-0.1, [0.11, 0.31, 0.22], [0.22, 0.0, 0.0], -18.0),
    (-0.1, [0.16, 0.41, 0.28], [-0.22, 0.0, 0.0], 18.0),
    (0.2, [0.21, 0.25, 0.41], [0.0, 0.35, -0.15], 0.0),
    (0.2, [0.046, 0.046, 0.05], [0.0, 0.1, 0.25], 0.0),
    (0.2, [0.046, 0.046, 0.05], [0.0, -0.1, 0.25], 0.0),
    (0.2, [0.046, 0.023, 0.05], [-0.08, -0.605, 0.0], 0.0),
    (0.2, [0.023, 0.023, 0.02], [0.0, -0.606, 0.0], 0.0),
    (0.2, [0.023, 0.046, 0.02], [0.06, -0.605, 0.0], 0.0),
];

const NOISES: [f64; 6] = [0.0, 0.001, 0.005, 0.01, 0.02, 0.05];
/// Iterations among which SIRT and CGLS choose their best.
const TRIED: [usize; 2] = [300, 60];

fn main() {
    let is_quick = std::env::args().any(|argument| argument == "--quick");
    let (side, views, width) = if is_quick { (32, 16, 48) } else { (64, 32, 96) };
    for joint in [false, true] {
        let measured = Measured::new(side, views, width, joint);
        println!("\n{}\n", if joint { "emission and albedo together" } else { "extinction" });
        println!("| noise | method | volume | pictures | iterations | seconds |\n|---|---|---|---|---|---|");
        for noise in NOISES {
            measured.row(noise);
        }
    }
}

fn grid(side: usize) -> VoxelGrid {
    let cube = DAffine3::from_scale_rotation_translation(DVec3::splat(2.0), DQuat::IDENTITY, DVec3::NEG_ONE);
    VoxelGrid::over_cube([side; 3], cube).unwrap()
}

/// The phantom, the mean of 2³ points a voxel.
fn phantom(side: usize) -> Volume {
    let fine = grid(2 * side);
    let value = |p: DVec3| {
        let of = |&(value, axes, centre, turn): &(f64, [f64; 3], [f64; 3], f64)| {
            let p = DQuat::from_rotation_z(-f64::to_radians(turn)) * (p - DVec3::from_array(centre));
            let is_inside = (p / DVec3::from_array(axes)).length_squared() <= 1.0;
            if is_inside { value } else { 0.0 }
        };
        ELLIPSOIDS.iter().map(of).sum::<f64>().max(0.0)
    };
    let coarse = grid(side);
    let mean = |index: usize| {
        let [x, y, z] = coarse.voxel(index);
        let corners = (0..8).map(|k| [2 * x + (k & 1), 2 * y + (k >> 1 & 1), 2 * z + (k >> 2)]);
        (corners.map(|voxel| value(fine.centre(voxel))).sum::<f64>() / 8.0) as f32
    };
    Volume::new(coarse, 1, Samples::F32((0..coarse.len()).map(mean).collect())).unwrap()
}

fn constant(like: &Volume, value: f32) -> Arc<Volume> {
    Arc::new(Volume::constant(*like.grid(), [value; 3]).unwrap())
}

/// A phantom, its pictures, and the scene in which it is looked for.
struct Measured {
    scene: VolumeScene,
    /// At the resolution at which it is looked for.
    truth: VolumeMedium,
    clean: Vec<Image>,
    find: Find,
}

impl Measured {
    fn new(side: usize, views: usize, width: usize, joint: bool) -> Self {
        let medium = |side| {
            let extinction = Arc::new(phantom(side));
            let some = |scale: f32| Arc::new(extinction.map(|value| (scale * value).min(1.0)).unwrap());
            VolumeMedium {
                // What glows is what is dense; what scatters is the other way round.
                emission: if joint { some(0.5) } else { constant(&extinction, 0.0) },
                albedo: match joint {
                    true => Arc::new(extinction.map(|value| (0.9 - value).max(0.0)).unwrap()),
                    false => constant(&extinction, 0.0),
                },
                extinction,
                g: 0.0,
                interpolation: Interpolation::Nearest,
                refraction: None,
            }
        };
        let camera = |view: usize| {
            let turn = DQuat::from_rotation_y(std::f64::consts::TAU * view as f64 / views as f64);
            let world = look_at(turn * DVec3::Z * 6.0, DVec3::ZERO, DVec3::Y).unwrap();
            Camera::new(world, 24.0, FovAxis::Y, [width; 2]).unwrap()
        };
        let (fine, truth) = (medium(2 * side), medium(side));
        let find = if joint { Find::Joint } else { Find::Extinction };
        let dark = Environment::constant([0.0; 3], 1).unwrap();
        let mut seen = scene(fine, dark, (0..views).map(camera).collect());
        if joint {
            seen.lights.push(DirectionalLight::new(DVec3::new(0.3, -1.0, -0.4), [8.0; 3]).unwrap());
        }
        seen.background = Some([if joint { 0.0 } else { 1.0 }; 3]);
        seen.stages = vec![find];
        let clean = pictures_in(&seen, &VolumeState::of(&seen).unwrap(), find);
        let searched = match joint {
            true => VolumeMedium {
                emission: constant(&truth.extinction, 0.0),
                albedo: constant(&truth.extinction, 0.5),
                ..truth.clone()
            },
            false => VolumeMedium { extinction: constant(&truth.extinction, 0.3), ..truth.clone() },
        };
        let solve = SolveSettings { regularization: Regularization::default(), ..SolveSettings::default() };
        Self { scene: VolumeScene { medium: searched, solve, ..seen }, truth, clean, find }
    }

    /// The pictures with noise, as a part of the background; where there is none, of the root mean square of the pictures.
    fn noisy(&self, noise: f64) -> Vec<Image> {
        let mut n = Numbers(7);
        let squares: f64 =
            self.clean.iter().flat_map(|image| &image.pixels).map(|c| f64::from(c[1]).powi(2)).sum();
        let count = self.clean.iter().map(|image| image.pixels.len()).sum::<usize>() as f64;
        let scale = if self.find == Find::Joint { (squares / count).sqrt() } else { 1.0 };
        let mut normal = || (0..12).map(|_| n.uniform(0.0, 1.0)).sum::<f64>() - 6.0;
        let mut pixel = |color: &Rgb| {
            // A camera that counts the same photons in all channels: grey pictures stay grey.
            let by = noise * scale * normal();
            color.map(|value| {
                (f64::from(value) + by).max(if self.find == Find::Joint { f64::NEG_INFINITY } else { 1e-4 })
                    as f32
            })
        };
        let mut picture =
            |image: &Image| Image::new(image.size(), image.pixels.iter().map(&mut pixel).collect()).unwrap();
        self.clean.iter().map(&mut picture).collect()
    }

    fn row(&self, noise: f64) {
        let noisy = self.noisy(noise);
        let desired = wanted(&noisy);
        let say = |method: &str, [volume, pictures]: [f64; 2], iterations: String, seconds: f64| {
            let percent = 100.0 * noise;
            println!(
                "| {percent} % | {method} | {volume:.3} | {pictures:.4} | {iterations} | {seconds:.1} |"
            );
        };
        let stages: &[(&str, &[Find])] = match self.find {
            Find::Joint => &[("unscatter", &[Find::Joint])],
            _ => &[
                ("unscatter, extinction", &[Find::Extinction]),
                ("unscatter, refined", &[Find::Extinction, Find::Refinement]),
            ],
        };
        for (name, stages) in stages {
            // Only extinction stops by itself.
            let ways = [("", None), (", followed", Some(0.0))];
            for (how, told) in ways.into_iter().take(if self.find == Find::Joint { 1 } else { 2 }) {
                let (errors, iterations, seconds) = self.by_job(&noisy, stages, told);
                say(&format!("{name}{how}"), errors, iterations, seconds);
            }
        }
        let problem = problem(&self.scene, &desired, self.find);
        let operator = problem.on_cpu(Strategy::Auto, u64::MAX).unwrap();
        for (name, best) in [
            ("SIRT at its best", self.sirt(&problem, &operator)),
            ("CGLS at its best", self.cgls(&problem, &operator)),
        ] {
            say(
                name,
                self.errors(&self.applied(&problem, &best.x)),
                best.iteration.to_string(),
                best.seconds,
            );
        }
    }

    /// As the command does it.
    fn by_job(&self, noisy: &[Image], stages: &[Find], noise: Option<f64>) -> ([f64; 2], String, f64) {
        let mut scene = VolumeScene { stages: stages.to_vec(), ..self.scene.clone() };
        scene.solve.noise = noise;
        for (view, picture) in scene.views.iter_mut().zip(noisy) {
            let pixels = picture.pixels.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect();
            view.picture = Some(RgbaImage::new(picture.size(), pixels).unwrap());
        }
        let options = Options { pictures: false, turntable: 0, ..Options::default() };
        let clock = Instant::now();
        let found = Job::new(scene).with(options).solve(&mut Quiet).unwrap();
        let seconds = clock.elapsed().as_secs_f64();
        let iterations: Vec<String> =
            found.report().stages.iter().map(|stage| stage.stop.iteration.to_string()).collect();
        (self.errors(found.volume().unwrap()), iterations.join(" + "), seconds)
    }

    fn applied(&self, problem: &VolumeProblem, x: &[Rgb]) -> VolumeState {
        problem.apply(&VolumeState::of(&self.scene).unwrap(), x).unwrap()
    }

    /// Of the volume, and of its pictures.
    fn errors(&self, state: &VolumeState) -> [f64; 2] {
        let pixels =
            |images: &[Image]| images.iter().flat_map(|image| image.pixels.clone()).collect::<Vec<_>>();
        let shown = pictures_in(&self.scene, state, self.find);
        [self.of_volume(&state.medium), relative(&pixels(&shown), &pixels(&self.clean))]
    }

    fn of_volume(&self, found: &VolumeMedium) -> f64 {
        let colors = |volume: &Volume| (0..volume.grid().len()).map(|index| volume.color(index)).collect();
        let all = |medium: &VolumeMedium| -> Vec<Rgb> {
            // What is not dense is not seen.
            let dense = |index: &usize| self.truth.extinction.color(*index)[0] > 0.0;
            let of = |volume: &Volume| {
                let colors: Vec<Rgb> = colors(volume);
                (0..colors.len()).filter(dense).map(|index| colors[index]).collect::<Vec<Rgb>>()
            };
            match self.find {
                Find::Joint => [of(&medium.emission), of(&medium.albedo)].concat(),
                _ => colors(&medium.extinction),
            }
        };
        relative(&all(found), &all(&self.truth))
    }
}

/// The iterate whose volume is nearest to the truth.
struct Best {
    x: Vec<Rgb>,
    error: f64,
    iteration: usize,
    seconds: f64,
}

impl Best {
    fn of(start: &[Rgb]) -> Self {
        Self { x: start.to_vec(), error: f64::INFINITY, iteration: 0, seconds: 0.0 }
    }

    fn see(&mut self, measured: &Measured, problem: &VolumeProblem, x: &[Rgb], at: (usize, f64)) {
        let error = measured.of_volume(&measured.applied(problem, x).medium);
        if error < self.error {
            *self = Self { x: x.to_vec(), error, iteration: at.0, seconds: at.1 };
        }
    }
}

impl Measured {
    /// x ← max(0, x + C Tᵀ R (b − T x)), R and C the inverse sums of rows and columns.
    fn sirt(&self, problem: &VolumeProblem, operator: &OnHost) -> Best {
        let inverse = |sums: &mut [Rgb]| {
            sums.iter_mut().flatten().for_each(|sum| *sum = if *sum > 0.0 { 1.0 / *sum } else { 0.0 });
        };
        let (mut x, mut y, mut step) = (operator.domain(), operator.range(), operator.domain());
        let (mut of_rows, mut of_columns) = (operator.range(), operator.domain());
        x.fill([1.0; 3]);
        y.fill([1.0; 3]);
        operator.apply(&x, &mut of_rows).unwrap();
        operator.apply_adjoint(&y, &mut of_columns).unwrap();
        inverse(&mut of_rows.0);
        inverse(&mut of_columns.0);
        x.0.copy_from_slice(&problem.start);
        let (mut best, mut seconds) = (Best::of(&problem.start), 0.0);
        for iteration in 1..=TRIED[0] {
            let clock = Instant::now();
            operator.apply(&x, &mut y).unwrap();
            for ((shown, wanted), inverse) in y.0.iter_mut().zip(&problem.targets).zip(&of_rows.0) {
                (0..3).for_each(|c| shown[c] = inverse[c] * (wanted[c] - shown[c]));
            }
            operator.apply_adjoint(&y, &mut step).unwrap();
            for ((x, step), inverse) in x.0.iter_mut().zip(&step.0).zip(&of_columns.0) {
                (0..3).for_each(|c| x[c] = (x[c] + inverse[c] * step[c]).max(0.0));
            }
            seconds += clock.elapsed().as_secs_f64();
            best.see(self, problem, &x.0, (iteration, seconds));
        }
        best
    }

    fn cgls(&self, problem: &VolumeProblem, operator: &OnHost) -> Best {
        let mut start = operator.domain();
        start.0.copy_from_slice(&problem.start);
        let stacked = Stacked::new(operator);
        let rhs = Blocks::new(CpuVector(problem.targets.clone()), Vec::new());
        let problem_of_rows = LeastSquares::new(&stacked, &rhs);
        let (mut best, mut seconds, mut clock) = (Best::of(&problem.start), 0.0, Instant::now());
        let mut method = Cgls::new(&stacked);
        let limits = Limits::new(TRIED[1], 0.0);
        let each = |history: &unscatter::solve::History, method: &mut Cgls<Stacked<CpuVector>>| {
            seconds += clock.elapsed().as_secs_f64();
            best.see(self, problem, &method.solution().0, (history.progress.len() - 1, seconds));
            clock = Instant::now();
            Ok(Control::Continue)
        };
        drive(&mut method, &problem_of_rows, Beginning::At(&start), &limits, each).unwrap();
        best
    }
}

/// ‖a − b‖ / ‖b‖.
fn relative(a: &[Rgb], b: &[Rgb]) -> f64 {
    let square = |value: f32| f64::from(value).powi(2);
    let miss: f64 = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| square(a - b)).sum();
    (miss / b.iter().flatten().map(|&b| square(b)).sum::<f64>()).sqrt()
}
