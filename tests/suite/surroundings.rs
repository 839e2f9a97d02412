//! The sun and lights from everywhere as elements behind the texels of a light map.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use unscatter::Error;
use unscatter::march::FurtherWeights;
use unscatter::operator::{CpuVector, LinearOperator, Neighbours, TransportOperator, adjoint_test};
use unscatter::problem::{LightMapProblem, Problem, evenly, render, solve};
use unscatter::scene::{Medium, Ray, RegularizationWeight, Rgb, Scene, Strategy, Target};
use unscatter::solve::Control;
use unscatter::sparse::ExplicitMatrix;
use unscatter::visibility::Geometry;

use crate::scenes::Numbers;
use crate::scenes::mist::{CASES, Case, SHAFTS, scene_of};
use crate::tolerances::{
    ADJOINT_F32, ADJOINT_F64, AGAINST_EXPLICIT, SURROUNDINGS_FOUND, SURROUNDINGS_PICTURE, SURROUNDINGS_TRACED,
};

fn explicit(problem: &LightMapProblem) -> ExplicitMatrix {
    match problem.is_grey() {
        true => ExplicitMatrix::new::<1>(&problem.traversal, u64::MAX).unwrap(),
        false => ExplicitMatrix::new::<3>(&problem.traversal, u64::MAX).unwrap(),
    }
}

fn wide(colors: &[Rgb]) -> CpuVector<f64> {
    CpuVector(colors.iter().map(|color| color.map(f64::from)).collect())
}

/// Texels and all that is behind them, each its own.
pub(crate) fn some_light(problem: &LightMapProblem, seed: u64) -> Vec<Rgb> {
    let mut n = Numbers(seed);
    let mut light = problem.starts();
    let texels = problem.maps.light_map.len();
    light[..texels].iter_mut().for_each(|texel| *texel = std::array::from_fn(|_| n.uniform(0.5, 4.0) as f32));
    light[texels..]
        .iter_mut()
        .for_each(|further| *further = std::array::from_fn(|_| n.uniform(0.1, 1.5) as f32));
    light
}

/// What a light shows at the painted pixels.
pub(crate) fn pictured(scene: &Scene, problem: &LightMapProblem, light: &[Rgb]) -> [Vec<Rgb>; 2] {
    let pictures: Vec<_> =
        (0..scene.views.len()).map(|view| render(scene, &problem.maps, Some(light), view).unwrap()).collect();
    let at = |of: fn(&unscatter::problem::Rendering) -> &unscatter::scene::Image| {
        problem.constraints.iter().map(|pixel| of(&pictures[pixel.view]).at(pixel.x, pixel.y)).collect()
    };
    [at(|it| &it.before), at(|it| &it.after)]
}

/// ‖a − b‖ / ‖b‖.
pub(crate) fn distance(a: &[Rgb], b: &[Rgb]) -> f64 {
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    norm(&mut pairs.map(|(&a, &b)| f64::from(a) - f64::from(b)))
        / norm(&mut b.iter().flatten().map(|&b| f64::from(b)))
}

/// What the rows show of a light, all told.
pub(crate) fn shown(problem: &LightMapProblem, light: &[Rgb]) -> Vec<Rgb> {
    let matrix = explicit(problem);
    let mut rows = matrix.range();
    matrix.apply(&wide(light), &mut rows).unwrap();
    let known = problem.known_radiance.iter().zip(&rows.0);
    known.map(|(known, row)| std::array::from_fn(|c| known[c] + row[c] as f32)).collect()
}

#[test]
fn rows_show_what_pictures_show() {
    for case in &CASES {
        let scene = scene_of(case);
        let problem = LightMapProblem::new(&scene).unwrap();
        let ends = problem.traversal.rays().iter().map(|ray| ray.length.is_finite());
        assert!(ends.clone().any(|is_surface| is_surface) && ends.clone().any(|is_surface| !is_surface));
        assert_eq!(problem.is_grey(), case.block == "0.3" && case.panes.is_empty());
        let light = some_light(&problem, 71);
        let [before, after] = pictured(&scene, &problem, &light);
        for (of, light) in [(&before, &problem.starts()), (&after, &light)] {
            let error = distance(&shown(&problem, light), of);
            assert!(error <= SURROUNDINGS_PICTURE, "{case:?}: {error:e}");
        }
        // Of each further element, and of a texel on the floor, one row's worth is missed.
        for element in problem.maps.light_map.len()..problem.elements() {
            let mut other = light.clone();
            other[element] = [0.0; 3];
            let error = distance(&shown(&problem, &other), &after);
            assert!(error > 10.0 * SURROUNDINGS_PICTURE, "{case:?}: {element} makes {error:e}");
        }
    }
}

