//! Light through panes: against brute force, and against the parts that an adapter computes it in.

use glam::DVec2;
use unscatter::march::{LightMapTraversal, Real, Traversal};
use unscatter::scene::{Basis, Quadrature};

use crate::scenes;

/// A row as a dense vector; a walk that visits an element twice breaks the traversal's law.
fn row<F: Real>(traversal: &LightMapTraversal, row: usize) -> Vec<[f64; 3]> {
    let mut dense = vec![[0.0; 3]; Traversal::<F, 3>::elements(traversal)];
    traversal.walk(row, &mut |element, weight: [F; 3]| {
        assert_eq!(dense[element], [0.0; 3], "element {element} is visited twice");
        let weight = weight.map(Real::wide);
        assert!(weight.iter().all(|&it| it >= 0.0) && weight != [0.0; 3]);
        dense[element] = weight;
    });
    dense
}

/// The integral by midpoints, from the definition: position, light that arrives, panes before the eye, texel.
fn brute_force(traversal: &LightMapTraversal, row: usize, steps: usize) -> (Vec<[f64; 3]>, f64) {
    let (ray, transport) = (&traversal.rays()[row], traversal.transport());
    let (sigma, grid) = (transport.sigma_t[0], &transport.light_map);
    let end = ray.length.min(-transport.transmittance_bound.ln() / sigma);
    let step = end / steps as f64;
    let mut dense = vec![[0.0; 3]; grid.len()];
    let size = DVec2::new(grid.size[0] as f64, grid.size[1] as f64);
    for j in 0..steps {
        let t = (j as f64 + 0.5) * step;
        let point = ray.origin + ray.direction * t;
        let p = grid.grid_from_light(DVec2::new(point.x, point.y));
        if p.cmplt(DVec2::ZERO).any() || p.cmpge(size).any() {
            continue;
        }
        let seen = traversal.seen_by(row).iter().take_while(|pane| pane.distance < t).last();
        let seen = seen.map_or([1.0; 3], |pane| pane.passes);
        let arriving = transport.shadow_map.light_at(point);
        let weight = ray.scattering[0] * sigma * (-sigma * t).exp() * step;
        let texel = &mut dense[p.y as usize * grid.size[0] + p.x as usize];
        (0..3).for_each(|c| texel[c] += weight * f64::from(arriving[c]) * seen[c]);
    }
    (dense, ray.scattering[0] * sigma * step)
}

fn difference(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).sum()
}

#[test]
fn rows_behind_panes_agree_with_a_million_steps() {
    let (mut colored, mut plain) = (0, 0);
    for seed in 1..40 {
        let rows = scenes::random(seed, 3, Basis::Nearest, Quadrature::Exact);
        let rows = scenes::through_panes(&rows, seed);
        for k in 0..3 {
            let exact = row::<f64>(&rows, k);
            let (brute, a_cut) = brute_force(&rows, k, 1_000_000);
            // One step at each of the cuts in each channel: grid lines of both maps, panes, depths, the ends.
            let tolerance = 3.0 * 160.0 * a_cut + 1e-9;
            let error = difference(&exact, &brute);
            assert!(error <= tolerance, "row {k} of {seed} differs by {error:e}, more than {tolerance:e}");
            let single = difference(&exact, &row::<f32>(&rows, k));
            let all: f64 = exact.iter().flatten().sum();
            assert!(single <= 2e-5 * all + 1e-7, "f32 differs by {single:e} of {all:e}");
            let is_grey = exact.iter().all(|weight| *weight == [weight[0]; 3]);
            *(if is_grey { &mut plain } else { &mut colored }) += 1;
            assert!(is_grey || rows.is_colored(k));
        }
    }
    assert!(colored > 30 && plain > 30, "{colored} coloured rows, {plain} others");
}

#[test]
fn rows_are_what_is_before_panes_and_what_is_beside() {
    for seed in 1..60 {
        let basis = if seed % 2 == 0 { Basis::Nearest } else { Basis::Bilinear };
        let quadrature = if seed % 3 == 0 { Quadrature::March { steps: 37 } } else { Quadrature::Exact };
        let rows = scenes::through_panes(&scenes::random(seed, 8, basis, quadrature), seed);
        let (before, beside) = (rows.before_panes(), rows.beside().unwrap());
        for k in 0..8 {
            let (whole, first) = (row::<f64>(&rows, k), row::<f64>(&before, k));
            let sum: Vec<[f64; 3]> = first
                .iter()
                .zip(row::<f64>(&beside, k))
                .map(|(a, b)| std::array::from_fn(|c| a[c] + b[c]))
                .collect();
            assert!(first.iter().all(|weight| *weight == [weight[0]; 3]), "what is before panes is grey");
            let all: f64 = whole.iter().flatten().sum();
            // The march takes its steps from where a ray leaves the map, and a ray to a pane leaves it earlier.
            if quadrature == Quadrature::Exact {
                assert!(difference(&whole, &sum) <= 1e-13 * (1.0 + all), "row {k} of {seed}");
            }
            let lit = rows.lit_ray(k);
            assert_eq!(lit.weight(), rows.lit_weight(k));
            let mut known = vec![[0.0; 3]; whole.len()];
            lit.walk(0, &mut |element, weight: [f64; 3]| known[element] = weight);
            assert_eq!(known, whole);
        }
    }
}

#[test]
fn sums_of_rows_are_the_lit_weight_inside_the_map() {
    for seed in 1..60 {
        let rows = scenes::random(seed, 8, Basis::Bilinear, Quadrature::Exact);
        let rows = scenes::through_panes(&rows, seed);
        for k in 0..8 {
            let sum = row::<f64>(&rows, k)
                .iter()
                .fold([0.0; 3], |sum: [f64; 3], weight| std::array::from_fn(|c| sum[c] + weight[c]));
            let inside = rows.inside_weight(k);
            (0..3).for_each(|c| assert!((sum[c] - inside[c]).abs() <= 1e-12, "{sum:?} is not {inside:?}"));
        }
    }
}

#[test]
fn panes_that_let_all_through_change_nothing_and_those_that_let_nothing_through_are_walls() {
    use std::sync::Arc;
    use unscatter::march::LightMapTransport;
    use unscatter::visibility::PaneDepth;

    for seed in 1..20 {
        let rows = scenes::random(seed, 8, Basis::Bilinear, Quadrature::Exact);
        let map = &rows.transport().shadow_map;
        let behind = |share: f32| {
            let panes = (0..map.grid().len())
                .map(|texel| (texel, vec![PaneDepth { depth: 0.1, passes: [share; 3] }]));
            let shadow_map = Arc::new((**map).clone().with_panes(panes.collect()).unwrap());
            rows.through(LightMapTransport { shadow_map, ..rows.transport().clone() })
        };
        for k in 0..8 {
            let plain = row::<f64>(&rows, k);
            assert!(difference(&plain, &row::<f64>(&behind(1.0), k)) <= 1e-13);
            let half = row::<f64>(&behind(0.5), k);
            let walls = row::<f64>(&behind(0.0), k);
            // What half passes is half-way between.
            let mean: Vec<[f64; 3]> =
                plain.iter().zip(&walls).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect();
            assert!(difference(&mean, &half) <= 1e-13);
            assert_eq!(walls, row::<f64>(&behind(0.0).before_panes(), k));
        }
    }
}
