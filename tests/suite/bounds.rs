//! Bounds of one to four parts against a plain loop that looks up every element's own.

use unscatter::march::Real;
use unscatter::operator::{Bounds, CpuVector, Metric, Scaling, Vector};

use crate::scenes::Numbers;

/// More than one piece of a sum and of a task, and a multiple of nothing.
const LEN: usize = 20_011;

const NONE: f64 = f64::INFINITY;

/// Where parts begin, and their l and u. The second is shorter than any piece, and the third begins one element before a piece ends.
const PARTS: [(usize, [[f64; 3]; 2]); 4] = [
    (0, [[-0.5, 0.0, -NONE], [0.25, NONE, 0.75]]),
    (103, [[0.0; 3], [NONE; 3]]),
    (109, [[-NONE; 3], [0.1, NONE, 0.3]]),
    (8191, [[-0.2, -NONE, 0.1], [0.3, -0.1, 0.1]]),
];

/// The first `count` of the parts, which begin `shift` elements later.
fn bounds(count: usize, shift: usize) -> Bounds {
    let [first, others @ ..] = PARTS;
    let of = |[lower, upper]: [[f64; 3]; 2]| Bounds::new(lower, upper).unwrap();
    others[..count - 1]
        .iter()
        .fold(of(first.1), |bounds, &(begin, others)| bounds.then(begin + shift, of(others)))
}

/// l and u of an element and channel when there are so many parts.
fn looked_up(count: usize, element: usize, c: usize) -> [f64; 2] {
    let (_, [lower, upper]) = PARTS[..count].iter().rfind(|(begin, _)| *begin <= element).unwrap();
    [lower[c], upper[c]]
}

fn random<F: Real>(len: usize, seed: u64) -> CpuVector<F> {
    let mut n = Numbers(seed);
    // What f32 can hold, so that both precisions start from the same.
    let values: Vec<[f64; 3]> =
        (0..len).map(|_| std::array::from_fn(|_| f64::from(n.uniform(-1.0, 1.0) as f32))).collect();
    CpuVector::of(&values)
}

/// Every change within bounds: a vector's, given x and a gradient.
fn changes<F: Real>(len: usize, bounds: &Bounds) -> [CpuVector<F>; 5] {
    let ([mut clamped, mut held, mut held_at, mut shortened], gradient) =
        ([7, 7, 7, 7].map(|seed| random::<F>(len, seed)), random(len, 5));
    let mut x = random(len, 3);
    x.clamp(bounds);
    clamped.clamp(bounds);
    held.hold(&x, &gradient, bounds);
    held_at.hold_at_bounds(&x, bounds);
    shortened.shorten(&x, bounds);
    let mut scale = random(len, 11);
    scale.multiply(&scale.clone());
    let mut stepped = gradient;
    Scaling::new(scale, true).descend(&mut stepped, &x, [1.0, 2.0, 0.5], bounds);
    [clamped, held, held_at, shortened, stepped]
}

/// The same, number by number.
fn plain_changes<F: Real>(len: usize, count: usize) -> [CpuVector<F>; 5] {
    let [mine, gradient, x, scale] = [7, 5, 3, 11].map(|seed| random::<F>(len, seed));
    let mut changed: [CpuVector<F>; 5] = std::array::from_fn(|_| mine.clone());
    for (element, c) in (0..len).flat_map(|element| (0..3).map(move |c| (element, c))) {
        let [lower, upper] = looked_up(count, element, c).map(F::of);
        let within = |value: F| F::min(F::max(value, lower), upper);
        let (g, x, mine, s) =
            (gradient.0[element][c], within(x.0[element][c]), mine.0[element][c], scale.0[element][c]);
        let leaves = (x <= lower && g > F::zero()) || (x >= upper && g < F::zero());
        let room = F::min(x - lower, upper - x);
        let stepped = x + F::of(-1.0 / [1.0, 2.0, 0.5][c]) * (g * (s * s).recip());
        let all = [
            within(mine),
            if leaves { F::zero() } else { mine },
            if x <= lower || x >= upper { F::zero() } else { mine },
            if room.is_finite() { mine * room } else { mine },
            within(stepped),
        ];
        changed.iter_mut().zip(all).for_each(|(changed, value)| changed.0[element][c] = value);
    }
    changed
}

/// The largest step, and the square of the projected gradient.
fn sums(len: usize, bounds: &Bounds) -> [[f64; 3]; 2] {
    let (mut x, gradient) = (random::<f64>(len, 3), random(len, 5));
    x.clamp(bounds);
    let square = gradient.projected_norm_squared(&x, bounds).unwrap();
    // Steps that no bound stops at once.
    let mut step = gradient;
    step.hold_at_bounds(&x, bounds);
    [step.largest_step(&x, bounds).unwrap(), square]
}

fn plain_sums(len: usize, count: usize) -> [[f64; 3]; 2] {
    let (x, gradient) = (random::<f64>(len, 3), random::<f64>(len, 5));
    let (mut largest, mut square) = ([NONE; 3], [0.0; 3]);
    for (element, c) in (0..len).flat_map(|element| (0..3).map(move |c| (element, c))) {
        let [lower, upper] = looked_up(count, element, c);
        let (g, x) = (gradient.0[element][c], x.0[element][c].max(lower).min(upper));
        if !((x <= lower && g > 0.0) || (x >= upper && g < 0.0)) {
            square[c] += g * g;
        }
        if x > lower && x < upper {
            largest[c] = f64::min(largest[c], if g < 0.0 { (lower - x) / g } else { (upper - x) / g });
        }
    }
    [largest, square]
}

#[test]
fn every_element_is_held_to_the_bounds_of_its_part() {
    for count in 1..=PARTS.len() {
        for len in [0, 1, 105, 109, LEN] {
            let bounds = bounds(count, 0);
            assert_eq!(changes::<f64>(len, &bounds), plain_changes::<f64>(len, count), "{count} {len}");
            assert_eq!(changes::<f32>(len, &bounds), plain_changes::<f32>(len, count), "{count} {len}");
            let ([largest, square], [plain_largest, plain_square]) =
                (sums(len, &bounds), plain_sums(len, count));
            assert_eq!(largest, plain_largest, "{count} {len}");
            for c in 0..3 {
                assert!((square[c] - plain_square[c]).abs() <= 1e-12 * plain_square[c], "{count} {len}");
            }
        }
    }
}

#[test]
fn a_part_that_begins_one_element_late_is_noticed() {
    for count in 2..=PARTS.len() {
        let (got, expected) = (changes::<f64>(LEN, &bounds(count, 1)), plain_changes::<f64>(LEN, count));
        assert!(got != expected, "{count}");
    }
}
