//! Rays along axes, in grid lines and faces, through corners and edges, and at grazing angles.

use glam::{DAffine3, DVec2, DVec3};

use super::case::{Case, Measurements, Setting};
use super::rows::{
    BASES, FAULT, INTERPOLATIONS, WorldPlace, cube, dense, inside, open_rows, relative, row_sum, view_ray,
    volume_rows, worse,
};
use crate::Result;
use crate::march::{LightMapTraversal, Quantity, ViewRay};
use crate::scene::{Mesh, Primitive, Ray, Volume};
use crate::visibility::Geometry;

pub(super) const CASES: [Case; 6] = [
    Case {
        name: "rays/axis-parallel",
        law: "a ray in a grid line sums up to its depth over the map, at the map's rim to that or nothing",
        why: "closed form; some 100 pieces round a few times each",
        run: axis_parallel,
    },
    Case {
        name: "rays/corners",
        law: "a ray through texel corners sums up to its depth, and one beside it has nearly its weights",
        why: "closed form; 128 crossings move by twice the distance between the rays",
        run: corners,
    },
    Case {
        name: "rays/grazing",
        law: "a ray at a small angle to grid lines, rim or light sums up to its depth over the map",
        why: "closed form; some 100 pieces round a few times each",
        run: grazing,
    },
    Case {
        name: "rays/voxel-edges",
        law: "a ray in voxel edges, faces or corners sums up to its depth, at the rim to that or nothing",
        why: "closed forms, 4 Gauss nodes for trilinear emission",
        run: voxel_edges,
    },
    Case {
        name: "rays/voxel-grazing",
        law: "a ray at a small angle to voxel faces sums up to its depth",
        why: "as above",
        run: voxel_grazing,
    },
    Case {
        name: "rays/surfaces",
        law: "edges, corners and grazing rays of a surface are hit where they are, its own plane finitely",
        why: "a distance rounds a few times; the angle is that of the ray",
        run: surfaces,
    },
];

/// Row sums (ARCHITECTURE, Numbers).
const EXACT: f64 = 1e-13;
const CONSTANT: f64 = 1e-11;
const SIGMA_T: f64 = 0.7;
const ANGLES: [f64; 9] = [1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14, 1e-15];
/// The side of a texel of [`open_rows`].
const TEXEL: f64 = 1.0 / 16.0;

/// From where to where a ray is over the map of [`open_rows`], its rim included.
fn over_the_map(ray: &ViewRay) -> Option<[f64; 2]> {
    let (mut enter, mut leave) = (0.0_f64, ray.length);
    for axis in 0..2 {
        let (origin, slope) = (ray.origin[axis], ray.direction[axis]);
        if slope == 0.0 {
            if origin.abs() > 2.0 {
                return None;
            }
            continue;
        }
        let ends = [(-2.0 - origin) / slope, (2.0 - origin) / slope];
        enter = enter.max(ends[0].min(ends[1]));
        leave = leave.min(ends[0].max(ends[1]));
    }
    (enter < leave).then_some([enter, leave])
}

/// The sum that a row should have.
fn expected(ray: &ViewRay) -> f64 {
    let depth = |[a, b]: [f64; 2]| (-SIGMA_T * a).exp() * -(-SIGMA_T * (b - a)).exp_m1();
    over_the_map(ray).map_or(0.0, depth)
}

/// How far the sums of all rows are from what they should be. What runs along the rim may be inside or outside.
fn off(setting: &Setting, rows: &LightMapTraversal) -> f64 {
    let tested = setting.tested(rows);
    let error = |(row, ray): (usize, &ViewRay)| {
        let [sum] = row_sum::<1>(&tested, row);
        let in_the_rim = (0..2).any(|axis| ray.direction[axis] == 0.0 && ray.origin[axis].abs() == 2.0);
        if in_the_rim && sum == 0.0 { 0.0 } else { relative(sum, expected(ray)) }
    };
    rows.rays().iter().enumerate().map(error).fold(0.0, worse)
}

fn axis_parallel(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let places: Vec<f64> = (-64..=64).map(|k| f64::from(k) * TEXEL / 2.0).collect();
    for basis in BASES {
        for (name, direction) in
            [("u", DVec3::X), ("-u", DVec3::NEG_X), ("v", DVec3::Y), ("-v", DVec3::NEG_Y), ("w", DVec3::Z)]
        {
            let start = match direction.z == 0.0 {
                true => -3.0 * direction,
                false => DVec3::new(0.5, 0.25, -1.0),
            };
            let across = if direction.x == 0.0 { DVec3::X } else { DVec3::Y };
            let ray = |&place: &f64| view_ray(start + place * across, direction, 7.0);
            let mut rays: Vec<ViewRay> = places.iter().map(ray).collect();
            rays.extend(places.iter().map(|place| view_ray(place * across, direction, 1.0)));
            let rows = open_rows([SIGMA_T; 3], basis, rays)?;
            measurements.within(format!("{basis:?}, along {name}"), off(setting, &rows), EXACT);
        }
    }
    Ok(())
}

