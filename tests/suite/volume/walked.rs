//! Rows that are walked anew, to each accuracy, against the explicit matrix.

use unscatter::cpu::Transport;
use unscatter::march::{InScattering, LitVolume, VolumeTransport};
use unscatter::operator::{CpuVector, LinearOperator, WalkPlan, adjoint_test};
use unscatter::scene::Strategy;
use unscatter::sparse::ExplicitMatrix;

use super::*;
use crate::tolerances::ADJOINT_F32;

/// What is between the voxels of a medium, and of what is looked for.
#[derive(Clone, Copy)]
enum Field {
    /// Waves of fourteen voxels: what a grid resolves.
    Smooth,
    /// Every voxel by lot: the worst that there is.
    Rough,
}

impl Field {
    fn at(self, n: &mut Numbers, grid: &VoxelGrid, index: usize) -> f64 {
        let [i, j, k] = grid.voxel(index).map(|place| place as f64);
        match self {
            Self::Smooth => 0.5 + 0.15 * ((0.45 * i).sin() + (0.45 * j + 1.0).sin() + (0.45 * k + 2.0).sin()),
            Self::Rough => n.uniform(0.0, 1.0),
        }
    }
}

/// A cube of 14³ voxels of some optical depth, seen along rays by lot: emission, and light that is scattered where it is colored.
fn traversal<const C: usize>(field: Field, depth: f64, accuracy: f64) -> VolumeTraversal {
    let mut n = numbers(3);
    let grid = VoxelGrid::over_cube([14, 15, 13], placement(&mut n)).unwrap();
    let volume = |n: &mut Numbers, most: f64| {
        let samples = (0..grid.len()).flat_map(|index| {
            let value = field.at(n, &grid, index);
            (0..C).map(move |c| ((1.0 + 0.5 * c as f64) * most * value) as f32)
        });
        Volume::new(grid, C, Samples::F32(samples.collect())).unwrap()
    };
    let density = volume(&mut n, depth);
    let mut parts = vec![part(Quantity::Emission, grid, Interpolation::Trilinear)];
    if C == 3 {
        let radiance = Arc::new(volume(&mut n, 1.0));
        let light = InScattering::new(vec![LitVolume { along: Some((n.direction(), 0.4)), radiance }]);
        parts.push(part(Quantity::Albedo(Arc::new(light)), grid, Interpolation::Trilinear));
    }
    let rays = rows_along(&random_rays(&mut n, 5000));
    let transport = VolumeTransport { accuracy, ..transport(density, Interpolation::Trilinear) };
    VolumeTraversal::new(transport, rays, parts)
}

fn operator<const C: usize>(
    traversal: &VolumeTraversal,
    strategy: Strategy,
) -> Transport<VolumeTraversal, f32, C> {
    Transport::new(traversal.clone(), &WalkPlan::new::<C>(traversal), strategy, u64::MAX).unwrap()
}

fn off(a: &CpuVector, b: &CpuVector<f64>) -> f64 {
    let [mut apart, mut all] = [0.0; 2];
    for (a, b) in a.0.as_flattened().iter().zip(b.0.as_flattened()) {
        apart += (f64::from(*a) - b).powi(2);
        all += b * b;
    }
    (apart / all).sqrt()
}

/// How far T x and Tᵀ y are from the explicit matrix, for fields of a kind and for residuals by lot.
fn errors<const C: usize>(field: Field, depth: f64, accuracy: f64) -> [f64; 2] {
    let traversal = traversal::<C>(field, depth, accuracy);
    let walked = operator::<C>(&traversal, Strategy::MatrixFree);
    let explicit = ExplicitMatrix::new::<C>(&traversal, u64::MAX).unwrap();
    let mut n = numbers(8);
    let elements = traversal.parts().iter().flat_map(|part| {
        part.voxels().indices().into_iter().map(|index| (part.grid, index as usize)).collect::<Vec<_>>()
    });
    let x: Vec<[f64; 3]> = elements
        .map(|(grid, index)| [0.5, 1.0, 2.0].map(|most| most * field.at(&mut n, &grid, index)))
        .collect();
    let y: Vec<[f64; 3]> =
        (0..traversal.rays().len()).map(|_| std::array::from_fn(|_| n.uniform(0.0, 1.0))).collect();
    let single = |values: &[[f64; 3]]| CpuVector(values.iter().map(|v| v.map(|v| v as f32)).collect());
    let (mut forward, mut back) = (walked.range(), walked.domain());
    walked.apply(&single(&x), &mut forward).unwrap();
    walked.apply_adjoint(&single(&y), &mut back).unwrap();
    let (mut true_forward, mut true_back) = (explicit.range(), explicit.domain());
    explicit.apply(&CpuVector(x), &mut true_forward).unwrap();
    explicit.apply_adjoint(&CpuVector(y), &mut true_back).unwrap();
    let adjoint = adjoint_test(&walked, 2, 3).unwrap().error;
    assert!(adjoint <= ADJOINT_F32, "{adjoint:e} at {depth}, {accuracy:e}");
    [off(&forward, &true_forward), off(&back, &true_back)]
}

