//! The traversal of a light map on the device: rays are walked anew in every application.

use std::cell::RefCell;

use bytemuck::Zeroable;
use glam::DVec2;

use super::Gpu;
use super::device::Allocation;
use super::fixed_point::{Accumulation, FixedSums};
use super::kernel::{Consumer, Kernel, RAYS, Walk};
use super::layout::{LEVELS, Pass, Ray, Transport};
use super::recorder::Binding;
use super::vector::{GpuVector, MOST_WORKGROUPS, Slab};
use crate::march::LightMapTraversal;
use crate::operator::{LinearOperator, Vector, expect_len};
use crate::scene::{Quadrature, ShadowMap};
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
        let walk = Walk::new(shared.basis, shared.quadrature, colored, 3);
        let rays: Vec<Ray> = (0..traversal.rays().len()).map(|row| ray(traversal, row)).collect();
        let sum = |power: i32| -> f64 {
            let most = |ray: &Ray| ray.strength.iter().copied().fold(0.0, f32::max);
            rays.iter().map(|ray| f64::from(most(ray)).powi(power)).sum()
        };
        let (rows, elements) = (rays.len(), shared.light_map.len());
        let accumulation = gpu.accumulation(deterministic);
        let fixed = match accumulation {
            Accumulation::Fixed => {
                Some(RefCell::new(FixedSums::new(gpu, elements, &GpuVector::zeros(gpu, rows))?))
            }
            Accumulation::Float | Accumulation::Swap => None,
        };
        let (depths, ranges, levels) = pyramid(&shared.shadow_map);
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
                self.each_pass(consumer, &[y, x], x, |slab_of_y, slab_of_x| {
                    vec![y.binding(slab_of_y), x.binding(slab_of_x)]
                });
            }
            Some(fixed) => {
                let mut fixed = fixed.borrow_mut();
                fixed.begin(&self.gpu, y, row_sums);
                let [low, high] = &fixed.words;
                self.each_pass(consumer, &[y, x], x, |slab_of_y, slab_of_x| {
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
        x: &GpuVector,
        bindings: impl Fn(Slab, Slab) -> Vec<Binding>,
    ) {
        let y = vectors[0];
        let shared = [self.depths.whole(), self.ranges.whole(), self.transport.whole()];
        for channels in GpuVector::channels(vectors) {
            let kernel = Kernel::LightMap(consumer, Walk { channels: channels[1], ..self.walk });
            for (first, rays) in &self.rays {
                let count = rays.buffer.size() as usize / size_of::<Ray>();
                for slab_of_y in y.slabs(channels) {
                    // Slabs of rays and of y are cut at the same rows, or y is in one piece.
                    let begin = (*first).max(slab_of_y.first);
                    let end = (first + count).min(slab_of_y.first + slab_of_y.len);
                    if begin >= end {
                        continue;
                    }
                    let offset = ((begin - first) * size_of::<Ray>()) as u64;
                    let walked = rays.part(offset, ((end - begin) * size_of::<Ray>()) as u64);
                    for (again, slab_of_x) in (0u32..).zip(x.slabs(channels)) {
                        let pass = Pass {
                            rows: (end - begin) as u32,
                            y_first: (begin - slab_of_y.first) as u32,
                            y_stride: y.stride as u32,
                            channel: channels[0],
                            x_first: slab_of_x.first as u32,
                            x_len: slab_of_x.len as u32,
                            x_stride: x.stride as u32,
                            again,
                        };
                        let first_group = bindings(slab_of_y, slab_of_x);
                        let workgroups = [pass.rows.div_ceil(RAYS), 1];
                        let groups: [&[Binding]; 3] = [&first_group, &shared, std::slice::from_ref(&walked)];
                        self.gpu.dispatch(kernel, &pass, &groups, workgroups);
                    }
                }
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
        self.each_pass(Consumer::Gather, &[y, x], x, |slab_of_y, slab_of_x| {
            vec![y.binding(slab_of_y), x.binding(slab_of_x)]
        });
        self.gpu.check()
    }

    fn apply_adjoint(&self, y: &GpuVector, x: &mut GpuVector) -> Result<()> {
        self.scatter(Consumer::Scatter(self.accumulation), y, x, self.row_sums[0])
    }
}

/// A row as the kernel walks it: cut to the light map in f64, and measured from there.
fn ray(traversal: &LightMapTraversal, row: usize) -> Ray {
    let shared = traversal.transport();
    let Some([enter, leave]) = traversal.over_the_map(row) else { return Ray::zeroed() };
    let view = &traversal.rays()[row];
    let point = view.origin + enter * view.direction;
    let [direction, entry] = [view.direction, point].map(|v| DVec2::new(v.x, v.y));
    let length = leave - enter;
    let [shadow_enter, shadow_leave] = traversal
        .over_the_shadow_map(row, enter, leave)
        .map_or([length; 2], |clip| clip.map(|t| (t - enter).clamp(0.0, length)));
    let strength: [f64; 3] = std::array::from_fn(|c| view.scattering[c] * (-shared.sigma_t[c] * enter).exp());
    let pair = |v: DVec2| [v.x as f32, v.y as f32];
    let shadow_map = &shared.shadow_map;
    Ray {
        entry: pair(shared.light_map.grid_from_light(entry)),
        slope: pair(direction * shared.light_map.density()),
        shadow_entry: pair(shadow_map.grid().grid_from_light(entry)),
        shadow_clip: [shadow_enter as f32, shadow_leave as f32],
        depth: (point.z - shadow_map.depth_origin()) as f32,
        depth_slope: view.direction.z as f32,
        length: length as f32,
        before: enter as f32,
        strength: [strength[0] as f32, strength[1] as f32, strength[2] as f32, 0.0],
    }
}

fn uniform(traversal: &LightMapTraversal, levels: [[u32; 4]; LEVELS]) -> Transport {
    let shared = traversal.transport();
    let [r, g, b] = shared.sigma_t.map(|sigma| sigma as f32);
    let shadow = shared.shadow_map.grid();
    let ratio = shadow.density() / shared.light_map.density();
    Transport {
        sigma_t: [r, g, b, 0.0],
        light_size: shared.light_map.size.map(|side| side as i32),
        shadow_size: shadow.size.map(|side| side as i32),
        shadow_from_light: [ratio.x as f32, ratio.y as f32],
        shadow_top: shared.shadow_map.top() as u32,
        steps: match shared.quadrature {
            Quadrature::Exact => 0,
            Quadrature::March { steps } => steps,
        },
        levels,
    }
}

/// The depths, the ranges of the nodes above them, and where each level begins among those and how wide it is.
fn pyramid(map: &ShadowMap) -> (Vec<f32>, Vec<[f32; 2]>, [[u32; 4]; LEVELS]) {
    // Kernels have no infinity; the largest number is as far.
    let far = |z: f32| z.clamp(f32::MIN, f32::MAX);
    let [mut width, mut height] = map.grid().size;
    let depths = (0..width * height).map(|k| far(map.depth(k % width, k / width))).collect();
    let (mut ranges, mut levels) = (Vec::new(), [[0; 4]; LEVELS]);
    for level in 1..=map.top() {
        (width, height) = (width.div_ceil(2), height.div_ceil(2));
        levels[level] = [ranges.len() as u32, width as u32, height as u32, 0];
        ranges.extend((0..width * height).map(|k| map.range(level, k % width, k / width).map(far)));
    }
    if ranges.is_empty() {
        ranges.push([0.0; 2]);
    }
    (depths, ranges, levels)
}