#[test]
fn paint_is_about_all_that_is_seen() {
    let cases = CASES.iter().filter(|case| case.block == "0.3");
    for (case, target) in cases.flat_map(|case| [(case, Target::Tint), (case, Target::WhiteTint)]) {
        let mut scene = Scene { target, ..scene_of(case) };
        let problem = LightMapProblem::new(&scene).unwrap();
        let [before, _] = {
            // The same lights as they are, or as bright and white.
            let white = |color: Rgb| match target {
                Target::WhiteTint => [0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2]; 3],
                _ => color,
            };
            scene.light.radiance = white(scene.light.radiance);
            scene.ambient = white(scene.ambient);
            if let Some(sky) = scene.surroundings.as_mut().and_then(|it| it.sky.as_mut()) {
                sky.start.iter_mut().for_each(|color| *color = white(*color));
            }
            let start = vec![scene.light.radiance; problem.maps.light_map.len()];
            pictured(&scene, &problem, &start)
        };
        let wanted: Vec<Rgb> = (0..before.len()).map(|row| problem.wanted(row)).collect();
        let painted = problem.constraints.iter().zip(&before);
        let painted: Vec<Rgb> =
            painted.map(|(pixel, seen)| std::array::from_fn(|c| pixel.color[c] * seen[c])).collect();
        let error = distance(&wanted, &painted);
        assert!(error <= SURROUNDINGS_PICTURE, "{case:?}, {target:?}: {error:e}");
    }
}

/// Many midpoints along a ray, with visibility by a ray from each: the integral in the weight of a direction, and what is shown by the
/// surface at the end. `counts` says where light counts.
fn by_midpoints(
    scene: &Scene,
    geometry: &Geometry,
    ray: &Ray,
    towards: DVec3,
    counts: impl Fn(DVec3) -> bool,
    [sees_shadows, sees_surfaces]: [bool; 2],
) -> [f64; 3] {
    const STEPS: usize = 4000;
    let Medium { sigma_t, albedo, .. } = scene.medium;
    let hit = geometry.first_hit(ray, f64::INFINITY);
    let end = hit.map_or(f64::INFINITY, |hit| hit.distance).min(12.0 / sigma_t[0]);
    let panes = geometry.panes(ray, end);
    let seen = |t: f64, c: usize| -> f64 {
        let before = panes.iter().take_while(|pane| pane.distance < t);
        before.map(|pane| f64::from(pane.transmittance[c])).product()
    };
    // What of the light arrives.
    let arriving = |point: DVec3| {
        let light = Ray { origin: point, direction: towards };
        match (counts(point), sees_shadows) {
            (false, _) => [0.0; 3],
            (true, false) => [1.0; 3],
            (true, true) => geometry.transmittance(&light, f64::INFINITY).map(f64::from),
        }
    };
    let phase = scene.medium.phase(towards.dot(ray.direction));
    let mut sum = [0.0; 3];
    for step in 0..STEPS {
        let t = end * (step as f64 + 0.5) / STEPS as f64;
        let arriving = arriving(ray.at(t));
        for c in 0..3 {
            let transmittance = (-sigma_t[c] * t).exp() * seen(t, c) * arriving[c];
            sum[c] += albedo[c] * phase * sigma_t[c] * transmittance * end / STEPS as f64;
        }
    }
    if let Some(hit) = hit.filter(|hit| sees_surfaces && hit.normal.dot(towards) > 0.0) {
        let point = ray.at(hit.distance);
        let arriving = if counts(point) { arriving(point + 1e-3 * hit.normal) } else { [0.0; 3] };
        for c in 0..3 {
            let reflected = f64::from(hit.albedo[c]) * hit.normal.dot(towards) / std::f64::consts::PI;
            sum[c] += (-sigma_t[c] * hit.distance).exp() * reflected * arriving[c] * seen(hit.distance, c);
        }
    }
    sum
}

#[test]
fn columns_are_what_many_points_along_each_ray_see() {
    for case in [&CASES[0], &CASES[4]] {
        columns_are_those_of_points(case);
    }
}

