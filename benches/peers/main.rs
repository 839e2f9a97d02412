//! Our side of the comparison with what users would take instead: `benches/peers/run.sh` runs all of it.
//!
//! `cargo bench --bench peers -- DIR` writes the volumes, the vectors and our products to DIR, so that others compute the
//! same, and `ours.json` with what they took. Times are medians.
//!
//! - `volume`: emission of 128³ voxels, 18 % of them occupied, or all, trilinear, seen in two views of 480 × 480; one
//!   weight for all channels and three channels of values.
//! - `slice`: lengths in 512² pixels (a volume one voxel thick) of a fan of 512 rays from each of 180 sides.

#![allow(missing_docs, reason = "a bench")]

use std::f64::consts::{PI, TAU};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use glam::{DAffine3, DQuat, DVec3};
use rayon::prelude::*;
use serde_json::{Value, json};
use unscatter::cpu::{Transport, near_medium};
use unscatter::march::{Density, PixelRays, Quantity, VolumeTransport, VolumeTraversal, VoxelElements};
use unscatter::operator::{CpuVector, LinearOperator, WalkPlan};
use unscatter::scene::{
    Camera, FovAxis, Interpolation, Quadrature, Samples, Strategy, Volume, VoxelGrid, VoxelSet, look_at,
};

const TRIALS: usize = 11;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let folder = std::env::args().skip(1).find(|word| !word.starts_with('-'));
    let folder = folder.ok_or("say where to write: cargo bench --bench peers -- DIR")?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    let measured = json!({
        "sparse": volume(folder, "sparse")?,
        "dense": volume(folder, "dense")?,
        "slice": slice(folder)?,
    });
    std::fs::write(folder.join("ours.json"), serde_json::to_string_pretty(&measured)?)?;
    Ok(())
}

/// A cube from −1 to 1, or a slice of it.
fn placed(size: [usize; 3], thickness: f64) -> unscatter::Result<VoxelGrid> {
    let scale = DVec3::new(2.0, 2.0, thickness);
    VoxelGrid::over_cube(
        size,
        DAffine3::from_scale_rotation_translation(scale, DQuat::IDENTITY, -0.5 * scale),
    )
}

/// A lumpy ball, in a haze where it is to be dense.
fn blob(dense: bool) -> unscatter::Result<Volume> {
    let grid = placed([128; 3], 2.0)?;
    let sigma_t = |index: usize| {
        let p = grid.centre(grid.voxel(index));
        let waves = (7.0 * p.x).sin() * (9.0 * p.y).sin() * (8.0 * p.z).sin();
        let ball = (1.0 - 2.0 * p.length_squared() + 0.4 * waves).max(0.0);
        (6.0 * ball + if dense { 0.05 } else { 0.0 }) as f32
    };
    Volume::new(grid, 1, Samples::F32((0..grid.len()).map(sigma_t).collect()))
}

