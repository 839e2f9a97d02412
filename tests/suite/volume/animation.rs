//! From key frames to all frames: diffusion into empty space, and blending.

use nalgebra::{DMatrix, DVector};
use unscatter::Error;
use unscatter::problem::{Determined, Known, Occupied, Spreading, VolumeState, diffuse};
use unscatter::scene::{Environment, Find, Rgb, VolumeMedium, VolumeScene, look_at};
use unscatter::solve::Limits;

use super::scene::{colors, picture_error, pictures, problem, solved_state, wanted};
use super::*;
use crate::tolerances::{DIFFUSED, VOLUME_PICTURES};

fn limits() -> Limits {
    Limits::new(5000, 1e-8)
}

/// A lattice of which some places are known, some empty, and some not there.
struct Case {
    size: [usize; 3],
    known: Vec<u32>,
    colors: Vec<Rgb>,
    empty: Vec<u32>,
}

impl Case {
    fn random(seed: u64, size: [usize; 3]) -> Self {
        let mut n = numbers(seed);
        let mut case = Self { size, known: Vec::new(), colors: Vec::new(), empty: Vec::new() };
        for place in 0..size.iter().product::<usize>() as u32 {
            match n.next() % 10 {
                0 | 1 => {
                    case.known.push(place);
                    case.colors.push(std::array::from_fn(|_| n.uniform(-1.0, 2.0) as f32));
                }
                2 => {}
                _ => case.empty.push(place),
            }
        }
        case
    }

    fn diffused(&self) -> Vec<Rgb> {
        let known = Known { places: &self.known, colors: &self.colors };
        diffuse::<f64>(&self.size, &known, &self.empty, &limits()).unwrap().colors
    }

    /// The colours of all places that are there, and the places beside each empty one.
    fn neighbours(&self, diffused: &[Rgb]) -> (Vec<Option<Rgb>>, Vec<Vec<usize>>) {
        let mut all = vec![None; self.size.iter().product()];
        let places = self.known.iter().zip(&self.colors).chain(self.empty.iter().zip(diffused));
        places.for_each(|(&place, &color)| all[place as usize] = Some(color));
        let beside = |&place: &u32| {
            let place = place as usize;
            let [x, y, _] = self.size;
            let at = [place % x, place / x % y, place / x / y];
            let mut beside = Vec::new();
            for (axis, stride) in [1, x, x * y].into_iter().enumerate() {
                if at[axis] > 0 {
                    beside.push(place - stride);
                }
                if at[axis] + 1 < self.size[axis] {
                    beside.push(place + stride);
                }
            }
            beside.retain(|&other| all[other].is_some());
            beside
        };
        let beside = self.empty.iter().map(beside).collect();
        (all, beside)
    }

    /// The largest |Σ over neighbours of x − x'|.
    fn laplacian(&self, diffused: &[Rgb]) -> f64 {
        let (all, beside) = self.neighbours(diffused);
        let mut worst = 0.0f64;
        for (color, beside) in diffused.iter().zip(&beside) {
            for c in 0..3 {
                let value = |place: usize| f64::from(all[place].unwrap()[c]);
                let sum: f64 = beside.iter().map(|&other| f64::from(color[c]) - value(other)).sum();
                worst = worst.max(sum.abs());
            }
        }
        worst
    }
}

#[test]
fn what_diffuses_is_harmonic_and_stays_inside_what_is_known() {
    for (seed, size) in [(1, [13, 11, 9]), (2, [40, 3, 5]), (3, [1, 24, 24])] {
        let case = Case::random(seed, size);
        let mut diffused = case.diffused();
        assert!(case.laplacian(&diffused) < DIFFUSED, "{}", case.laplacian(&diffused));
        for c in 0..3 {
            let known = case.colors.iter().map(|color| color[c]);
            let (low, high) =
                (known.clone().fold(f32::INFINITY, f32::min), known.fold(f32::NEG_INFINITY, f32::max));
            assert!(diffused.iter().all(|color| (low..=high).contains(&color[c])));
        }
        let middle = diffused.len() / 2;
        diffused[middle][1] += 1e-4;
        assert!(case.laplacian(&diffused) > DIFFUSED, "a value that is off by 1e-4");
    }
}

