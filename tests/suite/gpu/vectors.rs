//! Every operation on vectors against its twin on the CPU, whole, plane by plane and slab by slab.

use std::sync::Arc;

use unscatter::gpu::{Choice, Gpu, GpuVector};
use unscatter::operator::{
    Bounds, CpuVector, Gradient, Indexed, Laplacian, LinearOperator, Metric, NOWHERE, Neighbours, PendingSum,
    Scaling, Vector, adjoint_test,
};

use super::{device, gpu, host, narrow, open, products, random, relative_difference};
use crate::scenes::Numbers;
use crate::tolerances::{ADJOINT_F32, AGAINST_EXPLICIT, DEVICE_ELEMENT, DEVICE_SUM};

/// The whole vector in one binding; a plane at a time; slabs of 512 elements; one workgroup along an axis of a dispatch.
fn ways() -> [Gpu; 4] {
    let alone = Choice { workgroup_limit: Some(1), ..Choice::default() };
    [gpu(), narrow(6000 * 4), narrow(512 * 4), open(alone)]
}

const LENGTHS: [usize; 4] = [0, 1, 257, 5003];

/// Bounds of one, two, three and four parts, whose beginnings are multiples of nothing and lie in three slabs of 512.
fn parts() -> [Bounds; 4] {
    const NONE: f64 = f64::INFINITY;
    let of = |lower, upper| Bounds::new(lower, upper).unwrap();
    let one = of([-0.5, 0.0, -NONE], [0.25, NONE, 0.75]);
    let two = one.clone().then(103, of([0.0; 3], [NONE; 3]));
    let three = two.clone().then(109, of([-NONE; 3], [0.125, NONE, 0.375]));
    let four = three.clone().then(3331, of([-0.25, -NONE, 0.125], [0.375, -0.125, 0.125]));
    [one, two, three, four]
}

