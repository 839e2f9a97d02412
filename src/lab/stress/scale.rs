//! Scenes of any size, anywhere, under light of any strength.

use std::sync::Arc;

use glam::DVec3;

use super::case::{Case, Measurements, Setting};
use super::hall::{Hall, problem};
use super::rows::{
    BASES, INTERPOLATIONS, RandomNumbers, WorldPlace, apart, cube, random_density, random_light_map,
    random_rays, volume_rows,
};
use super::solved::{Question, certificate};
use crate::cpu::HostOperator;
use crate::march::{InScattering, LitVolume, Quantity, VolumeTraversal};
use crate::operator::{FromHost, TransportOperator, WalkPlan};
use crate::problem::{Problem, solve};
use crate::scene::{Interpolation, Rgb, Strategy, Volume};
use crate::solve::Control;
use crate::{Error, Result};

pub(super) const CASES: [Case; 9] = [
    Case {
        name: "scale/light-map",
        law: "a scene of any size has the same matrix: the same bits for powers of two",
        why: "0; powers of ten: coordinates round to 1e-16, stored depths to 6e-8",
        run: light_map,
    },
    Case {
        name: "scale/volume",
        law: "a volume of any size has the same matrix: the same bits for powers of two",
        why: "0; powers of ten: extinction is kept in f32, which rounds to 6e-8",
        run: volume,
    },
    Case {
        name: "scale/whole-scene",
        law: "a painted scene of any size, 1e-6 to 1e6 metres, has the same light map",
        why: "4 * 2^9 * 6e-8: stored depths round to 6e-8, the pull leaves a condition of 2^9",
        run: whole_scene,
    },
    Case {
        name: "origin/light-map",
        law: "a scene far from the origin has the same matrix",
        why: "coordinates round to epsilon * distance; a crossing moves by a few of these, over a texel",
        run: light_map_from_afar,
    },
    Case {
        name: "origin/volume",
        law: "a volume far from the origin has the same matrix",
        why: "as above, over a voxel",
        run: volume_from_afar,
    },
    Case {
        name: "origin/whole-scene",
        law: "a painted scene far from the origin has the same light map",
        why: "as for whole scenes of any size",
        run: whole_scene_from_afar,
    },
    Case {
        name: "radiance/product",
        law: "T x of k x is k T x: the same bits for powers of two",
        why: "0; powers of ten: x and T x are rounded to f32",
        run: product,
    },
    Case {
        name: "radiance/light-map",
        law: "a painted scene under light k has k times the light map: the same bits for powers of two",
        why: "0; powers of ten: products in f32 round differently, over all iterations",
        run: radiance_of_light_map,
    },
    Case {
        name: "radiance/albedo",
        law: "under light k a medium has the same albedo, or it is said that the light is too weak",
        why: "the certificate of the matrix in f64",
        run: radiance_of_albedo,
    },
];

/// Powers of two near 1e-6 and 1e6, and of ten.
const SCALES: [f64; 12] =
    [1.0 / 1_048_576.0, 1e-6, 1e-5, 1.0 / 1024.0, 1e-3, 1e-1, 1024.0, 1e1, 1e3, 1_048_576.0, 1e5, 1e6];
/// The same as light: 2^-40 to 2^40, and 1e-12 to 1e12.
const RADIANCES: [f64; 9] =
    [1.0 / 1_099_511_627_776.0, 1e-12, 1e-6, 1.0 / 1024.0, 1e-3, 1024.0, 1_099_511_627_776.0, 1e6, 1e12];
const DISTANCES: [f64; 7] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6];

/// What f32 rounds, some of it several times.
const ROUNDED: f64 = 1e-6;
/// Two ways to one light map, relative to its brightest texel.
const SAME_SOLUTION: f64 = 1e-5;
/// The same where stored depths differ by a rounding of 6e-8, times 2^9, the condition that the pull leaves, and 4.
const OTHER_DEPTHS: f64 = 1.2e-4;