/// Errors of T x and of Tᵀ y at most, for each accuracy: of fields that the grid resolves, and of what is by lot.
const STATED: [(f64, [[f64; 2]; 2]); 4] = [
    (1e-6, [[1e-6, 3e-6], [1e-6, 3e-6]]),
    (1e-5, [[1e-5, 3e-4], [1e-3, 5e-3]]),
    (2e-4, [[2e-4, 1e-2], [5e-3, 2e-2]]),
    (2e-3, [[2e-3, 5e-2], [3e-2, 1e-1]]),
];

fn errors_are_stated<const C: usize>(depths: &[f64]) {
    for &depth in depths {
        let mut before = 0.0;
        for (accuracy, stated) in STATED {
            for (field, stated) in [Field::Smooth, Field::Rough].into_iter().zip(stated) {
                let errors = errors::<C>(field, depth, accuracy);
                assert!(
                    errors[0] <= stated[0] && errors[1] <= stated[1],
                    "{accuracy:e} at {depth}: {errors:?}, not {stated:?}"
                );
                if let Field::Smooth = field {
                    // Each is worth its time.
                    assert!(errors[0] > 2.0 * before || depth > 1.0, "{errors:?} after {before:e}");
                    before = errors[0];
                }
            }
        }
    }
}

#[test]
fn errors_of_walked_rows_are_stated() {
    errors_are_stated::<1>(&[1.0, 3000.0]);
    errors_are_stated::<3>(&[30.0]);
}

/// Lengths in voxels, and the bits of all products.
#[test]
fn walked_rows_are_the_same_for_any_number_of_threads() {
    let products = |traversal: &VolumeTraversal, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let walked = operator::<1>(traversal, Strategy::MatrixFree);
            let values = |len: usize| CpuVector((0..len).map(|i| [(i % 7) as f32, 1.0, 0.1]).collect());
            let (x, y) = (values(walked.domain().0.len()), values(walked.range().0.len()));
            let (mut forward, mut back) = (walked.range(), walked.domain());
            walked.apply(&x, &mut forward).unwrap();
            walked.apply_adjoint(&y, &mut back).unwrap();
            [forward, back]
        })
    };
    let emitted = traversal::<1>(Field::Rough, 3.0, 1e-6);
    let grid = emitted.parts()[0].grid;
    let transport = VolumeTransport { basis: Interpolation::Nearest, ..emitted.transport().clone() };
    let lengths = vec![part(Quantity::Extinction, grid, Interpolation::Nearest)];
    let lengths = VolumeTraversal::new(transport, emitted.rays().clone(), lengths);
    for traversal in [&emitted, &lengths] {
        let one = products(traversal, 1);
        for threads in [2, 3, 5] {
            assert!(products(traversal, threads) == one, "{threads} threads");
        }
        let kept = operator::<1>(traversal, Strategy::Assembled);
        let mut back = kept.domain();
        kept.apply_adjoint(
            &CpuVector((0..kept.range().0.len()).map(|i| [(i % 7) as f32, 1.0, 0.1]).collect()),
            &mut back,
        )
        .unwrap();
        let wide = |v: &CpuVector| CpuVector(v.0.iter().map(|v| v.map(f64::from)).collect());
        assert!(off(&one[1], &wide(&back)) <= 1e-6);
    }
}

/// Where copies fit one product they fit the other.
#[test]
fn products_match_however_little_room_there_is() {
    let traversal = traversal::<1>(Field::Rough, 3.0, 2e-3);
    let plan = WalkPlan::new::<1>(&traversal);
    let room = Traversal::<f64, 1>::room(&traversal);
    for part in 1..=12 {
        let walked: Transport<_, f32, 1> =
            Transport::new(traversal.clone(), &plan, Strategy::MatrixFree, room * part / 10).unwrap();
        let adjoint = adjoint_test(&walked, 2, 3).unwrap().error;
        assert!(adjoint <= ADJOINT_F32, "{adjoint:e} in {part} tenths");
    }
}
