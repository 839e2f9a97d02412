//! The traversal against brute force, closed forms and itself.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use proptest::prelude::*;
use unscatter::march::{LightMapTransport, LightMapTraversal, Real, Traversal, ViewRay};
use unscatter::scene::{Basis, Grid, Medium, Quadrature};
use unscatter::visibility::ShadowMap;

use crate::scenes::{self, extent};

/// A row as a dense vector; a walk that visits an element twice breaks the traversal's law.
fn row<F: Real>(traversal: &LightMapTraversal, row: usize) -> Vec<f64> {
    let mut dense = vec![0.0; Traversal::<F, 1>::elements(traversal)];
    traversal.walk(row, &mut |element, weight: [F; 1]| {
        assert_eq!(dense[element], 0.0, "element {element} is visited twice");
        assert!(weight[0].wide() > 0.0);
        dense[element] = weight[0].wide();
    });
    dense
}

#[test]
fn a_ray_whose_lit_stretches_are_known_is_the_same_row_to_the_bit() {
    let mut lit = 0;
    for seed in 0..40 {
        let basis = if seed % 2 == 0 { Basis::Nearest } else { Basis::Bilinear };
        let rows = scenes::random(seed, 24, basis, Quadrature::Exact);
        // Which nodes a pyramid has is nothing that a row depends on.
        let transport = rows.transport().clone();
        let shadow_map = Arc::new((*transport.shadow_map).clone().without_pyramid());
        let texels = rows.through(LightMapTransport { shadow_map, ..transport });
        for index in 0..rows.rays().len() {
            let ray = rows.lit_ray(index);
            assert_eq!(ray.weight(), rows.lit_weight(index));
            let mut known = vec![0.0; Traversal::<f64, 1>::elements(&ray)];
            ray.walk(0, &mut |element, weight: [f64; 1]| known[element] = weight[0]);
            assert_eq!(known, row::<f64>(&rows, index));
            assert_eq!(known, row::<f64>(&texels, index));
            assert!(rows.extent(index).shadow_nodes <= texels.extent(index).shadow_nodes);
            lit += usize::from(known.iter().any(|&weight| weight > 0.0));
        }
    }
    assert!(lit > 100, "only {lit} rows have any light");
}

