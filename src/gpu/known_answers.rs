//! What an adapter is asked before anything is believed of it: sums and products of integers, which f32 holds exactly, and the two
//! traversals and slices over small scenes against the same walks on the processor in f64.

use std::sync::Arc;

use glam::{DAffine3, DVec2, DVec3};

use super::device::{AdapterRecord, Choice, Gpu, Tactics};
use super::operators::{DeviceOperator, Kept, TileMetric, Walked, swept};
use super::vectors::GpuVector;
use crate::march::{
    Density, EpipolarSettings, EpipolarTraversal, LightMapTransport, LightMapTraversal, PixelRays, Quantity,
    Traversal, ViewRay, VolumeTransport, VolumeTraversal, VoxelElements,
};
use crate::operator::{Bounds, LinearOperator, Metric, RowTable, Vector};
use crate::scene::{
    Basis, Camera, Extent, FovAxis, Grid, Interpolation, Quadrature, Samples, Volume, VoxelGrid, look_at,
};
use crate::visibility::ShadowMap;
use crate::{Error, Result};

/// Elements of the vectors that are tried: several workgroups, and no multiple of one.
const ELEMENTS: usize = 10_007;
/// How far walked rows may be off, relative to the largest number.
const WALKED: f64 = 1e-5;

/// Lets an adapter compute what is known: vectors, kept rows of every way of sharing them, tiles, and the traversals of light maps and
/// volumes in f32 and in fixed point, slices, by the tactics for hardware and by those for software.
///
/// Errors: [`Error::Adapter`] when it computes something else, or cannot.
pub fn known_answers(record: &AdapterRecord) -> Result<()> {
    for tactics in [Tactics::SOFTWARE, Tactics::HARDWARE] {
        let choice = Choice { number: Some(record.number), tactics: Some(tactics), ..Choice::default() };
        let gpu = Gpu::open(&choice)?;
        if tactics == Tactics::SOFTWARE {
            vectors(&gpu)?;
            volume(&gpu)?;
        }
        // Non-zeros a row that one lane takes, that eight share, and 32; columns of 10,000, which are cut up.
        [2, 20, 200].into_iter().try_for_each(|nonzeros| kept_rows(&gpu, nonzeros))?;
        tiles(&gpu)?;
        light_map(&gpu)?;
    }
    Ok(())
}

fn counted() -> Vec<[f64; 3]> {
    (0..ELEMENTS).map(|k| [(k % 7) as f64, 1.0, -((k % 3) as f64)]).collect()
}

fn vectors(gpu: &Gpu) -> Result<()> {
    let (mut x, mut y) = (GpuVector::zeros(gpu, ELEMENTS), GpuVector::zeros(gpu, ELEMENTS));
    let counted = counted();
    x.set_from_host(&counted)?;
    y.fill([2.0, 3.0, 4.0]);
    y.axpby([1.0; 3], &x, [1.0, 2.0, 0.5]);
    let expected = counted.iter().fold([0.0; 3], |sum, [r, g, b]| {
        [sum[0] + r * (r + 2.0), sum[1] + g * (g + 6.0), sum[2] + b * (b + 2.0)]
    });
    agree(gpu, "the sum of a product", &[x.dot(&y)?], &[expected], 0.0)
}

/// Row k holds so many ones from element k on, and all rows hold a two at the last element.
fn kept_rows(gpu: &Gpu, ones: usize) -> Result<()> {
    let last = ELEMENTS - 1;
    let rows = last - ones;
    let table = RowTable {
        offsets: (0..=rows).map(|row| (ones + 1) * row).collect(),
        elements: (0..rows).flat_map(|row| (row..row + ones).chain([last]).map(|k| k as u32)).collect(),
        weights: vec![[vec![1.0; ones], vec![2.0]].concat().repeat(rows)],
    };
    let kept = Kept::new(gpu, table, ELEMENTS)?;
    let (mut x, mut y) = (kept.domain(), kept.range());
    let counted = counted();
    x.set_from_host(&counted)?;
    kept.apply(&x, &mut y)?;
    let of_row = |row: usize| {
        let sum =
            |c: usize| counted[row..row + ones].iter().map(|x| x[c]).sum::<f64>() + 2.0 * counted[last][c];
        [sum(0), sum(1), sum(2)]
    };
    let expected: Vec<_> = (0..rows).map(of_row).collect();
    agree(gpu, "a product with a matrix", &y.to_host()?, &expected, 0.0)?;
    y.fill([1.0, -2.0, 3.0]);
    kept.apply_adjoint(&y, &mut x)?;
    let met = |k: usize| match k == last {
        true => 2 * rows,
        // Rows k + 1 − ones to k, as far as there are such.
        false => (k + 1).min(rows) - (k + 1).saturating_sub(ones).min(rows),
    };
    let expected: Vec<_> = (0..ELEMENTS).map(|k| [1.0, -2.0, 3.0].map(|y| met(k) as f64 * y)).collect();
    agree(gpu, "a product with a transpose", &x.to_host()?, &expected, 0.0)
}

