//! The CPU operator and its compositions against the explicit matrix and against each other.

use proptest::prelude::*;
use unscatter::cpu::{Transport, kept_bytes};
use unscatter::march::{LightMapTraversal, Real, Traversal, Weight};
use unscatter::operator::{
    Bounds, CpuVector, Identity, LinearOperator, Restricted, Scaled, Stacked, Vector, WalkPlan, Weighted,
    adjoint_test,
};
use unscatter::scene::{Basis, Quadrature, Strategy};
use unscatter::sparse::ExplicitMatrix;

use crate::scenes::field::Field;
use crate::scenes::{self, Numbers};
use crate::tolerances::{ADJOINT_F32, ADJOINT_F64, AGAINST_EXPLICIT};

const STRATEGIES: [Strategy; 2] = [Strategy::Assembled, Strategy::MatrixFree];

fn transport<F: Real>(seed: u64, rows: usize, strategy: Strategy) -> Transport<LightMapTraversal, F, 1> {
    let traversal = scenes::random(seed, rows, Basis::Bilinear, Quadrature::Exact);
    let plan = WalkPlan::new::<1>(&traversal);
    Transport::new(traversal, &plan, strategy, u64::MAX).unwrap()
}

fn random_vector(len: usize, seed: u64) -> CpuVector<f64> {
    let mut n = Numbers(seed | 1);
    CpuVector((0..len).map(|_| std::array::from_fn(|_| n.uniform(-1.0, 1.0))).collect())
}

fn relative_difference(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let difference = norm(&mut a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a - b));
    difference / norm(&mut b.iter().flatten().copied()).max(1e-300)
}

/// Both products of an operator, on the host.
fn products<T: LinearOperator>(operator: &T, seed: u64) -> [Vec<[f64; 3]>; 2] {
    let (mut x, mut y) = (operator.domain(), operator.range());
    x.set_from_host(&random_vector(x.len(), seed).0).unwrap();
    operator.apply(&x, &mut y).unwrap();
    let forward = y.to_host().unwrap();
    y.set_from_host(&random_vector(y.len(), seed + 1).0).unwrap();
    operator.apply_adjoint(&y, &mut x).unwrap();
    [forward, x.to_host().unwrap()]
}

#[test]
fn the_field_of_the_benches_has_the_rows_it_says_and_obeys_the_same_laws() {
    for basis in [Basis::Nearest, Basis::Bilinear] {
        let field = Field { picture: [64, 36], painted: 241, map: 64, basis, ..Field::PAPER };
        let traversal = field.traversal();
        assert_eq!(traversal.rays().len(), 241);
        let explicit = ExplicitMatrix::new::<1>(&traversal, u64::MAX).unwrap();
        let truth = products(&explicit, 3);
        let plan = WalkPlan::new::<1>(&traversal);
        for strategy in STRATEGIES {
            let operator = Transport::<_, f32, 1>::new(traversal.clone(), &plan, strategy, u64::MAX).unwrap();
            let products = products(&operator, 3);
            assert!((0..2).all(|way| relative_difference(&products[way], &truth[way]) <= AGAINST_EXPLICIT));
            assert!(adjoint_test(&operator, 2, 3).unwrap().error <= ADJOINT_F32);
        }
        // The next pixel of one view is another ray.
        let mut rays = traversal.rays().to_vec();
        let seen = (0..rays.len() - 1)
            .max_by(|&a, &b| traversal.inside_weight(a)[0].total_cmp(&traversal.inside_weight(b)[0]));
        rays[seen.unwrap()] = rays[seen.unwrap() + 1];
        let other = LightMapTraversal::new(traversal.transport().clone(), rays.into());
        let other = products(&ExplicitMatrix::new::<1>(&other, u64::MAX).unwrap(), 3);
        assert!((0..2).all(|way| relative_difference(&other[way], &truth[way]) > AGAINST_EXPLICIT));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..Default::default() })]

    #[test]
    fn both_directions_agree_with_the_explicit_matrix(seed in 1u64.., rows in 1usize..300) {
        let explicit = ExplicitMatrix::new::<1>(
            &scenes::random(seed, rows, Basis::Bilinear, Quadrature::Exact), u64::MAX).unwrap();
        let truth = products(&explicit, seed);
        for strategy in STRATEGIES {
            let single = products(&transport::<f32>(seed, rows, strategy), seed);
            let double = products(&transport::<f64>(seed, rows, strategy), seed);
            for direction in 0..2 {
                prop_assert!(relative_difference(&single[direction], &truth[direction]) <= AGAINST_EXPLICIT);
                prop_assert!(relative_difference(&double[direction], &truth[direction]) <= 1e-13);
            }
        }
    }

    #[test]
    fn the_adjoint_is_the_adjoint(seed in 1u64.., rows in 1usize..300) {
        for strategy in STRATEGIES {
            prop_assert!(adjoint_test(&transport::<f32>(seed, rows, strategy), 3, seed).unwrap().error <= ADJOINT_F32);
            prop_assert!(adjoint_test(&transport::<f64>(seed, rows, strategy), 3, seed).unwrap().error <= ADJOINT_F64);
        }
    }

    #[test]
    fn compositions_keep_the_adjoint(seed in 1u64.., rows in 2usize..200) {
        let operator = transport::<f64>(seed, rows, Strategy::Auto);
        let columns: Vec<u32> = (0..operator.domain().len() as u32).step_by(2).collect();
        let mut weights = random_vector(rows, seed);
        weights.clamp(&Bounds::NOT_NEGATIVE);
        let weighted = Weighted::new(Restricted::new(&operator, columns).unwrap(), weights).unwrap();
        let scaled = Scaled::new(Identity::scaled(&weighted.domain(), [1.0; 3]), [0.5, -2.0, 0.0]);
        let stacked = Stacked::new(weighted).over(scaled).unwrap();
        prop_assert!(adjoint_test(&stacked, 3, seed).unwrap().error <= ADJOINT_F64);
    }

    #[test]
    fn linear(seed in 1u64..) {
        let operator = transport::<f64>(seed, 50, Strategy::Auto);
        let (a, b) = (random_vector(operator.domain().len(), seed), random_vector(operator.domain().len(), seed + 9));
        let apply = |x: &CpuVector<f64>| {
            let mut y = operator.range();
            operator.apply(x, &mut y).unwrap();
            y
        };
        let mut combined = a.clone();
        combined.axpby([2.0; 3], &b, [-3.0; 3]);
        let mut expected = apply(&a);
        expected.axpby([2.0; 3], &apply(&b), [-3.0; 3]);
        prop_assert!(relative_difference(&apply(&combined).0, &expected.0) <= 1e-12);
    }
}