/// The integral by `steps` midpoints, from the definition: position, shadow lookup, basis lookup.
/// Returns the row and the largest error that one discontinuity can make.
fn brute_force(traversal: &LightMapTraversal, row: usize, steps: usize) -> (Vec<f64>, f64) {
    let (ray, transport) = (&traversal.rays()[row], traversal.transport());
    let (sigma, grid) = (transport.sigma_t[0], &transport.light_map);
    let end = ray.length.min(-transport.transmittance_bound.ln() / sigma);
    let step = end / steps as f64;
    let mut dense = vec![0.0; grid.len()];
    let size = DVec2::new(grid.size[0] as f64, grid.size[1] as f64);
    for j in 0..steps {
        let t = (j as f64 + 0.5) * step;
        let point = ray.origin + ray.direction * t;
        let p = grid.grid_from_light(DVec2::new(point.x, point.y));
        if p.cmplt(DVec2::ZERO).any() || p.cmpge(size).any() || !transport.shadow_map.is_lit(point) {
            continue;
        }
        let weight = ray.scattering[0] * sigma * (-sigma * t).exp() * step;
        match transport.basis {
            Basis::Nearest => dense[p.y as usize * grid.size[0] + p.x as usize] += weight,
            Basis::Bilinear => {
                let q = (p - 0.5).clamp(DVec2::ZERO, size - 1.0);
                let low = q.floor().min((size - 2.0).max(DVec2::ZERO));
                let f = q - low;
                for (x, fx) in [(low.x, 1.0 - f.x), (low.x + 1.0, f.x)] {
                    for (y, fy) in [(low.y, 1.0 - f.y), (low.y + 1.0, f.y)] {
                        if fx * fy > 0.0 {
                            dense[y as usize * grid.size[0] + x as usize] += weight * fx * fy;
                        }
                    }
                }
            }
        }
    }
    (dense, ray.scattering[0] * sigma * step)
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..Default::default() })]

    #[test]
    fn exact_rows_agree_with_a_million_steps(seed in 1u64.., bilinear: bool) {
        let basis = if bilinear { Basis::Bilinear } else { Basis::Nearest };
        let traversal = scenes::random(seed, 3, basis, Quadrature::Exact);
        for k in 0..3 {
            let exact = row::<f64>(&traversal, k);
            let (brute, a_cut) = brute_force(&traversal, k, 1_000_000);
            // One step at each of the cuts: grid lines of both maps, depth crossings, the two ends.
            let tolerance = 120.0 * a_cut + 1e-9;
            let error = difference(&exact, &brute);
            prop_assert!(error <= tolerance, "row {k} differs by {error:e}, more than {tolerance:e}");
        }
    }

    #[test]
    fn the_march_is_what_it_says(seed in 1u64.., bilinear: bool, steps in 1u32..400) {
        let basis = if bilinear { Basis::Bilinear } else { Basis::Nearest };
        let marched = scenes::random(seed, 6, basis, Quadrature::March { steps });
        for k in 0..6 {
            // The march ends where the ray leaves the light map; make that the end for brute force as well.
            let mut ray = marched.rays()[k];
            let reach = -marched.transport().transmittance_bound.ln() / marched.transport().sigma_t[0];
            let size = marched.transport().light_map.size.map(|side| side as f64);
            let at = |t: f64| {
                let p = ray.origin + ray.direction * t;
                marched.transport().light_map.grid_from_light(DVec2::new(p.x, p.y))
            };
            let (origin, slope) = (at(0.0), at(1.0) - at(0.0));
            let leave = (0..2).filter(|&a| slope[a] != 0.0).map(|a| {
                ((0.0 - origin[a]) / slope[a]).max((size[a] - origin[a]) / slope[a])
            }).fold(ray.length.min(reach), f64::min);
            prop_assume!(leave.is_finite() && !(0.0..=1e-6).contains(&leave));
            ray.length = leave.max(0.0);
            let alone = LightMapTraversal::new(marched.transport().clone(), Arc::new([ray]));
            let (brute, a_step) = brute_force(&alone, 0, steps as usize);
            let error = difference(&row::<f64>(&marched, k), &brute);
            // A sample that falls on an edge to the last bit may be taken on either side.
            prop_assert!(error <= 1e-12 || error <= 2.001 * a_step, "row {k}: {error:e} of {a_step:e}");
        }
    }

    #[test]
    fn single_precision_walks_agree(seed in 1u64.., bilinear: bool) {
        let basis = if bilinear { Basis::Bilinear } else { Basis::Nearest };
        let traversal = scenes::random(seed, 16, basis, Quadrature::Exact);
        for k in 0..16 {
            let (double, single) = (row::<f64>(&traversal, k), row::<f32>(&traversal, k));
            let sum: f64 = double.iter().sum();
            let error = difference(&double, &single);
            prop_assert!(error <= 2e-4 * sum + 1e-7, "row {k}: {error:e} of {sum:e}, {:?}", traversal.rays()[k]);
        }
    }

    #[test]
    fn row_sums_are_the_lit_weight_inside_the_map(seed in 1u64.., bilinear: bool) {
        let basis = if bilinear { Basis::Bilinear } else { Basis::Nearest };
        let traversal = scenes::random(seed, 16, basis, Quadrature::Exact);
        for k in 0..16 {
            let sum: f64 = row::<f64>(&traversal, k).iter().sum();
            let (all, outside) = (traversal.lit_weight(k)[0], traversal.outside_weight(k)[0]);
            prop_assert!((sum + outside - all).abs() <= 1e-13, "row {k}: {sum} + {outside} is not {all}");
        }
    }
}

