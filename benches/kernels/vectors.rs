//! Operations on vectors.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use unscatter::gpu::{DeviceSum, Gpu, GpuVector};
use unscatter::operator::{Bounds, Indexed, PendingSum, Vector};

use crate::rates::{Rates, Round, Work, by_the_clock};
use crate::{COLOR, on_adapter};

/// Bytes of an index.
const INDEX: u64 = 4;

type Change = fn(&mut GpuVector, &GpuVector, &GpuVector, &Bounds);
type Reduction = fn(&GpuVector, &GpuVector, &Bounds) -> unscatter::Result<DeviceSum>;
type LookUp = fn(&mut GpuVector, &GpuVector, &[<GpuVector as Indexed>::Index; 2]);

/// Kernels that change an element by its partners, and how many vectors each reads or writes.
const CHANGES: [(&str, u64, Change); 11] = [
    ("fill", 1, |x, _, _, _| x.fill([1.0, 2.0, 3.0])),
    ("axpby", 3, |x, y, _, _| x.axpby([0.5; 3], y, [0.25; 3])),
    ("scale", 2, |x, _, _, _| x.scale([-1.0; 3])),
    ("multiply", 3, |x, y, _, _| x.multiply(y)),
    ("invert", 2, |x, _, _, _| x.invert()),
    ("extrapolate", 3, |x, y, _, _| x.extrapolate(y, [0.5; 3])),
    ("step_within", 4, |x, y, z, bounds| x.step_within([0.5; 3], y, z, bounds)),
    ("clamp", 2, |x, _, _, bounds| x.clamp(bounds)),
    ("hold", 4, |x, y, z, bounds| x.hold(y, z, bounds)),
    ("hold_at_bounds", 3, |x, y, _, bounds| x.hold_at_bounds(y, bounds)),
    ("shorten", 3, |x, y, _, bounds| x.shorten(y, bounds)),
];
const REDUCTIONS: [(&str, Reduction); 2] = [
    ("dot", |x, y, _| x.dot_later(y)),
    ("projected_norm_squared", |x, y, bounds| x.projected_norm_squared_later(y, bounds)),
];
/// Kernels that look elements up, here in ascending order, and how many vectors and indices each reads or writes; `place` fills with
/// zeros first.
const LOOK_UPS: [(&str, u64, u64, LookUp); 4] = [
    ("pick", 2, 1, |x, y, [a, _]| x.pick(y, a)),
    ("place", 3, 1, |x, y, [a, _]| x.place(y, a)),
    ("difference", 2, 2, |x, y, [a, b]| x.difference(y, a, b)),
    ("divergence", 3, 2, |x, y, [a, b]| x.divergence(y, a, b)),
];

pub fn bench(rates: &mut Rates, gpu: &Gpu, elements: u32) {
    let group = format!("vectors of {elements}");
    let zeros = || GpuVector::zeros(gpu, elements as usize);
    let vector = |value: f64| {
        let mut vector = zeros();
        vector.fill([value; 3]);
        vector
    };
    let bounds = Bounds::new([0.0; 3], [2.0; 3]).unwrap();
    let work = |vectors: u64, indices: u64| Work {
        bytes: u64::from(elements) * (vectors * COLOR + indices * INDEX),
        ..Work::default()
    };
    for (name, vectors, change) in CHANGES {
        rates.bench(&group, name, || {
            let (mut x, y, z, bounds) = (vector(1.0), vector(0.5), vector(0.0), bounds.clone());
            let change = move || {
                change(&mut x, &y, &z, &bounds);
                Ok(())
            };
            (work(vectors, 0), on_adapter(gpu, change))
        });
    }
    for (name, vectors, indices, look_up) in LOOK_UPS {
        rates.bench(&group, name, || {
            let (mut x, y) = (vector(1.0), vector(0.5));
            let index = |shift: u32| {
                let index: Arc<[u32]> = (0..elements).map(|k| (k + shift) % elements).collect();
                y.index(&index).unwrap()
            };
            let both = [index(0), index(1)];
            let look_up = move || {
                look_up(&mut x, &y, &both);
                Ok(())
            };
            (work(vectors, indices), on_adapter(gpu, look_up))
        });
    }
    for (name, reduce) in REDUCTIONS {
        rates.bench(&group, name, || {
            let (x, y, bounds) = (vector(1.0), vector(0.5), bounds.clone());
            let asked = Rc::new(RefCell::new(None));
            let last = asked.clone();
            let mut round = on_adapter(gpu, move || {
                *last.borrow_mut() = Some(reduce(&x, &y, &bounds)?);
                Ok(())
            });
            // Fetched after each round: what is asked for and not fetched piles up.
            let round: Round = Box::new(move || {
                let took = round();
                asked.take().map(DeviceSum::value).transpose().unwrap();
                took
            });
            (work(2, 0), round)
        });
    }
    rates.bench(&group, "largest_step, with waiting for it", || {
        let (x, y, bounds) = (vector(1.0), vector(0.5), bounds.clone());
        (work(2, 0), by_the_clock(move || x.largest_step(&y, &bounds).unwrap()))
    });
}