fn columns_are_those_of_points(case: &Case) {
    let scene = scene_of(case);
    let problem = LightMapProblem::new(&scene).unwrap();
    let (matrix, texels) = (explicit(&problem), problem.maps.light_map.len());
    let sky = scene.surroundings.as_ref().and_then(|it| it.sky.as_ref()).unwrap();
    let outside_the_map = |point: DVec3| {
        let p = problem.maps.frame.light_from_world(point);
        let p = problem.maps.light_map.grid_from_light(DVec2::new(p.x, p.y));
        let size = problem.maps.light_map.size.map(|side| side as f64);
        !((0.0..size[0]).contains(&p.x) && (0.0..size[1]).contains(&p.y))
    };
    let rows: Vec<usize> = (0..problem.constraints.len()).step_by(53).collect();
    // How far all columns are from those of points, where these see everything, no shadows, or no surfaces.
    let error = |sees: [bool; 2]| -> f64 {
        let (mut error, mut whole) = (0.0, 0.0);
        for &row in &rows {
            let pixel = problem.constraints[row];
            let ray = scene.views[pixel.view].camera.pixel_ray(pixel.x, pixel.y);
            let of_light = |light: usize| -> [f64; 3] {
                sky.basis.directions(light).into_iter().fold([0.0; 3], |sum, (towards, angle)| {
                    let weight = by_midpoints(&scene, &problem.maps.geometry, &ray, towards, |_| true, sees);
                    std::array::from_fn(|c| sum[c] + angle * weight[c])
                })
            };
            let sun = by_midpoints(
                &scene,
                &problem.maps.geometry,
                &ray,
                -scene.light.direction,
                outside_the_map,
                sees,
            );
            let further = std::iter::once(sun).chain((0..sky.basis.len()).map(of_light));
            for (element, points) in further.enumerate() {
                for (c, points) in points.into_iter().enumerate() {
                    let weight = matrix.channel(c).get(row, texels + element).copied().unwrap_or_default();
                    error += (weight - points).powi(2);
                    whole += points.powi(2);
                }
            }
        }
        (error / whole).sqrt()
    };
    let seen = error([true, true]);
    assert!(seen <= SURROUNDINGS_TRACED, "{seen:e}");
    for sees in [[false, true], [true, false]] {
        let seen = error(sees);
        assert!(seen > 10.0 * SURROUNDINGS_TRACED, "{sees:?}: {seen:e}");
    }
}

/// Both products of an operator with the same vectors, on the host.
fn products(operator: &impl LinearOperator) -> [Vec<[f64; 3]>; 2] {
    use unscatter::operator::Vector;
    let mut n = Numbers(31);
    let mut values = |len: usize| -> Vec<[f64; 3]> {
        (0..len).map(|_| std::array::from_fn(|_| f64::from(n.uniform(-1.0, 1.0) as f32))).collect()
    };
    let (mut x, mut y) = (operator.domain(), operator.range());
    x.set_from_host(&values(x.len())).unwrap();
    operator.apply(&x, &mut y).unwrap();
    let forward = y.to_host().unwrap();
    y.set_from_host(&values(y.len())).unwrap();
    operator.apply_adjoint(&y, &mut x).unwrap();
    [forward, x.to_host().unwrap()]
}

fn relative(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    norm(&mut pairs.map(|(a, b)| a - b)) / norm(&mut b.iter().flatten().copied())
}

/// Asserts that an operator is the explicit matrix of a problem, and that its adjoint is one.
fn assert_is_explicit(name: &str, problem: &LightMapProblem, operator: &impl TransportOperator) {
    let (truth, got) = (products(&explicit(problem)), products(operator));
    for direction in 0..2 {
        let error = relative(&got[direction], &truth[direction]);
        assert!(error <= AGAINST_EXPLICIT, "{name}, direction {direction}: {error:e}");
    }
    let error = adjoint_test(operator, 3, 5).unwrap().error;
    assert!(error <= ADJOINT_F32, "{name}: {error:e}");
}

#[test]
fn both_strategies_are_the_explicit_matrix_and_have_its_adjoint() {
    for case in CASES.iter().chain([&SHAFTS]) {
        let problem = LightMapProblem::new(&scene_of(case)).unwrap();
        assert!(adjoint_test(&explicit(&problem), 3, 5).unwrap().error <= ADJOINT_F64);
        for strategy in [Strategy::Assembled, Strategy::MatrixFree] {
            let operator = problem.on_cpu(strategy, u64::MAX).unwrap();
            assert_is_explicit(&format!("{case:?}, {strategy:?}"), &problem, &operator);
        }
        // One weight of one light makes a difference.
        let matrix = explicit(&problem);
        let mut other = wide(&problem.starts());
        let mut rows = [matrix.range(), matrix.range()];
        matrix.apply(&other, &mut rows[0]).unwrap();
        other.0.last_mut().unwrap()[0] += 1.0;
        matrix.apply(&other, &mut rows[1]).unwrap();
        assert!(relative(&rows[1].0, &rows[0].0) > 10.0 * AGAINST_EXPLICIT);
    }
}