#[test]
fn a_wrong_texel_is_noticed() {
    // The sabotage twin of the comparisons above.
    let traversal = scenes::random(7, 40, Basis::Bilinear, Quadrature::Exact);
    let mut noticed = 0;
    for k in 0..40 {
        let mut exact = row::<f64>(&traversal, k);
        let (brute, a_cut) = brute_force(&traversal, k, 20_000);
        let Some(largest) = (0..exact.len()).max_by(|&a, &b| exact[a].total_cmp(&exact[b])) else { continue };
        if exact[largest] > 0.0 && exact.len() > 1 {
            let weight = std::mem::take(&mut exact[largest]);
            exact[(largest + 1) % brute.len()] += weight;
            assert!(difference(&exact, &brute) > weight.min(120.0 * a_cut));
            noticed += 1;
        }
    }
    assert!(noticed > 10);
}

/// One ray through maps over [0, 4]², with the given depths along u.
fn simple(size: usize, basis: Basis, depths: &[f32], ray: ViewRay, sigma: f64) -> LightMapTraversal {
    let area = extent([0.0, 0.0], [4.0, 4.0]);
    let shadow = Grid::new(area, [depths.len(), 1]).unwrap();
    let transport = LightMapTransport {
        sigma_t: [sigma; 3],
        shadow_map: Arc::new(ShadowMap::new(shadow, 0.0, depths).unwrap()),
        light_map: Grid::new(area, [size, size]).unwrap(),
        basis,
        quadrature: Quadrature::Exact,
        transmittance_bound: 1e-300,
        mask: None,
    };
    LightMapTraversal::new(transport, Arc::new([ray]))
}

fn ray(origin: [f64; 3], direction: [f64; 3], length: f64) -> ViewRay {
    let direction = DVec3::from_array(direction).normalize();
    ViewRay { origin: DVec3::from_array(origin), direction, length, scattering: [0.08; 3] }
}

const BOTH: [Basis; 2] = [Basis::Nearest, Basis::Bilinear];

#[test]
fn open_medium() {
    for (basis, sigma) in BOTH.into_iter().flat_map(|b| [1e-8, 0.03, 1.0, 50.0].map(|s| (b, s))) {
        let length = 3.5;
        let open = simple(16, basis, &[f32::INFINITY], ray([0.2, 0.3, 0.0], [1.0, 0.9, 0.4], length), sigma);
        let truth = 0.08 * -(-sigma * length).exp_m1();
        let sum: f64 = row::<f64>(&open, 0).iter().sum();
        assert!((sum / truth - 1.0).abs() < 1e-13, "{basis:?} {sigma}: {sum} is not {truth}");
    }
}

#[test]
fn half_shadowed_ray() {
    // Depth 1 over the near half: the ray at depth 2 is in shadow until u = 2; at depth 0.5 it never is.
    let sigma = 0.7_f64;
    for basis in BOTH {
        let depths = [1.0, 1.0, f32::INFINITY, f32::INFINITY];
        let below = simple(8, basis, &depths, ray([0.0, 1.0, 2.0], [1.0, 0.0, 0.0], 4.0), sigma);
        let truth = 0.08 * ((-sigma * 2.0).exp() - (-sigma * 4.0).exp());
        assert!((row::<f64>(&below, 0).iter().sum::<f64>() / truth - 1.0).abs() < 1e-13);
        let above = simple(8, basis, &depths, ray([0.0, 1.0, 0.5], [1.0, 0.0, 0.0], 4.0), sigma);
        let open = 0.08 * (1.0 - (-sigma * 4.0).exp());
        assert!((row::<f64>(&above, 0).iter().sum::<f64>() / open - 1.0).abs() < 1e-13);
    }
}

#[test]
fn a_slab_of_light_is_cut_where_the_ray_meets_the_depth() {
    // Depth 1 everywhere; the ray goes down along the light and dives under it at t = √2 exactly.
    let sigma = 0.4_f64;
    for basis in BOTH {
        let down = simple(64, basis, &[1.0; 7], ray([0.5, 1.0, 0.0], [1.0, 0.0, 1.0], 4.0), sigma);
        let truth = 0.08 * -(-sigma * 2f64.sqrt()).exp_m1();
        assert!((row::<f64>(&down, 0).iter().sum::<f64>() / truth - 1.0).abs() < 1e-13);
        let up = simple(64, basis, &[1.0; 7], ray([0.5, 1.0, 2.0], [1.0, 0.0, -1.0], 4.0), sigma);
        let truth = 0.08 * ((-sigma * 2f64.sqrt()).exp() - (-sigma * 4.0).exp());
        assert!((row::<f64>(&up, 0).iter().sum::<f64>() / truth - 1.0).abs() < 1e-13);
    }
}

