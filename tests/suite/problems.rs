//! What every kind of problem promises as a `Problem`: light maps, transfer functions, all that is looked for in volumes, and lights around them.

use unscatter::operator::{LinearOperator, NOWHERE, TransportOperator, adjoint_test};
use unscatter::problem::{LightMapProblem, Problem};
use unscatter::scene::{Environment, Find, Interpolation, Quadrature, SolveSettings, Strategy};

use crate::scenes::mist;
use crate::scenes::volume::{Cloud, problem};
use crate::tolerances::ADJOINT_F32;

/// One of each kind, and what it is.
fn each(mut check: impl FnMut(&str, &dyn Problem)) {
    for case in mist::CASES.iter().chain([&mist::SHAFTS]) {
        check(&format!("{case:?}"), &LightMapProblem::new(&mist::scene_of(case)).unwrap());
    }
    check("a transfer function", &crate::looks::transfer_problem("{}"));
    let cloud = Cloud::seen_twice(false, Interpolation::Trilinear).shrunk(16);
    let mut scene = cloud.scene();
    scene.environment = Environment::constant([1.0, 0.8, 0.6], 8).unwrap();
    let finds =
        [Find::Emission, Find::Albedo, Find::Joint, Find::Extinction, Find::Refinement, Find::Environment];
    for find in finds {
        check(find.name(), &problem(&scene, &cloud.even(), find));
    }
}

/// The non-zeros of a row.
fn row(problem: &dyn Problem, row: usize) -> Vec<(usize, [f64; 3])> {
    let mut nonzeros = Vec::new();
    problem.row(row, &mut |element, weight| nonzeros.push((element, weight)));
    nonzeros
}

#[test]
fn rows_are_those_of_the_matrix_and_stay_what_they_are() {
    each(|name, problem| {
        let explicit = problem.explicit(u64::MAX).unwrap();
        assert_eq!(explicit.is_grey(), problem.is_grey(), "{name}");
        assert!(problem.explicit(1).is_err(), "{name}");
        let rows: Vec<usize> = (0..problem.rows()).step_by(problem.rows() / 40).collect();
        let picked = problem.picked(&rows);
        let same = problem.integrated(Quadrature::Exact, None).unwrap();
        for (index, &number) in rows.iter().enumerate() {
            let nonzeros = row(problem, number);
            for &(element, weight) in &nonzeros {
                for c in 0..3 {
                    let there = explicit.channel(c).get(number, element).copied().unwrap_or_default();
                    assert_eq!(there, weight[c], "{name}, row {number}");
                }
            }
            let in_matrix = explicit.channel(0).outer_view(number).unwrap().nnz();
            assert_eq!(in_matrix, nonzeros.len(), "{name}, row {number}");
            assert_eq!(row(&*picked, index), nonzeros, "{name}, row {number}");
            assert_eq!(row(&*same, number), nonzeros, "{name}, row {number}");
            assert_eq!(picked.pixel(index), problem.pixel(number), "{name}");
            assert_eq!(picked.targets()[index], problem.targets()[number], "{name}");
        }
        assert_eq!(problem.sampled(7).rows(), 7, "{name}");
    });
}

#[test]
fn parts_are_all_elements_and_every_place_is_there_once() {
    each(|name, problem| {
        let formulation = problem.formulation(&SolveSettings::default()).unwrap();
        let elements = formulation.elements();
        assert_eq!(elements, problem.plan().elements, "{name}");
        assert_eq!(formulation.starts().len(), elements, "{name}");
        assert_eq!(problem.targets().len(), problem.weights().0.len(), "{name}");
        assert!(problem.candidates() >= elements && problem.ray_bytes() > 0, "{name}");
        let mut places = formulation.places(&(0..elements as u32).collect::<Vec<_>>());
        places.retain(|&place| place != NOWHERE);
        assert!(places.iter().all(|&place| (place as usize) < formulation.lattices().len()), "{name}");
        let count = places.len();
        places.sort_unstable();
        places.dedup();
        assert_eq!(places.len(), count, "{name}: a place twice");
        let placed = formulation.parts.iter().filter(|part| part.lattice.is_some());
        assert_eq!(placed.map(|part| part.start.len()).sum::<usize>(), count, "{name}");
        assert!(!problem.views().is_empty(), "{name}");
    });
}

#[test]
fn operators_in_both_precisions_have_the_shape_of_the_problem() {
    each(|name, problem| {
        for strategy in [Strategy::Assembled, Strategy::MatrixFree] {
            let operator = problem.on_cpu(strategy, u64::MAX).unwrap();
            assert!(adjoint_test(&operator, 1, 5).unwrap().error <= ADJOINT_F32, "{name}");
            assert_eq!(operator.range().0.len(), problem.rows(), "{name}");
            let wide = problem.wide(strategy).unwrap();
            assert!(adjoint_test(&wide, 1, 5).unwrap().error <= 1e-13, "{name}");
            assert_eq!(
                operator.squares(&problem.weights()).unwrap().0.len(),
                wide.domain().0.len(),
                "{name}"
            );
        }
    });
}

#[test]
fn what_is_not_skipped_is_walked_in_vain() {
    each(|name, problem| {
        let Some(entered) = problem.unskipped() else { return };
        let [skipping, without] = entered.work;
        // Extinction may be anywhere, so no voxel of it is left out.
        let is_of_extinction = ["extinction", "refinement"].contains(&name);
        let is_less = skipping < without || is_of_extinction && skipping == without;
        assert!(is_less, "{name}: {skipping} of {without} {}", entered.unit);
        for number in (0..problem.rows()).step_by(problem.rows() / 40) {
            // Zeros may be visited; what is not zero is the same.
            let other = |of: Vec<(usize, [f64; 3])>| -> Vec<(usize, [f64; 3])> {
                of.into_iter().filter(|(_, weight)| *weight != [0.0; 3]).collect()
            };
            let (with, without) = (other(row(problem, number)), other(row(&*entered.problem, number)));
            assert_eq!(with.len(), without.len(), "{name}, row {number}");
            for ((element, weight), (there, other)) in with.iter().zip(&without) {
                assert_eq!(element, there, "{name}, row {number}");
                (0..3).for_each(|c| assert!((weight[c] - other[c]).abs() <= 1e-12 * other[c].abs().max(1.0)));
            }
        }
    });
}