#[test]
fn diffusion_agrees_with_a_dense_solve() {
    let case = Case::random(4, [6, 5, 4]);
    let diffused = case.diffused();
    let (all, beside) = case.neighbours(&diffused);
    let number = |place: usize| case.empty.iter().position(|&empty| empty as usize == place);
    let count = case.empty.len();
    let (mut matrix, mut rhs) = (DMatrix::<f64>::zeros(count, count), DMatrix::<f64>::zeros(count, 3));
    for (row, beside) in beside.iter().enumerate() {
        matrix[(row, row)] = beside.len() as f64;
        for &other in beside {
            match number(other) {
                Some(column) => matrix[(row, column)] = -1.0,
                None => (0..3).for_each(|c| rhs[(row, c)] += f64::from(all[other].unwrap()[c])),
            }
        }
    }
    let lu = matrix.lu();
    for c in 0..3 {
        let truth = lu.solve(&DVector::from(rhs.column(c))).unwrap();
        for (diffused, truth) in diffused.iter().zip(truth.iter()) {
            assert!((f64::from(diffused[c]) - truth).abs() < DIFFUSED);
        }
    }
}

#[test]
fn between_two_ends_it_is_linear_and_beyond_them_constant() {
    let known = Known { places: &[3, 19], colors: &[[0.0, 4.0, 1.0], [8.0, -4.0, 1.0]] };
    let empty: Vec<u32> = (0..24).filter(|place| ![3, 19].contains(place)).collect();
    let diffused = diffuse::<f64>(&[24], &known, &empty, &limits()).unwrap();
    for (&place, color) in empty.iter().zip(&diffused.colors) {
        let u = (f64::from(place) - 3.0).clamp(0.0, 16.0) / 16.0;
        for (value, truth) in color.iter().zip([8.0 * u, 4.0 - 8.0 * u, 1.0]) {
            assert!((f64::from(*value) - truth).abs() < 8.0 * DIFFUSED, "{place}: {value} and {truth}");
        }
    }
}

#[test]
fn islands_are_alike_and_like_what_is_near() {
    // Known on the left; an island of two places far on the right.
    let known = Known { places: &[0, 1], colors: &[[1.0; 3], [3.0; 3]] };
    let diffused = diffuse::<f64>(&[16], &known, &[2, 12, 13], &limits()).unwrap().colors;
    assert!((diffused[0][0] - 3.0).abs() < 1e-6);
    assert!((diffused[1][0] - 2.0).abs() < 1e-6 && (diffused[2][0] - 2.0).abs() < 1e-6, "{diffused:?}");
    let nothing = Known { places: &[], colors: &[] };
    assert!(matches!(diffuse::<f64>(&[16], &nothing, &[2], &limits()), Err(Error::Empty { .. })));
}

/// Eyes around a box of 14 × 8 × 8 voxels in the dark, with a ball of mist somewhere along x.
fn start(at: f64, seed: u64, eyes: &[[f64; 3]], fov: f64) -> VolumeScene {
    let cube =
        DAffine3::from_scale(DVec3::new(1.75, 1.0, 1.0)) * DAffine3::from_translation(DVec3::splat(-0.5));
    let grid = VoxelGrid::over_cube([14, 8, 8], cube).unwrap();
    let volume = |value: &mut dyn FnMut([usize; 3]) -> f64| {
        let samples = (0..grid.len()).map(|index| value(grid.voxel(index)) as f32).collect();
        Arc::new(Volume::new(grid, 1, Samples::F32(samples)).unwrap())
    };
    let n = &mut numbers(seed);
    let medium = VolumeMedium {
        extinction: volume(&mut |voxel| {
            let distance = grid.centre(voxel).distance(DVec3::new(at, 0.0, 0.0));
            if distance < 0.3 { n.uniform(1.0, 3.0) } else { 0.0 }
        }),
        albedo: volume(&mut |_| 0.0),
        emission: volume(&mut |_| START),
        g: 0.0,
        interpolation: Interpolation::Nearest,
        refraction: None,
    };
    let camera = |eye: &[f64; 3]| {
        let eye =
            look_at(DVec3::from_array(*eye), DVec3::new(at, 0.0, 0.0), DVec3::new(0.1, 0.9, 0.3)).unwrap();
        Camera::new(eye, fov, FovAxis::X, [20; 2]).unwrap()
    };
    let dark = Environment::constant([0.0; 3], 8).unwrap();
    let mut scene = scene::scene(medium, dark, eyes.iter().map(camera).collect());
    scene.background = Some([0.0; 3]);
    scene
}