fn corners(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let directions = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [2.0, 1.0], [-1.0, 3.0]];
    for basis in BASES {
        for [u, v] in setting.some(&directions) {
            // Corners of texels, and corners of the cells between their centres.
            for shift in [0.0, TEXEL / 2.0] {
                let direction = DVec3::new(u, v, 0.0);
                let origin = DVec3::new(shift, shift, 0.0) - direction;
                let across = DVec3::new(-v, u, 0.0).normalize();
                for distance in setting.some(&[1e-6, 1e-9, 1e-12, 1e-15]) {
                    let ray = |side: f64| view_ray(origin + side * distance * across, direction, 7.0);
                    let rows = open_rows([SIGMA_T; 3], basis, vec![ray(0.0), ray(1.0), ray(-1.0)])?;
                    let place = format!("{basis:?}, along ({u}, {v}) + {shift}, {distance:e} m beside");
                    measurements.within(&place, off(setting, &rows), EXACT);
                    let on = dense::<1>(&Setting::RIGHT.tested(&rows), 0);
                    let apart = |row| {
                        let beside = dense::<1>(&setting.tested(&rows), row);
                        on.iter().zip(&beside).map(|([a], [b])| (a - b).abs()).sum::<f64>()
                    };
                    let bound = 128.0 * 4.0 * SIGMA_T * (distance + 4.0 * f64::EPSILON);
                    measurements.within(place, worse(apart(1), apart(2)), bound);
                }
            }
        }
    }
    Ok(())
}

fn grazing(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    for basis in BASES {
        for angle in setting.some(&ANGLES) {
            let along = [
                DVec3::new(1.0, angle, 0.0),
                DVec3::new(1.0, -angle, 0.3),
                DVec3::new(angle, -1.0, 0.0),
                DVec3::new(angle, 0.0, 1.0),
                DVec3::new(-angle, angle, -1.0),
            ];
            let starts = [
                DVec2::ZERO,
                DVec2::new(0.5 * TEXEL, 0.5 * TEXEL),
                DVec2::new(-2.0, 2.0),
                DVec2::new(-2.0, -2.0),
                DVec2::new(-3.0, 2.0),
            ];
            let rays = along.iter().flat_map(|&direction| {
                starts.iter().map(move |start| view_ray(start.extend(0.0), direction, 5.0))
            });
            let rows = open_rows([SIGMA_T; 3], basis, rays.collect())?;
            measurements.within(format!("{basis:?}, angle {angle:e}"), off(setting, &rows), EXACT);
        }
    }
    Ok(())
}

/// Emission and length of rays through an even medium of 16³ voxels, whose faces are at multiples of 1/8.
fn through_voxels(
    setting: &Setting,
    measurements: &mut Measurements,
    place: &str,
    rays: &[(Ray, f64)],
) -> Result<()> {
    let grid = cube([16; 3], &WorldPlace::PLAIN)?;
    for basis in INTERPOLATIONS {
        for quantity in [Quantity::Emission, Quantity::Extinction] {
            let is_length = matches!(quantity, Quantity::Extinction);
            let what = if is_length { "length" } else { "emission" };
            let density = Volume::constant(grid, [SIGMA_T as f32; 3])?;
            let rows = volume_rows(density, quantity, basis, rays)?;
            let tested = setting.tested(&rows);
            let error = |(row, &(_, length)): (usize, &(Ray, f64))| {
                let [sum] = row_sum::<1>(&tested, row);
                let ray = rows.rays().ray(row);
                let metres = inside(&ray, length, &grid);
                let depth = f64::from(SIGMA_T as f32) * metres;
                let truth = if is_length { metres } else { -(-depth).exp_m1() };
                let in_the_rim =
                    (0..3).any(|axis| ray.direction[axis] == 0.0 && ray.origin[axis].abs() == 1.0);
                if in_the_rim && sum == 0.0 { 0.0 } else { relative(sum, truth) }
            };
            let error = rays.iter().enumerate().map(error).fold(0.0, worse);
            measurements.within(format!("{basis:?}, {what}, {place}"), error, CONSTANT);
        }
    }
    Ok(())
}