#[test]
fn results_are_bit_identical_for_any_number_of_threads_and_any_storage() {
    let run = |threads: usize, strategy: Strategy| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| products(&transport::<f32>(5, 3000, strategy), 5))
    };
    let reference = run(1, Strategy::Assembled);
    for threads in [1, 2, 3, 7] {
        assert!(run(threads, Strategy::Assembled) == reference, "{threads} threads");
    }
    let walked = run(1, Strategy::MatrixFree);
    assert!(run(5, Strategy::MatrixFree) == walked);
    assert!(relative_difference(&walked[1], &reference[1]) <= 1e-7);
}

#[test]
fn a_budget_between_nothing_and_everything_keeps_some_rows() {
    let traversal = scenes::random(5, 3000, Basis::Bilinear, Quadrature::Exact);
    let plan = WalkPlan::new::<1>(&traversal);
    let whole = Transport::<_, f32, 1>::new(traversal.clone(), &plan, Strategy::Auto, u64::MAX).unwrap();
    let bytes = kept_bytes::<f32>(&plan, 1);
    let part = Transport::<_, f32, 1>::new(traversal.clone(), &plan, Strategy::Auto, bytes / 3).unwrap();
    assert_eq!(whole.storage().walked_rows, 0);
    assert!(part.storage().kept_rows > 500 && part.storage().walked_rows > 500);
    assert!(part.storage().bytes <= bytes / 2);
    let (whole, part) = (products(&whole, 3), products(&part, 3));
    assert!(relative_difference(&whole[0], &part[0]) <= 1e-6);
    assert!(relative_difference(&whole[1], &part[1]) <= 1e-6);
    assert!(Transport::<_, f32, 1>::new(traversal, &plan, Strategy::Assembled, bytes / 3).is_err());
}

#[test]
fn squares_are_the_diagonal_of_the_normal_matrix() {
    let operator = transport::<f64>(11, 150, Strategy::Auto);
    let weights = CpuVector((0..150).map(|row| [row as f64, 1.0, 0.5]).collect());
    let squares = operator.squares(&weights).unwrap();
    for element in 0..operator.domain().len() {
        let mut unit = operator.domain();
        unit.0[element] = [1.0; 3];
        let mut column = operator.range();
        operator.apply(&unit, &mut column).unwrap();
        for c in 0..3 {
            let truth: f64 = column.0.iter().zip(&weights.0).map(|(t, w)| w[c] * t[c] * t[c]).sum();
            assert!((squares.0[element][c] - truth).abs() <= 1e-12 * truth.max(1e-12));
        }
    }
}

/// An operator whose adjoint is wrong in one texel, or too large by a factor.
struct Sabotaged<T>(T, fn(&mut [[f64; 3]]));