/// An emission that nobody wants, where every voxel starts.
const START: f64 = 7.0;

const ALL_AROUND: [[f64; 3]; 4] = [[0.3, 0.2, 3.0], [0.2, 3.0, 0.4], [-0.3, -0.4, -3.0], [1.0, 1.2, 2.5]];

/// A key whose emission is found in pictures of an emission near `wanted_value`.
fn key(at: f64, wanted_value: f32) -> (VolumeScene, VolumeState, Vec<Determined>) {
    let scene = start(at, 5, &ALL_AROUND, 40.0);
    let truth = VolumeMedium {
        emission: Arc::new(scene.medium.emission.map(|_| wanted_value).unwrap()),
        ..scene.medium.clone()
    };
    let problem = problem(&scene, &wanted(&pictures(&scene, &truth, Find::Emission)), Find::Emission);
    let (solved, state) = solved_state(&scene, &problem);
    (scene, state, Determined::by(&problem, &solved.columns))
}

/// The extinction of a frame with the mist somewhere.
fn extinction(at: f64) -> Arc<Volume> {
    start(at, 9, &ALL_AROUND, 40.0).medium.extinction
}

#[test]
fn where_smoke_moves_to_its_emission_is_defined() {
    // Two balls that do not touch, and all that lies between.
    let keys = [key(-0.5, 0.4), key(0.5, 0.6)];
    let frames: Vec<Arc<Volume>> = (0..=10).map(|t| extinction(-0.5 + 0.1 * f64::from(t))).collect();
    let grid = *frames[0].grid();
    let mut occupied = Occupied::at(grid, &grid.set(|_| false));
    frames.iter().for_each(|frame| occupied.add(frame).unwrap());
    keys.iter().for_each(|(_, state, _)| occupied.add(&state.medium.extinction).unwrap());
    let spread = keys.each_ref().map(|(_, state, found)| state.spread(found, &occupied).unwrap());
    assert!(spread.iter().all(|(_, much)| much.voxels > 100));
    for ((scene, state, found), (spread, _)) in keys.iter().zip(&spread) {
        let [found] = &found[..] else { panic!("one property") };
        assert_eq!(found.property, Spreading::Emission);
        for voxel in found.reached.voxels() {
            let index = grid.index(voxel);
            let [before, after] = [state, spread].map(|state| state.medium.emission.color(index));
            assert_eq!(before, after, "what was found stays as it is");
        }
        let [before, after] = [state, spread].map(|state| pictures(scene, &state.medium, Find::Emission));
        assert!(before == after, "and so do the pictures of the key");
        let truth = scene
            .medium
            .emission
            .map(|_| if scene.medium.extinction == keys[0].0.medium.extinction { 0.4 } else { 0.6 });
        let truth = VolumeMedium { emission: Arc::new(truth.unwrap()), ..scene.medium.clone() };
        assert!(picture_error(&after, &pictures(scene, &truth, Find::Emission)) < VOLUME_PICTURES);
    }
    // Far from the start everywhere: what was found is from about 0.4 to 0.6.
    let worst = |from: &VolumeState, to: &VolumeState| {
        let mut worst = 0.0f32;
        for (t, extinction) in frames.iter().enumerate() {
            let blended = from.blended(to, t as f64 / 10.0).unwrap();
            for (sigma_t, emission) in colors(extinction).iter().zip(colors(&blended.medium.emission)) {
                if sigma_t[0] > 0.0 {
                    worst = worst.max(emission[0]);
                }
            }
        }
        worst
    };
    let reached = |(_, state, found): &(VolumeScene, VolumeState, Vec<Determined>)| {
        let indices = found[0].reached.indices();
        indices.iter().map(|&index| state.medium.emission.color(index as usize)[0]).fold(0.0, f32::max)
    };
    let most = keys.iter().map(reached).fold(0.0, f32::max);
    assert!(f64::from(most) < 0.5 * START, "{most}");
    assert!(worst(&spread[0].0, &spread[1].0) <= most);
    // Blending alone shows the start on the way.
    assert!(f64::from(worst(&keys[0].1, &keys[1].1)) > 0.9 * START);
}

