//! What a dispatch and a round trip cost whatever they do, and a kernel's first call.

use std::time::{Duration, Instant};

use unscatter::gpu::{Choice, Gpu, GpuVector, Walked};
use unscatter::operator::{LinearOperator, Vector};

use crate::rates::{Rates, Round, Work};
use crate::scenes::field::Field;

/// Operations of a round: within what one submission holds.
const TIMES: u32 = 500;

/// Tiny operations, each on what the one before it has left, as in a solve.
pub fn bench(rates: &mut Rates, [gpu, spinning]: &[Gpu; 2]) {
    let tiny = |gpu| {
        let mut x = GpuVector::zeros(gpu, 64);
        x.fill([1.0, 0.5, 0.25]);
        x
    };
    let dispatch = Work { dispatches: 1.0, ..Work::default() };
    rates.bench("overhead", "a dispatch", || {
        let mut x = tiny(gpu);
        let round: Round = Box::new(move || {
            gpu.finish().unwrap();
            let clock = Instant::now();
            (0..TIMES).for_each(|_| x.scale([-1.0; 3]));
            gpu.finish().unwrap();
            clock.elapsed() / TIMES
        });
        (dispatch, round)
    });
    if gpu.record().timestamps {
        rates.bench("overhead", "a dispatch, by the adapter's own time", || {
            let mut x = tiny(gpu);
            let mut all = move || {
                (0..TIMES).for_each(|_| x.scale([-1.0; 3]));
                Ok(())
            };
            let round: Round =
                Box::new(move || Duration::from_secs_f64(gpu.seconds(&mut all).unwrap().unwrap()) / TIMES);
            (dispatch, round)
        });
    }
    for (name, gpu) in [("a round trip", gpu), ("a round trip, spinning", spinning)] {
        rates.bench("overhead", name, || {
            let x = tiny(gpu);
            let round: Round = Box::new(move || {
                let clock = Instant::now();
                for _ in 0..TIMES {
                    std::hint::black_box(x.dot(&x).unwrap());
                }
                clock.elapsed() / TIMES
            });
            (Work { round_trips: 1.0, ..dispatch }, round)
        });
    }
}

/// The first application of a product on an adapter just opened, which compiles its kernels, and the one after it.
pub fn first_call(rates: &mut Rates, choice: &Choice) {
    for (name, before) in [("gather, compiled", 0), ("gather, again", 1)] {
        rates.bench("first call", name, || {
            let traversal = Field::TINY.traversal();
            let round: Round = Box::new(move || {
                let gpu = Gpu::open(choice).unwrap();
                let walked = Walked::light_map(&gpu, &traversal, false, false).unwrap();
                let (x, mut y) = (walked.domain(), walked.range());
                let mut apply = || {
                    walked.apply(&x, &mut y).unwrap();
                    gpu.finish().unwrap();
                };
                (0..before).for_each(|_| apply());
                let clock = Instant::now();
                apply();
                clock.elapsed()
            });
            (Work { rays: Field::TINY.painted as u64, ..Work::default() }, round)
        });
    }
}
