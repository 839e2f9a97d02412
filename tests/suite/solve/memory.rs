//! Methods keep the vectors that they say, and take no memory on the way.

use unscatter::operator::{Bounds, CpuVector, LinearOperator, Vector};
use unscatter::solve::{
    Cgls, Fista, FlexibleCgls, Lbfgs, LeastSquares, Lsmr, Lsqr, Mprgp, Spectral, Vectors,
};

use super::{Dense, Made, all, random_matrix, rhs};

#[test]
fn a_method_keeps_as_many_vectors_as_it_says() {
    let dense = Dense::new(random_matrix(9, 7, 1));
    let makers: [fn(&Dense) -> Made<Dense>; 9] = [
        |o| Box::new(Cgls::new(o)),
        |o| Box::new(Cgls::clamped(o)),
        |o| Box::new(Lsqr::new(o)),
        |o| Box::new(Lsmr::new(o)),
        |o| Box::new(Fista::new(o)),
        |o| Box::new(Spectral::new(o)),
        |o| Box::new(Lbfgs::new(o)),
        |o| Box::new(Mprgp::new(o)),
        |o| Box::new(FlexibleCgls::new(o)),
    ];
    for make in makers {
        dense.count_anew();
        let method = make(&dense);
        let [domain, range] = dense.asked_for();
        let made = Vectors { domain, range };
        assert_eq!(made, method.vectors(), "{}", method.name());
    }
}

#[test]
fn neither_beginning_nor_iterating_takes_memory() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    // Inside the pool, because handing work over to it takes memory now and then.
    pool.install(|| {
        let dense = Dense::new(random_matrix(40, 30, 1));
        let (b, scaling) = (rhs(40, 1), dense.scaling());
        let problem = LeastSquares::new(&dense, &b).bounded(Bounds::NOT_NEGATIVE).measured(&scaling);
        let mut start = dense.domain();
        start.fill([0.4; 3]);
        for mut method in all(&dense) {
            dense.count_anew();
            let taken = allocation_counter::measure(|| {
                method.begin(&problem, &start).unwrap();
                for live in [[true; 3], [true, false, true]] {
                    for _ in 0..12 {
                        method.step(&problem, live).unwrap();
                    }
                }
            });
            assert_eq!(taken.count_total, 0, "{}", method.name());
            assert_eq!(dense.asked_for(), [0, 0], "{}", method.name());
        }
        // The measure sees what is taken.
        let taken = allocation_counter::measure(|| drop(std::hint::black_box(CpuVector::<f64>::zeros(8))));
        assert_eq!(taken.count_total, 1);
    });
}
