//! Optical depth from 1e-8 to 1e3.

use super::case::{Case, Measurements, Setting};
use super::rows::{
    BASES, INTERPOLATIONS, RandomNumbers, WorldPlace, cube, inside, open_rows, random_density,
    random_light_map, random_rays, relative, row_sum, view_ray, volume_rows, worse,
};
use super::solved::{Question, certificate};
use crate::Result;
use crate::march::{LightMapTraversal, Quantity};
use crate::scene::{Basis, SolveSettings, Volume};

pub(super) const CASES: [Case; 6] = [
    Case {
        name: "depth/light-map",
        law: "a row sums up to 1 - exp(-depth) in every channel",
        why: "closed forms; some 100 pieces round a few times each",
        run: light_map,
    },
    Case {
        name: "depth/cut-off",
        law: "what the transmittance bound cuts off is at most that bound",
        why: "the bound itself, 2^-24, and its rounding",
        run: cut_off,
    },
    Case {
        name: "depth/volume",
        law: "a row of an even medium sums up to 1 - exp(-depth)",
        why: "closed form for nearest; 4 Gauss nodes leave 3e-12 a half of depth for trilinear",
        run: volume,
    },
    Case {
        name: "depth/uneven-volume",
        law: "a row of any medium sums up to 1 - exp(-depth)",
        why: "as above; 4 nodes leave 5e-6 where densities jump from voxel to voxel",
        run: uneven_volume,
    },
    Case {
        name: "depth/solve-light-map",
        law: "the solve ends with a reason, and its certificate is that of the matrix in f64",
        why: "both products in f32 are right to 1e-5",
        run: solve_light_map,
    },
    Case {
        name: "depth/solve-volume",
        law: "the solve ends with a reason, and its certificate is that of the matrix in f64",
        why: "both products in f32 are right to 1e-5",
        run: solve_volume,
    },
];

/// Optical depths of a metre.
const DEPTHS: [f64; 12] = [1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3];
/// The channels, relative to the first.
const SPREAD: [f64; 3] = [1.0, 0.3, 1e-3];

/// Row sums of a light map, and of a volume that is constant in each cell (ARCHITECTURE, Numbers).
const EXACT: f64 = 1e-13;
const CONSTANT: f64 = 1e-11;
/// Of a volume whose density is cubic along a ray.
const CUBIC: f64 = 1e-5;

/// Rays that stay over the map.
fn rays_over_the_map(sigma_t: [f64; 3], basis: Basis) -> Result<LightMapTraversal> {
    let mut n = RandomNumbers(7);
    let rays = (0..64).map(|_| {
        let (from, to) = (n.point(1.9), n.point(1.9));
        view_ray(from, to - from, (to - from).length())
    });
    open_rows(sigma_t, basis, rays.collect())
}

fn light_map(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    for basis in BASES {
        for depth in setting.some(&DEPTHS) {
            let sigma_t = SPREAD.map(|part| part * depth);
            let rows = rays_over_the_map(sigma_t, basis)?;
            let tested = setting.tested(&rows);
            let mut error = 0.0;
            for (row, ray) in rows.rays().iter().enumerate() {
                let sum = row_sum::<3>(&tested, row);
                for c in 0..3 {
                    error = worse(error, relative(sum[c], -(-sigma_t[c] * ray.length).exp_m1()));
                }
            }
            measurements.within(format!("{basis:?}, depth {depth:e}"), error, EXACT);
        }
    }
    Ok(())
}

fn cut_off(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let bound = SolveSettings::default().transmittance_bound;
    for basis in BASES {
        for depth in setting.some(&DEPTHS) {
            let rows = rays_over_the_map([depth; 3], basis)?;
            let mut transport = rows.transport().clone();
            transport.transmittance_bound = bound;
            let cut = LightMapTraversal::new(transport, rows.rays().into());
            let tested = setting.tested(&cut);
            let mut error = 0.0;
            for (row, ray) in rows.rays().iter().enumerate() {
                let [sum] = row_sum::<1>(&tested, row);
                error = worse(error, relative(sum, -(-depth * ray.length).exp_m1()));
            }
            measurements.within(format!("{basis:?}, depth {depth:e}"), error, bound + EXACT);
        }
    }
    Ok(())
}

fn volume(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let grid = cube([18, 11, 9], &WorldPlace::PLAIN)?;
    let rays = random_rays(&mut RandomNumbers(3), 48, &WorldPlace::PLAIN);
    for basis in INTERPOLATIONS {
        for depth in setting.some(&DEPTHS) {
            let sigma_t = SPREAD.map(|part| (part * depth) as f32);
            let rows = volume_rows(Volume::constant(grid, sigma_t)?, Quantity::Emission, basis, &rays)?;
            let tested = setting.tested(&rows);
            let mut error = 0.0;
            for (row, &(_, length)) in rays.iter().enumerate() {
                let sum = row_sum::<3>(&tested, row);
                let metres = inside(&rows.rays().ray(row), length, &grid);
                for c in 0..3 {
                    let truth = -(-f64::from(sigma_t[c]) * metres).exp_m1();
                    error = worse(error, relative(sum[c], truth));
                }
            }
            measurements.within(format!("{basis:?}, depth {depth:e}"), error, CONSTANT);
        }
    }
    Ok(())
}

fn uneven_volume(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let rays = random_rays(&mut RandomNumbers(5), 48, &WorldPlace::PLAIN);
    for (basis, bound) in INTERPOLATIONS.into_iter().zip([CONSTANT, CUBIC]) {
        for depth in setting.some(&DEPTHS) {
            let density = random_density(11, depth, &WorldPlace::PLAIN)?;
            let rows = volume_rows(density, Quantity::Emission, basis, &rays)?;
            let tested = setting.tested(&rows);
            let mut error = 0.0;
            for (row, &(_, length)) in rays.iter().enumerate() {
                let [sum] = row_sum::<1>(&tested, row);
                let ray = rows.rays().ray(row);
                let [tau, _, _] = rows.transport().density.optical_depth(ray.origin, ray.direction, length);
                error = worse(error, relative(sum, -(-tau).exp_m1()));
            }
            measurements.within(format!("{basis:?}, depth {depth:e}"), error, bound);
        }
    }
    Ok(())
}

fn solve_light_map(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    for basis in BASES {
        for depth in setting.some(&DEPTHS) {
            let rows = random_light_map(2, 400, basis, depth, &WorldPlace::PLAIN)?;
            let solved = Question::answered_by(&rows, 1e-4)?.solved(setting, &rows)?;
            certificate(measurements, &format!("{basis:?}, depth {depth:e}"), &solved, 1e-4);
        }
    }
    Ok(())
}

fn solve_volume(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let rays = random_rays(&mut RandomNumbers(5), 400, &WorldPlace::PLAIN);
    for basis in INTERPOLATIONS {
        for depth in setting.some(&DEPTHS) {
            let density = random_density(11, depth, &WorldPlace::PLAIN)?;
            let rows = volume_rows(density, Quantity::Emission, basis, &rays)?;
            let solved = Question::answered_by(&rows, 1e-4)?.solved(setting, &rows)?;
            certificate(measurements, &format!("{basis:?}, depth {depth:e}"), &solved, 1e-4);
        }
    }
    Ok(())
}