#[test]
fn what_no_ray_reaches_is_filled_at_the_key_itself() {
    // One eye that sees the middle of the ball alone.
    let scene = start(0.0, 5, &[[0.1, 0.2, 3.0]], 5.0);
    let desired = wanted(&pictures(
        &scene,
        &VolumeMedium { emission: extinction(0.0), ..scene.medium.clone() },
        Find::Emission,
    ));
    let problem = problem(&scene, &desired, Find::Emission);
    let (solved, state) = solved_state(&scene, &problem);
    let found = Determined::by(&problem, &solved.columns);
    let grid = *scene.medium.extinction.grid();
    let occupied = Occupied::at(grid, &grid.set(|index| scene.medium.extinction.color(index)[0] > 0.0));
    let (spread, much) = state.spread(&found, &occupied).unwrap();
    let unreached = |state: &VolumeState| {
        let dense = (0..grid.len()).filter(|&index| scene.medium.extinction.color(index)[0] > 0.0);
        let unreached = dense.filter(|&index| !found[0].reached.contains(grid.voxel(index)));
        unreached.map(|index| state.medium.emission.color(index)[0]).collect::<Vec<f32>>()
    };
    assert!(much.voxels >= unreached(&state).len() && unreached(&state).len() > 10);
    assert!(unreached(&state).iter().all(|&value| f64::from(value) == START));
    let reached = found[0].reached.indices();
    let most =
        reached.iter().map(|&index| state.medium.emission.color(index as usize)[0]).fold(0.0, f32::max);
    assert!(unreached(&spread).iter().all(|&value| value <= most));
}

#[test]
fn blending_is_linear_and_exact_at_both_ends() {
    let mut n = numbers(6);
    let cube = DAffine3::from_translation(DVec3::splat(-0.5));
    let grid = VoxelGrid::over_cube([5, 4, 3], cube).unwrap();
    let mut state = || {
        let mut random = |channels| Arc::new(values(&mut n, grid, channels, 2.0));
        VolumeState {
            medium: VolumeMedium {
                extinction: random(1),
                albedo: random(3),
                emission: random(3),
                g: 0.0,
                interpolation: Interpolation::Nearest,
                refraction: None,
            },
            environment: Environment::constant([1.0; 3], 8).unwrap(),
        }
    };
    let (from, to) = (state(), state());
    let of = |state: &VolumeState| {
        let VolumeMedium { extinction, albedo, emission, .. } = &state.medium;
        [extinction, albedo, emission].map(|volume| colors(volume))
    };
    assert_eq!(of(&from.blended(&to, 0.0).unwrap()), of(&from));
    assert_eq!(of(&from.blended(&to, 1.0).unwrap()), of(&to));
    let middle = of(&from.blended(&to, 0.5).unwrap());
    for ((middle, from), to) in middle.iter().zip(of(&from)).zip(of(&to)) {
        for ((middle, from), to) in middle.iter().zip(from).zip(to) {
            assert_eq!(*middle, std::array::from_fn(|c| 0.5 * (from[c] + to[c])));
        }
    }
    let other = VoxelGrid::over_cube([5, 4, 2], cube).unwrap();
    let mut small = state();
    small.medium.emission = Arc::new(Volume::constant(other, [1.0; 3]).unwrap());
    assert!(matches!(from.blended(&small, 0.5), Err(Error::Shape { .. })));
}
