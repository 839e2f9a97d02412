//! T on the device, walked and kept, against the explicit matrix in f64 and against the CPU.

use proptest::prelude::*;
use unscatter::cpu::Transport as CpuTransport;
use unscatter::gpu::{Accumulation, Choice, DeviceOperator, Gpu, GpuVector, Kept, Walked};
use unscatter::march::{LightMapTraversal, Traversal};
use unscatter::operator::{CpuVector, LinearOperator, RowTable, Vector, WalkPlan, adjoint_test};
use unscatter::scene::{Basis, Quadrature, Strategy as Storage};
use unscatter::sparse::ExplicitMatrix;

use super::{as_on_hardware, gpu, narrow, open, products, random, relative_difference};
use crate::scenes;
use crate::tolerances::{ADJOINT_F32, AGAINST_EXPLICIT};

/// A random scene, in colours if so asked.
fn traversal(
    seed: u64,
    rows: usize,
    basis: Basis,
    quadrature: Quadrature,
    colored: bool,
) -> LightMapTraversal {
    let grey = scenes::random(seed, rows, basis, quadrature);
    if !colored {
        return grey;
    }
    let mut transport = grey.transport().clone();
    let [sigma, ..] = transport.sigma_t;
    transport.sigma_t = [sigma, 0.5 * sigma, 2.0 * sigma];
    let rays = grey.rays().iter().map(|ray| {
        let [s, ..] = ray.scattering;
        unscatter::march::ViewRay { scattering: [s, 0.3 * s, 0.7 * s], ..*ray }
    });
    LightMapTraversal::new(transport, rays.collect())
}

fn explicit(traversal: &LightMapTraversal, colored: bool) -> ExplicitMatrix {
    if colored {
        ExplicitMatrix::new::<3>(traversal, u64::MAX).unwrap()
    } else {
        ExplicitMatrix::new::<1>(traversal, u64::MAX).unwrap()
    }
}

/// The rows as the CPU keeps them.
fn table(traversal: &LightMapTraversal, colored: bool) -> RowTable {
    if colored { scenes::kept_rows::<3>(traversal) } else { scenes::kept_rows::<1>(traversal) }
}

fn agree(got: &[Vec<[f64; 3]>; 2], truth: &[Vec<[f64; 3]>; 2]) -> Result<(), TestCaseError> {
    for direction in 0..2 {
        let error = relative_difference(&got[direction], &truth[direction]);
        prop_assert!(error <= AGAINST_EXPLICIT, "direction {direction}: {error:e}");
    }
    Ok(())
}

fn basis(bilinear: bool) -> Basis {
    if bilinear { Basis::Bilinear } else { Basis::Nearest }
}

thread_local! {
    /// Whole vectors, in f32 and in fixed point, also with sums inside workgroups; sums by compare-and-swap; slabs of a thousand elements and a few rays.
    static WALKS: [(Gpu, bool); 7] = [
        (gpu(), false),
        (gpu(), true),
        (as_on_hardware(), false),
        (as_on_hardware(), true),
        (open(Choice { without_float_atomics: true, ..Choice::default() }), false),
        (narrow(4096), false),
        (narrow(4096), true),
    ];
    static WHOLE_AND_NARROW: [Gpu; 3] = [gpu(), as_on_hardware(), narrow(2048)];
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..Default::default() })]

    #[test]
    #[ignore = "needs a graphics adapter; ./test.sh brings one"]
    fn walked_rows_are_those_of_the_explicit_matrix(
        seed in 1u64..,
        rows in 1usize..300,
        bilinear: bool,
        colored: bool,
        march: bool,
    ) {
        let quadrature = if march { Quadrature::March { steps: 37 } } else { Quadrature::Exact };
        let traversal = traversal(seed, rows, basis(bilinear), quadrature, colored);
        let truth = products(&explicit(&traversal, colored), seed);
        WALKS.with(|walks| {
            for (gpu, deterministic) in walks {
                let walked = Walked::light_map(gpu, &traversal, colored, *deterministic).unwrap();
                agree(&products(&walked, seed), &truth)?;
                prop_assert!(adjoint_test(&walked, 1, seed).unwrap().error <= ADJOINT_F32);
            }
            Ok(())
        })?;
    }

    #[test]
    #[ignore = "needs a graphics adapter; ./test.sh brings one"]
    fn kept_rows_are_those_of_the_explicit_matrix(seed in 1u64.., rows in 1usize..300, colored: bool) {
        let traversal = traversal(seed, rows, Basis::Bilinear, Quadrature::Exact, colored);
        let truth = products(&explicit(&traversal, colored), seed);
        let elements = traversal.transport().light_map.len();
        WHOLE_AND_NARROW.with(|gpus| {
            for gpu in gpus {
                let kept = Kept::new(gpu, table(&traversal, colored), elements).unwrap();
                agree(&products(&kept, seed), &truth)?;
                prop_assert!(adjoint_test(&kept, 1, seed).unwrap().error <= ADJOINT_F32);
            }
            Ok(())
        })?;
    }
}

