//! The traversal of a light map on the device: rays are walked anew in every application.

mod ray;

use std::sync::Arc;

use super::rays::Rays;
use super::rounds;
use super::walked::{Walked, WalkedPart};
use crate::Result;
use crate::gpu::device::{Allocation, Gpu};
use crate::gpu::kernels::layout::{LEVELS, LightMapUniform};
use crate::gpu::kernels::{Accumulation, LightMapWalk, Walk};
use crate::march::{LightMapTraversal, Traversal};
use crate::operator::RowOrder;
use crate::scene::Quadrature;
use crate::visibility::ShadowMap;
use ray::{Depths, ray};

/// The depths of a shadow map on an adapter, and the ranges of the nodes above them.
#[derive(Debug)]
pub struct DepthPyramid {
    depths: Depths,
    memory: [Arc<Allocation>; 2],
    levels: [[u32; 4]; LEVELS],
}

impl DepthPyramid {
    /// Hands it over.
    ///
    /// Errors: [`crate::Error::AdapterMemory`], [`crate::Error::TooLarge`] for one that a kernel cannot see as a whole.
    pub fn new(gpu: &Gpu, map: &ShadowMap) -> Result<Self> {
        let depths = Depths::of(map);
        let (texels, nodes, levels) = depths.pyramid(map);
        gpu.expect_visible(
            "the shadow map on the adapter",
            size_of_val(&texels[..]).max(size_of_val(&nodes[..])) as u64,
            "lower shadow_map.size, or compute on the processor",
        )?;
        let memory = [
            Arc::new(gpu.upload("the shadow map", &texels)?),
            Arc::new(gpu.upload("the shadow map", &nodes)?),
        ];
        Ok(Self { depths, memory, levels })
    }
}

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
        let pyramid = DepthPyramid::new(gpu, &traversal.transport().shadow_map)?;
        let order = RowOrder::new(Traversal::<f64, 1>::row_order(traversal));
        Self::through(gpu, &pyramid, (traversal, &order), colored, deterministic)
    }

    /// The same for rows of pixels that are gathered once, where the depths of the shadow map have been handed over already. They are
    /// walked as they come: to sort them takes longer.
    ///
    /// Errors: [`crate::Error::AdapterMemory`], [`crate::Error::TooLarge`] for rays whose loops would not end by themselves.
    pub fn pixels_of_light_map(
        gpu: &Gpu,
        pyramid: &DepthPyramid,
        traversal: &LightMapTraversal,
        colored: bool,
    ) -> Result<Self> {
        Self::through(gpu, pyramid, (traversal, &RowOrder::default()), colored, false)
    }

    fn through(
        gpu: &Gpu,
        pyramid: &DepthPyramid,
        (traversal, order): (&LightMapTraversal, &RowOrder),
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
        let rows = traversal.rays().len();
        let rays = Rays::new(gpu, rows, |position| {
            let ray = ray(traversal, &pyramid.depths, order.row(position));
            let most = ray.strength.iter().copied().fold(0.0, f32::max);
            ([ray], f64::from(most))
        })?;
        let uniform = uniform(traversal, pyramid.levels);
        let [texels, nodes] = pyramid.memory.clone();
        let passed = vec![texels, nodes, Arc::new(gpu.upload("the transport", &[uniform])?)];
        let walk = Walk::LightMap(LightMapWalk::new(shared.basis, shared.quadrature, colored));
        let elements = 0..Traversal::<f64, 1>::elements(traversal);
        Self::new(gpu, (rows, order), vec![WalkedPart::new(walk, elements, passed, rays)], accumulation)
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