fn voxel_edges(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    // Faces and middles of voxels.
    let places: Vec<f64> = (-16..=16).map(|k| f64::from(k) / 16.0).collect();
    for (axis, direction) in [DVec3::X, DVec3::NEG_Y, DVec3::Z].into_iter().enumerate() {
        let [across, up] = [1, 2].map(|next| DVec3::AXES[(axis + next) % 3]);
        let pairs = places.iter().flat_map(|a| setting.some(&places).into_iter().map(move |b| (*a, b)));
        let ray = |(a, b)| Ray { origin: a * across + b * up - 2.0 * direction, direction };
        let rays: Vec<(Ray, f64)> = pairs.map(|pair| (ray(pair), f64::INFINITY)).collect();
        through_voxels(setting, measurements, &format!("along {direction}"), &rays)?;
    }
    for direction in [DVec3::ONE, DVec3::new(1.0, -1.0, 0.0), DVec3::new(0.0, 1.0, 2.0)] {
        let ray = |k: i32| {
            let corner = DVec3::new(f64::from(k) / 8.0, 0.0, f64::from(-k) / 16.0);
            Ray { origin: corner - 2.0 * direction, direction: direction.normalize() }
        };
        let rays: Vec<(Ray, f64)> = (-7..=7).map(|k| (ray(k), f64::INFINITY)).collect();
        through_voxels(setting, measurements, &format!("along {direction}"), &rays)?;
    }
    Ok(())
}

fn voxel_grazing(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    for angle in setting.some(&ANGLES) {
        let along = [
            DVec3::new(1.0, angle, 0.0),
            DVec3::new(1.0, -angle, angle),
            DVec3::new(angle, 0.3, -1.0),
            DVec3::new(-angle, 1.0, angle),
        ];
        let starts = [DVec3::ZERO, DVec3::splat(1.0 / 16.0), DVec3::new(-0.5, 0.25, 0.125)];
        let rays = along.iter().flat_map(|direction| {
            let ray = |start: DVec3| Ray { origin: start, direction: direction.normalize() };
            starts.map(|start| (ray(start), 5.0))
        });
        through_voxels(setting, measurements, &format!("angle {angle:e}"), &rays.collect::<Vec<_>>())?;
    }
    Ok(())
}

fn surfaces(setting: &Setting, measurements: &mut Measurements) -> Result<()> {
    let mut mesh = Mesh::default();
    // A square of two triangles whose common edge is a diagonal, and the same once more in its plane.
    let sides = [DVec3::new(2.0, 0.0, 0.0), DVec3::new(0.0, 0.0, 2.0)];
    for _ in 0..2 {
        mesh.append(Primitive::Plane { centre: DVec3::ZERO, sides }.mesh([0.5; 3])?, DAffine3::IDENTITY);
    }
    let square = Geometry::new(mesh)?;
    let factor = if setting.faulty { FAULT } else { 1.0 };
    let hit = |origin: DVec3, direction: DVec3| {
        let hit = square.first_hit(&Ray { origin, direction: direction.normalize() }, f64::INFINITY);
        hit.map(|hit| factor * hit.distance)
    };
    let mut error = 0.0;
    for k in -64..=64 {
        let at = f64::from(k) / 64.0;
        for point in [DVec3::new(at, 0.0, at), DVec3::new(at, 0.0, -at), DVec3::new(at, 0.0, 1.0)] {
            for eye in [DVec3::new(0.1, 3.0, 0.2), point + DVec3::Y] {
                let distance = hit(eye, point - eye).unwrap_or(f64::INFINITY);
                // The rim itself may be missed: a point of it is rounded to either side.
                let rim = point.x.abs() == 1.0 || point.z.abs() == 1.0;
                let missed = rim && distance == f64::INFINITY;
                error = worse(error, if missed { 0.0 } else { relative(distance, (point - eye).length()) });
            }
        }
    }
    measurements.within("diagonals and rim", error, 8.0 * f64::EPSILON);
    for angle in setting.some(&ANGLES) {
        let height = 0.5 * angle;
        let direction = DVec3::new(1.0, -angle, 0.0);
        let distance = hit(DVec3::new(-0.25, height, 0.1), direction).unwrap_or(f64::INFINITY);
        let truth = height / -direction.normalize().y;
        measurements.within(format!("angle {angle:e}"), relative(distance, truth), 64.0 * f64::EPSILON);
        let away = hit(DVec3::new(-0.25, height, 0.1), DVec3::new(1.0, angle, 0.0));
        measurements.must(format!("angle {angle:e}, away"), away.is_none());
    }
    for (name, origin) in [("from beside", -3.0), ("from inside", 0.25)] {
        let distance = hit(DVec3::new(origin, 0.0, 0.1), DVec3::X);
        let reached = distance.map(|distance| origin + distance);
        measurements
            .must(format!("in its plane {name}"), reached.is_none_or(|x| x.abs() <= 1.0 + f64::EPSILON));
    }
    let up = hit(DVec3::new(0.1, 0.0, 0.2), DVec3::Y);
    measurements.must("from itself", up.is_none());
    Ok(())
}