/// diag(Tᵀ diag(y) T) as the CPU has it.
fn true_squares(traversal: &LightMapTraversal, y: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let plan = WalkPlan::new::<3>(traversal);
    let transport =
        CpuTransport::<_, f64, 3>::new(traversal.clone(), &plan, Storage::Auto, u64::MAX).unwrap();
    transport.squares(&CpuVector(y.to_vec())).unwrap().0
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn squares_are_the_diagonal_of_the_normal_matrix() {
    for colored in [false, true] {
        let traversal = traversal(11, 200, Basis::Bilinear, Quadrature::Exact, colored);
        let elements = traversal.transport().light_map.len();
        for (gpu, deterministic) in [
            (gpu(), false),
            (gpu(), true),
            (as_on_hardware(), false),
            (as_on_hardware(), true),
            (narrow(4096), false),
        ] {
            let walked = Walked::light_map(&gpu, &traversal, colored, deterministic).unwrap();
            let kept = Kept::new(&gpu, table(&traversal, colored), elements).unwrap();
            let mut y = random(walked.range(), 3);
            y.clamp(&unscatter::operator::Bounds::NOT_NEGATIVE);
            let truth = true_squares(&traversal, &y.to_host().unwrap());
            let mut x = walked.domain();
            walked.squares(&y, &mut x).unwrap();
            let error = relative_difference(&x.to_host().unwrap(), &truth);
            assert!(error <= AGAINST_EXPLICIT, "walked: {error:e}");
            kept.squares(&y, &mut x).unwrap();
            let error = relative_difference(&x.to_host().unwrap(), &truth);
            assert!(error <= AGAINST_EXPLICIT, "kept: {error:e}");
            // Another weight of one row that is seen is noticed.
            let mut values = y.to_host().unwrap();
            let seen = (0..values.len())
                .filter(|&row| values[row][0] > 0.1)
                .max_by(|&a, &b| traversal.inside_weight(a)[0].total_cmp(&traversal.inside_weight(b)[0]));
            values[seen.unwrap()][0] *= 1.01;
            assert!(
                relative_difference(&x.to_host().unwrap(), &true_squares(&traversal, &values))
                    > AGAINST_EXPLICIT
            );
        }
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn one_wrong_weight_or_ray_is_noticed() {
    let traversal = traversal(5, 300, Basis::Bilinear, Quadrature::Exact, false);
    let gpu = gpu();
    let elements = traversal.transport().light_map.len();
    let truth = products(&explicit(&traversal, false), 1);
    let mut table = table(&traversal, false);
    let heaviest =
        (0..table.elements.len()).max_by(|&a, &b| table.weights[0][a].total_cmp(&table.weights[0][b]));
    table.weights[0][heaviest.unwrap()] *= 1.01;
    assert!(agree(&products(&Kept::new(&gpu, table, elements).unwrap(), 1), &truth).is_err());

    let mut rays = traversal.rays().to_vec();
    let weight = |row: usize| traversal.inside_weight(row)[0];
    let seen = (0..rays.len()).max_by(|&a, &b| weight(a).total_cmp(&weight(b))).unwrap();
    rays[seen].direction = (rays[seen].direction + glam::DVec3::new(0.03, 0.03, 0.03)).normalize();
    let bent = LightMapTraversal::new(traversal.transport().clone(), rays.into());
    assert!(agree(&products(&Walked::light_map(&gpu, &bent, false, false).unwrap(), 1), &truth).is_err());
}

/// An operator with one texel of its adjoint wrong.
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
fn the_adjoint_test_notices_one_wrong_texel() {
    let traversal = traversal(5, 300, Basis::Bilinear, Quadrature::Exact, false);
    let walked = Walked::light_map(&gpu(), &traversal, false, false).unwrap();
    assert!(adjoint_test(&Sabotaged(walked), 3, 1).unwrap().error > ADJOINT_F32);
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn fixed_point_gives_the_same_bits_and_f32_says_what_it_is() {
    let gpu = gpu();
    let traversal = traversal(23, 5000, Basis::Bilinear, Quadrature::Exact, false);
    let walked = Walked::light_map(&gpu, &traversal, false, true).unwrap();
    assert_eq!(walked.accumulation(), Accumulation::Fixed);
    let y = random(walked.range(), 9);
    let product = || {
        let mut x = walked.domain();
        walked.apply_adjoint(&y, &mut x).unwrap();
        x.to_host().unwrap()
    };
    let first = product();
    (0..10).for_each(|_| assert_eq!(product(), first));
    assert_ne!(
        Walked::light_map(&gpu, &traversal, false, false).unwrap().accumulation(),
        Accumulation::Fixed
    );
}

/// The same rays again and again, all of them through the same texels: the sum that is most in danger of its range.
fn crowd(gpu: &Gpu, rays: usize, y: [f64; 3]) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
    let one = traversal(31, 64, Basis::Nearest, Quadrature::Exact, true);
    let row = (0..64).find(|&row| one.inside_weight(row)[0] > 1e-3).unwrap();
    let crowd = LightMapTraversal::new(one.transport().clone(), vec![one.rays()[row]; rays].into());
    let mut truth = vec![[0.0; 3]; one.transport().light_map.len()];
    Traversal::<f64, 3>::walk(&one, row, &mut |element, weight: [f64; 3]| {
        (0..3).for_each(|c| truth[element][c] += weight[c] * y[c] * rays as f64);
    });
    let walked = Walked::light_map(gpu, &crowd, true, true).unwrap();
    let (mut all, mut x) = (walked.range(), walked.domain());
    all.fill(y);
    walked.apply_adjoint(&all, &mut x).unwrap();
    (x.to_host().unwrap(), truth)
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn fixed_point_holds_from_the_faintest_to_the_brightest_light() {
    let gpu = gpu();
    for scale in [1e-25, 1e-12, 1.0, 1e12, 1e25] {
        let (got, truth) = crowd(&gpu, 100_000, [scale, -scale, 1e-3 * scale]);
        let error = relative_difference(&got, &truth);
        assert!(error <= AGAINST_EXPLICIT, "{scale:e}: {error:e}");
    }
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let (got, _) = crowd(&gpu, 70, [1.0, bad, 1.0]);
        assert!(got.iter().all(|texel| texel[1].is_nan() && texel[0].is_finite()), "{bad} is hidden");
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn columns_that_every_row_meets_are_cut_up() {
    // Rays from one eye: all of them pass the texels around it.
    let one = traversal(31, 64, Basis::Bilinear, Quadrature::Exact, false);
    let row = (0..64).find(|&row| one.inside_weight(row)[0] > 1e-3).unwrap();
    let crowd = LightMapTraversal::new(one.transport().clone(), vec![one.rays()[row]; 10_000].into());
    let truth = products(&explicit(&crowd, false), 3);
    for gpu in [gpu(), as_on_hardware(), narrow(1 << 16)] {
        let kept = Kept::new(&gpu, table(&crowd, false), crowd.transport().light_map.len()).unwrap();
        agree(&products(&kept, 3), &truth).unwrap();
        let mut squares = kept.domain();
        let mut ones = kept.range();
        ones.fill([1.0; 3]);
        kept.squares(&ones, &mut squares).unwrap();
        let truth = true_squares(&crowd, &ones.to_host().unwrap());
        assert!(relative_difference(&squares.to_host().unwrap(), &truth) <= AGAINST_EXPLICIT);
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn rows_that_are_walked_in_several_submissions_are_each_walked_once() {
    // More than are walked at first.
    let traversal = traversal(5, 40_000, Basis::Bilinear, Quadrature::Exact, false);
    let truth = products(&explicit(&traversal, false), 5);
    for deterministic in [false, true] {
        let walked = Walked::light_map(&gpu(), &traversal, false, deterministic).unwrap();
        // While the pace is found, and after.
        for _ in 0..3 {
            agree(&products(&walked, 5), &truth).unwrap();
        }
    }
}
