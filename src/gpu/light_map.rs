//! The traversal of a light map on the device: rays are walked anew in every application.

use super::Gpu;
use super::fixed_point::Accumulation;
use super::kernel::{Kernel, RAYS};
use super::layout::{LEVELS, Ray, Transport};
use super::memory::Allocation;
use super::pace::Paces;
use super::pass::walkings;
use super::ray::{Depths, ray};
use super::recorder::Binding;
use super::vector::{GpuVector, Slab};
use super::walk::{Consumer, Walk};
use super::walked::{Rays, Walked};
use crate::march::{LightMapTraversal, Traversal};
use crate::scene::Quadrature;
use crate::{Error, Result};

/// Rays over a light map.
#[derive(Debug)]
struct LightMapRays {
    walk: Walk,
    rows: usize,
    elements: usize,
    depths: Allocation,
    ranges: Allocation,
    transport: Allocation,
    /// The rays, slab by slab of the rows.
    rays: Vec<(usize, Allocation)>,
    /// Σ_k Σ_i w_ki at most, and the same of the squared row sums.
    row_sums: [f64; 2],
    paces: Paces,
}

impl Walked {
    /// Hands rays and shadow map of a light map over. `colored` media have one weight a channel; `deterministic` scatters give the
    /// same bits every time. What the rows show beside the texels along their rays is left to be added.
    ///
    /// Errors: [`Error::AdapterMemory`], [`Error::TooLarge`] for a shadow map that a kernel cannot see as a whole.
    pub fn light_map(
        gpu: &Gpu,
        traversal: &LightMapTraversal,
        colored: bool,
        deterministic: bool,
    ) -> Result<Self> {
        let shared = traversal.transport();
        let walk = Walk::new(shared.basis, shared.quadrature, colored);
        let depths = Depths::of(&shared.shadow_map);
        let rays: Vec<Ray> = (0..traversal.rays().len()).map(|row| ray(traversal, &depths, row)).collect();
        let sum = |power: i32| -> f64 {
            let most = |ray: &Ray| ray.strength.iter().copied().fold(0.0, f32::max);
            rays.iter().map(|ray| f64::from(most(ray)).powi(power)).sum()
        };
        let (rows, elements) = (rays.len(), Traversal::<f64, 1>::elements(traversal));
        let accumulation = gpu.accumulation(deterministic);
        check_rounds(gpu, traversal, accumulation)?;
        let (depths, ranges, levels) = depths.pyramid(&shared.shadow_map);
        let bytes = size_of_val(&depths[..]).max(size_of_val(&ranges[..])) as u64;
        if bytes > gpu.binding_limit() {
            return Err(Error::TooLarge {
                what: "the shadow map on the adapter".to_owned(),
                needed: format!("{bytes} bytes"),
                limit: format!("{} bytes", gpu.binding_limit()),
                remedy: "lower shadow_map.size, or compute on the processor",
            });
        }
        let at_once = gpu.rays_at_once(size_of::<Ray>());
        let slab = |(index, rays): (usize, &[Ray])| Ok((index * at_once, gpu.upload("the rays", rays)?));
        let rays = LightMapRays {
            walk,
            rows,
            elements,
            depths: gpu.upload("the shadow map", &depths)?,
            ranges: gpu.upload("the shadow map", &ranges)?,
            transport: gpu.upload("the transport", &[uniform(traversal, levels)])?,
            row_sums: [sum(1), sum(2)],
            paces: Paces::default(),
            rays: rays.chunks(at_once).enumerate().map(slab).collect::<Result<_>>()?,
        };
        Self::new(gpu, rays, accumulation)
    }
}

impl Rays for LightMapRays {
    fn shape(&self) -> [usize; 2] {
        [self.rows, self.elements]
    }

    fn row_sums(&self, power: usize) -> f64 {
        self.row_sums[power - 1]
    }

    fn record(
        &self,
        gpu: &Gpu,
        consumer: Consumer,
        vectors: [&GpuVector; 2],
        bindings: &dyn Fn(Slab, Slab) -> Vec<Binding>,
    ) {
        let count = |rays: &Allocation| rays.buffer.size() as usize / size_of::<Ray>();
        let slabs: Vec<_> = self.rays.iter().map(|(first, rays)| (*first, count(rays))).collect();
        let shared = [self.depths.whole(), self.ranges.whole(), self.transport.whole()];
        for channels in GpuVector::channels(&vectors) {
            let near = consumer != Consumer::Gather && gpu.sums_near();
            let kernel = Kernel::LightMap(consumer, Walk { channels: channels[1], near, ..self.walk });
            for walking in walkings(&slabs, vectors, channels) {
                let first_group = bindings(walking.of_y, walking.of_x);
                self.paces.of(consumer)(gpu, walking.rows.len(), &mut |rows| {
                    let (rows, pass) = walking.narrowed(&rows);
                    let [offset, size] =
                        [rows.start, rows.len()].map(|rows| (rows * size_of::<Ray>()) as u64);
                    let walked = self.rays[walking.slab].1.part(offset, size);
                    let groups: [&[Binding]; 3] = [&first_group, &shared, std::slice::from_ref(&walked)];
                    gpu.dispatch(kernel, &pass, &groups, [pass.rows.div_ceil(RAYS), 1, 1]);
                });
            }
        }
    }
}

/// Whether the loops of one ray end by themselves: Mesa's software adapter counts the rounds of all loops of an
/// invocation, and leaves them in silence after 65535.
///
/// Errors: [`Error::TooLarge`].
fn check_rounds(gpu: &Gpu, traversal: &LightMapTraversal, accumulation: Accumulation) -> Result<()> {
    const ROUNDS: usize = 60_000;
    if gpu.record().is_hardware() {
        return Ok(());
    }
    let shared = traversal.transport();
    let half_way = |size: [usize; 2]| size[0] + size[1];
    let steps = match shared.quadrature {
        Quadrature::Exact => half_way(shared.light_map.size),
        Quadrature::March { steps } => 3 * steps as usize,
    };
    let waits = if accumulation == Accumulation::Swap { 16 } else { 0 };
    let needed = (2 + waits) * steps + 3 * half_way(shared.shadow_map.grid().size);
    if needed <= ROUNDS {
        return Ok(());
    }
    Err(Error::TooLarge {
        what: "a ray on a software adapter".to_owned(),
        needed: format!("{needed} rounds of its loops"),
        limit: ROUNDS.to_string(),
        remedy: "lower the maps' sizes or the steps, choose the strategy `assembled`, or compute on the processor",
    })
}

fn uniform(traversal: &LightMapTraversal, levels: [[u32; 4]; LEVELS]) -> Transport {
    let shared = traversal.transport();
    let [r, g, b] = shared.sigma_t.map(|sigma| sigma as f32);
    Transport {
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