fn is_power_of_two(scale: f64) -> bool {
    scale.log2().fract() == 0.0
}

/// Nothing for powers of two, `bound` for others.
fn unless_exact(factor: f64, bound: f64) -> f64 {
    if is_power_of_two(factor) { 0.0 } else { bound }
}

fn light_map(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    for basis in BASES {
        let plain = random_light_map(2, 200, basis, 0.5, &WorldPlace::PLAIN)?;
        for scale in setting.some(&SCALES) {
            let rows = random_light_map(2, 200, basis, 0.5, &WorldPlace::scaled(scale))?;
            let difference = apart(&plain, &setting.tested(&rows));
            measurements.within(format!("{basis:?}, {scale:.3e}"), difference, unless_exact(scale, ROUNDED));
        }
    }
    Ok(())
}

/// Rows of emission through random densities.
fn emission(basis: Interpolation, place: &WorldPlace) -> Result<VolumeTraversal> {
    let rays = random_rays(&mut RandomNumbers(5), 200, place);
    volume_rows(random_density(11, 1.0, place)?, Quantity::Emission, basis, &rays)
}

fn volume(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    for basis in INTERPOLATIONS {
        let plain = emission(basis, &WorldPlace::PLAIN)?;
        for scale in setting.some(&SCALES) {
            let rows = emission(basis, &WorldPlace::scaled(scale))?;
            let difference = apart(&plain, &setting.tested(&rows));
            measurements.within(format!("{basis:?}, {scale:.3e}"), difference, unless_exact(scale, ROUNDED));
        }
    }
    Ok(())
}

/// The light map of a hall.
fn light_map_of(setting: &Setting, hall: &Hall) -> Result<Vec<Rgb>> {
    let (scene, problem) = problem(hall)?;
    let operator = HostOperator::<_, f32>::new(
        setting.tested(&problem.traversal),
        true,
        problem.plan(),
        Strategy::Auto,
        u64::MAX,
    )?;
    let coverage = operator.squares(&problem.weights())?;
    Ok(solve(&problem, &operator, &coverage, &scene.solve, None, |_, _| Ok(Control::Continue))?.x)
}

/// max |a − b / factor| / max |a|.
fn light_maps_apart(a: &[Rgb], b: &[Rgb], factor: f64) -> f64 {
    let largest = a.iter().flatten().copied().fold(0.0, f32::max);
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    let difference = |(a, b): (&f32, &f32)| (f64::from(*a) - f64::from(*b) / factor).abs();
    pairs.map(difference).fold(0.0, super::rows::worse) / f64::from(largest)
}

/// The hall as it should be solved.
fn plain_light_map() -> Result<Vec<Rgb>> {
    light_map_of(&Setting::RIGHT, &Hall::PLAIN)
}

fn whole_scene(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let plain = plain_light_map()?;
    for scale in setting.some(&SCALES) {
        let found = light_map_of(setting, &Hall { place: WorldPlace::scaled(scale), ..Hall::PLAIN })?;
        measurements.within(format!("{scale:.3e}"), light_maps_apart(&plain, &found, 1.0), OTHER_DEPTHS);
    }
    Ok(())
}

fn moved(distance: f64) -> WorldPlace {
    WorldPlace { offset: DVec3::new(0.7, -0.5, 0.6) * distance, ..WorldPlace::PLAIN }
}

fn light_map_from_afar(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    for basis in BASES {
        let plain = random_light_map(2, 200, basis, 0.5, &WorldPlace::PLAIN)?;
        for distance in setting.some(&DISTANCES) {
            let rows = random_light_map(2, 200, basis, 0.5, &moved(distance))?;
            let difference = apart(&plain, &setting.tested(&rows));
            // Texels of both maps are about a tenth of a metre.
            let bound = 16.0 * f64::EPSILON * (distance + 1.0) / 0.1;
            measurements.within(format!("{basis:?}, {distance:e} m"), difference, bound);
        }
    }
    Ok(())
}

