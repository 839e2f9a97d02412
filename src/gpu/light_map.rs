//! The traversal of a light map on the device: rays are walked anew in every application.

use std::cell::RefCell;

use super::Gpu;
use super::fixed_point::{Accumulation, FixedSums};
use super::kernel::{Kernel, RAYS};
use super::layout::{LEVELS, Ray, Transport};
use super::memory::Allocation;
use super::pass::{Walking, walkings};
use super::ray::{Depths, ray};
use super::recorder::Binding;
use super::vector::{GpuVector, MOST_WORKGROUPS, Slab};
use super::walk::{Consumer, Walk};
use crate::march::LightMapTraversal;
use crate::operator::{LinearOperator, Vector, expect_len};
use crate::scene::Quadrature;
use crate::{Error, Result};

/// T of a light map, walked on the device.
///
/// Shapes  x: texels, y: rays, three channels each
/// Error   1e-5 relative to the explicit matrix in f64: rays are cut to the map in f64, and walked in f32 from there
/// Cost    one walk a row; scatters in f32 depend on the order in which rays arrive, those in fixed point do not
#[derive(Debug)]
pub struct Walked {
    gpu: Gpu,
    walk: Walk,
    rows: usize,
    elements: usize,
    accumulation: Accumulation,
    depths: Allocation,
    ranges: Allocation,
    transport: Allocation,
    /// The rays, slab by slab of the rows.
    rays: Vec<(usize, Allocation)>,
    /// Σ_k Σ_i w_ki at most, and the same of the squared row sums.
    row_sums: [f64; 2],
    fixed: Option<RefCell<FixedSums>>,
}

impl Walked {
    /// Hands rays and shadow map over. `colored` media have one weight a channel; `deterministic` scatters give the same bits
    /// every time.
    ///
    /// Errors: [`Error::AdapterMemory`], [`Error::TooLarge`] for a shadow map that a kernel cannot see as a whole.
    pub fn new(gpu: &Gpu, traversal: &LightMapTraversal, colored: bool, deterministic: bool) -> Result<Self> {
        let shared = traversal.transport();
        let walk = Walk::new(shared.basis, shared.quadrature, colored);
        let depths = Depths::of(&shared.shadow_map);
        let rays: Vec<Ray> = (0..traversal.rays().len()).map(|row| ray(traversal, &depths, row)).collect();
        let sum = |power: i32| -> f64 {
            let most = |ray: &Ray| ray.strength.iter().copied().fold(0.0, f32::max);
            rays.iter().map(|ray| f64::from(most(ray)).powi(power)).sum()
        };
        let (rows, elements) = (rays.len(), shared.light_map.len());
        let accumulation = gpu.accumulation(deterministic);
        check_rounds(gpu, traversal, accumulation)?;
        let fixed = match accumulation {
            Accumulation::Fixed => {
                Some(RefCell::new(FixedSums::new(gpu, elements, &GpuVector::zeros(gpu, rows))?))
            }
            Accumulation::Float | Accumulation::Swap => None,
        };
        let (depths, ranges, levels) = depths.pyramid(&shared.shadow_map);
        let bytes = size_of_val(&depths[..]).max(size_of_val(&ranges[..])) as u64;
        if bytes > gpu.binding_limit() {
            return Err(Error::TooLarge {
                what: "the shadow map on the adapter".to_owned(),
                needed: format!("{bytes} bytes"),
                limit: format!("{} bytes", gpu.binding_limit()),
                remedy: "lower shadow_map.size, or use --backend cpu",
            });
        }
        let at_once =
            (gpu.binding_limit() as usize / size_of::<Ray>()).min((MOST_WORKGROUPS * RAYS) as usize);
        // Slabs of y begin where bindings may.
        let at_once = (at_once / 64 * 64).max(64);
        let slab = |(index, rays): (usize, &[Ray])| Ok((index * at_once, gpu.upload("the rays", rays)?));
        Ok(Self {
            walk,
            rows,
            elements,
            accumulation,
            depths: gpu.upload("the shadow map", &depths)?,
            ranges: gpu.upload("the shadow map", &ranges)?,
            transport: gpu.upload("the transport", &[uniform(traversal, levels)])?,
            row_sums: [sum(1), sum(2)],
            rays: rays.chunks(at_once).enumerate().map(slab).collect::<Result<_>>()?,
            fixed,
            gpu: gpu.clone(),
        })
    }

