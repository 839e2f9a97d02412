//! Depths that tie with the shadow map's, and surfaces that lie in each other.

use glam::DVec3;

use super::case::{Case, Measurements, Setting};
use super::hall::{Hall, problem};
use super::rows::{BASES, WorldPlace, apart, light_map_rows, relative, row_sum, texels, view_ray, worse};
use crate::Result;
use crate::march::{LightMapTraversal, ViewRay};
use crate::scene::Basis;
use crate::visibility::ShadowMap;

pub(super) const CASES: [Case; 4] = [
    Case {
        name: "shadow/ties",
        law: "a point at the stored depth is lit, the next number behind it is not",
        why: "closed form of what is lit, and 0",
        run: ties,
    },
    Case {
        name: "shadow/tied-texels",
        law: "along texels of which every other ties and the rest are one f32 nearer, just those are lit",
        why: "closed form of the lit texels",
        run: tied_texels,
    },
    Case {
        name: "shadow/grazing",
        law: "a ray at a small angle to a shadow's end is cut where it meets the stored depth",
        why: "closed form of what is lit",
        run: grazing,
    },
    Case {
        name: "shadow/coplanar",
        law: "surfaces that lie in each other three times over have the matrix of one",
        why: "0",
        run: coplanar,
    },
];

const EXACT: f64 = 1e-13;
const SIGMA_T: f64 = 0.7;
const SIDE: usize = 64;
const LENGTH: f64 = 3.5;

/// The square of 4 × 4 metres around the origin under a shadow map of 64 × 64 depths.
fn under(
    depth: impl Fn(usize) -> f32,
    depth_origin: f64,
    basis: Basis,
    rays: Vec<ViewRay>,
) -> Result<LightMapTraversal> {
    let grid = texels([-2.0; 2], [2.0; 2], [SIDE; 2], &WorldPlace::PLAIN)?;
    let depths: Vec<f32> = (0..SIDE * SIDE).map(depth).collect();
    Ok(light_map_rows(grid, ShadowMap::new(grid, depth_origin, &depths)?, [SIGMA_T; 3], basis, rays))
}

fn worst(setting: &Setting, rows: &LightMapTraversal, truth: impl Fn(&ViewRay) -> f64) -> f64 {
    let tested = setting.tested(rows);
    let error = |(row, ray)| {
        let [sum] = row_sum::<1>(&tested, row);
        relative(sum, truth(ray))
    };
    rows.rays().iter().enumerate().map(error).fold(0.0, worse)
}

fn ties(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let directions = [DVec3::X, DVec3::NEG_Y, DVec3::new(1.0, 1.0, 0.0), DVec3::new(-0.3, 0.8, 0.0)];
    let all = -(-SIGMA_T * 1.75f64).exp_m1();
    for basis in BASES {
        for (stored, depth_origin) in [(0.5, 0.0), (0.0, 0.25), (0.75, -1024.0)] {
            let stored: f32 = stored;
            let tie = f64::from(stored) + depth_origin;
            for (name, depth, lit) in [
                ("at it", tie, all),
                ("the number before", tie.next_down(), all),
                ("the number behind", tie.next_up(), 0.0),
            ] {
                let ray = |direction| view_ray(DVec3::new(0.0, 0.0, depth), direction, 1.75);
                let rows = under(|_| stored, depth_origin, basis, directions.map(ray).to_vec())?;
                let place = format!("{basis:?}, {name}, {stored} + {depth_origin}");
                measurements.within(place, worst(setting, &rows, |_| lit), EXACT);
            }
        }
    }
    Ok(())
}

fn tied_texels(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    for basis in BASES {
        for stored in setting.some(&[0.5f32, 1.0, 1.0 / 3.0]) {
            let depth = |index: usize| if index.is_multiple_of(2) { stored } else { stored.next_down() };
            let ray = |row: i32| {
                let v = (f64::from(row) + 0.25) / 16.0;
                view_ray(DVec3::new(-2.0, v, f64::from(stored)), DVec3::X, 4.0)
            };
            let rows = under(depth, 0.0, basis, (-20..20).map(ray).collect())?;
            let texel = 1.0 / 16.0;
            let lit = |k: usize| (-SIGMA_T * texel * 2.0 * k as f64).exp() * -(-SIGMA_T * texel).exp_m1();
            let truth: f64 = (0..SIDE / 2).map(lit).sum();
            measurements.within(format!("{basis:?}, {stored}"), worst(setting, &rows, |_| truth), EXACT);
        }
    }
    Ok(())
}

fn grazing(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    for basis in BASES {
        for angle in setting.some(&[1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-15]) {
            let rays = [1.0, -1.0].into_iter().flat_map(|side: f64| {
                (1..8).map(move |k| {
                    let origin = DVec3::new(-1.8, 0.01 * f64::from(k), -side * 0.3 * f64::from(k) * angle);
                    view_ray(origin, DVec3::new(1.0, 0.05, side * angle), LENGTH)
                })
            });
            let rows = under(|_| 0.0, 0.0, basis, rays.collect())?;
            let truth = |ray: &ViewRay| {
                let meets = (-ray.origin.z / ray.direction.z).min(LENGTH);
                let [a, b] = if ray.direction.z > 0.0 { [0.0, meets] } else { [meets, LENGTH] };
                (-SIGMA_T * a).exp() * -(-SIGMA_T * (b - a)).exp_m1()
            };
            measurements.within(format!("{basis:?}, angle {angle:e}"), worst(setting, &rows, truth), EXACT);
        }
    }
    Ok(())
}

fn coplanar(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let (_, once) = problem(&Hall::PLAIN)?;
    for copies in [2, 3, 5] {
        let (_, often) = problem(&Hall { copies, ..Hall::PLAIN })?;
        let difference = apart(&once.traversal, &setting.tested(&often.traversal));
        measurements.within(format!("{copies} times"), difference, 0.0);
    }
    Ok(())
}