fn volume_from_afar(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    for basis in INTERPOLATIONS {
        let plain = emission(basis, &WorldPlace::PLAIN)?;
        for distance in setting.some(&DISTANCES) {
            let rows = emission(basis, &moved(distance))?;
            let difference = apart(&plain, &setting.tested(&rows));
            let bound = 16.0 * f64::EPSILON * (distance + 1.0) / 0.1;
            measurements.within(format!("{basis:?}, {distance:e} m"), difference, bound);
        }
    }
    Ok(())
}

fn whole_scene_from_afar(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let plain = plain_light_map()?;
    for distance in setting.some(&DISTANCES) {
        let found = light_map_of(setting, &Hall { place: moved(distance), ..Hall::PLAIN })?;
        measurements.within(format!("{distance:e} m"), light_maps_apart(&plain, &found, 1.0), OTHER_DEPTHS);
    }
    Ok(())
}

fn product(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    for basis in BASES {
        let rows = random_light_map(2, 400, basis, 0.5, &WorldPlace::PLAIN)?;
        let plan = WalkPlan::new::<1>(&setting.tested(&rows));
        let right =
            HostOperator::<_, f32>::new(Setting::RIGHT.tested(&rows), true, &plan, Strategy::Auto, u64::MAX)?;
        let tested =
            HostOperator::<_, f32>::new(setting.tested(&rows), true, &plan, Strategy::Auto, u64::MAX)?;
        let mut n = RandomNumbers(9);
        let elements = rows.transport().light_map.len();
        let x: Vec<Rgb> =
            (0..elements).map(|_| std::array::from_fn(|_| n.uniform(0.5, 2.0) as f32)).collect();
        let shown = right.shown(&x)?;
        for radiance in setting.some(&RADIANCES) {
            let lit: Vec<Rgb> = x.iter().map(|x| x.map(|x| (f64::from(x) * radiance) as f32)).collect();
            let difference = light_maps_apart(&shown, &tested.shown(&lit)?, radiance);
            measurements.within(
                format!("{basis:?}, {radiance:.3e}"),
                difference,
                unless_exact(radiance, ROUNDED),
            );
        }
    }
    Ok(())
}

fn radiance_of_light_map(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let plain = plain_light_map()?;
    for factor in setting.some(&RADIANCES) {
        let radiance = (f64::from(Hall::PLAIN.radiance) * factor) as f32;
        let found = light_map_of(setting, &Hall { radiance, ..Hall::PLAIN })?;
        let difference = light_maps_apart(&plain, &found, factor);
        measurements.within(format!("{factor:.3e}"), difference, unless_exact(factor, SAME_SOLUTION));
    }
    Ok(())
}

fn radiance_of_albedo(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let rays = random_rays(&mut RandomNumbers(5), 200, &WorldPlace::PLAIN);
    for depth in setting.some(&[1.0, 1e-4, 1e-8]) {
        for radiance in setting.some(&RADIANCES) {
            let grid = cube([18, 11, 9], &WorldPlace::PLAIN)?;
            let light = Arc::new(Volume::constant(grid, [radiance as f32; 3])?);
            let light = InScattering::new(vec![LitVolume { along: None, radiance: light }]);
            let density = random_density(11, depth, &WorldPlace::PLAIN)?;
            let quantity = Quantity::Albedo(Arc::new(light));
            let rows = volume_rows(density, quantity, Interpolation::Nearest, &rays)?;
            let place = format!("depth {depth:e}, light {radiance:.3e}");
            match Question::answered_by(&rows, 1e-4)?.solved(setting, &rows) {
                Err(error @ Error::Empty { .. }) => measurements.must(format!("{place}: {error}"), true),
                answer => certificate(measurements, &place, &answer?, 1e-4),
            }
        }
    }
    Ok(())
}
