//! T of a volume on the device against the explicit matrix in f64.

use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3};
use unscatter::gpu::{Accumulation, Choice, DeviceOperator, Gpu, GpuVector, Walked};
use unscatter::march::{
    Density, InScattering, LitVolume, PixelRays, Quantity, Refraction, VolumeTransport, VolumeTraversal,
    VoxelElements,
};
use unscatter::operator::{Bounds, LinearOperator, Vector, adjoint_test};
use unscatter::scene::{
    Camera, FovAxis, Interpolation, Quadrature, Samples, Volume, VoxelGrid, VoxelSet, look_at,
};
use unscatter::sparse::ExplicitMatrix;

use super::{gpu, narrow, open, products, random, relative_difference};
use crate::scenes::Numbers;
use crate::tolerances::{ADJOINT_F32, AGAINST_EXPLICIT};

#[derive(Debug, Clone, Copy, PartialEq)]
enum Looked {
    Emission,
    /// For so many lights.
    Albedo(usize),
    Extinction,
    /// Emission, then albedo.
    Both,
}

/// What a volume is made of.
#[derive(Debug, Clone, Copy)]
struct Case {
    looked: Looked,
    basis: Interpolation,
    /// Whether the unknown has a grid of its own.
    nested: bool,
    colored: bool,
    size: [usize; 3],
    /// Extinction of the densest voxel in 1/metre, where a voxel has a few centimetres.
    sigma_t: f64,
    rows: usize,
}

impl Default for Case {
    fn default() -> Self {
        Self {
            looked: Looked::Emission,
            basis: Interpolation::Nearest,
            nested: false,
            colored: false,
            size: [20, 17, 13],
            sigma_t: 4.0,
            rows: 300,
        }
    }
}

/// A grid that is turned, mirrored along one axis, and a little larger than a cube of side 2 around a point.
fn grid(size: [usize; 3], angle: f64, centre: DVec3) -> VoxelGrid {
    let scale = DVec3::new(2.1, -2.3, 1.9);
    let turned = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), angle);
    let cube = DAffine3::from_scale_rotation_translation(scale, turned, centre);
    VoxelGrid::over_cube(size, cube * DAffine3::from_translation(DVec3::splat(-0.5))).unwrap()
}

/// A volume with holes, and bricks without anything.
fn medium(n: &mut Numbers, grid: VoxelGrid, most: f64, colored: bool) -> Volume {
    let [a, b, c] = [0; 3].map(|_| n.uniform(2.0, 5.0));
    let channels = if colored { 3 } else { 1 };
    let samples = (0..grid.len()).flat_map(|index| {
        let voxel = grid.voxel(index);
        let p = grid.centre(voxel);
        let is_hole = (a * p.x).sin() + (b * p.y).sin() + (c * p.z).cos() < -0.3 || voxel[0] / 8 == 1;
        let value = if is_hole { 0.0 } else { n.uniform(0.0, most) };
        [value, 0.4 * value, n.uniform(0.0, 1.0) * value].into_iter().take(channels)
    });
    Volume::new(grid, channels, Samples::F32(samples.map(|value| value as f32).collect())).unwrap()
}

/// One ray a camera of one pixel: from inside and outside, along the grid's axes, along its outer faces, and past it.
fn rays(n: &mut Numbers, grid: &VoxelGrid, rows: usize) -> PixelRays {
    let from_grid = grid.world_from_grid();
    let size = DVec3::from_array(grid.size().map(|side| side as f64));
    let inside = |n: &mut Numbers| size * DVec3::from_array(std::array::from_fn(|_| n.uniform(0.0, 1.0)));
    let mut lengths = Vec::new();
    let cameras: Vec<Camera> = (0..rows)
        .map(|row| {
            let target = from_grid.transform_point3(inside(n));
            let axis = [DVec3::X, DVec3::NEG_Y, DVec3::Z][row % 3];
            let (eye, target) = match row % 8 {
                // Along an axis of the grid, from before it.
                0 => (target - 40.0 * from_grid.transform_vector3(axis), target),
                // From inside.
                1 => (from_grid.transform_point3(inside(n)), target),
                // Just inside an outer face, and nearly parallel to it.
                2 => {
                    let (mut a, mut b) = (inside(n), inside(n));
                    (a.z, b.z) = (1e-3, 1e-7);
                    let [a, b] = [a, b].map(|p| from_grid.transform_point3(p));
                    (a - 3.0 * (b - a), b)
                }
                // Past it.
                3 => (target + 5.0 * n.direction(), target + 5.0 * n.direction()),
                _ => (target + n.uniform(1.0, 6.0) * n.direction(), target),
            };
            lengths.push(if row % 5 == 0 { n.uniform(0.0, 6.0) } else { f64::INFINITY });
            let up = if (target - eye).normalize().y.abs() > 0.9 { DVec3::X } else { DVec3::Y };
            Camera::new(look_at(eye, target, up).unwrap(), 1e-3, FovAxis::Y, [1, 1]).unwrap()
        })
        .collect();
    let pixels: Vec<[u32; 2]> = (0..rows as u32).map(|row| [row, 0]).collect();
    PixelRays::new(cameras.into(), pixels, lengths.into())
}