#[cfg(feature = "gpu")]
#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn rows_on_an_adapter_are_the_explicit_matrix() {
    let gpu = crate::gpu::gpu();
    for case in CASES.iter().chain([&SHAFTS]) {
        let problem = LightMapProblem::new(&scene_of(case)).unwrap();
        for (strategy, deterministic) in
            [(Strategy::Assembled, false), (Strategy::MatrixFree, false), (Strategy::MatrixFree, true)]
        {
            let operator = problem.on_gpu(&gpu, strategy, u64::MAX, deterministic);
            assert_is_explicit(&format!("{case:?}, {strategy:?}"), &problem, &operator.unwrap());
        }
    }
}

#[test]
fn a_few_rows_are_the_rows_they_are() {
    let problem = LightMapProblem::new(&scene_of(&CASES[0])).unwrap();
    let few = problem.of_some(&evenly(100, problem.constraints.len()));
    let [all, few_of_all] = [&problem, &few].map(|problem| shown(problem, &some_light(problem, 3)));
    let expected: Vec<Rgb> = evenly(100, all.len()).into_iter().map(|row| all[row]).collect();
    assert_eq!(few_of_all, expected);
}

/// All elements that a problem's solve finds for pictures.
fn found(scene: &Scene, problem: &LightMapProblem) -> Vec<Rgb> {
    let operator = problem.on_cpu(scene.solve.strategy, u64::MAX).unwrap();
    let coverage = operator.squares(&problem.weights()).unwrap();
    let solved =
        solve(problem, &operator, &coverage, &scene.solve, None, |_, _| Ok(Control::Continue)).unwrap();
    solved.x
}

/// A problem whose pixels should show this much.
fn wanting(mut problem: LightMapProblem, pictures: &[Rgb]) -> LightMapProblem {
    for (row, wanted) in pictures.iter().enumerate() {
        problem.targets[row] = std::array::from_fn(|c| wanted[c] - problem.known_radiance[row][c]);
    }
    problem
}

/// The same rows with what is behind the texels as it starts, and known.
fn only_texels(mut problem: LightMapProblem) -> LightMapProblem {
    let shown = problem.traversal.further_weights().unwrap().clone();
    for (row, known) in problem.known_radiance.iter_mut().enumerate() {
        for (further, start) in problem.further_start.iter().enumerate() {
            let weight = shown.weight(row, further);
            (0..3).for_each(|c| known[c] += weight[c] * start[c]);
        }
    }
    let reflected = (0..problem.constraints.len()).map(|row| *shown.reflected(row)).collect();
    let surfaces = FurtherWeights::new(0, &[], reflected).unwrap();
    problem.traversal = problem.traversal.with_further(Arc::new(surfaces));
    problem.further_start.clear();
    problem.replan();
    problem
}

#[test]
fn known_light_comes_back_and_a_light_map_alone_is_no_match() {
    for case in &CASES {
        let scene = scene_of(case);
        let problem = LightMapProblem::new(&scene).unwrap();
        let truth = some_light(&problem, 17);
        let [before, pictures] = pictured(&scene, &problem, &truth);
        let problem = wanting(problem, &pictures);
        let light = found(&scene, &problem);
        let [_, after] = pictured(&scene, &problem, &light);
        let [start, end] = [&before, &after].map(|seen| distance(seen, &pictures));
        assert!(end <= SURROUNDINGS_FOUND, "{case:?}: {start} to {end}");
        assert!(start > 10.0 * SURROUNDINGS_FOUND);

        // The same pictures, with only the light map free.
        let texels = problem.maps.light_map.len();
        let fixed = wanting(only_texels(LightMapProblem::new(&scene).unwrap()), &pictures);
        let mut light = problem.starts();
        light[..texels].copy_from_slice(&found(&scene, &fixed));
        let [_, after] = pictured(&scene, &problem, &light);
        let by_map = distance(&after, &pictures);
        assert!(by_map > 5.0 * end, "{case:?}: {by_map} and {end}");
    }
}