fn volume(folder: &Path, name: &str) -> Result<Value, Failure> {
    const PICTURE: usize = 480;
    let fov = 2.0 * 0.5f64.atan().to_degrees();
    let cameras = [DVec3::NEG_Z * 3.0, DVec3::NEG_X * 3.0]
        .map(|eye| Camera::new(look_at(eye, DVec3::ZERO, DVec3::Y)?, fov, FovAxis::Y, [PICTURE; 2]));
    let cameras = cameras.into_iter().collect::<unscatter::Result<Vec<_>>>()?;
    let volume = Arc::new(blob(name == "dense")?);
    // Squares of 8 × 8 pixels, as problems take them.
    let across = (PICTURE / 8) as u32;
    let in_square = |n: u32| {
        let (square, inside) = (n / 64, n % 64);
        let [x, y] = [square % across * 8 + inside % 8, square / across * 8 + inside / 8];
        y * PICTURE as u32 + x
    };
    let pixels: Vec<[u32; 2]> =
        (0..2).flat_map(|view| (0..(PICTURE * PICTURE) as u32).map(move |n| [view, in_square(n)])).collect();

    let clock = Instant::now();
    let density = Arc::new(Density::new(volume.clone(), Interpolation::Trilinear));
    let grid = *volume.grid();
    let voxels = Arc::new(near_medium(&density, &grid));
    let part = VoxelElements::new(Quantity::Emission, grid, voxels.clone(), Interpolation::Trilinear);
    let rays = PixelRays::new(cameras.into(), pixels.clone(), Vec::new().into());
    let traversal = VolumeTraversal::new(transport(density), rays, vec![part]);
    let rows: Vec<usize> =
        (0..pixels.len()).into_par_iter().filter(|&row| traversal.has_weights(row)).collect();
    let traversal = traversal.along(traversal.rays().picked(&rows));
    let made = clock.elapsed().as_secs_f64();

    // One smooth function a channel, given at all voxels.
    let emission = |index: usize| -> [f32; 3] {
        let p = grid.centre(grid.voxel(index));
        [p.x, p.y, p.z].map(|p| (1.5 + (5.0 * p).sin()) as f32)
    };
    let x = CpuVector(voxels.indices().iter().map(|&index| emission(index as usize)).collect());
    let (measured, y) = products(traversal, made, &x)?;
    let mut pictures = vec![[0.0f32; 3]; 2 * PICTURE * PICTURE];
    for (&row, color) in rows.iter().zip(&y.0) {
        let [view, pixel] = pixels[row];
        pictures[view as usize * PICTURE * PICTURE + pixel as usize] = *color;
    }
    let all: Vec<[f32; 3]> = (0..grid.len()).map(emission).collect();
    let sigma_t: Vec<f32> = volume.samples().iter().collect();
    std::fs::write(folder.join(format!("{name}_sigma_t.f32")), bytemuck::cast_slice(&sigma_t))?;
    std::fs::write(folder.join(format!("{name}_emission.f32")), bytemuck::cast_slice(&all))?;
    std::fs::write(folder.join(format!("{name}_pictures.f32")), bytemuck::cast_slice(&pictures))?;
    Ok(measured)
}

fn slice(folder: &Path) -> Result<Value, Failure> {
    const SIDE: usize = 512;
    const SIDES: usize = 180;
    // One voxel is a cube, and the fan lies in its middle.
    let grid = placed([SIDE, SIDE, 1], 2.0 / SIDE as f64)?;
    let camera = |side: usize| {
        let angle = side as f64 * TAU / SIDES as f64;
        let eye = 4.0 * DVec3::new(angle.sin(), -angle.cos(), 0.0);
        // Half the width of a detector of 3 beside the centre, seen from a distance of 4.
        Camera::new(
            look_at(eye, DVec3::ZERO, DVec3::Z)?,
            2.0 * (1.5f64 / 4.0).atan() * 180.0 / PI,
            FovAxis::X,
            [SIDE, 1],
        )
    };
    let cameras = (0..SIDES).map(camera).collect::<unscatter::Result<Vec<_>>>()?;
    let pixels: Vec<[u32; 2]> =
        (0..SIDES as u32).flat_map(|side| (0..SIDE as u32).map(move |pixel| [side, pixel])).collect();
    let clock = Instant::now();
    let all = Arc::new(VoxelSet::all(grid.size()));
    let part = VoxelElements::new(Quantity::Extinction, grid, all.clone(), Interpolation::Nearest);
    // Lengths know of no medium.
    let nothing = Volume::constant(grid, [0.0; 3])?;
    let density = Arc::new(Density::new(Arc::new(nothing), Interpolation::Nearest));
    let transport = VolumeTransport { basis: Interpolation::Nearest, ..transport(density) };
    let rays = PixelRays::new(cameras.into(), pixels, Vec::new().into());
    let traversal = VolumeTraversal::new(transport, rays, vec![part]);
    let made = clock.elapsed().as_secs_f64();
    let value = |index: usize| {
        let p = grid.centre(grid.voxel(index));
        if p.length() < 0.9 { (1.5 + (9.0 * p.x).sin() * (7.0 * p.y).cos()) as f32 } else { 0.0 }
    };
    let x = CpuVector(all.indices().iter().map(|&index| [value(index as usize); 3]).collect());
    let (measured, y) = products(traversal, made, &x)?;
    let values: Vec<f32> = (0..grid.len()).map(value).collect();
    let lengths: Vec<f32> = y.0.iter().map(|color| color[0]).collect();
    std::fs::write(folder.join("slice_values.f32"), bytemuck::cast_slice(&values))?;
    std::fs::write(folder.join("slice_lengths.f32"), bytemuck::cast_slice(&lengths))?;
    Ok(measured)
}