/// Light of several sources, some on grids of their own, some from everywhere.
fn lights(n: &mut Numbers, grid: VoxelGrid, count: usize, colored: bool) -> Arc<InScattering> {
    let others: [VoxelGrid; 5] = [
        grid,
        self::grid([9, 14, 21], 0.3, DVec3::new(0.1, 0.2, 0.0)),
        self::grid([1, 2, 30], -0.7, DVec3::ZERO),
        self::grid([5, 5, 5], 2.0, DVec3::new(0.9, 0.0, 0.0)),
        grid,
    ];
    let field = |k: usize, n: &mut Numbers| {
        let lit = others[k];
        let channels = if colored && k.is_multiple_of(2) { 3 } else { 1 };
        let samples = (0..lit.len() * channels).map(|_| n.uniform(0.0, 2.0) as f32).collect();
        LitVolume {
            along: (k % 3 != 2).then(|| (n.direction(), 0.3 * k as f64)),
            radiance: Arc::new(Volume::new(lit, channels, Samples::F32(samples)).unwrap()),
        }
    };
    Arc::new(InScattering::new((0..count).map(|k| field(k, n)).collect()))
}

fn traversal(seed: u64, case: Case) -> VolumeTraversal {
    let mut n = Numbers(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    (0..8).for_each(|_| {
        n.next();
    });
    let medium_grid = grid(case.size, 0.6, DVec3::new(0.1, -0.2, 0.3));
    let density =
        Arc::new(Density::new(Arc::new(medium(&mut n, medium_grid, case.sigma_t, case.colored)), case.basis));
    let unknown = match case.nested {
        true => grid([11, 14, 9], -0.4, DVec3::new(0.4, 0.0, 0.3)),
        false => medium_grid,
    };
    let rays = rays(&mut n, &medium_grid, case.rows);
    let mut part = |quantity| {
        let holds: Vec<bool> = (0..unknown.len()).map(|_| !n.next().is_multiple_of(4)).collect();
        let voxels = VoxelSet::new(unknown.size(), |index| holds[index] && index / 64 % 3 != 1);
        VoxelElements::new(quantity, unknown, Arc::new(voxels), case.basis)
    };
    let light = |count| Quantity::Albedo(lights(&mut Numbers(seed | 1), medium_grid, count, case.colored));
    let parts = match case.looked {
        Looked::Emission => vec![part(Quantity::Emission)],
        Looked::Albedo(count) => vec![part(light(count))],
        Looked::Extinction => vec![part(Quantity::Extinction)],
        Looked::Both => vec![part(Quantity::Emission), part(light(2))],
    };
    let transport = VolumeTransport {
        density,
        basis: case.basis,
        quadrature: Quadrature::Exact,
        accuracy: 1e-6,
        transmittance_bound: f64::powi(2.0, -24),
        refraction: None,
    };
    VolumeTraversal::new(transport, rays, parts)
}

fn explicit(traversal: &VolumeTraversal, colored: bool) -> ExplicitMatrix {
    match colored {
        true => ExplicitMatrix::new::<3>(traversal, u64::MAX).unwrap(),
        false => ExplicitMatrix::new::<1>(traversal, u64::MAX).unwrap(),
    }
}

/// diag(Tᵀ diag(y) T) of the explicit matrix.
fn true_squares(matrix: &ExplicitMatrix, elements: usize, y: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let mut squares = vec![[0.0; 3]; elements];
    for c in 0..3 {
        for (&weight, (row, element)) in matrix.channel(c) {
            squares[element][c] += weight * weight * y[row][c];
        }
    }
    squares
}

/// The largest error of both products and of the squares, and that of the adjoint.
fn errors(gpu: &Gpu, traversal: &VolumeTraversal, colored: bool, deterministic: bool) -> [f64; 4] {
    let matrix = explicit(traversal, colored);
    let walked = Walked::volume(gpu, traversal, colored, deterministic).unwrap();
    let [forward, backward] = products(&walked, 3);
    let [true_forward, true_backward] = products(&matrix, 3);
    let mut y = random(walked.range(), 3);
    y.clamp(&Bounds::NOT_NEGATIVE);
    let mut x = walked.domain();
    walked.squares(&y, &mut x).unwrap();
    let squares = true_squares(&matrix, x.len(), &y.to_host().unwrap());
    [
        relative_difference(&forward, &true_forward),
        relative_difference(&backward, &true_backward),
        relative_difference(&x.to_host().unwrap(), &squares),
        adjoint_test(&walked, 1, 5).unwrap().error,
    ]
}

fn agree(name: &str, [forward, backward, squares, adjoint]: [f64; 4]) {
    let all = format!("{name}: {forward:.1e}, {backward:.1e}, {squares:.1e}; adjoint {adjoint:.1e}");
    let largest = forward.max(backward).max(squares);
    assert!(largest <= AGAINST_EXPLICIT && adjoint <= ADJOINT_F32, "{all}");
}

const BASES: [Interpolation; 2] = [Interpolation::Nearest, Interpolation::Trilinear];

/// Everything that can be looked for, on the medium's grid and on another.
fn cases(basis: Interpolation) -> Vec<Case> {
    let mut all = Vec::new();
    for colored in [false, true] {
        let case = Case { basis, colored, ..Case::default() };
        for looked in [Looked::Emission, Looked::Albedo(1), Looked::Albedo(4), Looked::Both] {
            all.extend([false, true].map(|nested| Case { looked, nested, ..case }));
        }
        all.push(Case { looked: Looked::Extinction, ..case });
    }
    all
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn walked_volumes_are_those_of_the_explicit_matrix() {
    let gpu = gpu();
    for basis in BASES {
        for (seed, case) in (1..).zip(cases(basis)) {
            let traversal = traversal(seed, case);
            agree(&format!("{case:?}"), errors(&gpu, &traversal, case.colored, false));
        }
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn however_sums_are_made_and_vectors_are_seen() {
    let swap = open(Choice { without_float_atomics: true, ..Choice::default() });
    let whole = gpu();
    // Slabs of half a thousand elements and a few rays: no room for a medium, but lengths need none.
    let narrow = narrow(2048);
    for basis in BASES {
        let case = Case { basis, looked: Looked::Both, colored: true, ..Case::default() };
        let traversal = traversal(17, case);
        agree("swap", errors(&swap, &traversal, true, false));
        agree("fixed", errors(&whole, &traversal, true, true));
        let small = Case { looked: Looked::Extinction, rows: 200, ..case };
        let traversal = self::traversal(18, small);
        agree("narrow", errors(&narrow, &traversal, true, false));
        agree("narrow, fixed", errors(&narrow, &traversal, true, true));
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn thick_and_thin_media_keep_their_digits() {
    let gpu = gpu();
    for basis in BASES {
        // A voxel has about 0.12 m: optical depths of 1e3 a voxel, and of 1e-6 in all.
        for sigma_t in [1e4, 1e2, 1e-3, 1e-6, 1e-12] {
            for nested in [false, true] {
                let traversal = traversal(7, Case { basis, nested, sigma_t, ..Case::default() });
                agree(&format!("{basis:?} {sigma_t:e} {nested}"), errors(&gpu, &traversal, false, false));
            }
        }
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn long_rays_keep_their_digits() {
    let gpu = gpu();
    for basis in BASES {
        for looked in [Looked::Emission, Looked::Albedo(2), Looked::Extinction] {
            let size = [512, 400, 16];
            let case = Case { basis, looked, size, rows: 150, sigma_t: 2.0, ..Case::default() };
            agree(&format!("{basis:?} {looked:?}"), errors(&gpu, &traversal(9, case), false, false));
        }
    }
}

/// Extinction with one voxel changed.
fn with_another_voxel(traversal: &VolumeTraversal) -> VolumeTraversal {
    let density = &traversal.transport().density;
    let volume = density.volume();
    let mut values: Vec<f32> = volume.samples().iter().collect();
    // One in the middle that many rays meet.
    let grid = volume.grid();
    let distance = |index: usize| (grid.centre(grid.voxel(index)) - grid.centre([5, 8, 6])).length();
    let voxel = (0..values.len())
        .filter(|&index| values[index] > 1.0)
        .min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
        .unwrap();
    values[voxel] *= 1.05;
    let volume = Volume::new(*grid, 1, Samples::F32(values)).unwrap();
    let density = Arc::new(Density::new(Arc::new(volume), density.interpolation()));
    let transport = VolumeTransport { density, ..traversal.transport().clone() };
    VolumeTraversal::new(transport, traversal.rays().clone(), traversal.parts().to_vec())
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn one_wrong_voxel_or_ray_is_noticed() {
    let gpu = gpu();
    for basis in BASES {
        let traversal = traversal(5, Case { basis, ..Case::default() });
        let truth = products(&explicit(&traversal, false), 1);
        let differs = |other: &VolumeTraversal| {
            let got = products(&Walked::volume(&gpu, other, false, false).unwrap(), 1);
            (0..2).all(|direction| relative_difference(&got[direction], &truth[direction]) > AGAINST_EXPLICIT)
        };
        assert!(!differs(&traversal));
        assert!(differs(&with_another_voxel(&traversal)));
        // A ray that ends before it begins.
        let rays = traversal.rays();
        let mut lengths: Vec<f64> = (0..rays.len()).map(|row| rays.length(row)).collect();
        let weight = |row: usize| {
            let mut sum = 0.0;
            traversal.trace::<1>(row, &traversal.parts()[0], &mut |_, [weight]| sum += weight);
            sum
        };
        let seen = (0..rays.len()).max_by(|&a, &b| weight(a).total_cmp(&weight(b))).unwrap();
        lengths[seen] = 0.0;
        assert!(differs(&traversal.along(rays.clone().until(lengths.into()))));
    }
}

/// An operator with one voxel of its adjoint wrong.
struct Sabotaged(Walked);

impl LinearOperator for Sabotaged {
    type Domain = GpuVector;
    type Range = GpuVector;
    fn domain(&self) -> GpuVector {
        self.0.domain()
    }
    fn range(&self) -> GpuVector {
        self.0.range()
    }
    fn apply(&self, x: &GpuVector, y: &mut GpuVector) -> unscatter::Result<()> {
        self.0.apply(x, y)
    }
    fn apply_adjoint(&self, y: &GpuVector, x: &mut GpuVector) -> unscatter::Result<()> {
        self.0.apply_adjoint(y, x)?;
        let mut values = x.to_host()?;
        let largest = (0..values.len()).max_by(|&a, &b| values[a][0].total_cmp(&values[b][0])).unwrap();
        values[largest][0] *= 1.001;
        x.set_from_host(&values)
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn the_adjoint_test_notices_one_wrong_voxel() {
    let traversal = traversal(5, Case::default());
    let walked = Walked::volume(&gpu(), &traversal, false, false).unwrap();
    assert!(adjoint_test(&Sabotaged(walked), 3, 1).unwrap().error > ADJOINT_F32);
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn fixed_point_gives_the_same_bits() {
    let gpu = gpu();
    let case = Case { looked: Looked::Both, basis: Interpolation::Trilinear, rows: 2000, ..Case::default() };
    let traversal = traversal(23, case);
    let walked = Walked::volume(&gpu, &traversal, false, true).unwrap();
    assert_eq!(walked.accumulation(), Accumulation::Fixed);
    let y = random(walked.range(), 9);
    let products = || {
        let (mut x, mut squares) = (walked.domain(), walked.domain());
        walked.apply_adjoint(&y, &mut x).unwrap();
        walked.squares(&y, &mut squares).unwrap();
        [x.to_host().unwrap(), squares.to_host().unwrap()]
    };
    let first = products();
    (0..5).for_each(|_| assert_eq!(products(), first));
    let other = Walked::volume(&gpu, &traversal, false, false).unwrap();
    assert_ne!(other.accumulation(), Accumulation::Fixed);
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn what_there_is_no_kernel_for_is_refused_and_says_what_to_do() {
    let whole = gpu();
    let refused = |gpu: &Gpu, traversal: &VolumeTraversal, words: &str| {
        let error = Walked::volume(gpu, traversal, false, false).unwrap_err();
        assert!(error.is_not_possible_here(), "{error}");
        let text = error.to_string();
        assert!(text.contains(words) && text.contains("compute on the processor"), "{text}");
    };
    let usual = traversal(1, Case::default());
    let with = |change: &dyn Fn(&mut VolumeTransport)| {
        let mut transport = usual.transport().clone();
        change(&mut transport);
        VolumeTraversal::new(transport, usual.rays().clone(), usual.parts().to_vec())
    };
    let index = Arc::new(Volume::constant(*usual.transport().density.grid(), [1.1; 3]).unwrap());
    let refraction = Arc::new(Refraction::new(index, 0.01).unwrap());
    refused(&whole, &with(&|transport| transport.refraction = Some(refraction.clone())), "straight rays");
    let march = Quadrature::March { steps: 10 };
    refused(&whole, &with(&|transport| transport.quadrature = march), "exactly");
    refused(&whole, &with(&|transport| transport.basis = Interpolation::Trilinear), "differ");
    refused(&whole, &traversal(1, Case { looked: Looked::Albedo(5), ..Case::default() }), "4 lights");
    // More than a binding: the medium's bricks.
    refused(&narrow(4096), &usual, "the medium on the adapter");
    // More rounds than Mesa's software adapter lets loops take.
    let swap = open(Choice { without_float_atomics: true, ..Choice::default() });
    let long = Case { basis: Interpolation::Trilinear, size: [512, 16, 16], ..Case::default() };
    if !swap.record().is_hardware() {
        refused(&swap, &traversal(1, long), "rounds of its loops");
    }
}
