//! The operator of a volume problem at the size of Klehm 2015, fig. 7.3: 128³ voxels, 2 views of 480 × 480.
//!
//! `cargo bench --bench volume [-- dense|trilinear]`; times are medians.

#![allow(missing_docs, clippy::print_stdout, reason = "figures are what it is for")]

use std::sync::Arc;
use std::time::Instant;

use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use unscatter::cpu::{Transport, WalkPlan, near_medium};
use unscatter::march::{Density, Part, PixelRays, Quantity, VolumeTransport, VolumeTraversal};
use unscatter::operator::LinearOperator;
use unscatter::scene::{
    Camera, FovAxis, Interpolation, Quadrature, Samples, Strategy, Volume, VoxelGrid, look_at,
};

const SIDE: usize = 128;
const PICTURE: usize = 480;
const TRIALS: usize = 21;

fn main() -> unscatter::Result<()> {
    let asked: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    for dense in [false, true] {
        for basis in [Interpolation::Nearest, Interpolation::Trilinear] {
            let names = [
                if dense { "dense" } else { "sparse" },
                match basis {
                    Interpolation::Nearest => "nearest",
                    Interpolation::Trilinear => "trilinear",
                },
            ];
            if asked.iter().all(|word| names.contains(&word.as_str())) {
                measure(dense, basis, &names.join(" "))?;
            }
        }
    }
    Ok(())
}

fn measure(dense: bool, basis: Interpolation, name: &str) -> unscatter::Result<()> {
    let cameras: Vec<Camera> = [DVec3::new(0.0, 0.0, -3.0), DVec3::new(-3.0, 0.0, 0.0)]
        .into_iter()
        .map(|eye| Camera::new(look_at(eye, DVec3::ZERO, DVec3::Y)?, 53.0, FovAxis::Y, [PICTURE; 2]))
        .collect::<unscatter::Result<_>>()?;
    let volume = Arc::new(volume(dense)?);
    let clock = Instant::now();
    let density = Arc::new(Density::new(volume.clone(), basis));
    let density_cells = density.cells().clone();
    let pixels: Vec<[u32; 2]> = (0..2)
        .flat_map(|view| {
            (0..(PICTURE * PICTURE) as u32).map(move |n| {
                let (tile, inside) = (n / 64, n % 64);
                let across = (PICTURE / 8) as u32;
                let (x, y) = (tile % across * 8 + inside % 8, tile / across * 8 + inside / 8);
                [view, y * PICTURE as u32 + x]
            })
        })
        .collect();
    let rays = PixelRays::new(cameras.into(), pixels, Vec::new().into());
    let transport = VolumeTransport {
        density,
        basis,
        quadrature: Quadrature::Exact,
        transmittance_bound: f64::powi(2.0, -24),
        refraction: None,
    };
    let grid = *volume.grid();
    let voxels = match basis {
        Interpolation::Nearest => density_cells,
        Interpolation::Trilinear => near_medium(&transport.density, &grid),
    };
    let part = Part::new(Quantity::Emission, grid, Arc::new(voxels), basis);
    let traversal = VolumeTraversal::new(transport, rays, vec![part]);
    // As the problem does: rays that meet nothing are no rows.
    let rows: Vec<usize> =
        (0..traversal.rays().len()).into_par_iter().filter(|&row| traversal.meets_elements(row)).collect();
    let traversal = traversal.along(traversal.rays().picked(&rows));
    let walk_free = clock.elapsed().as_secs_f64();
    let plan = WalkPlan::new::<f32, 1>(&traversal);
    let transport: Transport<_, f32, 1> = Transport::new(traversal, &plan, Strategy::Assembled, u64::MAX)?;
    let set_up = clock.elapsed().as_secs_f64();
    let storage = transport.storage();
    let (mut x, mut y) = (transport.domain(), transport.range());
    x.0.iter_mut().enumerate().for_each(|(i, x)| *x = [(i % 97) as f32, 1.0, 0.5]);
    let forward = median(|| transport.apply(&x, &mut y))?;
    let backward = median(|| transport.apply_adjoint(&y, &mut x))?;
    println!(
        "{name}: {} unknowns, {} non-zeros, {} MiB; set-up {:.3} s (before walking {:.3} s), forward {:.2} ms, backward {:.2} ms",
        x.0.len(),
        storage.kept_nonzeros,
        storage.bytes >> 20,
        set_up,
        walk_free,
        1e3 * forward,
        1e3 * backward
    );
    Ok(())
}

fn median(mut work: impl FnMut() -> unscatter::Result<()>) -> unscatter::Result<f64> {
    let mut seconds = Vec::with_capacity(TRIALS);
    for _ in 0..TRIALS {
        let clock = Instant::now();
        work()?;
        seconds.push(clock.elapsed().as_secs_f64());
    }
    seconds.sort_by(f64::total_cmp);
    Ok(seconds[TRIALS / 2])
}

/// A blob with waves on it, 18 % of the cube from −1 to 1, or dense everywhere.
fn volume(dense: bool) -> unscatter::Result<Volume> {
    let cube =
        DAffine3::from_scale_rotation_translation(DVec3::splat(2.0), glam::DQuat::IDENTITY, DVec3::NEG_ONE);
    let grid = VoxelGrid::over_cube([SIDE; 3], cube)?;
    let sigma_t = |index: usize| {
        let p = grid.centre(grid.voxel(index));
        if dense {
            return 0.5;
        }
        let waves = 0.4 * (7.0 * p.x).sin() * (9.0 * p.y).sin() * (8.0 * p.z).sin();
        6.0 * (1.0 - 2.0 * p.length_squared() + waves).max(0.0)
    };
    Volume::new(grid, 1, Samples::F32((0..grid.len()).map(|index| sigma_t(index) as f32).collect()))
}