impl<T: LinearOperator<Domain = CpuVector<f64>>> LinearOperator for Sabotaged<T> {
    type Domain = T::Domain;
    type Range = T::Range;
    fn domain(&self) -> T::Domain {
        self.0.domain()
    }
    fn range(&self) -> T::Range {
        self.0.range()
    }
    fn apply(&self, x: &T::Domain, y: &mut T::Range) -> unscatter::Result<()> {
        self.0.apply(x, y)
    }
    fn apply_adjoint(&self, y: &T::Range, x: &mut T::Domain) -> unscatter::Result<()> {
        self.0.apply_adjoint(y, x)?;
        self.1(&mut x.0);
        Ok(())
    }
}

#[test]
fn the_adjoint_test_notices_one_wrong_texel_and_names_a_missing_factor() {
    let one_texel = Sabotaged(transport::<f64>(5, 300, Strategy::Auto), |x| {
        let largest = (0..x.len()).max_by(|&a, &b| x[a][0].total_cmp(&x[b][0])).unwrap();
        x[largest][0] *= 1.0 + 1e-4;
    });
    assert!(adjoint_test(&one_texel, 3, 1).unwrap().error > 100.0 * ADJOINT_F64);
    let factor = Sabotaged(transport::<f64>(5, 300, Strategy::Auto), |x| {
        x.iter_mut().flatten().for_each(|value| *value *= 2.0);
    });
    let test = adjoint_test(&factor, 3, 1).unwrap();
    assert!(test.error > 0.1 && (test.factor - 0.5).abs() < 1e-12 && test.scatter < 1e-12);
    let nan = Sabotaged(transport::<f64>(5, 300, Strategy::Auto), |x| x[0][0] = f64::NAN);
    assert!(adjoint_test(&nan, 3, 1).unwrap().error.is_nan());
}

#[test]
fn vectors_that_do_not_fit_are_refused() {
    let operator = transport::<f32>(5, 30, Strategy::Auto);
    let (mut x, mut y) = (CpuVector::zeros(1), operator.range());
    assert!(operator.apply(&x, &mut y).is_err());
    assert!(operator.apply_adjoint(&y, &mut x).is_err());
    assert!(Restricted::new(&operator, vec![3, 1]).is_err());
    assert!(Restricted::new(&operator, vec![u32::MAX]).is_err());
    assert!(Weighted::new(&operator, CpuVector::zeros(7)).is_err());
}

#[test]
fn a_row_without_elements_and_a_walk_plan_without_rows_are_fine() {
    let traversal = scenes::random(3, 0, Basis::Nearest, Quadrature::Exact);
    assert_eq!(Traversal::<f64, 1>::rows(&traversal), 0);
    let plan = WalkPlan::new::<1>(&traversal);
    let operator = Transport::<_, f32, 1>::new(traversal, &plan, Strategy::Auto, 0).unwrap();
    let [forward, backward] = products(&operator, 1);
    assert!(forward.is_empty() && backward.iter().all(|value| *value == [0.0; 3]));
}

/// Many rows that all meet the same few elements, like lights around a volume; the weights of one element are off by a share.
struct Crowded(f64);

impl Traversal<f64, 1> for Crowded {
    fn rows(&self) -> usize {
        200_000
    }

    fn elements(&self) -> usize {
        70
    }

    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f64, 1>)) {
        for element in (row % 3..70).step_by(3) {
            let off = if element == 4 { self.0 } else { 0.0 };
            visit(element, [0.01 * (1 + (row * 31 + element * 17) % 97) as f64 * (1.0 + off)]);
        }
    }
}

#[test]
fn few_elements_of_many_rows_are_summed_up_as_exactly_as_many() {
    let y = random_vector(200_000, 5);
    let y = CpuVector(y.0.iter().map(|y| y.map(|y| (y.abs() + 0.1) as f32)).collect());
    let wide = CpuVector(y.0.iter().map(|y| y.map(f64::from)).collect());
    let truth = ExplicitMatrix::new::<1>(&Crowded(0.0), u64::MAX).unwrap();
    let mut expected = truth.domain();
    truth.apply_adjoint(&wide, &mut expected).unwrap();
    let plan = WalkPlan::new::<1>(&Crowded(0.0));
    let back = |off: f64, strategy: Strategy| {
        let transport: Transport<_, f32, 1> =
            Transport::new(Crowded(off), &plan, strategy, u64::MAX).unwrap();
        let mut x = transport.domain();
        transport.apply_adjoint(&y, &mut x).unwrap();
        let x: Vec<[f64; 3]> = x.0.iter().map(|x| x.map(f64::from)).collect();
        relative_difference(&x, &expected.0)
    };
    for strategy in STRATEGIES {
        let error = back(0.0, strategy);
        assert!(error <= ADJOINT_F32, "{strategy:?}: {error:e}");
        assert!(back(1e-4, strategy) > ADJOINT_F32);
    }
}