fn transport(density: Arc<Density>) -> VolumeTransport {
    VolumeTransport {
        density,
        basis: Interpolation::Trilinear,
        quadrature: Quadrature::Exact,
        accuracy: 1e-6,
        transmittance_bound: f64::powi(2.0, -24),
        refraction: None,
    }
}

/// Both products, kept and walked anew to each accuracy, after `made` seconds of set-up; and T x.
fn products(traversal: VolumeTraversal, made: f64, x: &CpuVector) -> Result<(Value, CpuVector), Failure> {
    let clock = Instant::now();
    let plan = WalkPlan::new::<1>(&traversal);
    let planned = made + clock.elapsed().as_secs_f64();
    let mut measured = serde_json::Map::new();
    let mut kept: Option<[CpuVector; 2]> = None;
    let ways = [("kept", Strategy::Assembled, 1e-6), ("walked to 1e-6", Strategy::MatrixFree, 1e-6)];
    let fewer = [1e-5, 2e-4, 2e-3].map(|accuracy| (accuracy, format!("walked to {accuracy:.0e}")));
    let is_attenuated = traversal.parts().iter().all(|part| matches!(part.quantity, Quantity::Emission));
    let fewer = fewer.iter().filter(|_| is_attenuated);
    let fewer = fewer.map(|(accuracy, name)| (&**name, Strategy::MatrixFree, *accuracy));
    for (name, strategy, accuracy) in ways.into_iter().chain(fewer) {
        let transport = VolumeTransport { accuracy, ..traversal.transport().clone() };
        let traversal = VolumeTraversal::new(transport, traversal.rays().clone(), traversal.parts().to_vec());
        let clock = Instant::now();
        let operator: Transport<_, f32, 1> = Transport::new(traversal, &plan, strategy, u64::MAX)?;
        let set_up = planned + clock.elapsed().as_secs_f64();
        let (mut y, mut back) = (operator.range(), operator.domain());
        let trials = if strategy == Strategy::Assembled { TRIALS } else { 5 };
        let forward = median(trials, || operator.apply(x, &mut y))?;
        let [exact, exact_back] = kept.get_or_insert_with(|| [y.clone(), back.clone()]);
        let backward = median(trials, || operator.apply_adjoint(exact, &mut back))?;
        if strategy == Strategy::Assembled {
            exact_back.clone_from(&back);
        }
        let [one, other] = [(&y, &*exact), (x, &back)].map(|(a, b)| dot(a, b));
        measured.insert(
            name.to_owned(),
            json!({
                "set_up": set_up, "forward": forward, "backward": backward,
                "forward_off": off(&y, exact), "backward_off": off(&back, exact_back),
                "adjoint_off": (one - other).abs() / one.abs(),
                "rows": y.0.len(), "elements": x.0.len(), "nonzeros": plan.nonzeros,
            }),
        );
    }
    let [shown, _] = kept.ok_or("nothing was measured")?;
    Ok((Value::Object(measured), shown))
}

fn dot(a: &CpuVector, b: &CpuVector) -> f64 {
    a.0.as_flattened().iter().zip(b.0.as_flattened()).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
}

/// The relative distance.
fn off(a: &CpuVector, from: &CpuVector) -> f64 {
    let apart = a.0.iter().zip(&from.0).map(|(a, b)| std::array::from_fn(|c| a[c] - b[c])).collect();
    let apart = CpuVector(apart);
    (dot(&apart, &apart) / dot(from, from)).sqrt()
}

fn median(trials: usize, mut work: impl FnMut() -> unscatter::Result<()>) -> unscatter::Result<f64> {
    let mut seconds = Vec::with_capacity(trials);
    for _ in 0..trials {
        let clock = Instant::now();
        work()?;
        seconds.push(clock.elapsed().as_secs_f64());
    }
    seconds.sort_by(f64::total_cmp);
    Ok(seconds[trials / 2])
}
