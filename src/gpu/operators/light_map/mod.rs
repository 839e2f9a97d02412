//! The traversal of a light map on the device: rays are walked anew in every application.

mod ray;

use std::sync::Arc;

use super::rays::Rays;
use super::rounds;
use super::walked::{Walked, WalkedPart};
use crate::Result;
use crate::gpu::device::Gpu;
use crate::gpu::kernels::layout::{LEVELS, LightMapUniform};
use crate::gpu::kernels::{Accumulation, LightMapWalk, Walk};
use crate::march::{LightMapTraversal, Traversal};
use crate::scene::Quadrature;
use ray::{Depths, ray};

impl Walked {
    /// Hands rays and shadow map of a light map over. `colored` media have one weight a channel; `deterministic` scatters give the
    /// same bits every time. What the rows show beside the texels along their rays is left to be added.
    ///
    /// Errors: [`crate::Error::AdapterMemory`], [`crate::Error::TooLarge`] for a shadow map that a kernel cannot see as a whole.
    pub fn light_map(
        gpu: &Gpu,
        traversal: &LightMapTraversal,
        colored: bool,
        deterministic: bool,
    ) -> Result<Self> {
        let shared = traversal.transport();
        let accumulation = gpu.accumulation(deterministic);
        rounds::check(
            gpu,
            || rounds_of_a_ray(traversal, accumulation),
            "lower the maps' sizes or the steps, choose the strategy `assembled`, or compute on the processor",
        )?;
        let depths = Depths::of(&shared.shadow_map);
        let rows = traversal.rays().len();
        let rays = Rays::new(gpu, rows, |row| {
            let ray = ray(traversal, &depths, row);
            let most = ray.strength.iter().copied().fold(0.0, f32::max);
            ([ray], f64::from(most))
        })?;
        let (depths, ranges, levels) = depths.pyramid(&shared.shadow_map);
        gpu.expect_visible(
            "the shadow map on the adapter",
            size_of_val(&depths[..]).max(size_of_val(&ranges[..])) as u64,
            "lower shadow_map.size, or compute on the processor",
        )?;
        let passed = vec![
            Arc::new(gpu.upload("the shadow map", &depths)?),
            Arc::new(gpu.upload("the shadow map", &ranges)?),
            Arc::new(gpu.upload("the transport", &[uniform(traversal, levels)])?),
        ];
        let walk = Walk::LightMap(LightMapWalk::new(shared.basis, shared.quadrature, colored));
        let elements = 0..Traversal::<f64, 1>::elements(traversal);
        Self::new(gpu, rows, vec![WalkedPart::new(walk, elements, passed, rays)], accumulation)
    }
}

/// Rounds of the loops of one ray at most.
fn rounds_of_a_ray(traversal: &LightMapTraversal, accumulation: Accumulation) -> usize {
    let shared = traversal.transport();
    let half_way = |size: [usize; 2]| size[0] + size[1];
    let steps = match shared.quadrature {
        Quadrature::Exact => half_way(shared.light_map.size),
        Quadrature::March { steps } => 3 * steps as usize,
    };
    let waits = if accumulation == Accumulation::Swap { 16 } else { 0 };
    (2 + waits) * steps + 3 * half_way(shared.shadow_map.grid().size)
}

fn uniform(traversal: &LightMapTraversal, levels: [[u32; 4]; LEVELS]) -> LightMapUniform {
    let shared = traversal.transport();
    let [r, g, b] = shared.sigma_t.map(|sigma| sigma as f32);
    LightMapUniform {
        sigma_t: [r, g, b, 0.0],
        light_size: shared.light_map.size.map(|side| side as i32),
        shadow_size: shared.shadow_map.grid().size.map(|side| side as i32),
        shadow_top: shared.shadow_map.top() as u32,
        steps: match shared.quadrature {
            Quadrature::Exact => 0,
            Quadrature::March { steps } => steps,
        },
        pad: [0; 2],
        levels,
    }
}