#[test]
fn regularizers_among_neighbours_leave_the_surroundings_alone() {
    let nowhere = unscatter::operator::NOWHERE;
    let with = Neighbours::new([3, 2], &[0, 1, 2, 4, nowhere, nowhere]).unwrap();
    let without = Neighbours::new([3, 2], &[0, 1, 2, 4]).unwrap();
    assert_eq!(with.edges(), without.edges());
    assert_eq!(with.degrees(), [without.degrees(), vec![0, 0]].concat());

    let mut scene = scene_of(&CASES[0]);
    let problem = LightMapProblem::new(&scene).unwrap();
    let truth = some_light(&problem, 23);
    let [_, pictures] = pictured(&scene, &problem, &truth);
    let problem = wanting(problem, &pictures);
    scene.solve.regularization.gradient = RegularizationWeight::Relative(1e4);
    let light = found(&scene, &problem);
    let [texels, further] = problem.parted(&light);
    // Texels that are hardly allowed to differ; lights beside each other differ as they did.
    let spread = |colors: &[Rgb]| {
        let values = colors.iter().map(|color| color[0]);
        values.clone().fold(f32::MIN, f32::max) - values.fold(f32::MAX, f32::min)
    };
    let reached: Vec<Rgb> = texels.iter().copied().filter(|texel| *texel != problem.start).collect();
    assert!(spread(&reached) < 0.2, "{}", spread(&reached));
    assert!(spread(&further[1..]) > 0.3, "{}", spread(&further[1..]));
}

#[test]
fn light_that_shows_nowhere_is_an_error() {
    let refused = |surroundings: &'static str, change: &dyn Fn(&mut Scene)| {
        let mut scene = scene_of(&Case { surroundings, ..CASES[1] });
        change(&mut scene);
        match LightMapProblem::new(&scene).map(|_| ()) {
            Err(Error::Empty { reason, .. }) => reason,
            other => panic!("{other:?}"),
        }
    };
    // Everything lies inside the light map.
    let wide = |scene: &mut Scene| {
        let corner = DVec2::splat(1e4);
        scene.light_map.extent = Some(unscatter::scene::Extent { min: -corner, max: corner });
    };
    assert!(refused(r#"{"sun": true}"#, &wide).contains("any of the sun"));
    // Nothing comes through the floor, and smoke that only absorbs shows no light.
    let below = r#"{"environment": {"lights": {"count": 1, "over": "upper-hemisphere", "up": [0, -1, 0]}, "shadow_map": 64}}"#;
    let cover = |scene: &mut Scene| {
        scene.medium.albedo = [0.0; 3];
        let sides = [DVec3::Z * 1e4, DVec3::X * 1e4];
        let floor = unscatter::scene::Primitive::Plane { centre: DVec3::new(0.0, -0.1, 0.0), sides };
        scene.mesh = floor.mesh([0.5; 3]).unwrap().into();
    };
    assert!(refused(below, &cover).contains("none of the 1 lights"));
}

#[test]
fn rows_without_a_pane_stay_grey_and_the_others_are_kept_beside_them() {
    let problem = LightMapProblem::new(&scene_of(&SHAFTS)).unwrap();
    let colored: Vec<usize> = (0..problem.rows()).filter(|&row| problem.traversal.is_colored(row)).collect();
    assert!(
        colored.len() > 100 && colored.len() < problem.rows() / 2,
        "{} of {}",
        colored.len(),
        problem.rows()
    );
    assert!(!problem.is_grey());
    // Three weights for coloured rows alone.
    let kept = problem.on_cpu(Strategy::Assembled, u64::MAX).unwrap().storage();
    let grey: Vec<usize> = (0..problem.rows()).filter(|row| colored.binary_search(row).is_err()).collect();
    let of = |rows: &[usize]| problem.of_some(rows).on_cpu(Strategy::Assembled, u64::MAX).unwrap().storage();
    assert_eq!(kept.bytes, of(&grey).bytes + of(&colored).bytes);
    assert!(problem.of_some(&grey).is_grey());
    // As much as memory allows, and to the same end.
    let little = problem.on_cpu(Strategy::Auto, kept.bytes / 3).unwrap();
    let storage = little.storage();
    assert!(storage.kept_rows > 0 && storage.walked_rows > 0 && storage.bytes <= kept.bytes / 3);
    assert_is_explicit("little memory", &problem, &little);
}