/// Dense tiles to multiply with; tiles whose off-diagonal entries are 0 to divide by, where one sweep is exact.
fn tiles(gpu: &Gpu) -> Result<()> {
    const SIDE: usize = 16;
    let members: Vec<u32> = (0..SIDE as u32).rev().collect();
    let matrix = |entry: fn(usize, usize) -> f32| -> Vec<f32> {
        (0..SIDE * SIDE).map(|k| entry(k / SIDE, k % SIDE)).collect()
    };
    let dense = matrix(|row, column| ((row + column) % 5) as f32);
    let diagonal = matrix(|row, column| if row == column { 4.0 } else { 0.0 });
    let metric = |matrix: &[f32]| TileMetric::new(gpu, SIDE, 1, [(&members[..], matrix)].into_iter());
    let start = &counted()[..SIDE];
    let mut v = GpuVector::zeros(gpu, SIDE);
    v.set_from_host(start)?;
    metric(&dense)?.stretch(&mut v);
    let from_behind = |k: usize| SIDE - 1 - k;
    let of = |row: usize, c: usize| -> f64 {
        (0..SIDE).map(|k| f64::from(dense[from_behind(row) * SIDE + from_behind(k)]) * start[k][c]).sum()
    };
    let expected: Vec<_> = (0..SIDE).map(|row| [of(row, 0), of(row, 1), of(row, 2)]).collect();
    agree(gpu, "a product with tiles", &v.to_host()?, &expected, 0.0)?;
    v.set_from_host(start)?;
    let diagonal = metric(&diagonal)?;
    diagonal.shrink(&mut v);
    let expected: Vec<_> = start.iter().map(|x| x.map(|x| 0.25 * x)).collect();
    agree(gpu, "a solution with tiles", &v.to_host()?, &expected, 0.0)?;
    // From 1 against the gradient, not below 0.
    let mut from = GpuVector::zeros(gpu, SIDE);
    from.fill([1.0; 3]);
    v.set_from_host(start)?;
    diagonal.descend(&mut v, &from, [1.0; 3], &Bounds::NOT_NEGATIVE);
    let expected: Vec<_> = start.iter().map(|g| g.map(|g| (1.0 - 0.25 * g).max(0.0))).collect();
    agree(gpu, "a step with tiles", &v.to_host()?, &expected, 0.0)
}

/// Rays from one eye over a light map, between a few blocks.
fn light_map(gpu: &Gpu) -> Result<()> {
    const SIDE: usize = 24;
    let extent = Extent { min: DVec2::splat(-1.0), max: DVec2::splat(1.0) };
    let grid = Grid::new(extent, [SIDE; 2])?;
    let depths: Vec<f32> =
        (0..grid.len()).map(|k| if k / 5 % 3 == 0 { 0.1 } else { f32::INFINITY }).collect();
    let transport = LightMapTransport {
        sigma_t: [0.7; 3],
        shadow_map: Arc::new(ShadowMap::new(grid, 0.0, &depths)?),
        light_map: grid,
        basis: Basis::Bilinear,
        quadrature: Quadrature::Exact,
        transmittance_bound: f64::powi(2.0, -24),
        mask: None,
    };
    let ray = |k: usize| ViewRay {
        origin: DVec3::new(-0.7, 0.2, -0.3),
        direction: DVec3::new(1.0, (k % 20) as f64 * 0.1 - 1.0, (k / 20) as f64 * 0.05 - 0.4).normalize(),
        length: 1.5,
        scattering: [0.05; 3],
    };
    let traversal = LightMapTraversal::new(transport, (0..300).map(ray).collect());
    walked(gpu, &traversal, |deterministic| {
        Ok(Box::new(Walked::light_map(gpu, &traversal, false, deterministic)?))
    })?;
    let slices = EpipolarTraversal::new(&traversal, &|_| 0.05, EpipolarSettings::default())?;
    walked(gpu, &slices, |_| swept(gpu, &slices, true))
}