#[test]
fn rays_that_miss_have_empty_rows() {
    for basis in BOTH {
        for missing in [
            ray([-1.0, 1.0, 0.0], [-1.0, 0.0, 0.0], f64::INFINITY),
            ray([1.0, 1.0, 0.0], [1.0, 0.0, 0.0], 0.0),
            ray([-1.0, 1.0, 0.0], [1.0, 0.0, 0.0], 0.5),
            ray([5.0, 5.0, 0.0], [0.0, 0.0, 1.0], f64::INFINITY),
            ray([2.0, -3.0, 0.0], [1.0, 0.0, 0.0], f64::INFINITY),
        ] {
            let traversal = simple(8, basis, &[f32::INFINITY], missing, 0.1);
            assert!(row::<f64>(&traversal, 0).iter().all(|&weight| weight == 0.0), "{missing:?}");
        }
    }
}

#[test]
fn a_ray_along_the_light_stays_in_its_texel() {
    let traversal =
        simple(4, Basis::Nearest, &[3.0; 4], ray([1.5, 2.5, 0.0], [0.0, 0.0, 1.0], f64::INFINITY), 0.5);
    let dense = row::<f64>(&traversal, 0);
    let truth = 0.08 * -(-0.5 * 3.0_f64).exp_m1();
    assert!((dense[2 * 4 + 1] / truth - 1.0).abs() < 1e-14);
    assert_eq!(dense.iter().filter(|&&weight| weight > 0.0).count(), 1);
}

#[test]
fn rays_on_grid_lines_and_through_corners_lose_nothing() {
    for basis in BOTH {
        for grazing in [
            ray([0.0, 2.0, 0.0], [1.0, 0.0, 0.0], 4.0),
            ray([0.0, 0.0, 0.0], [1.0, 1.0, 0.0], 32f64.sqrt()),
            ray([4.0, 4.0, 0.0], [-1.0, -1.0, 0.3], 5.0),
            ray([4.0, 0.0, 0.0], [-1.0, 1.0, 0.0], 32f64.sqrt()),
        ] {
            let traversal = simple(8, basis, &[f32::INFINITY; 8], grazing, 0.2);
            let truth = 0.08 * -(-0.2 * grazing.length).exp_m1();
            let sum: f64 = row::<f64>(&traversal, 0).iter().sum();
            assert!((sum / truth - 1.0).abs() < 1e-12, "{grazing:?}: {sum} is not {truth}");
        }
    }
}

#[test]
fn coloured_media_walk_each_channel() {
    let medium = Medium::new([0.1, 0.5, 2.0], [1.0, 0.5, 0.0], 0.0).unwrap();
    let mut traversal =
        simple(8, Basis::Bilinear, &[f32::INFINITY], ray([0.1, 0.2, 0.0], [1.0, 0.4, 0.0], 3.0), 1.0);
    let mut transport = traversal.transport().clone();
    transport.sigma_t = medium.sigma_t;
    let mut view = traversal.rays()[0];
    view.scattering = medium.albedo.map(|albedo| albedo * medium.phase(0.0));
    traversal = LightMapTraversal::new(transport, Arc::new([view]));
    let mut sums = [0.0; 3];
    traversal.walk(0, &mut |_, weight: [f64; 3]| (0..3).for_each(|c| sums[c] += weight[c]));
    for c in 0..3 {
        let truth = view.scattering[c] * -(-medium.sigma_t[c] * 3.0).exp_m1();
        assert!((sums[c] - truth).abs() <= 1e-15, "channel {c}: {} is not {truth}", sums[c]);
    }
}