/// All operations that change elements, one after the other on the same vectors, each seen.
fn changes<V: Indexed>(prototype: &V, len: usize) -> Vec<(&'static str, Vec<[f64; 3]>)> {
    let y = random(prototype.zeros(len), 5);
    let mut seen = Vec::new();
    let mut see = |name, change: &dyn Fn(&mut V)| {
        let mut mine = random(prototype.zeros(len), 7);
        change(&mut mine);
        seen.push((name, mine.to_host().unwrap()));
    };
    see("fill", &|mine| mine.fill([1.0, -2.0, 0.1]));
    see("copy_from", &|mine| mine.copy_from(&y));
    see("axpby", &|mine| mine.axpby([0.3, -1.5, 0.0], &y, [2.0, 0.0, 1.0]));
    see("axpby that forgets", &|mine| {
        mine.scale([f64::NAN; 3]);
        mine.axpby([1.0; 3], &y, [0.0; 3]);
    });
    see("scale", &|mine| mine.scale([0.0, 3.0, -1.0]));
    see("multiply", &|mine| mine.multiply(&y));
    see("extrapolate", &|mine| mine.extrapolate(&y, [0.3, -1.5, 0.0]));
    see("invert", &|mine| {
        mine.clamp(&Bounds::NOT_NEGATIVE);
        mine.invert();
    });
    for bounds in parts() {
        let mut x = random(prototype.zeros(len), 3);
        x.clamp(&bounds);
        see("clamp", &|mine| mine.clamp(&bounds));
        see("hold", &|mine| mine.hold(&x, &y, &bounds));
        see("hold_at_bounds", &|mine| mine.hold_at_bounds(&x, &bounds));
        see("shorten", &|mine| mine.shorten(&x, &bounds));
        see("step_within", &|mine| mine.step_within([-0.3, 2.0, 0.0], &y, &x, &bounds));
        see("descend", &|mine| {
            let mut scale = prototype.zeros(len);
            scale.fill([0.5, 2.0, 4.0]);
            Scaling::new(scale, false).descend(mine, &x, [3.0, 2.0, 0.5], &bounds);
        });
    }
    if len > 0 {
        let mut n = Numbers(11);
        let mut index = |nowhere: bool| -> V::Index {
            let any = (0..len).map(|_| {
                if nowhere && n.next().is_multiple_of(5) { NOWHERE } else { (n.next() % len as u64) as u32 }
            });
            prototype.index(&any.collect::<Arc<[u32]>>()).unwrap()
        };
        let (a, b) = (index(true), index(true));
        see("pick", &|mine| mine.pick(&y, &a));
        see("difference", &|mine| mine.difference(&y, &a, &b));
        see("divergence", &|mine| mine.divergence(&y, &a, &b));
        // Every other element, from the last to the first.
        let order: Arc<[u32]> = (0..len as u32).step_by(2).rev().collect();
        let index = prototype.index(&order).unwrap();
        let from = random(prototype.zeros(order.len()), 13);
        see("place", &|mine| mine.place(&from, &index));
    }
    seen
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn changes_are_those_of_the_twin() {
    for gpu in ways() {
        for len in LENGTHS {
            let (here, there) = (changes(&host(0), len), changes(&device(&gpu, 0), len));
            for ((name, expected), (_, got)) in here.into_iter().zip(there) {
                let error = relative_difference(&got, &expected);
                assert!(error <= DEVICE_ELEMENT, "{name} of {len} elements: {error:e}");
            }
        }
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn a_part_costs_a_dispatch_and_one_that_begins_late_is_noticed() {
    let gpu = gpu();
    let (mut x, x0) = (random(device(&gpu, 5003), 7), random(device(&gpu, 5003), 3));
    for (dispatches, bounds) in (1..).zip(parts()) {
        let before = gpu.dispatches();
        x.clamp(&bounds);
        assert_eq!(gpu.dispatches() - before, dispatches);
        let _sum = x.projected_norm_squared_later(&x0, &bounds).unwrap();
        assert_eq!(gpu.dispatches() - before, 2 * dispatches);
    }
    let [.., three, four] = parts();
    let clamped = |bounds: &Bounds| {
        let mut x = random(device(&gpu, 5003), 7);
        x.clamp(bounds);
        x.to_host().unwrap()
    };
    let late =
        three.then(3332, Bounds::new([-0.25, f64::NEG_INFINITY, 0.125], [0.375, -0.125, 0.125]).unwrap());
    assert!(relative_difference(&clamped(&late), &clamped(&four)) > DEVICE_ELEMENT);
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn threads_that_share_an_adapter_get_what_each_would_get_alone() {
    let gpu = gpu();
    let columns: Vec<u32> = (0..57 * 41).filter(|k| k % 7 != 3).collect();
    let neighbours = Arc::new(Neighbours::new([57, 41], &columns).unwrap());
    let laplacian = Laplacian::new(neighbours, &device(&gpu, 0)).unwrap();
    let round = |seed: u64| {
        let (x, y) =
            (random(device(&gpu, columns.len()), seed), random(device(&gpu, columns.len()), seed + 1));
        // The room between both steps of the operator is shared, too.
        let mut z = device(&gpu, columns.len());
        laplacian.apply(&x, &mut z).unwrap();
        let sums = [x.dot_later(&y).unwrap(), z.dot_later(&y).unwrap()];
        (sums.map(|sum| sum.value().unwrap()), z.to_host().unwrap())
    };
    let alone: Vec<_> = (0..4).map(round).collect();
    std::thread::scope(|scope| {
        for (seed, alone) in (0..).zip(&alone) {
            scope.spawn(move || (0..20).for_each(|_| assert!(round(seed) == *alone)));
        }
    });
    assert!(alone[0] != alone[1]);
}

/// All reductions: in f64 on the host, or as the device makes them.
fn sums<V: Vector>(zeros: V, bounds: &Bounds) -> Vec<(&'static str, [f64; 3])> {
    let x = {
        let mut x = random(zeros.zeros_like(), 17);
        x.clamp(bounds);
        x
    };
    let y = random(zeros, 19);
    vec![
        ("dot", x.dot(&y).unwrap()),
        ("norm_squared", y.norm_squared().unwrap()),
        ("projected_norm_squared", y.projected_norm_squared(&x, bounds).unwrap()),
        ("largest_step", y.largest_step(&x, bounds).unwrap()),
    ]
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn sums_are_those_of_the_twin() {
    let boxed = Bounds::new([-0.5, 0.0, f64::NEG_INFINITY], [0.25, f64::INFINITY, f64::INFINITY]).unwrap();
    for gpu in ways() {
        for len in [0, 1, 257, 5003, 100_003] {
            for bounds in [Bounds::NONE, boxed.clone()].into_iter().chain(parts()) {
                let truth = sums(CpuVector::<f64>::zeros(len), &bounds);
                // |terms| of every sum here are at most 1, and most of them count.
                let scale = (len as f64).max(1.0);
                for ((name, expected), (_, got)) in truth.into_iter().zip(sums(device(&gpu, len), &bounds)) {
                    for c in 0..3 {
                        let scale = if name == "largest_step" { expected[c].max(1e-3) } else { scale };
                        let same =
                            got[c] == expected[c] || (got[c] - expected[c]).abs() <= DEVICE_SUM * scale;
                        assert!(same, "{name} of {len}: {} instead of {}", got[c], expected[c]);
                    }
                }
            }
        }
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn a_million_roundings_do_not_add_up() {
    // 0.1 is not a number of f32: a running sum would be off by 1e-3.
    let gpu = gpu();
    let mut x = device(&gpu, 1_000_000);
    x.fill([0.1, 1.0, 1e-3]);
    let square = |value: f64| f64::from(value as f32).powi(2) * 1e6;
    let sum = x.norm_squared().unwrap();
    for (c, value) in [0.1, 1.0, 1e-3].into_iter().enumerate() {
        assert!((sum[c] / square(value) - 1.0).abs() < 2e-7, "{} instead of {}", sum[c], square(value));
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn several_sums_cost_one_round_trip() {
    let gpu = gpu();
    let (x, y) = (random(device(&gpu, 1000), 1), random(device(&gpu, 1000), 2));
    gpu.finish().unwrap();
    let before = gpu.round_trips();
    let sums = [x.dot_later(&y), x.dot_later(&x), y.projected_norm_squared_later(&x, &Bounds::NOT_NEGATIVE)];
    let values = sums.map(|sum| sum.unwrap().value().unwrap());
    assert_eq!(gpu.round_trips() - before, 1);
    assert_eq!(values[0], x.dot(&y).unwrap());
    assert_ne!(values[1], values[0]);
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn gradient_and_laplacian_are_those_of_the_twin() {
    let size = [57, 41];
    let columns: Vec<u32> = (0..57 * 41).filter(|k| k % 7 != 3 && k % 11 != 5).collect();
    let neighbours = Arc::new(Neighbours::new(size, &columns).unwrap());
    for gpu in ways() {
        let (here, there) = (CpuVector::<f64>::zeros(0), device(&gpu, 0));
        let truth = Gradient::new(neighbours.clone(), &here).unwrap();
        let gradient = Gradient::new(neighbours.clone(), &there).unwrap();
        let true_laplacian = Laplacian::new(neighbours.clone(), &here).unwrap();
        let laplacian = Laplacian::new(neighbours.clone(), &there).unwrap();
        for (truth, got) in [
            (products(&truth, 1), products(&gradient, 1)),
            (products(&true_laplacian, 2), products(&laplacian, 2)),
        ] {
            for direction in 0..2 {
                assert!(relative_difference(&got[direction], &truth[direction]) <= AGAINST_EXPLICIT);
            }
        }
        // The lattice turned round, with as many pairs, is noticed.
        let turned: Vec<u32> = columns.iter().map(|k| 57 * 41 - 1 - k).rev().collect();
        let turned = Arc::new(Neighbours::new(size, &turned).unwrap());
        assert_eq!(turned.edges(), neighbours.edges());
        let turned = products(&Gradient::new(turned, &there).unwrap(), 1);
        assert!(relative_difference(&turned[0], &products(&truth, 1)[0]) > AGAINST_EXPLICIT);
        assert!(adjoint_test(&gradient, 3, 1).unwrap().error <= ADJOINT_F32);
        assert!(adjoint_test(&laplacian, 3, 1).unwrap().error <= ADJOINT_F32);
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn one_wrong_element_is_noticed() {
    let gpu = gpu();
    let (expected, mut got) = (random(host(5003), 7), random(device(&gpu, 5003), 7));
    assert!(relative_difference(&got.to_host().unwrap(), &expected.to_host().unwrap()) <= DEVICE_ELEMENT);
    let mut values = got.to_host().unwrap();
    values[4000][1] += 1e-3;
    got.set_from_host(&values).unwrap();
    assert!(relative_difference(&got.to_host().unwrap(), &expected.to_host().unwrap()) > DEVICE_ELEMENT);
    let (truth, sabotaged) = (random(CpuVector::<f64>::zeros(5003), 7).norm_squared(), got.norm_squared());
    let (truth, sabotaged) = (truth.unwrap()[1], sabotaged.unwrap()[1]);
    assert!((truth - sabotaged).abs() > DEVICE_SUM * 5003.0);
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn the_time_of_nothing_and_of_many_submissions_is_measured() {
    let gpu = gpu();
    let mut x = GpuVector::zeros(&gpu, 100_000);
    let nothing = gpu.seconds(|| Ok(())).unwrap();
    let much = gpu.seconds(|| {
        (0..3000).for_each(|_| x.scale([1.0; 3]));
        Ok(())
    });
    let much = much.unwrap();
    assert_eq!(nothing.is_some(), gpu.record().timestamps);
    if let (Some(nothing), Some(much)) = (nothing, much) {
        assert!((0.0..1.0).contains(&nothing), "{nothing}");
        // Of 3000 scalings only the last 952 stand in the last submission.
        let one = gpu.seconds(|| {
            (0..900).for_each(|_| x.scale([1.0; 3]));
            Ok(())
        });
        assert!(much > 1.5 * one.unwrap().unwrap(), "{much}");
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn what_is_sent_in_parts_arrives_whole() {
    let gpu = gpu();
    // 55 MiB a channel: four parts, and the last one short.
    let len = 14_400_001;
    let mut x = GpuVector::zeros(&gpu, len);
    let values: Vec<[f64; 3]> = (0..len).map(|k| [k as f64, (k % 7) as f64, -1.0]).collect();
    x.set_from_host(&values).unwrap();
    let back = x.to_host().unwrap();
    assert!(back == values);
}