/// A camera before a cube of smoke that is interpolated.
fn volume(gpu: &Gpu) -> Result<()> {
    const SIDE: usize = 12;
    let grid = VoxelGrid::new([SIDE; 3], DAffine3::from_scale(DVec3::splat(1.0 / SIDE as f64)))?;
    let sigma = (0..grid.len()).map(|k| if k / 40 % 4 == 0 { 0.0 } else { (k % 9) as f32 }).collect();
    let medium = Arc::new(Volume::new(grid, 1, Samples::F32(sigma))?);
    let transport = VolumeTransport {
        density: Arc::new(Density::new(medium, Interpolation::Trilinear)),
        basis: Interpolation::Trilinear,
        quadrature: Quadrature::Exact,
        accuracy: 1e-6,
        transmittance_bound: f64::powi(2.0, -24),
        refraction: None,
    };
    let world = look_at(DVec3::new(0.4, 0.6, 3.0), DVec3::splat(0.5), DVec3::Y)?;
    let camera = Camera::new(world, 30.0, FovAxis::X, [16, 16])?;
    let pixels: Vec<[u32; 2]> = (0..256).map(|pixel| [0, pixel]).collect();
    let voxels = Arc::new(grid.set(|_| true));
    let part = VoxelElements::new(Quantity::Emission, grid, voxels, Interpolation::Trilinear);
    let traversal = VolumeTraversal::new(transport, PixelRays::seen_by_one(camera, pixels), vec![part]);
    walked(gpu, &traversal, |deterministic| {
        Ok(Box::new(Walked::volume(gpu, &traversal, false, deterministic)?))
    })
}

/// Both products of a traversal in f32 and in fixed point, against its own rows in f64.
fn walked<T: Traversal<f64, 1>>(
    gpu: &Gpu,
    traversal: &T,
    walk: impl Fn(bool) -> Result<Box<dyn DeviceOperator>>,
) -> Result<()> {
    let wave = |k: usize| [1.0, 2.0, 3.0].map(|phase| 1.0 + (0.37 * k as f64 + phase).sin());
    let x: Vec<_> = (0..traversal.elements()).map(wave).collect();
    let y: Vec<_> = (0..traversal.rows()).map(wave).collect();
    let (mut shown, mut arriving) = (vec![[0.0; 3]; y.len()], vec![[0.0; 3]; x.len()]);
    for row in 0..traversal.rows() {
        traversal.walk(row, &mut |element, [weight]| {
            for c in 0..3 {
                shown[row][c] += weight * x[element][c];
                arriving[element][c] += weight * y[row][c];
            }
        });
    }
    for deterministic in [false, true] {
        let operator = walk(deterministic)?;
        let (mut on_x, mut on_y) = (operator.domain(), operator.range());
        on_x.set_from_host(&x)?;
        operator.apply(&on_x, &mut on_y)?;
        agree(gpu, "rays that gather", &on_y.to_host()?, &shown, WALKED)?;
        on_y.set_from_host(&y)?;
        operator.apply_adjoint(&on_y, &mut on_x)?;
        agree(gpu, "rays that scatter", &on_x.to_host()?, &arriving, WALKED)?;
    }
    Ok(())
}

/// Errors: [`Error::Adapter`] where a number is off by more than so much of the largest.
fn agree(gpu: &Gpu, what: &str, got: &[[f64; 3]], expected: &[[f64; 3]], tolerance: f64) -> Result<()> {
    let largest = expected.iter().flatten().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    // Not `>`: a NaN must not pass.
    let is_right = |(got, expected): (&f64, &f64)| (got - expected).abs() <= tolerance * largest;
    let pairs = || got.iter().flatten().zip(expected.iter().flatten());
    let Some((got, expected)) = pairs().find(|&(got, expected)| !is_right((got, expected))) else {
        return Ok(());
    };
    Err(Error::Adapter {
        adapter: gpu.record().name.clone(),
        problem: format!("computes {what} wrong: {got} instead of {expected}"),
        remedy: "update its driver, or compute on the processor",
    })
}