    /// How sums are made where rays meet.
    pub fn accumulation(&self) -> Accumulation {
        self.accumulation
    }

    /// x ← diag(Tᵀ diag(y) T).
    ///
    /// Errors: [`Error::Shape`] when a vector does not fit, and what has gone wrong on the device.
    pub fn squares(&self, y: &GpuVector, x: &mut GpuVector) -> Result<()> {
        self.scatter(Consumer::Squares(self.accumulation), y, x, self.row_sums[1])
    }

    fn scatter(&self, consumer: Consumer, y: &GpuVector, x: &mut GpuVector, row_sums: f64) -> Result<()> {
        expect_len("x", x, self.elements)?;
        expect_len("y", y, self.rows)?;
        match &self.fixed {
            None => {
                x.fill([0.0; 3]);
                self.each_pass(consumer, &[y, x], |slab_of_y, slab_of_x| {
                    vec![y.binding(slab_of_y), x.binding(slab_of_x)]
                });
            }
            Some(fixed) => {
                let mut fixed = fixed.borrow_mut();
                fixed.begin(&self.gpu, y, row_sums);
                let [low, high] = &fixed.words;
                self.each_pass(consumer, &[y, x], |slab_of_y, slab_of_x| {
                    let words = [low.binding(slab_of_x), high.binding(slab_of_x)];
                    vec![y.binding(slab_of_y), words[0].clone(), words[1].clone(), fixed.scales.whole()]
                });
                x.finish_fixed(&fixed.words, &fixed.scales);
            }
        }
        self.gpu.check()
    }

    /// Records a consumer for every slab of rays, of y and of x.
    fn each_pass(
        &self,
        consumer: Consumer,
        vectors: &[&GpuVector; 2],
        bindings: impl Fn(Slab, Slab) -> Vec<Binding>,
    ) {
        let count = |rays: &Allocation| rays.buffer.size() as usize / size_of::<Ray>();
        let slabs: Vec<_> = self.rays.iter().map(|(first, rays)| (*first, count(rays))).collect();
        let shared = [self.depths.whole(), self.ranges.whole(), self.transport.whole()];
        for channels in GpuVector::channels(vectors) {
            let near = consumer != Consumer::Gather && self.gpu.sums_near();
            let kernel = Kernel::LightMap(consumer, Walk { channels: channels[1], near, ..self.walk });
            for Walking { slab, rows, of_y, of_x, pass } in walkings(&slabs, *vectors, channels) {
                let [offset, size] = [rows.start, rows.len()].map(|rows| (rows * size_of::<Ray>()) as u64);
                let walked = self.rays[slab].1.part(offset, size);
                let first_group = bindings(of_y, of_x);
                let groups: [&[Binding]; 3] = [&first_group, &shared, std::slice::from_ref(&walked)];
                self.gpu.dispatch(kernel, &pass, &groups, [pass.rows.div_ceil(RAYS), 1]);
            }
        }
    }
}

impl LinearOperator for Walked {
    type Domain = GpuVector;
    type Range = GpuVector;

    fn domain(&self) -> GpuVector {
        GpuVector::zeros(&self.gpu, self.elements)
    }

    fn range(&self) -> GpuVector {
        GpuVector::zeros(&self.gpu, self.rows)
    }

    fn apply(&self, x: &GpuVector, y: &mut GpuVector) -> Result<()> {
        expect_len("x", x, self.elements)?;
        expect_len("y", y, self.rows)?;
        let y = &*y;
        self.each_pass(Consumer::Gather, &[y, x], |slab_of_y, slab_of_x| {
            vec![y.binding(slab_of_y), x.binding(slab_of_x)]
        });
        self.gpu.check()
    }

    fn apply_adjoint(&self, y: &GpuVector, x: &mut GpuVector) -> Result<()> {
        self.scatter(Consumer::Scatter(self.accumulation), y, x, self.row_sums[0])
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
        remedy: "lower the maps' sizes or the steps, choose the strategy `assembled`, or use --backend cpu",
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
